"""Variable projection against a general fit."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from jshell.signals.damped_pair import fit

TIMES = 0.1 * np.arange(300)


def ring(times, offset, a, b, c, d, slow, fast, tau):
    decay = np.exp(-times / tau)
    return offset + decay * (
        a * np.cos(slow * times) + b * np.sin(slow * times) + c * np.cos(fast * times) + d * np.sin(fast * times)
    )


TRUTH = (2.9, 0.1, 0.02, -0.03, 0.05, 1.05, 1.76, 8.0)


def test_a_noise_free_pair_is_found_exactly():
    found = fit(TIMES, ring(TIMES, *TRUTH)[None], np.array([[0.9, 2.0, 0.2], [0.5, 1.1, 0.1]]))
    assert found.converged
    # the search stops when nothing changes by 1e-11
    np.testing.assert_allclose([*found.Omega, found.tau], TRUTH[-3:], rtol=1e-8)
    assert found.offset[0] == pytest.approx(TRUTH[0], rel=1e-9)
    assert found.residual < 1e-9


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_fit_equals_scipy_curve_fit_with_its_errors(seed):
    values = ring(TIMES, *TRUTH) + 0.01 * np.random.default_rng(seed).normal(size=TIMES.size)
    wanted, covariance = curve_fit(ring, TIMES, values, p0=TRUTH, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = fit(TIMES, values[None], np.array([[1.0, 1.7, 0.1]]))
    np.testing.assert_allclose([*found.Omega, found.tau], wanted[-3:], rtol=1e-6)
    # same linearised errors: projection leaves the covariance of what remains unchanged
    assert found.errors[-1] == pytest.approx(np.sqrt(covariance[-1, -1]), rel=1e-3)


def test_two_channels_share_what_each_alone_scatters_about():
    rng = np.random.default_rng(0)
    second = (1.3, 0.2, 0.1, 0.01, 0.02, 1.05, 1.76, 8.0)
    values = np.stack([ring(TIMES, *TRUTH), ring(TIMES, *second)]) + 0.002 * rng.normal(size=(2, TIMES.size))
    joint = fit(TIMES, values, np.array([[1.0, 1.7, 0.1]]))
    np.testing.assert_allclose(joint.Omega, [1.05, 1.76], atol=0.01)
    np.testing.assert_allclose(joint.offset, [2.9, 1.3], atol=1e-3)


def test_padding_changes_nothing():
    # 300 samples are padded to 512; the same record cut to 256 needs none
    values = ring(TIMES, *TRUTH)
    whole = fit(TIMES, values[None], np.array([[1.0, 1.7, 0.1]]))
    short = fit(TIMES[:256], values[None, :256], np.array([[1.0, 1.7, 0.1]]))
    np.testing.assert_allclose(whole.omega, short.omega, rtol=1e-8)

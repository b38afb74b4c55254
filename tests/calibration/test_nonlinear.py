"""Nonlinear fits: constants recovered within their errors, by both integrators alike."""

import dataclasses

import numpy as np
import pytest

from jshell.calibration.nonlinear import fit_nonlinear
from jshell.errors import BadName, BadShape, BadValue, Outcome
from jshell.oscillator import add_noise, drive, random_shell
from jshell.trace import Trace

pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
TIMES = np.linspace(0.0, 40.0, 400)


def _noisy(seed, times=TIMES):
    """A large motion of a random shell by an adaptive solver, with 1 % noise."""
    s = random_shell(seed)
    run = drive(s.conditions, s.coefficients, times=times, initial=tuple(s.initial), equilibrium=s.state, budget=False)
    channels = {"V": run.motion.V, "S": run.motion.S}
    c = s.coefficients
    return add_noise(Trace(times, channels, s.conditions), 0.01, seed), [c.alpha1, c.alpha2, c.k_vs, c.beta1]


@pytest.fixture(scope="module")
def traces():
    return [_noisy(seed) for seed in range(4)]


@pytest.fixture(scope="module")
def fits(traces):
    return fit_nonlinear([trace for trace, _ in traces])


@pytest.mark.long
def test_constants_are_found_within_four_standard_errors(traces, fits):
    truth = np.array([constants for _, constants in traces])
    assert all(outcome == Outcome.OK for outcome in fits.outcome)
    assert np.all(np.abs(fits.constants - truth) < 4 * fits.stderr)
    assert np.all(fits.stderr < 0.1)


@pytest.mark.slow
def test_both_integrators_find_the_same(traces, fits):
    other = fit_nonlinear([trace for trace, _ in traces], solver="diffrax")
    # the fixed step of 0.03 leaves 1e-5 of the motion, a hundredth of a standard error
    assert np.all(np.abs(other.constants - fits.constants) < 0.02 * fits.stderr)
    np.testing.assert_allclose(other.stderr, fits.stderr, rtol=1e-2)


@pytest.mark.slow
def test_a_hundred_random_shells():
    listed = [_noisy(seed) for seed in range(100)]
    found = fit_nonlinear([trace for trace, _ in listed])
    assert all(outcome == Outcome.OK for outcome in found.outcome)
    distance = np.abs(found.constants - np.array([constants for _, constants in listed])) / found.stderr
    # of 400 normal deviates the largest exceeds 4 in one draw of forty
    assert np.sort(distance.ravel())[-2] < 4
    assert distance.max() < 5


@pytest.mark.long
def test_a_hopeless_trace_beside_good_ones_says_so(traces, fits):
    flat = Trace(TIMES, {"V": np.linspace(2.9, 2.90001, 400), "S": np.full(400, 12.5)}, traces[0][0].conditions)
    found = fit_nonlinear([trace for trace, _ in traces[:3]] + [flat])
    assert found.outcome[3] != Outcome.OK
    assert np.all(np.isnan(found.constants[3]))
    np.testing.assert_allclose(found.constants[:3], fits.constants[:3], rtol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("solver", ["rk4", pytest.param("diffrax", marks=pytest.mark.slow)])
def test_samples_of_hardly_any_weight_are_as_if_left_out(traces, solver):
    trace = traces[0][0]
    half = trace.between(0, 20)
    size = {"V": 0.01, "S": 0.02}
    rough = {name: np.where(TIMES <= 20, s, 1e6 * s) for name, s in size.items()}
    found = fit_nonlinear(dataclasses.replace(trace, sigma=rough), solver=solver)
    wanted = fit_nonlinear(dataclasses.replace(half, sigma={n: np.full(half.times.shape, s) for n, s in size.items()}),
                           solver=solver)  # fmt: skip
    # the last step leaves a hundredth of a standard error
    assert np.all(np.abs(found.constants - wanted.constants) < 0.02 * wanted.stderr)
    np.testing.assert_allclose(found.stderr, wanted.stderr, rtol=1e-2)
    assert found.chi_square == pytest.approx(wanted.chi_square, rel=1e-5)


@pytest.mark.parametrize("partly", ["channel", "trace"])
def test_sigma_of_some_is_refused(partly):
    channels = {"V": np.linspace(2.8, 2.9, 400), "S": np.full(400, 12.5)}
    bare = Trace(TIMES, channels, random_shell(0).conditions)
    sigma = {name: np.full(400, 0.01) for name in ("VS" if partly == "trace" else "V")}
    with pytest.raises(BadValue, match="σ for some"):
        fit_nonlinear([dataclasses.replace(bare, sigma=sigma), *([bare] if partly == "trace" else [])])


def test_a_sample_that_is_no_number_is_named():
    values = np.where(np.arange(400) == 7, np.nan, 2.8)
    with pytest.raises(BadValue, match=r"channel 'V', sample 8 .*Cut"):
        fit_nonlinear(Trace(TIMES, {"V": values, "S": np.full(400, 12.5)}, random_shell(0).conditions))


@pytest.mark.long
def test_wrong_requests_are_refused(traces):
    trace = traces[0][0]
    with pytest.raises(BadName, match="solver"):
        fit_nonlinear(trace, solver="magic")
    with pytest.raises(BadValue, match="trace 1"):
        fit_nonlinear(Trace(TIMES, trace.channels))
    with pytest.raises(BadShape, match="trace 2"):
        fit_nonlinear([trace, trace.between(0, 20)])

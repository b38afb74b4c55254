"""Nonlinear fits: constants recovered within their errors, by both integrators alike."""

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
def test_wrong_requests_are_refused(traces):
    trace = traces[0][0]
    with pytest.raises(BadName, match="solver"):
        fit_nonlinear(trace, solver="magic")
    with pytest.raises(BadValue, match="trace 1"):
        fit_nonlinear(Trace(TIMES, trace.channels))
    with pytest.raises(BadShape, match="trace 2"):
        fit_nonlinear([trace, trace.between(0, 20)])

"""Shells from thin to thick, spheres about any rest volume, and two hundred at random."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jshell as js
from jshell.contour import clearance, regrade
from jshell.dynamics import NO_LOSSES, record, simulate, swell
from jshell.errors import Outcome
from jshell.membrane import buckling_eigenvalue, plateau_pressure, rest
from jshell.shell.sphere import sphere_frequency_at_load
from jshell.signals import extract

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")]


def above_the_eigenvalue(d, ratio=0.7, excess=1.02):
    """Gas and outer pressure such that the dimple rests at V/V0 = ratio, 2 % above the eigenvalue's outer pressure."""
    first = buckling_eigenvalue(d)
    plateau = float(plateau_pressure(d, law="solver", volume_ratio=ratio))

    def missing(gas):
        threshold = gas * float(first.volume_ratio) ** -1.4 + float(first.difference)
        return excess * threshold - (gas * ratio**-1.4 + plateau)

    gas = brentq(missing, 1e-6, 50)
    return gas, gas * ratio**-1.4 + plateau


@pytest.mark.parametrize("d", [0.04, 0.08, 0.15, 0.3])
def test_a_shell_of_any_thickness_snaps_and_its_frequencies_are_converged(d):
    gas, outer = above_the_eigenvalue(d)
    problem = js.Reduced(d, gas, outer, 0.004)
    coarse = simulate(problem, follow=True, duration=80.0)
    fine = simulate(problem, elements=48, step=1 / 120, follow=True, duration=80.0)
    assert int(coarse.outcome) == int(fine.outcome) == Outcome.OK
    assert float(coarse["V"][-1]) / (4 * np.pi / 3) == pytest.approx(0.7, abs=0.02)
    heard = [extract(trace) for trace in (coarse, fine)]
    assert heard[0].omega_minus == pytest.approx(heard[1].omega_minus, rel=5e-3)
    assert heard[0].omega_plus == pytest.approx(heard[1].omega_plus, rel=5e-3)


@pytest.mark.parametrize("d", [0.02, 0.04, 0.08, 0.15, 0.3])
def test_modes_of_a_shell_of_any_thickness_are_converged(d):
    gas, outer = above_the_eigenvalue(d)
    problem = js.Reduced(d, gas, outer, 0.004)
    coarse, fine = (js.dynamics.modes(problem, elements=n, count=2) for n in (32, 48))
    assert np.all(np.asarray(coarse.outcome) == Outcome.OK)
    np.testing.assert_allclose(coarse.omega, fine.omega, rtol=5e-3)


# the source's three families: gas pressure, thickness, and outer pressure vary
SPHERES = [(0.22, 0.9, 0.95), (0.22, 3.0, 3.1), (0.1, 0.9, 0.95), (0.3, 0.9, 1.0), (0.22, 0.9, 1.1), (0.22, 0.9, 0.7)]


@pytest.mark.parametrize(("d", "gas", "outer"), SPHERES)
def test_a_breathing_sphere_has_the_frequency_of_eq_wsphere(d, gas, outer):
    problem = js.Reduced(d, gas, outer)
    found = rest(problem, branch="sphere", elements=16)
    trace = simulate(problem, start=found, velocity=swell(found, 1e-3), duration=6.0, losses=NO_LOSSES)
    t, V = np.asarray(trace.times), np.asarray(trace["V"])
    V = V - float(found.volume)
    rises = np.flatnonzero((V[:-1] < 0) & (V[1:] >= 0))
    crossings = t[rises] - V[rises] * (t[1] - t[0]) / (V[rises + 1] - V[rises])
    # the first crossing is the start itself, where V rises from rest
    period = (crossings[-1] - 0.0) / len(crossings)
    assert 2 * np.pi / period == pytest.approx(float(sphere_frequency_at_load(problem)), rel=3e-3)


@eqx.filter_jit
def room_of(shape, nodes, coordinates, thickness):
    """(samples,) least free space between places of the wall that face each other."""
    one = lambda given: clearance(regrade(shape, given[0]), given[1], thickness)  # noqa: E731
    return jax.lax.map(one, (nodes, coordinates))


def test_nothing_returned_as_ok_is_not_finite_or_passes_through_itself():
    ends = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        d, gas, eta = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in ((0.04, 0.3), (0.2, 5.0), (1e-4, 1.0)))
        outer = float(rng.uniform(0.9, 1.3)) * (gas + 4 * d / 3)
        motion = record(js.Reduced(d, gas, outer, eta), elements=24, step=1 / 40, duration=50.0, follow=True)
        trace, shape = motion.trace, motion.setup.shape
        outcome = Outcome(int(trace.outcome))
        if outcome == Outcome.OK:
            thickness = jnp.full(shape.at_points(motion.coordinates[0]).x.shape, d)
            assert np.min(np.asarray(room_of(shape, motion.nodes, motion.coordinates, thickness))) > 0, seed
        assert all(np.all(np.isfinite(np.asarray(trace[name]))) for name in trace.channels), seed
        assert outcome in (Outcome.OK, Outcome.CONTACT, Outcome.MESH), seed
        ends.append(outcome)
    assert ends.count(Outcome.OK) > 150

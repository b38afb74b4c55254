"""Buckling and unbuckling in time, response curves, bifurcations, softening, ensembles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName, BadValue, Outcome
from jshell.oscillator import (
    SOURCE,
    Drag,
    RaisedCosine,
    bifurcation,
    crossing,
    matrices,
    random_shell,
    response_curve,
    simulate,
    simulate_regimes,
    softening,
    thresholds,
)
from jshell.oscillator.ensemble import trace_jacobian, traces
from jshell.shell.rest import buckled_state, sphere_state
from jshell.shell.sphere import buckling_load
from jshell.shell.unbuckling import unbuckling_load, unbuckling_volume

DECAY = Drag("equal_decay", tau=jnp.asarray(8.0))


@pytest.mark.slow
def test_a_slow_cycle_of_the_pressure_closes_and_turns_at_the_printed_loads(shell, constants):
    period = 1500.0
    times = np.linspace(0.0, 2 * period, 2001)
    rest = float(shell.outer_pressure)
    swing = RaisedCosine(0.80 - rest, 1.30 - rest, period)
    trajectory = simulate_regimes(shell, constants, swing, times=times, drag=DECAY)
    assert trajectory.outcome == Outcome.OK
    assert [switch.buckles for switch in trajectory.switches] == [True, False, True, False]
    V = np.asarray(trajectory.trace["V"])
    np.testing.assert_allclose(V[1000:], V[:1001], atol=1e-6)
    at = trajectory.thresholds
    # the pressure still creeps at a switch, and ringing reaches the limit a little early
    assert trajectory.switches[0].outer_pressure == pytest.approx(at.buckling_pressure, rel=1e-3)
    assert trajectory.switches[1].outer_pressure == pytest.approx(at.unbuckling_pressure, rel=2e-3)
    assert trajectory.accepted > 1000
    assert trajectory.rejected > 0


def test_the_loads_of_the_hysteresis_are_those_of_the_rest_states(shell, constants):
    at = thresholds(shell, constants)
    assert at.buckling_pressure == pytest.approx(float(buckling_load(shell)), rel=1e-12)
    assert at.unbuckling_pressure < at.buckling_pressure
    # without coupling the wall is the plateau alone: the branches meet where the plateau law says
    plain = type(constants)(constants.alpha1, constants.alpha2, jnp.asarray(0.0))
    assert thresholds(shell, plain).unbuckling_pressure == pytest.approx(float(unbuckling_load(shell)), rel=1e-12)
    # with it too the two rest states share their volume at the printed load
    met = type(shell)(shell.thickness, shell.gas_pressure, jnp.asarray(at.unbuckling_pressure))
    assert float(sphere_state(met).volume) == pytest.approx(at.unbuckling_volume, rel=1e-10)
    V = unbuckling_volume(shell)
    met = type(shell)(shell.thickness, shell.gas_pressure, unbuckling_load(shell))
    assert float(buckled_state(met).volume) == pytest.approx(float(V), rel=1e-10)


def test_a_wrong_beginning_is_refused(shell, constants):
    with pytest.raises(BadName, match="begin"):
        simulate_regimes(shell, constants, lambda t: 0.0, times=np.linspace(0, 1, 3), begin="cube")


@pytest.mark.long
def test_a_small_tone_answers_as_the_linear_model_says(shell, constants):
    w = np.linspace(0.6, 1.6, 6)
    size = 1e-5
    curve = response_curve(shell, constants, size, w)
    system = matrices(constants, buckled_state(shell), shell)
    exact = [
        abs(np.linalg.solve(system.stiffness + 1j * x * system.damping - x**2 * system.mass, [size, 0])[0]) for x in w
    ]
    assert np.all(np.asarray(curve.outcome) == Outcome.OK)
    # quadratic terms enter at 1e-5 of the answer, the fixed step at 1e-7
    np.testing.assert_allclose(curve.harmonics[:, 1], exact, rtol=1e-4)
    np.testing.assert_allclose(curve.scattered[:, 1], np.asarray(curve.harmonics[:, 1]) * w**2 / (4 * np.pi), rtol=1e-3)
    # the area of a damped cycle shrinks by exp(-2 (1/τ1 + 1/τ2) T) in four dimensions, so the largest is below 1
    assert np.all(np.asarray(curve.multiplier) < 1)


def test_a_bifurcation_agrees_with_shooting_and_flags_what_unbuckles(shell, constants):
    w = 1.1
    found = bifurcation(shell, constants, [1e-3, 0.03, 2.0], w, periods=60, keep=20, drag=DECAY)
    assert [Outcome(int(o)) for o in found.outcome] == [Outcome.OK, Outcome.OK, Outcome.NO_BUCKLED_STATE]
    assert list(np.asarray(found.period)) == [1, 1, 0]
    assert np.all(np.isnan(np.asarray(found.volume[:, 2])))
    # once a period, at zero phase, the strobe sees Im of the complex amplitude; 1e-3 is no small motion's error here
    system = matrices(constants, buckled_state(shell), shell)
    damping = 2 / 8.0 * system.mass
    linear = np.linalg.solve(system.stiffness + 1j * w * damping - w**2 * system.mass, [-1e-3, 0])[0]
    assert float(found.volume[-1, 0]) == pytest.approx(float(np.imag(linear)), rel=1e-2)
    with pytest.raises(BadValue, match="kept"):
        bifurcation(shell, constants, [0.1], w, periods=5, keep=9)


@pytest.mark.long
def test_softening_of_the_source_and_its_curve():
    found = softening(0.02, 0.4, SOURCE)
    ratios = [float(found.slow), float(found.fast), float(found.marmottant)]
    np.testing.assert_allclose(ratios, [4.53, 2.51, 1.76], atol=0.005)
    rows = softening(np.array([[0.02, 0.1]]), np.array([[0.4], [0.9]]), SOURCE)
    assert rows.slow.shape == (2, 2)
    assert float(rows.slow[0, 0]) == pytest.approx(ratios[0], rel=1e-12)
    load = float(found.load)
    curve = crossing(0.02, 0.4, SOURCE, np.array([0.41, load * (1 - 1e-9), load * (1 + 1e-9), 0.6]))
    assert float(curve.sphere[1] / curve.slow[2]) == pytest.approx(ratios[0], rel=1e-6)
    assert np.isnan(float(curve.slow[1]))
    assert np.isnan(float(curve.sphere[2]))


SHELLS = [random_shell(seed) for seed in range(3)]


def _stacked():
    stack = lambda *leaves: jnp.stack([jnp.asarray(x, float) for x in leaves])  # noqa: E731
    parts = [(s.conditions, s.coefficients, s.state) for s in SHELLS]
    return jax.tree.map(stack, *parts)


def test_many_traces_at_once_are_the_exact_ones():
    initial = jnp.stack([jnp.asarray(s.initial) for s in SHELLS], axis=1)
    found = traces(*_stacked(), initial, 0.1, 400)
    for i, s in enumerate(SHELLS):
        one = simulate(s.conditions, s.coefficients, initial=s.initial, times=np.arange(400) * 0.1, equilibrium=s.state)
        np.testing.assert_allclose(found.volume[:, i] + s.state.volume, one["V"], atol=1e-12)
        np.testing.assert_allclose(found.area[:, i] + 4 * np.pi, one["S"], atol=1e-12)


def test_the_jacobian_of_a_trace_is_that_of_its_differences():
    s = SHELLS[0]
    c = s.coefficients
    state = jax.tree.map(jnp.asarray, s.state)
    x = np.array([c.alpha1, c.alpha2, c.k_vs, c.beta1, *s.initial])

    def motion(x):
        constants = type(c)(*(jnp.asarray(part) for part in x[:4]))
        return np.asarray(trace_jacobian(s.conditions, constants, state, jnp.asarray(x[4:]), 0.1, 100)[0])

    _, J = trace_jacobian(s.conditions, type(c)(*(jnp.asarray(p) for p in x[:4])), state, jnp.asarray(x[4:]), 0.1, 100)
    for k in range(8):
        h = 1e-3 * max(abs(x[k]), 0.1)
        move = lambda size, k=k, h=h: np.where(np.arange(8) == k, size * h, 0.0)  # noqa: E731
        near, far = ((motion(x + move(n)) - motion(x - move(n))) / (2 * n * h) for n in (1, 2))
        richardson = (4 * near - far) / 3
        # what is left is h⁴ times a fifth derivative, and rounding over h
        np.testing.assert_allclose(J[..., k], richardson, atol=2e-8 * max(1.0, np.abs(richardson).max()))

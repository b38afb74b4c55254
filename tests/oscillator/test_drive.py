"""The driven shell: energy, order, ends, lanes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jshell.errors import BadName, BadShape, BadValue, NotOk, Outcome
from jshell.memory import half_derivative
from jshell.oscillator import Drag, Reynolds, StokesLayer, Tone, drive, harmonics, simulate
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.drive import ORDERS, _warn_of_thick_layer, layer_thickness
from jshell.oscillator.linear import squared_frequencies
from jshell.oscillator.spectrum import spectrum
from jshell.shell.rest import buckled_state

TIMES = np.linspace(0.0, 50.0, 101)


def _in_numpy(shell, c, amplitude, pulsation):
    """The driven equation written out by hand, for SciPy."""
    V_e, P_e = (float(x) for x in buckled_state(shell))
    names = ("outer_pressure", "viscosity", "kappa", "poisson_ratio")
    load, eta, kappa, nu = (float(getattr(shell, name)) for name in names)
    a1, a2, k, b1, b2 = (float(getattr(c, n)) for n in ("alpha1", "alpha2", "k_vs", "beta1", "beta2"))
    S_e, pi = 4 * np.pi, np.pi
    K_A = 1 / (2 * (1 - nu))

    def rate(t, y):
        V, S, v, s = y
        P_ext = load + amplitude * np.sin(pulsation * t)
        F_V = P_e * (V_e / V) ** kappa - P_ext + (load - P_e) - k / V_e * (S - S_e)
        F_S = -k / V_e * (V - V_e) - K_A / S_e * (S - S_e)
        h2 = S * S - 4 * pi**2
        G = V * V * S * S / (pi**2 * h2)  # g²
        G_V, G_S = 2 * G / V, 2 * V * V * S / (pi**2 * h2) * (1 - S * S / h2)
        m_S = a2 * G / (6 * pi)
        dm = a2 / (6 * pi) * (G_V * v + G_S * s)
        a_V = (F_V + a2 / (12 * pi) * G_V * s * s - eta * b1 / pi * v) / (a1 / (4 * pi))
        a_S = (F_S + a2 / (12 * pi) * G_S * s * s - dm * s - eta * 3 * b2 / pi * G * s) / m_S
        return [v, s, a_V, a_S]

    return rate, [V_e, S_e, 0.0, 0.0]


@pytest.mark.long
def test_a_driven_run_agrees_with_an_independent_one(shell, constants, driven_run):
    rate, start = _in_numpy(shell, constants, 0.02, 0.8)
    other = solve_ivp(rate, (0, 50), start, method="DOP853", t_eval=TIMES, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(driven_run.motion.V, other.y[0], atol=2e-9)
    np.testing.assert_allclose(driven_run.motion.S, other.y[1], atol=2e-9)


@pytest.mark.long
def test_energy_less_all_work_is_kept(driven_run):
    assert int(driven_run.outcome) == Outcome.OK
    assert float(jnp.max(jnp.abs(driven_run.imbalance))) < 1e-9
    assert float(driven_run.motion.lost[-1]) < 0 < float(driven_run.motion.gained[-1])


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:the Stokes layer")  # 0.2 R0 thick: energy is kept nevertheless
def test_energy_is_kept_whatever_the_drag(shell, constants):
    """Everything at once, in fixed steps: layer, wall, sound and a quasi-steady Reynolds law."""
    drag = Drag(
        "reynolds",
        reynolds=Reynolds(speed="quasi_steady"),
        layer=StokesLayer(half_derivative(terms=4)),
        wall_viscosity=0.1,
        sound_speed=30.0,
    )
    run = drive(shell, constants, Tone(0.02, 0.8), times=TIMES, drag=drag, solver="rk4", step=0.005)
    assert int(run.outcome) == Outcome.OK
    assert float(jnp.max(jnp.abs(run.imbalance))) < 1e-6


def _observed_order(run, reference, steps):
    gaps = [float(jnp.max(jnp.abs(run(step) - reference))) for step in steps]
    return np.log(gaps[0] / gaps[1]) / np.log(steps[0] / steps[1])


@pytest.mark.long
def test_the_fast_solver_is_of_fourth_order(shell, constants, driven_run):
    run = lambda h: drive(shell, constants, Tone(0.02, 0.8), times=TIMES, solver="rk4", step=h, budget=False).motion.V  # noqa: E731
    assert _observed_order(run, driven_run.motion.V, (0.1, 0.05)) == pytest.approx(4, abs=0.2)


LARGER = {"rk4": 0.05, "euler": 0.0025, "midpoint": 0.0125, "heun": 0.0125, "bosh3": 0.05, "tsit5": 0.0625,
          "dopri5": 0.125, "dopri8": 0.25}  # fmt: skip
SPACED = np.linspace(0.0, 50.0, 51)


@pytest.mark.slow
@pytest.mark.parametrize("solver", LARGER)
def test_every_fixed_step_solver_has_its_order(shell, constants, solver):
    """Against the smallest steps of the highest order, which leave 2e-14 and are held against adaptive ones below.

    Dormand and Prince's eighth-order method meets the ninth-order condition of linear motions to 0.13 % (z⁹ of its
    stability polynomial), so near a mode it looks of order 8.8: it is driven faster than both modes.
    """
    tone = Tone(0.3, 4.0) if solver == "dopri8" else Tone(0.02, 0.8)
    run = lambda solver, h: drive(shell, constants, tone, times=SPACED, solver=solver, step=h, budget=False).motion.V  # noqa: E731
    observed = _observed_order(lambda h: run(solver, h), run("dopri8", 0.02), (LARGER[solver], LARGER[solver] / 2))
    print(f"{solver}: {observed:.2f}")
    assert observed == pytest.approx(ORDERS[solver], abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("tone", [Tone(0.3, 4.0), Tone(0.02, 0.8)])
def test_the_reference_of_the_orders_is_the_adaptive_answer(shell, constants, tone):
    settings = ({"solver": "dopri8", "step": 0.02}, {"solver": "tsit5", "rtol": 1e-12, "atol": 1e-14})
    fixed, adaptive = (
        drive(shell, constants, tone, times=SPACED, budget=False, **given).motion.V for given in settings
    )
    np.testing.assert_allclose(adaptive, fixed, atol=1e-10)


def test_the_undriven_shell_moves_as_simulate_says(shell, constants):
    initial = (0.05, -0.1, 0.02, 0.0)
    fixed = drive(shell, constants, times=TIMES, initial=initial, solver="rk4", step=0.01, budget=False)
    other = simulate(shell, constants, initial=initial, times=TIMES, solver="diffrax", model="nonlinear", rtol=1e-11)
    np.testing.assert_allclose(fixed.motion.V, other["V"], atol=1e-7)


def _many(amplitudes, k_vs, shell):
    c = Coefficients(jnp.asarray(3.6), jnp.asarray(1.1), k_vs, jnp.asarray(5.3))
    return drive(shell, c, Tone(amplitudes, 0.8), times=TIMES, solver="rk4", step=0.05, budget=False)


@pytest.mark.long
def test_a_poisoned_lane_hurts_nobody(shell):
    """NaN, a pressure beyond all sense, and one that unbuckles the shell, beside two sound lanes."""
    sound = jnp.array([0.01, 0.02])
    mixed = jnp.array([0.01, jnp.nan, 0.02, 1e200, 0.8])
    k = jnp.asarray(0.23)
    alone, together = _many(sound, k, shell), _many(mixed, k, shell)
    np.testing.assert_allclose(together.motion.V[:, [0, 2]], alone.motion.V, rtol=1e-12, atol=1e-12)
    words = [Outcome(int(o)) for o in together.outcome]
    assert words[0] == words[2] == Outcome.OK
    assert words[1] == Outcome.UNUSABLE_DATA
    assert words[3] != Outcome.OK
    assert words[4] == Outcome.NO_BUCKLED_STATE
    assert np.all(np.isnan(np.asarray(together.motion.V[:, 1])))
    with pytest.raises(NotOk):
        together.check()

    def size(amplitudes, k):
        run = _many(amplitudes, k, shell)
        return jnp.sum(jnp.where(jnp.isfinite(run.motion.V), run.motion.V - 3.0, 0.0) ** 2)

    by_amplitude, by_coupling = jax.grad(size, (0, 1))(mixed, k)
    assert np.all(np.isfinite(np.asarray(by_amplitude)))
    assert np.isfinite(float(by_coupling))


@pytest.mark.slow
def test_a_poisoned_lane_under_vmap_hurts_nobody(shell, constants):
    one = lambda a: drive(shell, constants, Tone(a, 0.8), times=TIMES, rtol=1e-11, atol=1e-13)  # noqa: E731
    clean, many = (jax.vmap(one)(jnp.array([0.02, second, 0.8])) for second in (0.02, jnp.nan))
    np.testing.assert_allclose(many.motion.V[0], clean.motion.V[0], rtol=1e-12, atol=1e-12)
    # against a run of its own: steps are chosen from rounded errors, so only to the tolerance
    single = one(jnp.asarray(0.02))
    np.testing.assert_allclose(many.motion.V[0], single.motion.V, atol=2e-9)
    assert [Outcome(int(o)) for o in many.outcome] == [Outcome.OK, Outcome.UNUSABLE_DATA, Outcome.NO_BUCKLED_STATE]
    assert 0 < float(many.ended[2]) < 50
    before = np.asarray(many.motion.V[2])[float(many.ended[2]) > TIMES]
    assert np.all(np.isfinite(before))


@pytest.mark.long
def test_ends_are_named(shell, constants):
    """A steady suction unbuckles; a blow to the area flattens, one to the volume empties."""
    from jshell.oscillator import Step

    out = drive(shell, constants, Step(-0.4), times=TIMES, solver="rk4", step=0.02, budget=False)
    assert int(out.outcome) == Outcome.NO_BUCKLED_STATE
    short = np.linspace(0.0, 2.0, 11)
    blows = (((0.0, -6.2, 0.0, -3.0), Outcome.OUT_OF_RANGE), ((0.0, 0.0, -2000.0, 0.0), Outcome.CONTACT))
    for initial, end in blows:
        into = drive(shell, constants, times=short, initial=initial, solver="rk4", step=1e-4, budget=False)
        assert int(into.outcome) == end
        assert np.isnan(float(into.motion.V[-1]))
        assert 0 < float(into.ended) < 2


@pytest.mark.long
def test_a_response_is_a_trace_with_named_channels(driven_run):
    trace = driven_run.trace()
    for name in ("V", "S", "R_eq", "x_front", "v_front", "P", "P_ext", "p_scattered", "work_drag"):
        assert np.all(np.isfinite(np.asarray(trace[name])))
    V, t = np.asarray(trace["V"]), np.asarray(trace.times)
    np.testing.assert_allclose(trace["R_eq"], np.cbrt(3 * V / (4 * np.pi)), rtol=1e-12)
    assert np.corrcoef(np.gradient(np.gradient(V, t), t)[4:-4], np.asarray(trace["p_scattered"])[4:-4])[0, 1] > 0.98
    speed = np.gradient(np.asarray(trace["x_front"]), t)
    assert np.corrcoef(speed[2:-2], np.asarray(trace["v_front"])[2:-2])[0, 1] > 0.98


def test_harmonics_and_spectrum_find_the_tones_that_are_there():
    t = jnp.linspace(0.0, 40 * np.pi, 4001)
    values = jnp.stack([0.3 * jnp.sin(t) + 0.1 * jnp.cos(t / 2) + 0.05 * jnp.sin(3 * t + 1), jnp.cos(2 * t)], axis=1)
    found = harmonics(t, values, 1.0)
    np.testing.assert_allclose(found[:, 0], [0.1, 0.3, 0, 0, 0, 0.05], atol=1e-12)
    np.testing.assert_allclose(found[:, 1], [0, 0, 0, 1, 0, 0], atol=1e-12)
    heard = spectrum(t, values[:, 0])
    peak = int(jnp.argmax(heard.amplitude))
    assert float(heard.angular_frequency[peak]) == pytest.approx(1.0, abs=0.03)
    assert float(heard.amplitude[peak]) == pytest.approx(0.3, rel=1e-2)


def test_wrong_requests_are_refused(shell, constants):
    with pytest.raises(BadName, match="solver"):
        drive(shell, constants, times=TIMES, solver="magic")
    with pytest.raises(BadValue, match="increase"):
        drive(shell, constants, times=TIMES[::-1])
    with pytest.raises(BadValue, match="even"):
        drive(shell, constants, times=TIMES**1.1, solver="rk4")
    with pytest.raises(BadShape, match="vmap"):
        drive(shell, constants, Tone(jnp.ones(3), 1.0), times=TIMES)
    with pytest.raises(BadValue, match="step"):
        drive(shell, constants, times=TIMES, solver="rk4", step=-1.0)


@pytest.mark.parametrize(("viscosity", "thick"), [(1e-3, False), (2e-3, False), (0.02, True), (0.1, True)])
def test_a_layer_too_thick_for_its_law_is_said(viscosity, thick, shell, constants, recwarn):
    conditions = shell.replace(viscosity=viscosity)
    state = buckled_state(conditions)
    slow = np.sqrt(float(squared_frequencies(*state, constants.alpha1, constants.alpha2, constants.k_vs)[0]))
    found = layer_thickness(conditions, constants, state)
    assert found == pytest.approx(np.sqrt(2 * viscosity / slow), rel=1e-12)
    _warn_of_thick_layer(found)
    assert [f"{found:.2g} R0 thick" in str(one.message) for one in recwarn] == [True] * thick
    assert np.isnan(layer_thickness(shell.replace(viscosity=np.ones(2)), constants, state))

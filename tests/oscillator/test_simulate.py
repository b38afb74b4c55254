"""The doors of the short model."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName, BadShape, BadValue, Outcome
from jshell.oscillator import SOURCE, Coefficients, frequencies, random_shell, random_trace, simulate
from jshell.shell import Reduced
from jshell.shell.sphere import buckling_load

SHELL = random_shell(3)


def _run(times, **options):
    return simulate(
        SHELL.conditions, SHELL.coefficients, initial=SHELL.initial, times=times, equilibrium=SHELL.state, **options
    )


@pytest.mark.long
@pytest.mark.parametrize("times", [np.linspace(1.0, 20.0, 100), np.linspace(1.0, 20.0, 60) ** 1.2])
def test_exact_and_adaptive_motion_agree(times):
    exact, adaptive = _run(times), _run(times, solver="diffrax")
    for name in ("V", "S"):
        # the adaptive solver is asked for 1e-9 of a motion of about 0.1
        np.testing.assert_allclose(exact[name], adaptive[name], atol=2e-8)
    assert exact["V"][0] == pytest.approx(float(SHELL.state.volume) + SHELL.initial[0], rel=1e-14)
    assert exact["S"][0] == pytest.approx(4 * np.pi + SHELL.initial[1], rel=1e-14)
    assert int(exact.outcome) == int(adaptive.outcome) == Outcome.OK
    assert dict(exact.settings)["alpha1"] == f"{SHELL.coefficients.alpha1:.17g}"


@pytest.mark.long
def test_adaptive_derivatives_forward_reverse_and_exact_agree():
    times = jnp.linspace(0.0, 10.0, 21)

    def size(k_vs, solver, adjoint="reverse"):
        c = Coefficients(SHELL.coefficients.alpha1, 1.0, k_vs, SHELL.coefficients.beta1)
        trace = simulate(
            SHELL.conditions,
            c,
            initial=SHELL.initial,
            times=times,
            equilibrium=SHELL.state,
            solver=solver,
            adjoint=adjoint,
        )
        return jnp.sum(trace["V"] ** 2)

    k = jnp.asarray(0.2)
    exact = jax.jit(jax.grad(lambda k: size(k, "exact")))(k)
    reverse = jax.jit(jax.grad(lambda k: size(k, "diffrax")))(k)
    forward = jax.jit(jax.jacfwd(lambda k: size(k, "diffrax", "forward")))(k)
    np.testing.assert_allclose(forward, reverse, rtol=1e-10)
    np.testing.assert_allclose(reverse, exact, rtol=1e-6)


@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_a_load_below_the_plateau_has_no_buckled_state():
    weak = Reduced(0.22, 0.9, 0.95, 0.004)
    assert int(frequencies(weak, SOURCE).outcome) == Outcome.NO_BUCKLED_STATE
    trace = simulate(weak, SOURCE, initial=(0.1, 0.0, 0.0, 0.0), times=np.linspace(0, 1, 5))
    assert int(trace.outcome) == Outcome.NO_BUCKLED_STATE


@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_an_unstable_slow_mode_is_flagged():
    found = frequencies(Reduced(0.22, 0.9, 1.6), Coefficients(3.6, 1.1, 0.8))
    assert not bool(found.stable)
    assert found.stability_margin < 1
    assert np.isnan(found.omega_minus)
    assert int(found.outcome) == Outcome.OUT_OF_RANGE


def test_frequencies_run_over_a_batch_under_jit():
    d = jnp.linspace(0.05, 0.1, 4)
    batch = jax.jit(jax.vmap(lambda d: frequencies(Reduced(d, 0.9, 1.2), SOURCE).omega_minus))(d)
    single = [float(frequencies(Reduced(float(x), 0.9, 1.2), SOURCE).omega_minus) for x in d]
    np.testing.assert_allclose(batch, single, rtol=1e-13)


def test_wrong_requests_are_refused():
    with pytest.raises(BadName, match="solver"):
        _run(np.linspace(0, 1, 3), solver="magic")
    with pytest.raises(BadName, match="nonlinear"):
        _run(np.linspace(0, 1, 3), model="nonlinear")
    with pytest.raises(BadShape):
        simulate(SHELL.conditions, SOURCE, initial=np.ones(2), times=np.linspace(0, 1, 3), equilibrium=SHELL.state)
    with pytest.raises(BadName, match="law"):
        frequencies(SHELL.conditions, SOURCE, law="folklore")


def test_random_shells_lie_where_they_are_promised():
    for seed in range(6):
        shell = random_shell(seed)
        c, o = shell.conditions, shell.coefficients
        assert 0.05 <= c.thickness <= 0.3
        assert 0.4 <= c.gas_pressure <= 3
        assert 1.0 < c.outer_pressure / buckling_load(c) < 1.06
        assert 0.1 <= abs(o.k_vs) <= 0.35
        assert 5 <= shell.tau <= 30
        w2 = c.kappa * shell.state.volume * shell.state.pressure / (4 * np.pi * o.k_vs**2)
        assert w2 >= 1.3
    assert random_shell(7).coefficients.alpha1 == random_shell(7).coefficients.alpha1


def test_noise_is_one_percent_of_the_motion():
    clean, noisy = _run(np.linspace(0, 40, 400)), random_trace(SHELL, 0)
    gap = np.asarray(noisy["V"] - clean["V"])
    assert gap.std() / np.asarray(clean["V"]).std() == pytest.approx(0.01, rel=0.15)


def test_a_start_that_is_not_finite_is_refused():
    with pytest.raises(BadValue, match="initial"):
        simulate(Reduced(0.08, 0.9, 1.2), SOURCE, initial=(np.nan, 0.0, 0.0, 0.0), times=np.linspace(0, 1, 5))

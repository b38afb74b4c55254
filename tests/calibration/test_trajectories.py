"""Constants from traces: both losses, both solvers, against the truth and against lmfit."""

import jax
import jax.numpy as jnp
import lmfit
import numpy as np
import pytest
import scipy.linalg

from jshell.calibration import FitWarning, fit_trajectories, prepare, trace_loss
from jshell.calibration.losses import bases, best_linear, projected, targets
from jshell.errors import BadName, BadValue, Outcome
from jshell.oscillator import Coefficients, add_noise, random_shell, random_trace, simulate
from jshell.shell import Reduced
from jshell.trace import Trace

pytestmark = [
    pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning"),
    pytest.mark.filterwarnings("ignore:the plateau law:jshell.calibration.report.FitWarning"),
]
CONSTANTS = ("alpha1", "alpha2", "k_vs", "beta1")


def _deviations(found, shell, names=CONSTANTS):
    true = {name: getattr(shell.coefficients, name) for name in names}
    return {name: (found[name].value - true[name]) / found[name].stderr for name in names}


def _recovered(seed, solver):
    shell = random_shell(seed)
    found = fit_trajectories(random_trace(shell, seed), solver=solver)
    assert found.outcome == Outcome.OK, found
    assert max(abs(z) for z in _deviations(found, shell).values()) < 4, found


@pytest.mark.long
def test_fifty_random_shells_are_recovered_by_the_exact_solver():
    for seed in range(50):
        _recovered(seed, "exact")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 25])
def test_random_shells_are_recovered_by_the_adaptive_solver(seed):
    _recovered(seed, "diffrax")


@pytest.mark.slow
def test_fifty_random_shells_are_recovered_by_the_adaptive_solver():
    for seed in range(50):
        _recovered(seed, "diffrax")


@pytest.mark.long
def test_both_solvers_find_the_same():
    trace = random_trace(random_shell(25), 25)
    exact, adaptive = fit_trajectories(trace), fit_trajectories(trace, solver="diffrax")
    for name in CONSTANTS:
        assert adaptive[name].value == pytest.approx(exact[name].value, rel=1e-6)
        assert adaptive[name].stderr == pytest.approx(exact[name].stderr, rel=1e-3)


def full_residual(p, linear, model):
    """That of one trace of the strict loss, at any linear parameters."""
    return bases(p, model)[0] @ linear - targets(model)[0]


@pytest.mark.long
def test_numbers_equal_lmfits_on_the_same_residual():
    trace = random_trace(random_shell(0), 0)
    found, model = fit_trajectories(trace), prepare(trace)
    evaluate = jax.jit(lambda p, c: full_residual(p, c, model))
    begin = np.array([found[name].start for name in CONSTANTS])
    linear = best_linear(jnp.asarray(begin), model)[0]
    parameters = lmfit.Parameters()
    for name, value in zip((*CONSTANTS, *(f"c{i}" for i in range(6))), (*begin, *linear), strict=True):
        parameters.add(name, value)

    def residual(p):
        x = np.array([p[name].value for name in p])
        return np.asarray(evaluate(jnp.asarray(x[:4]), jnp.asarray(x[4:])))

    whole = jax.jit(jax.jacrev(lambda x: full_residual(x[:4], x[4:], model)))
    slopes = lambda p: np.array(whole(jnp.array([p[name].value for name in p])))  # noqa: E731
    other = lmfit.minimize(residual, parameters, Dfun=slopes, ftol=1e-14, xtol=1e-14, gtol=0)
    for name in CONSTANTS:
        assert found[name].value == pytest.approx(other.params[name].value, rel=1e-6)
        assert found[name].stderr == pytest.approx(other.params[name].stderr, rel=1e-6)
    assert found.chi_square == pytest.approx(other.chisqr, rel=1e-4)
    assert found.reduced_chi_square == pytest.approx(other.redchi, rel=1e-4)
    assert (found.aic, found.bic) == pytest.approx((other.aic, other.bic), rel=1e-4, abs=1e-3)
    assert (found.n_data, found.n_varied) == (other.ndata, other.nvarys)


def test_given_errors_are_absolute():
    shell = random_shell(1)
    noisy = random_trace(shell, 1)
    clean = simulate(
        shell.conditions, shell.coefficients, initial=shell.initial, times=noisy.times, equilibrium=shell.state
    )
    sigma = {name: np.full(400, 0.01 * np.std(values)) for name, values in clean.channels.items()}
    found = fit_trajectories(Trace(noisy.times, noisy.channels, noisy.conditions, sigma))
    assert found.absolute
    assert found.reduced_chi_square == pytest.approx(1, abs=0.2)
    scaled = fit_trajectories(noisy)
    assert found["alpha1"].stderr == pytest.approx(scaled["alpha1"].stderr, rel=0.1)
    assert "absolute" in found.report()


@pytest.mark.long
@pytest.mark.parametrize("dipole", ["corrected", "printed"])
def test_both_dampings_are_found_when_free(dipole):
    shell = random_shell(6)
    c = shell.coefficients
    true = Coefficients(c.alpha1, c.alpha2, c.k_vs, c.beta1, 1.7 * c.area_damping, dipole)
    clean = simulate(
        shell.conditions, true, initial=shell.initial, times=np.linspace(0, 40, 400), equilibrium=shell.state
    )
    found = fit_trajectories(add_noise(clean, 0.01, 3), beta2="free", dipole=dipole)
    for name in (*CONSTANTS, "beta2"):
        assert abs(found[name].value - getattr(true, name)) < 4 * found[name].stderr
    assert found.coefficients.dipole == dipole


@pytest.mark.long
def test_uneven_times_are_fitted_too():
    shell = random_shell(8)
    times = np.sort(np.random.default_rng(0).uniform(0, 40, 200))
    clean = simulate(shell.conditions, shell.coefficients, initial=shell.initial, times=times, equilibrium=shell.state)
    found = fit_trajectories(add_noise(clean, 0.01, 0), starts=1)
    assert found.outcome == Outcome.OK
    assert max(abs(z) for z in _deviations(found, shell).values()) < 4


@pytest.mark.long
def test_one_trace_of_volume_leaves_a_direction_free_and_says_so():
    shell = random_shell(9)
    found = fit_trajectories(random_trace(shell, 9), channels=("V",))
    assert found.outcome == Outcome.RANK_DEFICIENT
    assert len(found.free_directions) == 1
    assert "alpha2" in found.free_directions[0]
    assert "second" in found.free_directions[0]
    assert "fix alpha2" in found.free_directions[0]
    for name in ("alpha1", "alpha2", "k_vs"):
        assert np.isnan(found[name].stderr)
        assert found[name].reason
    w2 = np.linalg.eigvals(_squared(shell))
    # what the record does determine keeps its error
    assert abs(found["omega_minus"].value - np.sqrt(w2.min())) < 4 * found["omega_minus"].stderr
    assert abs(found["omega_plus"].value - np.sqrt(w2.max())) < 4 * found["omega_plus"].stderr
    assert abs(found["tau"].value - shell.tau) < 4 * found["tau"].stderr


def _squared(shell):
    from jshell.oscillator import matrices

    system = matrices(shell.coefficients, shell.state, shell.conditions)
    return np.linalg.solve(system.mass, system.stiffness)


@pytest.mark.long
def test_fixing_alpha2_makes_one_trace_of_any_channel_enough():
    shell = random_shell(9)
    trace = random_trace(shell, 9)
    height = Trace(trace.times, {"H": 1.7 + 0.2 * trace["V"] - 0.1 * trace["S"]}, trace.conditions)
    found = fit_trajectories(height, fix={"alpha2": float(shell.coefficients.alpha2)})
    assert found.outcome == Outcome.OK
    assert abs(found["alpha1"].value - shell.coefficients.alpha1) < 4 * found["alpha1"].stderr
    assert abs(found["k_vs"].value - abs(shell.coefficients.k_vs)) < 4 * found["k_vs"].stderr
    assert found["alpha2"].role == "fixed"


@pytest.mark.long
def test_three_pressures_on_volume_alone_determine_the_constants():
    shell = random_shell(13)
    c, traces = shell.coefficients, []
    for i, factor in enumerate((0.6, 1.0, 1.6)):
        old = shell.conditions
        conditions = Reduced(
            old.thickness, factor * old.gas_pressure, factor * old.outer_pressure + 0.1 * i, old.viscosity
        )
        clean = simulate(conditions, c, initial=shell.initial, times=np.linspace(0, 40, 400))
        traces.append(add_noise(clean, 0.01, i))
    found = fit_trajectories(traces, channels=("V",))
    assert found.outcome == Outcome.OK, found
    for name, true in (("alpha1", c.alpha1), ("alpha2", c.alpha2), ("k_vs", abs(c.k_vs))):
        assert abs(found[name].value - true) < 4 * found[name].stderr
    assert abs(found["tau[2]"].value - shell.tau) < 4 * found["tau[2]"].stderr


@pytest.mark.long
def test_gradients_agree_between_solvers_directions_and_differences():
    trace = random_trace(random_shell(3), 3, samples=100, duration=20.0)
    c = random_shell(3).coefficients
    p = jnp.array([1.01 * c.alpha1, 0.99 * c.alpha2, c.k_vs + 0.005, c.beta1])
    exact, forward, reverse = prepare(trace), prepare(trace, solver="diffrax"), None
    reverse = prepare(trace, solver="diffrax", adjoint="reverse")
    slope = lambda mode, model: jax.jit(mode(lambda p: trace_loss(p, model)))(p)  # noqa: E731
    ahead, back = slope(jax.jacfwd, exact), slope(jax.grad, exact)
    np.testing.assert_allclose(back, ahead, rtol=1e-10)
    adaptive = slope(jax.jacfwd, forward)
    np.testing.assert_allclose(slope(jax.grad, reverse), adaptive, rtol=1e-10)
    np.testing.assert_allclose(adaptive, ahead, rtol=1e-6)
    value = jax.jit(lambda p: trace_loss(p, exact))
    for i in range(4):
        h = 1e-5 * abs(float(p[i]))
        fourth = [float(value(p.at[i].add(k * h))) for k in (-2, -1, 1, 2)]
        central = (fourth[0] - 8 * fourth[1] + 8 * fourth[2] - fourth[3]) / (12 * h)
        assert central == pytest.approx(float(ahead[i]), rel=1e-6)


def test_gradient_is_that_of_the_matrix_exponential():
    # scipy's exponential and its Fréchet derivative, best linear parameters by orthogonal steps: at the best ones
    # the loss does not feel them (envelope theorem), so its slope is r · dΦ c
    trace = random_trace(random_shell(3), 3, samples=60, duration=20.0)
    c, model = random_shell(3).coefficients, prepare(trace)
    p = np.array([1.01 * c.alpha1, 0.99 * c.alpha2, c.k_vs + 0.005, c.beta1])
    one, eta = model.records[0], float(trace.conditions.viscosity)
    V, P = (float(x) for x in one.state)

    def matrix(p):
        m = np.array([p[0] / (4 * np.pi), 2 * p[1] * V**2 / (9 * np.pi**3)])
        wall = 1 / (8 * np.pi * (1 - float(trace.conditions.poisson_ratio)))
        K = np.array([[float(trace.conditions.kappa) * P / V, p[2] / V], [p[2] / V, wall]])
        return np.block([[np.zeros((2, 2)), np.eye(2)], [-K / m[:, None], -np.eye(2) * 4 * p[3] * eta / p[0]]])

    A, weight, rest = matrix(p), np.asarray(one.weight), np.kron(np.eye(2), np.ones((60, 1)))
    # every entry is a power of each constant, so complex steps give exact slopes
    slopes = [matrix(p + 1e-30j * np.eye(4)[i] * p).imag / (1e-30 * p[i]) for i in range(4)]
    times = np.asarray(one.elapsed)
    flat = lambda motion: weight.reshape(-1, 1) * np.moveaxis(np.stack(motion)[:, :2], 1, 0).reshape(120, 4)  # noqa: E731
    basis = np.hstack([flat([scipy.linalg.expm(A * t) for t in times]), weight.reshape(-1, 1) * rest])
    data = (weight * np.asarray(one.data)).ravel()
    best = np.linalg.lstsq(basis, data, rcond=None)[0]
    left = basis @ best - data
    expected = [
        left @ flat([scipy.linalg.expm_frechet(A * t, dA * t, compute_expm=False) for t in times]) @ best[:4]
        for dA in slopes
    ]
    found = jax.jit(jax.grad(lambda p: trace_loss(p, model)))(jnp.asarray(p))
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_projected_residual_is_that_of_the_best_linear_parameters():
    trace = random_trace(random_shell(3), 3, samples=200)
    model, c = prepare(trace), random_shell(3).coefficients
    p = jnp.array([c.alpha1, 1.1 * c.alpha2, c.k_vs, c.beta1])
    left = full_residual(p, best_linear(p, model)[0], model)
    np.testing.assert_allclose(projected(p, model), left, atol=1e-8)


def test_strict_loss_refuses_other_channels():
    trace = random_trace(random_shell(3), 3, samples=100)
    other = Trace(trace.times, {"V": trace["V"], "H": trace["S"] / 8}, trace.conditions)
    with pytest.raises(BadName, match="V and S"):
        fit_trajectories(other, "strict")
    with pytest.raises(BadName, match="modal"):
        fit_trajectories(trace, "strict", channels=("V",))
    with pytest.raises(BadName, match="solver"):
        fit_trajectories(trace, solver="euler")
    with pytest.raises(BadName, match="integrates nothing"):
        fit_trajectories(trace, "modal", solver="diffrax")
    with pytest.raises(BadValue, match="conditions"):
        fit_trajectories(Trace(trace.times, trace.channels))
    still = Reduced(*(getattr(trace.conditions, k) for k in ("thickness", "gas_pressure", "outer_pressure")))
    with pytest.raises(BadValue, match="viscosity"):
        fit_trajectories(Trace(trace.times, trace.channels, still))


def test_a_shell_that_rests_elsewhere_is_told_and_can_be_believed():
    shell = random_shell(12)
    state = type(shell.state)(1.03 * shell.state.volume, shell.state.pressure / 1.03**1.4)
    clean = simulate(
        shell.conditions, shell.coefficients, initial=shell.initial, times=np.linspace(0, 40, 400), equilibrium=state
    )
    trace = add_noise(clean, 0.01, 5)
    with pytest.warns(FitWarning, match="misfit"), pytest.warns(FitWarning, match=r"\+3\.0% from the plateau"):
        fit_trajectories(trace)
    with pytest.warns(FitWarning, match="from the plateau"):
        found = fit_trajectories(trace, equilibrium="trace")
    assert max(abs(z) for z in _deviations(found, shell, ("alpha1", "alpha2", "k_vs")).values()) < 4


@pytest.mark.long
def test_modes_the_oscillator_cannot_have_are_a_misfit():
    """Two modes whose areas move against the oscillator's ratios, as the membrane's do (-0.37, -0.41)."""
    t = np.linspace(0, 40, 400)
    slow, fast = np.exp(-t / 8) * np.cos(1.03 * t), np.exp(-t / 8) * np.cos(1.77 * t + 1)
    random = np.random.default_rng(0)
    V = 2.913 + 0.1 * slow + 0.05 * fast + 0.0005 * random.standard_normal(400)
    S = 4 * np.pi - 0.1 / 0.37 * slow - 0.05 / 0.41 * fast + 0.001 * random.standard_normal(400)
    trace = Trace(t, {"V": V, "S": S}, Reduced(0.22, 0.9, 1.6, 0.004))
    with pytest.warns(FitWarning, match="misfit"):
        found = fit_trajectories(trace)
    assert any("does not describe this record" in text for text in found.warnings)
    modal = fit_trajectories(trace, "modal", fix={"alpha2": 1.0})
    assert not any("misfit" in text for text in modal.warnings)
    assert modal["omega_minus"].value == pytest.approx(np.hypot(1.03, 1 / 8), rel=2e-3)


@pytest.mark.long
def test_the_window_is_respected():
    trace = random_trace(random_shell(5), 5, duration=60.0, samples=601)
    found = fit_trajectories(trace, start=9.95, stop=49.95)
    assert found.n_data == 2 * 400
    assert max(abs(z) for z in _deviations(found, random_shell(5)).values()) < 4

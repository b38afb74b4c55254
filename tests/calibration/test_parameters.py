"""Free, fixed, bounded, tied, local and uncertain parameters; robust losses; samples left out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.calibration import Prior, fit_conditions, fit_frequencies, fit_trajectories, prepare
from jshell.calibration.losses import bases, targets
from jshell.calibration.parameters import Expression, unknowns
from jshell.calibration.problem import join
from jshell.errors import BadName, BadValue, Outcome
from jshell.oscillator import Coefficients, add_noise, simulate
from jshell.trace import Trace

NAMES = ("alpha1", "alpha2", "k_vs", "beta1")


def far(found, shell, names=NAMES):
    return max(abs(found[n].value - float(getattr(shell.coefficients, n))) / found[n].stderr for n in names)


def test_arithmetic_is_read_and_nothing_else_is():
    known = {"alpha1": jnp.asarray(9.0), "beta1[2]": jnp.asarray(8.0)}
    assert float(Expression("2*sqrt(alpha1) - beta1[2]/4")(known)) == pytest.approx(4.0)
    assert Expression("0.3*alpha1 + beta1[2]").names == ("alpha1", "beta1[2]")
    for text in ("__import__('os')", "alpha1.real", "alpha1 if alpha2 else 1", "open('x')", "alpha1 +", "'a'*3"):
        with pytest.raises(BadValue, match="arithmetic"):
            Expression(text)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"fix": {"gamma": 1.0}}, "gamma"),
        ({"fix": {"a": 1.0, "b": 2.0, "c": 3.0}}, "at least one of a, b, c"),
        ({"fix": {"a": -1.0}}, "1e-12 to .* for a"),
        ({"fix": {"a": 0.0}}, "1e-12 to .* for a"),
        ({"fix": {"a": 1e-320}}, "1e-12 to .* for a"),
        ({"fix": {"b": 1e300}}, "to 1e.12 for b"),
        ({"fix": {"b": np.nan}}, "to 1e.12 for b"),
        ({"tie": {"a": "0"}}, "tie.'a'., 0: found 0"),
        ({"tie": {"a": "b - b"}}, "found 0"),
        ({"tie": {"a": "-abs"}}, "'abs'"),
        ({"tie": {"a": "sqrt(-1)"}}, "found nan"),
        ({"tie": {"a": "9**9**9*b"}}, "no value"),
        ({"tie": {"a": "b/0"}}, "found inf"),
        ({"tie": {"b": "(-8)**0.5"}}, "no value"),
        ({"tie": {"b": "9" * 400}}, "no value"),
        ({"bounds": {"a": (1e-320, 1e-310)}}, "bounds.'a'."),
        ({"bounds": {"b": (1e300, 1e305)}}, "bounds.'b'."),
        ({"tie": {"a": "2*b"}, "fix": {"a": 1.0}}, "also fixed"),
        ({"tie": {"a": "2*z"}}, "'z'"),
        ({"tie": {"a": "b", "b": "a"}}, "circle"),
        ({"bounds": {"b": (2.0, 1.0)}}, "lowest < highest"),
    ],
)
def test_impossible_wishes_are_refused_in_words(given, match):
    with pytest.raises((BadName, BadValue), match=match):
        unknowns(("a", "b", "c"), frozenset({"a"}), **given)


def test_a_chain_of_ties_is_worked_out_in_order_and_differentiated():
    parameters = unknowns(("a", "b", "c"), frozenset(), tie={"a": "2*b", "b": "c**2"})
    np.testing.assert_allclose(parameters.constrained(jnp.array([3.0])), [18.0, 9.0, 3.0])
    np.testing.assert_allclose(parameters.slopes(np.array([18.0, 9.0, 3.0]))[:, 0], [12.0, 6.0, 1.0])


@pytest.mark.slow
def test_a_tie_as_function_is_that_of_the_text(shell, trace):
    ratio = float(shell.coefficients.alpha2 / shell.coefficients.alpha1)
    one = fit_trajectories(trace, tie={"alpha2": f"{ratio!r}*alpha1"})
    two = fit_trajectories(trace, tie={"alpha2": lambda p: ratio * p["alpha1"]})
    assert two["alpha2"].value == pytest.approx(one["alpha2"].value, rel=1e-10)


@pytest.mark.slow
def test_tied_local_and_shared_constants_are_found_together(shell, trace, fit):
    c = shell.coefficients
    other = Coefficients(c.alpha1, c.alpha2, c.k_vs, 1.5 * c.beta1)
    clean = simulate(
        shell.conditions, other, initial=shell.initial[::-1], times=np.asarray(trace.times), equilibrium=shell.state
    )
    ratio = float(c.alpha2 / c.alpha1)
    both = [trace, add_noise(clean, 0.01, 5)]
    found = fit_trajectories(both, local=("beta1",), tie={"alpha2": f"{ratio!r}*alpha1"})
    assert found.outcome == Outcome.OK
    assert found.varied == ("alpha1", "k_vs", "beta1[1]", "beta1[2]")
    assert found["alpha2"].role == "tied"
    assert found["alpha2"].value == pytest.approx(ratio * found["alpha1"].value, rel=1e-12)
    assert found["alpha2"].stderr == pytest.approx(ratio * found["alpha1"].stderr, rel=1e-10)
    for name, true in (("beta1[1]", c.beta1), ("beta1[2]", 1.5 * c.beta1), ("alpha1", c.alpha1)):
        assert abs(found[name].value - true) < 4 * found[name].stderr
    assert found["alpha1"].stderr < fit["alpha1"].stderr


def test_a_stiffer_wall_is_the_same_shell_in_other_units(trace):
    """Twice E d: pressures over it, viscosity over its root, the record's time in its own unit that much longer."""
    problem = join(prepare(trace), uncertain={"youngs_modulus": 0.1, "gas_pressure": None}, equilibrium="trace")
    assert problem.names == ("alpha1", "alpha2", "k_vs", "beta1", "youngs_modulus", "gas_pressure")
    plain = problem.model.records[0]
    P = plain.conditions.gas_pressure
    moved = problem.terms(np.array([9.0, 1.0, 0.1, 5.0, 2.0, 3.0 * P]))[0].model.records[0]
    assert moved.conditions.gas_pressure == pytest.approx(1.5 * P)
    assert moved.conditions.outer_pressure == pytest.approx(plain.conditions.outer_pressure / 2)
    assert moved.conditions.viscosity == pytest.approx(plain.conditions.viscosity / np.sqrt(2))
    np.testing.assert_allclose(moved.elapsed, np.sqrt(2) * np.asarray(plain.elapsed), rtol=1e-14)
    assert moved.state.volume == plain.state.volume
    np.testing.assert_allclose(problem.prior, [[1.0, 0.1]])


@pytest.mark.slow
def test_uncertain_conditions_pass_their_error_on(shell, trace, fit):
    """α1 goes with P0, a(α1, P) = 4π κ P/(α1 V): their relative errors are one; V and S together tell of P0 too."""
    found = fit_trajectories(trace, uncertain={"gas_pressure": 0.02}, equilibrium="trace")
    share = found["alpha1"].stderr / found["alpha1"].value
    pressure = found["gas_pressure"]
    assert share == pytest.approx(pressure.stderr / pressure.value, rel=0.1)
    assert fit["alpha1"].stderr / fit["alpha1"].value < 0.1 * share
    assert pressure.stderr < 0.02 * float(shell.conditions.gas_pressure)
    assert any("priors are held" in note for note in found.notes)


@pytest.mark.slow
def test_a_prior_holds_a_constant(shell, trace):
    held = fit_trajectories(trace, priors={"beta1": Prior(float(shell.coefficients.beta1), 1e-4)})
    assert held["beta1"].stderr < 1.01e-4


@pytest.mark.slow
def test_the_inverse_finds_a_condition_from_known_constants(shell, trace):
    true = float(shell.conditions.gas_pressure)
    wrong = Trace(trace.times, trace.channels, trace.conditions)
    with pytest.warns(DeprecationWarning, match=r"jshell\.invert"):
        found = fit_conditions(wrong, shell.coefficients, ("gas_pressure",))
    assert found.outcome == Outcome.OK
    assert abs(found["gas_pressure"].value - true) < 4 * found["gas_pressure"].stderr
    assert found["alpha1"].role == "fixed"


def test_the_former_inverse_says_its_new_name(shell, trace):
    with pytest.warns(DeprecationWarning, match=r"jshell\.invert"), pytest.raises(BadValue, match="vary"):
        fit_conditions(trace, shell.coefficients, ())


@pytest.fixture(scope="module")
def dirty(trace):
    """The record with 20 of 400 samples of V spoiled by half its scatter."""
    random = np.random.default_rng(0)
    channels = {name: np.array(values) for name, values in trace.channels.items()}
    spoiled = random.choice(400, 20, replace=False)
    channels["V"][spoiled] += 0.5 * np.std(channels["V"]) * random.standard_normal(20)
    return Trace(trace.times, channels, trace.conditions)


@pytest.mark.long
def test_a_robust_loss_bears_outliers(shell, dirty):
    plain, robust = fit_trajectories(dirty), fit_trajectories(dirty, robust="huber")
    assert robust["alpha1"].stderr < 0.5 * plain["alpha1"].stderr
    assert far(robust, shell) < 4
    with pytest.raises(BadName, match="huber, cauchy"):
        fit_trajectories(dirty, robust="median")
    with pytest.raises(BadValue, match="robust"):
        robust.profile()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "tuning"), [("huber", 1.345), ("cauchy", 2.385)])
def test_a_robust_fit_is_lmfits_with_the_same_loss(kind, tuning, dirty):
    import lmfit

    found, model = fit_trajectories(dirty, robust=kind), prepare(dirty)
    residual = jax.jit(lambda x: bases(x[:4], model)[0] @ x[4:] - targets(model)[0])
    slopes = jax.jit(jax.jacfwd(residual))
    best = np.array([found[name].value for name in NAMES])
    linear = np.array([one.value for one in found.estimates if one.role == "nuisance"])
    left = np.asarray(residual(np.append(best, linear))).reshape(2, 400)
    scale = np.repeat(1.4826 * np.median(np.abs(left), axis=1), 400)  # each channel's own, as the fit has it
    parameters = lmfit.Parameters()
    for i, value in enumerate(np.append(1.002 * best, linear)):
        parameters.add(f"x{i}", value)
    flat = lambda p: np.array([p[name].value for name in p])  # noqa: E731
    other = lmfit.minimize(
        lambda p: np.asarray(residual(flat(p))) / scale,
        parameters,
        method="least_squares",
        loss=kind,
        f_scale=tuning,
        jac=lambda p: np.array(slopes(flat(p))) / scale[:, None],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    there = flat(other.params)
    np.testing.assert_allclose(there[:4], best, rtol=1e-8)
    # lmfit's AIC is of the residual over the robust scale: the same formula, of the residual as it was weighed
    chi_square = float(np.sum(np.asarray(residual(there)) ** 2))
    shift = 800 * np.log(chi_square / other.chisqr)
    assert found.aic == pytest.approx(other.aic + shift, rel=1e-6)
    assert found.bic == pytest.approx(other.bic + shift, rel=1e-6)
    assert found.chi_square == pytest.approx(chi_square, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["huber", "cauchy"])
def test_errors_of_a_robust_fit_are_those_of_its_refits(kind, dirty):
    found = fit_trajectories(dirty, robust=kind)
    refits = found.bootstrap(256)
    assert refits.lost == 0
    # the standard deviation of 256 refits is known to 1/sqrt(2·256) = 4%
    np.testing.assert_allclose(refits.stderr, [found[name].stderr for name in NAMES], rtol=0.2)


def test_samples_are_left_out_by_time_and_where_they_are_missing(shell, trace):
    channels = {name: np.array(values) for name, values in trace.channels.items()}
    channels["S"][7] = np.nan
    holed = Trace(trace.times, channels, trace.conditions)
    with pytest.raises(BadValue, match=r"sample 8 .*missing=.drop"):
        fit_trajectories(holed)
    found = fit_trajectories(holed, missing="drop", drop=[(10.0, 11.0)])
    inside = np.sum((np.asarray(trace.times) >= 10) & (np.asarray(trace.times) <= 11))
    assert found.n_data == 800 - 1 - 2 * inside
    assert far(found, shell) < 4


@pytest.mark.parametrize(
    ("bounds", "square", "sign"),
    [
        ((-1.0, -0.2), (0.04, 1.0), -1.0),
        ((-0.3, 0.3), (0.0, 0.09), 1.0),
        ((-0.5, 0.2), (0.0, 0.25), 1.0),
        ((0.1, 0.4), (0.01, 0.16), 1.0),
        ((-np.inf, 0.0), (0.0, np.inf), -1.0),
        (None, (0.0, np.inf), 1.0),
    ],
)
def test_bounds_of_a_parameter_seen_by_its_square_are_its_own(bounds, square, sign):
    names = ("alpha1", "k_vs")
    given = None if bounds is None else {"k_vs": bounds}
    parameters = unknowns(names, frozenset({"alpha1"}), bounds=given, squared=frozenset({"k_vs"}))
    np.testing.assert_allclose((parameters.low[1], parameters.high[1]), square, rtol=1e-15)
    np.testing.assert_allclose(parameters.reported(np.array([2.0, 0.09])), [2.0, sign * 0.3], rtol=1e-15)
    np.testing.assert_allclose(parameters.shown(np.array([0.0, 0.09])), [1.0, sign * 0.3], rtol=1e-15)
    np.testing.assert_allclose(parameters.stretch(np.array([2.0, sign * 0.3])), [1.0, sign * 0.6], rtol=1e-15)


def test_ties_read_and_give_the_parameter_where_the_model_sees_its_square():
    names, squared = ("alpha1", "k_vs"), frozenset({"k_vs"})
    by_alpha = unknowns(names, frozenset(), tie={"k_vs": "-0.1*alpha1"}, squared=squared)
    np.testing.assert_allclose(by_alpha.constrained(jnp.array([3.0])), [3.0, 0.09], rtol=1e-15)
    np.testing.assert_allclose(by_alpha.reported(np.array([3.0, 0.09])), [3.0, -0.3], rtol=1e-15)
    np.testing.assert_allclose(by_alpha.slopes(np.array([3.0, 0.09]))[:, 0], [1.0, 0.06], rtol=1e-14)
    by_k = unknowns(names, frozenset(), tie={"alpha1": "10*k_vs"}, squared=squared)
    np.testing.assert_allclose(by_k.constrained(jnp.array([0.09])), [3.0, 0.09], rtol=1e-15)


FREQUENCIES = {
    "V_e": np.array([2.9, 3.1, 2.5, 3.3]),
    "P_e": np.array([1.5, 0.6, 2.4, 1.0]),
    "omega_minus": np.array([0.99, 0.62, 1.29, 0.78]),
    "omega_plus": np.array([1.65, 1.4, 2.1, 1.39]),
}


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.calibration.report.FitWarning")
def test_a_negative_coupling_is_bounded_and_told_as_given():
    free = fit_frequencies(FREQUENCIES)
    k = free["k_vs"].value
    assert k > 0
    below = fit_frequencies(FREQUENCIES, bounds={"k_vs": (-2 * k, -0.5 * k)})
    assert below["k_vs"].value == pytest.approx(-k, rel=1e-8)
    assert below["k_vs"].stderr == pytest.approx(free["k_vs"].stderr, rel=1e-6)
    assert below["alpha1"].value == pytest.approx(free["alpha1"].value, rel=1e-8)
    assert "negative, as it was given" in below.report()
    interval = below.profile(("k_vs",))["k_vs"]
    assert interval.low < interval.value < interval.high < 0
    held = fit_frequencies(FREQUENCIES, bounds={"k_vs": (-0.5 * k, 0.5 * k)})
    assert (held.outcome, held["k_vs"].value) == (Outcome.AT_BOUND, pytest.approx(0.5 * k, rel=1e-12))
    assert fit_frequencies(FREQUENCIES, fix={"k_vs": -k})["k_vs"].value == -k


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.calibration.report.FitWarning")
def test_the_coupling_of_modal_fits_can_be_tied_bounded_and_local(trace):
    free = fit_trajectories(trace, "modal", fix={"alpha2": 1.1})
    ratio = free["k_vs"].value / free["alpha1"].value
    tied = fit_trajectories(trace, "modal", tie={"k_vs": f"{-ratio!r}*alpha1"}, fix={"alpha2": 1.1})
    assert tied["k_vs"].role == "tied"
    assert tied["k_vs"].value == pytest.approx(-ratio * tied["alpha1"].value, rel=1e-12)
    assert tied["k_vs"].stderr == pytest.approx(ratio * tied["alpha1"].stderr, rel=1e-9)
    assert tied["k_vs"].value == pytest.approx(-free["k_vs"].value, rel=1e-6)

    other = fit_trajectories(
        [trace, trace], "modal", fix={"alpha2": 1.1, "alpha1": free["alpha1"].value}, local=("k_vs",),
        bounds={"k_vs[1]": (-1.0, -0.5 * free["k_vs"].value)},
    )  # fmt: skip
    assert other["k_vs[1]"].value == pytest.approx(-other["k_vs[2]"].value, rel=1e-6)
    alone = fit_trajectories(trace, "modal", fix={"alpha2": 1.1, "alpha1": free["alpha1"].value})
    for number in (1, 2):  # ω± and its error follow the trace's own coupling
        assert other[f"omega_plus[{number}]"].value == pytest.approx(alone["omega_plus"].value, rel=1e-6)
        assert other[f"omega_plus[{number}]"].stderr == pytest.approx(alone["omega_plus"].stderr, rel=1e-2)

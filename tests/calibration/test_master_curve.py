"""Constants from frequencies: recovered, refused, and reported as lmfit reports them."""

import json
import re
import sys

import equinox as eqx
import lmfit
import numpy as np
import pytest

from jshell.calibration import FitWarning, fit_frequencies, master_curve
from jshell.calibration.master_curve import WEIGHTINGS
from jshell.errors import BadName, BadShape, BadValue, NotOk, Outcome
from jshell.oscillator import squared_frequencies

pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
TRUE = (2.7, 0.9, 0.17)  # far from the source's constants
PRESSURES = np.array([0.3, 0.6, 1.1, 2.0, 3.3, 5.0])
VOLUMES = np.array([2.4, 2.7, 3.0, 2.9, 3.2, 3.3])


def _table(noise=0.0, seed=0, constants=TRUE, rows=slice(None)):
    random = np.random.default_rng(seed)
    w = np.sqrt([squared_frequencies(V, P, *constants) for V, P in zip(VOLUMES[rows], PRESSURES[rows], strict=True)])
    w = w * (1 + noise * random.standard_normal(w.shape))
    return {"V_e": VOLUMES[rows], "P_e": PRESSURES[rows], "omega_minus": w[:, 0], "omega_plus": w[:, 1]}


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_exact_frequencies_give_the_constants_back(weighting):
    found = fit_frequencies(_table(), weighting)
    assert found.outcome == Outcome.OK
    np.testing.assert_allclose([found[name].value for name in ("alpha1", "alpha2", "k_vs")], TRUE, rtol=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_ten_random_starts_agree_and_errors_are_honest(seed):
    found = fit_frequencies(_table(0.02, seed), seed=seed)
    assert found.outcome == Outcome.OK
    assert len(found.starts) == 11
    assert all(start.agrees or start.outcome == Outcome.AT_BOUND for start in found.starts)
    for name, true in zip(("alpha1", "alpha2", "k_vs"), TRUE, strict=True):
        assert abs(found[name].value - true) < 4 * found[name].stderr


@pytest.mark.parametrize("weighting", WEIGHTINGS)
@pytest.mark.parametrize("known", [False, True])
def test_numbers_equal_lmfits(weighting, known):
    table = _table(0.02)
    if known:
        table |= {"sigma_minus": 0.02 * table["omega_minus"], "sigma_plus": 0.03 * table["omega_plus"]}
    found = fit_frequencies(table, weighting)
    w = np.stack([table["omega_minus"], table["omega_plus"]], axis=1)
    V, P = VOLUMES[:, None], PRESSURES

    def residual(p):
        pi, a1, a2, k = np.pi, p["alpha1"].value, p["alpha2"].value, p["k_vs"].value
        v = VOLUMES
        plus, minus = 9 * pi**2 * a1 + 32 * pi * a2 * 1.4 * v * P, 9 * pi**2 * a1 - 32 * pi * a2 * 1.4 * v * P
        root = np.sqrt(minus**2 + 2 * a1 * a2 * (48 * pi**2 * k) ** 2)
        w2 = np.stack([plus - root, plus + root], axis=1) / (16 * a1 * a2 * V**2)
        sigma = np.stack([table["sigma_minus"], table["sigma_plus"]], axis=1) if known else 1.0
        if weighting == "V_e omega":
            return ((V * np.sqrt(w2) - V * w) / (V * sigma if known else 1.0)).ravel()
        return ((V**2 * (w2 - w**2)) / (2 * V**2 * w * sigma if known else 1.0)).ravel()

    parameters = lmfit.Parameters()
    parameters.add("alpha1", 2.9)
    parameters.add("alpha2", 1.0)
    parameters.add("k_vs", 0.2)
    other = lmfit.minimize(residual, parameters, scale_covar=not known, ftol=1e-14, xtol=1e-14)
    for name in ("alpha1", "alpha2", "k_vs"):
        assert found[name].value == pytest.approx(other.params[name].value, rel=1e-6)
        assert found[name].stderr == pytest.approx(other.params[name].stderr, rel=1e-4)
    assert found.correlation[0, 1] == pytest.approx(other.params["alpha1"].correl["alpha2"], abs=1e-4)
    assert found.chi_square == pytest.approx(other.chisqr, rel=1e-6)
    assert found.reduced_chi_square == pytest.approx(other.redchi, rel=1e-6)
    assert (found.aic, found.bic) == pytest.approx((other.aic, other.bic), rel=1e-6)
    assert (found.n_data, found.n_varied, found.absolute) == (other.ndata, other.nvarys, known)


@pytest.mark.long
def test_one_shape_is_refused_and_its_free_direction_named():
    found = fit_frequencies(_table(rows=slice(2, 3)))
    assert found.outcome == Outcome.RANK_DEFICIENT
    assert "alpha1" in found.free_directions[0]
    assert "second pressure" in found.free_directions[0]
    for name in ("alpha1", "alpha2", "k_vs"):
        assert np.isnan(found[name].stderr)
        assert np.isnan(found[name].value)
        assert found[name].reason
        assert re.search(rf"{name}: +undetermined", found.report())
    with pytest.raises(NotOk, match="rank_deficient"):
        found.require_ok()


@pytest.mark.long
def test_moving_along_the_free_direction_changes_no_frequency():
    """The direction is read back from the words of the report."""
    found = fit_frequencies(_table(rows=slice(2, 3)))
    words = found.free_directions[0].split(" changes")[0].split(", ")
    change = {word.split()[0]: float(word.split()[1].rstrip("%")) / 100 for word in words}
    objective = found.objective()  # the result says what is determined; where the search ended stands here
    p = dict(zip(("alpha1", "alpha2", "k_vs"), objective.shown(objective.best), strict=True))
    V, P, step = VOLUMES[2], PRESSURES[2], 1e-3

    def shift(directions):
        moved = [p[name] * (1 + step * directions.get(name, 0.0)) for name in p]
        return np.abs(squared_frequencies(V, P, *moved) / squared_frequencies(V, P, *p.values()) - 1).max()

    assert shift(change) < 0.02 * shift({"alpha1": 1.0})  # percents are rounded


@pytest.mark.long
def test_fixing_one_constant_makes_one_shape_enough():
    found = fit_frequencies(_table(rows=slice(2, 3)), fix={"alpha2": TRUE[1]})
    assert found.outcome == Outcome.OK
    assert found["alpha1"].value == pytest.approx(TRUE[0], rel=1e-8)
    assert found["k_vs"].value == pytest.approx(TRUE[2], rel=1e-7)
    assert "no scatter" in found["k_vs"].reason
    assert found["alpha2"].role == "fixed"


def test_the_sign_of_the_coupling_is_not_claimed():
    found = fit_frequencies(_table(constants=(2.7, 0.9, -0.17)))
    assert found["k_vs"].value == pytest.approx(0.17, rel=1e-7)
    assert any("k_VS² only" in note for note in found.notes)


def test_a_missing_frequency_is_left_out():
    table = _table()
    table["omega_plus"] = np.where(np.arange(6) == 3, np.nan, table["omega_plus"])
    found = fit_frequencies(table)
    assert found.n_data == 11
    assert found["alpha1"].value == pytest.approx(TRUE[0], rel=1e-7)


@pytest.mark.long
def test_rest_states_come_from_the_plateau_law_when_not_given():
    conditions = {"d_hat": np.array([0.06, 0.08, 0.1]), "P0_hat": np.array([0.5, 1.0, 3.0])}
    conditions["Pext_hat"] = conditions["P0_hat"] + np.array([0.3, 0.4, 1.5])
    dP = (3 / 4) ** -0.75 * (2.34e-6 + 0.9 * conditions["d_hat"] ** 2.57) / conditions["d_hat"]
    P = conditions["Pext_hat"] - dP
    V = 4 * np.pi / 3 * (conditions["P0_hat"] / P) ** (1 / 1.4)
    w = np.sqrt([squared_frequencies(v, p, *TRUE) for v, p in zip(V, P, strict=True)])
    found = fit_frequencies(conditions | {"omega_minus": w[:, 0], "omega_plus": w[:, 1]})
    assert found["alpha2"].value == pytest.approx(TRUE[1], rel=1e-7)
    assert any("plateau law" in note for note in found.notes)


def test_report_says_what_a_reader_needs():
    found = fit_frequencies(_table(0.02))
    text = found.report()
    for words in ("alpha1:", "±", "%)", "(start =", "C(alpha1", "chi square", "aic", "bic", "11 of 11", "scaled"):
        assert words in text
    assert text == str(found)
    assert "<table>" in found._repr_html_()
    json.dumps(found.record(), allow_nan=False)
    assert found.coefficients.alpha1 == found["alpha1"].value


def test_wrong_tables_are_refused():
    with pytest.raises(BadName, match="weighting"):
        fit_frequencies(_table(), "omega")
    with pytest.raises(BadName, match="omega_minus"):
        fit_frequencies({"V_e": [1.0], "P_e": [1.0]})
    with pytest.raises(BadName, match="rest states"):
        fit_frequencies({"omega_minus": [1.0], "omega_plus": [2.0]})
    with pytest.raises(BadShape, match="columns"):
        fit_frequencies(_table() | {"V_e": VOLUMES[:2]})
    with pytest.raises(BadValue, match="sigma"):
        fit_frequencies(_table() | {"sigma_minus": np.zeros(6)})
    with pytest.raises(BadName, match="alpha9"):
        fit_frequencies(_table(), fix={"alpha9": 1.0})


def test_starts_that_disagree_are_not_hidden(monkeypatch):
    """A start that never becomes a number stands for one that ends elsewhere."""
    broken = lambda first, count, seed, *share: np.vstack([first, np.full(3, np.nan)])  # noqa: E731
    monkeypatch.setattr(master_curve, "scatter", broken)
    with pytest.warns(FitWarning, match="only 1 of 2 starts"):
        found = fit_frequencies(_table(0.02))
    assert found.outcome == Outcome.STALLED
    assert "only 1 of 2" in found.report()


def _wrong(kind: str, seed: int) -> dict[str, np.ndarray]:
    """A table of twelve shells that the model does not describe; noise of 1%."""
    random = np.random.default_rng(seed)
    V, P = np.linspace(2.2, 3.4, 12), np.exp(random.uniform(np.log(0.5), np.log(3.0), 12))
    rows = zip(V, P, strict=True)
    omega = np.sqrt([np.asarray(squared_frequencies(v, p, *TRUE)) for v, p in rows])
    if kind == "slow 30% too fast at high pressure":
        omega[:, 0] *= 1 + 0.3 * (P - 1)
    if kind == "fast ones of another shell":
        omega[:, 1] = random.uniform(1.5, 6.0, 12)
    if kind == "volume twice as heavy in the fast mode":
        omega[:, 1] *= np.where(P > 1.2, 0.7, 1.0)
    omega *= 1 + 0.01 * random.standard_normal(omega.shape)
    return {"V_e": V, "P_e": P, "omega_minus": omega[:, 0], "omega_plus": omega[:, 1]}


@pytest.mark.long
@pytest.mark.parametrize(
    "kind",
    ["slow 30% too fast at high pressure", "fast ones of another shell", "volume twice as heavy in the fast mode"],
)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning")
def test_a_table_that_the_model_does_not_describe_is_a_misfit(kind, seed):
    found = fit_frequencies(_wrong(kind, seed))
    assert found.outcome != Outcome.OK or any(text.startswith("misfit") for text in found.warnings)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning")
def test_given_errors_that_are_too_small_are_a_misfit():
    table = _wrong("none", 0)
    sigma = {f"sigma_{which}": 0.01 * table[f"omega_{which}"] for which in ("minus", "plus")}
    assert not fit_frequencies(table | sigma).warnings
    small = {name: values / 5 for name, values in sigma.items()}
    assert "times the errors of the table" in fit_frequencies(table | small).report()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning")
def test_good_tables_are_hardly_ever_called_misfits():
    flagged = [seed for seed in range(300) if fit_frequencies(_wrong("none", seed)).warnings]
    assert len(flagged) <= 3


@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning")
def test_one_start_of_many_is_not_enough(monkeypatch):
    module = sys.modules["jshell.calibration.master_curve"]
    search = module.from_many_starts

    def one_alone(*given):
        """All but the first start end at k_VS = 0, in its minimum."""
        solution = search(*given)
        others = solution.outcome.at[1:].set(int(Outcome.AT_BOUND)), solution.cost.at[1:].set(1.0)
        return eqx.tree_at(lambda e: (e.outcome, e.cost), solution, others)

    monkeypatch.setattr(module, "from_many_starts", one_alone)
    found = fit_frequencies(_table())
    assert found.outcome == Outcome.STALLED
    assert np.isnan(found["alpha1"].value)
    assert "only 1 of 11 starts" in found.report()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning")
def test_both_weightings_are_shown_where_they_disagree():
    table = _wrong("none", 0)
    table["omega_plus"][3] *= 1.8  # a row that was misread
    found = fit_frequencies(table)
    told = [text for text in found.warnings if "V_e^2 omega^2" in text]
    other = fit_frequencies(table, "V_e^2 omega^2")
    apart = max(abs(found[n].value - other[n].value) / np.hypot(found[n].stderr, other[n].stderr) for n in found.varied)
    assert bool(told) == (apart > 1)
    assert bool(told) == ("V_e omega" in other.report().split("misfit")[-1] and bool(other.warnings))

"""Profiles, bootstraps, posteriors and other minimisers agree about one fit; what data leave open is said."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from jshell.calibration import compare, fit_trajectories
from jshell.calibration.profile import profile
from jshell.calibration.uncertainty import uncertainty
from jshell.errors import BadName, BadValue, MissingExtra, NotOk, Outcome
from jshell.trace import Trace

pytestmark = [
    pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning"),
    pytest.mark.filterwarnings("ignore::jshell.calibration.report.FitWarning"),
]
BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def flags():
    return runpy.run_path(str(BENCHMARKS / "flags.py"))


def test_params_is_the_table_of_the_report(fit, monkeypatch):
    assert fit.params["alpha1"] == fit["alpha1"]
    assert "alpha1" in fit.params
    assert fit.params.get("alpha3") is None
    with pytest.raises(BadName, match=r"parameter 'alpha3': found no such parameter; expected one of alpha1, "):
        _ = fit["alpha3"]
    told = [line.strip() for line in fit.report().splitlines()]
    assert {line.split()[0] for line in str(fit.params).splitlines()} <= {line.split()[0] for line in told if line}
    assert fit["alpha1"].line(len("omega_minus")) in str(fit.params)
    assert "6 more belong to single traces" in str(fit.params)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match="extra `io`"):
        fit.params.to_dataframe()


def test_params_are_a_frame_of_pandas(fit):
    pytest.importorskip("pandas", reason="no pandas: pip install pandas")
    frame = fit.params.to_dataframe()
    assert frame.loc["alpha1", "stderr"] == fit["alpha1"].stderr
    assert frame.loc["omega_minus", "role"] == "derived"


def linear_errors(result):
    return np.array([one.stderr for one in result.estimates if one.role == "nuisance"])


@pytest.mark.long
def test_the_report_is_lmfits_and_the_profile_is_its_conf_interval(fit):
    import lmfit

    minimizer = fit.to_lmfit()
    away = minimizer.params.copy()
    for name in fit.varied:
        away[name].value *= 1.01
    other = minimizer.minimize(params=away, ftol=1e-14, xtol=1e-14)
    for name in fit.varied:
        assert fit[name].value == pytest.approx(other.params[name].value, rel=1e-6)
        assert fit[name].stderr == pytest.approx(other.params[name].stderr, rel=1e-6)
    assert fit.chi_square == pytest.approx(other.chisqr, rel=1e-6)
    assert (fit.aic, fit.bic) == pytest.approx((other.aic, other.bic), rel=1e-6)
    ours = fit.profile(["alpha1"])
    low, _, high = lmfit.conf_interval(minimizer, other, p_names=["alpha1"], sigmas=[0.95])["alpha1"]
    width = ours["alpha1"].high - ours["alpha1"].low
    assert ours["alpha1"].low == pytest.approx(low[1], abs=0.01 * width)
    assert ours["alpha1"].high == pytest.approx(high[1], abs=0.01 * width)
    assert "F with 1 and 790" in ours.criterion


def test_standard_errors_are_those_of_differences_and_lmfits_own_are_coarser(fit):
    """Differences extrapolated twice leave h⁶; lmfit's forward ones, at a step of 1e-5, leave four digits."""
    minimizer = fit.to_lmfit()
    best = minimizer.params
    names, at = list(best), np.array([best[name].value for name in best])

    def residual(x):
        moved = best.copy()
        for name, value in zip(names, x, strict=True):
            moved[name].value = value
        return np.asarray(minimizer.userfcn(moved))

    columns = []
    for unit, size in zip(np.eye(at.size), np.maximum(np.abs(at), 0.05), strict=True):
        coarse, middle, fine = (
            (residual(at + h * size * unit) - residual(at - h * size * unit)) / (2 * h * size)
            for h in (2e-3, 1e-3, 5e-4)
        )
        columns.append((16 * (4 * fine - middle) / 3 - (4 * middle - coarse) / 3) / 15)
    J, r = np.stack(columns, axis=1), residual(at)
    stderr = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * (r @ r) / (r.size - at.size))
    ours = np.append([fit[name].stderr for name in fit.varied], linear_errors(fit))
    np.testing.assert_allclose(ours, stderr, rtol=1e-8)
    coarser = minimizer.leastsq(Dfun=None)
    theirs = np.array([coarser.params[name].stderr for name in names])
    np.testing.assert_allclose(theirs, stderr, rtol=1e-4)
    assert np.abs(theirs / stderr - 1).max() > 1e-6


@pytest.mark.slow
def test_the_profile_is_minos(fit):
    minuit = fit.to_minuit()
    minuit.migrad()
    minuit.minos("k_vs", cl=0.95)
    one = profile(fit, ["k_vs"], criterion="chi2")["k_vs"]
    width = one.high - one.low
    assert one.high - one.value == pytest.approx(minuit.merrors["k_vs"].upper, abs=0.01 * width)
    assert one.low - one.value == pytest.approx(minuit.merrors["k_vs"].lower, abs=0.01 * width)


@pytest.mark.long
def test_the_bootstrap_agrees_with_the_covariance(fit):
    found = fit.bootstrap(128, seed=0)
    errors = np.array([fit[name].stderr for name in fit.varied])
    # the standard deviation of 128 refits is known to 1/sqrt(2·128) = 6%
    np.testing.assert_allclose(found.stderr, errors, rtol=0.25)
    assert found.lost == 0
    assert "128 refits" in found.report()
    with pytest.raises(BadName, match="kind"):
        fit.bootstrap(20, kind="wild")
    with pytest.raises(BadValue, match="count"):
        fit.bootstrap(3)


@pytest.mark.slow
@pytest.mark.filterwarnings(r"ignore:\s*ArviZ is undergoing:FutureWarning")  # said once a day
def test_the_posterior_agrees_with_the_covariance_and_arviz_reads_it(fit, tmp_path):
    import arviz

    found = fit.posterior(400, warmup=300, seed=0)
    assert found.sound
    for i, name in enumerate(found.names):
        draws = found.draws[:, :, i]
        assert draws.mean() == pytest.approx(fit[name].value, abs=0.3 * fit[name].stderr)
        assert draws.std() == pytest.approx(fit[name].stderr, rel=0.2)
    read = arviz.from_netcdf(found.to_netcdf(tmp_path / "p.nc"))
    np.testing.assert_array_equal(read.posterior["alpha1"].values, found.draws[:, :, 0])


def test_bad_wishes_are_refused(fit):
    with pytest.raises(BadName, match="no such varied parameter"):
        fit.profile(["gamma"])
    with pytest.raises(BadValue, match="level"):
        fit.profile(level=95)


KINDS = ["slow mode only", "fast mode only", "a seventh of a period"]  # V only: see test_trajectories


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_what_data_leave_free_is_named_with_what_would_fix_it(kind, flags):
    _, make = flags["KINDS"][kind]
    found = make(2)
    assert flags["flagged"](found)
    assert found.free_directions
    assert "second pressure" in found.free_directions[0]


@pytest.mark.parametrize("kind", ["two decays, β2 × 2", "two decays, β2 × 0.5", "P0 10 % too high"])
def test_a_model_that_does_not_describe_the_record_is_called_a_misfit(kind, flags):
    _, make = flags["KINDS"][kind]
    assert flags["flagged"](make(1))


@pytest.mark.slow
def test_every_bad_problem_is_flagged_and_hardly_a_good_one(flags):
    for name, (_, make) in flags["KINDS"].items():
        assert all(text for _, text, _ in flags["ends"](make, 20)), name
    false = [seed for seed, text, _ in flags["ends"](flags["good"], 1000) if text]
    assert len(false) <= 10


def test_models_weighed_by_errors_that_change_are_refused(trace):
    sigma = {"V": np.linspace(1.0, 2.0, trace.times.size), "S": np.ones(trace.times.size)}
    with pytest.raises(BadValue, match="change from sample to sample"):
        compare(Trace(trace.times, trace.channels, trace.conditions, sigma))


@pytest.mark.long
def test_models_side_by_side_say_what_the_record_holds(trace):
    found = compare(trace)
    assert {row.name for row in found.rows} == {"one mode", "two modes", "three modes", "modal", "strict"}
    assert found.rows[0].name == "strict"
    assert found["one mode"].bic > found["two modes"].bic + 100
    assert found["modal"].chi_square == pytest.approx(found["two modes"].chi_square, rel=1e-6)
    assert found["three modes"].chi_square < found["two modes"].chi_square
    assert found["strict"].white
    assert "holds two modes" in found.verdict
    assert "strict oscillator describes" in found.verdict


@pytest.mark.slow
def test_the_other_minimum_of_a_modal_fit_is_told(trace, shell):
    found = fit_trajectories(trace, "modal", fix={"alpha2": float(shell.coefficients.alpha2)}, starts=12)
    assert found.outcome == Outcome.OK
    ended = [start for start in found.starts if not start.agrees]
    assert bool(ended) == any("another minimum" in note for note in found.notes)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_have_no_errors(bad):
    with pytest.raises(NotOk, match="not_finite"):
        uncertainty(np.array([[1.0], [bad]]), np.ones(2), np.ones(1), absolute=True)

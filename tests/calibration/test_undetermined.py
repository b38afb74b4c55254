"""What an outcome says is undetermined is NaN and a word; what is determined beside it stays."""

import json
import re
import warnings

import equinox as eqx
import numpy as np
import pytest

import jshell as js
from jshell.calibration import diagnostics, fit_frequencies, fit_trajectories, trajectories
from jshell.calibration.estimate import Estimate
from jshell.errors import Outcome
from jshell.trace import Trace

pytestmark = pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
TOO_LONG = re.compile(r"\d{18,}|\d{4,}(\.\d+)?%")  # digits that no number of a report needs; percents beyond 1000


def short(trace, samples):
    return Trace(
        trace.times[:samples], {name: values[:samples] for name, values in trace.channels.items()}, trace.conditions
    )


def checked(found):
    """The names that are undetermined, once report, page and record say so, and nothing else does."""
    lost = {one.name for one in (*found.estimates, *found.derived) if one.undetermined}
    for text in (found.report(nuisance=True), found._repr_html_(), repr(found)):
        assert not TOO_LONG.search(text), TOO_LONG.search(text)
    for one in (*found.estimates, *found.derived):
        assert np.isnan(one.value) == (one.name in lost)
        if one.name in lost:
            assert one.reason
            assert np.isnan(one.stderr)
            assert f"{one.name}:" in found.report(nuisance=True)
    rows = {row["name"]: row for row in found.record()["estimates"]}
    assert all((rows[name]["value"] is None) == (name in lost) for name in rows)
    assert json.dumps(found.record(), allow_nan=False)
    for i, name in enumerate(found.varied):
        assert np.isnan(found.covariance[i, i]) == (name in lost) or not np.isfinite(found[name].stderr)
    return lost


def test_a_free_direction_takes_the_constants_it_moves_and_leaves_frequencies_and_decay(trace):
    found = fit_trajectories(trace, channels=("V",), starts=0)
    assert found.outcome == Outcome.RANK_DEFICIENT
    assert {"alpha1", "alpha2", "k_vs"} <= checked(found)
    for name in ("tau", "omega_minus", "omega_plus"):
        assert np.isfinite(found[name].value)
        assert found[name].stderr < 0.1 * found[name].value
    assert re.search(r"alpha2: +undetermined \(", found.report())


@pytest.mark.parametrize("samples", [16, 24, 40])
def test_a_record_too_short_says_undetermined_not_a_million_percent(trace, samples):
    found = fit_trajectories(short(trace, samples), starts=0)
    lost = checked(found)
    for one in found.estimates:
        if one.role == "constant" and one.name not in lost and found.outcome == Outcome.RANK_DEFICIENT:
            assert one.stderr <= 0.5 * max(abs(one.value), 0.05)


@pytest.mark.long
@pytest.mark.parametrize("outcome", [Outcome.STALLED, Outcome.NOT_CONVERGED, Outcome.NOT_FINITE])
@pytest.mark.parametrize("loss", ["strict", "modal"])
def test_a_fit_that_did_not_come_to_rest_determines_nothing(trace, monkeypatch, outcome, loss):
    minimise = trajectories.minimise
    ended = lambda e: eqx.tree_at(lambda e: e.outcome, e, 0 * e.outcome + int(outcome))  # noqa: E731
    monkeypatch.setattr(trajectories, "minimise", lambda *given: ended(minimise(*given)))
    monkeypatch.setattr(diagnostics, "best_of", lambda solution, size: (0, np.array([True] * len(solution.cost))))
    found = fit_trajectories(trace, loss, fix={"alpha2": 1.0} if loss == "modal" else None, starts=0)
    assert found.outcome == outcome
    fixed = {one.name for one in found.estimates if one.role == "fixed"}
    assert checked(found) == {one.name for one in (*found.estimates, *found.derived)} - fixed


@pytest.mark.slow
def test_a_tie_to_what_is_undetermined_is_undetermined(trace):
    found = fit_trajectories(trace, channels=("V",), tie={"k_vs": "0.05*alpha1*alpha2"}, starts=0)
    if found.outcome == Outcome.RANK_DEFICIENT:
        lost = checked(found)
        assert ("k_vs" in lost) == bool(lost & {"alpha1", "alpha2"})


def test_what_is_undetermined_comes_back_from_a_file_with_the_place_where_the_search_ended(trace, tmp_path):
    found = fit_trajectories(trace, channels=("V",), starts=0)
    read = js.load(found.save(tmp_path / "fit.json"))
    assert read == found
    np.testing.assert_allclose(read.objective().values, found.objective().values)
    assert np.all(np.isfinite(read.objective().values))


@pytest.mark.long
def test_one_shape_of_a_table_is_undetermined():
    found = fit_frequencies({"V_e": [2.7], "P_e": [1.0], "omega_minus": [0.9], "omega_plus": [1.5]})
    assert checked(found) == {"alpha1", "alpha2", "k_vs"}


@pytest.mark.parametrize(("value", "stderr"), [(1e-200, 1.0), (0.0, 1.0), (1e-8, 6e5), (1e300, 1.0), (-1e-14, 1e-3)])
def test_a_percentage_beyond_meaning_is_not_printed(value, stderr):
    line = Estimate("k_vs", value, stderr).line(6)
    assert not TOO_LONG.search(line)
    assert len(line) < 60


@pytest.mark.long
@pytest.mark.parametrize("status", ["one mode", "stuck"])
def test_rows_of_a_batch_say_undetermined_too(trace, monkeypatch, status):
    batch = js.calibration.fit_batch
    if status == "stuck":
        monkeypatch.setattr("jshell.calibration.batch_result.CONVERGED", 77)
        monkeypatch.setattr("jshell.calibration.batch_result.RUNNING", 78)
        found = batch([trace])
        assert found.outcomes == [Outcome.STALLED]
        assert np.isnan(found.values).all()
        assert np.isnan(found.stderr).all()
        assert np.isnan(found.omega).all()
        return
    # the normal matrix of a record in which alpha2 and k_vs cannot be told apart
    monkeypatch.setattr("jshell.calibration.batch_result._inverse", _deficient)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = batch([trace])
    assert found.outcomes == [Outcome.RANK_DEFICIENT]
    assert np.isnan(found.stderr).all()
    assert np.isfinite(found.omega).all()


def _deficient(normal):
    return np.zeros_like(normal), np.ones(len(normal), bool)

"""Batch fits: against single fits and the truth; and rows that fail, which must say so and hurt nobody."""

import numpy as np
import pytest

from jshell.calibration import (
    BatchResult,
    Recordings,
    bootstrap_frequencies,
    fit_batch,
    fit_trajectories,
    load_recordings,
    save_recordings,
)
from jshell.calibration.recordings import stacked
from jshell.errors import BadFile, BadName, BadShape, BadValue, Outcome
from jshell.oscillator import random_shell, random_trace
from jshell.shell import Reduced
from jshell.trace import Trace

pytestmark = [
    pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning"),
    pytest.mark.filterwarnings("ignore::jshell.calibration.report.FitWarning"),
]

SEEDS = range(6)
NAMES = ("thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio")


@pytest.fixture(scope="module")
def shells():
    return [random_shell(seed) for seed in SEEDS]


@pytest.fixture(scope="module")
def traces(shells):
    return [random_trace(shell, seed) for seed, shell in zip(SEEDS, shells, strict=True)]


@pytest.fixture(scope="module")
def found(traces) -> BatchResult:
    return fit_batch(traces)


def _recordings(traces) -> Recordings:
    values = np.stack([np.stack([np.asarray(t["V"]), np.asarray(t["S"])]) for t in traces])
    numbers = [np.array([float(getattr(t.conditions, name)) for t in traces]) for name in NAMES]
    return Recordings(np.asarray(traces[0].times), values, Reduced(*numbers))


def test_every_row_agrees_with_the_single_fit(traces, found):
    for row in (0, 1, 2):
        single = fit_trajectories(traces[row], noise="white")
        for name in ("alpha1", "alpha2", "k_vs", "beta1"):
            # both stop within 1e-4 standard errors of the minimum
            assert abs(found[name][row] - single[name].value) < 1e-3 * single[name].stderr
            assert found.error_of(name)[row] == pytest.approx(single[name].stderr, rel=1e-4)
        assert found.chi_square[row] == pytest.approx(single.chi_square, rel=1e-7)


def test_every_row_finds_the_truth(shells, found):
    assert found.ok.all()
    true = np.array([[s.coefficients.alpha1, s.coefficients.alpha2, s.coefficients.k_vs, s.tau] for s in shells])
    assert np.abs((found.values[:, :4] - true.astype(float)) / found.stderr[:, :4]).max() < 4.5
    motion = np.array([s.initial for s in shells])
    assert np.abs(found.state[:, :2] - motion[:, :2]).max() < 0.01 * np.abs(motion).max()
    assert np.abs(found.state[:, 2:4] - motion[:, 2:]).max() < 0.05 * np.abs(motion).max()


def test_a_bad_row_changes_no_other_by_a_bit(traces, found):
    records = _recordings(traces)
    values = np.array(records.values)
    values[2] = np.random.default_rng(0).standard_normal(values[2].shape)
    values[4, 0] = np.nan
    spoiled = fit_batch(Recordings(records.times, values, records.conditions))
    for name in ("values", "stderr", "state", "chi_square", "outcome"):
        np.testing.assert_array_equal(getattr(spoiled, name)[[0, 1, 3, 5]], getattr(found, name)[[0, 1, 3, 5]])
    assert spoiled.outcomes[4] == Outcome.UNUSABLE_DATA
    assert np.isnan(spoiled.values[4]).all()


@pytest.mark.slow
def test_ragged_uneven_and_missing_samples_are_fitted(shells, traces):
    V, S, t = (np.asarray(x, dtype=float) for x in (traces[0]["V"], traces[0]["S"], traces[0].times))
    holed = V.copy()
    holed[100:110] = np.nan
    random = np.random.default_rng(0)
    kept = np.sort(random.choice(400, 300, replace=False))
    variants = [
        Trace(t[:333], {"V": V[:333], "S": S[:333]}, traces[0].conditions),
        Trace(t, {"V": holed, "S": S}, traces[0].conditions),
        Trace(t[kept], {"V": V[kept], "S": S[kept]}, traces[0].conditions),
    ]
    found = fit_batch(variants)
    assert [o.word for o in found.outcomes] == ["ok"] * 3
    c = shells[0].coefficients
    for i, name in enumerate(("alpha1", "alpha2", "k_vs")):
        assert np.all(np.abs(found[name] - float(getattr(c, name))) < 4.5 * found.stderr[:, i])
    single = fit_trajectories(variants[2], noise="white")
    assert found["alpha1"][2] == pytest.approx(single["alpha1"].value, abs=1e-3 * single["alpha1"].stderr)


@pytest.mark.long
def test_outcomes_name_what_went_wrong(traces):
    t = np.asarray(traces[0].times)
    flat = Trace(t, {"V": np.full(t.size, 3.0), "S": np.asarray(traces[0]["S"])}, traces[0].conditions)
    c = traces[0].conditions
    sphere = Reduced(float(c.thickness), float(c.gas_pressure), 1e-3, float(c.viscosity))
    unbuckled = Trace(t, dict(traces[0].channels), sphere)
    found = fit_batch([flat, unbuckled, traces[0]], bounds={"alpha1": (20.0, 30.0)})
    assert [o.word for o in found.outcomes[:2]] == ["unusable_data", "no_buckled_state"]
    assert found.outcomes[2] != Outcome.OK
    assert not found.ok.any()


def test_fixed_and_bounded_parameters_are_kept(shells, traces):
    true = float(shells[1].coefficients.alpha2)
    found = fit_batch([traces[1]], fix={"alpha2": true}, bounds={"tau": (0.1, 1e3)})
    assert found["alpha2"][0] == pytest.approx(true, rel=1e-12)
    assert found.error_of("alpha2")[0] == 0
    assert found.outcomes[0] == Outcome.OK


def test_random_starts_report_their_basins(traces):
    found = fit_batch(traces[:2], starts=4)
    assert np.all(found.tried >= 5)
    assert np.all((found.agreeing >= 1) & (found.agreeing <= found.tried))


def test_the_table_and_progress_are_complete(traces, found):
    told = []
    fit_batch(traces, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (6, 6)
    dataset = found.to_xarray()
    assert float(dataset["alpha1"][3]) == found["alpha1"][3]
    assert dataset["covariance"].shape == (6, 5, 5)
    assert len(found.rows()) == len(found) == 6
    assert "ok" in str(found)


def test_impossible_requests_are_refused(traces):
    with pytest.raises(BadName, match="beta1"):
        fit_batch(traces, fix={"beta1": 1.0})
    with pytest.raises(BadName, match="solver"):
        fit_batch(traces, solver="euler")
    with pytest.raises(BadValue, match="none"):
        fit_batch([])
    with pytest.raises(BadShape, match="recordings"):
        Recordings(np.arange(5.0), np.zeros((2, 3, 5)), traces[0].conditions)
    of = lambda **change: Reduced(**{"thickness": 0.2, "gas_pressure": 1.0, "outer_pressure": 1.5} | change)  # noqa: E731
    with pytest.raises(BadShape, match="of each condition a row or one for all"):
        Recordings(np.arange(5.0), np.zeros((2, 2, 5)), of(thickness=np.full(3, 0.2)))
    with pytest.raises(BadValue, match=r"recordings, values: found an array of <U1"):
        Recordings(np.arange(5.0), np.full((2, 2, 5), "a"), of())
    with pytest.raises(BadValue, match="thickness"):  # complex numbers lost their imaginary part in silence
        of(thickness=np.full(2, 0.2 + 1j))


@pytest.mark.slow
def test_integrated_motion_gives_the_same_fits(traces, found):
    other = fit_batch(traces, solver="diffrax")
    assert np.abs((other.values - found.values) / found.stderr).max() < 1e-3
    np.testing.assert_allclose(other.stderr, found.stderr, rtol=1e-4)


@pytest.mark.slow
def test_a_thousand_random_shells_end_at_the_true_minimum():
    """2% noise, no start: where a search begun at the truth ends."""
    shells = [random_shell(seed) for seed in range(1000)]
    traces = [random_trace(shell, seed, noise=0.02) for seed, shell in enumerate(shells)]
    found = fit_batch(traces)
    true = np.array([[s.coefficients.alpha1, s.coefficients.alpha2, s.coefficients.k_vs, s.tau] for s in shells])
    right = np.all(np.abs(found.values[:, :4] - true.astype(float)) < 5 * found.stderr[:, :4], axis=1)
    assert np.mean(found.ok & right) >= 0.99
    assert not np.any(found.ok & ~right)


@pytest.mark.long
def test_bootstrap_scatters_as_the_standard_errors_say():
    random = np.random.default_rng(0)
    V, P = random.uniform(2.0, 3.6, 40), random.uniform(0.5, 3.0, 40)
    a, b = 4 * np.pi * 1.4 * P / (3.6 * V), 9 * np.pi**2 / (8 * 1.1 * V**2)
    c = 18 * np.pi**4 * 0.23**2 / (3.6 * 1.1 * V**4)
    fast = (a + b) / 2 + np.sqrt((a - b) ** 2 / 4 + c)
    noisy = lambda w2: np.sqrt(w2) + 0.01 * random.standard_normal(40) / V  # noqa: E731
    table = {"V_e": V, "P_e": P, "omega_minus": noisy((a * b - c) / fast), "omega_plus": noisy(fast)}
    scatter = bootstrap_frequencies(table, resamples=1000)
    assert np.all(scatter.outcome == Outcome.OK)
    for name in ("alpha1", "alpha2", "k_vs"):
        # 40 shells: the two estimates of the error differ by chance by some 15%
        assert np.std(scatter[name]) == pytest.approx(scatter.whole[name].stderr, rel=0.4)
    low, high = scatter.interval("alpha1", 0.95)
    assert low < 3.6 < high


def test_recordings_are_kept_in_a_file(tmp_path, traces):
    records = stacked(list(traces))
    path = save_recordings(records, tmp_path / "many.npz")
    back = load_recordings(path)
    for name in ("times", "values"):
        np.testing.assert_array_equal(getattr(back, name), getattr(records, name))
    assert back.channels == records.channels
    np.testing.assert_array_equal(back.conditions.thickness, records.conditions.thickness)
    with pytest.raises(BadFile, match="Check it"):
        save_recordings(records, tmp_path / "no folder" / "many.npz")
    np.savez(path, times=np.arange(3.0))
    with pytest.raises(BadFile, match="no array values"):
        load_recordings(path)

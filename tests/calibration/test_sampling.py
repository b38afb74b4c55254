"""Even grids are known by the digits of their stamps, and noise is found at any times: rounding changes no weight."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from jshell.calibration import fit_batch, fit_trajectories
from jshell.calibration.recordings import bucketed, stacked
from jshell.calibration.records import record
from jshell.calibration.sampling import noise_of, sampling
from jshell.oscillator import Coefficients, add_noise, simulate
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState
from jshell.trace import Trace

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

GRID = np.arange(281) / 7


def digits(count):
    return lambda t: np.array([float(f"{x:.{count}g}") for x in t])


@pytest.mark.parametrize("step", [1 / 7, 1 / 30, 0.1234567, 3.7])
@pytest.mark.parametrize("begin", [0.0, 5.3, 812.0])
@pytest.mark.parametrize(
    "stamp",
    [
        digits(17),
        digits(9),
        digits(6),
        lambda t: np.round(t, 3),
        lambda t: np.floor(1e3 * t + 1e-6) / 1e3,
        lambda t: np.float32(t).astype(float),
        lambda t: np.round(t, 3) * 0.7390,  # their unit was changed after they were rounded
    ],
)
def test_rounded_stamps_are_the_grid_they_were(step, begin, stamp):
    true = begin + step * np.arange(300)
    given = stamp(true)
    taken = sampling(given)
    assert taken.even
    assert taken.missing == 0
    true = true * (0.739 if given[-1] < 0.9 * true[-1] else 1.0)
    # the grid is nearer to the truth than the stamps, but for a common shift; both are right to rounding at 17 digits
    assert np.ptp(taken.times - true) < 0.5 * np.ptp(given - true) + 1e-12 * true[-1]


@pytest.mark.parametrize("stamp", [digits(17), digits(9), lambda t: np.round(t, 3)])
def test_removed_rows_are_gaps_in_a_grid(stamp):
    taken = sampling(stamp(GRID)[np.arange(281) % 37 != 30])
    assert not taken.even
    assert taken.missing == 7
    assert np.ptp(taken.times - GRID[np.arange(281) % 37 != 30]) < 2e-4  # of a third of the last digit at most


@pytest.mark.parametrize(
    "times",
    [
        GRID + 0.01 / 7 * np.random.default_rng(0).uniform(-1, 1, 281),
        np.round(GRID + 0.03 / 7 * np.random.default_rng(1).uniform(-1, 1, 281), 4),
        np.where(GRID > 20, GRID + 0.03, GRID),  # a pause
        np.where(np.arange(281) > 99, 0.1 * np.arange(281) + 0.02, 0.1 * np.arange(281)),  # of whole digits
        np.cumsum(np.random.default_rng(2).exponential(1.0, 281)),
        np.geomspace(1, 50, 281),
        np.linspace(0, 6, 281) ** 2,
    ],
)
def test_uneven_times_are_taken_as_they_are(times):
    taken = sampling(times)
    assert not taken.even
    assert taken.times is not None
    assert np.array_equal(taken.times, times)


@pytest.mark.parametrize(
    "times",
    [
        GRID + 0.01 / 7 * np.random.default_rng(0).uniform(-1, 1, 281),
        GRID + 0.3 / 7 * np.random.default_rng(0).uniform(-1, 1, 281),
        GRID[np.random.default_rng(1).random(281) > 0.1],
        GRID[np.random.default_rng(1).random(281) > 0.4],
        np.where(GRID > 20, GRID + 9.0, GRID),
        np.sort(np.random.default_rng(2).uniform(0, 40, 281)),
        np.concatenate([k * 1.3 + 0.1 * np.arange(8) for k in range(30)]),
    ],
)
def test_noise_is_found_at_any_times(times):
    ring = np.exp(-times / 12) * (np.cos(0.95 * times) + 0.6 * np.cos(1.47 * times + 1.1))
    found = [
        noise_of(ring + 0.01 * np.random.default_rng(seed).standard_normal(times.size), times) for seed in range(40)
    ]
    # of one record to about a tenth; a motion seen through the widest windows may add as much again
    assert np.mean(found) == pytest.approx(0.01, rel=0.06)


def test_a_missing_sample_weighs_the_same_dropped_or_removed():
    values = np.cos(0.95 * GRID) + 0.01 * np.random.default_rng(0).standard_normal(281)
    keep = np.arange(281) % 37 != 30
    dropped = np.where(keep, values, np.nan)
    assert noise_of(values[keep], GRID[keep]) == pytest.approx(noise_of(dropped, GRID), rel=1e-9)
    every_fifth = np.where(np.arange(281) % 5, values, np.nan)  # no seven neighbours are left
    assert noise_of(every_fifth, GRID) == pytest.approx(0.01, rel=0.3)


@pytest.fixture(scope="module")
def sevenths():
    """A record with a step of a seventh, its noise white."""
    conditions = Reduced(0.08, 0.9, 1.2, 0.004)
    constants = Coefficients.with_decay_time(3.0, 0.85, 0.2, tau=12.0, viscosity=0.004)
    clean = simulate(conditions, constants, initial=(-0.10, 0.05, 0.0, 0.0), times=GRID)
    return add_noise(clean, 0.01, 0)


def refitted(trace, times, keep=slice(None)):
    channels = {name: np.asarray(values)[keep] for name, values in trace.channels.items()}
    return fit_trajectories(Trace(times[keep], channels, trace.conditions), starts=0)


@pytest.mark.parametrize("stamp", [digits(9), lambda t: np.round(t, 3)])
def test_a_fit_does_not_see_how_stamps_are_rounded(sevenths, stamp):
    trace = sevenths
    exact = refitted(trace, GRID)
    rounded = refitted(trace, stamp(GRID))
    assert rounded.reduced_chi_square == pytest.approx(exact.reduced_chi_square, rel=1e-4)
    for name in ("alpha1", "alpha2", "k_vs", "beta1"):
        assert rounded[name].stderr == pytest.approx(exact[name].stderr, rel=1e-3)
        assert abs(rounded[name].value - exact[name].value) < 0.05 * exact[name].stderr
    assert not rounded.warnings


@pytest.mark.long
def test_a_fit_with_rows_removed_is_as_good_and_says_what_was_done(sevenths):
    trace = sevenths
    exact = refitted(trace, GRID)
    gaps = refitted(trace, GRID, np.arange(281) % 37 != 30)
    assert gaps.reduced_chi_square == pytest.approx(exact.reduced_chi_square, rel=0.1)
    assert gaps["alpha1"].stderr == pytest.approx(exact["alpha1"].stderr, rel=0.1)
    assert "7 samples of the grid are missing" in gaps.report()
    assert "misfit" not in gaps.report()


@pytest.mark.long
def test_a_motion_that_the_model_lacks_is_a_misfit_at_uneven_times_too(sevenths):
    trace = sevenths
    keep = np.arange(281) % 37 != 30
    channels = {name: np.asarray(values) for name, values in trace.channels.items()}
    channels["S"] = channels["S"] + 0.1 * np.std(channels["S"]) * np.cos(2.9 * GRID)
    with pytest.warns(match="misfit"):
        found = refitted(Trace(GRID, channels, trace.conditions), GRID, keep)
    assert found.reduced_chi_square > 4


def test_a_batch_takes_times_and_noise_as_single_fits_do(sevenths):
    channels = {name: np.asarray(values) for name, values in sevenths.channels.items()}
    keep = np.arange(281) % 37 != 30
    cut = {name: values[keep] for name, values in channels.items()}
    rounded = Trace(np.round(GRID, 3), channels, sevenths.conditions)
    gaps = Trace(np.round(GRID, 3)[keep], cut, sevenths.conditions)
    (even, uneven), unusable = bucketed(stacked([rounded, gaps]))
    assert not unusable.any()
    assert even.elapsed is None
    assert even.steps[0] == pytest.approx(1 / 7, rel=1e-6)
    one = record(gaps, ("V", "S"), RestState(1.0, 1.0))
    assert uneven.noise is not None
    assert uneven.elapsed is not None
    np.testing.assert_allclose(uneven.noise[0], 1 / one.weight[:, 0], rtol=1e-9)
    np.testing.assert_allclose(uneven.elapsed[0, : keep.sum()], one.elapsed, rtol=1e-12)


@pytest.mark.slow
def test_a_batch_weighs_as_single_fits_do(sevenths):
    channels = {name: np.asarray(values) for name, values in sevenths.channels.items()}
    keep = np.arange(281) % 37 != 30
    lost = {name: np.where(keep, values, np.nan) for name, values in channels.items()}
    cut = {name: values[keep] for name, values in channels.items()}
    traces = [
        Trace(np.round(GRID, 3), channels, sevenths.conditions),
        Trace(GRID[keep], cut, sevenths.conditions),
        Trace(GRID, lost, sevenths.conditions),
    ]
    found = fit_batch(traces)
    assert found.ok.all()
    for row, trace in enumerate(traces):
        single = fit_trajectories(trace, starts=0, missing="drop", noise="white")
        assert found.chi_square[row] == pytest.approx(single.chi_square, rel=1e-6)
        for name in ("alpha1", "alpha2", "k_vs", "beta1"):
            assert abs(found[name][row] - single[name].value) < 1e-3 * single[name].stderr
            assert found.error_of(name)[row] == pytest.approx(single[name].stderr, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("stamps", ["9 digits", "3 digits", "jitter", "removed"])
def test_two_thousand_intervals_hold_the_truth_whatever_the_stamps(stamps):
    coverage = runpy.run_path(str(BENCHMARKS / "coverage.py"))["coverage"]

    share, lost, reduced = coverage(0.0, 2000, "auto", stamps)
    exact = coverage(0.0, 200)[2]
    assert lost == 0
    assert np.all((share > 0.93) & (share < 0.97)), share
    assert reduced == pytest.approx(exact, rel=0.1)

"""Autocorrelated noise, in batches: tested, fitted and told apart from misfits as in single fits."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from jshell.calibration import fit_batch, fit_trajectories
from jshell.oscillator import random_shell, random_trace
from jshell.trace import Trace
from tests.calibration.test_noise import autocorrelated

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = ("alpha1", "alpha2", "k_vs", "beta1")


def noisy(memory: float, seed: int, keep=slice(None)) -> Trace:
    clean = random_trace(random_shell(0), 0, noise=0.0)
    channels = {
        name: (values + 0.01 * np.std(values) * autocorrelated(memory, 10 * seed + k))[keep]
        for k, (name, values) in enumerate((name, np.asarray(v)) for name, v in clean.channels.items())
    }
    return Trace(np.asarray(clean.times)[keep], channels, clean.conditions)


def lacking(seed: int) -> Trace:
    """White noise, and a motion that the model does not have."""
    trace = noisy(0.0, seed)
    S = np.asarray(trace["S"])
    return Trace(
        trace.times,
        {"V": trace["V"], "S": S + 0.05 * S.std() * np.cos(3.1 * np.asarray(trace.times))},
        trace.conditions,
    )


def agree(found, row: int, trace: Trace) -> None:
    single = fit_trajectories(trace, starts=0)
    assert found.memory[row] == pytest.approx([one.memory for one in single.noise], abs=1e-3)
    assert found.chi_square[row] == pytest.approx(single.chi_square, rel=1e-4)
    for name in NAMES:
        one = single[name]
        assert abs(found[name][row] - one.value) < 2e-3 * one.stderr
        assert found.error_of(name)[row] == pytest.approx(one.stderr, rel=2e-3)
        low, high = (end[row] for end in found.interval(name))
        assert (low, high) == pytest.approx(single.interval(name), abs=5e-3 * one.stderr)
    assert found.misfit[row] == any(text.startswith("misfit") for text in single.warnings)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
def test_rows_of_a_batch_are_single_fits_whatever_their_noise():
    traces = [noisy(0.0, 1), noisy(0.5, 2), noisy(0.9, 3), lacking(4)]
    found = fit_batch(traces)
    for row, trace in enumerate(traces):
        agree(found, row, trace)
    assert list(found.memory.max(axis=1) > 0.3)[:3] == [False, True, True]
    assert list(found.misfit) == [False, False, False, True]
    assert "autocorrelated" in str(found)

    white = fit_batch(traces[:3], noise="white")
    assert not white.memory.any()
    assert white.error_of("alpha1")[2] < 0.7 * found.error_of("alpha1")[2]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
def test_uneven_rows_and_fixed_constants_are_single_fits_too():
    keep = np.arange(400) % 37 != 30
    found = fit_batch([noisy(0.8, 5, keep)])
    agree(found, 0, noisy(0.8, 5, keep))
    trace = noisy(0.8, 6)
    held = fit_batch([trace], fix={"alpha2": 1.5})
    single = fit_trajectories(trace, fix={"alpha2": 1.5}, starts=0)
    assert held.memory[0] == pytest.approx([one.memory for one in single.noise], abs=1e-3)
    for name in ("alpha1", "k_vs", "beta1"):
        assert held.error_of(name)[0] == pytest.approx(single[name].stderr, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "low", "high"), [(0.0, 0.93, 0.97), (0.5, 0.92, 0.97), (0.9, 0.90, 0.99)])
def test_two_thousand_intervals_of_a_batch_hold_the_truth(memory, low, high):
    share, lost = runpy.run_path(str(BENCHMARKS / "coverage.py"))["batch_coverage"](memory, 2000)
    assert np.all((share > low) & (share < high)), share
    assert lost <= 20  # false alarms

"""What is left of a fit: white, autocorrelated or coherent; and intervals that hold the truth."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import jshell as js
from jshell.calibration import FitWarning, fit_trajectories
from jshell.calibration.misfit import DRIFTS, drift_share
from jshell.calibration.noise import Noise, ar1_memory, estimate_memory, examine, lag_one, runs, steps_between, whiten
from jshell.oscillator import random_shell, random_trace, simulate
from jshell.trace import Trace

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TIMES = np.linspace(0, 40, 400)
COLUMNS = np.stack([np.cos(TIMES), np.sin(TIMES), np.ones(400), TIMES / 40], axis=1)


def autocorrelated(phi: float, seed: int, size: int = 400) -> np.ndarray:
    fresh = np.random.default_rng(seed).standard_normal(size)
    e = fresh.copy()
    for k in range(1, size):
        e[k] = phi * e[k - 1] + np.sqrt(1 - phi**2) * fresh[k]
    return e


def left_by(e: np.ndarray) -> np.ndarray:
    return e - COLUMNS @ np.linalg.lstsq(COLUMNS, e, rcond=None)[0]


def test_white_noise_passes():
    found = [examine("V", left_by(autocorrelated(0.0, seed)), COLUMNS, TIMES, np.ones(400)) for seed in range(200)]
    assert not any(one.correlated or one.coherent for one in found)
    # lag-1 and runs are standard normal in white noise: 200 of them have mean 0 ± 0.07, deviation 1 ± 0.05
    assert abs(np.mean([runs(autocorrelated(0.0, seed)) for seed in range(200)])) < 0.25
    assert np.std([lag_one(autocorrelated(0.0, seed))[1] for seed in range(200)]) == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize(
    ("effective", "worth"),
    [
        (22.4, "22 samples' worth"),
        (1.2, "one sample's worth"),
        (0.8, "worth less than one sample"),
        (0.2, "worth less than one sample"),
    ],
)
def test_a_report_says_what_samples_are_worth(effective, worth):
    told = Noise("W [1]", 124, 0.93, 10.4, -9.9, 0.998, effective, 1.0, 1.0).words()
    assert told.endswith(f"autocorrelated, φ = 0.998: {worth}")


def test_memory_is_estimated_without_the_bias_of_a_residual():
    steps = steps_between(TIMES)
    found = np.array([estimate_memory(left_by(autocorrelated(0.9, seed)), COLUMNS, steps) for seed in range(60)])
    naive = np.array([lag_one(left_by(autocorrelated(0.9, seed)))[0] for seed in range(60)])
    # standard error of the mean of 60: sqrt(1 - 0.81)/sqrt(400 · 60) = 0.003
    assert found.mean() == pytest.approx(0.9, abs=0.01)
    assert naive.mean() < 0.885


def test_whitening_gives_the_fresh_part_back_and_respects_gaps():
    fresh = np.random.default_rng(0).standard_normal(400)
    e = autocorrelated(0.7, 0)
    np.testing.assert_allclose(whiten(e, 0.7)[1:], fresh[1:], atol=1e-12)
    used = np.arange(400) != 5
    phi = ar1_memory(0.7, steps_between(TIMES, used))
    assert phi[5] == phi[6] == 0
    assert phi[7] == pytest.approx(0.7)
    assert ar1_memory(0.7, np.array([1.0, 2.0]))[1] == pytest.approx(0.49)


def test_a_leftover_motion_is_coherent_and_autocorrelated_noise_is_not():
    wave = np.exp(-TIMES / 8) * np.cos(1.7 * TIMES) + 0.02 * autocorrelated(0.0, 1)
    assert examine("V", wave, COLUMNS, TIMES, np.ones(400)).coherent
    noise = examine("V", left_by(autocorrelated(0.9, 2)), COLUMNS, TIMES, np.ones(400))
    assert noise.correlated
    assert not noise.coherent
    assert noise.effective < 60


def test_errors_grow_where_noise_is_autocorrelated_and_the_report_says_so(shell, fit):
    clean = simulate(shell.conditions, shell.coefficients, initial=shell.initial, times=TIMES, equilibrium=shell.state)
    channels = {
        name: np.asarray(values) + 0.01 * np.std(values) * autocorrelated(0.9, k)
        for k, (name, values) in enumerate(clean.channels.items())
    }
    noisy = Trace(TIMES, channels, clean.conditions)
    found = fit_trajectories(noisy)
    with pytest.warns(FitWarning, match="take it as white are too small"):
        white = fit_trajectories(noisy, noise="white")
    assert found["alpha1"].stderr > 1.5 * white["alpha1"].stderr
    assert "autocorrelated noise" in found.report()
    assert "autocorrelated noise" not in white.report()
    assert "taken as white" in white.report()
    assert "autocorrelated" not in fit.report()
    for name in ("alpha1", "alpha2", "k_vs", "beta1"):
        assert abs(found[name].value - getattr(shell.coefficients, name)) < 4 * found[name].stderr
    assert found.freedom < 0.2 * white.freedom


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "low", "high"), [(0.0, 0.935, 0.965), (0.9, 0.90, 0.99)])
def test_two_thousand_intervals_hold_the_truth_as_often_as_they_say(memory, low, high):
    coverage = runpy.run_path(str(BENCHMARKS / "coverage.py"))["coverage"]

    share, lost, _ = coverage(memory, 2000)
    assert lost == 0
    assert np.all((share > low) & (share < high)), share


@pytest.mark.parametrize("shape", ["line", "fading", "wave", "noise"])
def test_a_drift_is_told_from_waves_and_noise(shape):
    t = np.linspace(0.0, 40.0, 400)
    noise = 0.2 * np.random.default_rng(0).standard_normal(t.size)
    left = {"line": t / 40 - 0.5, "fading": np.exp(-t / 15) - 0.35, "wave": np.cos(0.9 * t), "noise": 0 * t}[shape]
    assert (drift_share(t, left + noise) > DRIFTS) == (shape in ("line", "fading"))


@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
@pytest.mark.parametrize("third", [0.0, 0.05, 0.15])
def test_a_motion_that_the_model_lacks_is_not_taken_for_noise_that_remembers(third):
    """By the memory of its residual a third mode, taken for noise, moved ω- by three of its errors."""
    t, random = np.linspace(0.0, 40.0, 400), np.random.default_rng(0)
    modes = ((0.2, 1.08, 0.3), (0.15, 1.75, 1.0), (third, 3.6, 2.0))
    V = 2.9 + sum(a * np.exp(-t / 6.5) * np.cos(w * t + p) for a, w, p in modes)
    trace = Trace(t, {"V": V + 1e-6 * random.standard_normal(t.size)}, js.presets.R.conditions)
    white, found = (fit_trajectories(trace, "modal", channels=["V"], noise=noise) for noise in ("white", "auto"))
    assert [one.memory > 0 for one in found.noise] == [third > 0]
    assert [one.value for one in found.derived] == [one.value for one in white.derived]
    assert found.chi_square == white.chi_square
    assert any(text.startswith("misfit") for text in found.warnings) == (third > 0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
def test_a_fit_of_a_record_that_drifts_says_so():
    clean = random_trace(random_shell(0), 0)
    V = np.asarray(clean["V"]) * (1 + 0.004 * np.asarray(clean.times))
    found = fit_trajectories(Trace(clean.times, {"V": V, "S": clean["S"]}, clean.conditions), starts=0)
    assert any(text.startswith("misfit") and "slow drift" in text for text in found.warnings)

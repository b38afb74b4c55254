"""Many records of many kinds: few false alarms, no bias, errors that hold."""

import json
import resource
import subprocess
import sys

import numpy as np
import pytest

from jshell.signals import Signature, extract
from jshell.trace import Trace

KINDS = ("white", "AR(0.5)", "AR(0.9)", "jitter", "gaps", "three channels", "rounded", "digitised")


def coloured(random: np.random.Generator, size: int, memory: float) -> np.ndarray:
    """AR(1) noise of unit variance."""
    fresh = random.standard_normal(size)
    noise = fresh.copy()
    for k in range(1, size):
        noise[k] = memory * noise[k - 1] + np.sqrt(1 - memory**2) * fresh[k]
    return noise


def good(seed: int) -> tuple[Trace, np.ndarray, int]:
    """A record that one or two modes describe, with (ω-, ω+, τ) and the number of modes."""
    random, kind = np.random.default_rng(seed), KINDS[seed % len(KINDS)]
    span, size = random.uniform(30, 80), int(random.integers(200, 1200))
    times = np.linspace(0, span, size)
    if kind == "jitter":
        times = np.sort(times + random.uniform(-0.3, 0.3, size) * span / size)
    if kind == "gaps":
        kept = np.ones(size, dtype=bool)
        for _ in range(3):
            at = random.integers(0, size - 20)
            kept[at : at + random.integers(3, 20)] = False
        times = times[kept]
    slow, ratio, tau = random.uniform(0.6, 1.4), random.uniform(1.2, 2.6), random.uniform(6, 20)
    level, modes = 10 ** random.uniform(-3.5, -1.3), 2 if random.random() < 0.8 else 1
    memory = {"AR(0.5)": 0.5, "AR(0.9)": 0.9}.get(kind, 0.0)
    channels = {}
    for name in "VHW" if kind == "three channels" else "V":
        fast = 10 ** random.uniform(-1, 0.3) * (modes > 1)
        phases = random.uniform(0, 2 * np.pi, 2)
        waves = np.cos(slow * times + phases[0]) + fast * np.cos(ratio * slow * times + phases[1])
        values = 3 + np.exp(-times / tau) * waves + level * coloured(random, times.size, memory)
        if kind == "rounded":
            values = np.round(values, random.integers(3, 6))
        if kind == "digitised":
            step = 4 / 2 ** random.integers(8, 13)
            values = np.round(values / step) * step
        channels[name] = values
    return Trace(times, channels), np.array([np.hypot(slow, 1 / tau), np.hypot(ratio * slow, 1 / tau), tau]), modes


def z_of(found: Signature, truth: np.ndarray) -> np.ndarray:
    """Errors over standard errors; none of ω+ where one mode is heard."""
    pairs = zip(("omega_minus", "omega_plus", "tau"), truth, strict=True)
    return np.array([(getattr(found, k) - v) / found.stderr[k] for k, v in pairs if getattr(found, k) is not None])


def survey(seeds: range) -> tuple[int, np.ndarray]:
    """False alarms, and all z of the records that are called sound."""
    alarms, z = 0, []
    for seed in seeds:
        trace, truth, modes = good(seed)
        found = extract(trace, start=float(trace.times[0]))
        alarms += not found.sound
        if found.sound and (found.verdict == "two") == (modes == 2):
            z.append(z_of(found, truth))
    return alarms, np.concatenate(z)


@pytest.mark.long
def test_good_records_are_called_good_and_their_errors_hold():
    alarms, z = survey(range(60))
    assert alarms <= 1
    assert 0.8 < z.std() < 1.25  # of 150 numbers, nearly independent


@pytest.mark.slow
def test_false_alarms_are_fewer_than_one_in_a_hundred():
    alarms, z = survey(range(1000))
    assert alarms <= 10
    assert 0.95 < z.std() < 1.08
    assert np.mean(np.abs(z) < 1.96) == pytest.approx(0.95, abs=0.02)


def drifting(seed: int, drift: float, shape: str) -> Trace:
    """A camera's record of the height [mm]."""
    times = np.linspace(0, 40, 230)
    ring = np.exp(-times / 10) * (np.cos(0.95 * times + 0.3) + 0.5 * np.cos(1.5 * times + 1.0))
    leak = times / 40 if shape == "line" else 1 - np.exp(-times / 12)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(times.size)
    return Trace(times, {"H": 30 + ring + drift * leak + noise})


def drifted(seeds: range, drift: float, shape: str) -> tuple[int, np.ndarray]:
    """Flagged without a drift term; mean z of ω-, ω+ and τ with one."""
    truth = np.array([np.hypot(0.95, 0.1), np.hypot(1.5, 0.1), 10.0])
    flagged = sum(not extract(drifting(seed, drift, shape), start=0.0).sound for seed in seeds)
    z = [z_of(extract(drifting(seed, drift, shape), start=0.0, drift="auto"), truth) for seed in seeds]
    return flagged, np.mean(z, axis=0)


@pytest.mark.parametrize("drift", [0.2, pytest.param(0.6, marks=pytest.mark.long)])
def test_a_drift_of_tenths_of_a_millimetre_is_flagged_without_its_term(drift):
    flagged, z = drifted(range(2), drift, "line")
    assert flagged == 2
    assert np.all(np.abs(z) < 4 / np.sqrt(2))


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["line", "exponential"])
@pytest.mark.parametrize("drift", [0.0, 0.2, 0.6])
def test_a_drift_moves_no_frequency_once_it_is_allowed_for(drift, shape):
    flagged, z = drifted(range(200), drift, shape)
    assert flagged <= 2 if drift == 0 else flagged == 200
    assert np.all(np.abs(z[:2]) < 0.25)


def long_record(size: int) -> tuple[Trace, np.ndarray]:
    """Forty units of time, finely sampled, with its (ω-, ω+, τ)."""
    times = np.linspace(0, 40, size)
    ring = np.exp(-times / 12) * (0.5 * np.cos(0.954 * times + 0.3) + 0.3 * np.cos(1.474 * times + 1.1))
    noise = 0.01 * np.random.default_rng(0).standard_normal(size)
    return Trace(times, {"V": 3 + ring + noise}), np.array([np.hypot(0.954, 1 / 12), np.hypot(1.474, 1 / 12), 12.0])


@pytest.mark.long
def test_a_long_record_is_heard_by_all_its_samples():
    trace, truth = long_record(100_000)
    found = extract(trace, start=0.0)
    assert (found.verdict, found.sound) == ("two", True)
    assert np.all(np.abs(z_of(found, truth)) < 4)
    short = extract(long_record(1000)[0], start=0.0)
    # a hundred times the samples: a tenth of the error
    assert found.stderr["tau"] == pytest.approx(short.stderr["tau"] / 10, rel=0.1)
    assert found.noise == pytest.approx(short.noise, rel=0.1)


@pytest.mark.slow
def test_a_million_samples_take_seconds_and_little_memory(tmp_path):
    trace, truth = long_record(1_000_000)
    path = tmp_path / "long.csv"
    np.savetxt(path, np.c_[trace.times, trace["V"]], delimiter=",", header="t,V", comments="", fmt="%.9g")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "jshell", "analyse", str(path), "--from", "0", "--json"]
    out = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert used.ru_utime - before.ru_utime < 20  # of the processor: others may be at work
    assert used.ru_maxrss < 1.5e6  # kilobytes
    found = json.loads(out)
    assert found["verdict"] == "two"
    assert abs(found["tau"] - truth[2]) < 4 * found["stderr"]["tau"]

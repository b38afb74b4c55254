"""What two modes do not describe is said: never ok and wrong."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from jshell.errors import Outcome
from jshell.signals import Signature, extract
from jshell.trace import Trace


def also(*given):
    """A neighbour of a case that is tested always: among the slow tests."""
    return pytest.param(*given, marks=pytest.mark.slow)


def later(*given):
    """A case of seconds: among the long tests, which continuous integration runs as well."""
    return pytest.param(*given, marks=pytest.mark.long)


TIMES = np.linspace(0.0, 40.0, 401)
SLOW, FAST, TAU, NOISE = 0.954, 1.474, 12.0, 1e-3


def ring(times, tau=TAU, slow=1.0, fast=0.6, fast_tau=None):
    fading = np.exp(-times / tau), np.exp(-times / (tau if fast_tau is None else fast_tau))
    return fading[0] * slow * np.cos(SLOW * times + 0.3) + fading[1] * fast * np.cos(FAST * times + 1.1)


def noisy(values, seed, level=NOISE):
    return values + level * np.random.default_rng(seed).standard_normal(values.size)


def identified(values, seed=0, times=TIMES, level=NOISE, **given) -> Signature:
    return extract(Trace(times, {"V": 3 + noisy(values, seed, level)}), start=0.0, **given)


def right(found: Signature, slow=SLOW, fast=FAST, tau=TAU) -> bool:
    """Within 4.5 standard errors of the truth."""
    if found.omega_plus is None or found.omega_minus is None or found.tau is None:
        return False
    numbers = (found.omega_minus, found.omega_plus, found.tau)
    truth = (np.hypot(slow, 1 / tau), np.hypot(fast, 1 / tau), tau)
    errors = [found.stderr[name] for name in ("omega_minus", "omega_plus", "tau")]
    return all(abs(a - b) < 4.5 * error for a, b, error in zip(numbers, truth, errors, strict=True))


DRIFTS = {
    "gas leak": (1.2 * np.exp(-TIMES / 15), "exponential"),
    "small leak": (0.02 * np.exp(-TIMES / 10), "exponential"),
    "warming": (0.03 * TIMES, "line"),
    "slow warming": (4e-5 * TIMES, "line"),
}


@pytest.mark.parametrize("kind", ["gas leak", later("small leak"), later("warming"), "slow warming"])
@pytest.mark.parametrize("seed", [0, also(1)])
def test_a_drift_is_flagged_and_right_once_it_is_allowed_for(kind, seed):
    drift, name = DRIFTS[kind]
    flagged = identified(ring(TIMES) + drift, seed)
    assert not flagged.sound
    assert flagged.verdict == "misfit"
    assert f'drift="{name}"' in " ".join(flagged.warnings)
    found = identified(ring(TIMES) + drift, seed, drift="auto")
    assert (found.drift, found.verdict, found.sound) == (name, "two", True)
    assert right(found)


def test_a_record_about_zero_needs_no_offset():
    values = noisy(ring(TIMES), 2)
    found = extract(Trace(TIMES, {"V": values}), start=0.0, drift="none")
    assert found.sound
    assert right(found)
    assert found.offsets == {"V": 0.0}
    assert not extract(Trace(TIMES, {"V": 0.5 + values}), start=0.0, drift="none").sound


def test_without_a_drift_none_is_found():
    found = identified(ring(TIMES), 3, drift="auto")
    assert (found.drift, found.sound) == ("constant", True)


@pytest.mark.parametrize(("tau", "fast_tau"), [(20.0, 4.0), (12.0, 10.0), also(6.0, 9.0)])
def test_decays_of_their_own_are_named(tau, fast_tau):
    found = identified(ring(TIMES, tau, fast_tau=fast_tau))
    assert found.verdict == "misfit"
    assert "decays of their own" in found.warnings[0]
    assert f"τ = {tau:.3g}"[:5] in found.warnings[0]


@pytest.mark.parametrize(
    ("at", "size"), [(20.0, 1.0), later(10.0, 0.1), also(10.0, 1.0), also(31.7, 1.0), also(20.0, 0.1), also(31.7, 0.1)]
)
def test_a_second_kick_is_named_with_its_time(at, size):
    again = np.where(at <= TIMES, ring(TIMES - at, slow=-0.8 * size, fast=0.7 * size), 0.0)
    found = identified(ring(TIMES) + again)
    assert found.verdict == "misfit"
    told = found.warnings[0].partition("second kick at t = ")[2]
    assert float(told.split(" ")[0]) == pytest.approx(at, abs=0.2)  # two samples
    before = extract(Trace(TIMES, {"V": 3 + noisy(ring(TIMES) + again, 0)}), start=0.0, stop=at - 0.2)
    assert before.sound
    assert right(before)


@pytest.mark.parametrize("count", [3, later(15), also(4), also(6)])
def test_more_modes_than_two_are_flagged(count):
    random = np.random.default_rng(count)
    turns, phases = 0.9 * 1.25 ** np.arange(count), random.uniform(0, 6, count)
    sizes = random.uniform(0.3, 1.0, (count, 1))
    found = identified(np.exp(-TIMES / TAU) * np.sum(sizes * np.cos(np.outer(turns, TIMES) + phases[:, None]), axis=0))
    assert not found.sound
    assert found.verdict in (("more than two",) if count == 3 else ("more than two", "misfit"))


@pytest.mark.parametrize("gap", [0.03, 0.06, also(0.02), also(0.1)])
@pytest.mark.parametrize("phase", [1.0, also(2.5)])
def test_two_modes_close_together_are_told_apart_or_flagged(gap, phase):
    times = np.linspace(0.0, 60.0, 601)
    found = identified(np.exp(-times / TAU) * (np.cos(1.4 * times) + np.cos((1.4 + gap) * times + phase)), times=times)
    assert right(found, 1.4, 1.4 + gap) if gap >= 0.03 else right(found, 1.4, 1.4 + gap) or not found.sound


@pytest.mark.parametrize(("level", "silent"), [later(0.006, 0), also(0.009, 1)])
def test_a_pair_hardly_told_apart_is_rarely_called_one_mode_in_silence(level, silent):
    times = np.linspace(0.0, 25.0, 250)  # a sixth of a beat
    pair = np.exp(-times / 18) * (np.cos(0.9 * times) + 0.33 * np.cos(0.938 * times + 1.0))
    found = [identified(pair, seed, times=times, level=level) for seed in range(6)]
    assert sum(one.sound and not right(one, 0.9, 0.938, 18.0) for one in found) <= silent


@pytest.mark.long
def test_a_pair_too_near_for_its_record_is_flagged_where_one_mode_is_the_less_likely():
    times = np.linspace(0.0, 60.0, 601)  # a fifth of a beat; one mode leaves a χ² of 19 without noise
    pair = np.exp(-times / TAU) * (np.cos(1.4 * times) + np.cos(1.42 * times + 1.0))
    found = [identified(pair, seed, times=times, level=0.01) for seed in range(6)]
    assert sum("close together" in " ".join(one.warnings) for one in found) >= 3


@pytest.mark.parametrize(("seed", "apart"), [later(394, "0.035"), (430, "0.14")])
def test_a_pair_with_errors_as_large_as_a_tenth_of_its_distance_is_flagged(seed, apart):
    """A third of a beat: one frequency lay more than four of its errors away, and nothing was said."""
    made = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "listening.py"))["record"](seed)
    found = extract(made[1], start=0.0)
    assert found.verdict == "two"
    assert not found.sound
    assert f"ω+ - ω- = {apart} ±" in " ".join(found.warnings)


@pytest.mark.parametrize("share", [0.003, also(0.01), also(0.03)])
def test_a_quiet_second_mode_counts_by_the_noise_not_by_the_loud_one(share):
    found = identified(ring(TIMES, fast=share), level=2e-4)
    assert (found.verdict, found.sound) == ("two", True)
    assert right(found)


def test_one_mode_is_reported_as_one():
    found = identified(ring(TIMES, fast=0.0), 4)
    assert (found.verdict, found.sound) == ("one", True)
    assert found.omega_plus is None
    assert np.isnan(found.stderr["omega_plus"])
    assert found.omega_minus == pytest.approx(np.hypot(SLOW, 1 / TAU), abs=4 * found.stderr["omega_minus"])


@pytest.mark.parametrize("memory", [0.5, later(0.9)])
def test_autocorrelated_noise_is_no_misfit_and_widens_the_errors(memory):
    fresh = np.random.default_rng(5).standard_normal(TIMES.size) * np.sqrt(1 - memory**2)
    noise = np.zeros(TIMES.size)
    for k in range(1, TIMES.size):
        noise[k] = memory * noise[k - 1] + fresh[k]
    found = identified(ring(TIMES) + 0.02 * noise, level=0.0)
    assert found.sound
    assert right(found)
    assert found.stderr["omega_minus"] > 1.4 * identified(ring(TIMES), 5, level=0.02).stderr["omega_minus"]
    assert "autocorrelated" in found.notes[0]


@pytest.mark.parametrize(("ratio", "sure"), [(2.0, True), (2.03, None)])
def test_twice_the_slow_frequency_is_an_overtone(ratio, sure):
    slow = np.cos(0.8 * TIMES) + 0.3 * np.cos(0.8 * ratio * TIMES + 1)
    found = identified(np.exp(-TIMES / TAU) * slow)
    told = [text for text in (*found.warnings, *found.notes) if "overtone" in text]
    assert bool(told) == bool(sure)
    assert found.sound is not bool(sure)


def test_growth_is_named():
    found = identified(np.exp(TIMES / 30) * np.cos(SLOW * TIMES) + 0.3 * np.exp(TIMES / 30) * np.cos(FAST * TIMES))
    assert not found.sound
    assert "grows" in " ".join(found.warnings)


def test_a_ring_that_does_not_decay_is_named():
    found = identified(np.cos(SLOW * TIMES) + 0.5 * np.cos(FAST * TIMES))
    assert not found.sound
    assert "decay" in " ".join(found.warnings)


@pytest.mark.parametrize("turns", [0.4, 0.7])
def test_less_than_a_period_is_said(turns):
    times = np.linspace(0.0, turns * 2 * np.pi / SLOW, 300)
    found = identified(np.exp(-times / TAU) * np.cos(SLOW * times), times=times)
    assert not found.sound


@pytest.mark.parametrize(
    ("step", "low", "high"),
    [(0.0, -np.inf, 3.8), later(0.01, 2.4, np.inf), also(0.0, 2.4, np.inf), also(0.01, -np.inf, 3.8)],
)
def test_clipping_is_named_on_its_channel(step, low, high):
    def rounded(values):
        return np.round(values / step) * step if step else values

    whole, other = 3 + noisy(ring(TIMES), 6), 2 + noisy(0.5 * ring(TIMES), 7)
    clipped = Trace(TIMES, {"H": rounded(other), "W": rounded(np.clip(whole, low, high))})
    found = extract(clipped, start=0.0)
    assert not found.sound
    told = [text for text in found.warnings if "clipped" in text]
    assert len(told) == 1
    assert told[0].startswith("W is clipped")
    assert not [t for t in extract(Trace(TIMES, {"W": rounded(whole)}), start=0.0).warnings if "clipped" in t]


@pytest.mark.parametrize(("step", "sound"), [(0.01, True), (0.2, False)])
def test_digitising_is_named(step, sound):
    values = 3 + noisy(ring(TIMES), 8)
    found = extract(Trace(TIMES, {"V": np.round(values / step) * step}), start=0.0)
    told = found.notes if sound else found.warnings
    assert any(text.startswith("V is digitised in steps of") for text in told)
    assert found.sound is sound


def test_white_noise_is_refused():
    for seed in range(3):
        found = identified(0 * TIMES, seed, level=0.1)
        assert found.outcome == Outcome.UNUSABLE_DATA

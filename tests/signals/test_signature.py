"""What is extracted is what was put in, and what cannot be extracted is said."""

import tracemalloc

import numpy as np
import pytest
from scipy.optimize import curve_fit

from jshell.calibration.data import windowed
from jshell.errors import BadName, BadValue, NotOk, Outcome
from jshell.shell.parameters import Reduced
from jshell.signals import dip, extract, ring_down_start
from jshell.trace import Trace

R_BUCKLED = Reduced(0.22, 0.9, 1.62, 0.004)
TIMES = np.linspace(0.0, 40.0, 401)
TAU = 8.0


def ring(times: np.ndarray, *modes: tuple[float, float, float]) -> np.ndarray:
    """Damped sinusoids (amplitude, Ω, phase) of one decay time."""
    return np.exp(-times / TAU) * sum(A * np.cos(w * times + phase) for A, w, phase in modes)


SLOW, FAST, THIRD = (1.0, 1.05, 0.3), (0.5, 1.75, -1.0), (0.4, 2.9, 2.0)


@pytest.mark.parametrize(
    ("modes", "expected"), [((SLOW,), "one"), ((SLOW, FAST), "two"), ((SLOW, FAST, THIRD), "more than two")]
)
def test_the_verdict_counts_the_modes_put_in(modes, expected):
    noise = 0.01 * np.random.default_rng(0).standard_normal(TIMES.size)
    assert extract(Trace(TIMES, {"V": 3 + ring(TIMES, *modes) + noise}), start=0.0).verdict == expected


def test_noise_alone_never_asks_for_a_mode():
    noise = 0.2 * np.random.default_rng(1).standard_normal(TIMES.size)
    assert extract(Trace(TIMES, {"V": 3 + ring(TIMES, SLOW) + noise}), start=0.0).verdict == "one"


def test_two_modes_are_heard_as_scipy_fits_them():
    noise = 0.02 * np.random.default_rng(2).standard_normal(TIMES.size)
    data = 3 + ring(TIMES, SLOW, FAST) + noise

    def model(t, w1, w2, tau, a, b, c, d, offset):
        wave = a * np.cos(w1 * t) + b * np.sin(w1 * t) + c * np.cos(w2 * t) + d * np.sin(w2 * t)
        return offset + np.exp(-t / tau) * wave

    best, covariance = curve_fit(model, TIMES, data, p0=[1.0, 1.8, 6.0, 1, 0, 0.5, 0, 3])
    errors = np.sqrt(np.diag(covariance))
    identified = extract(Trace(TIMES, {"V": data}), start=0.0)
    # the same least squares by two routes
    assert identified.tau == pytest.approx(best[2], rel=1e-6)
    assert identified.omega_minus == pytest.approx(np.hypot(best[0], 1 / best[2]), rel=1e-6)
    assert identified.omega_plus == pytest.approx(np.hypot(best[1], 1 / best[2]), rel=1e-6)
    assert identified.stderr["tau"] == pytest.approx(errors[2], rel=0.02)  # 2 %: degrees of freedom


def test_amplitudes_and_phases_are_those_at_the_windows_start():
    identified = extract(Trace(TIMES, {"V": 3 + ring(TIMES, SLOW, FAST)}), start=10.0)
    fade = np.exp(-10.0 / TAU)
    assert identified.amplitudes["V"] == pytest.approx((SLOW[0] * fade, FAST[0] * fade), rel=1e-6)
    assert identified.amplitude_ratio["V"] == pytest.approx(0.5, rel=1e-6)
    wanted = [np.exp(1j * (w * 10.0 + phase)) for _, w, phase in (SLOW, FAST)]
    np.testing.assert_allclose(np.exp(1j * np.array(identified.phases["V"])), wanted, atol=1e-5)


def snapped(times: np.ndarray, at: float) -> np.ndarray:
    """A sphere's volume that falls to a buckled one and rings."""
    after = np.maximum(times - at, 0.0)
    return np.where(times < at, 4.1, 2.9 + 0.1 * ring(after, (1.0, 1.05, np.pi)))


def test_the_default_window_opens_five_units_after_the_dip():
    trace = Trace(TIMES, {"V": snapped(TIMES, 8.0)})
    identified = extract(trace)
    assert dip(trace) == pytest.approx(8.0, abs=0.11)
    assert identified.window[0] == pytest.approx(dip(trace) + 5, abs=0.11)


def test_a_record_that_only_rings_holds_no_snap():
    assert ring_down_start(Trace(TIMES, {"V": 2.9 + 0.1 * ring(TIMES, SLOW, FAST)})) is None
    assert ring_down_start(Trace(TIMES, {"V": snapped(TIMES, 8.0)})) == pytest.approx(13.0, abs=0.2)


def test_a_microshells_record_in_seconds_costs_no_more_than_its_samples():
    volume, start = 2.9 + 0.1 * ring(TIMES, SLOW), 0.0
    tracemalloc.start()
    identified = extract(Trace(1e-8 * TIMES, {"V": volume}), start=start)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert identified.omega_minus == pytest.approx(1e8 * extract(Trace(TIMES, {"V": volume}), start=start).omega_minus)
    assert peak < 20e6  # a running mean over a time unit would be one over 1e9 samples


def test_without_volume_all_measured_channels_are_heard_together():
    height, width = 1.3 + ring(TIMES, SLOW), 2.1 + 0.2 * ring(TIMES, SLOW, FAST)
    identified = extract(Trace(TIMES, {"H": height, "W": width, "v_front": TIMES}), start=0.0)
    assert identified.channels == ("H", "W")
    assert identified.amplitude_ratio["H"] < 1e-6
    assert identified.amplitude_ratio["W"] == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize(("values", "stop"), [(np.full(401, 2.9), None), (2.9 + ring(TIMES, SLOW), 2.0)])
def test_what_cannot_be_heard_is_an_outcome_without_numbers(values, stop):
    identified = extract(Trace(TIMES, {"V": values}), start=0.0, stop=stop)
    assert identified.outcome == Outcome.UNUSABLE_DATA
    assert identified.omega_minus is None
    assert identified.reason
    with pytest.raises(NotOk, match="unusable_data"):
        extract(Trace(TIMES, {"V": values}), start=0.0, stop=stop, throw=True)


def test_wrong_requests_are_refused():
    trace = Trace(TIMES, {"V": 3 + ring(TIMES, SLOW)})
    with pytest.raises(BadName, match="no such channel"):
        extract(trace, "H")
    holed = np.where(TIMES[7] == TIMES, np.nan, trace["V"])
    with pytest.raises(BadValue, match="sample 7"):
        extract(Trace(TIMES, {"V": holed}))


def test_white_noise_holds_no_mode():
    noise = np.random.default_rng(3).standard_normal(TIMES.size)
    identified = extract(Trace(TIMES, {"V": 2.9 + 0.1 * noise}), start=0.0)
    assert identified.outcome == Outcome.UNUSABLE_DATA
    assert identified.omega_minus is None


@pytest.mark.parametrize("span", [40.0, 150.0, 400.0])
@pytest.mark.parametrize("leak", [0.0, -2e-4])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_long_plateau_hides_no_snap(span, leak, seed):
    times = np.arange(0.0, span, 0.1)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(times.size)
    trace = Trace(times, {"V": snapped(times, 8.0) + leak * times + noise})
    assert dip(trace) == pytest.approx(8.0, abs=1.0)
    assert ring_down_start(trace) == pytest.approx(13.0, abs=1.0)


@pytest.mark.parametrize("size", [0.1, 0.3, 0.5])
def test_a_snap_from_a_long_rest_is_seen_beside_a_loud_ring(size):
    after = np.maximum(TIMES - 15.0, 0.0)
    values = np.where(TIMES < 15.0, 4.1, 2.9 + size * ring(after, (1.0, 1.05, np.pi)))
    assert ring_down_start(Trace(TIMES, {"V": values})) == pytest.approx(20.0, abs=0.2)


@pytest.mark.parametrize("name", ["V", "H", "W"])
def test_fit_and_extraction_read_the_same_window(name):
    for values in (snapped(TIMES, 8.0), 2.9 + 0.1 * ring(TIMES, SLOW, FAST)):
        trace = Trace(TIMES, {name: values + 1e-4 * np.random.default_rng(0).standard_normal(TIMES.size)}, R_BUCKLED)
        (cut,) = windowed(trace, None, None)
        assert extract(trace).window == (float(cut.times[0]), float(cut.times[-1]))


def test_a_channel_of_noise_alone_takes_nothing_from_one_that_rings():
    t = np.linspace(0, 60, 601)
    rng = np.random.default_rng(0)
    ring = np.exp(-t / 15) * (np.cos(t) + 0.5 * np.cos(1.7 * t + 1))
    H, W = 3 + 0.05 * ring + 5e-4 * rng.normal(size=t.size), 4 + 0.02 * rng.normal(size=t.size)
    alone, both = (extract(Trace(t, channels), start=0) for channels in ({"H": H}, {"H": H, "W": W}))
    for name in ("omega_minus", "omega_plus", "tau"):
        # of equal weight, noise of the scatter of the ring would move f by a hundredth; σ is a twentieth of that
        assert abs(getattr(both, name) - getattr(alone, name)) < 0.1 * alone.stderr[name]
        assert both.stderr[name] == pytest.approx(alone.stderr[name], rel=0.1)
    assert both.verdict == "two"

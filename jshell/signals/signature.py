"""The modes of a record: two frequencies, one decay, and whether two are enough.

Symbols    ω-, ω+ intrinsic frequencies, ω² = Ω² + 1/τ²   τ decay time   A±  amplitudes
Valid for  the ring-down after a snap, where the motion is small and decays together
Source     Mokbel et al. 2021, section "A 2-frequency oscillator"
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.errors import BadName, BadValue, NotOk, Outcome
from jshell.signals.damped_pair import DampedModes, fit
from jshell.signals.pencil import rates
from jshell.signals.snap import AFTER_SNAP, dip
from jshell.trace import Trace

FEWEST_SAMPLES = 32
WITHOUT_V = ("H", "W", "S")  # taken together where V was not recorded
MEASURED = ("V", "S", "H", "W")  # the shape's own measures: fitted by default, their amplitude ratios reported
MOST_STARTS = 10

# A further mode is needed where what the modes so far leave is worth having (over this share of the signal,
# and over the noise) and where the further mode takes a good part of it away.
WORTH_HAVING = 0.05
OVER_NOISE = 1.3
TAKEN_AWAY = 0.3

NOTHING_HEARD = 0.9  # three modes that leave this much of a record have found none

VERDICTS = ("one", "two", "more than two")


@dataclass(frozen=True)
class Signature:
    """Two frequencies and a decay time, with the evidence for them.

    Attributes:
        omega_minus, omega_plus, tau: Of the two-mode fit, in the trace's time unit; None unless the outcome is ok.
        stderr: Standard errors of the three, from the residual as white noise.
        amplitudes, phases: Channel to (slow, fast) amplitude in the channel's unit, and phase [rad], both at the
            window's start.
        offsets: Channel to the value it settles at.
        residual: rms of the two-mode residual over rms of the signal about its offset.
        residuals: The same with one, two and three modes.
        noise: Estimated noise over rms of the signal.
        verdict: `one`, `two` or `more than two` modes are needed.
        channels: Those it was extracted from.
        window: First and last time used.
        t_dip: Time of the snap's dip.
        outcome: ok, unusable_data or not_converged.
        reason: Why the outcome is not ok, in words.
        frequency_unit: Hz per unit of ω, where the record's SI scales are known.
    """

    omega_minus: float | None
    omega_plus: float | None
    tau: float | None
    stderr: dict[str, float]
    amplitudes: dict[str, tuple[float, float]]
    phases: dict[str, tuple[float, float]]
    offsets: dict[str, float]
    residual: float | None
    residuals: tuple[float, ...]
    noise: float | None
    verdict: str | None
    channels: tuple[str, ...]
    window: tuple[float, float]
    t_dip: float
    outcome: Outcome
    reason: str = ""
    frequency_unit: float | None = None
    fits: tuple[DampedModes, ...] = field(default=(), repr=False)

    @readable
    def __repr__(self) -> str:
        hertz = "" if self.f_minus_Hz is None else f"{number((self.f_minus_Hz, self.f_plus_Hz), 'Hz')}"
        return shown(
            self,
            f"ω− {number(self.omega_minus, FREQUENCY)}",
            f"ω+ {number(self.omega_plus, FREQUENCY)}",
            f"τ {number(self.tau, TIME)}",
            hertz,
            f"modes needed: {self.verdict}",
            "from " + " ".join(self.channels),
            ended(self.outcome),
        )

    @property
    def amplitude_ratio(self) -> dict[str, float | None]:
        """Channel to A+/A-; None where the slow mode is absent."""
        return {name: fast / slow if slow > 0 else None for name, (slow, fast) in self.amplitudes.items()}

    @property
    def f_minus_Hz(self) -> float | None:
        return _product(self.omega_minus, self.frequency_unit)

    @property
    def f_plus_Hz(self) -> float | None:
        return _product(self.omega_plus, self.frequency_unit)

    def record(self) -> dict:
        """The signature as a JSON object."""
        found = {
            "omega_minus": self.omega_minus,
            "omega_plus": self.omega_plus,
            "tau": self.tau,
            "stderr": self.stderr,
            "amplitude_ratio": self.amplitude_ratio,
            "offsets": self.offsets,
            "residual": self.residual,
            "residuals": list(self.residuals),
            "noise": self.noise,
            "verdict": self.verdict,
            "channels": list(self.channels),
            "window": list(self.window),
            "t_dip": self.t_dip,
            "outcome": self.outcome.word,
            "reason": self.reason,
        }
        if self.frequency_unit is not None:
            found |= {"f_minus_Hz": self.f_minus_Hz, "f_plus_Hz": self.f_plus_Hz}
        return found


def extract(
    trace: Trace,
    channel: str | Sequence[str] | None = None,
    *,
    start: float | int | None = None,
    stop: float | int | None = None,
    throw: bool = False,
) -> Signature:
    """Extract the modes of a trace: two frequencies, one decay time, amplitudes, and a verdict.

    Args:
        trace: The record.
        channel: Channel to use, or several that share frequencies and decay. By default V; where V was
            not recorded, all of H, W and S that were, else every channel.
        start, stop: Window [the trace's time unit]; by default from 5 units after the snap's dip to the end.
        throw: Raise `NotOk` unless the outcome is ok.

    Returns:
        The signature. Too short or constant a record is `unusable_data`, with the reason.

    Raises:
        BadName: A channel that the trace does not have.
        BadValue: Samples that are not finite.

    Example:
        >>> import jshell as js, numpy as np
        >>> t = np.linspace(0, 40, 401)
        >>> ring = np.exp(-t / 8) * (np.cos(t) + 0.4 * np.cos(1.7 * t + 1))
        >>> found = js.signals.extract(js.Trace(t, {"V": 3 + ring}), start=0)
        >>> print(f"{found.omega_minus:.4f} {found.omega_plus:.4f} {found.tau:.3f} {found.verdict}")
        1.0078 1.7046 8.000 two
    """
    names = _chosen(trace, channel)
    times = np.asarray(trace.times, dtype=float)
    for name in (*names, *(m for m in MEASURED if m in trace.channels)):
        if not np.all(np.isfinite(np.asarray(trace[name]))):
            row = int(np.argmin(np.isfinite(np.asarray(trace[name]))))
            place = f"channel {name!r}, sample {row}"
            raise BadValue(place, found="not a finite number", expected="numbers", remedy="Cut it out.")
    t_dip = dip(trace, names)
    low = t_dip + AFTER_SNAP if start is None else start
    cut = trace.between(low, stop)
    t = np.asarray(cut.times, dtype=float)
    window = (float(t[0]), float(t[-1])) if t.size else (float(low), float(times[-1]))
    ended = lambda why: _silent(names, window, t_dip, why, throw)  # noqa: E731
    if t.size < FEWEST_SAMPLES:
        return ended(f"{t.size} samples from t = {low:g} on, at least {FEWEST_SAMPLES} are needed")
    data = np.stack([np.asarray(cut[name], dtype=float) for name in names])
    level = np.abs(data).max(axis=1)
    if np.any(data.std(axis=1) <= 1e-12 * np.maximum(level, 1e-300)):
        return ended("a channel does not move in the window")

    fits = _fits(t, data)
    if fits is None:
        return ended("no oscillation is found in the window")
    pair = fits[1]
    if min(found.residual for found in fits) > NOTHING_HEARD:
        return ended("no oscillation rises above the noise in the window")
    if not pair.converged:
        return _silent(names, window, t_dip, "the two-mode fit did not converge", throw, Outcome.NOT_CONVERGED)
    residuals = tuple(found.residual for found in fits)
    noise = _noise(data, pair)
    amplitudes, phases, offsets = _amplitudes(t, cut, names, pair)
    unit = None if trace.scales is None else trace.scales.frequency
    omega = pair.omega
    return Signature(
        omega_minus=float(omega[0]),
        omega_plus=float(omega[1]),
        tau=pair.tau,
        stderr={
            "omega_minus": float(pair.errors[0]),
            "omega_plus": float(pair.errors[1]),
            "tau": float(pair.errors[2]),
        },
        amplitudes=amplitudes,
        phases=phases,
        offsets=offsets,
        residual=pair.residual,
        residuals=residuals,
        noise=noise,
        verdict=verdict(residuals, noise),
        channels=names,
        window=window,
        t_dip=t_dip,
        outcome=Outcome.OK,
        frequency_unit=unit,
        fits=fits,
    )


def verdict(residuals: Sequence[float], noise: float) -> str:
    """How many modes a record needs: `one`, `two` or `more than two`.

    Modes are enough where they leave less than a twentieth of the signal or less than 1.3 times the noise,
    or where no further mode takes away at least 30 % of what they leave.
    """
    for count, so_far in enumerate(residuals):
        worth = so_far > WORTH_HAVING and so_far > OVER_NOISE * noise
        further = min(residuals[count + 1 :], default=so_far)
        if not (worth and further < (1 - TAKEN_AWAY) * so_far):
            return VERDICTS[count]
    return VERDICTS[-1]


def _chosen(trace: Trace, channel: str | Sequence[str] | None) -> tuple[str, ...]:
    if channel is None:
        if "V" in trace.channels:
            return ("V",)
        found = tuple(name for name in WITHOUT_V if name in trace.channels)
        names = found or tuple(trace.channels)
    else:
        names = (channel,) if isinstance(channel, str) else tuple(channel)
    if not names:
        raise BadName("channels", found="none", expected="at least one channel", remedy="Name one.")
    for name in names:
        trace[name]
    return names


def _fits(t: np.ndarray, data: np.ndarray) -> tuple[DampedModes, ...] | None:
    """Fits with one, two and three modes; None where the pencil finds nothing."""
    found = rates(t, data / data.std(axis=1, keepdims=True))
    if not found:
        return None
    span = t[-1] - t[0]
    fits = []
    for modes in (1, 2, 3):
        starts = _starts(found, modes, span)
        fits.append(fit(t, data, starts))
    return tuple(fits)


def _starts(found: list[np.ndarray], modes: int, span: float) -> np.ndarray:
    """Starts for a number of modes: combinations of the strongest rates of every order, the decay from them."""
    rows = []
    for s in found:
        strongest = s[: modes + 2]
        while strongest.size < modes:  # fewer rates than modes: an overtone to start from
            strongest = np.append(strongest, strongest[-1].real + 1.7j * strongest[-1].imag)
        for chosen in combinations(strongest, modes):
            decay = min(max(-np.mean([r.real for r in chosen]), 0.05 / span), 10 / span)
            rows.append((*sorted(r.imag for r in chosen), decay))
    # strongest combinations of each order come first; interleave the orders and keep a fixed number
    rows = sorted(set(rows), key=rows.index)
    spread = np.linspace(0, len(rows) - 1, min(MOST_STARTS, len(rows))).round().astype(int)
    picked = [rows[k] for k in np.unique(spread)]
    while len(picked) < MOST_STARTS:
        picked.append(picked[0])
    return np.array(picked)


def _noise(data: np.ndarray, pair: DampedModes) -> float:
    """Noise over rms of the signal, from sixth differences, which the motion hardly survives."""
    signal = data - pair.offset[:, None]
    each = np.mean(np.diff(data, 6, axis=1) ** 2, axis=1) / 924.0  # 924 = (12 choose 6)
    return float(np.sqrt(np.mean(each / np.mean(signal**2, axis=1))))


def _amplitudes(t: np.ndarray, cut: Trace, names: tuple[str, ...], pair: DampedModes):
    """Amplitudes, phases and offsets of every measured channel at the pair's frequencies and decay."""
    elapsed = t - t[0]
    envelope = np.exp(-elapsed / pair.tau)[:, None]
    angle = elapsed[:, None] * pair.Omega[None]
    columns = np.concatenate([envelope * np.cos(angle), envelope * np.sin(angle), np.ones((t.size, 1))], axis=1)
    amplitudes, phases, offsets = {}, {}, {}
    for name in dict.fromkeys((*(m for m in MEASURED if m in cut.channels), *names)):
        found = np.linalg.lstsq(columns, np.asarray(cut[name], dtype=float), rcond=None)[0]
        cosine, sine = found[:2], found[2:4]
        slow, fast = np.hypot(cosine, sine)
        amplitudes[name] = (float(slow), float(fast))
        first, second = np.arctan2(-sine, cosine)
        phases[name] = (float(first), float(second))
        offsets[name] = float(found[4])
    return amplitudes, phases, offsets


def _silent(names, window, t_dip, reason, throw, outcome=Outcome.UNUSABLE_DATA) -> Signature:
    if throw:
        raise NotOk(f"signature of {', '.join(names)} ({reason})", outcome)
    return Signature(
        None, None, None, {}, {}, {}, {}, None, (), None, None, tuple(names), window, t_dip, outcome, reason
    )


def _product(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a * b

"""The modes of a record: two frequencies, one decay, and whether two are enough.

Symbols    ω-, ω+ intrinsic frequencies, ω² = Ω² + 1/τ²   τ decay time   A±  amplitudes
Valid for  the ring-down after a snap, where the motion is small and decays together
Source     Mokbel et al. 2021, section "A 2-frequency oscillator"
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.errors import BadName, BadValue, NotOk, Outcome, choose
from jshell.signals.alternatives import TERM, chi_square, residuals
from jshell.signals.damped_pair import DampedModes, comparable, damped_modes
from jshell.signals.model_selection import Judgement, judge
from jshell.signals.sample_faults import sample_faults
from jshell.signals.snap import dip, ring_down_start
from jshell.signals.waves import DRIFTS, SignalFit, linear_part, measured, search
from jshell.signals.waves_from_data import in_cells, model_orders, sound
from jshell.trace import Trace, traces_of

FEWEST_SAMPLES = 32
LOUDER = 2.0  # ratio of the noise of two channels, each over its scatter, from which they count by it
QUIETEST = 1e-6  # noise that is taken for a channel's least, over the loudest's
WITHOUT_V = ("H", "W", "S")  # taken together where V was not recorded
MEASURED = ("V", "S", "H", "W")  # the shape's own measures: fitted by default, their amplitude ratios reported


@dataclass(frozen=True)
class Signature:
    """Two frequencies and a decay time, with the evidence for them.

    Attributes:
        omega_minus, omega_plus, tau: Of the two-mode fit, in the trace's time unit; None unless the outcome is ok.
            Where one mode is found it is ω-, and ω+ is None.
        stderr: Standard errors of the three, from the residual as noise, white or autocorrelated; NaN of what is None.
        amplitudes, phases: Channel to (slow, fast) amplitude in the channel's unit, and phase [rad], both at the
            window's start.
        offsets: Channel to the value it settles at.
        residual: rms of what the modes leave over rms of the signal about its offset.
        residuals: The same with one, two and three modes.
        noise: Estimated noise over rms of the signal.
        verdict: `one` or `two` modes describe the record, `more than two` are needed, or `misfit`: they do not describe
            it, and `warnings` says what might.
        channels: Those it was extracted from.
        window: First and last time used.
        t_dip: Time of the snap's dip.
        outcome: ok, unusable_data or not_converged.
        reason: Why the outcome is not ok, in words.
        frequency_unit: Hz per unit of ω, where the record's SI scales are known.
        fits: With one, two and three modes.
        drift: What the modes ring about: the one asked for, or the one found.
        warnings: Why the numbers are not to be trusted; empty where they are.
        notes: What a reader may want to know besides.
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
    drift: str = "constant"
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

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
    def sound(self) -> bool:
        """Whether the record is described, and the numbers can be read as they are."""
        return self.outcome == Outcome.OK and self.verdict in ("one", "two") and not self.warnings

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

    @property
    def tau_s(self) -> float | None:
        """The decay time [s], where the record's SI scales are known."""
        return None if self.tau is None or self.frequency_unit is None else self.tau / (2 * np.pi * self.frequency_unit)

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
            "drift": self.drift,
            "warnings": list(self.warnings),
            "notes": list(self.notes),
            "outcome": self.outcome.word,
            "reason": self.reason,
        }
        if self.frequency_unit is not None:
            found |= {"f_minus_Hz": self.f_minus_Hz, "f_plus_Hz": self.f_plus_Hz, "tau_s": self.tau_s}
        return found


def extract(
    trace: Trace,
    channel: str | Sequence[str] | None = None,
    *,
    start: float | int | None = None,
    stop: float | int | None = None,
    drift: str = "constant",
    throw: bool = False,
) -> Signature:
    """Extract the modes of a trace: two frequencies, one decay time, amplitudes, and a verdict.

    Args:
        trace: The record.
        channel: Channel to use, or several that share frequencies and decay. By default V; where V was
            not recorded, all of H, W and S that were, else every channel.
        start, stop: Window [the trace's time unit]; by default from 5 units after the dip of a record that holds a
            snap, else from its start, to the end. Fits have the same rule.
        drift: What the modes ring about: `none` (zero), `constant`, `line`, `exponential` (a constant and a term that
            fades), or `auto`, the simplest that is needed. With a constant, a drift of significance is a misfit.
        throw: Raise `NotOk` unless the outcome is ok.

    Returns:
        The signature. Too short or constant a record is `unusable_data`, with the reason.

    Raises:
        BadName: A channel that the trace does not have.
        BadValue: Samples that are not finite; no trace, but the path of a file.

    Example:
        >>> import jshell as js, numpy as np
        >>> t = np.linspace(0, 40, 401)
        >>> ring = np.exp(-t / 8) * (np.cos(t) + 0.4 * np.cos(1.7 * t + 1))
        >>> found = js.signals.extract(js.Trace(t, {"V": 3 + ring}), start=0)
        >>> print(f"{found.omega_minus:.4f} {found.omega_plus:.4f} {found.tau:.3f} {found.verdict}")
        1.0078 1.7046 8.000 two
    """
    (trace,) = traces_of([trace])
    names = _chosen(trace, channel)
    times = np.asarray(trace.times, dtype=float)
    for name in (*names, *(m for m in MEASURED if m in trace.channels)):
        if not np.all(np.isfinite(np.asarray(trace[name]))):
            row = int(np.argmin(np.isfinite(np.asarray(trace[name]))))
            place = f"channel {name!r}, sample {row}"
            raise BadValue(place, found="not a finite number", expected="numbers", remedy="Cut it out.")
    t_dip = dip(trace, names)
    choose("drift", drift, (*DRIFTS, "auto"))
    low = start
    if low is None:
        begin = ring_down_start(trace)
        low = float(times[0]) if begin is None else begin
    cut = trace.between(low, stop)
    t = np.asarray(cut.times, dtype=float)
    window = (float(t[0]), float(t[-1])) if t.size else (float(low), float(times[-1]))
    ended = lambda why: _silent(names, window, t_dip, why, throw)  # noqa: E731
    if t.size < FEWEST_SAMPLES:
        whole = f"of a record from {times[0]:.4g} to {times[-1]:.4g}"
        return ended(f"{t.size} samples from t = {low:g} on, {whole}; at least {FEWEST_SAMPLES} are needed")
    data = np.stack([np.asarray(cut[name], dtype=float) for name in names])
    level = np.abs(data).max(axis=1)
    if np.any(data.std(axis=1) <= 1e-12 * np.maximum(level, 1e-300)):
        return ended("a channel does not move in the window")

    elapsed, even, mean, scale = comparable(t, data, centred=drift != "none")
    cells = in_cells(elapsed, even)  # a long record is judged in cells; its numbers are from all samples
    drift, fits = _fits(*cells, drift)
    if not fits[0]:
        return ended("no oscillation is found in the window")
    marks = [sample_faults(row) for row in data]
    steps = np.array([mark.step for mark in marks]) / scale
    found = judge(fits, *cells, names, marks, window[0], steps=steps)
    if found.word is None:
        return ended("no oscillation rises above the noise in the window")
    if not sound(found.solution, cells[0]):
        why, outcome = "the fit did not converge", Outcome.NOT_CONVERGED
        if not sound(fits[0][0], cells[0]):
            why, outcome = "no ring-down is found in the window", Outcome.UNUSABLE_DATA
        silent = _silent(names, window, t_dip, why, throw, outcome)
        word = found.word if found.word in ("more than two", "misfit") else None
        return replace(silent, verdict=word, warnings=found.warnings, notes=found.notes, drift=drift)
    solutions = [solutions[0] for solutions in fits]
    if cells[0].size < elapsed.size:
        solutions = [measured(one, elapsed, even) for one in solutions]
        place = found.solution.model.modes - 1
        solutions[place] = search(solutions[place].model, elapsed, even, solutions[place].unknowns)
        found = replace(found, solution=solutions[place], noise=residuals(even, solutions[place], elapsed))
    if (weighed := _weighed(found, elapsed, even)) is not found:
        found = weighed
        solutions[found.solution.model.modes - 1] = found.solution
    every = tuple(damped_modes(one, elapsed, even, mean, scale) for one in solutions)
    best = every[found.solution.model.modes - 1]
    errors = best.errors * _wider(found, float(np.median(np.diff(elapsed))))
    alone = found.word == "one" or best.Omega.size == 1
    amplitudes, phases, offsets = _amplitudes(elapsed, cut, names, found.solution)
    signal = even - found.solution.background(elapsed)
    noise = [part.level**2 / np.mean(row**2) for part, row in zip(found.noise, signal, strict=True)]
    return Signature(
        omega_minus=float(best.omega[0]),
        omega_plus=None if alone else float(best.omega[1]),
        tau=best.tau,
        stderr={
            "omega_minus": float(errors[0]),
            "omega_plus": np.nan if alone else float(errors[1]),
            "tau": float(errors[-1]),
        },
        amplitudes=amplitudes,
        phases=phases,
        offsets=offsets,
        residual=best.residual,
        residuals=tuple(one.residual for one in every),
        noise=float(np.sqrt(np.mean(noise))),
        verdict=found.word,
        channels=names,
        window=window,
        t_dip=t_dip,
        outcome=Outcome.OK,
        frequency_unit=None if trace.scales is None else trace.scales.frequency,
        fits=every,
        drift=drift,
        warnings=found.warnings,
        notes=found.notes,
    )


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


def _fits(elapsed: np.ndarray, values: np.ndarray, drift: str) -> tuple[str, list[list[SignalFit]]]:
    """Fits with one, two and three modes, and the drift they were made with."""
    if drift != "auto":
        return drift, model_orders(elapsed, values, drift)
    tries = {kind: model_orders(elapsed, values, kind) for kind in ("constant", "line", "exponential")}
    if not all(fits[0] for fits in tries.values()):
        return "constant", tries["constant"]
    richest = min((fits[1][0] for fits in tries.values()), key=lambda solution: solution.power)
    noise = residuals(values, richest, elapsed)
    chi = {kind: chi_square(noise, values, fits[1][0], elapsed) for kind, fits in tries.items()}
    good = {kind: chi[kind] if sound(fits[1][0], elapsed) else np.inf for kind, fits in tries.items()}
    if not np.isfinite(good["constant"]) and chi["constant"] - min(chi.values()) < TERM:
        return "constant", tries["constant"]
    # a drift must be sure; that it fades is one number more, worth the logarithm of the samples
    priced = {"line": good["line"], "exponential": good["exponential"] + np.log(values.size)}
    best = min(priced, key=lambda kind: priced[kind])
    sure = good["constant"] - good[best] > TERM or not np.isfinite(good["constant"])
    chosen = best if sure else "constant"
    return chosen, tries[chosen]


def _weighed(found: Judgement, elapsed: np.ndarray, values: np.ndarray) -> Judgement:
    """The waves again where one channel is much noisier than another: each then counts by its own noise.

    Channels of one scatter would else count alike, one of noise alone as much as one of signal alone.
    """
    level = np.array([one.level for one in found.noise])
    level = np.maximum(level, QUIETEST * level.max())
    if level.max() <= LOUDER * level.min():
        return found
    near = search(found.solution.model, elapsed, values / level[:, None], found.solution.unknowns)
    if not sound(near, elapsed):
        return found
    here = measured(near, elapsed, values)
    return replace(found, solution=replace(here, covariance=near.covariance))


def _wider(found: Judgement, step: float) -> np.ndarray:
    """Factors of the errors of each ω and of τ where the noise is autocorrelated: it is louder at one place than on
    average, and errors of white noise do not know."""
    at = np.stack([one.louder(found.solution.Omega * step) for one in found.noise])
    worst = at.max(axis=0)
    return np.append(worst, worst.max())


def _amplitudes(elapsed: np.ndarray, cut: Trace, names: tuple[str, ...], solution: SignalFit):
    """Amplitudes, phases and offsets of every measured channel at the waves' frequencies and decay."""
    listed = tuple(dict.fromkeys((*(m for m in MEASURED if m in cut.channels), *names)))
    linear = linear_part(solution, elapsed, np.stack([np.asarray(cut[name], dtype=float) for name in listed]))
    waves = linear[solution.model.background :]
    C, S = waves[0::2], waves[1::2]
    size, turned = np.hypot(C, S), np.arctan2(-S, C)
    second = lambda row: float(row[1]) if row.size > 1 else 0.0  # noqa: E731
    amplitudes, phases, offsets = {}, {}, {}
    for name, one, angle, k in zip(listed, size.T, turned.T, range(len(listed)), strict=True):
        amplitudes[name] = (float(one[0]), second(one))
        phases[name] = (float(angle[0]), second(angle))
        offsets[name] = float(linear[0, k]) if solution.model.background else 0.0
    return amplitudes, phases, offsets


def _silent(names, window, t_dip, reason, throw, outcome=Outcome.UNUSABLE_DATA) -> Signature:
    if throw:
        raise NotOk(f"signature of {', '.join(names)} ({reason})", outcome)
    return Signature(
        None, None, None, {}, {}, {}, {}, None, (), None, None, tuple(names), window, t_dip, outcome, reason
    )


def _product(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a * b

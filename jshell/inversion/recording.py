"""A recording as an inversion reads it: times and channels in one system of units, what it shows of itself.

What is asked is forgotten: a header that names the shell's modulus does not tell where to look for it.

Symbols    Ω damped frequency   τ decay time
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jshell.calibration.agreement import refuse_sizes
from jshell.errors import BadName, BadValue, Outcome, UnusableData
from jshell.inversion.response import ACROSS, CHANNELS, ECHO
from jshell.signals import dip, extract
from jshell.trace import Trace

# of length in each channel; an echo's size is the hydrophone's and its distance's, and tells nothing
POWER = {"H": 1, "W": 1, "V": 3, "S": 2, "x_front": 1, "x_back": 1, ECHO: 0} | dict.fromkeys(ACROSS, 1)
SNAP = 3.0  # a record that starts further off its rest than this many swings of its ring-down holds a snap
SETTLING = 0.5  # periods after the dip that a ring-down begins
FEWEST = 32


@dataclass(frozen=True)
class Recording:
    """One ring-down.

    Attributes:
        number: From 1.
        channels: Their names.
        times: (times,) inside the window [s, or time unit].
        values: (channels, times) [m, m², m³, Pa, or without units].
        sigma: (channels,) known standard errors, or None.
        noise: (channels,) the noise that it shows itself.
        level: (channels,) where it settles.
        Omega, tau: The frequencies that it shows, and their decay time.
        verdict: What `jshell.signals` says of it.
        known: What its header says of the shell.
        si: In SI.
        trace: The trace.
    """

    number: int
    channels: tuple[str, ...]
    times: np.ndarray
    values: np.ndarray
    sigma: np.ndarray | None
    noise: np.ndarray
    level: np.ndarray
    Omega: np.ndarray
    tau: float
    verdict: str
    known: Mapping[str, float]
    si: bool
    trace: Trace


def recording(
    trace: Trace,
    number: int,
    channels: Sequence[str] | None,
    start: float | int | None,
    stop: float | int | None,
    si: bool,
) -> Recording:
    """A trace as an inversion reads it.

    Args:
        trace: The trace; of a laboratory with its scales, or in seconds and metres, or without units.
        number: From 1.
        channels: Those to use; by default all that the simulator knows.
        start, stop: Window [s, or time unit]; by default from half a slow period after the dip of a snap.
        si: The numbers asked for are in SI.

    Raises:
        BadName: A channel that the simulator has not, or none.
        UnusableData: Too few samples, or nothing that oscillates.
    """
    listed, times, values, factor = channels_of(trace, number, channels, si)
    low = times[0] if start is None else float(start)
    inside = (times >= low) & (times <= (np.inf if stop is None else float(stop)))
    plain = Trace(times[inside], dict(zip(listed, values[:, inside], strict=True)))
    if plain.times.size < FEWEST:
        raise UnusableData(
            f"trace {number}",
            found=f"{plain.times.size} samples in the window, of {times.size} from {times[0]:.4g} to {times[-1]:.4g}"
            + (" s" if si else ""),
            expected=f"at least {FEWEST}",
            remedy="Widen the window by start and stop, or record longer.",
        )
    if start is None:
        begin = _ring_down(plain, listed)
        plain = plain if begin is None else plain.between(begin, None)
    seen = _seen(plain, listed, number)
    values = np.stack([np.asarray(plain[name]) for name in listed])
    sigma = None
    if all(name in trace.sigma for name in listed):
        sigma = np.array([float(np.median(np.asarray(trace.sigma[name]))) for name in listed]) * factor
    known = header(trace, si)
    return Recording(
        number, listed, np.asarray(plain.times), values, sigma, _rough_noise(values),
        seen.level, seen.Omega, seen.tau, seen.verdict, known, si, trace,
    )  # fmt: skip


def channels_of(
    trace: Trace, number: int, channels: Sequence[str] | None, si: bool
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]:
    """Names, times (times,), values (channels, times), and what a unit of each channel is, all in one system of units.

    Raises:
        BadName: A channel that the simulator has not, or none.
        BadValue: Samples that are no numbers, or an echo beside what is seen.
    """
    # the opposite pole does not move where a pad holds it, and is a matter of the camera's origin where none does
    listed = tuple(channels or [name for name in CHANNELS[:4] if name in trace.channels])
    listed = listed or tuple(name for name in (ECHO,) if name in trace.channels)
    for name in listed:
        if name not in CHANNELS or name not in trace.channels:
            there = [one for one in CHANNELS if one in trace.channels]
            raise BadName(
                f"channel {name!r}",
                found=f"no such channel in trace {number}",
                expected="one of " + ", ".join(there or CHANNELS),
                remedy="Choose one." if there else "Name the columns by what they are, such as --columns H=A.",
            )
    if not listed:
        raise BadName(
            f"trace {number}", found="channels " + ", ".join(trace.channels), expected="one of " + ", ".join(CHANNELS),
            remedy="Name the columns by what they are, in the terminal by --columns H=A.",
        )  # fmt: skip
    together(f"channels of trace {number}", listed)
    time, length = _units(trace, si)
    times = np.asarray(trace.times, dtype=float) * time
    pressure = float(trace.scales.pressure) if trace.scales is not None and si else 1.0
    factor = np.array([pressure if name == ECHO else length ** POWER[name] for name in listed])
    values = np.stack([np.asarray(trace[name], dtype=float) for name in listed]) * factor[:, None]
    if not np.all(np.isfinite(values)):
        raise BadValue(
            f"trace {number}", found="samples that are no numbers", expected="numbers", remedy="Cut them out."
        )
    return listed, times, values, factor


def together(place: str, channels: Sequence[str]) -> None:
    """Refuse channels that are of no one recording.

    Raises:
        BadValue: An echo beside what is seen.
    """
    if ECHO in channels and len(channels) > 1:
        raise BadValue(
            place, found=", ".join(channels), expected=f"{ECHO} alone, or without it",
            remedy="How loud an echo is beside what is seen depends on hydrophone and distance: give it as a trace of "
            "its own, js.invert([film, echo], …).",
        )  # fmt: skip


def _units(trace: Trace, si: bool) -> tuple[float, float]:
    if trace.scales is not None and si:
        return float(trace.scales.time), float(trace.scales.length)
    return 1.0, 1.0


def header(trace: Trace, si: bool) -> dict[str, float]:
    """The shell of the header, by the names of unknowns."""
    c = trace.conditions
    pad = {"pad": trace.attached} if trace.attached else {}
    if c is None:
        return pad
    shape = {"kappa": float(c.kappa), "poisson_ratio": float(c.poisson_ratio)} | pad
    if not si:
        names = ("thickness", "gas_pressure", "outer_pressure", "viscosity")
        return {name: float(getattr(c, name)) for name in names} | shape
    assert trace.scales is not None
    shell, gas, liquid, load = c.to_si(trace.scales)
    return {
        "radius": float(shell.radius),
        "thickness": float(shell.thickness),
        "youngs_modulus": float(shell.youngs_modulus),
        "gas_pressure": float(gas.pressure),
        "outer_pressure": float(load.pressure),
        "density": float(liquid.density),
        "viscosity": float(liquid.viscosity),
    } | shape


def refuse_other_size(record: Recording, radius: float) -> None:
    """Refuse heights and widths that no shell of this radius has.

    Args:
        record: What is seen of the shell.
        radius: R0, in the record's unit of length.

    Raises:
        UnusableData: A height or width of another shell, or in another unit.
    """
    levels = zip(record.channels, record.level, strict=True)
    seen = {name: float(level) / radius for name, level in levels if name in ("H", "W")}
    refuse_sizes(seen, f"trace {record.number}")


class _Seen(NamedTuple):
    """What a window shows of itself."""

    Omega: np.ndarray
    tau: float
    level: np.ndarray
    verdict: str


def _seen(trace: Trace, names: Sequence[str], number: int) -> _Seen:
    """The frequencies of a window, or its pitch alone where free sinusoids did not come to rest."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = extract(trace, names, start=float(trace.times[0]))
    verdict = found.verdict or "misfit"
    if found.fits:
        best = found.fits[min({"one": 1, "two": 2}.get(verdict, 3), len(found.fits)) - 1]
        return _Seen(best.Omega, best.tau, np.array([found.offsets[name] for name in names]), verdict)
    if found.outcome == Outcome.UNUSABLE_DATA:
        raise UnusableData(
            f"trace {number}", found=found.reason or "nothing that oscillates", expected="a ring-down",
            remedy="Give the window of the ring-down by start and stop.",
        )  # fmt: skip
    times, late = np.asarray(trace.times), slice(-max(1, trace.times.size // 5), None)
    level = np.array([float(np.mean(np.asarray(trace[name])[late])) for name in names])
    return _Seen(np.array([_pitch(times, np.asarray(trace[names[0]]))]), (times[-1] - times[0]) / 4, level, verdict)


def _ring_down(trace: Trace, names: Sequence[str]) -> float | None:
    """When the ring-down after a snap begins; None where the record holds no snap.

    In units of the pitch that the later part of the record shows, since no other unit of time is known yet.
    """
    times, values = np.asarray(trace.times), np.asarray(trace[names[0]])
    pitch = _pitch(times, values)
    if ECHO in names:  # a snap is the loudest
        loudest = float(times[np.argmax(np.abs(values - np.median(values)))])
        after = loudest + 2 * np.pi * SETTLING / pitch
        silent = loudest - times[0] > 2 * np.pi * SETTLING / pitch
        return after if silent and np.sum(times > after) >= FEWEST else None
    scaled = Trace(times * pitch, {name: np.asarray(trace[name]) for name in names})
    at = dip(scaled, names) / pitch
    settled = float(np.mean(values[-max(1, values.size // 5) :]))
    after = values[times > at + 2 * np.pi * SETTLING / pitch]
    if after.size < FEWEST or abs(values[0] - settled) < SNAP * np.max(np.abs(after - settled)):
        return None
    return at + 2 * np.pi * SETTLING / pitch


def after_snap(trace: Trace, names: Sequence[str]) -> float:
    """When the ring-down begins of a record that is known to hold a snap: half a period after the dip, or there."""
    times, values = np.asarray(trace.times), np.asarray(trace[names[0]])
    rough = _pitch(times, values)
    at = dip(Trace(times * rough, {name: np.asarray(trace[name]) for name in names}), names) / rough
    # the snap itself would be taken for the pitch
    late = times > at
    if late.sum() < 2 * FEWEST:
        return float(times[0]) if late.sum() < FEWEST else at
    begin = at + 2 * np.pi * SETTLING / _pitch(times[late], values[late])
    return begin if (times > begin).sum() >= FEWEST else at


def _pitch(times: np.ndarray, values: np.ndarray) -> float:
    """Angular frequency that is strongest in the later three fifths of a record."""
    late = values[2 * values.size // 5 :]
    line = np.polynomial.Polynomial.fit(np.arange(late.size), late, 1)(np.arange(late.size))
    power = np.abs(np.fft.rfft((late - line) * np.hanning(late.size), 4 * late.size)) ** 2
    return 2 * np.pi * float(max(np.argmax(power), 4)) / (4 * late.size * float(np.median(np.diff(times))))


def _rough_noise(values: np.ndarray) -> np.ndarray:
    """What six differences leave of each channel: white noise whole, slow motion not at all."""
    rough = np.diff(values, 6, axis=1) / np.sqrt(924)
    return np.sqrt(np.mean(rough**2, axis=1))

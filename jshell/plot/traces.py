"""Records in time: a channel as it was taken, and the modes identified in it.

Symbols    t time   V, S, H, W volume, area, height, width; relative to the stress-free sphere where asked
           ω-, ω+ intrinsic frequencies, Ω² = ω² - 1/τ² damped ones   τ decay time
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from jshell.errors import BadName, BadValue, NotOk, Outcome
from jshell.plot.style import BLACK, BLUE, CHANNEL, GREY, PALE, Axes, axes_or_new, style
from jshell.quantities import LABORATORY, POWERS, QUANTITIES, UNITS, laboratory_unit, quantity
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.signals import Signature, dip, ring_down_start
from jshell.trace import Trace

# What a channel is compared with on the stress-free sphere, and how the ratio is written.
SPHERE = {
    "V": (SPHERE_VOLUME, "V/V₀"),
    "S": (SPHERE_AREA, "S/S₀"),
    "H": (2.0, "H/2R₀"),
    "W": (2.0, "W/2R₀"),
}


@dataclass(frozen=True)
class AxisUnit:
    """How one column of a trace is read on an axis: times `factor` in `unit`, under `label`, in short `symbol`."""

    factor: float
    label: str
    symbol: str
    unit: str = ""


def reading(trace: Trace, name: str, *, relative: bool = False, laboratory: bool = False) -> AxisUnit:
    """How to read a channel, or the time `t`, on an axis.

    Args:
        trace: The record.
        name: Channel, or `t`.
        relative: Against the stress-free sphere, where that has a meaning: V, S, H, W of a dimensionless record.
        laboratory: In SI units of a convenient size; needs the record's scales.

    Raises:
        BadValue: Laboratory units of a record that has no scales.
    """
    if laboratory and trace.scales is None:
        raise BadValue(
            "laboratory",
            found="a trace without scales",
            expected="a trace that knows its SI units",
            remedy="Build it with scales=…, or plot it without units.",
        )
    if name not in QUANTITIES:
        return AxisUnit(1.0, name, name)
    known = quantity(name)
    bare = trace.conditions is None and trace.scales is None
    if relative and name in SPHERE and not bare:
        size, symbol = SPHERE[name]
        return AxisUnit(1 / size, f"{known.words} {symbol}", symbol)
    if laboratory and trace.scales is not None and known.dimension in LABORATORY:
        values = trace.times if name == "t" else trace[name]
        reach = float(np.nanmax(np.abs(np.asarray(values)))) * trace.scales.of(known.dimension)
        unit = laboratory_unit(known.dimension, reach)
        factor = trace.scales.of(known.dimension) / UNITS[unit][1]
        return AxisUnit(factor, known.label(unit.translate(POWERS)), known.symbol, unit.translate(POWERS))
    if bare:
        return AxisUnit(1.0, known.label("s" if name == "t" else ""), known.symbol)
    return AxisUnit(1.0, known.label(), known.symbol)


def channel(
    trace: Trace,
    name: str,
    ax: Axes | None = None,
    *,
    relative: bool = True,
    window: tuple[float, float] | None = None,
    mark_dip: bool = True,
    laboratory: bool = False,
    **line: Any,
) -> Axes:
    """One channel of a trace in time.

    Args:
        trace: The record.
        name: Channel.
        ax: Where to draw; by default on a new figure.
        relative: Against the stress-free sphere (V, S, H, W).
        window: First and last time of a window to shade [the trace's time unit].
        mark_dip: Mark the dip that ends the snap, where the record holds one.
        laboratory: In SI units of a convenient size; needs the trace's scales.
        **line: Passed to the line, e.g. `color`, `label`.

    Raises:
        BadName: No such channel.
        BadValue: Laboratory units of a record that has no scales.
    """
    values = np.asarray(trace[name], dtype=float)
    time, shown = _time(trace, laboratory), reading(trace, name, relative=relative, laboratory=laboratory)
    with style():
        ax = axes_or_new(ax)
        if window is not None:
            low, high = (time.factor * edge for edge in window)
            ax.axvspan(low, high, color=PALE, alpha=0.5, linewidth=0, zorder=0, label="window")
        look: dict[str, Any] = {"color": CHANNEL.get(name, BLUE), "label": shown.symbol} | line
        ax.plot(time.factor * np.asarray(trace.times), shown.factor * values, **look)
        if mark_dip and ring_down_start(trace) is not None:
            at = dip(trace, (name,))
            ax.axvline(time.factor * at, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0.5, label="dip")
        ax.margins(x=0.0)
        ax.set_xlabel(time.label)
        ax.set_ylabel(shown.label)
    return ax


def two_modes(signature: Signature, name: str, times: Float[np.ndarray, "times"]) -> Float[np.ndarray, "times"]:
    """The two-mode curve identified in a channel, in the channel's own unit.

    Raises:
        NotOk: No modes were identified.
        BadName: A channel without amplitudes.
    """
    slow, fast, tau = signature.omega_minus, signature.omega_plus, signature.tau
    if signature.outcome != Outcome.OK or slow is None or tau is None:
        raise NotOk(f"signature ({signature.reason})", signature.outcome)
    if name not in signature.amplitudes:
        raise BadName(
            f"channel {name!r}",
            found="no amplitudes in the signature",
            expected="one of " + ", ".join(signature.amplitudes),
            remedy="Extract the modes of that channel first.",
        )
    elapsed = times - signature.window[0]
    damped = np.sqrt(np.array([slow, slow if fast is None else fast]) ** 2 - 1 / tau**2)  # a mode not found has no size
    amplitude, phase = np.array(signature.amplitudes[name]), np.array(signature.phases[name])
    waves = amplitude * np.cos(elapsed[:, None] * damped + phase)
    return signature.offsets[name] + np.exp(-elapsed / tau) * waves.sum(axis=1)


def identified_modes(
    trace: Trace,
    signature: Signature,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    relative: bool = True,
    laboratory: bool = False,
) -> Axes:
    """A channel in its window, the two-mode curve over it, and what the curve leaves, at the same scale below.

    Args:
        trace: The record.
        signature: The modes identified in it.
        name: Channel; by default the first one of the signature.
        ax: Where to draw; by default on a new figure.
        relative: Against the stress-free sphere (V, S, H, W).
        laboratory: In SI units of a convenient size, frequencies in Hz; needs the trace's scales.

    Raises:
        NotOk: No modes were identified.
        BadName: No such channel, or one without amplitudes.
    """
    name = signature.channels[0] if name is None else name
    cut = trace.between(*signature.window)
    times, values = np.asarray(cut.times, dtype=float), np.asarray(cut[name], dtype=float)
    curve = two_modes(signature, name, times)
    time, shown = (
        _time(trace, laboratory),
        reading(trace, name, relative=relative and not laboratory, laboratory=laboratory),
    )
    with style():
        ax = axes_or_new(ax)
        compare(
            ax,
            time.factor * times,
            shown.factor * values,
            shown.factor * curve,
            color=CHANNEL.get(name, BLUE),
            names=(shown.symbol, "one mode" if signature.verdict == "one" else "two modes"),
        )
        ax.text(
            0.985,
            0.98,
            _numbers(signature, time, laboratory),
            transform=ax.transAxes,
            ha="right",
            va="top",
            fontsize=7.5,
        )
        ax.set_xlabel(time.label)
        ax.set_ylabel(shown.label)
    return ax


def compare(
    ax: Axes,
    times: Float[np.ndarray, "times"],
    data: Float[np.ndarray, "times"],
    curve: Float[np.ndarray, "times"],
    *,
    color: str,
    names: tuple[str, str],
) -> None:
    """Data, the curve over them, and their difference about a line of its own below, at the same scale."""
    left = data - curve
    high, low = max(data.max(), curve.max()), min(data.min(), curve.min())
    tall = high - low
    base = low - 0.12 * tall - max(float(left.max()), 0.04 * tall)
    ax.plot(times, data, color=color, linewidth=3.2, alpha=0.55, solid_capstyle="round", label=names[0])
    ax.plot(times, curve, color=BLACK, linewidth=0.9, label=names[1])
    ax.axhline(base, color=PALE, linewidth=0.8, zorder=0.5)
    ax.plot(times, base + left, color=GREY, linewidth=0.9, label="residual, shifted")

    ax.margins(x=0.0)
    ax.set_ylim(base + min(float(left.min()), 0.0) - 0.24 * tall, high + 0.30 * tall)
    # the value axis belongs to the data: no numbers beside the residual
    ticks = np.asarray(ax.get_yticks())
    ax.set_yticks(ticks[(ticks >= low - 0.06 * tall) & (ticks <= high + 0.1 * tall)])
    ax.legend(loc="lower center", ncols=3, columnspacing=1.2)


def _time(trace: Trace, laboratory: bool) -> AxisUnit:
    return reading(trace, "t", laboratory=laboratory)


def _numbers(signature: Signature, time: AxisUnit, laboratory: bool) -> str:
    """Frequencies and decay time with errors, as lines of text."""
    rows = (("omega_minus", "f₋"), ("omega_plus", "f₊"), ("tau", quantity("tau").symbol))
    unit = signature.frequency_unit if laboratory else None
    lines = []
    for key, letter in rows:
        value, error = getattr(signature, key), signature.stderr[key]
        if value is None:
            continue
        if unit is None:
            lines.append(f"{quantity(key).symbol} = {_with_error(value, error)}")
        elif key == "tau":
            lines.append(f"{letter} = {_with_error(value * time.factor, error * time.factor)} {time.unit}")
        else:
            lines.append(f"{letter} = {_with_error(value * unit, error * unit)} Hz")
    return "\n".join(lines)


def _with_error(value: float, error: float) -> str:
    """`1.0757 ± 0.0045`: the error to two digits, the value to the same place."""
    if not (np.isfinite(error) and error > 0):
        return f"{value:.4g}"
    if error < 1e-6 * abs(value):  # of a record without noise
        return f"{value:.6g}"
    digits = min(max(1 - int(np.floor(np.log10(error))), 0), 6)
    return f"{value:.{digits}f} ± {error:.{digits}f}"

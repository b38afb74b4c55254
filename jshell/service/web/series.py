"""Curves for the page: what is drawn, under which labels, said in words for those who do not see it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jshell.calibration import FitResult
from jshell.plot.style import BLACK, BLUE, CHANNEL, GREY, ORANGE, VERMILION
from jshell.plot.traces import AxisUnit, reading
from jshell.service.preview import Preview
from jshell.trace import Trace

MOST = 3000  # points of a curve on the page
DIGITS = 7


@dataclass(frozen=True)
class Line:
    """One curve: label, colour, width, dashes, values."""

    label: str
    color: str
    values: np.ndarray
    width: float | int = 1.5
    dash: tuple[int, ...] = ()
    dots: bool = False


@dataclass(frozen=True)
class Plot:
    """One picture.

    Attributes:
        title: Above it.
        words: What it shows, for those who do not see it.
        x, y: Labels of the axes.
        at: Where the curves have their values.
        lines: The curves.
        mark: Where a vertical line stands.
        height: In pixels.
    """

    title: str
    words: str
    x: str
    y: str
    at: np.ndarray
    lines: tuple[Line, ...]
    mark: float | int | None = None
    height: int = 260

    def record(self) -> dict[str, Any]:
        """For the page's script."""
        return {
            "x": self.x,
            "y": self.y,
            "height": self.height,
            "mark": self.mark,
            "data": [_numbers(self.at), *(_numbers(line.values) for line in self.lines)],
            "lines": [
                {"label": one.label, "color": one.color, "width": one.width, "dash": list(one.dash), "dots": one.dots}
                for one in self.lines
            ],
        }


def _numbers(values: np.ndarray) -> list[float | None]:
    """Rounded to seven digits; what is no number is null."""
    return [float(f"{x:.{DIGITS}g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=float)]


def thinned(*rows: np.ndarray) -> list[np.ndarray]:
    """The rows at every k-th sample, so that none is longer than the page draws."""
    step = -(-rows[0].size // MOST)
    return [np.asarray(row)[::step] for row in rows]


def axis(trace: Trace, name: str) -> AxisUnit:
    """A channel as the page shows it: in SI where the trace has units."""
    return reading(trace, name, laboratory=trace.scales is not None)


def of_preview(found: Preview, whole: Sequence[Trace], names: Sequence[str]) -> list[Plot]:
    """Every recording as it is, with the identified modes drawn over the part that is fitted."""
    plots = []
    for number, (trace, cut, curves) in enumerate(zip(whole, found.traces, found.curves, strict=True)):
        times = np.asarray(trace.times, dtype=float)
        inside = np.isin(times, np.asarray(cut.times, dtype=float))
        for channel in found.channels:
            time, shown = axis(trace, "t"), axis(trace, channel)
            data = shown.factor * np.asarray(trace[channel], dtype=float)
            color = CHANNEL.get(channel, BLUE)
            rows = [time.factor * times, data]
            if channel in curves:
                curve = np.full(times.size, np.nan)
                curve[inside] = shown.factor * curves[channel]
                rows.append(curve)
            at, data, *more = thinned(*rows)
            lines = (
                Line("data", color, data, 1, dots=True),
                *(Line("estimated start", BLACK, row, 1.3) for row in more),
            )
            of = f"{names[number]}: " if len(whole) > 1 else ""
            words = (
                f"{of}{shown.label} over {time.label}, {times.size} samples from {data.min():.4g} to {data.max():.4g}"
            )
            words += f"; the estimated start is drawn over the {inside.sum()} that are fitted." if more else "."
            plots.append(Plot(f"{of}{shown.label}", words, time.label, shown.label, at, lines))
    return plots


def of_fit(result: FitResult, names: Sequence[str]) -> list[tuple[Plot, Plot]]:
    """Data with the fit over them, and what the fit leaves, for every trace and channel."""
    plots = []
    for number, (trace, curves) in enumerate(zip(result.traces, result.curves(), strict=True)):
        for channel, curve in curves.items():
            time, shown = axis(trace, "t"), axis(trace, channel)
            data = np.asarray(trace[channel], dtype=float)
            at, data, curve = thinned(
                time.factor * np.asarray(trace.times, float), shown.factor * data, shown.factor * curve
            )
            left = data - curve
            of = f"{names[number]}: " if len(result.traces) > 1 else ""
            below = (Line("residual", GREY, left, 1),)
            plots.append(
                (
                    compared("fit", of, (time.label, shown.label), channel, (at, data, curve)),
                    Plot(
                        f"{of}residual of {shown.symbol}",
                        f"Residual of {shown.symbol}, between {np.nanmin(left):.3g} and {np.nanmax(left):.3g}.",
                        time.label, "data − fit", at, below, height=130,
                    ),
                )
            )  # fmt: skip
    return plots


def compared(name: str, of: str, labels: tuple[str, str], channel: str, rows: Sequence[np.ndarray]) -> Plot:
    """Data with a curve over them, and how much of their scatter it leaves.

    Args:
        name: Of the curve.
        of: What stands before the label where there are several recordings.
        labels: Of time and channel.
        channel: Chooses the colour.
        rows: Times, data and curve.
    """
    (time, label), (at, data, curve) = labels, rows
    left = float(np.nanstd(data - curve) / max(float(np.nanstd(data)), 1e-300))
    words = f"{of}{label} over {time}: data and {name}, which leaves {100 * left:.2g} % of the scatter."
    lines = (Line("data", CHANNEL.get(channel, BLUE), data, 1, dots=True), Line(name, BLACK, curve, 1.3))
    return Plot(f"{of}{label}", words, time, label, at, lines)


def of_trace(trace: Trace, channels: Sequence[str]) -> list[Plot]:
    """Channels of a trace as they are."""
    plots = []
    for channel in channels:
        time, shown = axis(trace, "t"), axis(trace, channel)
        data = shown.factor * np.asarray(trace[channel], dtype=float)
        at, data = thinned(time.factor * np.asarray(trace.times, dtype=float), data)
        words = f"{shown.label} over {time.label}, from {np.nanmin(data):.4g} to {np.nanmax(data):.4g}."
        line = Line(shown.symbol, CHANNEL.get(channel, BLUE), data)
        plots.append(Plot(shown.label, words, time.label, shown.label, at, (line,), height=210))
    return plots


def of_answer(found: Mapping[str, Any]) -> list[Plot]:
    """Angular frequencies over the outer pressure, and the motion after a push, from the API's own answer."""
    row = lambda values: np.array([np.nan if x is None else x for x in values], dtype=float)  # noqa: E731
    curve, trace = found["crossing"], found["trace"]
    at = row(curve["P_ext"])
    lines = (
        Line("sphere", GREY, row(curve["sphere"]), 1.6),
        Line("ω₋", BLUE, row(curve["omega_minus"]), 1.8),
        Line("ω₊", VERMILION, row(curve["omega_plus"]), 1.8),
        Line("Marmottant", ORANGE, row(curve["marmottant"]), 1.2, (5, 4)),
    )
    load = found["softening"]["load"]
    words = "Angular frequencies over the outer pressure: the sphere's, and beyond buckling ω₋, ω₊ and Marmottant's."
    words += (
        f" Buckling at {load:.4g}; the marked outer pressure is {found['conditions']['Pext_hat']:.4g}." if load else ""
    )
    plots = [
        Plot(
            "Angular frequency over outer pressure", words,
            "outer pressure P̂ext [E d/R₀]", "ω [√(E d/ρ R₀³)]", at, lines,
            found["conditions"]["Pext_hat"],
        )
    ]  # fmt: skip
    if found["outcome"] == "ok":
        volume, area = row(trace["V"]), row(trace["S"])
        shown = (
            Line("V", CHANNEL["V"], 100 * (volume / found["volume"] - 1), 1.5),
            Line("S", CHANNEL["S"], 100 * (area / (4 * np.pi) - 1), 1.5),
        )
        words = "Motion after a push of one percent of the volume: change of volume V and area S in percent over time."
        plots.append(
            Plot(
                "After a push of 1 % of the volume",
                words,
                "time t [√(ρ R₀³/E d)]",
                "change [%]",
                row(trace["t"]),
                shown,
            )
        )
    return plots

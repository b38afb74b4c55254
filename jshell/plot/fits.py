"""Fits of traces: data, curve and residual of every trace and channel."""

from collections.abc import Sequence

import numpy as np
import scipy.interpolate

from jshell.calibration.curves import fitted_curves
from jshell.calibration.data import windowed
from jshell.calibration.profile import Profile
from jshell.calibration.report import FitResult
from jshell.errors import BadShape
from jshell.plot.style import BLUE, CHANNEL, ONE, Axes, new_figure, style
from jshell.plot.traces import compare, reading
from jshell.trace import Trace

PROFILED = {"alpha1": "α₁", "alpha2": "α₂", "k_vs": r"k$_{\mathrm{VS}}$", "beta1": "β₁", "beta2": "β₂", "tau": "τ"}


def trace_fit(
    result: FitResult,
    traces: Trace | Sequence[Trace] | None = None,
    axes: Axes | Sequence[Axes] | np.ndarray | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
) -> np.ndarray:
    """What a trace fit made of its data, one panel for every trace and channel.

    Args:
        result: From `jshell.calibration.fit_trajectories`.
        traces: The traces that were fitted; None takes them from the result, in their windows.
        axes: Where to draw, one per trace and channel, channels fastest; by default on a new figure.
        start, stop: The window that the fit was given.

    Returns:
        (traces, channels) of axes.

    Raises:
        BadShape: Traces or a window other than the fit's; too few axes.
    """
    cut, names = _cut(result, traces, start, stop), result.channels
    pairs = [(trace, name) for trace in cut for name in names]
    curves = [curve for each in fitted_curves(result, cut) for curve in each.values()]
    with style():
        if axes is None:
            figure = new_figure((ONE[0] * len(names), 0.9 * ONE[1] * len(cut)))
            axes = figure.subplots(len(cut), len(names), squeeze=False)
        grid = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
        if grid.size != len(pairs):
            raise BadShape(
                "axes",
                found=f"{grid.size}",
                expected=f"{len(pairs)}, one for every trace and channel",
                remedy="Leave them out for a new figure.",
            )
        for ax, (trace, name), curve in zip(grid, pairs, curves, strict=True):
            time, shown = reading(trace, "t"), reading(trace, name)
            times, data = np.asarray(trace.times, dtype=float), np.asarray(trace[name], dtype=float)
            compare(ax, times, data, curve, color=CHANNEL.get(name, BLUE), names=(shown.symbol, "fit"))
            ax.set_xlabel(time.label)
            ax.set_ylabel(shown.label)
        if len(cut) > 1:
            for number, ax in enumerate(grid[:: len(names)], 1):
                ax.set_title(f"trace {number}", loc="left")
    return grid.reshape(len(cut), len(names))


def _cut(
    result: FitResult, traces: Trace | Sequence[Trace] | None, start: float | None, stop: float | None
) -> list[Trace]:
    """The traces of a fit, in its window."""
    if traces is not None:
        return windowed(traces, start, stop)
    if not result.traces:
        raise BadShape(
            f"result {result.title!r}",
            found="no traces",
            expected="the result of a trace fit",
            remedy="Draw a fit of frequencies with `master_curve`.",
        )
    return list(result.traces)


def _between(points: np.ndarray, value: float, across: np.ndarray) -> np.ndarray:
    """Growth of χ² between the points looked at: its signed root is nearly straight, and interpolated."""
    at, growth = np.unique(points[:, 0], return_index=True)
    root = np.sign(at - value) * np.sqrt(points[growth, 1])
    return np.square(scipy.interpolate.pchip_interpolate(at, root, across))


def profiles(profile: Profile, axes: Axes | Sequence[Axes] | np.ndarray | None = None) -> np.ndarray:
    """Profile likelihoods, one panel for every parameter: growth of χ², the criterion, and both ends.

    Args:
        profile: From `FitResult.profile`.
        axes: Where to draw, one per parameter; by default on a new figure.

    Returns:
        (parameters,) of axes.

    Raises:
        BadShape: Too few axes.
    """
    count = len(profile.intervals)
    with style():
        if axes is None:
            figure = new_figure((0.62 * ONE[0] * min(count, 2), 0.75 * ONE[1] * -(-count // 2)))
            axes = figure.subplots(-(-count // 2), min(count, 2), squeeze=False)
        grid = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
        if grid.size < count:
            raise BadShape("axes", found=f"{grid.size}", expected=f"{count}", remedy="Leave them out for a new figure.")
        for ax, one, points in zip(grid, profile.intervals, profile.points, strict=False):
            inside = points[points[:, 1] <= 2 * profile.growth]
            across = np.linspace(inside[0, 0], inside[-1, 0], 101)
            ax.plot(across, ((across - one.value) / one.stderr) ** 2, color="0.6", linewidth=1.0, label="parabola")
            ax.plot(across, _between(inside, one.value, across), color=BLUE, linewidth=1.2, label="profile")
            ax.plot(inside[:, 0], inside[:, 1], color=BLUE, marker="o", markersize=3, linestyle="none")
            ax.axhline(profile.growth, color="0.3", linewidth=0.8, linestyle="--")
            for end in (one.low, one.high):
                if np.isfinite(end):
                    ax.axvline(end, color="0.3", linewidth=0.8, linestyle=":")
            ax.set_ylim(0, 2 * profile.growth)
            ax.locator_params(axis="x", nbins=4)
            ax.set_xlabel(PROFILED.get(one.name, one.name))
            ax.set_ylabel("Δχ²/s²")
            ax.margins(x=0.02)
        for ax in grid[count:]:
            ax.set_visible(False)
        grid[0].legend(loc="upper center")
    return grid[:count]

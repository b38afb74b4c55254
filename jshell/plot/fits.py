"""Fits of traces: data, curve and residual of every trace and channel.

A `FitResult` keeps the weighted residual, not the curve; with the weights that
the fit gave the same samples, curve = data + residual/weight, to rounding.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jshell.calibration.records import record, windowed
from jshell.calibration.report import FitResult
from jshell.errors import BadShape
from jshell.plot.style import BLUE, CHANNEL, ONE, Axes, new_figure, style
from jshell.plot.traces import compare, reading
from jshell.shell.rest import RestState
from jshell.trace import Trace

AT_REST = " at rest [1]"  # every channel of the first trace has one such estimate


def trace_fit(
    result: FitResult,
    traces: Trace | Sequence[Trace],
    axes: Axes | Sequence[Axes] | np.ndarray | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
) -> np.ndarray:
    """What a trace fit made of its data, one panel for every trace and channel.

    Args:
        result: From `jshell.calibration.fit_trajectories`.
        traces: The traces that were fitted.
        axes: Where to draw, one per trace and channel, channels fastest; by default on a new figure.
        start, stop: The window that the fit was given.

    Returns:
        (traces, channels) of axes.

    Raises:
        BadShape: Traces or a window other than the fit's; too few axes.
    """
    cut, names = windowed(traces, start, stop), fitted_channels(result)
    pairs = [(trace, name) for trace in cut for name in names]
    curves = fitted(result, cut)
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


def fitted_channels(result: FitResult) -> tuple[str, ...]:
    """The channels that a trace fit read, in its order.

    Raises:
        BadShape: The result is not one of a trace fit.
    """
    names = tuple(e.name.removesuffix(AT_REST) for e in result.estimates if e.name.endswith(AT_REST))
    if not names:
        raise BadShape(
            f"result {result.title!r}",
            found="no channels",
            expected="the result of a trace fit",
            remedy="Draw a fit of frequencies with `master_curve`.",
        )
    return names


def fitted(result: FitResult, cut: Sequence[Trace]) -> list[np.ndarray]:
    """The fitted curve of every trace and channel, at the samples of the traces in the fit's window."""
    names = fitted_channels(result)
    unused = RestState(jnp.asarray(1.0), jnp.asarray(1.0))  # a record's weights do not depend on its rest state
    records = [record(trace, names, unused) for trace in cut]
    size = sum(one.data.size for one in records)
    if size != result.residual.size:
        raise BadShape(
            "traces",
            found=f"{size} samples of {', '.join(names)}",
            expected=f"the {result.residual.size} that were fitted",
            remedy="Give the traces, and `start` and `stop`, that the fit was given.",
        )
    found, at = [], 0
    for one in records:
        for data, weight in zip(np.asarray(one.data), np.asarray(one.weight), strict=True):
            found.append(data + np.asarray(result.residual[at : at + data.size]) / weight)
            at += data.size
    return found

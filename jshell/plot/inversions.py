"""An inversion: data, the simulator's curve and what it leaves, of every recording and channel."""

from collections.abc import Sequence

import numpy as np

from jshell.inversion import Inversion
from jshell.plot.style import BLUE, CHANNEL, ONE, Axes, new_figure, style
from jshell.plot.traces import compare
from jshell.quantities import POWERS, QUANTITIES, UNITS, laboratory_unit


def shown_in(name: str, values: np.ndarray, si: bool) -> tuple[float, str]:
    """The factor and the unit that a laboratory reads a channel, or the times `t`, in.

    Args:
        name: Of the registry.
        values: In SI, or without units.
        si: Which of them.
    """
    row = QUANTITIES[name]
    if not si:
        return 1.0, row.scale
    unit = laboratory_unit(row.dimension, float(np.abs(values).max()))
    return 1 / UNITS[unit][1], unit.translate(POWERS)


def inversion(result: Inversion, axes: Axes | Sequence[Axes] | np.ndarray | None = None) -> np.ndarray:
    """What an inversion made of its recordings, one panel for every recording and channel.

    Args:
        result: From `jshell.invert`.
        axes: Where to draw, channels fastest; by default on a new figure.

    Returns:
        (recordings, channels) of axes.

    Raises:
        NotOk: The search ended nowhere, and there is no curve.
    """
    curves = result.curves()
    pairs = [(k, name) for k, each in enumerate(curves) for name in each]
    across = max(len(each) for each in curves)
    recordings = result.recordings
    with style():
        if axes is None:
            figure = new_figure((ONE[0] * across, 0.9 * ONE[1] * len(curves)))
            axes = figure.subplots(len(curves), across, squeeze=False)
        grid = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
        for ax, (k, name) in zip(grid, pairs, strict=False):
            one, row = recordings[k], QUANTITIES[name]
            values = one.values[one.channels.index(name)]
            factor, unit = shown_in(name, values, one.si)
            second, clock = shown_in("t", one.times, one.si)
            names = (row.symbol, "simulator")
            compare(
                ax,
                second * one.times,
                factor * values,
                factor * curves[k][name],
                color=CHANNEL.get(name, BLUE),
                names=names,
            )
            ax.set_xlabel(f"t [{clock}]" if one.si else "t")
            ax.set_ylabel(f"{row.symbol} [{unit}]")
    return grid.reshape(len(curves), across) if grid.size == len(curves) * across else grid

"""The same curves as SVG, made here for those who browse without JavaScript; by `jshell.plot`."""

import io
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jshell.dynamics.vibrations import Modes
from jshell.errors import Outcome
from jshell.plot.shapes import mode_shape, rest_shape
from jshell.plot.style import new_figure, style
from jshell.service.web.series import Plot

SHOWN, STRIP = 3, 7  # modes beside the rest shape; frames of a run
_TURN = threading.Lock()  # matplotlib's settings belong to the process


def svg(plots: Sequence[Plot]) -> bytes:
    """Pictures below each other, in the look of the library's own.

    Raises:
        MissingExtra: matplotlib is not installed.
    """

    def draw(figure: Any) -> None:
        grid = figure.subplots(len(plots), 1, squeeze=False, height_ratios=heights)[:, 0]
        for ax, plot in zip(grid, plots, strict=True):
            for line in plot.lines:
                look: dict[str, Any] = (
                    {"marker": ".", "linestyle": "none", "markersize": 3} if line.dots else {"linewidth": line.width}
                )
                if line.dash:
                    look["dashes"] = line.dash
                ax.plot(plot.at, line.values, color=line.color, label=line.label, **look)
            if plot.mark is not None:
                ax.axvline(plot.mark, color="#333333", linewidth=0.8, linestyle=":")
            ax.set_xlabel(plot.x)
            ax.set_ylabel(plot.y)
            ax.margins(x=0.01)
            if len(plot.lines) > 1:
                ax.legend(loc="best", ncols=2)

    heights = [plot.height for plot in plots]
    return svg_of((7.2, sum(heights) / 90), draw)


def svg_of(size: tuple[float, float], draw: Callable[[Any], None]) -> bytes:
    """A figure of a size [in] as a file, once `draw` has drawn into it.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with _TURN, style():
        figure = new_figure(size)
        draw(figure)
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


def shell(found: Modes) -> bytes:
    """A shell at rest and its slowest modes."""

    def draw(figure: Any) -> None:
        axes = figure.subplots(1, 1 + SHOWN)
        rest_shape(found.rest, axes[0])
        for k in range(SHOWN):
            if int(found.outcome[k]) == Outcome.OK:
                mode_shape(found, k, axes[1 + k])
            else:
                axes[1 + k].set_axis_off()

    return svg_of((9.6, 3.8), draw)


def strip(film: dict[str, Any]) -> bytes:
    """Some frames of a run side by side, evenly by how much of the volume has gone."""
    volume = np.array(film["V"], dtype=float)
    gone = np.cumsum(np.abs(np.diff(volume, prepend=volume[0])))
    chosen = np.unique(np.searchsorted(gone, np.linspace(0.0, gone[-1], STRIP)).clip(0, volume.size - 1))

    def draw(figure: Any) -> None:
        for ax, k in zip(np.atleast_1d(figure.subplots(1, chosen.size)), chosen, strict=True):
            x, r = np.array(film["x"][k]), np.array(film["r"][k])
            ax.fill(np.append(x, x[::-1]), np.append(r, -r[::-1]), facecolor="#e7f1f8", edgecolor="#17212b")
            ax.set_title(f"t = {film['t'][k]:.4g}", fontsize=8)
            ax.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), aspect="equal")
            ax.set_axis_off()

    return svg_of((1.5 * chosen.size, 1.8), draw)

"""The same curves as SVG, made here for those who browse without JavaScript; by `jshell.plot`."""

import io
import threading
from collections.abc import Sequence
from typing import Any

from jshell.plot.style import new_figure, style
from jshell.service.web.series import Plot

_TURN = threading.Lock()  # matplotlib's settings belong to the process


def svg(plots: Sequence[Plot]) -> bytes:
    """Pictures below each other, in the look of the library's own.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with _TURN, style():
        heights = [plot.height for plot in plots]
        figure = new_figure((7.2, sum(heights) / 90))
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
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()

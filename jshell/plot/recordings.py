"""Frames of a film with the outline that was found in each: to look at before its numbers are believed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jshell.camera import Filmed, Lens
from jshell.camera.forms import Film
from jshell.camera.frames import open_film
from jshell.plot.style import ORANGE, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_FRAMES_A_ROW = 6  # frames of a row
SIDE = 2.0  # in, of a frame


def outlines(film: Film | str | Path, found: Filmed, lens: Lens | None = None, count: int = MAX_FRAMES_A_ROW) -> Figure:
    """Some frames of a film, evenly in time, with their outlines.

    Args:
        film: The film, or where it lies.
        found: What `jshell.camera.measure` found in it.
        lens: That of the measurement: outlines without distortion are drawn where the picture shows them.
        count: Frames at most.

    Raises:
        BadFile, BadName: As `jshell.camera.open_film`.
        MissingExtra: matplotlib, or the extra `camera`, is not installed.
    """
    if not isinstance(film, Film):
        with open_film(film) as opened:
            return outlines(opened, found, lens, count)
    chosen = np.unique(np.linspace(0, film.count - 1, count).astype(int)).tolist()
    across = min(len(chosen), MAX_FRAMES_A_ROW)
    down = -(-len(chosen) // across)
    rows, columns = film.shape
    figure = new_figure((SIDE * across, down * (SIDE * min(max(rows / columns, 0.3), 3) + 0.25)))
    for place, number in enumerate(chosen, 1):
        ax = figure.add_subplot(down, across, place)
        ax.imshow(film.read(number), cmap="gray")
        outline = found.outlines[number]
        if outline is not None:
            points = outline.points if lens is None else lens.seen(outline.points)
            ax.plot(*points.T, color=ORANGE, linewidth=0.9)
        ax.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
        ax.set_title(f"frame {number + 1}", fontsize=8)
        ax.set_axis_off()
    return figure

"""A shell in three dimensions, pushed along a motion that is not axially symmetric; and a film of it going round.

The wall is coloured by how far it moves across itself. The dimple looks up.

Symbols    x along the axis [R0], upwards here   φ angle around it [rad]   m order of the motion
Source     `jshell.dynamics.azimuthal_modes`, `jshell.membrane.stability`
"""

from pathlib import Path
from typing import Any

import numpy as np

from jshell.contour import azimuthal
from jshell.errors import BadName, BadValue
from jshell.membrane import RestShape
from jshell.plot.style import Axes, matplotlib, new_figure, style

SIDE = 3.4  # of a picture [inch]
AROUND = 145  # points around the axis
ELEVATION = 38.0  # of the eye [degrees]
FRAMES, PACE = 36, 12  # of a film, and its frames a second
WAVES = 2  # periods of the motion in a film
FILM_DPI = 80


def _surface(
    rest: RestShape, order: int, motion: np.ndarray, size: float
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """The displaced wall, x, y, z with x along the axis, and its motion outwards; (points, around) each.

    Args:
        rest: The shape at rest.
        order: m, at least 1.
        motion: (motions,) coordinates (a, b + c, b - c) on the elements of `rest`; its real part is drawn.
        size: Largest displacement drawn [R0].
    """
    shape = rest.meridian
    curve = shape.at_points(rest.coordinates)
    x, r, x1, r1 = (np.asarray(part)[:, None] for part in curve[:4])
    parts = zip(azimuthal(shape).motion(order), np.real(np.asarray(motion)).reshape(3, -1), strict=True)
    a, p, g = (np.asarray(family.values[0] @ part)[:, None] for family, part in parts)
    b, c = (p + g) / 2, (p - g) / 2
    factor = size / max(np.hypot(a, b).max(), np.abs(c).max())
    phi = np.linspace(0, 2 * np.pi, AROUND)[None]
    along, away, around = a * np.cos(order * phi), b * np.cos(order * phi), c * np.sin(order * phi)
    outwards = factor * (along * r1 - away * x1) / np.hypot(x1, r1)
    y = (r + factor * away) * np.cos(phi) - factor * around * np.sin(phi)
    z = (r + factor * away) * np.sin(phi) + factor * around * np.cos(phi)
    return (x + factor * along, y, z), outwards


def in_space(
    rest: RestShape,
    order: int,
    motion: np.ndarray,
    *,
    size: float = 0.15,
    azimuth: float = 30.0,
    ax: Axes | None = None,
) -> Axes:
    """A shell pushed along a motion of order m >= 1, in three dimensions.

    Args:
        rest, order, motion: As `jshell.dynamics.azimuthal_modes` has them: `rest`, `orders[i]`, `shapes[i, k]`; or
            `jshell.membrane.stability`: `rest`, `order`, `shapes[lowest]`.
        size: Largest displacement drawn [R0].
        azimuth: Of the eye [degrees].
        ax: Axes in three dimensions; by default on a new figure.

    Raises:
        BadValue: An order below 1.
    """
    if order < 1:
        raise BadValue("order", found=f"{order}", expected="1 or more", remedy="m = 0 is drawn by `mode_shape`.")
    with style():
        axes: Any = new_figure((SIDE, SIDE)).add_subplot(projection="3d") if ax is None else ax
        (x, y, z), outwards = _surface(rest, order, motion, size)
        most = max(np.abs(outwards).max(), 1e-12)
        colours = matplotlib().colormaps["RdBu_r"](0.5 + 0.45 * outwards / most)
        axes.plot_surface(y, z, x, facecolors=colours, rstride=2, cstride=2, linewidth=0.0, antialiased=False)
        for setting in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
            setting(-0.75, 0.75)
        axes.set_box_aspect((1, 1, 1))
        axes.view_init(elev=ELEVATION, azim=azimuth)
        axes.set_axis_off()
        axes.set_title(f"m = {order}, swing drawn as {abs(size):.2g} R₀" if ax is None else f"m = {order}")
    return axes


def rotating(rest: RestShape, order: int, motion: np.ndarray, path: str | Path, *, size: float = 0.15) -> Path:
    """A film of a shell that moves along a motion while the eye goes round it, as an animated GIF.

    Args:
        rest, order, motion, size: As in `in_space`.
        path: File to write, .gif.
    """
    target = Path(path)
    if target.suffix.lower() != ".gif":
        raise BadName("film", found=f"ending {target.suffix!r}", expected=".gif", remedy="Name it film.gif.")
    matplotlib()
    from matplotlib.animation import PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with style():
        figure = new_figure((SIDE, SIDE))
        FigureCanvasAgg(figure)
        ax = figure.add_subplot(projection="3d")
        writer = PillowWriter(fps=PACE)
        with writer.saving(figure, str(target), dpi=FILM_DPI):
            for frame in range(FRAMES):
                ax.clear()
                swing = size * np.cos(2 * np.pi * WAVES * frame / FRAMES)
                in_space(rest, order, motion, size=swing, azimuth=360.0 * frame / FRAMES, ax=ax)
                writer.grab_frame()
    return target

"""Shapes: the meridian as it would be seen cut open, at rest and vibrating.

Symbols    x along the axis [R0], the buckling pole at large x   r distance to the axis [R0]
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.contour import Meridian
from jshell.dynamics.vibrations import Modes
from jshell.errors import BadShape, BadValue, Outcome
from jshell.membrane import RestShape
from jshell.plot.style import BLACK, FAST, GREY, PALE, PALETTE, SLOW, SQUARE, Axes, axes_or_new, style
from jshell.quantities import UNITS, laboratory_unit, quantity
from jshell.shell import Scales

LARGEST = 0.15  # the largest displacement a mode is drawn with [R0]
MARGIN = 0.05  # around everything drawn [R0]
WORDS = 0.2  # height left for words below the shapes, over that of the shapes


def outline(shape: Meridian, q: Float[Array, "coordinates"]) -> tuple[np.ndarray, np.ndarray]:
    """The whole meridian as a closed curve: x and r [R0], r negative on the mirrored half."""
    curve, (x_nodes, _) = shape.at_points(q), shape.at_nodes(q)
    x = np.concatenate([[x_nodes[0]], np.asarray(curve.x), [x_nodes[-1]]])
    r = np.concatenate([[0.0], np.asarray(curve.r), [0.0]])
    return np.concatenate([x, x[-2::-1]]), np.concatenate([r, -r[-2::-1]])


def rest_shape(
    states: RestShape | Sequence[RestShape],
    ax: Axes | None = None,
    *,
    labels: Sequence[str] | None = None,
    sphere: bool = True,
) -> Axes:
    """Shapes at rest, cut along the axis; the stress-free sphere dashed.

    Args:
        states: One shape or several.
        ax: Where to draw; by default on a new figure.
        labels: One per shape; by default its volume, and its outcome where that is not ok.
        sphere: Whether to draw the stress-free sphere.

    Raises:
        BadShape: Not one label per shape.
    """
    listed = [states] if isinstance(states, RestShape) else list(states)
    names = [_caption(state) for state in listed] if labels is None else list(labels)
    if len(names) != len(listed):
        raise BadShape(
            "labels", found=f"{len(names)}", expected=f"{len(listed)}, one per shape", remedy="Name every shape."
        )
    colours = [BLACK] if len(listed) == 1 else [PALETTE[i % len(PALETTE)] for i in range(len(listed))]
    with style():
        ax = axes_or_new(ax, SQUARE)
        if sphere:
            _sphere(ax)
        for state, name, colour in zip(listed, names, colours, strict=True):
            x, r = outline(state.meridian, jnp.asarray(state.coordinates))
            ax.plot(x, r, color=colour, label=name)
        ax.legend(loc="lower center", ncols=1 if len(listed) == 1 else 2)
        _frame(ax)
    return ax


def mode_shape(
    modes: Modes, k: int = 0, ax: Axes | None = None, scale: float | None = None, *, scales: Scales | None = None
) -> Axes:
    """One vibration: the rest outline, and the two ends of the swing.

    Where there is loss the parts of the shell do not swing in step; drawn is the moment of the largest change
    of volume.

    Args:
        modes: From `jshell.dynamics.modes`.
        k: Which, 0 is the slowest.
        ax: Where to draw; by default on a new figure.
        scale: Factor on the normalised mode; by default its largest displacement is drawn as 0.15 R0.
        scales: SI values of the units, as of `jshell.shell.scales`: lengths, frequency and decay time are then told in
            mm or µm, Hz and ms or µs.

    Raises:
        BadValue: No such mode.
    """
    count = modes.omega.shape[0]
    if not 0 <= k < count:
        raise BadValue("k", found=repr(k), expected=f"0 to {count - 1}", remedy="Ask `modes` for a larger count.")
    shape, q = modes.rest.meridian, jnp.asarray(modes.rest.coordinates)
    move = jnp.real(jnp.asarray(modes.shapes[k]))
    scaled = "" if scale is not None else f", to {LARGEST:g} R₀"
    if scale is None:
        dx, dr = outline(shape, move)
        scale = LARGEST / float(np.hypot(dx, dr).max())
    colour = PALETTE[k % len(PALETTE)] if k > 1 else (SLOW, FAST)[k]
    with style():
        ax = axes_or_new(ax, SQUARE)
        x, r = outline(shape, q)
        out, back = outline(shape, q + scale * move), outline(shape, q - scale * move)
        ax.fill(*out, color=colour, alpha=0.10, linewidth=0)
        symbol = quantity("V").symbol
        ax.plot(x, r, color=BLACK, linewidth=1.0, label="rest")
        ax.plot(*out, color=colour, linewidth=1.3, label=f"{symbol} up{scaled}")
        ax.plot(*back, color=colour, linewidth=1.0, linestyle=(0, (4, 2)), label=f"{symbol} down")
        ax.text(0.5, 0.105, _rates(modes, k, scales), transform=ax.transAxes, ha="center", va="bottom", fontsize=7.5)
        ax.legend(loc="lower center", ncols=3, columnspacing=0.9, handlelength=1.3, handletextpad=0.5)
        _frame(ax)
        if scales is not None:
            _in_laboratory_units(ax, float(scales.length))
    return ax


def _caption(state: RestShape) -> str:
    symbol = quantity("V").symbol
    text = f"{symbol}/{symbol}₀ = {float(state.volume_ratio):.3f}"
    outcome = Outcome(int(state.outcome))
    return text if outcome == Outcome.OK else f"{text} ({outcome.word})"


def _rates(modes: Modes, k: int, scales: Scales | None) -> str:
    text = f"ω = {float(modes.omega[k]):.3f}"
    tau = float(modes.tau[k])
    if scales is not None:
        f, tau = float(modes.omega[k]) * float(scales.frequency), tau * float(scales.time)
        size, hertz = next((row for row in ((1e6, "MHz"), (1e3, "kHz")) if f >= row[0]), (1.0, "Hz"))
        text = f"f = {f / size:.3g} {hertz}"
        if not np.isfinite(tau):
            return text
        unit = laboratory_unit("time", tau)
        return f"{text}, {quantity('tau').symbol} = {tau / UNITS[unit][1]:.3g} {unit}"
    return f"{text}, {quantity('tau').symbol} = {tau:.2f}" if np.isfinite(tau) else text


def _in_laboratory_units(ax: Axes, radius: float) -> None:
    """Axes of R0 told in mm or µm."""
    unit = laboratory_unit("length", radius)
    words = [f"{place * radius / UNITS[unit][1]:.4g}" for place in (-1, 0, 1)]
    ax.set_xticks([-1.0, 0.0, 1.0], words)
    ax.set_yticks([-1.0, 0.0, 1.0], words)
    ax.set_xlabel(f"along the axis x [{unit}]")
    ax.set_ylabel(f"from the axis r [{unit}]")


def _sphere(ax: Axes) -> None:
    angle = np.linspace(0.0, 2 * np.pi, 361)
    ax.fill(np.cos(angle), np.sin(angle), color=PALE, alpha=0.35, linewidth=0)
    ax.plot(np.cos(angle), np.sin(angle), color=GREY, linestyle=(0, (4, 3)), linewidth=0.9, label="stress-free sphere")


def _frame(ax: Axes) -> None:
    """Equal scales, room for the stress-free sphere at least, and below for words: panels beside each other match."""
    points = np.concatenate([np.asarray(line.get_xydata()) for line in ax.get_lines()])
    points = points[np.isfinite(points).all(axis=1)]  # a shape that was not found has none: the legend says why
    points = np.concatenate([points, [[0.0, 0.0]]])
    left, low = np.minimum(points.min(axis=0), -1.1) - MARGIN
    right, high = np.maximum(points.max(axis=0), 1.1) + MARGIN
    ax.set_xlim(left, right)
    ax.set_ylim(low - WORDS * (high - low), high)
    ax.set_xticks([-1.0, 0.0, 1.0])
    ax.set_yticks([-1.0, 0.0, 1.0])
    ax.set_aspect("equal", adjustable="box")
    unit = quantity("x_front").scale
    ax.set_xlabel(f"along the axis x [{unit}]")
    ax.set_ylabel(f"from the axis r [{unit}]")

"""Figures of the source that show shapes: set-up, snap with its flow, the two motions, the meridian.

Symbols    H, W height and width [R0]   f frequency [Hz]   λ1, λ2 stretches along the meridian and around the axis
Source     Mokbel et al. 2021: fig:exptyp, fig:simulationResults, fig:schememodel, fig:axisymmetric
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jshell.contour import speed
from jshell.dynamics import Modes, Motion
from jshell.flow import field
from jshell.membrane import RestShape
from jshell.paper.printed import printed
from jshell.plot.film import AIR, WALL, WATER, filmstrip
from jshell.plot.shapes import outline
from jshell.plot.style import BLACK, BLUE, GREY, VERMILION, Axes, Figure, new_figure, style
from jshell.plot.traces import two_modes
from jshell.shell.parameters import Scales
from jshell.signals import Signature
from jshell.trace import Trace

LARGEST = 0.11  # the largest displacement that a motion is drawn with [R0]
OVERTONE = 0.1  # a second frequency this near to twice the first is its overtone
REACH = 1.75  # half the side of the pictures of the two motions [R0]
SPACING = 0.22  # between arrows there [R0]


def setup(rest: RestShape, trace: Trace, extracted: Signature, scales: Scales) -> Figure:
    """fig:exptyp: the attached shell, and its height and width ringing after the snap, with their damped pair.

    Args:
        rest: The attached shell at rest.
        trace: Its snap, with H and W.
        extracted: What was extracted from H and W together.
        scales: The laboratory's units, in which the record is shown.
    """
    with style():
        figure = new_figure((7.6, 3.5))
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.75))
        _measured_shape(rest, float(trace.conditions.thickness) if trace.conditions else 0.0, left)
        _letter(left, "a", "what a camera sees")

        cut = trace.between(extracted.t_dip - 8.0, extracted.t_dip + 36.0)
        first = extracted.t_dip - 8.0
        ms, mm = 1e3 * scales.time, 1e3 * scales.length
        times = np.asarray(cut.times)
        fitted = times >= extracted.window[0]
        for name, colour in (("W", BLUE), ("H", VERMILION)):
            right.plot(ms * (times - first), mm * np.asarray(cut[name]), color=colour, linewidth=2.6, alpha=0.55)
            curve = two_modes(extracted, name, times[fitted])
            right.plot(ms * (times[fitted] - first), mm * curve, color=BLACK, linewidth=0.8)
            level = mm * extracted.offsets[name]
            right.annotate(
                {"W": "W, width", "H": "H, height"}[name], (1.0, level), xycoords=("axes fraction", "data"),
                xytext=(4, 0), textcoords="offset points", color=colour, va="center",
            )  # fmt: skip
        right.set_xlabel("time t [ms]")
        right.set_ylabel("H, W [mm]")
        right.set_xlim(0.0, ms * (times[-1] - first))
        low, high = right.get_ylim()
        right.set_ylim(low, high + 0.2 * (high - low))
        right.text(
            0.99, 0.99, _in_hertz(extracted, scales), transform=right.transAxes, ha="right", va="top", fontsize=7.5
        )
        _letter(right, "b", "snap and ring-down; black: two damped sinusoids")
    return figure


def snapshots(motion: Motion) -> Figure:
    """fig:simulationResults: the snap in pictures, the liquid's velocity as arrows, the last contours overlaid.

    Args:
        motion: A run with shapes, from `jshell.dynamics.record`.
    """
    return filmstrip(motion)


def coordinates(modes: Modes) -> Figure:
    """fig:schememodel, from the simulator: the two slowest motions, how they change V and S, and their flow.

    The source takes one motion that changes V alone and one that changes S alone. Arrows are the liquid's velocity,
    as long as the square root of the speed.

    Args:
        modes: Undamped, two at least.
    """
    with style():
        figure = new_figure((7.2, 4.1))
        axes = figure.subplots(1, 2)
        for k, (ax, letter, word) in enumerate(zip(axes, "ab", ("slow", "fast"), strict=True)):
            _motion_of(modes, jnp.real(jnp.asarray(modes.shapes[k])), ax)
            ratio = float(modes.dS[k]) / float(modes.dV[k])
            _letter(ax, letter, f"{word} mode, ω̂ = {float(modes.omega[k]):.2f}:  dŜ/dV̂ = {ratio:.2f}".replace("-", "−"))
        figure.legend(
            *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3,
            title="source: one motion with dŜ = 0, one with dV̂ = 0",
        )  # fmt: skip
    return figure


def meridian_stretches(rest: RestShape) -> Figure:
    """fig:axisymmetric: the meridian in the liquid, and how far the wall is stretched along and around.

    Args:
        rest: A buckled shape at rest.
    """
    shape, q = rest.meridian, rest.coordinates
    curve = shape.at_points(q)
    angles = np.asarray(shape.angles)
    along = np.asarray(speed(curve))
    around = np.asarray(curve.r) / np.sin(angles)
    x, r = np.asarray(curve.x), np.asarray(curve.r)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(r)))])
    with style():
        figure = new_figure((7.4, 3.3))
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
        left.set_facecolor(WATER)
        node_x, node_r = (np.asarray(part) for part in shape.at_nodes(q))
        left.fill(np.append(x, x[0]), np.append(r, 0.0), color=AIR, linewidth=0)
        left.axhline(0.0, color=GREY, linewidth=0.8, linestyle=(0, (6, 2, 1, 2)))
        left.plot(x, r, color=BLACK, linewidth=1.2)
        left.plot(node_x, node_r, "o", color=VERMILION, markersize=2.6)
        left.text(1.0, 1.42, "liquid Ω", ha="right")
        left.text(-0.15, 0.55, "gas", ha="center")
        low = int(np.argmax(r))
        left.annotate("Γ", (x[low], r[low]), xytext=(0, 7), textcoords="offset points", ha="center")
        left.set_xlim(-1.5, 1.25)
        left.set_ylim(-0.12, 1.62)
        left.set_aspect("equal")
        left.set_xlabel("along the axis x [R₀]")
        left.set_ylabel("from the axis r [R₀]")
        _letter(left, "a", "meridian and its nodes")
        right.axhline(1.0, color=GREY, linewidth=0.8)
        right.plot(arc, along, color=BLUE, label="λ₁, along the meridian")
        right.plot(arc, around, color=VERMILION, linestyle=(0, (5, 2)), label="λ₂, around the axis")
        right.set_xlim(0.0, arc[-1])
        right.set_xlabel("arc length from the buckling pole s [R₀]")
        right.set_ylabel("stretch λ₁, λ₂")
        right.legend(loc="lower right")
        _letter(right, "b", "principal stretches at rest")
    return figure


def _letter(ax: Axes, letter: str, words: str) -> None:
    ax.set_title(rf"$\bf{{({letter})}}$  {words}", loc="left")


def _measured_shape(rest: RestShape, thickness: float, ax: Axes) -> None:
    """The shell cut open, its height and width, and the pad that holds it."""
    shape, q = rest.meridian, rest.coordinates
    x, r = outline(shape, q)
    ax.set_facecolor(WATER)
    half = thickness / 2
    dx, dr = np.gradient(x), np.gradient(r)
    ds = np.hypot(dx, dr)
    # drawn with the axis upright, the buckling pole on top
    ax.fill(r - half * dx / ds, x + half * dr / ds, color=WALL, linewidth=0, zorder=3)
    ax.fill(r + half * dx / ds, x - half * dr / ds, color=AIR, linewidth=0, zorder=4)
    low, high, wide = x.min(), x.max(), r.max()
    arrow = {"arrowstyle": "<->", "color": BLACK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (-wide - 0.34, low), (-wide - 0.34, high), arrowprops=arrow)
    ax.text(-wide - 0.42, (low + high) / 2, "H", ha="right", va="center", color=VERMILION, fontsize=11)
    ax.annotate("", (-wide, high + 0.34), (wide, high + 0.34), arrowprops=arrow)
    ax.text(0.0, high + 0.40, "W", ha="center", va="bottom", color=BLUE, fontsize=11)
    for end in (low, high):
        ax.plot([-wide - 0.4, 0.0], [end, end], color=GREY, linewidth=0.6, linestyle=(0, (3, 2)), zorder=1)
    for side in (-wide, wide):
        ax.plot([side, side], [0.0, high + 0.4], color=GREY, linewidth=0.6, linestyle=(0, (3, 2)), zorder=1)
    pad = np.sin(shape.attached) if shape.attached else 0.3
    ax.fill_between([-pad, pad], low - half - 0.32, low - half + 0.02, color=GREY, linewidth=0, zorder=2)
    ax.text(pad + 0.08, low - half - 0.17, "held", ha="left", va="center", fontsize=7.5)
    ax.set_xlim(-wide - 0.72, wide + 0.3)
    ax.set_ylim(low - half - 0.4, high + 0.68)
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)


def _in_hertz(extracted: Signature, scales: Scales) -> str:
    """What was extracted beside what the source prints."""
    ours = (extracted.omega_minus or np.nan, extracted.omega_plus or np.nan)
    rows = []
    for symbol, value, key in (("f₋", ours[0], "f_minus"), ("f₊", ours[1], "f_plus")):
        rows.append(f"{symbol} = {value * scales.frequency:.1f} Hz  (experiment: {printed('fig:exptyp', key).value:g})")
    if abs(ours[1] / ours[0] - 2) < OVERTONE:
        rows.append("f₊ here is 2 f₋, the overtone of a large swing")
    return "\n".join(rows)


def _motion_of(modes: Modes, move: Any, ax: Axes) -> None:
    """The rest outline, the two ends of a motion, and the liquid's velocity along it."""
    shape, q = modes.rest.meridian, jnp.asarray(modes.rest.coordinates)
    dx, dr = outline(shape, move)
    move = move * (LARGEST / float(np.hypot(dx, dr).max()))
    rows, columns = np.arange(SPACING / 2, REACH, SPACING), np.arange(-REACH, REACH + 1e-9, SPACING)
    x, r = (np.ravel(part) for part in np.meshgrid(columns, rows))
    x = x - 0.12
    seen = field(shape, q, move, jnp.asarray(x), jnp.asarray(r))
    keep = np.asarray(seen.outside) & (np.asarray(seen.distance) > 0.09)
    x, r, v_x, v_r = x[keep], r[keep], np.asarray(seen.v_x)[keep], np.asarray(seen.v_r)[keep]
    size = np.hypot(v_x, v_r)
    # length as the square root of the speed: a dipole would be seen near the wall alone
    factor = 0.34 / np.sqrt(size.max() * np.maximum(size, 1e-12))
    ax.set_facecolor(WATER)
    ax.quiver(
        np.concatenate([r, -r]), np.concatenate([x, x]), np.concatenate([factor * v_r, -factor * v_r]),
        np.concatenate([factor * v_x, factor * v_x]), color="#7FA8C9", pivot="middle", angles="xy", scale_units="xy",
        scale=1, width=0.005, headwidth=3.6, headlength=4, headaxislength=3.6, minlength=0, zorder=2,
    )  # fmt: skip
    at_rest, out, back = outline(shape, q), outline(shape, q + move), outline(shape, q - move)
    ax.fill(at_rest[1], at_rest[0], color=AIR, linewidth=0, zorder=2.5)
    ax.plot(at_rest[1], at_rest[0], color=BLACK, linewidth=1.0, zorder=3, label="at rest")
    ax.plot(out[1], out[0], color=VERMILION, zorder=3, label="V largest")
    ax.plot(back[1], back[0], color=BLUE, linestyle=(0, (4, 2)), zorder=3, label="V smallest")
    ax.set_xlim(-REACH, REACH)
    ax.set_ylim(-REACH - 0.12, REACH - 0.12)
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)

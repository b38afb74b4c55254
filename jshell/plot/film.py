"""A run as pictures: a strip of moments of the snap with the liquid's motion, and a film of it.

The shell is cut along its axis, both halves drawn, the wall as thick as it is.
Arrows are the liquid's velocity.

Symbols    x along the axis [R0], the buckling pole at large x   r distance to the axis [R0]
Source     Mokbel et al. 2021, fig:simulationResults
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jshell.contour import Meridian
from jshell.dynamics import Motion
from jshell.dynamics.outputs import liquid_at, meridian_at, meridians
from jshell.errors import BadName, BadValue
from jshell.plot.shapes import outline
from jshell.plot.style import (
    BLACK,
    BLUE,
    GREEN,
    PALE,
    VERMILION,
    Axes,
    Figure,
    axes_or_new,
    matplotlib,
    new_figure,
    style,
)  # fmt: skip
from jshell.plot.traces import reading
from jshell.quantities import UNITS, laboratory_unit
from jshell.shell import Scales
from jshell.shell.elasticity import SPHERE_VOLUME

REACH = 1.65  # half the side of a picture [R0]
SPACING = 0.19  # between arrows [R0]
CLEAR = 0.05  # arrows begin this far outside the wall [R0]
LONGEST = 0.55  # length of the longest arrow of a group of pictures [R0]
SHORTEST = 0.025  # shorter ones are left out [R0]
MATERIAL = 13  # points of the wall whose way is drawn, from pole to pole
ROW = 4  # pictures in a row of a strip
PANEL = 2.35  # side of a picture in a strip [inch]
WATER, WALL, AIR = "#EAF3FA", "#4A4A4A", "#FFFFFF"
LATE = (VERMILION, BLUE, BLACK)  # the last three contours laid over each other


@dataclass(frozen=True)
class Arrows:
    """The liquid's velocity where arrows are drawn: places and velocities, both halves, (arrows,) each."""

    x: np.ndarray
    r: np.ndarray
    v_x: np.ndarray
    v_r: np.ndarray

    @property
    def fastest(self) -> float:
        return float(np.hypot(self.v_x, self.v_r).max(initial=0.0))


def filmstrip(
    motion: Motion,
    times: Sequence[float] | None = None,
    *,
    flow: bool = True,
    contours: bool = True,
    scales: Scales | None = None,
) -> Figure:
    """Moments of a run beside each other, and the contours of the last three laid over one another.

    Arrows are as long as the liquid is fast. After the deepest dent they are drawn longer, by the whole factor
    that a picture tells.

    Args:
        motion: From `jshell.dynamics.record`.
        times: Moments to draw, the nearest samples are taken; by default `moments`.
        flow: Whether to draw the liquid's velocity.
        contours: Whether to add the last picture; marks and arrows there are points of the wall and
            their way from the first of the three to the second.
        scales: SI values of the units, as of `jshell.shell.scales`: moments are then told in ms or µs.

    Raises:
        BadValue: No times, or a time outside the run.
    """
    chosen = moments(motion) if times is None else [float(t) for t in times]
    samples = [_sample(motion, t) for t in chosen]
    if not samples:
        raise BadValue("times", found="none", expected="at least one moment", remedy="Leave `times` out.")
    fields = [arrows(motion, k) if flow else None for k in samples]
    deepest = _deepest(motion)
    fast = max((a.fastest for a in fields if a is not None), default=0.0)
    late = max((a.fastest for a, k in zip(fields, samples, strict=True) if a is not None and k > deepest), default=0.0)
    factor = max(1, int(fast / late)) if late > 0 else 1
    count = len(samples) + contours
    columns = min(ROW, count)
    rows = -(-count // columns)
    with style():
        figure = new_figure((PANEL * columns, PANEL * 1.15 * rows))
        axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False).ravel())
        for ax in axes[count:]:
            ax.remove()
        for letter, ax, k, seen in zip("abcdefghijklmnopqrstuvwxyz", axes, samples, fields, strict=False):
            stretch = factor if k > deepest else 1
            _picture(ax, motion, k, seen, stretch * LONGEST / fast if fast > 0 else 0.0)
            ax.set_title(f"({letter})  {_caption(motion, k, scales)}", loc="left")
            if stretch > 1 and seen is not None:
                ax.text(0.98, 0.02, f"arrows ×{stretch}", transform=ax.transAxes, ha="right", va="bottom", fontsize=7)
        if contours:
            letter = "abcdefghijklmnopqrstuvwxyz"[len(samples) % 26]
            _contours(axes[len(samples)], motion, samples[-3:], scales)
            axes[len(samples)].set_title(f"({letter})  contours", loc="left")
    return figure


def snapshot(motion: Motion, time: float | int, ax: Axes | None = None, *, flow: bool = True) -> Axes:
    """One moment of a run: the shell cut open, and the liquid's velocity.

    Args:
        motion: From `jshell.dynamics.record`.
        time: The nearest sample is taken [time unit].
        ax: Where to draw; by default on a new figure.
        flow: Whether to draw the liquid's velocity; the longest arrow is 0.55 R0 long.

    Raises:
        BadValue: A time outside the run.
    """
    k = _sample(motion, float(time))
    seen = arrows(motion, k) if flow else None
    with style():
        ax = axes_or_new(ax, (3.4, 3.6))
        _picture(ax, motion, k, seen, LONGEST / seen.fastest if seen is not None and seen.fastest > 0 else 0.0)
        ax.set_title(_caption(motion, k), loc="left")
    return ax


def animate(
    motion: Motion,
    path: str | Path,
    *,
    start: float | int | None = None,
    stop: float | int | None = None,
    frames: int = 100,
    rate: int = 20,
    flow: bool = True,
) -> Path:
    """A film of a run: the shell in its liquid, and the volume in time below it, as an animated picture.

    Arrows grow with the square root of the speed, so that the slow motion after the snap is seen, too.

    Args:
        motion: From `jshell.dynamics.record`.
        path: File to write, `.gif`.
        start, stop: First and last moment; by default from where the shell first moves visibly to the end.
        frames: Pictures in the film, evenly spaced in time, at most one per sample.
        rate: Pictures per second.
        flow: Whether to draw the liquid's velocity.

    Raises:
        BadName: Another ending than `.gif`.
        BadValue: An empty span of time, fewer than two pictures, or no rate.
    """
    target = Path(path)
    if target.suffix.lower() != ".gif":
        raise BadName("film", found=f"ending {target.suffix!r}", expected=".gif", remedy="Name it film.gif.")
    if frames < 2 or rate < 1:
        raise BadValue(
            "frames, rate", found=f"{frames}, {rate}", expected="2 pictures or more, 1 per second or more",
            remedy="100 and 20 are usual.",
        )  # fmt: skip
    first = _first_seen(motion) if start is None else _sample(motion, float(start))
    last = len(motion.trace.times) - 1 if stop is None else _sample(motion, float(stop))
    if last <= first:
        raise BadValue(
            "start, stop", found=f"{start}, {stop}", expected="two moments in rising order", remedy="Leave them out."
        )
    samples = np.unique(np.linspace(first, last, frames).round().astype(int))
    fields = [arrows(motion, int(k)) if flow else None for k in samples]
    fast = max((a.fastest for a in fields if a is not None), default=0.0)
    matplotlib()
    from matplotlib.animation import PillowWriter

    with style():
        figure = new_figure((3.6, 4.9))
        above, below = figure.subplots(2, 1, height_ratios=[3.4, 1])
        writer = PillowWriter(fps=rate)
        with writer.saving(figure, str(target), dpi=110):
            for k, seen in zip(samples, fields, strict=True):
                above.clear()
                _picture(above, motion, int(k), _rooted(seen, fast), LONGEST)
                above.set_title(_caption(motion, int(k)), loc="left")
                _volume(below, motion, samples, int(k))
                writer.grab_frame()
    return target


def moments(motion: Motion) -> list[float]:
    """Seven moments that tell the story of a snap, as the source's figure does [time unit].

    Four on the way to the deepest dent, the next two turns of the volume, and the end. A run without a dimple
    gets seven even ones.
    """
    times, V, sunk = np.asarray(motion.trace.times), np.asarray(motion.trace["V"]), _sunk(motion)
    deepest = _deepest(motion)
    if deepest in (0, times.size - 1):
        return [float(t) for t in times[np.linspace(0, times.size - 1, 7).round().astype(int)]]
    depth = sunk[deepest] - sunk[0]
    way = [int(np.argmax(sunk[: deepest + 1] - sunk[0] >= share * depth)) for share in (0.02, 0.3, 0.7)]
    turns = deepest + 1 + np.flatnonzero(np.diff(np.sign(np.diff(V[deepest:]))) != 0)
    later = [int(k) for k in turns[turns > deepest + 1][:2]]
    return [float(times[k]) for k in sorted({*way, deepest, *later, times.size - 1})]


def arrows(motion: Motion, sample: int, *, reach: float = REACH, spacing: float = SPACING) -> Arrows:
    """The liquid's velocity on a grid around the shell at one sample, both halves."""
    rows = np.arange(spacing / 2, reach, spacing)
    columns = np.arange(-reach, reach, spacing) + (reach % spacing)
    x, r = (np.ravel(part) for part in np.meshgrid(columns, rows))
    centre = _centre(motion, sample)
    seen = liquid_at(motion, sample, jnp.asarray(x + centre), jnp.asarray(r))
    half = float(motion.setup.conditions.thickness) / 2
    keep = np.asarray(seen.outside) & (np.asarray(seen.distance) > half + CLEAR)
    x, r, v_x, v_r = x[keep] + centre, r[keep], np.asarray(seen.v_x)[keep], np.asarray(seen.v_r)[keep]
    both = lambda upper, lower: np.concatenate([upper, lower])  # noqa: E731
    return Arrows(both(x, x), both(r, -r), both(v_x, v_x), both(v_r, -v_r))


def _picture(ax: Axes, motion: Motion, k: int, seen: Arrows | None, scale: float) -> None:
    """The shell cut open in its liquid, with arrows `scale` long per speed."""
    centre = _centre(motion, k)
    ax.set_facecolor(WATER)
    outer, inner = _faces(motion, k)
    if seen is not None and scale > 0:
        long = scale * np.hypot(seen.v_x, seen.v_r) > SHORTEST
        ax.quiver(
            seen.x[long], seen.r[long], scale * seen.v_x[long], scale * seen.v_r[long], color=BLUE, pivot="tail",
            angles="xy", scale_units="xy", scale=1, width=0.0062, headwidth=3.4, headlength=4.0, headaxislength=3.6,
            minlength=0, zorder=2,
        )  # fmt: skip
    ax.fill(*outer, color=WALL, linewidth=0, zorder=3)
    ax.fill(*inner, color=AIR, linewidth=0, zorder=4)
    ax.set_xlim(centre - REACH, centre + REACH)
    ax.set_ylim(-REACH, REACH)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)


def _faces(motion: Motion, k: int) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Outer and inner face of the wall, half its thickness from the meridian on either side, as closed curves."""
    shape, q = meridian_at(motion, k), motion.coordinates[k]
    x, r = outline(shape, q)
    dx, dr = _slope(shape, q)
    ds = np.hypot(dx, dr)
    half = _thickness(motion, shape) / 2
    across_x, across_r = half * dr / ds, -half * dx / ds
    return (x + across_x, r + across_r), (x - across_x, r - across_r)


def _slope(shape: Meridian, q: jax.Array) -> tuple[np.ndarray, np.ndarray]:
    """Tangent along the closed outline, in its own order."""
    curve = shape.at_points(q)
    x1, r1 = np.asarray(curve.x1), np.asarray(curve.r1)
    first, last = np.array([np.hypot(x1[0], r1[0])]), np.array([-np.hypot(x1[-1], r1[-1])])
    dx, dr = np.concatenate([[0.0], x1, [0.0]]), np.concatenate([first, r1, last])
    return np.concatenate([dx, -dx[-2::-1]]), np.concatenate([dr, dr[-2::-1]])


def _thickness(motion: Motion, shape: Meridian) -> np.ndarray:
    """Thickness along the closed outline [R0]."""
    setup = motion.setup
    at = np.concatenate([[0.0], np.asarray(shape.angles), [np.pi]])
    profile = np.interp(at, np.asarray(setup.shape.angles), np.asarray(setup.profile))
    thickness = float(setup.conditions.thickness) * profile
    return np.concatenate([thickness, thickness[-2::-1]])


def _contours(ax: Axes, motion: Motion, samples: Sequence[int], scales: Scales | None) -> None:
    """Contours laid over each other, and the way of the wall's points from the first to the second."""
    looks = LATE[-len(samples) :]
    for k, colour in zip(samples, looks, strict=True):
        x, r = outline(meridian_at(motion, k), motion.coordinates[k])
        ax.plot(
            x,
            r,
            color=colour,
            linewidth=1.1,
            label=_moment(motion, k, scales).removeprefix("" if scales is None else "t = "),
        )
    shapes, _ = meridians(motion, np.linspace(0.0, np.pi, MATERIAL), samples=samples)
    x, r = np.asarray(shapes.x), np.asarray(shapes.r)
    x, r = np.concatenate([x, x], axis=1), np.concatenate([r, -r], axis=1)
    for points, marker in zip(range(min(2, len(samples) - 1)), "o^", strict=False):
        ax.plot(x[points], r[points], marker, color=looks[points], markersize=2.2)
    if len(samples) > 1:
        ax.quiver(
            x[0], r[0], x[1] - x[0], r[1] - r[0], color=WALL, angles="xy", scale_units="xy", scale=1, width=0.004,
            headwidth=4, minlength=0,
        )  # fmt: skip
    centre, reach = _centre(motion, samples[-1]), 0.82 * REACH
    ax.set_xlim(centre - reach, centre + reach)
    ax.set_ylim(-1.1 * reach, 0.9 * reach)
    ax.set_aspect("equal", adjustable="box")
    ax.set_axis_off()
    ax.legend(loc="lower center", ncols=3, borderaxespad=0.0, handlelength=0.9, handletextpad=0.4, columnspacing=0.8)


def _volume(ax: Axes, motion: Motion, samples: np.ndarray, k: int) -> None:
    """The volume over the span of the film, and where it is now."""
    ax.clear()
    trace, span = motion.trace, slice(int(samples[0]), int(samples[-1]) + 1)
    times, V = np.asarray(trace.times), np.asarray(trace["V"]) / SPHERE_VOLUME
    ax.plot(times[span], V[span], color=PALE)
    ax.plot(times[span.start : k + 1], V[span.start : k + 1], color=GREEN)
    ax.plot(times[k], V[k], "o", color=GREEN)
    ax.margins(x=0.02)
    ax.set_xlabel(reading(trace, "t").label)
    ax.set_ylabel(reading(trace, "V", relative=True).symbol)


def _rooted(seen: Arrows | None, fast: float) -> Arrows | None:
    """Arrows as long as the square root of the speed over the fastest."""
    if seen is None or fast <= 0:
        return None
    speed = np.hypot(seen.v_x, seen.v_r)
    factor = np.sqrt(speed / fast) / np.where(speed > 0, speed, 1.0)
    return Arrows(seen.x, seen.r, factor * seen.v_x, factor * seen.v_r)


def _caption(motion: Motion, k: int, scales: Scales | None = None) -> str:
    volume = float(motion.trace["V"][k]) / SPHERE_VOLUME
    return f"{_moment(motion, k, scales)},  V/V₀ = {volume:.3f}"


def _moment(motion: Motion, k: int, scales: Scales | None) -> str:
    """When a sample was taken, in time units or in one of the laboratory's."""
    times = np.asarray(motion.trace.times)
    if scales is None:
        return f"t = {float(times[k]):.2f}"
    unit = laboratory_unit("time", float(times[-1]) * float(scales.time))
    return f"t = {float(times[k]) * float(scales.time) / UNITS[unit][1]:.1f} {unit}"


def _centre(motion: Motion, k: int) -> float:
    """Middle of the picture: where the shell's own middle was at the beginning."""
    trace = motion.trace
    return float((trace["x_front"][0] + trace["x_back"][0]) / 2)


def _sunk(motion: Motion) -> np.ndarray:
    """How far the buckling pole lies below the top [R0]."""
    trace = motion.trace
    return np.asarray(trace["H"]) - (np.asarray(trace["x_front"]) - np.asarray(trace["x_back"]))


def _deepest(motion: Motion) -> int:
    """The sample with the deepest dent."""
    return int(np.argmax(_sunk(motion)))


def _first_seen(motion: Motion) -> int:
    """Some time before the dent is a tenth of its depth; the first sample where there is none."""
    sunk, times = _sunk(motion), np.asarray(motion.trace.times)
    deepest = _deepest(motion)
    if deepest == 0:
        return 0
    begun = int(np.argmax(sunk >= 0.1 * sunk[deepest]))
    return int(np.searchsorted(times, times[begun] - 0.1 * (times[-1] - times[begun])))


def _sample(motion: Motion, time: float) -> int:
    times = np.asarray(motion.trace.times)
    if not times[0] <= time <= times[-1]:
        raise BadValue(
            "time",
            found=f"{time:g}",
            expected=f"a moment from {times[0]:g} to {times[-1]:g}",
            remedy="The run ends there: ask for less, or run longer.",
        )
    return int(np.argmin(np.abs(times - time)))

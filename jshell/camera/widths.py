"""Widths of an outline across its axis at shares of its height: where it bulges, beside how far it reaches.

Symbols    p, q along and across the axis [px]   n_q part of the edge's normal across it: what moves the edge by e moves
           q by e/n_q there   ρ radius of curvature, b blur [px]: as at the ends, b²/2ρ is put back
"""

import numpy as np

from jshell.camera.ends import end
from jshell.camera.hull import Extent
from jshell.camera.outline import Outline

SHARES = (0.25, 0.5, 0.75)
REACH = 12  # points on each side that show how the edge lies and bends


def widths(outline: Outline, angle: float) -> list[Extent]:
    """The widths at each of `SHARES` of the height; NaN where the outline is not crossed on both sides.

    Args:
        outline: The outline.
        angle: Of the axis, from the picture's columns upward [rad]; the height counts from the lower end.
    """
    along = np.array([np.cos(angle), -np.sin(angle)])  # rows count downward
    across = np.array([-along[1], along[0]])
    p, q = outline.points @ along, outline.points @ across
    high, low = end(outline, along).value, -end(outline, -along).value
    found = []
    for share in SHARES:
        away = p - (low + share * (high - low))
        cut = np.flatnonzero(np.sign(away[:-1]) != np.sign(away[1:]))
        if len(cut) < 2:
            found.append(Extent(np.nan, np.nan))
            continue
        at = q[cut] - away[cut] * (q[cut + 1] - q[cut]) / (p[cut + 1] - p[cut])
        sides = [_edge(p, q, int(cut[k]), outline.blur) for k in (np.argmin(at), np.argmax(at))]
        inward = sum(back for _, back in sides)
        found.append(
            Extent(float(np.ptp(at)) + inward, outline.sigma * float(np.hypot(1 / sides[0][0], 1 / sides[1][0])))
        )
    return found


def _edge(p: np.ndarray, q: np.ndarray, k: int, blur: float) -> tuple[float, float]:
    """n_q about point k of a closed line, and how far the blur has drawn q inward there."""
    near = np.arange(k - REACH, k + REACH + 2) % (len(p) - 1)
    t = np.array([p[near[-1]] - p[near[0]], q[near[-1]] - q[near[0]]])
    t /= np.hypot(*t)
    away = np.stack([p[near] - p[k], q[near] - q[k]])
    across = max(abs(float(t[0])), 0.1)
    bend = abs(2 * np.polyfit(t @ away, t[0] * away[1] - t[1] * away[0], 2)[0])
    return across, float(blur**2 / 2 * bend / across)

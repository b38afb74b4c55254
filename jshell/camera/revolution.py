"""Volume, area and poles of an outline turned about its axis: where a film shows a section, as a light sheet does.

Both halves of the outline are used and averaged. A silhouette hides a dimple: its body of revolution is not the shell.

Symbols    q distance from the axis [px]   e error across the edge, alike over a width ℓ along it   R mean radius [px]
Source     Pappus' theorems: V = π ∬ |q| dA, S = π ∮ |q| ds over the whole outline
"""

from typing import NamedTuple

import numpy as np

from jshell.camera.hull import Extent
from jshell.camera.outline import Outline


class Revolved(NamedTuple):
    """A body of revolution: volume [px³], area [px²], and where the axis leaves it, upper and lower [px]."""

    volume: Extent
    area: Extent
    upper: Extent
    lower: Extent


def revolved(outline: Outline, angle: float) -> Revolved | None:
    """The body that an outline makes about the line of a direction through its middle; None where it is not closed.

    Args:
        outline: The outline.
        angle: Of the axis, from the picture's columns upward [rad].
    """
    if outline.cut:
        return None
    along = np.array([np.cos(angle), -np.sin(angle)])
    across = np.array([-along[1], along[0]])
    p, q = outline.points @ along, outline.points @ across
    step = np.hypot(np.diff(p), np.diff(q))
    # the axis goes through the middle of the area: so both halves weigh the same
    cross = p[:-1] * q[1:] - p[1:] * q[:-1]
    flat = np.sum(cross) / 2
    q = q - np.sum((q[:-1] + q[1:]) * cross) / (6 * flat)
    middle = np.abs(q[:-1] + q[1:]) / 2
    # ∬ |q| dA by Green's theorem: ∮ q|q|/2 dp, of a straight piece by Simpson's rule
    half = (q[:-1] + q[1:]) / 2
    mean = (q[:-1] * np.abs(q[:-1]) + 4 * half * np.abs(half) + q[1:] * np.abs(q[1:])) / 6
    volume = np.pi * abs(np.sum(mean * np.diff(p)) / 2)
    area = np.pi * np.sum(middle * step)
    radius = np.sqrt(abs(flat) / np.pi)
    spread = np.pi * outline.sigma * np.sqrt(outline.correlation * np.sum(middle**2 * step))
    crossings = np.nonzero(np.sign(q[:-1]) != np.sign(q[1:]))[0]
    if len(crossings) < 2:
        return None
    at = p[crossings] - q[crossings] * (p[crossings + 1] - p[crossings]) / (q[crossings + 1] - q[crossings])
    return Revolved(
        Extent(volume, spread),
        # of a sphere δS = 2 δV/R: what a dimple's own curvature changes in this error is left out
        Extent(area, 2 * spread / radius),
        Extent(float(at.max()), outline.sigma),
        Extent(float(at.min()), outline.sigma),
    )

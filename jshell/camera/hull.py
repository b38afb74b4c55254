"""Height and width of an outline: the extent of its convex hull along and across the axis.

The outermost of many noisy points lies too far out. So each of the four ends is
found by a curve through the points near it (`ends`), which noise moves either
way alike; its error follows from that of the points.

Source     Mokbel et al. 2021, section "Experiments": H and W of the convex hull
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jshell.camera.ends import end
from jshell.camera.outline import Outline


@dataclass(frozen=True)
class Extent:
    """Size of an outline in one direction.

    Attributes:
        value: [px].
        sigma: Its standard error [px].
    """

    value: float
    sigma: float


def extent(outline: Outline, angle: float) -> Extent:
    """The size of an outline's hull in a direction.

    Args:
        outline: The outline.
        angle: Of the direction, from the picture's columns upward [rad]; π/2 is upright.
    """
    along = np.array([np.cos(angle), -np.sin(angle)])  # rows count downward
    ends = [end(outline, sign * along) for sign in (1.0, -1.0)]
    return Extent(ends[0][0] + ends[1][0], float(np.hypot(ends[0][1], ends[1][1])))


def axis_of(points: Float[np.ndarray, "points 2"], within: float) -> tuple[float, float]:
    """The direction about which an outline mirrors itself best, and how much better than the worst, from 0 to 1.

    Args:
        points: The outline.
        within: How far from upright it may lie [rad].

    Returns:
        Angle from the columns upward [rad], and the contrast, near 0 for a circle, of which the angle says nothing.
    """
    middle = points.mean(axis=0)
    away = points - middle
    turn, size = np.arctan2(-away[:, 1], away[:, 0]), np.hypot(*away.T)
    order = np.argsort(turn)
    even = np.linspace(-np.pi, np.pi, 256, endpoint=False)
    radius = np.interp(even, turn[order], size[order], period=2 * np.pi)
    waves = np.fft.rfft(radius)[1:13] * np.exp(1j * np.pi * np.arange(1, 13))  # the angle begins at -π
    angles = np.pi / 2 + np.linspace(-within, within, 181)
    score = np.array([np.sum(np.real(waves**2 * np.exp(2j * np.arange(1, 13) * angle))) for angle in angles])
    power = float(np.sum(np.abs(waves) ** 2))
    best = int(np.argmax(score))
    relative = np.sqrt(power) / np.abs(np.fft.rfft(radius)[0])
    contrast = (score[best] - score.min()) / (2 * power) if power > 0 and relative > 1e-3 else 0.0
    return float(angles[best]), float(contrast)

"""Height and width of an outline: the extent of its convex hull along and across the axis.

The outermost of many noisy points lies too far out. So each of the four ends is
the vertex of a parabola through the points near it, which noise moves either
way alike; its error follows from that of the points. Blur draws the edge of a
round body inward by b²/2ρ, which is put back.

Symbols    p, q points along and across the direction of an end   D depth of the points that are fitted [px]
           ρ radius of curvature there [px]   b width of blur and smoothing, as of a Gaussian [px]
Source     Mokbel et al. 2021, section "Experiments": H and W of the convex hull
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jshell.camera.outline import Outline

DEPTH = 0.008  # D over the outline's size: the parabola's own error is then D²/2ρ
FEWEST = 7  # points at an end
# Variance of a parabola's vertex over that of a mean of the same points. Errors that go together over a width s within
# a half-length h take 0.56 s/h and 8.3 (s/h)² off, for ends and slope of the weights: their spectrum is not white.
VERTEX = 9 / 4


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
    ends = [_end(outline, sign * along) for sign in (1.0, -1.0)]
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


def _end(outline: Outline, along: Float[np.ndarray, "2"]) -> tuple[float, float]:
    """How far an outline reaches in a direction, and the error."""
    p, q = outline.points @ along, outline.points @ np.array([-along[1], along[0]])
    size = float(np.ptp(p))
    depth = float(np.clip(DEPTH * size, 0.6, 2.0))
    at, top = float(q[np.argmax(p)]), float(p.max())
    half = np.sqrt(size * depth)  # of a circle of this size
    curvature = 0.0
    for _ in range(3):
        near = (np.abs(q - at) <= half) & (p >= top - 4 * depth)
        if np.sum(near) < FEWEST:
            return top, outline.sigma
        c, b, a = np.polyfit(q[near] - at, p[near], 2)
        if c >= 0:  # a flat end: its highest points are as good as any
            return float(np.mean(p[near])), outline.sigma
        at, top, curvature = at - b / (2 * c), float(a - b**2 / (4 * c)), -2 * c
        half = float(np.clip(np.sqrt(depth / -c), 3.0, size / 3))
    width = outline.correlation / (2 * np.sqrt(np.pi)) / half
    spread = VERTEX * outline.correlation / (2 * half) * (1 - 0.56 * width - 8.3 * width**2)
    spread = float(np.clip(spread, 0.1, 1.0))
    inward = outline.blur**2 * curvature / 2
    return top + inward, outline.sigma * float(np.sqrt(spread))

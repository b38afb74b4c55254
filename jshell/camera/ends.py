"""How far an outline reaches in one direction, without the push that noise gives to an outermost point.

A round end is the top of a fourth-order curve through the points near it; where
the rim of a dimple makes it flat, a straight line that bends at two corners.
Errors along the edge go together over the width of its smoothing, and the error
of an end follows from all of theirs. Blur draws the edge of a round body inward
by b²/2ρ, which is put back.

Symbols    p, q points along and across the direction of an end   D depth of the points that are fitted [px]
           ρ radius of curvature there [px]   b width of blur and smoothing, as of a Gaussian [px]
           s width of the smoothing [px]: errors at distance d go together as exp(-d²/4s²)
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jshell.camera.outline import Outline

DEPTH = 0.02  # D over the outline's size
SHALLOW, DEEP = 1.5, 4.0  # bounds of D [px]
FEWEST = 9  # points at an end
ORDER = 4
BESIDE = 2.0  # half-lengths of a holder's gap that are fitted
LOOSE = 2.5  # mean square of what a curve leaves, over σ², that says the end has another form
BETTER = 0.7  # of that of the round one, to be taken for flat
LEANS = 4.0  # errors of a slope that is one
CORNER = 2.0  # blurs from a corner that its rounding reaches

Values = Float[np.ndarray, "points"]


class End(NamedTuple):
    """Where an outline ends, and its standard error [px]."""

    value: float
    sigma: float


class _Fit(NamedTuple):
    """A curve through an end: what it leaves, and where it ends."""

    left: float  # mean square [px²]
    end: End


def end(outline: Outline, along: Float[np.ndarray, "2"]) -> End:
    """How far an outline reaches in a direction.

    Args:
        outline: The outline.
        along: The direction, of length 1.
    """
    across = np.array([-along[1], along[0]])
    p, q = outline.points @ along, outline.points @ across
    highest = float(p.max())
    if outline.own is not None:
        p, q = p[outline.own], q[outline.own]
    if len(p) < FEWEST:
        return End(highest, outline.sigma)
    size = float(np.ptp(p))
    depth = float(np.clip(DEPTH * size, SHALLOW, DEEP))
    near = p >= p.max() - depth
    reached = float(q[near].max() + q[near].min()) / 2
    gap = _gap(q[near])
    if gap > 0:  # a holder's: what is beside it must say where the end would be
        half = max(float(np.ptp(q[near])) / 2, BESIDE * gap / 2)
        near = (np.abs(q - reached) <= half) & (p >= p.max() - size / 4)
    if np.sum(near) < FEWEST:
        return End(highest, outline.sigma)
    p, q = p[near], q[near] - reached
    order = np.argsort(q)
    p, q = p[order], q[order]
    found = _round(outline, p, q)
    if found is None or found.left > LOOSE * outline.sigma**2:
        flat = _flat(outline, p, q)
        if flat is not None and (found is None or flat.left < BETTER * found.left):
            found = flat
    if found is None or abs(found.end.value - highest) > depth + gap / 4:  # no end: the picture's border, a corner
        return End(highest, outline.sigma)
    # what neither form describes is an error as well
    allowed = LOOSE * outline.sigma**2
    worse = max(1.0, found.left / allowed) if allowed > 0 else 1.0  # a picture drawn without noise has none
    return End(found.end.value, found.end.sigma * float(np.sqrt(worse)))


def _gap(q: Values) -> float:
    """The widest part of an end without points of its own, where it is wider than the picture's pixels [px]."""
    widest = float(np.max(np.diff(np.sort(q)), initial=0.0))
    return widest if widest > 3 else 0.0


def _error(outline: Outline, weights: Values, p: Values, q: Values) -> float:
    """Error of a weighted sum of points, whose own go together."""
    smoothing = outline.correlation / (2 * np.sqrt(np.pi))
    apart = (p[:, None] - p) ** 2 + (q[:, None] - q) ** 2
    return outline.sigma * float(np.sqrt(max(weights @ np.exp(-apart / (4 * smoothing**2)) @ weights, 0.0)))


def _round(outline: Outline, p: Values, q: Values) -> _Fit | None:
    """The top of a fourth-order curve; None where it has none among the points."""
    half = float(np.abs(q).max())
    u = q / half
    powers = np.vander(u, ORDER + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    coefficients = inverse @ p
    curve = np.polynomial.Polynomial(coefficients)
    slope, bend = curve.deriv(1), curve.deriv(2)
    at = float(u[np.argmax(curve(u))])
    for _ in range(20):
        if bend(at) >= 0:
            return None
        step = float(slope(at) / bend(at))
        at -= step
        if abs(step) < 1e-9:
            break
    if not u[0] < at < u[-1]:
        return None
    left = float(np.mean((p - powers @ coefficients) ** 2))
    inward = -(outline.blur**2) * float(bend(at)) / half**2 / 2
    weights = at ** np.arange(ORDER + 1) @ inverse
    return _Fit(left, End(float(curve(at)) + inward, _error(outline, weights, p, q)))


def _flat(outline: Outline, p: Values, q: Values) -> _Fit | None:
    """The higher end of a straight line between two corners, beyond which parabolas fall; None where it is short."""
    high = q[p >= p.max() - 0.25]
    corners = np.array([high[0], high[-1]])
    left = np.inf
    for _ in range(8):  # Gauss and Newton, in the corners' places
        outside = np.stack([np.clip(corners[0] - q, 0, None), np.clip(q - corners[1], 0, None)], axis=1)
        basis = np.c_[np.ones(len(q)), q, -(outside**2)]
        found = np.linalg.lstsq(basis, p, rcond=None)[0]
        rest = p - basis @ found
        left = float(np.mean(rest**2))
        moved = np.c_[basis, -2 * found[2] * outside[:, 0], 2 * found[3] * outside[:, 1]]
        step = np.linalg.lstsq(moved, rest, rcond=None)[0][-2:]
        corners = np.clip(corners + np.clip(step, -5, 5), q[0], q[-1])
        if np.abs(step).max() < 0.01:
            break
    inner = CORNER * outline.blur
    middle = (q > corners[0] + inner) & (q < corners[1] - inner)
    if np.sum(middle) < FEWEST or found[2] <= 0 or found[3] <= 0:
        return None
    line = np.c_[np.ones(np.sum(middle)), q[middle]]
    inverse = np.linalg.pinv(line)
    slope = float(inverse[1] @ p[middle])
    weights = np.full(len(line), 1 / len(line))
    if abs(slope) > LEANS * _error(outline, inverse[1], p[middle], q[middle]):
        weights = np.array([1.0, corners[1] if slope > 0 else corners[0]]) @ inverse
    return _Fit(left, End(float(weights @ p[middle]), _error(outline, weights, p[middle], q[middle])))

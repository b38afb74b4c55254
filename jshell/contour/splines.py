"""Quintic splines on the meridian that know the poles.

A smooth closed surface of revolution has x(θ) even and r(θ) odd about both
poles. The meridian's breakpoints are therefore reflected there, and each
B-spline is added to (or subtracted from) its mirror image: smoothness at the
poles is exact, and every curvature stays finite.

A breakpoint may be repeated: four times, and only position and slope remain
continuous there, which is what the edge of a held pad needs.

Which B-spline lives on which element is fixed by the number of elements alone;
the breakpoints enter through the recursion only. They may be NumPy numbers or
values traced by JAX, so that a compiled program can move them.

Symbols    u position within an element, -1 to 1
Source     de Boor, A Practical Guide to Splines; parity as in any polar expansion
"""

from functools import lru_cache
from math import comb, perm
from typing import Literal, NamedTuple

import jax
import numpy as np

DEGREE = 5
ORDER = DEGREE + 1  # B-splines that are not zero on an element; also coefficients of a polynomial piece

Numbers = np.ndarray | jax.Array
Parity = Literal["even", "odd"]


class ParitySplines:
    """Even or odd splines of degree 5 on [0, π].

    Args:
        breaks: (elements + 1,) increasing, from 0 to π; at least eight elements.
        parity: `even` for x and the potential, `odd` for r.
        edge: Index of a breakpoint where only value and slope are continuous, or None.
        local: `local_splines(breaks, edge)`, where both parities share it.
    """

    def __init__(self, breaks: Numbers, parity: Parity, edge: int | None = None, local: Numbers | None = None) -> None:
        xp = breaks.__array_namespace__()
        self.breaks, self.parity = breaks, parity
        self._plan = _plan(len(breaks) - 1, parity, edge)
        self._half = (breaks[1:] - breaks[:-1]) / 2
        self._middle = (breaks[1:] + breaks[:-1]) / 2
        self.pieces = xp.matmul(local_splines(breaks, edge) if local is None else local, xp.asarray(self._plan.columns))

    @property
    def size(self) -> int:
        return self._plan.columns.shape[2]

    def within(self, u: np.ndarray, derivative: int = 0) -> Numbers:
        """(elements, len(u), size) values or derivatives at the same places in every element."""
        xp = self.breaks.__array_namespace__()
        return xp.matmul(xp.asarray(_powers(u, derivative)), self.pieces) / self._half[:, None, None] ** derivative

    def at_breaks(self) -> Numbers:
        """(elements + 1, size) values at the breakpoints."""
        xp = self.breaks.__array_namespace__()
        ends = self.within(np.array([-1.0, 1.0]))
        return xp.concat([ends[:, 0], ends[-1:, 1]])

    def __call__(self, angles: Numbers, derivative: int = 0) -> Numbers:
        """(…, size) values of every basis function, or of its derivative, at any angles."""
        xp = self.breaks.__array_namespace__()
        angles = xp.asarray(angles)
        element = xp.clip(xp.searchsorted(self.breaks, angles, side="right") - 1, 0, len(self.breaks) - 2)
        u = (angles - self._middle[element]) / self._half[element]
        factors = [float(perm(k, derivative)) * u ** max(k - derivative, 0) for k in range(ORDER)]
        values = xp.matmul(xp.stack(factors, axis=-1)[..., None, :], self.pieces[element])[..., 0, :]
        return values / self._half[element][..., None] ** derivative

    def beyond(self, element: int) -> np.ndarray:
        """(size,) whether a basis function lives on an element or on any after it."""
        return np.any(self._plan.columns[element:] != 0, axis=(0, 1))

    def taylor(self, side: int) -> Numbers:
        """(elements, coefficients, size) Taylor coefficients in u about the left (+1) or right (-1) element end."""
        xp = self.breaks.__array_namespace__()
        k = range(ORDER)
        move = np.array([[comb(i, j) * float(-side) ** (i - j) if i >= j else 0.0 for i in k] for j in k])
        return xp.matmul(xp.asarray(move), self.pieces)


def local_splines(breaks: Numbers, edge: int | None = None) -> Numbers:
    """(elements, coefficients, ORDER) the B-splines of each element as polynomials in u, by de Boor's recursion."""
    xp = breaks.__array_namespace__()
    plan = _plan(len(breaks) - 1, "even", edge)
    inside = breaks[plan.source]
    knots = xp.concat([-inside[ORDER:0:-1], inside, 2 * np.pi - inside[-2 : -ORDER - 2 : -1]])
    middle = ((breaks[1:] + breaks[:-1]) / 2)[:, None, None]
    half = ((breaks[1:] - breaks[:-1]) / 2)[:, None, None]
    zero = xp.zeros((len(plan.spans), 1, 1))
    splines = xp.concat([zero + 1, *[zero] * DEGREE], axis=1)
    for degree in range(1, ORDER):
        first = plan.spans[:, None] - degree + 1 + np.arange(degree)[None]
        a, b = knots[first][:, None], knots[first + degree][:, None]
        times_u = half * xp.concat([xp.zeros_like(splines[:, :1]), splines[:, :-1]], axis=1)
        rising = ((middle - a) * splines + times_u) / (b - a)
        falling = ((b - middle) * splines - times_u) / (b - a)
        none = xp.zeros_like(rising[:, :, :1])
        splines = xp.concat([none, rising], axis=2) + xp.concat([falling, none], axis=2)
    return splines


def _powers(u: np.ndarray, derivative: int) -> np.ndarray:
    """(len(u), coefficients) derivatives of u^k with respect to u."""
    return np.stack([perm(k, derivative) * u ** max(k - derivative, 0) for k in range(ORDER)], axis=1)


class _Plan(NamedTuple):
    """What the number of elements, the parity and the edge fix.

    source: the breakpoint behind every knot in [0, π]. spans: the knot at the left end of every element.
    columns: (elements, ORDER, size) which basis functions the B-splines of an element belong to, with sign.
    """

    source: np.ndarray
    spans: np.ndarray
    columns: np.ndarray


@lru_cache(maxsize=64)
def _plan(elements: int, parity: str, edge: int | None) -> _Plan:
    times = np.ones(elements + 1, dtype=int)
    if edge is not None:
        times[edge] = DEGREE - 1
    source = np.repeat(np.arange(elements + 1), times)
    spans = ORDER + np.cumsum(times)[:-1] - 1
    # even spacing serves to find mirror images: they do not depend on the spacing
    inside = source * np.pi / elements
    knots = np.concatenate([-inside[ORDER:0:-1], inside, 2 * np.pi - inside[-2 : -ORDER - 2 : -1]])
    fold = _fold(knots, len(knots) - ORDER, parity)
    return _Plan(source, spans, fold[spans[:, None] + np.arange(-DEGREE, 1)])


def _fold(knots: np.ndarray, count: int, parity: str) -> np.ndarray:
    """Matrix that adds every B-spline to its mirror images at both poles."""
    sign = 1.0 if parity == "even" else -1.0
    starts, stops = knots[:count], knots[DEGREE + 1 : DEGREE + 1 + count]
    centres = np.array([knots[j : j + DEGREE + 2].mean() for j in range(count)])
    touches = (stops > 1e-12) & (starts < np.pi - 1e-12)
    columns = []
    for j in map(int, np.flatnonzero(touches & (centres > -1e-9) & (centres < np.pi + 1e-9))):
        column = np.zeros(count)
        column[j] += 1.0
        for pole in (0.0, np.pi):
            mirror = _mirror(knots, count, j, pole)
            if mirror is not None and mirror != j:
                column[mirror] += sign
            elif mirror == j and sign < 0:
                column[j] = 0.0
        if np.any(column):
            columns.append(column)
    return np.stack(columns, axis=1)


def _mirror(knots: np.ndarray, count: int, j: int, pole: float) -> int | None:
    """Index of the reflection of B-spline j about a pole, if it lies in the knot range."""
    wanted = (2 * pole - knots[j : j + DEGREE + 2])[::-1]
    for k in range(count):
        if np.allclose(knots[k : k + DEGREE + 2], wanted, rtol=0, atol=1e-9):
            return k
    return None

"""Quintic splines on the meridian that know the poles.

A smooth closed surface of revolution has x(θ) even and r(θ) odd about both
poles. The meridian's breakpoints are therefore reflected there, and each
B-spline is added to (or subtracted from) its mirror image: smoothness at the
poles is exact, and every curvature stays finite.

A breakpoint may be repeated: four times, and only position and slope remain
continuous there, which is what the edge of a held pad needs.

Source     de Boor, A Practical Guide to Splines; parity as in any polar expansion
"""

from math import comb, factorial
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline

DEGREE = 5


class ParitySplines:
    """Even or odd splines of degree 5 on [0, π].

    Args:
        breaks: (elements + 1,) increasing, from 0 to π; at least eight elements.
        parity: `even` for x and the potential, `odd` for r.
        edge: Index of a breakpoint where only value and slope are continuous, or None.
    """

    def __init__(self, breaks: np.ndarray, parity: Literal["even", "odd"], edge: int | None = None) -> None:
        self.breaks = np.asarray(breaks, dtype=float)
        times = np.ones(len(breaks), dtype=int)
        if edge is not None:
            times[edge] = DEGREE - 1
        inside = np.repeat(self.breaks, times)
        reach = DEGREE + 1
        left = -inside[1 : reach + 1][::-1]
        right = 2 * np.pi - inside[-reach - 1 : -1][::-1]
        knots = np.concatenate([left, inside, right])
        count = len(knots) - DEGREE - 1
        self._spline = BSpline(knots, np.eye(count), DEGREE)
        self._fold = _fold(knots, count, parity)

    @property
    def size(self) -> int:
        return self._fold.shape[1]

    def __call__(self, angles: np.ndarray, derivative: int = 0) -> np.ndarray:
        """(…, size) values of every basis function, or of its derivative."""
        return self._spline(np.asarray(angles), derivative) @ self._fold

    def touching(self, low: float) -> np.ndarray:
        """(size,) whether a basis function is non-zero anywhere beyond an angle."""
        probe = self.breaks[:-1] + 0.5 * np.diff(self.breaks)
        return np.any(np.abs(self(probe[probe > low])) > 1e-14, axis=0)

    def taylor(self, node: int, side: int) -> np.ndarray:
        """(DEGREE + 1, size) one-sided Taylor coefficients at a breakpoint, exact for the polynomial piece."""
        element = node if side > 0 else node - 1
        middle = 0.5 * (self.breaks[element] + self.breaks[element + 1])
        centre = np.stack([self(np.array(middle), k) / factorial(k) for k in range(DEGREE + 1)])
        shift = self.breaks[node] - middle
        move = np.array([[comb(k, j) * shift ** (k - j) if k >= j else 0.0 for k in range(6)] for j in range(6)])
        return move @ centre


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

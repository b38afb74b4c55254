"""Profile likelihood of an inversion: intervals that need not be symmetric.

One unknown is held while the others seek their minimum anew, on the nodes of the answer and with its noise; the
interval ends where χ² has grown by what Student's factor allows.

Symbols    Δχ² growth above the minimum   s² variance of the weighted residual
Source     as `jshell.calibration.profile`
"""

from collections.abc import Sequence

import numpy as np
import scipy.special

from jshell.calibration.profile import Interval, Profile
from jshell.errors import BadValue, Outcome
from jshell.inversion.model import Model, Weighing
from jshell.inversion.search import SearchResult, prior_rows, projections_at, solve

MOST = 8  # points on each side
CLOSE = 0.02  # relative, of the distance sqrt(Δχ²/s²) at which an end is taken as found
FARTHEST = 6.0  # times the distance that the covariance says


def profile(
    model: Model,
    best: SearchResult,
    weighings: Sequence[Weighing],
    names: Sequence[str],
    *,
    level: float,
    freedom: float,
    scale: float,
    stderr: np.ndarray,
) -> Profile:
    """Intervals by profile likelihood.

    Args:
        model, best, weighings: Of the inversion.
        names: Of the unknowns.
        level: Of confidence.
        freedom, scale: Degrees of freedom, and variance of the weighted residual.
        stderr: (unknowns,) of what the solver sees.
    """
    if not 0 < level < 1:
        raise BadValue("level", found=f"{level:g}", expected="between 0 and 1", remedy="0.95 is usual.")
    far = float(scipy.special.stdtrit(freedom, (1 + level) / 2))
    shown = lambda i, at: float(model.parameters.to_values(np.where(np.arange(best.u.size) == i, at, best.u))[i])  # noqa: E731
    intervals, points = [], []
    for name in names:
        i = model.parameters.names.index(name)
        (low, below, left), (high, above, right) = (
            _end(model, best, weighings, i, side, far, scale, stderr) for side in (-1, 1)
        )
        value = shown(i, best.u[i])
        error = float(stderr[i]) * (value if model.parameters.logarithmic[i] else 1.0)
        words = [f"{side}: {text}" for side, text in (("below", below), ("above", above)) if text]
        intervals.append(Interval(name, value, shown(i, low), shown(i, high), "; ".join(words), error))
        points.append(np.array(sorted((shown(i, at), growth) for at, growth in [(best.u[i], 0.0), *left, *right])))
    criterion = f"Δχ²/s² = {far**2:.4g}, F with 1 and {freedom:g} degrees of freedom, s² = {scale:.4g}"
    return Profile(tuple(intervals), level, criterion, far**2, tuple(points))


def _end(model, best, weighings, i, side, far, scale, stderr) -> tuple[float, str, list]:
    """Where χ² of one unknown has grown by far² on one side, or why nowhere; and the points looked at."""
    low, high = model.parameters.to_u(model.parameters.low)[i], model.parameters.to_u(model.parameters.high)[i]
    step, inner, outer = far * stderr[i], (0.0, 0.0), None
    u, points = best.u, []
    for _ in range(MOST):
        at = best.u[i] + side * step
        if not low < at < high:
            return np.nan, "it reaches its bound", points
        u, cost = _held(model, best, weighings, i, at, u)
        grown = np.sqrt(max(cost - best.cost, 0.0) / scale)
        if not np.isfinite(cost):
            return np.nan, "the simulator finds no shell there", points
        points.append((at, grown**2))
        if abs(grown / far - 1) < CLOSE:
            return at, "", points
        if grown < far:
            inner = (step, grown)
        else:
            outer = (step, grown)
        if outer is None:
            step = step * min(max(far / max(grown, 1e-3), 1.1), 2.0)
            if step > FARTHEST * far * stderr[i]:
                return np.nan, "χ² does not grow enough", points
        else:
            share = (far - inner[1]) / (outer[1] - inner[1])
            step = inner[0] + np.clip(share, 0.05, 0.95) * (outer[0] - inner[0])
    return best.u[i] + side * step, "", points


def _held(model: Model, best: SearchResult, weighings, i: int, at: float, u: np.ndarray) -> tuple[np.ndarray, float]:
    """The minimum with one unknown held, from the unknowns of the point before."""
    low, high = model.parameters.to_u(model.parameters.low).copy(), model.parameters.to_u(model.parameters.high).copy()
    low[i] = high[i] = at
    # along the valley that the covariance knows
    J = np.concatenate([one.jacobian for one in best.projections] + [prior_rows(model, best.u)[1]])
    others = np.arange(u.size) != i
    start = best.u.copy()
    start[i] = at
    if others.any():
        start[others] -= np.linalg.lstsq(J[:, others], J[:, i], rcond=1e-10)[0] * (at - best.u[i])
    start = np.clip(start, low, high)
    found = solve(model, best.near, weighings, start, (low, high), max_steps=8, tolerances=(1e-5, 1e-6))
    v = np.asarray(found.unknowns)
    projections, outcome = projections_at(model, v, best.near, weighings)
    if outcome != Outcome.OK:
        return v, np.inf
    return v, float(sum(one.residual @ one.residual for one in projections) + np.sum(prior_rows(model, v)[0] ** 2))

"""Profile likelihood of an inversion: intervals that need not be symmetric.

One unknown is held while the others seek their minimum anew, on the nodes of the answer and with its noise; the
interval ends where χ² has grown by what Student's factor allows.

Symbols    Δχ² growth above the minimum   s² variance of the weighted residual
Source     as `jshell.calibration.profile`
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.special

from jshell.errors import BadValue, Outcome, choose
from jshell.inversion.model import Model, Weighing
from jshell.inversion.search import Ending, lefts_at, prior_rows, solve

MOST = 8  # points on each side
CLOSE = 0.02  # relative, of the distance sqrt(Δχ²/s²) at which an end is taken as found
FARTHEST = 6.0  # times the distance that the covariance says


@dataclass(frozen=True)
class Interval:
    """Where one unknown may lie; an end is NaN, with the reason, where χ² does not grow enough."""

    name: str
    value: float
    low: float
    high: float
    reason: str = ""


@dataclass(frozen=True)
class Profile:
    """Intervals of the unknowns at a level of confidence."""

    intervals: tuple[Interval, ...]
    level: float

    def __getitem__(self, name: str) -> Interval:
        known = {one.name: one for one in self.intervals}
        return known[choose("parameter", name, known)]

    def record(self) -> dict:
        """The intervals as a JSON object."""
        finite = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        rows = {
            one.name: {"low": finite(one.low), "high": finite(one.high), "reason": one.reason} for one in self.intervals
        }
        return {"level": self.level, "intervals": rows}

    def report(self) -> str:
        """The intervals as text."""
        lines = [f"[[Profile likelihood, {100 * self.level:g}%]]"]
        for one in self.intervals:
            why = f" ({one.reason})" if one.reason else ""
            lines.append(f"    {one.name}: {one.low:.6g} to {one.high:.6g}{why}")
        return "\n".join(lines)


def profile(
    model: Model,
    best: Ending,
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
    found = []
    for name in names:
        i = model.space.names.index(name)
        ends, reasons = [], []
        for side in (-1, 1):
            end, reason = _end(model, best, weighings, i, side, far, scale, stderr)
            ends.append(end)
            reasons.append(reason)
        low, high = (float(model.space.to_values(np.where(np.arange(best.u.size) == i, e, best.u))[i]) for e in ends)
        value = float(model.space.to_values(best.u)[i])
        found.append(Interval(name, value, low, high, "; ".join(r for r in reasons if r)))
    return Profile(tuple(found), level)


def _end(model, best, weighings, i, side, far, scale, stderr) -> tuple[float, str]:
    """Where χ² of one unknown has grown by far² on one side."""
    low, high = model.space.to_u(model.space.low)[i], model.space.to_u(model.space.high)[i]
    step, inner, outer = far * stderr[i], (0.0, 0.0), None
    u = best.u
    for _ in range(MOST):
        at = best.u[i] + side * step
        if not low < at < high:
            return np.nan, "it reaches its bound"
        u, cost = _held(model, best, weighings, i, at, u)
        grown = np.sqrt(max(cost - best.cost, 0.0) / scale)
        if not np.isfinite(cost):
            return np.nan, "the simulator finds no shell there"
        if abs(grown / far - 1) < CLOSE:
            return at, ""
        if grown < far:
            inner = (step, grown)
        else:
            outer = (step, grown)
        if outer is None:
            step = step * min(max(far / max(grown, 1e-3), 1.1), 2.0)
            if step > FARTHEST * far * stderr[i]:
                return np.nan, "χ² does not grow enough"
        else:
            share = (far - inner[1]) / (outer[1] - inner[1])
            step = inner[0] + np.clip(share, 0.05, 0.95) * (outer[0] - inner[0])
    return best.u[i] + side * step, ""


def _held(model: Model, best: Ending, weighings, i: int, at: float, u: np.ndarray) -> tuple[np.ndarray, float]:
    """The minimum with one unknown held, from the unknowns of the point before."""
    low, high = model.space.to_u(model.space.low).copy(), model.space.to_u(model.space.high).copy()
    low[i] = high[i] = at
    # along the valley that the covariance knows
    J = np.concatenate([one.jacobian for one in best.lefts] + [prior_rows(model, best.u)[1]])
    others = np.arange(u.size) != i
    start = best.u.copy()
    start[i] = at
    if others.any():
        start[others] -= np.linalg.lstsq(J[:, others], J[:, i], rcond=1e-10)[0] * (at - best.u[i])
    start = np.clip(start, low, high)
    found = solve(model, best.near, weighings, start, (low, high), max_steps=8, tolerances=(1e-5, 1e-6))
    v = np.asarray(found.unknowns)
    lefts, outcome = lefts_at(model, v, best.near, weighings)
    if outcome != Outcome.OK:
        return v, np.inf
    return v, float(sum(one.residual @ one.residual for one in lefts) + np.sum(prior_rows(model, v)[0] ** 2))

"""Profile likelihood: intervals that need not be symmetric.

One parameter is held while the others seek their minimum anew; its interval
ends where χ² has grown by what the criterion allows. The covariance assumes a
parabola, the profile looks.

Symbols    Δχ² growth above the minimum   s² variance of the weighted residual   N-k degrees of freedom
Source     criterion χ²: Δχ² = s² χ²₁(level), as MINOS has it; criterion F: Δχ² = s² F₁,N-k(level), as lmfit's
           conf_interval has it. Scaled errors take F by default, absolute ones χ².
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.special

from jshell.calibration.objective import Objective
from jshell.calibration.rebuilt import objective_of
from jshell.calibration.result import Fit
from jshell.errors import BadValue, Outcome, choose

CRITERIA = ("auto", "chi2", "F")
MOST_STEPS = 40
ROOT = 1e-7  # of the distance sqrt(Δχ²/s²) at which an end is taken as found
FARTHEST = 50.0  # standard errors at which an open side is given up


@dataclass(frozen=True)
class Interval:
    """Where one parameter may lie.

    Attributes:
        name: Of the parameter.
        value: At the minimum.
        low, high: Ends of the interval; NaN where it is open.
        reason: Why an end is missing.
        stderr: Standard error of the covariance, for comparison.
    """

    name: str
    value: float
    low: float
    high: float
    reason: str
    stderr: float

    def words(self) -> str:
        """One line of a report."""
        end = lambda x, sign: f"{sign}{abs(x - self.value):.4g}" if np.isfinite(x) else f"{sign}open"  # noqa: E731
        tail = f" ({self.reason})" if self.reason else ""
        return f"{self.name}: {self.value:.6g} {end(self.high, '+')} {end(self.low, '−')}{tail}"


@dataclass(frozen=True)
class Profile:
    """Intervals of several parameters, and the points that were looked at.

    Attributes:
        intervals: One per parameter.
        level: Of confidence.
        criterion: In words.
        growth: Of Δχ²/s² at which an interval ends.
        points: Per parameter, (points, 2): its value, and Δχ²/s² there, by value.
    """

    intervals: tuple[Interval, ...]
    level: float | int
    criterion: str
    growth: float
    points: tuple[np.ndarray, ...]

    def __getitem__(self, name: str) -> Interval:
        known = {one.name: one for one in self.intervals}
        return known[choose("parameter", name, known, remedy="Ask for its profile.")]

    def report(self) -> str:
        """The intervals as text."""
        head = f"[[Profile likelihood, {100 * self.level:g}%]] {self.criterion}"
        return "\n".join([head, *(f"    {one.words()}" for one in self.intervals)])

    def record(self) -> dict:
        """The intervals as a JSON object; open ends are null."""
        number = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        return {
            "level": self.level,
            "criterion": self.criterion,
            "intervals": {
                one.name: {"value": one.value, "low": number(one.low), "high": number(one.high), "reason": one.reason}
                for one in self.intervals
            },
        }

    @staticmethod
    def from_record(record: Mapping[str, Any]) -> "Profile":
        """What `record` said, to be read again: without the errors, the growth and the points, which it leaves out."""
        number = lambda x: np.nan if x is None else x  # noqa: E731
        intervals = tuple(
            Interval(name, one["value"], number(one["low"]), number(one["high"]), one["reason"], np.nan)
            for name, one in record["intervals"].items()
        )
        return Profile(intervals, record["level"], record["criterion"], np.nan, ())


def profile(
    result: Fit, names: Sequence[str] | None = None, *, level: float | int = 0.95, criterion: str = "auto"
) -> Profile:
    """Intervals by profile likelihood.

    Args:
        result: Of a fit, fresh or read from a file.
        names: Parameters; None takes all that were varied.
        level: Of confidence.
        criterion: `chi2`, `F`, or `auto`: F where errors are scaled, χ² where σ was given.

    Raises:
        BadName: No such criterion, or a parameter that was not varied.
        BadValue: A level outside 0 to 1; a robust fit, which has no likelihood.
    """
    objective = objective_of(result)
    choose("criterion", criterion, CRITERIA)
    if not 0 < level < 1:
        raise BadValue("level", found=f"{level:g}", expected="between 0 and 1", remedy="Write 0.95 for 95%.")
    if objective.loss:
        raise BadValue("profile", found="a robust fit", expected="least squares", remedy="Use bootstrap instead.")
    chosen = tuple(objective.names if names is None else names)
    for name in chosen:
        choose("parameter", name, objective.names, noun="varied parameter")
    kind = ("chi2" if objective.absolute else "F") if criterion == "auto" else criterion
    variance, freedom = objective.variance, objective.freedom
    if kind == "F":
        growth = float(scipy.special.fdtri(1, freedom, level))
        words = f"Δχ²/s² = {growth:.4g}, F with 1 and {freedom} degrees of freedom"
    else:
        growth = float(scipy.special.chdtri(1, 1 - level))
        words = f"Δχ²/s² = {growth:.4g}, χ² with 1 degree of freedom"
    words += ", errors given" if objective.absolute else f", s² = {variance:.4g} from the residual"
    walker = Walker(objective, variance, float(np.sqrt(growth)))
    found = [walker.interval(name) for name in chosen]
    return Profile(tuple(one for one, _ in found), level, words, growth, tuple(points for _, points in found))


class Walker:
    """Walks away from a minimum along one parameter at a time."""

    def __init__(self, objective: Objective, variance: float, distance: float) -> None:
        self.objective = objective
        self.variance = max(variance, 1e-300)
        self.distance = distance
        self.best = objective.best
        r, J = objective.linearised
        self.cost = float(r @ r)
        scale = np.linalg.norm(J, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        inverse = np.linalg.pinv((J / scale).T @ (J / scale), rcond=1e-14)
        self.covariance = inverse / np.outer(scale, scale) * self.variance

    def away(self, i: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray, bool]:
        """sqrt(Δχ²/s²) with one unknown held, the minimum there, and whether it was found."""
        low, high = np.array(self.objective.parameters.low), np.array(self.objective.parameters.high)
        low[i] = high[i] = value
        solution = self.objective.minimise(start[None], low, high)
        cost, ended = float(solution.cost[0]), Outcome(int(solution.outcome[0]))
        found = ended in (Outcome.OK, Outcome.AT_BOUND) and np.isfinite(cost)
        return float(np.sqrt(max(cost - self.cost, 0.0) / self.variance)), np.asarray(solution.unknowns[0]), bool(found)

    def interval(self, name: str) -> tuple[Interval, np.ndarray]:
        """Both ends, and the points looked at."""
        i = self.objective.names.index(name)
        error = float(np.sqrt(max(self.covariance[i, i], 0.0)))
        value = float(self.objective.shown(self.best)[i])
        ends, reasons, points = [], [], [(self.best[i], 0.0)]
        for side in (-1, 1):
            end, reason = self._end(i, side, error, points)
            ends.append(end)
            reasons.append(reason)

        def shown(u: float) -> float:
            moved = self.best.copy()
            moved[i] = u
            return float(self.objective.shown(moved)[i]) if np.isfinite(u) else np.nan

        if name in self.objective.parameters.negative:  # the solver sees the square, which grows the other way
            ends, reasons = ends[::-1], reasons[::-1]
        low, high = shown(ends[0]), shown(ends[1])
        rows = np.array(sorted((shown(u), d**2) for u, d in points if np.isfinite(u)))
        step = 1e-6 * max(error, 1e-300)
        slope = (shown(self.best[i] + step) - value) / step
        words = [f"{side}: {text}" for side, text in zip(("below", "above"), reasons, strict=True) if text]
        return Interval(name, value, low, high, "; ".join(words), abs(slope) * error), rows

    def _end(self, i: int, side: int, error: float, points: list) -> tuple[float, str]:
        """Where the distance is reached, as the solver sees it."""
        if not (np.isfinite(error) and error > 0):
            return np.nan, "the data do not depend on it"
        limit = float((self.objective.parameters.low if side < 0 else self.objective.parameters.high)[i])
        inner, outer = (0.0, 0.0), None  # steps from the minimum in standard errors, and sqrt(Δχ²/s²)
        start, step = self.best, self.distance
        for _ in range(MOST_STEPS):
            at = self.best[i] + side * step * error
            if side * (at - limit) >= 0:
                at, step = limit, abs(limit - self.best[i]) / error
            far, there, found = self.away(i, at, start)
            if not found:
                return np.nan, "the other parameters find no minimum on the way"
            points.append((at, far))
            if abs(far / self.distance - 1) < ROOT:
                return at, ""
            if far < self.distance:
                if at == limit:
                    return np.nan, f"it reaches its bound at Δχ²/s² = {far**2:.3g}"
                inner, start = (step, far), there
            else:
                outer = (step, far)
            if outer is None:
                step = min(max(step * self.distance / max(far, 1e-3 * self.distance), 1.2 * step), 3 * step)
                if step > FARTHEST * self.distance:
                    return np.nan, f"Δχ²/s² is {far**2:.3g} still at {FARTHEST:g} standard errors"
            else:
                share = (self.distance - inner[1]) / max(outer[1] - inner[1], 1e-300)
                share = min(max(share, 0.02), 0.98)
                step = inner[0] + share * (outer[0] - inner[0])
                if outer[0] - inner[0] < 1e-9 * outer[0]:
                    return at, ""
        return np.nan, "the end was not found"

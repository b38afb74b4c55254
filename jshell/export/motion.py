"""The law run as another code would: the volume's one equation, from its tables, with buckling and unbuckling.

Tables are read by cubic splines; the state changes where a volume is crossed, and volume and rate carry over.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.integrate
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from jshell.errors import BadShape, NotOk, Outcome
from jshell.export.law import LawBranch, RadialLaw

MOST_SWITCHES = 1000

Values = Float[np.ndarray, "times"]


class RadialMotion(NamedTuple):
    """A motion of the volume: its rate [m³/s], whether buckled, and when it changed state [s]."""

    times: Values
    volume: Values
    rate: Values
    buckled: Values
    switches: tuple[float, ...]


class _Equation:
    """One branch as a right-hand side."""

    def __init__(self, branch: LawBranch, outer: Callable[[float], float]) -> None:
        self.pressure, self.damping = (CubicSpline(branch.volume, part) for part in (branch.pressure, branch.damping))
        self.mass = CubicSpline(branch.volume, branch.mass)
        self.slope, self.outer = self.mass.derivative(), outer

    def __call__(self, t: float, y: np.ndarray) -> list[float]:
        V, rate = y
        force = self.pressure(V) - self.outer(t) - self.damping(V) * rate - self.slope(V) * rate**2 / 2
        return [rate, float(force / self.mass(V))]


def run(
    law: RadialLaw,
    outer: Callable[[float], float],
    times: ArrayLike,
    *,
    volume: float | None = None,
    rate: float = 0.0,
    buckled: bool = True,
    rtol: float = 1e-9,
) -> RadialMotion:
    """The motion of a law under an outer pressure.

    Args:
        law: From `radial_law` or `read_law`.
        outer: Outer pressure as a function of time [s] to [Pa].
        times: Ascending [s].
        volume, rate: At the first time [m³], [m³/s]; None is the buckled rest state.
        buckled: Whether it begins on the buckled branch.
        rtol: Of the solver.

    Raises:
        BadShape: Times that are no line of two or more.
        NotOk: A volume outside the tables, or a solver that gave up.
    """
    times = np.asarray(times, float)
    if times.ndim != 1 or len(times) < 2:
        raise BadShape("times", found=str(times.shape), expected="two times or more", remedy="Give a line of times.")
    found = np.full((3, len(times)), np.nan)
    y, now = np.array([law.rest_volume if volume is None else volume, rate]), float(times[0])
    switches: list[float] = []
    while True:
        branch = law.buckled if buckled else law.sphere
        limit, up = (law.unbuckling_volume, 1) if buckled else (law.buckling_volume, -1)
        ends = [_crossing(limit, up), _crossing(branch.volume[0], -1), _crossing(branch.volume[-1] * (1 + 1e-9), 1)]
        mine = times >= now
        part = scipy.integrate.solve_ivp(
            _Equation(branch, outer), (now, times[-1]), y, "DOP853", times[mine], events=ends, rtol=rtol,
            atol=rtol * 1e-3 * np.array([law.rest_volume, law.rest_volume / max(times[-1] - times[0], 1e-300)]),
        )  # fmt: skip
        here = np.flatnonzero(mine)[: len(part.t)]
        if len(here):  # a state may begin and end between two times
            found[:2, here], found[2, here] = part.y, float(buckled)
        if part.status == 0:
            return RadialMotion(times, found[0], found[1], found[2], tuple(switches))
        if part.status < 0 or not len(part.t_events[0]) or len(switches) == MOST_SWITCHES:
            raise NotOk("outer, times", Outcome.OUT_OF_RANGE if part.status > 0 else Outcome.NOT_CONVERGED)
        now, y, buckled = float(part.t_events[0][0]), part.y_events[0][0], not buckled
        switches.append(now)


def _crossing(volume: float, direction: int) -> Callable[[float, np.ndarray], float]:
    """An end where the volume passes a value in one direction."""

    def away(t: float, y: np.ndarray) -> float:
        return (y[0] - volume) / volume

    away.terminal, away.direction = True, direction  # pyright: ignore[reportFunctionMemberAccess]
    return away

"""A tolerance asked for, and got: finer and finer until two neighbours agree.

Geometry, energy and added mass converge with the sixth power of the spacing,
a step with its second, so two neighbouring levels differ by nearly all
of the coarser one's error: the finer one is well inside the tolerance.

Source     Roache, Perspective: a method for uniform reporting of grid refinement studies
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

from jshell.errors import BadValue
from jshell.shell.parameters import check

Result = TypeVar("Result")


class Level(NamedTuple):
    """One resolution: elements of the meridian, longest time step [time unit]."""

    elements: int
    step: float


LEVELS = (
    Level(16, 1 / 40),
    Level(24, 1 / 60),
    Level(32, 1 / 80),
    Level(48, 1 / 120),
    Level(64, 1 / 160),
    Level(96, 1 / 240),
)


class Refinement(NamedTuple):
    """Where refinement stopped: the finer result, its level, its distance from the coarser one, and if that will do."""

    result: object
    level: Level
    error: float
    reached: bool


def refine(at: Callable[[Level], Result], apart: Callable[[Result, Result], float], tolerance: float) -> Refinement:
    """Refine until two neighbouring levels agree.

    Args:
        at: The result at a level.
        apart: How far a coarser result is from a finer one.
        tolerance: What they may be apart.

    Raises:
        BadValue: The tolerance is not a number above 0.
    """
    check("tolerance", tolerance, "a finite number above 0", lambda x: x > 0)
    if isinstance(tolerance, bool):
        raise BadValue("tolerance", found=repr(tolerance), expected="a number above 0", remedy="1e-3 is usual.")
    coarse, error = at(LEVELS[0]), float("inf")
    for level in LEVELS[1:]:
        fine = at(level)
        error = apart(coarse, fine)
        if error <= tolerance:
            return Refinement(fine, level, error, True)
        coarse = fine
    return Refinement(coarse, LEVELS[-1], error, False)

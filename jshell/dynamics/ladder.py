"""A tolerance asked for, and got: finer and finer until two neighbours agree.

Geometry, energy and added mass converge with the sixth power of the spacing,
a step with its second, so two neighbours on the ladder differ by nearly all
of the coarser one's error: the finer one is well inside the tolerance.

Source     Roache, Perspective: a method for uniform reporting of grid refinement studies
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

from jshell.errors import BadValue
from jshell.shell.parameters import check

Result = TypeVar("Result")


class Rung(NamedTuple):
    """One resolution: elements of the meridian, longest time step [time unit]."""

    elements: int
    step: float


LADDER = (
    Rung(16, 1 / 40),
    Rung(24, 1 / 60),
    Rung(32, 1 / 80),
    Rung(48, 1 / 120),
    Rung(64, 1 / 160),
    Rung(96, 1 / 240),
)


class Climb(NamedTuple):
    """Where the ladder was left: the finer result, its rung, its distance from the coarser one, and if that will do."""

    result: object
    rung: Rung
    error: float
    reached: bool


def climb(at: Callable[[Rung], Result], apart: Callable[[Result, Result], float], tolerance: float) -> Climb:
    """Climb until two neighbouring rungs agree.

    Args:
        at: The result on a rung.
        apart: How far a coarser result is from a finer one.
        tolerance: What they may be apart.

    Raises:
        BadValue: The tolerance is not a number above 0.
    """
    check("tolerance", tolerance, "a finite number above 0", lambda x: x > 0)
    if isinstance(tolerance, bool):
        raise BadValue("tolerance", found=repr(tolerance), expected="a number above 0", remedy="1e-3 is usual.")
    coarse, error = at(LADDER[0]), float("inf")
    for rung in LADDER[1:]:
        fine = at(rung)
        error = apart(coarse, fine)
        if error <= tolerance:
            return Climb(fine, rung, error, True)
        coarse = fine
    return Climb(coarse, LADDER[-1], error, False)

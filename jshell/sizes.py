"""Sizes that are refused before memory is asked for them.

Symbols    none
Valid for  counts that a user gives directly, or by a length and a spacing
Source     a run of 10⁷ samples is 1.6 GB of channels: what is longer is a slip, or a case for shorter runs
"""

import math

from jshell.errors import BadValue

MOST_SAMPLES = 10_000_000


def count_of_samples(place: str, duration: float | int, every: float | int, most: int = MOST_SAMPLES) -> int:
    """How many spacings a duration holds, at least one.

    Args:
        place: What the two are called.
        duration, every: A length and a spacing, in one unit.
        most: As many are borne.

    Raises:
        BadValue: Lengths that are not finite and above 0, a spacing above the duration, or too many samples.

    Example:
        >>> from jshell.sizes import count_of_samples
        >>> count_of_samples("duration, every", 70.0, 0.05)
        1400
    """
    for value in (duration, every):
        if not (math.isfinite(value) and value > 0):
            raise BadValue(place, found=f"{value!r}", expected="finite numbers above 0", remedy="Check the values.")
    if every > duration:
        raise BadValue(
            place, found=f"{every:g}, above {duration:g}", expected="at most the duration", remedy="Sample more often."
        )
    return limited(place, round(duration / every), most, "samples")


def limited(place: str, count: float | int, most: int, noun: str) -> int:
    """A count, unless it is absurd.

    Raises:
        BadValue: More than `most`.
    """
    if not count <= most:
        raise BadValue(
            place,
            found=f"{count:.3g} {noun}",
            expected=f"at most {most:.3g} {noun}",
            remedy="Check the unit, or ask for less.",
        )
    return int(count)

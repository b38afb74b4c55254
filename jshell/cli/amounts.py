"""A number with its unit, as an option takes it: 22.5mm, 176kPa, 20 ms; without a unit, in SI."""

import re
from collections.abc import Callable

import typer

from jshell.quantities import SI_UNIT, UNITS

_WRITTEN = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?")


def read_amount(text: str, *dimensions: str) -> float:
    """A number in SI.

    Args:
        text: A number, and a unit after it where it is not in SI.
        dimensions: Those of `jshell.quantities.UNITS` that the unit may have.

    Raises:
        ValueError: No number; a unit that is none of these dimensions.
    """
    found = _WRITTEN.fullmatch(text.strip())
    known = {unit: size for unit, (dimension, size) in UNITS.items() if dimension in dimensions}
    if found is None:
        raise ValueError(f"{text!r} is no number; expected one such as {_example(dimensions)}.")
    number, unit = found.groups()
    if unit is not None and unit not in known:
        raise ValueError(f"{text!r} ends in an unknown unit; expected one of {', '.join(known)}, or none for SI.")
    return float(number) * (1.0 if unit is None else known[unit])


def amount(dimension: str) -> Callable[[str], float]:
    """What Typer reads an option of a dimension by."""

    def number(text: str) -> float:
        try:
            return read_amount(text, dimension)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None

    return number


def _example(dimensions: tuple[str, ...]) -> str:
    examples = {"length": "22.5mm", "pressure": "176kPa", "time": "20ms"}
    shown = [examples[one] for one in dimensions if one in examples]
    return " or ".join(shown or [f"1 {SI_UNIT[dimensions[0]]}"])

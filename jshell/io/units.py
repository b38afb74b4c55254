"""Units at the door: the registry's own, and uncommon but legal ones through pint."""

import functools
import re
from typing import Any

from jshell.errors import BadUnits
from jshell.io.files import SPOILED
from jshell.quantities import QUANTITIES, SI_UNIT, UNITS

SIGMA = "sigma_"
PURE = "-"  # the unit of a number among columns with units
_UNITS = {**UNITS, PURE: ("none", 1.0)}
_SPELLING = str.maketrans({"μ": "µ", "²": "^2", "³": "^3"})  # Greek mu for micro; superscripts
_LEGAL = re.compile(r"[^\W\d][\w µ°.*/^()\-]{0,39}")
_LARGE_POWER = re.compile(r"(\^|\*\*)\s*[-(]*\s*\d{2}")  # m^99999 would keep pint busy for good
# An angle is no dimension to pint, so that Hz and rad/s would be one: frequencies stay without unit.
_DIMENSIONS = {
    "[time]": "time",
    "[length]": "length",
    "[length] ** 2": "area",
    "[length] ** 3": "volume",
    "[length] / [time]": "speed",
    "[length] ** 3 / [time]": "volume rate",
    "[mass] / [length] / [time] ** 2": "pressure",
    "[length] ** 2 * [mass] / [time] ** 2": "energy",
    "[mass] * [length] ** 2 / [time] ** 2": "energy",
    "[mass] / [length] / [time]": "viscosity",
}


def dimension_of(name: str) -> str:
    """Dimension of a column by its name; unknown names are pure numbers."""
    bare = name.removeprefix(SIGMA)
    return QUANTITIES[bare].dimension if bare in QUANTITIES else "none"


def si_unit(name: str) -> str:
    """The unit that a column has in a file in SI."""
    dimension = dimension_of(name)
    if dimension != "none" and dimension not in SI_UNIT:
        raise BadUnits(
            f"channel {name!r}",
            found=f"a {dimension}",
            expected="one of " + ", ".join(SI_UNIT),
            remedy='Leave the channel out, or write with units="reduced".',
        )
    return SI_UNIT.get(dimension, PURE)


def known_unit(place: str, name: str, written: str) -> tuple[str, float]:
    """Dimension and SI factor of a unit, which must fit the column's name.

    Raises:
        BadUnits: A unit that neither the registry nor pint knows, or of another dimension.
    """
    unit = written.strip().translate(_SPELLING)
    found = _UNITS.get(unit) or _uncommon(unit)
    if found is None:
        raise BadUnits(
            place,
            found=f"the unit {written[:40]!r}",
            expected="one of " + ", ".join(_UNITS) + ", or another spelling that pint knows (extra `io`)",
            remedy="Convert the column to a unit of the list.",
        )
    dimension, factor = found
    bare = name.removeprefix(SIGMA)
    if bare in QUANTITIES and QUANTITIES[bare].dimension != dimension:
        wanted = QUANTITIES[bare].dimension
        fitting = [known for known, (kind, _) in _UNITS.items() if kind == wanted]
        raise BadUnits(
            place,
            found=f"the unit {written}, of {dimension}",
            expected=f"a unit of {wanted}: {', '.join(fitting) or 'none is known, leave all units out'}",
            remedy="Correct the unit, or rename the column.",
        )
    return dimension, factor


@functools.lru_cache(maxsize=64)
def _uncommon(unit: str) -> tuple[str, float] | None:
    """Dimension and SI factor of a unit by pint; None where it knows none, or is not installed."""
    if not _LEGAL.fullmatch(unit) or _LARGE_POWER.search(unit):
        return None
    registry = _registry()
    if registry is None:
        return None
    try:
        parsed = registry.parse_units(unit)
        dimension = _DIMENSIONS.get(str(parsed.dimensionality))
        zero, one = (float(registry.Quantity(number, parsed).to_base_units().magnitude) for number in (0.0, 1.0))
    except SPOILED:  # pint's own errors are among them, and it lets Python's through
        return None
    return None if dimension is None or zero != 0 or not one > 0 else (dimension, one)


@functools.lru_cache(maxsize=1)
def _registry() -> Any:
    try:
        import pint
    except ImportError:
        return None
    return pint.UnitRegistry()

"""Units at the door: the registry's own, and uncommon but legal ones through pint.

A unit of another kind, such as volts, is a unit, too: its column keeps its own
numbers, is a channel of any analysis, and stands for no quantity of the shell.
"""

import functools
import re
from typing import Any

from jshell.errors import BadUnits
from jshell.io.files import SPOILED
from jshell.quantities import QUANTITIES, SI_UNIT, UNITS

SIGMA = "sigma_"
PURE = "-"  # the unit of a number among columns with units
OWN = "another kind"  # the dimension of a unit that no quantity of the shell has
_UNITS = {**UNITS, PURE: ("none", 1.0)}
_SPELLING = str.maketrans({"μ": "µ", "²": "^2", "³": "^3"})  # Greek mu for micro; superscripts
_POWER = re.compile(r"([A-Za-zµ])([23])$")  # mm3
# How instruments spell the registry's units.
_WORDS = {
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
}
_WORDS |= {"usec": "us", "µsec": "us", "microsecond": "us", "microseconds": "us", "nsec": "ns", "nanoseconds": "ns"}
_WORDS |= {
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "ml": "mL",
    "pascal": "Pa",
    "none": PURE,
    "1": PURE,
}
LOGARITHMS = ("dB", "dBm", "dBV", "dBmV", "dBu", "dBFS")
# Units of instruments that no quantity here has; pint knows more of them.
_MORE = (
    "V mV uV µV kV A mA uA µA W mW Hz kHz MHz N mN g kg K deg C °C degC % ° rad px pixel pixels count counts ADC LSB "
    "bit bits a.u. au arb arb. volt volts ampere amperes amps m/s^2 V/div frame frames"
)
_OTHERS = frozenset(_MORE.split()) | {*LOGARITHMS}
_LEGAL = re.compile(r"[^\W\d][\w µ°.*/^()\-]{0,39}")
# Powers of powers, and of ten and more, would keep pint busy for good: `m^99999`, `s**9**9**9`, `square cubic km`.
_MARK = r"(?:\^|\*\*|\b(?:square|squared|cubic|cubed|sq)\b)"
_DIGIT = r"-?\s*\d(?:\.\d{1,3})?"
_EXPONENT = rf"\s*(?:\^|\*\*)\s*(?:{_DIGIT}|\(\s*{_DIGIT}(?:\s*/\s*[1-9])?\s*\))(?![\w.(])(?!\s*{_MARK})"
_POWERS = re.compile(_MARK)
_OF_NAME = re.compile(rf"(?<=[^\W\d_]|°){_EXPONENT}")
_OF_BRACKET = re.compile(rf"(?<=\)){_EXPONENT}|\b(?:square|cubic|sq) [^\W\d_]+(?!\s*{_MARK})| (?:squared|cubed)\b")
_LOWER = frozenset(unit for unit in _OTHERS if len(unit) > 3 and unit == unit.lower())  # words in capitals
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
    found = _meaning(written)
    if found is None:
        raise BadUnits(
            place,
            found=f"the unit {written[:40]!r}",
            expected="one of " + ", ".join(_UNITS) + ", or another spelling that pint knows (extra `io`)",
            remedy="Convert the column to a unit of the list.",
        )
    dimension, factor = found
    bare = name.removeprefix(SIGMA)
    if bare in QUANTITIES and dimension == OWN:
        raise BadUnits(
            place,
            found=f"the unit {written[:40]!r} on the {QUANTITIES[bare].words}",
            expected=f"a unit of {QUANTITIES[bare].dimension}",
            remedy=f"If it is something else, call it so: `--columns signal={bare}`; "
            f"if it has no unit, say so: `--units {bare}={PURE}`.",
        )
    if bare in QUANTITIES and QUANTITIES[bare].dimension != dimension:
        wanted = QUANTITIES[bare].dimension
        fitting = [known for known, (kind, _) in _UNITS.items() if kind == wanted]
        raise BadUnits(
            place,
            found=f"the unit {written}, of {dimension}",
            expected=f"a unit of {wanted}: {', '.join(fitting) or 'none is known, leave all units out'}",
            remedy=f"Correct the unit, say `--units {bare}={(fitting or [PURE])[0]}`, or rename the column.",
        )
    return dimension, factor


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, in any spelling."""
    return bool(text.strip()) and _meaning(text) is not None


def known_factor(unit: str) -> tuple[str, float] | None:
    """Dimension and SI factor of a unit, None where it is unknown."""
    return _meaning(unit)


def is_common(text: str) -> bool:
    """Whether a text is a unit as instruments write them, without brackets: `t` and `S` are names."""
    return _known(text) is not None


def _meaning(written: str) -> tuple[str, float] | None:
    """Dimension and SI factor of a unit; the dimension is `OWN` where no quantity has it."""
    return _known(written) or _uncommon(written.strip().translate(_SPELLING))


def _known(written: str) -> tuple[str, float] | None:
    unit = written.strip().translate(_SPELLING)
    unit = _WORDS.get(unit.lower(), unit)
    for spelled in (unit, _POWER.sub(r"\1^\2", unit)):
        if spelled in _UNITS:
            return _UNITS[spelled]
    return (OWN, 1.0) if unit in _OTHERS or unit.lower() in _LOWER else None


@functools.lru_cache(maxsize=64)
def _uncommon(unit: str) -> tuple[str, float] | None:
    """Dimension and SI factor of a unit by pint; None where it knows none, or is not installed."""
    if not _LEGAL.fullmatch(unit) or not _is_tame(unit):
        return None
    registry = _registry()
    if registry is None:
        return None
    try:
        parsed = registry.parse_units(unit)
        if parsed.dimensionless:
            return None
        dimension = _DIMENSIONS.get(str(parsed.dimensionality))
        if dimension is None:
            return OWN, 1.0
        zero, one = (float(registry.Quantity(number, parsed).to_base_units().magnitude) for number in (0.0, 1.0))
    except SPOILED:  # pint's own errors are among them, and it lets Python's through
        return None
    return None if zero != 0 or not one > 0 else (dimension, one)


def _is_tame(unit: str) -> bool:
    """Whether its powers are single digits of names, or one of a bracket or in words: pint evaluates all of them."""
    if any(letter.isnumeric() and not letter.isascii() for letter in unit):  # pint reads m⁹⁹ as a power, too
        return False
    bare = _OF_NAME.sub("", unit)
    return not _POWERS.search(bare) or (bare == unit and not _POWERS.search(_OF_BRACKET.sub("", unit, count=1)))


@functools.lru_cache(maxsize=1)
def _registry() -> Any:
    try:
        import pint
    except ImportError:
        return None
    return pint.UnitRegistry()

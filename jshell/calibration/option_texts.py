"""Options as text: what a terminal's line and a form's field say, read into the values of `FitOptions`."""

import math
from collections.abc import Sequence
from typing import Any

from jshell.calibration.options import CONSTANTS, Prior
from jshell.errors import BadName, BadValue

FORMS = {  # of one text
    "fix": "NAME=VALUE",
    "bounds": "NAME=LOW:HIGH",
    "tie": "NAME=ARITHMETIC",
    "local": "NAME",
    "uncertain": "CONDITION=RELATIVE ERROR, or CONDITION alone",
    "priors": "NAME=MEAN:ERROR",
    "channels": "NAME",
    "drop": "FROM:TO",
}
_SPELLING = {"kvs": "k_vs"}


def read_texts(option: str, texts: Sequence[str], place: str) -> Any:
    """The value of an option from its texts, each of the form that `FORMS` says.

    Args:
        option: A field of `FitOptions` that `FORMS` knows.
        texts: What was written.
        place: Where, for messages.

    Raises:
        BadName: No such constant.
        BadValue: Text of another form.
    """
    match option:
        case "fix":
            return dict(_fixed(text, place) for text in texts)
        case "bounds":
            pairs = [_named(text, place) for text in texts]
            return {name: read_span(value, place) for name, value in pairs}
        case "tie":
            return dict(_named(text, place) for text in texts)
        case "uncertain":
            return dict(_relative(text, place) for text in texts)
        case "priors":
            return dict(_prior(text, place) for text in texts)
        case "drop":
            return tuple(read_span(text, place) for text in texts)
        case "local":
            return tuple(spelled(text) for text in texts)
    return tuple(text.strip() for text in texts)


def spelled(name: str) -> str:
    """A constant's name as Python has it: kVS is k_vs."""
    base, bracket, number = name.strip().partition("[")
    return _SPELLING.get(base.lower(), base) + bracket + number


def read_span(text: str, place: str) -> tuple[float, float]:
    """LOW:HIGH, either of which may be empty.

    Raises:
        BadValue: Not two numbers.
    """
    low, colon, high = text.partition(":")
    try:
        found = (float(low) if low.strip() else -math.inf, float(high) if high.strip() else math.inf)
    except ValueError:
        found = None
    if found is None or not colon:
        raise BadValue(place, found=repr(text), expected="LOW:HIGH", remedy=f"Write {place} …2.5:3.1") from None
    return found


def _named(text: str, place: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    if not name.strip() or not value.strip():
        raise BadValue(place, found=repr(text), expected="NAME=…", remedy=f"Write {place} NAME=… with one of them.")
    return spelled(name), value.strip()


def _fixed(text: str, place: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    key = spelled(name)
    if key.split("[")[0] not in CONSTANTS:
        raise BadName(
            place, found=repr(text), expected="one of " + ", ".join(CONSTANTS), remedy=f"Write {place} alpha2=1.1"
        )
    try:
        return key, float(value)
    except ValueError:
        raise BadValue(place, found=repr(text), expected="NAME=NUMBER", remedy=f"Write {place} alpha2=1.1") from None


def _relative(text: str, place: str) -> tuple[str, float | None]:
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value) if equals else None
    except ValueError:
        raise BadValue(
            place, found=repr(text), expected="CONDITION=NUMBER", remedy=f"Write {place} gas_pressure=0.02"
        ) from None


def _prior(text: str, place: str) -> tuple[str, Prior]:
    name, value = _named(text, place)
    try:
        mean, sigma = map(float, value.split(":"))
    except ValueError:
        mean = sigma = math.nan
    if not (math.isfinite(mean) and math.isfinite(sigma)):
        raise BadValue(place, found=repr(text), expected="NAME=MEAN:ERROR", remedy=f"Write {place} {name}=0.85:0.05")
    return name, Prior(mean, sigma)

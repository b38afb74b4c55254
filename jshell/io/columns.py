"""Columns of a sheet given their meaning: units taken off, values no shell can show refused.

Symbols    t time   V volume   S area   H height   W width   V0 = 4π/3 volume of the stress-free sphere
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from jshell.errors import BadName, BadUnits, BadValue
from jshell.io.headers import SI_KEYS
from jshell.io.sheets import Sheet
from jshell.quantities import QUANTITIES, SI_UNIT, UNITS
from jshell.shell.parameters import Scales

SPHERE = 4 * np.pi / 3  # V0
SLACK = 1e-3  # relative: what rounding, meshes and image processing may do to a sphere
SIGMA = "sigma_"
PURE = "-"  # the unit of a number among columns with units
_UNITS = {**UNITS, PURE: ("none", 1.0)}
_SPELLING = str.maketrans({"μ": "µ", "²": "^2", "³": "^3"})  # Greek mu for micro; superscripts

Columns = dict[str, np.ndarray]


def check_roles(channels: Sequence[str], sigma: Sequence[str], place: Callable[[str], str]) -> None:
    """At least one channel, and no standard error of a channel that is not there."""
    for name in sigma:
        if name not in channels:
            raise BadName(
                place(SIGMA + name),
                found=f"a standard error of `{name}`, which is no channel here",
                expected=f"a channel `{name}` beside it",
                remedy="Add the channel or remove the column.",
            )
    if not channels:
        raise BadName(
            place("t"), found="no column but `t`", expected="at least one channel, such as `V`", remedy="Add one."
        )


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


def dimensionless(sheet: Sheet, scales: Scales | None) -> Columns:
    """The sheet's columns, each divided by the unit that jshell uses."""
    bare = [name for name, unit in zip(sheet.names, sheet.units, strict=True) if unit is None]
    if len(bare) == len(sheet.names):
        return {name: values.copy() for name, values in zip(sheet.names, sheet.values.T, strict=True)}
    if bare:
        raise BadUnits(
            sheet.place(bare[0]),
            found="no unit, while other columns have one",
            expected="a unit in brackets for every column, or for none",
            remedy=f"Write `{bare[0]} [unit]`, with `[{PURE}]` for a pure number.",
        )
    columns = {}
    for name, written, values in zip(sheet.names, sheet.units, sheet.values.T, strict=True):
        dimension, factor = _known_unit(sheet.place(name), name, str(written))
        if scales is None:
            raise BadUnits(
                sheet.place(name),
                found=f"the unit {written}, without SI conditions",
                expected="the keys " + ", ".join(SI_KEYS) + " in the header or in the meta file",
                remedy="Add them, or write dimensionless columns without brackets.",
            )
        with np.errstate(over="ignore", under="ignore"):
            columns[name] = values * (factor / scales.of(dimension))
    return columns


def _known_unit(place: str, name: str, written: str) -> tuple[str, float]:
    """Dimension and SI factor of a unit, which must fit the column's name."""
    unit = written.translate(_SPELLING)
    if unit not in _UNITS:
        raise BadUnits(
            place,
            found=f"the unit {written!r}",
            expected="one of " + ", ".join(_UNITS),
            remedy="Convert the column to a unit of the list.",
        )
    dimension, factor = _UNITS[unit]
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


def check_times(times: Float[np.ndarray, " times"], place: Callable[[str, int], str]) -> None:
    """Refuse a time that does not increase."""
    still = np.flatnonzero(~(times[1:] > times[:-1]))
    if still.size:
        at = int(still[0]) + 1
        raise BadValue(
            place("t", at),
            found=f"t = {times[at]:.10g} after {times[at - 1]:.10g}",
            expected="a time above the one before",
            remedy="Sort the rows, remove repeated ones, or split joined records.",
        )


def check_finite(columns: Columns, place: Callable[[str, int], str]) -> None:
    """Refuse NaN, infinity, and what became so with its unit."""
    for name, values in columns.items():
        remedy = "Cut the record before it, or check unit and conditions."
        _refuse_first(name, values, ~np.isfinite(values), place, "a finite number", remedy)


def check_values(columns: Columns, place: Callable[[str, int], str]) -> None:
    """Refuse values that no shell can show; all numbers dimensionless."""
    check_finite(columns, place)
    for name, values in columns.items():
        if name.startswith(SIGMA):
            _refuse_first(name, values, values < 0, place, "a standard error of at least 0", "Check the sign.")
        if name in ("V", "H", "W"):
            _refuse_first(name, values, values <= 0, place, "a number above 0", "Check how the column was made.")
    if "V" not in columns:
        return
    V = columns["V"]
    expected = f"at most {SPHERE:.5f}, the stress-free sphere in units of R0^3"
    hint = "Wrong units? Write `V [mm^3]` with SI conditions, or divide by R0^3."
    _refuse_first("V", V, V > SPHERE * (1 + SLACK), place, expected, hint)
    if "S" in columns:
        S = columns["S"]
        with np.errstate(over="ignore", under="ignore"):
            least = 36 * np.pi * V**2 * (1 - SLACK)  # isoperimetric inequality
            small = least > S**3
        expected = "S^3 >= 36 π V^2: no surface encloses this volume with less than a sphere's area"
        _refuse_first("S", S, small, place, expected, "Check the units of V and S, and that they belong together.")


def _refuse_first(
    name: str, values: np.ndarray, bad: np.ndarray, place: Callable[[str, int], str], expected: str, remedy: str
) -> None:
    if np.any(bad):
        at = int(np.argmax(bad))
        raise BadValue(place(name, at), found=f"{name} = {values[at]:.6g}", expected=expected, remedy=remedy)

"""Columns of a sheet given their meaning: units taken off, values no shell can show refused.

Symbols    t time   V volume   S area   H height   W width   V0 = 4π/3 volume of the stress-free sphere
"""

import re
import warnings
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from jshell.errors import BadName, BadUnits, BadValue, RangeWarning
from jshell.io.clock import even_stamps
from jshell.io.files import brief
from jshell.io.headers import SI_KEYS
from jshell.io.sheets import Sheet
from jshell.io.units import OWN, PURE, SIGMA, dimension_of, known_unit
from jshell.quantities import UNITS
from jshell.shell.parameters import Scales

SPHERE = 4 * np.pi / 3  # V0
SLACK = 1e-3  # relative: what rounding, meshes and image processing may do to a sphere, unsaid
MAX_EXCESS = 0.02  # relative: what an overstretched wall or noise may add, with a warning; no slip of units is so small
SIGMAS = 6.0  # standard errors that noise may add: one sample in 1e9 goes further

Columns = dict[str, np.ndarray]
Place = Callable[[str, int], str]


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


SECONDS = Scales(1.0, 1.0, 1.0)  # of a record in SI whose shell is not told: its unit of time is the second


def dimensionless(sheet: Sheet, scales: Scales | None, *, known: bool) -> tuple[Columns, dict[str, str]]:
    """The sheet's columns, each divided by the unit that jshell uses, and the units that have no such unit.

    Args:
        sheet: The columns.
        scales: SI values of the units, where the conditions give them.
        known: Whether there are conditions; a record without them stays in SI (`SECONDS`).

    Raises:
        BadUnits: A unit that is unknown, that contradicts the name, or that nothing makes dimensionless; a quantity
            of the shell, or the time, without a unit beside others that have one.
    """
    if all(unit is None for unit in sheet.units):
        return {name: values.copy() for name, values in zip(sheet.names, sheet.columns, strict=True)}, {}
    si = not known
    columns, own = {}, {}
    for name, written, values in zip(sheet.names, sheet.units, sheet.columns, strict=True):
        if written is None:
            if name not in sheet.pure:
                _refuse_bare(sheet, name, si)
            columns[name] = values.copy()
            continue
        dimension, factor = known_unit(sheet.place(name), name, written)
        if dimension == OWN:
            own[name] = written
            columns[name] = values.copy()
            continue
        if scales is None and not si and dimension != "none":
            raise BadUnits(
                sheet.place(name),
                found=f"the unit {written}, without SI conditions",
                expected="the keys " + ", ".join(SI_KEYS) + " in the header or in the meta file",
                remedy=f"Add them; or, if its numbers are dimensionless in truth, say `--units {brief(name)}={PURE}`.",
            )
        unit = SECONDS if scales is None else scales
        with np.errstate(over="ignore", under="ignore"):
            columns[name] = values * (factor / unit.of(dimension))
    return columns, own


def _refuse_bare(sheet: Sheet, name: str, si: bool) -> None:
    """Refuse a quantity of the shell, or the time, whose unit is not told while others have one."""
    if dimension_of(name) == "none" or (si and name != "t"):
        return
    fitting = next((unit for unit, (kind, _) in UNITS.items() if kind == dimension_of(name)), PURE)
    raise BadUnits(
        sheet.place(name),
        found="no unit, while other columns have one",
        expected="a unit in brackets for every quantity, or for none",
        remedy=f"Write `{brief(name)} [{fitting}]`, or say it: `--units {brief(name)}={fitting}`.",
    )


def increasing(times: Float[np.ndarray, " times"], place: Place) -> tuple[Float[np.ndarray, " times"], str]:
    """The times, which increase; where they are rounded stamps of even steps, those steps, and what was done in words.

    Raises:
        BadValue: A time that does not increase.
    """
    still = int(np.sum(~(times[1:] > times[:-1])))
    even = even_stamps(times) if still else None
    if even is None:
        check_times(times, place)
        return times, ""
    step = (even[-1] - even[0]) / (even.size - 1)
    return even, f"{still} stamps repeat: they were rounded, and agree with even steps, which are read ({step:.6g})"


def check_times(times: Float[np.ndarray, " times"], place: Place) -> None:
    """Refuse a time that does not increase."""
    still = np.flatnonzero(~(times[1:] > times[:-1]))
    if not still.size:
        return
    at = int(still[0]) + 1
    where, before = place("t", at), place("t", at - 1)
    row, last = (re.search(r"row (\d+)", text) for text in (where, before))
    remedy = "Sort the rows, remove repeated ones, or split joined records."
    if row is not None and last is not None:
        remedy = f"If a second record begins here, read one: `--rows :{last[1]}` or `--rows {row[1]}:`."
        if times[at] != times[0]:
            remedy += (
                " If the rows are even, say how many a second: `--rate 1000`. Else sort them, or remove repeated ones."
            )
    raise BadValue(
        where,
        found=f"t = {times[at]:.10g} after {times[at - 1]:.10g}",
        expected="a time above the one before",
        remedy=remedy,
    )


def check_finite(columns: Columns, place: Place) -> None:
    """Refuse NaN, infinity, and what became so with its unit."""
    for name, values in columns.items():
        remedy = "Cut the record before it, or check unit and conditions."
        _refuse_first(name, values, ~np.isfinite(values), place, "a finite number", remedy)


def check_values(columns: Columns, place: Place, *, si: bool = False) -> None:
    """Refuse values that no shell can show; all numbers dimensionless, or in SI, where no sphere is known.

    A volume above the sphere's, or an area below a sphere's of that volume, is
    refused beyond 2 % and six stated standard errors; short of that, but beyond
    0.1 %, it is taken for noise or an overstretched wall, with a warning.

    Raises:
        BadValue: A value that no shell can show.

    Warns:
        RangeWarning: A volume or an area slightly beyond the sphere's.
    """
    check_finite(columns, place)
    for name, values in columns.items():
        if name.startswith(SIGMA):
            _refuse_first(name, values, values < 0, place, "a standard error of at least 0", "Check the sign.")
        if name in ("V", "H", "W"):
            _refuse_first(name, values, values <= 0, place, "a number above 0", "Check how the column was made.")
    if "V" not in columns or si:
        return
    V, V_noise = columns["V"], columns.get("sigma_V", np.zeros(1))
    expected = f"at most {SPHERE:.5f}, the stress-free sphere in units of R0^3"
    hint = "Wrong units? Write `V [mm^3]` with SI conditions, or divide by R0^3."
    over = V / SPHERE - 1
    noise = SIGMAS * V_noise / SPHERE
    _refuse_first("V", V, over > MAX_EXCESS + noise, place, expected, hint)
    _warn_worst("V", V, over, noise, place, "above the volume of the stress-free sphere")
    if "S" in columns:
        S, S_noise = columns["S"], columns.get("sigma_S", np.zeros(1))
        with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
            lacking = np.where(S > 0, 36 * np.pi * V**2 / S**3 - 1, np.inf)  # isoperimetric inequality
            noise = np.nan_to_num(SIGMAS * (1 + lacking) * np.hypot(2 * V_noise / V, 3 * S_noise / S))
        expected = "S^3 >= 36 π V^2: no surface encloses this volume with less than a sphere's area"
        hint = "Check the units of V and S, and that they belong together."
        _refuse_first("S", S, ~(lacking <= MAX_EXCESS + noise), place, expected, hint)
        _warn_worst("S", S, lacking, noise, place, "of S^3 short of the area of a sphere of that volume")


def _refuse_first(name: str, values: np.ndarray, bad: np.ndarray, place: Place, expected: str, remedy: str) -> None:
    if np.any(bad):
        at = int(np.argmax(bad))
        raise BadValue(place(name, at), found=f"{name} = {values[at]:.6g}", expected=expected, remedy=remedy)


def _warn_worst(name: str, values: np.ndarray, beyond: np.ndarray, noise: np.ndarray, place: Place, words: str) -> None:
    """Say how far beyond a sphere a column goes, and what could explain it."""
    at = int(np.argmax(beyond))
    if beyond[at] <= SLACK:
        return
    room = float(np.broadcast_to(noise, values.shape)[at])
    if beyond[at] <= room:
        why = f"within {SIGMAS:.0f} of its standard errors: taken for noise"
    else:
        why = "taken for noise or an overstretched wall; if it is neither, check R0 and the calibration of lengths"
    warnings.warn(
        f"{place(name, at)}: {name} = {values[at]:.6g} is {100 * beyond[at]:.2g} % {words}, {why}.",
        RangeWarning,
        stacklevel=4,
    )

"""Columns of a sheet given their meaning: units taken off, values no shell can show refused.

Symbols    t time   V volume   S area   H height   W width   V0 = 4π/3 volume of the stress-free sphere
"""

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from jshell.errors import BadName, BadUnits, BadValue, RangeWarning
from jshell.io.files import brief
from jshell.io.headers import SI_KEYS
from jshell.io.sheets import Sheet
from jshell.io.units import PURE, SIGMA, known_unit
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


def dimensionless(sheet: Sheet, scales: Scales | None) -> Columns:
    """The sheet's columns, each divided by the unit that jshell uses."""
    bare = [name for name, unit in zip(sheet.names, sheet.units, strict=True) if unit is None]
    if len(bare) == len(sheet.names):
        return {name: values.copy() for name, values in zip(sheet.names, sheet.columns, strict=True)}
    if bare:
        raise BadUnits(
            sheet.place(bare[0]),
            found="no unit, while other columns have one",
            expected="a unit in brackets for every column, or for none",
            remedy=f"Write `{brief(bare[0])} [unit]`, with `[{PURE}]` for a pure number.",
        )
    columns = {}
    for name, written, values in zip(sheet.names, sheet.units, sheet.columns, strict=True):
        dimension, factor = known_unit(sheet.place(name), name, str(written))
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


def check_times(times: Float[np.ndarray, " times"], place: Place) -> None:
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


def check_finite(columns: Columns, place: Place) -> None:
    """Refuse NaN, infinity, and what became so with its unit."""
    for name, values in columns.items():
        remedy = "Cut the record before it, or check unit and conditions."
        _refuse_first(name, values, ~np.isfinite(values), place, "a finite number", remedy)


def check_values(columns: Columns, place: Place) -> None:
    """Refuse values that no shell can show; all numbers dimensionless.

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
    if "V" not in columns:
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

"""Columns in NetCDF 4, through h5netcdf: variables along `t`, units and header as attributes.

What `Trace.to_xarray` makes, `Dataset.to_netcdf` of it and the files written
here are the same thing. Packed numbers are refused, not unpacked.
"""

import io as streams
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jshell.errors import BadFile, require_extra
from jshell.files import NamedBytes
from jshell.io.arrays import SETTINGS, check_array, refuse_names, settings_text, sheet_of
from jshell.io.choices import Reading
from jshell.io.files import SPOILED, check_size, looks_like, spoiled
from jshell.io.headers import CONDITION_KEYS
from jshell.io.sheets import Sheet, title

WORDS = "NetCDF 4 file"
PURE = "1"  # how the CF conventions spell a pure number
NAME = re.compile(r"\w([\w \-+.()^]*[\w\-+.()^])?")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
_SINCE = re.compile(r"\s+since\s.*")  # the CF conventions count times from a date
_PACKED = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def read(source: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a NetCDF file.

    Raises:
        BadFile: No NetCDF 4, packed numbers or fill values, several dimensions, links to other files, or too large.
        MissingExtra: h5netcdf is not installed.
    """
    require_extra("h5netcdf", "io", "NetCDF files")
    import h5py  # the library under h5netcdf: it tells where the numbers lie before any is read

    start = bytes(source.content[:16])
    if not start.startswith(b"\x89HDF"):
        known = looks_like(start)
        raise BadFile(
            source.name,
            found=known[0] if known else "a file of another kind",
            expected=f"a {WORDS}",
            remedy=f"If that is right, {known[1]}." if known else "Check how the file was written.",
        )
    try:
        with h5py.File(streams.BytesIO(source.content), "r") as file:
            header = [(f"{source}, attribute `{key}`", key, _array(file.attrs[key])) for key in _own(file.attrs)]
            columns, units, axes = _columns(source.name, file)
    except BadFile:
        raise
    except SPOILED as error:
        raise spoiled(source.name, WORDS, error) from None
    for place, _, value in header:
        check_array(place, value.shape, value.dtype.kind, value.dtype.itemsize)
    pure = all(unit == PURE for unit in units.values())
    spelled = {name: None if pure else ("-" if unit == PURE else unit) for name, unit in units.items()}
    words = [(key, value.reshape(())) for _, key, value in header if value.size == 1]
    named = [(title(name, spelled.get(name)), x) for name, x in columns.items()]
    made = sheet_of(source.name, [*words, *named], choices, required)
    return replace(made, axis=axes[0] if len(axes) == 1 and "t" not in columns else "")


def _columns(source: str, file: Any) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """The variables of a file, the units of those that name them, and those that others lie along."""
    import h5py

    columns, units, axes, total = {}, {}, [], 0.0
    for name in file:
        place = f"{source}, variable `{name}`"
        found = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
        if not isinstance(found, h5py.Dataset) or found.external or found.is_virtual:
            raise BadFile(
                place,
                found="a group, or a link to elsewhere",
                expected="numbers in this file",
                remedy="Write the columns beside each other into one file.",
            )
        attributes = found.attrs
        if str(_text(attributes.get("NAME", ""))).startswith(_NO_VARIABLE):
            continue
        check_array(place, found.shape, found.dtype.kind, found.dtype.itemsize)
        total += 8.0 * float(np.prod([float(size) for size in found.shape]))
        check_size(source, total)
        columns[str(name)] = np.asarray(found[...])
        _refuse_packed(place, {key: attributes[key] for key in _PACKED if key in attributes}, columns[str(name)])
        if "units" in attributes:
            units[str(name)] = _SINCE.sub("", _text(attributes["units"]))
        if attributes.get("CLASS") in (b"DIMENSION_SCALE", "DIMENSION_SCALE"):
            axes.append(str(name))
    return columns, units, axes


def encode(sheet: Sheet) -> bytes:
    """Columns bit for bit, conditions and settings as attributes.

    Raises:
        BadName: A name that NetCDF does not allow.
        MissingExtra: h5netcdf is not installed.
    """
    h5netcdf = require_extra("h5netcdf", "io", "NetCDF files")
    refuse_names(sheet, [name for name in sheet.names if not NAME.fullmatch(name)], "a word without slashes")
    pure = all(unit is None for unit in sheet.units)
    rest = [item for item in sheet.entries if item.key not in (*CONDITION_KEYS, "outcome")]
    made = streams.BytesIO()
    with h5netcdf.File(made, "w") as file:
        file.dimensions = {"t": sheet.columns[0].size}
        for name, unit, values in zip(sheet.names, sheet.units, sheet.columns, strict=True):
            variable = file.create_variable(name, ("t",), np.float64)
            variable[:] = values
            variable.attrs["units"] = PURE if pure or unit == "-" else str(unit)
        for item in sheet.entries:
            if item.key in CONDITION_KEYS:
                file.attrs[item.key] = float(item.value)
            elif item.key == "outcome":
                file.attrs[item.key] = item.value
        if rest:
            file.attrs[SETTINGS] = settings_text(rest)
    return made.getvalue()


def _refuse_packed(place: str, own: dict[str, Any], values: np.ndarray) -> None:
    for key in _PACKED:
        if key not in own:
            continue
        number = np.asarray(own[key])
        if key in ("scale_factor", "add_offset") or np.any(np.isin(values, number)):
            raise BadFile(
                f"{place}, attribute `{key}`",
                found="packed numbers"
                if key in ("scale_factor", "add_offset")
                else f"rows that are missing ({number})",
                expected="plain float64, every row filled",
                remedy="Write the file without packing, and drop rows that are missing.",
            )


def _own(attributes: Any) -> list[str]:
    return [key for key in attributes if not key.startswith("_")]


def _array(value: Any) -> np.ndarray:
    return np.asarray(_text(value)) if isinstance(value, str | bytes) else np.asarray(value)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

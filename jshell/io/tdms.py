"""Columns of NI's `.tdms`, through npTDMS: channels with their units, and the step of their samples."""

import io as streams
from collections.abc import Sequence
from typing import Any

import numpy as np

from jshell.errors import BadFile, require_extra
from jshell.files import NamedBytes
from jshell.io.arrays import WORDS as KINDS
from jshell.io.arrays import checked, vector
from jshell.io.choices import Reading
from jshell.io.files import SPOILED, check_size, spoiled
from jshell.io.sheets import Even, Sheet
from jshell.io.spreadsheets import not_written

WORDS = "TDMS file"


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a TDMS file.

    Raises:
        BadFile: No TDMS file, channels of different lengths or without numbers, or too large.
        MissingExtra: npTDMS is not installed.
    """
    library = require_extra("nptdms", "instruments", "TDMS files")
    try:
        with library.TdmsFile.open(streams.BytesIO(file.content)) as found:
            channels = [(group.name, one) for group in found.groups() for one in group.channels() if len(one)]
            check_size(file.name, 8.0 * sum(len(one) for _, one in channels))
            named = [one.name for _, one in channels]
            twice = len(set(named)) < len(named)
            names, units, columns, evens = [], [], [], []
            for group, one in channels:
                values, unit = _values(f"{file}, channel `{one.name}`", np.asarray(one[:]))
                names.append(f"{group} {one.name}" if twice else one.name)
                units.append(unit or _unit(one.properties))
                columns.append(values)
                evens.append(_even(one.name, one.properties))
    except BadFile:
        raise
    except SPOILED as error:
        raise spoiled(file.name, WORDS, error) from None
    even = evens[0] if evens and len({(one.start, one.step) if one else None for one in evens}) == 1 else None
    return checked(Sheet(file.name, (), tuple(names), tuple(units), tuple(columns), even=even), choices)


def encode(sheet: Sheet) -> bytes:
    """Nothing: TDMS files are not written.

    Raises:
        BadFile: Always.
    """
    raise not_written(sheet)


def _values(place: str, values: np.ndarray) -> tuple[np.ndarray, str | None]:
    """The numbers of a channel; dates in seconds since the first."""
    if values.dtype.kind == "M":
        return (values - values[0]) / np.timedelta64(1, "s"), "s"
    if values.dtype.kind not in "fiu":
        kind = KINDS.get(values.dtype.kind, values.dtype.kind)
        raise BadFile(place, found=f"a channel of {kind}", expected="real numbers", remedy="Leave it out of the file.")
    return vector(values), None


def _unit(properties: Any) -> str | None:
    return str(properties.get("unit_string") or "").strip() or None


def _even(name: str, properties: Any) -> Even | None:
    step = properties.get("wf_increment")
    if not isinstance(step, float | int) or not step > 0:
        return None
    return Even(float(properties.get("wf_start_offset") or 0.0), float(step), f"`wf_increment` {step:g} s of `{name}`")

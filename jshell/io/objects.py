"""Columns in JSON: `{"d_hat": 0.22, …, "columns": {"t": […], "V": […]}}`.

Conditions and settings stand beside `columns`, as in a meta file. Names may
carry units, `"V [mm^3]"`. Numbers keep all their digits.
"""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from jshell.errors import BadFile, BadName, BadValue
from jshell.files import NamedBytes
from jshell.io.arrays import checked
from jshell.io.choices import Reading
from jshell.io.files import read_text, short
from jshell.io.headers import CONDITION_KEYS, entries_of, parsed
from jshell.io.sheets import Sheet, title, titles

COLUMNS = "columns"


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a JSON file.

    Raises:
        BadFile: No JSON object with lists of numbers under `columns`, or columns of different lengths.
        BadValue: A number that is NaN or infinite.
    """
    pairs = parsed(file.name, read_text(file))
    found = [value for key, value in pairs if key == COLUMNS]
    if len(found) != 1 or not isinstance(found[0], tuple):
        raise BadFile(
            f"{file}, key `{COLUMNS}`",
            found="no JSON object" if not found else f"{len(found)} of them" if len(found) > 1 else "another value",
            expected="one object of lists of numbers",
            remedy='Write `{"columns": {"t": […], "V": […]}}`.',
        )
    names, units = titles(file.name, [str(key) for key, _ in found[0]])
    columns = tuple(
        _column(file.name, name, values, choices.missing == "drop")
        for name, (_, values) in zip(names, found[0], strict=True)
    )
    rest = [pair for pair in pairs if pair[0] != COLUMNS]
    return checked(Sheet(file.name, entries_of(rest, file.name), names, units, columns), choices)


def encode(sheet: Sheet) -> bytes:
    """Columns, conditions and settings as one JSON object, bit for bit.

    Raises:
        BadName: A setting that stands twice, or one called `columns`.
    """
    keys = [item.key for item in sheet.entries]
    for at, key in enumerate(keys):
        if key == COLUMNS or key in keys[:at]:
            raise BadName(
                f"trace, setting {key!r}",
                found="a key that a JSON file cannot hold, or not twice",
                expected="every key once, and none called `columns`",
                remedy="Rename the setting, or write CSV.",
            )
    record: dict[str, Any] = {
        item.key: float(item.value) if item.key in CONDITION_KEYS else item.value for item in sheet.entries
    }
    spelled = map(title, sheet.names, sheet.units)
    record[COLUMNS] = {name: values.tolist() for name, values in zip(spelled, sheet.columns, strict=True)}
    return (json.dumps(record, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _column(source: str, name: str, values: Any, dropping: bool) -> np.ndarray:
    """A list of numbers as an array; the slow walk happens only to place an error, or to find gaps."""
    if not isinstance(values, list):
        raise BadFile(
            f"{source}, column `{name}`",
            found=short(str(values)),
            expected="a list of numbers",
            remedy="Write `[0.0, 0.1, …]`.",
        )
    if set(map(type, values)) <= {int, float}:
        try:
            return np.asarray(values, dtype=np.float64)
        except OverflowError:
            pass  # an integer above 1e308: the walk below places it
    if dropping:  # null is a gap
        values = [math.nan if value is None else value for value in values]
        if set(map(type, values)) <= {float}:
            return np.asarray(values, dtype=np.float64)
    for at, value in enumerate(values):
        place = f"{source}, row {at + 1}, column `{name}`"
        if type(value) not in (int, float):
            raise BadFile(
                place,
                found=short(json.dumps(value, default=str)),
                expected="a number such as 4.18 or 4.18e-3",
                remedy="Correct it, or remove the row from every column.",
            )
        if abs(value) > 1.7976931348623157e308 or (isinstance(value, float) and not math.isfinite(value)):
            raise BadValue(
                place,
                found=short(str(value)),
                expected="a finite number",
                remedy="Correct it, or leave such rows out: `--missing drop`.",
            )
    raise AssertionError("a list that is neither sound nor wrong")

"""Named arrays sorted into a sheet: what `.npz`, `.mat` and NetCDF files have in common.

A vector of numbers is a column, a single number or a word an entry of the
header. `settings` is a text of lines `key: value`; `units` one of lines
`column: unit`, for formats whose names cannot hold brackets.
"""

from collections.abc import Iterable, Sequence
from pathlib import PurePath

import numpy as np

from jshell.errors import BadFile, BadName, BadValue
from jshell.io.choices import Reading
from jshell.io.files import check_size, short
from jshell.io.sheets import Entry, Sheet, entry, titles

SETTINGS = "settings"
UNITS = "units"
WORDS = {"S": "bytes", "O": "objects", "V": "records", "M": "dates", "m": "spans of time", "c": "complex numbers"}
WORDS |= {"b": "truth values", "U": "words", "T": "words"}


def check_array(place: str, shape: Sequence[int], kind: str, itemsize: int) -> None:
    """Refuse an array by what its file says of it, before any of it is read.

    Raises:
        BadFile: Not numbers or words, more than one column in one array, or too large.
    """
    if kind not in "fiuU":
        raise BadFile(
            place,
            found=f"an array of {WORDS.get(kind, kind)}",
            expected="real numbers, or a text",
            remedy="Save the columns as float64.",
        )
    if sum(size != 1 for size in shape) > 1:
        raise BadFile(
            place,
            found=f"an array of shape {tuple(map(int, shape))}",
            expected="one vector per column",
            remedy="Save every column under its own name.",
        )
    check_size(place, float(np.prod([float(size) for size in shape])) * max(itemsize, 8))


def sheet_of(
    file: str, arrays: Iterable[tuple[str, np.ndarray]], choices: Reading, required: Sequence[str] = ()
) -> Sheet:
    """A sheet from named arrays that `check_array` has passed.

    Raises:
        BadFile: Columns of different lengths or without rows, names that stand twice.
        BadName: A unit of no column.
        BadValue: A number that is NaN or infinite.
    """
    entries, columns = [], {}
    given: dict[str, str] = {}
    for name, values in arrays:
        place = f"{file}, key `{name}`"
        if values.dtype.kind == "U":
            text = _text(place, values)
            if name == SETTINGS:
                entries += _pairs(file, name, text)
            elif name == UNITS:
                given |= {pair.key: pair.value for pair in _pairs(file, name, text)}
            else:
                entries.append(Entry(name, " ".join(text.split("\n")), place))
        elif values.size == 1 and name not in required and values.ndim != 1:
            entries.append(Entry(name, number_text(values), place))
        else:
            columns[name] = values
    spelled = list(columns)
    names, written = titles(file, spelled)
    written = tuple(given.pop(name, unit) for name, unit in zip(names, written, strict=True))
    if given:
        raise BadName(
            f"{file}, units of `{next(iter(given))}`",
            found="a unit of no column",
            expected="one of " + ", ".join(names),
            remedy="Correct the name.",
        )
    values = tuple(vector(columns[key]) for name, key in zip(names, spelled, strict=True))
    return checked(Sheet(file, tuple(entries), names, written, values), choices)


def vector(values: np.ndarray) -> np.ndarray:
    """A column of a file as float64 of this machine, one value per row."""
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values.reshape(-1), dtype=np.float64)


def checked(sheet: Sheet, choices: Reading) -> Sheet:
    """The sheet, unless its columns differ in length or hold what is no number and is not to be dropped."""
    for name, values in zip(sheet.names, sheet.columns, strict=True):
        if values.size != sheet.columns[0].size:
            raise BadFile(
                sheet.place(name),
                found=f"{values.size} rows",
                expected=f"{sheet.columns[0].size}, as in column `{sheet.names[0]}`",
                remedy="Cut or fill the columns to one length.",
            )
        if values.size == 0:
            raise BadFile(
                sheet.place(name), found="no rows", expected="rows of numbers", remedy="Check how the file was written."
            )
        bad = ~np.isfinite(values)
        if np.any(bad) and choices.missing == "refuse":
            at = int(np.argmax(bad))
            raise BadValue(
                sheet.place(name, at),
                found=f"{values[at]}",
                expected="a finite number",
                remedy="Correct it, or leave such rows out: `--missing drop`.",
            )
    return sheet


def number_text(values: np.ndarray) -> str:
    """A single number as a header spells it, with all its digits."""
    number = values.reshape(-1)[0]
    return repr(int(number)) if values.dtype.kind in "iu" else repr(float(number))


def settings_text(pairs: Iterable[Entry]) -> str:
    """The text that keeps settings."""
    return "\n".join(f"{pair.key}: {pair.value}" for pair in pairs)


def refuse_names(sheet: Sheet, names: Iterable[str], words: str) -> None:
    """Refuse to write names that a format cannot hold.

    Raises:
        BadName: One of the names.
    """
    for name in names:
        raise BadName(
            f"trace, channel {name!r}",
            found=f"a name that {PurePath(sheet.file).suffix} files cannot hold",
            expected=words,
            remedy="Rename the channel, or write CSV.",
        )


def _text(place: str, values: np.ndarray) -> str:
    """Words of a file as one text; NumPy itself does not look whether they are made of letters."""
    native = np.atleast_1d(values).astype(values.dtype.newbyteorder("<"))
    try:
        native.tobytes().decode("utf-32-le")
    except UnicodeDecodeError as error:
        raise BadFile(
            place,
            found=f"a text with bytes that are no letters ({error.reason})",
            expected="text",
            remedy="Correct it.",
        ) from None
    return "\n".join(str(line).rstrip() for line in native.ravel())


def _pairs(file: str, name: str, text: str) -> list[Entry]:
    found = []
    for number, line in enumerate(text.split("\n"), 1):
        place = f"{file}, key `{name}`, line {number}"
        pair = entry(f"# {line}", place)
        if pair is None and line.strip():
            raise BadFile(
                place, found=short(line), expected="`key: value`", remedy="Write one pair per line, with a colon."
            )
        if pair is not None:
            found.append(pair)
    return found

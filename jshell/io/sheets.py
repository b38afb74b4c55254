"""A file of columns as it stands: header lines, names with their units, numbers.

Nothing here knows physics. A sheet remembers on which line each row stood, so
that whoever refuses a value later can say where it is. NumPy reads the numbers
in one go; the slow walk through the lines happens only to place an error.
"""

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile, BadName, BadValue

STRETCH = 4096  # lines passed over at once on the way to an error
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_COLUMN = re.compile(r"([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?")
_ENTRY = re.compile(r"#\s*([^\W\d][\w.\-]*)\s*:(?!//)\s*(.*)")  # "# https://…" is a comment


@dataclass(frozen=True)
class Entry:
    """One `key: value` of a header or of a JSON object, and where it stood."""

    key: str
    value: str
    place: str


@dataclass(frozen=True)
class Sheet:
    """A CSV file, read but not interpreted.

    Attributes:
        path: The file.
        entries: Its `# key: value` lines, in order.
        comments: Its other `#` lines with their places.
        names: Column names without units.
        units: Unit of each column as written in brackets, None where there is none.
        row: Line number of the column row.
        values: (rows, columns).
        lines: Its data lines, blank ones included.
    """

    path: Path
    entries: tuple[Entry, ...]
    comments: tuple[Entry, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    row: int
    values: Float[np.ndarray, "rows columns"]
    lines: list[str] = field(repr=False)

    def place(self, name: str, sample: int | None = None) -> str:
        """Where a column, or one sample of it, stands."""
        row = self.row if sample is None else self.row + 1 + _nth_filled(self.lines, sample)
        return f"{self.path}, row {row}, column `{name}`"


def read_text(path: str | Path) -> str:
    """The text of a file, whatever its line ends and with or without a byte order mark.

    Raises:
        BadFile: Missing, a directory, unreadable, empty, or not UTF-8 text.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise BadFile(str(path), found="no such file", expected="a file", remedy=_nearby(path)) from None
    except IsADirectoryError:
        raise BadFile(str(path), found="a directory", expected="a file", remedy="Name a file inside it.") from None
    except (OSError, ValueError) as error:
        raise BadFile(
            repr(str(path)), found=str(error), expected="a readable file", remedy="Check name and permissions."
        ) from None
    if not raw.strip():
        raise BadFile(str(path), found="an empty file", expected="text", remedy="Check how the file was written.")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _not_text(path, raw, error.start) from None
    if "\0" in text:
        raise _not_text(path, raw, raw.index(b"\0"))
    return text.replace("\r\n", "\n").replace("\r", "\n")


def entry(line: str, place: str) -> Entry | None:
    """The key and value of a header line; None for any other line."""
    found = _ENTRY.fullmatch(line.strip())
    return None if found is None else Entry(found[1], found[2].strip(), f"{place}, key `{found[1]}`")


def read_sheet(path: str | Path, required: Sequence[str] = ()) -> Sheet:
    """A CSV file as it stands, with at least the columns required.

    Raises:
        BadFile: Not a file of columns: no text, no rows, ragged rows, unnamed or repeated columns, words for numbers.
        BadName: A required column is missing.
        BadValue: A cell that is NaN or infinite.
    """
    path = Path(path)
    lines = read_text(path).split("\n")
    entries, comments = [], []
    for number, line in enumerate(lines, 1):
        line = line.strip()
        place = f"{path}, row {number}"
        found = entry(line, place)
        if found is not None:
            entries.append(found)
        elif line.startswith("#"):
            comments.append(Entry("", line[1:].strip(), place))
        elif line:
            break
    else:
        raise BadFile(
            str(path), found="comments only", expected="a row of column names", remedy="Add a row such as `t,V`."
        )
    names, units = _columns(f"{path}, row {number}", line)
    _require(f"{path}, row {number}", names, required)
    data = lines[number:]
    return Sheet(path, tuple(entries), tuple(comments), names, units, number, _numbers(path, number, names, data), data)


def _columns(place: str, line: str) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """Names and units of the column row."""
    names, units = [], []
    for position, cell in enumerate(line.split(","), 1):
        found = _COLUMN.fullmatch(cell.strip())
        if found is None:
            raise BadFile(
                f"{place}, column {position}",
                found=f"the name {cell.strip()!r}",
                expected="`name` or `name [unit]`",
                remedy="Keep brackets for the unit.",
            )
        if not found[1]:
            raise BadFile(
                f"{place}, column {position}",
                found="an empty column name",
                expected="a name for every column",
                remedy="Name the column, or remove a comma too many.",
            )
        if found[1] in names:
            raise BadFile(
                f"{place}, column `{found[1]}`",
                found=f"the name twice, as columns {names.index(found[1]) + 1} and {position}",
                expected="every name once",
                remedy="Rename or remove one of them.",
            )
        names.append(found[1])
        units.append(None if found[2] is None else found[2].strip())
    return tuple(names), tuple(units)


def _require(place: str, names: Sequence[str], required: Sequence[str]) -> None:
    """Refuse a column row without the columns asked for."""
    missing = [name for name in required if name not in names]
    if not missing:
        return
    lone = len(names) == 1 and any(mark in names[0] for mark in ";\t ")
    near = [name for name in names if name.lower() in {word.lower() for word in missing}]
    if lone:
        remedy = "Separate the columns by commas."
    elif near:
        remedy = f"Rename `{near[0]}`; capitals count."
    else:
        remedy = f"Add a row of names such as `{','.join(required)}` above the numbers, or rename a column."
    raise BadName(
        place,
        found="the columns " + ", ".join(f"`{name}`" for name in names),
        expected=" and ".join(f"a column `{name}`" for name in missing),
        remedy=remedy,
    )


def _numbers(path: Path, row: int, names: Sequence[str], lines: Sequence[str]) -> Float[np.ndarray, "rows columns"]:
    """The numbers below the column row, all of them finite."""
    filled = [line for line in lines if line.strip()]
    if not filled:
        raise BadFile(
            str(path),
            found=f"no rows below the column row {row}",
            expected="rows of numbers",
            remedy="Check how the file was written.",
        )
    values, trouble = _parsed(filled)
    if values is None or values.shape[1] != len(names) or not np.all(np.isfinite(values)):
        _refuse(path, row, names, lines)
    if values is None:
        raise BadFile(str(path), found=trouble, expected="rows of numbers", remedy="Write the file as plain CSV.")
    return values


def _parsed(filled: list[str]) -> tuple[Float[np.ndarray, "rows columns"] | None, str]:
    """The numbers of lines that are not blank, or why there are none."""
    try:
        return np.loadtxt(filled, delimiter=",", comments=None, ndmin=2, dtype=float), ""
    except ValueError as error:
        return None, str(error)


def _is_sound(lines: Sequence[str], columns: int) -> bool:
    """Whether a stretch of lines holds nothing to refuse."""
    filled = [line for line in lines if line.strip()]
    if not filled:
        return True
    values, _ = _parsed(filled)
    return values is not None and values.shape[1] == columns and bool(np.all(np.isfinite(values)))


def _refuse(path: Path, row: int, names: Sequence[str], lines: Sequence[str]) -> None:
    """Find the first line or cell that is wrong, and raise for it."""
    starts = range(0, len(lines), STRETCH)
    start = next((at for at in starts if not _is_sound(lines[at : at + STRETCH], len(names))), 0)
    for number, line in enumerate(lines[start:], row + 1 + start):
        if not line.strip():
            continue
        if line.lstrip().startswith("#"):
            raise BadFile(
                f"{path}, row {number}",
                found="a `#` line among the numbers",
                expected="header lines above the column row",
                remedy="Move or remove it.",
            )
        cells = [cell.strip() for cell in line.split(",")]
        if len(cells) != len(names):
            raise BadFile(
                f"{path}, row {number}",
                found=f"{len(cells)} cells",
                expected=f"{len(names)}, one per column",
                remedy="Check for a missing cell, a comma at the end, or commas used as decimal points.",
            )
        for name, cell in zip(names, cells, strict=True):
            place = f"{path}, row {number}, column `{name}`"
            if NOT_FINITE.fullmatch(cell):
                raise BadValue(place, found=cell, expected="a finite number", remedy="Remove the row or the column.")
            if not NUMBER.fullmatch(cell):
                raise BadFile(
                    place,
                    found=f"{_short(cell)}" if cell else "an empty cell",
                    expected="a number such as 4.18 or 4.18e-3",
                    remedy="Correct the cell, or remove the row or the column.",
                )
            if not np.isfinite(float(cell)):
                raise BadValue(
                    place,
                    found=f"{_short(cell)}, which overflows",
                    expected="a finite number",
                    remedy="Remove the row or the column.",
                )


def _nth_filled(lines: Sequence[str], count: int) -> int:
    """Position of the `count`-th line that is not blank, from zero."""
    filled = (position for position, line in enumerate(lines) if line.strip())
    return next(islice(filled, count, None))


def _short(cell: str) -> str:
    return repr(cell if len(cell) <= 40 else cell[:37] + "...")


def _not_text(path: Path, raw: bytes, start: int) -> BadFile:
    line = raw.count(b"\n", 0, start) + 1
    return BadFile(
        f"{path}, row {line}",
        found=f"byte 0x{raw[start]:02x}, which is not text",
        expected="UTF-8 text",
        remedy="Save the file as CSV in UTF-8; spreadsheets and NumPy files must be exported first.",
    )


def _nearby(path: Path) -> str:
    """What to try when a file is missing."""
    if not path.parent.is_dir():
        return f"There is no folder {path.parent} either; check the path."
    try:
        names = [found.name for found in path.parent.iterdir()]
    except OSError:  # a folder that may be entered but not listed
        names = []
    near = difflib.get_close_matches(path.name, names)
    return f"Did you mean {', '.join(near)}?" if near else "Check the path."

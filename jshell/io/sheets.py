"""A file of columns as it stands: header entries, names with their units, numbers.

Nothing here knows physics or formats. A sheet remembers where each row stood,
so that whoever refuses a value later can say where it is.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from jshell.errors import BadFile
from jshell.io.files import brief, short

NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)  # one way to read it: no backtracking
SHOWN = 12  # names that a message lists at most
HALVES = re.compile("[\ud800-\udfff]")  # surrogates: JSON may spell them, no file can hold them
_COLUMN = re.compile(r"([^\[\]]*)(?:\[([^\[\]]*)\])?")
_ENTRY = re.compile(r"#\s*([^\W\d][\w.\-]*)\s*:(?!//)\s*(.*)")  # "# https://…" is a comment


@dataclass(frozen=True)
class Entry:
    """One `key: value` of a header or of a JSON object, and where it stood."""

    key: str
    value: str
    place: str


@dataclass(frozen=True)
class Even:
    """Times that a file tells instead of listing them.

    Attributes:
        start: First time [s].
        step: Between samples [s].
        words: Where it says so.
    """

    start: float
    step: float
    words: str


def _row(sample: int) -> str:
    return f"row {sample + 1}"


@dataclass(frozen=True)
class Sheet:
    """Columns of a file, read but not interpreted; or what a file is to hold.

    Attributes:
        file: Its name.
        entries: Its `key: value` pairs, in order.
        names: Column names without units.
        units: Unit of each column as written, None where there is none.
        columns: One (rows,) array per name, all finite.
        comments: `#` lines that are no entries, with their places.
        head: Where the names stand, such as `row 5`; empty where a format has no such place.
        row_of: Sample to the place of its row, such as `row 12`.
        places: Place of each column in the file, from 1.
        passed: Columns that are not read, in words.
        lines: Lines above the table that mean nothing here, and whose file it is.
        axis: The column that the others lie along, where the format says so.
        taken: What was taken for what, in words.
        even: Times, where the file tells start and step of them.
        pure: Columns whose numbers are dimensionless, as their reader said.
    """

    file: str
    entries: tuple[Entry, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    columns: tuple[np.ndarray, ...]
    comments: tuple[Entry, ...] = ()
    head: str = ""
    row_of: Callable[[int], str] = field(default=_row, repr=False)
    places: tuple[int, ...] = ()
    passed: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    axis: str = ""
    taken: tuple[str, ...] = ()
    even: Even | None = None
    pure: tuple[str, ...] = ()

    def place(self, name: str, sample: int | None = None) -> str:
        """Where a column, or one sample of it, stands."""
        row = self.head if sample is None else self.row_of(sample)
        return ", ".join(part for part in (self.file, row, f"column `{brief(name)}`") if part)


def entry(line: str, place: str) -> Entry | None:
    """The key and value of a header line; None for any other line."""
    found = _ENTRY.fullmatch(line.strip())
    return None if found is None else Entry(found[1], found[2].strip(), f"{place}, key `{found[1]}`")


def titles(place: str, cells: Sequence[str], first: int = 1) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """Names and units of columns written as `name` or `name [unit]`; the first of them stands in column `first`.

    Raises:
        BadFile: A name that is empty, that stands twice, or that brackets spoil.
    """
    names: dict[str, int] = {}
    units = []
    for position, cell in enumerate(cells, first):
        found = _COLUMN.fullmatch(cell.strip())
        if found is None:
            raise BadFile(
                f"{place}, column {position}",
                found=f"the name {short(cell.strip())}",
                expected="`name` or `name [unit]`",
                remedy="Keep brackets for the unit.",
            )
        name = found[1].rstrip()
        if not name:
            raise BadFile(
                f"{place}, column {position}",
                found="an empty column name",
                expected="a name for every column",
                remedy="Name the column, or remove a comma too many.",
            )
        if name in names:
            raise BadFile(
                f"{place}, column `{brief(name)}`",
                found=f"the name twice, as columns {names[name]} and {position}",
                expected="every name once",
                remedy="Rename or remove one of them.",
            )
        names[name] = position
        units.append(None if found[2] is None else found[2].strip())
    return tuple(names), tuple(units)


def title(name: str, unit: str | None) -> str:
    """A column's name as files spell it."""
    return name if unit is None else f"{name} [{unit}]"


def listed(names: Sequence[str]) -> str:
    """Names of columns, as a message lists them."""
    if not names:
        return "no columns"
    rest = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return "the columns " + ", ".join(f"`{brief(name)}`" for name in names[:SHOWN]) + rest

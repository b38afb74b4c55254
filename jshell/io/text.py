"""Columns in text: tables as spreadsheets, instruments and people write them.

`layout` finds the table, `titles` its names. NumPy reads plain numbers in one
go; what it cannot read, a walk through the lines does: gaps, times of day,
words beside numbers, decimal commas with thousands; and where that cannot
either, it places the refusal.
"""

import re
from array import array
from collections.abc import Iterator, Sequence
from itertools import chain, islice

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile, BadName, BadValue
from jshell.files import NamedBytes
from jshell.io.choices import Reading
from jshell.io.clock import TIME_NAMES
from jshell.io.files import read_text, short
from jshell.io.instruments import recognise
from jshell.io.layout import BLANKS, EMPTY, NUMBERS, TIMES, WORDS, Layout, is_comment, laid_out, lines, split
from jshell.io.notes import header_notes
from jshell.io.numerals import Marks, days, is_gap, marks_of, seconds
from jshell.io.sheets import Sheet, title
from jshell.io.titles import WORDS_OF_MARKS, Titles, found_titles, parted

STRETCH = 4096  # rows that are written at once
EVIDENCE = re.compile(r"\d[.' \u00a0\u202f’]\d{3},\d|\d[,' \u00a0\u202f’]\d{3}\.\d|\d([.,'])\d{3}\1\d{3}")


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a text file.

    Raises:
        BadFile: Not a file of columns: no text, no rows, ragged rows, repeated names, words for numbers.
        BadValue: A cell that is NaN or infinite, unless such rows are to be dropped.
    """
    try:
        layout = laid_out(file, choices.rows[0])
    except UnicodeDecodeError:
        read_text(file)  # says which byte is no text
        raise
    if layout is None:
        raise _no_rows(file)
    known = recognise(file, layout)
    titles = known.titles if known is not None and known.titles is not None else None
    titles = titles or found_titles(file.name, layout, by_place=choices.by_place)
    notes = header_notes(file.name, layout, titles)
    try:
        columns, row_of, marks = _columns(file, layout, titles, choices)
    except (BadFile, BadValue, UnicodeDecodeError):
        read_text(file)  # says which byte is no text
        raise
    kept = sorted(columns)
    said = (
        [] if marks.thousands == "" else [f"`{marks.thousands}` parts thousands, `{marks.decimal}` is the decimal mark"]
    )
    units = ["s" if layout.kinds[k] == TIMES else unit for k, unit in enumerate(titles.units)]
    for k in kept:
        bare = units[k] is None and titles.names[k] != "t" and TIME_NAMES.fullmatch(titles.names[k])
        if bare and known is not None and known.in_seconds:
            units[k] = "s"
            said.append(f"`{titles.names[k]}` in s, as {known.maker} writes it")
    return Sheet(
        file.name,
        notes.entries,
        tuple(titles.names[k] for k in kept),
        tuple(units[k] for k in kept),
        tuple(columns[k] for k in kept),
        notes.comments,
        "" if titles.line is None else f"row {titles.line}",
        row_of,
        places=tuple(k + 1 for k in kept),
        passed=_passed(layout, titles),
        lines=(*([] if known is None else [f"a file of {known.maker}"]), *notes.passed),
        taken=tuple(said),
        even=(None if known is None else known.even) or notes.even,
    )


def encode(sheet: Sheet, mark: str = ",") -> bytes:
    """Columns as text: all digits of the first, twelve of the others.

    Raises:
        BadName: A name that would be read as a name with its unit.
    """
    for name in sheet.names:
        if parted(name) != (name, None):
            raise BadName(
                f"trace, channel {name!r}",
                found="a name that reads as a name with its unit",
                expected="a name without one",
                remedy="Rename the channel, or write JSON.",
            )
    made = [f"# {item.key}: {item.value}" for item in sheet.entries]
    made.append(mark.join(title(name, unit) for name, unit in zip(sheet.names, sheet.units, strict=True)))
    row = mark.join(["%r", *["%.12g"] * (len(sheet.columns) - 1)]) + "\n"
    table = np.stack(sheet.columns, axis=1)
    text = ["\n".join(made) + "\n"]
    for start in range(0, len(table), STRETCH):  # a large table never stands here as Python's own numbers
        text.append("".join(row % tuple(numbers) for numbers in table[start : start + STRETCH].tolist()))
    return "".join(text).encode()


def _no_rows(file: NamedBytes) -> BadFile:
    """Why a text holds no table."""
    filled = [(n, line) for n, line in enumerate(read_text(file).split("\n"), 1) if line.strip()]
    plain = [number for number, line in filled if not is_comment(line)]
    if not plain:
        remedy = "Add a row such as `t,V`, and the numbers below it."
        return BadFile(file.name, found="comments only", expected="a row of column names", remedy=remedy)
    return BadFile(
        file.name,
        found=f"no rows below the column row {plain[0]}",
        expected="rows of numbers",
        remedy="Check how the file was written.",
    )


def _passed(layout: Layout, titles: Titles) -> tuple[str, ...]:
    """Columns that hold words, or nothing under a name."""
    names = [f"`{titles.names[k]}`" if titles.names[k] else f"{k + 1}" for k in range(len(layout.kinds))]
    words = [f"column {names[k]} of words" for k, kind in enumerate(layout.kinds) if kind == WORDS]
    return (
        *words,
        *(f"column {names[k]}, empty" for k, kind in enumerate(layout.kinds) if kind == EMPTY and titles.names[k]),
    )


def _columns(file: NamedBytes, layout: Layout, titles: Titles, choices: Reading):
    """The columns of numbers by their places from zero, where each row stands, and how numbers are written."""
    first, last = layout.start, choices.rows[1]
    if all(kind == NUMBERS for kind in layout.kinds):
        table, marks = _plain(file, layout, first, last)
        if table is not None and np.all(np.isfinite(table)):
            row_of = lambda sample: f"row {_nth_row(file, first, sample)}"  # noqa: E731
            return dict(enumerate(table.T)), row_of, marks
    marks = marks_of(_telling(file, layout))
    walk = _Walk(file.name, layout, titles, marks, choices.missing == "drop")
    rows = [number for number, line in _rows(file, first, last) if walk.take(number, line)]
    if not rows:
        raise BadFile(
            f"{file}, row {first}",
            found="no complete row from here on",
            expected="rows of numbers",
            remedy="Check `--rows` and which columns are read.",
        )
    return walk.columns(), lambda sample: f"row {rows[sample]}", marks


def _rows(file: NamedBytes, first: int, last: int | None) -> Iterator[tuple[int, str]]:
    """Number and text of the lines from the first row to the last that are not blank."""
    stop = None if last is None else max(last - first + 1, 0)
    return ((n, line) for n, line in enumerate(islice(lines(file, first - 1), stop), first) if not line.isspace())


def _plain(file: NamedBytes, layout: Layout, first: int, last: int | None):
    """All numbers at once, by NumPy; None where it cannot."""
    mark = None if layout.mark == BLANKS else layout.mark
    for decimal in (".",) if mark == "," else (".", ","):
        found = (line for _, line in _rows(file, first, last))
        found = map(_pointed, found) if decimal == "," else found
        try:
            begin = next(found)
            table = np.loadtxt(
                chain([begin], found), delimiter=mark, comments=None, ndmin=2, dtype=float, quotechar='"'
            )
        except (ValueError, StopIteration):
            continue
        if table.shape[1] == len(layout.kinds):
            return table, Marks(decimal)
    return None, Marks()


def _pointed(line: str) -> str:
    """A line with points for its decimal commas."""
    if "." in line:
        raise ValueError("a decimal point among decimal commas")
    return line.replace(",", ".")


def _telling(file: NamedBytes, layout: Layout) -> Iterator[str]:
    """Cells that may show how numbers are written: those that hold both marks first."""
    here = [k for k, kind in enumerate(layout.kinds) if kind == NUMBERS]
    cells = lambda line: (cell for k, cell in enumerate(split(line, layout.mark)) if k in here)  # noqa: E731
    for _, line in _rows(file, layout.start, None):
        if EVIDENCE.search(line):
            yield from (cell for cell in cells(line) if EVIDENCE.search(cell))
    for _, line in islice(_rows(file, layout.start, None), STRETCH):
        yield from cells(line)


def _nth_row(file: NamedBytes, first: int, count: int) -> int:
    """Line of the `count`-th row, from zero."""
    return next(islice(_rows(file, first, None), count, None))[0]


class _Walk:
    """Rows taken one by one; the first that is wrong is refused at its place."""

    def __init__(self, file: str, layout: Layout, titles: Titles, marks: Marks, dropping: bool) -> None:
        self.file, self.layout, self.titles, self.marks, self.dropping = file, layout, titles, marks, dropping
        self.taken = [k for k, kind in enumerate(layout.kinds) if kind in (NUMBERS, TIMES)]
        self.values = {k: array("d") for k in self.taken}
        self.needed = 1 + max(self.taken)
        self.first_day: int | None = None
        self.dates: set[str] = set()

    def take(self, number: int, line: str) -> bool:
        """Take a row; whether it was read."""
        cells = split(line, self.layout.mark)
        width = len(self.layout.kinds)
        while len(cells) > width and not cells[-1]:
            cells.pop()
        if not self.needed <= len(cells) <= width:
            self._refuse_count(number, line, cells)
        for k in range(self.needed, len(cells)):
            if cells[k] and self.layout.kinds[k] == EMPTY and not self.titles.names[k]:
                self._refuse_count(number, line, cells)
        found: list[float] = []
        for k in self.taken:
            cell = cells[k]
            value = self._clock(number, k, cell) if self.layout.kinds[k] == TIMES else self.marks.number(cell)
            if value is None or value - value != 0:
                value = self._gap(number, k, line, cell, value)
            found.append(value)
        for k, value in zip(self.taken, found, strict=True):
            self.values[k].append(value)
        return True

    def columns(self) -> dict[int, Float[np.ndarray, " rows"]]:
        """The columns taken, by place; times of day in seconds since the first."""
        found = {k: np.frombuffer(values) for k, values in self.values.items()}
        for k in self.taken:
            if self.layout.kinds[k] == TIMES:
                found[k] = found[k] - found[k][np.isfinite(found[k])][0]
        return found

    def _place(self, number: int, k: int) -> str:
        name = self.titles.names[k]
        return f"{self.file}, row {number}, column " + (f"`{name}`" if name else f"{k + 1}")

    def _clock(self, number: int, k: int, cell: str) -> float | None:
        """Seconds of a time of day since midnight of the first day."""
        found = seconds(cell)
        if found is None:
            return None
        date, time = found
        if not date:
            return time
        day = days(date)
        if day is None:
            self.dates.add(date)
            if len(self.dates) == 1:
                return time  # one date throughout: it does not matter which
            raise BadFile(
                self._place(number, k),
                found=f"{short(cell)}, a date whose day and month could be taken for each other",
                expected="a date such as 2024-05-23",
                remedy="Write dates with the year first, or use `--rate` and leave this column out.",
            )
        self.first_day = day if self.first_day is None else self.first_day
        return 86400.0 * (day - self.first_day) + time

    def _gap(self, number: int, k: int, line: str, cell: str, value: float | None) -> float:
        """NaN for a cell that holds nothing, where such rows are to be dropped; else a refusal."""
        place = self._place(number, k)
        if is_gap(cell) or value is not None:
            if self.dropping and value is None:
                return np.nan
            leave = "Correct it, or leave such rows out: `--missing drop`."
            if value is not None:
                raise BadValue(place, found=f"{short(cell)}, which overflows", expected="a finite number", remedy=leave)
            if cell == "" or not re.fullmatch(r"[+−-]?(nan|inf|infinity|∞)", cell, re.IGNORECASE):
                found = short(cell) if cell else "an empty cell"
                raise BadFile(place, found=found, expected="a number such as 4.18 or 4.18e-3", remedy=leave)
            raise BadValue(place, found=cell, expected="a finite number", remedy=leave)
        if is_comment(line, self.layout.mark):
            raise BadFile(
                f"{self.file}, row {number}",
                found=f"a `{line.strip()[0]}` line among the numbers",
                expected="header lines above the column row",
                remedy=f"Move or remove it; or read rows on one side of it: `--rows {number + 1}:`.",
            )
        other = "." if self.marks.decimal == "," else ","
        if self.layout.mark != "," and other in cell and self.layout.kinds[k] == NUMBERS:
            raise BadFile(
                place,
                found=f"{short(cell)}, while the numbers above have `{self.marks.decimal}` for a decimal mark",
                expected=f"a number such as 4{self.marks.decimal}18",
                remedy="Use one decimal mark in the whole file, and a mark of thousands in none.",
            )
        raise BadFile(
            place,
            found=short(cell),
            expected="a number such as 4.18 or 4.18e-3",
            remedy=f"Correct the cell, or end above it: `--rows :{number - 1}`.",
        )

    def _refuse_count(self, number: int, line: str, cells: Sequence[str]) -> None:
        mark, width = self.layout.mark, self.layout.width
        if is_comment(line, mark):
            self._gap(number, self.taken[0], line, "#", None)
        others = [other for other in (",", ";", "\t") if other != mark and other in line]
        remedy = "Check for a missing cell, a comma at the end, or commas used as decimal points."
        if others and mark not in line:
            remedy = f"The rows above are separated by {WORDS_OF_MARKS[mark]}: separate all alike."
        raise BadFile(
            f"{self.file}, row {number}",
            found=f"{len(cells)} cells",
            expected=f"{width}, one per column",
            remedy=f"{remedy} To end above it: `--rows :{number - 1}`.",
        )

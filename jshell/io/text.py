"""Columns in text: tables as spreadsheets, instruments and people write them.

`layout` finds the table, `titles` its names. NumPy reads plain numbers in one
go; what it cannot read, a walk through the lines does: gaps, times of day,
words beside numbers, decimal commas with thousands; and where that cannot
either, it places the refusal.
"""

import re
from collections.abc import Iterator, Sequence
from itertools import chain, islice

import numpy as np

from jshell.errors import BadFile, BadName, BadValue
from jshell.files import NamedBytes
from jshell.io.choices import Reading
from jshell.io.clock import TIME_NAMES
from jshell.io.files import in_utf8, read_text
from jshell.io.instruments import recognise
from jshell.io.layout import BLANKS, EMPTY, NUMBERS, TIMES, WORDS, Layout, is_comment, laid_out, lines, split
from jshell.io.notes import header_notes
from jshell.io.numerals import Marks, marks_of
from jshell.io.sheets import Sheet, title
from jshell.io.titles import Titles, found_titles, parted
from jshell.io.walk import Walk

STRETCH = 4096  # rows that are written at once
EVIDENCE = re.compile(r"\d[.' \u00a0\u202f’]\d{3},\d|\d[,' \u00a0\u202f’]\d{3}\.\d|\d([.,'])\d{3}\1\d{3}")


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a text file.

    Raises:
        BadFile: Not a file of columns: no text, no rows, ragged rows, repeated names, words for numbers.
        BadValue: A cell that is NaN or infinite, unless such rows are to be dropped.
    """
    file, encoded = in_utf8(file)
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
    if encoded is not None:
        said.append(encoded)
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
    walk = Walk(file.name, layout, titles, marks, choices.missing == "drop")
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
    commas = layout.mark == ","  # then a number holds one only within quotes
    for _, line in _rows(file, layout.start, None):
        if (not commas or '"' in line) and EVIDENCE.search(line):
            yield from (cell for cell in cells(line) if EVIDENCE.search(cell))
    for _, line in islice(_rows(file, layout.start, None), STRETCH):
        yield from cells(line)


def _nth_row(file: NamedBytes, first: int, count: int) -> int:
    """Line of the `count`-th row, from zero."""
    return next(islice(_rows(file, first, None), count, None))[0]

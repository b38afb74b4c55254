"""Columns in text: CSV and its cousins with semicolons, tabs and decimal commas.

NumPy reads the numbers in one go; the slow walk through the lines happens only
to place an error. The row of names tells the separator.
With semicolons or tabs the decimal mark may be a comma, then in every cell.
"""

import io as streams
import re
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile, BadValue
from jshell.files import NamedBytes
from jshell.io.files import read_text, short
from jshell.io.sheets import NUMBER, SEPARATORS, Entry, Sheet, entry, require, title, titles

STRETCH = 4096  # lines passed over at once on the way to an error
MOST = 100_000  # lines of a header
LONGEST = 200_000  # characters of a header line or of the row of names
NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_BRACKETS = re.compile(r"\[[^\[\]]*\]")


def read(file: NamedBytes, required: Sequence[str] = ()) -> Sheet:
    """Columns of a text file.

    Raises:
        BadFile: Not a file of columns: no text, no rows, ragged rows, unnamed or repeated columns, words for numbers.
        BadName: A required column is missing.
        BadValue: A cell that is NaN or infinite.
    """
    entries, comments = [], []
    try:
        for number, line in enumerate(_lines(file), 1):
            place = f"{file}, row {number}"
            if "\0" in line or len(line) > LONGEST:
                read_text(file)  # says which byte is no text
                raise BadFile(
                    place,
                    found=f"a line of more than {LONGEST} characters",
                    expected="header lines and a row of names",
                    remedy="Check how the file was written.",
                )
            if number > MOST:
                raise BadFile(
                    place,
                    found=f"more than {MOST} lines of header",
                    expected="a row of column names",
                    remedy="Keep long notes in a file of their own.",
                )
            bare = line.strip()
            found = entry(bare, place)
            if found is not None:
                entries.append(found)
            elif bare.startswith("#"):
                comments.append(Entry("", bare[1:].strip(), place))
            elif bare:
                break
        else:
            read_text(file)  # says if there is no text at all
            raise BadFile(
                file.name, found="comments only", expected="a row of column names", remedy="Add a row such as `t,V`."
            )
    except UnicodeDecodeError:
        read_text(file)
        raise
    mark = _separator(place, line)
    names, units = titles(place, line.rstrip("\n").split(mark))
    require(place, names, required)
    columns = tuple(_numbers(file, number, names, mark).T)
    row_of = lambda sample: f"row {_nth_filled(file, number, sample)}"  # noqa: E731
    return Sheet(file.name, tuple(entries), names, units, columns, tuple(comments), f"row {number}", row_of)


def encode(sheet: Sheet, mark: str = ",") -> bytes:
    """Columns as text: all digits of the first, twelve of the others."""
    lines = [f"# {item.key}: {item.value}" for item in sheet.entries]
    lines.append(mark.join(title(name, unit) for name, unit in zip(sheet.names, sheet.units, strict=True)))
    row = mark.join(["%r", *["%.12g"] * (len(sheet.columns) - 1)]) + "\n"
    table = np.stack(sheet.columns, axis=1)
    made = ["\n".join(lines) + "\n"]
    for start in range(0, len(table), STRETCH):  # a large table never stands here as Python's own numbers
        made.append("".join(row % tuple(numbers) for numbers in table[start : start + STRETCH].tolist()))
    return "".join(made).encode()


def _lines(file: NamedBytes, skip: int = 0) -> Iterator[str]:
    """The lines of a file below the first few, whatever their ends."""
    with streams.TextIOWrapper(streams.BytesIO(file.content), encoding="utf-8-sig", newline=None) as lines:
        yield from islice(lines, skip, None)


def _separator(place: str, line: str) -> str:
    """What stands between the names; units in brackets do not count."""
    bare = _BRACKETS.sub("", line.rstrip("\n"))
    marks = [mark for mark in SEPARATORS if mark in bare]
    if len(marks) > 1:
        raise BadFile(
            place,
            found=" and ".join(SEPARATORS[mark] for mark in marks) + " between the names",
            expected="one separator",
            remedy="Separate all columns alike.",
        )
    return marks[0] if marks else ","


def _numbers(file: NamedBytes, row: int, names: Sequence[str], mark: str) -> Float[np.ndarray, "rows columns"]:
    """The numbers below the row of names, all of them finite."""
    values, trouble = _parsed(_filled(file, row), mark)
    if values is None and mark != ",":
        values, _ = _parsed(map(_pointed, _filled(file, row)), mark)
    if values is None or values.shape != (len(values), len(names)) or not np.all(np.isfinite(values)):
        _refuse(file, row, names, mark)
        raise BadFile(file.name, found=trouble, expected="rows of numbers", remedy="Write the file as plain CSV.")
    return values


def _filled(file: NamedBytes, row: int) -> Iterator[str]:
    return (line for line in _lines(file, row) if not line.isspace())


def _pointed(line: str) -> str:
    """A line with points for its decimal commas."""
    if "." in line:
        raise ValueError("a decimal point among decimal commas")
    return line.replace(",", ".")


def _parsed(lines: Iterator[str], mark: str) -> tuple[Float[np.ndarray, "rows columns"] | None, str]:
    """The numbers of lines that are not blank, or why there are none."""
    try:
        first = next(lines, None)
        if first is None:
            return None, "no rows"
        return np.loadtxt(_with_first(first, lines), delimiter=mark, comments=None, ndmin=2, dtype=float), ""
    except ValueError as error:
        return None, str(error)


def _with_first(first: str, lines: Iterator[str]) -> Iterator[str]:
    yield first
    yield from lines


def _is_sound(lines: Sequence[str], columns: int, mark: str, comma: bool) -> bool:
    """Whether a stretch of lines holds nothing to refuse."""
    filled = [line for line in lines if line.strip()]
    if not filled:
        return True
    values, _ = _parsed(map(_pointed, filled) if comma else iter(filled), mark)
    return values is not None and values.shape[1] == columns and bool(np.all(np.isfinite(values)))


def _refuse(file: NamedBytes, row: int, names: Sequence[str], mark: str) -> None:
    """Find the first line or cell that is wrong, and raise for it."""
    lines = read_text(file).split("\n")[row:]
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        raise BadFile(
            file.name,
            found=f"no rows below the column row {row}",
            expected="rows of numbers",
            remedy="Check how the file was written.",
        )
    mixed = mark != "," and _first_marks(lines)
    starts = range(0, len(lines), STRETCH)
    sound = lambda at: _is_sound(lines[at : at + STRETCH], len(names), mark, mixed == ",")  # noqa: E731
    start = next((at for at in starts if not sound(at)), 0)
    for number, line in enumerate(lines[start:], row + 1 + start):
        if line.strip():
            _check_line(f"{file}, row {number}", line, names, mark, str(mixed or "."))


def _first_marks(lines: Sequence[str]) -> str:
    """The decimal mark that the first number with one has."""
    found = next((found for found in map(re.compile("[.,]").search, lines) if found is not None), None)
    return "." if found is None else found[0]


def _check_line(place: str, line: str, names: Sequence[str], mark: str, decimal: str) -> None:
    if line.lstrip().startswith("#"):
        raise BadFile(
            place,
            found="a `#` line among the numbers",
            expected="header lines above the column row",
            remedy="Move or remove it.",
        )
    cells = [cell.strip() for cell in line.split(mark)]
    if len(cells) != len(names):
        others = [other for other in SEPARATORS if other != mark and other in line]
        remedy = "Check for a missing cell, a comma at the end, or commas used as decimal points."
        if others and mark not in line:
            remedy = f"The names are separated by {SEPARATORS[mark]}: separate the numbers alike."
        raise BadFile(place, found=f"{len(cells)} cells", expected=f"{len(names)}, one per column", remedy=remedy)
    for name, cell in zip(names, cells, strict=True):
        where = f"{place}, column `{name}`"
        other = "." if decimal == "," else ","
        if NOT_FINITE.fullmatch(cell):
            raise BadValue(where, found=cell, expected="a finite number", remedy="Remove the row or the column.")
        if mark != "," and other in cell:
            raise BadFile(
                where,
                found=f"{short(cell)}, while the numbers above have `{decimal}` for a decimal mark",
                expected=f"a number such as 4{decimal}18",
                remedy="Use one decimal mark in the whole file, and none for thousands.",
            )
        pointed = cell.replace(",", ".") if mark != "," else cell
        if not NUMBER.fullmatch(pointed):
            raise BadFile(
                where,
                found=f"{short(cell)}" if cell else "an empty cell",
                expected="a number such as 4.18 or 4.18e-3",
                remedy="Correct the cell, or remove the row or the column.",
            )
        if not np.isfinite(float(pointed)):
            raise BadValue(
                where,
                found=f"{short(cell)}, which overflows",
                expected="a finite number",
                remedy="Remove the row or the column.",
            )


def _nth_filled(file: NamedBytes, row: int, count: int) -> int:
    """Line number of the `count`-th line below the names that is not blank, both from zero."""
    filled = (number for number, line in enumerate(_lines(file, row), row + 1) if not line.isspace())
    return next(islice(filled, count, None))

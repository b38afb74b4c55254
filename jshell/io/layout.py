"""Where the table of a text file begins, and how it is laid out: the numbers decide.

Lines from the file's second half tell the separator, the number of cells and
which columns hold numbers, times of day, words or nothing. The first line of
that form is the first row; what stands above it is names, units, comments and
notes of the instrument. A line above that looks like a spoiled row is refused,
never taken for a header.

Source     RFC 4180 for quotes
"""

import csv
import io as streams
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from jshell.errors import BadFile
from jshell.files import NamedBytes
from jshell.io.files import read_text
from jshell.io.numerals import is_gap, is_number, is_time

BLANKS = " "
MARKS = (",", ";", "\t", "|", BLANKS)
NUMBERS, TIMES, WORDS, EMPTY = "numbers", "times", "words", "empty"
LABVIEW = b"LabVIEW Measurement"
LONGEST = 200_000  # characters of a line
MOST = 100_000  # lines above the numbers
SAMPLE = 1 << 16  # bytes that are looked at
ENOUGH = 200  # lines of the sample
_SEP = re.compile(r"\"?sep=(.)\"?[,;\t]*", re.IGNORECASE)
_ENDS = re.compile(r"\r\n|\n|\r")
_PIECES = re.compile(r'"[^"]*"|\S+')
COMMENTS = ("#", "%", "//", "!")


@dataclass(frozen=True)
class Layout:
    """The form of a table.

    Attributes:
        mark: What separates the cells; `BLANKS` for any number of blanks.
        kinds: What each column holds.
        start: Line of the first row, from 1.
        above: Number and text of the lines above it, blank ones left out.
    """

    mark: str
    kinds: tuple[str, ...]
    start: int
    above: tuple[tuple[int, str], ...]

    @property
    def width(self) -> int:
        """Cells of a row, without those at its end that are always empty."""
        return max((k for k, kind in enumerate(self.kinds, 1) if kind != EMPTY), default=0)


def lines(file: NamedBytes, skip: int = 0) -> Iterator[str]:
    """The lines of a file below the first few, whatever their ends."""
    with streams.TextIOWrapper(streams.BytesIO(file.content), encoding="utf-8-sig", newline=None) as found:
        yield from islice(found, skip, None)


def split(line: str, mark: str) -> list[str]:
    """The cells of a line, bare."""
    if mark == BLANKS:
        return [piece.strip('"') for piece in _PIECES.findall(line)]
    if '"' in line:
        found = next(csv.reader([line], delimiter=mark, skipinitialspace=True), [])
        return [cell.strip() for cell in found]
    return [cell.strip() for cell in line.split(mark)]


def is_comment(line: str, mark: str = "") -> bool:
    """Whether a line is a comment; `;` begins one where it is no separator."""
    bare = line.lstrip().lstrip('"')
    return bare.startswith(COMMENTS) or (bare.startswith(";") and mark != ";")


def laid_out(file: NamedBytes, first: int | None = None) -> Layout | None:
    """How the table of a text file is laid out; None where no line holds numbers.

    Args:
        file: Name and bytes.
        first: The row that is read first, where the reader was told.

    Raises:
        BadFile: No text; lines without end; too long a header.
    """
    sample = _sample(file)
    for number, line in enumerate(lines(file) if not sample else (), 1):
        _check_line(file, number, line)
    given = _SEP.fullmatch(next((line for line in lines(file) if line.strip()), "").strip())
    marks = MARKS if given is None else (given[1],)
    found = max((_form(sample, mark) for mark in marks), key=lambda one: one[0])
    if found[0][0] == 0:
        return None
    mark, kinds = found[1], found[2]
    above: list[tuple[int, str]] = []
    head = _labview_head(file)
    for number, line in enumerate(lines(file), 1):
        if line[0] == "#" and len(line) <= LONGEST and number <= MOST and "\0" not in line:
            above.append((number, line.strip("\n")))
            continue
        _check_line(file, number, line)
        bare = line.strip("\n")
        if not bare.strip() or _SEP.fullmatch(bare.strip()):
            continue
        if number > head and not is_comment(bare, mark) and is_row(split(bare, mark), kinds):
            return Layout(mark, kinds, number if first is None else max(first, number), tuple(above))
        above.append((number, bare))
    return None


def _labview_head(file: NamedBytes) -> int:
    """The line that ends the second head of a LabVIEW file, whose keys have numbers beside them; 0 of any other."""
    found = (
        list(islice(lines(file), 100)) if bytes(file.content[:200]).lstrip(b"\xef\xbb\xbf").startswith(LABVIEW) else []
    )
    ends = [number for number, line in enumerate(found, 1) if line.startswith("***End_of_Header***")]
    return ends[1] if len(ends) > 1 else 0


def _check_line(file: NamedBytes, number: int, line: str) -> None:
    """Refuse lines above the numbers that no table has."""
    if len(line) > LONGEST or "\0" in line:
        read_text(file)  # says which byte is no text
        raise BadFile(
            f"{file}, row {number}",
            found=f"a line of more than {LONGEST} characters",
            expected="lines of a table",
            remedy="Check how the file was written.",
        )
    if number > MOST:
        raise BadFile(
            f"{file}, row {number}",
            found=f"more than {MOST} lines above the numbers",
            expected="a table of numbers",
            remedy="Keep long notes in a file of their own.",
        )


def is_row(cells: Sequence[str], kinds: Sequence[str]) -> bool:
    """Whether cells have the form of a row: numbers where numbers belong, at least one, and no cell too many."""
    if any(cells[len(kinds) :]) or len(cells) < len(kinds) - kinds[::-1].index(
        next(k for k in kinds[::-1] if k != EMPTY)
    ):
        return False
    seen, gaps, beside = False, False, False
    for cell, kind in zip(cells, kinds, strict=False):
        good = is_number(cell) if kind == NUMBERS else is_time(cell) if kind == TIMES else True
        if not good and not is_gap(cell):
            return False
        gaps |= not good
        beside |= kind == EMPTY and bool(cell)
        seen |= good and kind in (NUMBERS, TIMES)
    # a key with its value, above a table whose column of that place is empty, leaves others without numbers
    return seen and not (gaps and beside)


def _sample(file: NamedBytes) -> list[str]:
    """Lines of the file below its first third or half, the last one among them, and no comments."""
    content = file.content
    half = len(content) // 2
    if len(content) < SAMPLE:
        found = _filled(content)
        return _bare(found[len(found) // 3 :])[:ENOUGH]
    middle, end = content[half : half + SAMPLE], content[max(half, len(content) - SAMPLE // 4) :]
    return [*_bare(_filled(middle)[1:-1])[:ENOUGH], *_bare(_filled(end)[1:])[:ENOUGH]]


def _filled(content: bytes | memoryview) -> list[str]:
    text = bytes(content).decode("utf-8", "replace").lstrip("\ufeff")
    return [line for line in _ENDS.split(text) if line.strip() and len(line) <= LONGEST]


def _bare(listed: list[str]) -> list[str]:
    return [line for line in listed if not line.lstrip().startswith("#")]


def _form(sample: Sequence[str], mark: str) -> tuple[tuple[float, ...], str, tuple[str, ...]]:
    """How well a separator explains the lines, the separator, and what its columns hold."""
    rows = [split(line, mark) for line in sample]
    counts = Counter(len(row) for row in rows if any(is_number(cell) or is_time(cell) for cell in row))
    if not counts:
        return (0.0,), mark, ()
    width = max(counts, key=lambda size: (counts[size], size))
    rows = [row for row in rows if len(row) == width and any(is_number(cell) or is_time(cell) for cell in row)]
    kinds = tuple(_kind([row[k] for row in rows]) for k in range(width))
    filled = [cell for row in rows for cell in row if cell]
    good = sum(is_number(cell) or is_time(cell) or is_gap(cell) for cell in filled)
    # most lines explained, then most cells numbers, then most columns; a single column is weak evidence of a separator
    share = good / max(len(filled), 1)
    columns = sum(kind in (NUMBERS, TIMES) for kind in kinds)
    explained = len(rows) / len(sample) * (columns > 0) * (1.0 if width > 1 else 0.3)
    return (explained, round(share, 2), float(columns)), mark, kinds


def _kind(cells: Sequence[str]) -> str:
    """What a column holds, by most of its cells that are filled."""
    filled = [cell for cell in cells if cell]
    if not filled:
        return EMPTY
    numbers = sum(map(is_number, filled))
    times = sum(map(is_time, filled))
    gaps = sum(map(is_gap, filled))
    if 2 * times > len(filled) - gaps:
        return TIMES
    return NUMBERS if numbers and 2 * numbers >= len(filled) - gaps else EMPTY if gaps == len(filled) else WORDS

"""The names of a table's columns, with their units, from the lines that stand above its numbers.

Names may fill one row or several; units stand behind them, in brackets or after
a comma, or in a row of their own. `[…]` is always a unit; what `(…)`, `, …`,
` in …` and ` / …` hold is one only where it is known as such.

Source     the column rows of oscilloscopes, LabVIEW, Tracker, ImageJ, DeepLabCut and phyphox
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from jshell.errors import BadFile
from jshell.io.files import short
from jshell.io.layout import BLANKS, EMPTY, NUMBERS, TIMES, Layout, is_comment, split
from jshell.io.numerals import is_gap, is_number
from jshell.io.sheets import titles
from jshell.io.units import is_common, is_unit

WORDS_OF_MARKS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
COMMENT = "comment"  # LabVIEW's last name, which stands over nothing
_MOST = 6  # rows of names that one table may have
_LONGEST = 200  # characters of a name that may hide a unit
_BEHIND = (
    re.compile(r"(?P<name>.*\S)\s*\((?P<unit>[^()]+)\)"),
    re.compile(r"(?P<name>.*\S),\s*(?P<unit>[^,]+)"),
    re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S+)"),
    re.compile(r"(?P<name>.*\S)\s*/\s*(?P<unit>\S+)"),
)


@dataclass(frozen=True)
class Titles:
    """Names and units of the columns of a table, and where they stand.

    Attributes:
        names: One per column of the layout, empty where it has none.
        units: The same; None where none is written.
        line: Where the names stand; None where the table has none.
        first: The highest line that belongs to them.
    """

    names: tuple[str, ...]
    units: tuple[str | None, ...]
    line: int | None
    first: int | None


def found_titles(file: str, layout: Layout, *, by_place: bool = False) -> Titles:
    """The names above a table.

    Args:
        file: Its name, for messages.
        layout: Where the numbers begin.
        by_place: Whether the reader names the columns by place: then names that do not fit are passed over.

    Raises:
        BadFile: More or fewer names than columns; a spoiled row of numbers; a name twice, or with odd brackets.
    """
    plain = [(number, line) for number, line in layout.above if not is_comment(line, layout.mark)]
    rows: list[tuple[int, list[str]]] = []
    for number, text in reversed(plain):
        cells = split(text, layout.mark)
        fitted = _fitted(cells, layout)
        if fitted is None and layout.mark == BLANKS:  # names with blanks inside stand further apart
            fitted = _fitted(re.split(r"\s{2,}|\t", text.strip()), layout)
        if fitted is None or (not rows and _looks_like_a_row(file, number, cells, fitted, layout)):
            if not rows and not by_place:
                _refuse(file, number, cells, layout)
            break
        rows.append((number, fitted))
        if len(rows) == _MOST or (_complete(fitted, layout) and not _are_units(fitted)):
            break
    if not rows:
        return Titles(("",) * len(layout.kinds), (None,) * len(layout.kinds), None, None)
    below: list[str] | None = None
    if len(rows) > 1 and _are_units(rows[0][1]):
        below, rows = rows[0][1], rows[1:]
    line = rows[0][0]
    names = _joined([cells for _, cells in rows], layout)
    place = f"{file}, row {line}"
    shown = [k for k, kind in enumerate(layout.kinds) if kind != EMPTY or names[k]]
    parts = [parted(name) for name in names]
    for k in shown:
        if layout.kinds[k] in (NUMBERS, TIMES) and names[k] and not by_place:
            titles(place, [names[k]], k + 1)  # brackets
    units = [part[1] if below is None or not below[k] else _bare(below[k]) for k, part in enumerate(parts)]
    return Titles(tuple(part[0] for part in parts), tuple(units), line, rows[-1][0])


def _fitted(cells: list[str], layout: Layout) -> list[str] | None:
    """The cells of a line, one per column; None where they are not as many."""
    wanted = layout.width
    bare = list(cells)
    while len(bare) > wanted and not bare[-1]:  # what a spreadsheet puts behind
        bare.pop()
    if layout.mark == BLANKS and len(bare) > wanted:
        together: list[str] = []
        for cell in bare:  # `Time (s)` is one name
            if together and re.fullmatch(r"[\[(].*[\])]", cell):
                together[-1] += f" {cell}"
            else:
                together.append(cell)
        bare = together
    if len(bare) == wanted + 1 and bare[-1].lower() == COMMENT:
        bare.pop()
    size = len(layout.kinds)
    if len(bare) < wanted and len(cells) == size:
        bare += [""] * (wanted - len(bare))
    return bare + [""] * (size - len(bare)) if wanted <= len(bare) <= size else None


def _looks_like_a_row(file: str, number: int, cells: list[str], fitted: list[str], layout: Layout) -> bool:
    """Whether the line above the first row holds numbers: a spoiled row is refused, a note has none beside words."""
    here = [(k, cell) for k, cell in enumerate(fitted) if layout.kinds[k] in (NUMBERS, TIMES)]
    numbers = [k for k, cell in here if is_number(cell)]
    if not numbers:
        return False
    words = [(k, cell) for k, cell in here if k not in numbers and not is_gap(cell)]
    if words:
        raise BadFile(
            f"{file}, row {number}, column {words[0][0] + 1}",
            found=f"{short(words[0][1])} beside numbers, right above the table",
            expected="names of columns, or a row of numbers such as 4.18 or 4.18e-3",
            remedy=f"Correct the cell; or begin below it: `--rows {layout.start}:`, with `--columns t=1,V=2`.",
        )
    return True


def _refuse(file: str, number: int, cells: list[str], layout: Layout) -> None:
    """Refuse names that are not as many as the columns."""
    bare = [cell for cell in cells if cell]
    width = layout.width
    if len(bare) < 2 and not any(mark in " ".join(bare) for mark in WORDS_OF_MARKS):
        return  # a word alone, such as `Data:`, names nothing
    others = [mark for mark in (",", ";", "\t") if mark != layout.mark and any(mark in cell for cell in bare)]
    own = layout.mark in layout.above[-1][1]
    remedy = f"Name every column, or name them by place: `--columns t=1,{'V=2' if width > 1 else '…'}`."
    found = f"{len(cells)} names over {width} columns of numbers"
    if others and own:
        both = sorted((layout.mark, others[0]), key=list(WORDS_OF_MARKS).index)
        found = " and ".join(WORDS_OF_MARKS[mark] for mark in both) + " between the names"
        remedy = f"Separate all columns alike. {remedy}"
    elif others:
        found = (
            f"names separated by {WORDS_OF_MARKS[others[0]]} over numbers separated by {WORDS_OF_MARKS[layout.mark]}"
        )
    elif layout.mark == "," and width == 2 * len(bare):
        remedy = f"Commas used as decimal points need another separator: write `;` between the columns. {remedy}"
    raise BadFile(f"{file}, row {number}", found=found, expected="one name per column", remedy=remedy)


def _complete(cells: Sequence[str], layout: Layout) -> bool:
    """Whether every column of numbers has a name of its own."""
    names = [cell for cell, kind in zip(cells, layout.kinds, strict=True) if kind in (NUMBERS, TIMES)]
    return all(names) and len(set(names)) == len(names)


def _are_units(cells: Sequence[str]) -> bool:
    """Whether cells are units and nothing else."""
    filled = [cell for cell in cells if cell]
    if not filled:
        return False
    return all(is_common(cell) or (cell != _bare(cell) and is_unit(_bare(cell) or "-")) for cell in filled)


def _bare(cell: str) -> str:
    """A unit without its brackets."""
    found = re.fullmatch(r"\[(.*)\]|\((.*)\)", cell)
    return cell if found is None else (found[1] if found[1] is not None else found[2]).strip()


def _joined(rows: list[list[str]], layout: Layout) -> list[str]:
    """One name per column from several rows, the lowest first; a row that says the same everywhere says nothing."""
    names = list(rows[0])
    for row in rows[1:]:
        said = {cell for cell, kind in zip(row[1:], layout.kinds[1:], strict=True) if cell and kind in (NUMBERS, TIMES)}
        for k, cell in enumerate(row):
            if not names[k]:
                names[k] = cell
            elif cell and len(said) > 1 and k > 0:
                names[k] = f"{cell} {names[k]}"
    if len(rows) > 1 and not _complete(names, layout):  # the same everywhere, and yet needed
        names = [" ".join(dict.fromkeys(row[k] for row in rows[::-1] if row[k])) for k in range(len(names))]
    return names


def parted(name: str) -> tuple[str, str | None]:
    """A name and its unit, as a table's names hold them."""
    alone = re.fullmatch(r"in (\S{1,8})", name)  # Rohde & Schwarz: seconds under no other name
    if alone is not None and is_unit(alone[1]):
        return "time", alone[1]
    found = re.fullmatch(r"([^\[\]]*)\[([^\[\]]*)\]", name)
    if found is not None:
        return found[1].rstrip(), found[2].strip()
    if len(name) <= _LONGEST:
        for pattern in _BEHIND:
            found = pattern.fullmatch(name)
            if found is not None and is_unit(found["unit"].strip()):
                return found["name"].rstrip(), found["unit"].strip()
    return name, None

"""The rows of a table, one by one: what NumPy cannot read in one go, and where the first wrong cell stands."""

import math
import re
from array import array
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile, BadValue
from jshell.io.files import short
from jshell.io.layout import BLANKS, EMPTY, NUMBERS, TIMES, Layout, is_comment, split
from jshell.io.numerals import Marks, days, is_gap, seconds
from jshell.io.titles import WORDS_OF_MARKS, Titles

SECONDS = re.compile(r"[0-5]?\d(?:[.,]\d+)?", re.ASCII)


class Walk:
    """Rows taken one by one; the first that is wrong is refused at its place."""

    def __init__(self, file: str, layout: Layout, titles: Titles, marks: Marks, dropping: bool) -> None:
        self.file, self.layout, self.titles, self.marks, self.dropping = file, layout, titles, marks, dropping
        self.taken = [k for k, kind in enumerate(layout.kinds) if kind in (NUMBERS, TIMES)]
        self.values = array("d")  # row after row
        self.needed = 1 + max(self.taken)
        kinds, names = layout.kinds, titles.names
        self.size, self.mark = len(kinds), layout.mark
        self.blank = [k for k, kind in enumerate(kinds) if kind == EMPTY and k >= self.needed and not names[k]]
        self.numbers = [k for k in self.taken if kinds[k] == NUMBERS]
        self.clocks = [(at, k) for at, k in enumerate(self.taken) if kinds[k] == TIMES]
        self.row = re.compile(rf"(?: *{marks.pattern}\s*\x1f)*", re.ASCII) if layout.mark != BLANKS else None
        self.minutes: dict[str, float] = {}  # what stands before the seconds, to its time
        self.first_day: int | None = None
        self.dates: set[str] = set()

    def take(self, number: int, line: str) -> bool:
        """Take a row; whether it was read."""
        return self._soon(line) or self._carefully(number, line)

    def _soon(self, line: str) -> bool:
        """Take a row of the usual form, all of whose numbers are whole; False leaves it to be looked at."""
        if self.row is None or '"' in line:
            return False
        cells = line.split(self.mark)
        if len(cells) != self.size or any(map(str.strip, [cells[k] for k in self.blank])):
            return False
        text = "\x1f".join([cells[k] for k in self.numbers])
        if self.row.fullmatch(text + "\x1f" * bool(text)) is None:
            return False
        if self.marks.thousands:
            text = text.replace(self.marks.thousands, "")
        if self.marks.decimal == ",":
            text = text.replace(",", ".")
        found = list(map(float, text.split("\x1f"))) if text else []
        for at, k in self.clocks:
            minute, _, rest = cells[k].strip().rpartition(":")
            if minute not in self.minutes or SECONDS.fullmatch(rest) is None:
                return False
            found.insert(at, self.minutes[minute] + float(rest.replace(",", ".")))
        if len(found) != len(self.taken) or not math.isfinite(sum(found)):
            return False
        self.values.extend(found)
        return True

    def _carefully(self, number: int, line: str) -> bool:
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
        self.values.extend(found)
        return True

    def columns(self) -> dict[int, Float[np.ndarray, " rows"]]:
        """The columns taken, by place; times of day in seconds since the first."""
        table = np.frombuffer(self.values).reshape(-1, len(self.taken))
        found = {k: np.ascontiguousarray(table[:, j]) for j, k in enumerate(self.taken)}
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
        value = self._dated(number, k, cell, *found)
        minute, _, rest = cell.rpartition(":")
        if SECONDS.fullmatch(rest):
            self.minutes[minute] = value - float(rest.replace(",", "."))
        return value

    def _dated(self, number: int, k: int, cell: str, date: str, time: float) -> float:
        """Seconds since midnight of the first day."""
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

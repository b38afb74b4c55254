"""One cell of a table: a number, a time of day, a gap, or words.

Numbers may have a decimal comma and marks of thousands; what they are is read
from the whole file (`marks_of`), never from one cell. Only a number with both
marks, as 1.234,5 or 1,234.5, or with several groups, shows which one parts the thousands.
"""

import datetime
import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass

from jshell.io.sheets import NUMBER

_NOTHING = "nan +nan -nan inf +inf -inf infinity +infinity -infinity ∞ +∞ -∞ −∞ na n/a #n/a null none - -- ---"
GAPS = frozenset(_NOTHING.split()) | {""}
_GROUPED = re.compile(
    r"[+-]?\d{1,3}(?:([.,' \u00a0\u202f’])\d{3})(?:\1\d{3})*(?:([.,])\d+)?(?:[eE][+-]?\d+)?", re.ASCII
)
_COMMA = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?", re.ASCII)
_LONGEST = 40  # characters of a number with marks, or of a date
_NAMES = "jan feb mar apr may jun jul aug sep oct nov dec"
_MONTHS = {name: k for k, name in enumerate(_NAMES.split(), 1)}
_CLOCK = re.compile(
    r"(?:(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.](?:\d{1,2}|[A-Za-z]{3})[-/.]\d{4})[T ]\s*)?"
    r"(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d+)?)\s*(?P<half>[aApP][mM])?(?:Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)


@dataclass(frozen=True)
class Marks:
    """How the numbers of a file are written.

    Attributes:
        decimal: `.` or `,`.
        thousands: What parts thousands; empty where nothing does.
    """

    decimal: str = "."
    thousands: str = ""

    @property
    def pattern(self) -> str:
        """A regular expression of a number, its marks in place."""
        point, part = re.escape(self.decimal), re.escape(self.thousands)
        whole = rf"(?:\d{{1,3}}(?:{part}\d{{3}})+|\d+)" if self.thousands else r"\d+"
        return rf"[+-]?(?:{whole}(?:{point}\d*)?|{point}\d+)(?:[eE][+-]?\d+)?"

    def number(self, cell: str) -> float | None:
        """The number that a cell holds, None where it holds none."""
        if self.decimal == "." and not self.thousands:
            return float(cell) if NUMBER.fullmatch(cell) else None
        if self.thousands and len(cell) <= _LONGEST:
            found = _GROUPED.fullmatch(cell)
            if found is not None and found[1] == self.thousands and found[2] in (None, self.decimal):
                cell = cell.replace(self.thousands, "")
        if self.decimal == ",":
            if "." in cell:
                return None
            cell = cell.replace(",", ".")
        return float(cell) if NUMBER.fullmatch(cell) else None


def is_number(cell: str) -> bool:
    """Whether a cell is a number in any spelling."""
    if NUMBER.fullmatch(cell) or _COMMA.fullmatch(cell):
        return True
    return len(cell) <= _LONGEST and _GROUPED.fullmatch(cell) is not None


def is_gap(cell: str) -> bool:
    """Whether a cell says that nothing was measured."""
    return len(cell) < 10 and cell.lower() in GAPS


def is_time(cell: str) -> bool:
    """Whether a cell is a time of day, with or without its date."""
    return len(cell) <= _LONGEST and seconds(cell) is not None


def marks_of(cells: Iterable[str]) -> Marks:
    """Decimal mark and mark of thousands that numbers of a file show; a point and none where they show nothing."""
    decimal, thousands = "", ""
    for cell in cells:
        found = _GROUPED.fullmatch(cell) if len(cell) <= _LONGEST else None
        if found is not None and (found[2] not in (None, found[1]) or found[1] not in ".," or cell.count(found[1]) > 1):
            thousands = thousands or found[1]
            decimal = decimal or (found[2] or "")
        elif not decimal and ("," in cell) != ("." in cell):
            decimal = "," if "," in cell else "."
    if decimal == thousands or not decimal:
        decimal = "," if thousands == "." else "."
    return Marks(decimal, thousands)


def seconds(cell: str) -> tuple[str, float] | None:
    """The date of a time of day as the file spells it, empty where there is none, and the seconds since midnight."""
    found = _CLOCK.fullmatch(cell)
    if found is None:
        return None
    hours, minutes, rest = found["h"], int(found["m"]), float(found["s"].replace(",", "."))
    if hours is None and "." not in found["s"] and "," not in found["s"]:
        return None  # 12:30 may be hours and minutes, or minutes and seconds
    if minutes > 59 or rest >= 61:
        return None
    hour = int(hours or 0)
    if found["half"]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if found["half"].lower() == "pm" else 0)
    return found["date"] or "", 3600.0 * hour + 60.0 * minutes + rest


@functools.lru_cache(maxsize=256)
def days(date: str) -> int | None:
    """The number of a date; None where day and month could be taken for each other, or where there is none such."""
    parts = re.split(r"[-/.]", date)
    try:
        if len(parts[0]) == 4:
            return datetime.date(int(parts[0]), int(parts[1]), int(parts[2])).toordinal()
        if parts[1].lower() in _MONTHS:
            return datetime.date(int(parts[2]), _MONTHS[parts[1].lower()], int(parts[0])).toordinal()
        first, second, year = map(int, parts)
        if "." in date or first > 12:
            return datetime.date(year, second, first).toordinal()
        if second > 12 or first == second:
            return datetime.date(year, first, second).toordinal()
    except ValueError:
        pass
    return None

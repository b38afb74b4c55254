"""What a reader is told of a file that does not say it itself: which column is which, units, the rate, the gaps.

One object with the same five words everywhere: keywords in Python, options in
the terminal, fields of a request. Whatever is left out, the file must say, or
the reader says what it took.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from jshell.errors import BadName, BadValue, choose
from jshell.io.files import brief

ROWS = "rows"
MOST_ROWS = 10**12  # more than any file has; iterators of C count no further than 2^63
_NEXT = re.compile(r",(?=[^,=]*=)")  # a comma that another `name=` follows: names of columns may hold commas


@dataclass(frozen=True)
class Reading:
    """How a file is to be read.

    Attributes:
        columns: Name to the column that it stands for, by the file's name or by its place from 1: `t=Time, H=3`. Where
            a channel is named, no others are read.
        units: Column to its unit, over what the file says: `t=ms, H=mm`; `-` is a number without one.
        rate: Samples per second, or per unit of time where the record has no units; its times are then even.
        time_from: What `rate` counts: `rows`, or a column that counts frames. By itself, the column of the times.
        rows: First and last row of numbers that is read, as a spreadsheet counts lines; None is an end left open.
        missing: What becomes of rows with an empty cell, NaN or infinity: `refuse`, or `drop` to leave them out.

    Raises:
        BadName: No such choice of `missing`; a column that stands for two names.
        BadValue: A rate that is no positive number; rows that end before they begin, or that no file has.

    Example:
        >>> from jshell.io import Reading
        >>> Reading.of(columns="t=Time (s),H=2", units={"H": "mm"}).columns
        {'t': 'Time (s)', 'H': '2'}
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rate: float | int | None = None
    time_from: str | None = None
    rows: tuple[int | None, int | None] = (None, None)
    missing: str = "refuse"

    def __post_init__(self) -> None:
        choose("missing", self.missing, ("refuse", "drop"))
        if self.rate is not None and not 0 < self.rate < np.inf:
            raise BadValue("rate", found=f"{self.rate}", expected="samples per second", remedy="Give a number above 0.")
        low, high = self.rows
        first, last = 1 if low is None else low, MOST_ROWS if high is None else high
        if not 1 <= first <= last <= MOST_ROWS:
            raise BadValue(
                "rows",
                found=brief(f"{low} to {high}"),
                expected="first and last row, counted from 1 to at most 10^12",
                remedy="Write `12:400`.",
            )
        taken = [str(one) for one in self.columns.values()]
        for one in taken:
            if taken.count(one) > 1:
                raise BadName(
                    "columns", found=f"{one!r} for two names", expected="every column once", remedy="Leave one out."
                )

    @staticmethod
    def of(
        columns: Mapping[str, str | int] | str | None = None,
        units: Mapping[str, str] | str | None = None,
        rate: float | int | None = None,
        time_from: str | int | None = None,
        rows: Sequence[int | None] | str | None = None,
        missing: str = "refuse",
    ) -> "Reading":
        """What is to be read, from mappings or from texts `t=Time,H=3` and `12:400`.

        Raises:
            BadName, BadValue: As the class itself; a text of another form.
        """
        span = _span(rows) if isinstance(rows, str) else tuple(rows or (None, None))
        if len(span) != 2:
            raise BadValue("rows", found=f"{len(span)} numbers", expected="first and last row", remedy="Give two.")
        return Reading(
            {name: str(one) for name, one in _pairs("columns", columns).items()},
            _pairs("units", units),
            rate,
            None if time_from is None else str(time_from),
            span,  # pyright: ignore[reportArgumentType]
            missing,
        )

    @staticmethod
    def from_record(given: Mapping[str, Any]) -> "Reading":
        """What is to be read, from the fields of a request.

        Raises:
            BadName, BadValue: As `of`.
        """
        known = [one.name for one in fields(Reading)]
        for name in given:
            choose("reading", name, known, noun="field")
        return Reading.of(**given)

    @property
    def by_place(self) -> bool:
        """Whether all columns are named by their places, so that the file need not name them."""
        named = list(self.columns.values())
        return bool(named) and all(one.isdecimal() for one in named)


def _pairs(name: str, given: Mapping[str, Any] | str | None) -> dict[str, Any]:
    if not isinstance(given, str):
        return dict(given or {})
    found: dict[str, str] = {}
    for part in _NEXT.split(given):
        key, mark, value = (text.strip() for text in part.partition("="))
        if not mark or not key or not value or key in found:
            raise BadValue(
                name,
                found=repr(part.strip()[:60]),
                expected="`name=column`, or `column=unit`, with commas between them, each name once",
                remedy="Write `t=Time,H=Height` or `t=ms,H=mm`.",
            )
        found[key] = value
    return found


def _span(text: str) -> tuple[int | None, int | None]:
    low, mark, high = (part.strip() for part in text.partition(":"))
    if not mark or any(part and not (part.isdecimal() and len(part) < 20) for part in (low, high)):
        raise BadValue(
            "rows", found=repr(text[:60]), expected="`FIRST:LAST`", remedy="Write `12:400`, `12:` or `:400`."
        )
    return (int(low) if low else None, int(high) if high else None)

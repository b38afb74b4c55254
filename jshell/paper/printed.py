"""The numbers that the source prints, by the label of the equation or figure where they stand.

Figures draw them beside ours and documents quote them; fits never see them.

Source     Mokbel et al. 2021; `data/paper/numbers.csv` and `table1.csv`
"""

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path

from jshell.errors import BadName

NUMBERS, TABLE = "numbers.csv", "table1.csv"


@dataclass(frozen=True)
class Printed:
    """One number of the source.

    Attributes:
        where: Label of the equation, figure or section.
        key: Its name there.
        value: As printed, in `unit`.
        error: Its error in percent; None where none is printed.
        unit: `1` is none.
        misprint: Row of the notes on the source where the number is known to be wrong; empty otherwise.
        words: What it is.
    """

    where: str
    key: str
    value: float
    error: float | None
    unit: str
    misprint: str
    words: str

    @property
    def spread(self) -> float:
        """The printed error in the value's own unit; 0 where none is printed."""
        return 0.0 if self.error is None else abs(self.value) * self.error / 100


@cache
def printed_numbers() -> tuple[Printed, ...]:
    """All of them, in the order of the file."""
    rows = csv.DictReader(line for line in _lines(NUMBERS))
    return tuple(
        Printed(
            row["where"],
            row["key"],
            float(row["value"]),
            float(row["error_percent"]) if row["error_percent"] else None,
            row["unit"],
            row["misprint"],
            row["words"],
        )
        for row in rows
    )


def printed(where: str, key: str) -> Printed:
    """One number of the source.

    Args:
        where: Label of the equation, figure or section.
        key: Its name there.

    Raises:
        BadName: No such place or number.

    Example:
        >>> from jshell.paper.printed import printed
        >>> found = printed("subsec:agree", "alpha1")
        >>> print(found.value, found.error)
        3.6 3.5
    """
    at = [row for row in printed_numbers() if row.where == where]
    for row in at:
        if row.key == key:
            return row
    known = [row.key for row in at] if at else sorted({row.where for row in printed_numbers()})
    raise BadName(
        f"number {where} {key!r}",
        found="no such number",
        expected="one of " + ", ".join(known),
        remedy="data/paper/numbers.csv lists them all.",
    )


@cache
def table_of_shells() -> dict[str, dict[str, tuple[float, float]]]:
    """Table 1: shell type to lowest and highest d̂, P̂0 and η̂."""
    found = {}
    for row in csv.DictReader(_lines(TABLE)):
        numbers = {key: (float(row[f"{key}_low"]), float(row[f"{key}_high"])) for key in ("d_hat", "P0_hat", "eta_hat")}
        found[row["shell"]] = numbers
    return found


def _lines(name: str) -> list[str]:
    """The lines of a file of `data/paper`, comments left out, from a checkout or the installed package."""
    checkout = Path(__file__).resolve().parents[2] / "data" / "paper" / name
    path = checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / "paper" / name))
    return [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]

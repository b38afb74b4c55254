"""What jobs make, as bytes: JSON, and tables in which no cell is a formula."""

import csv
import io
import json
from collections.abc import Iterable
from typing import Any

from jshell.io.records import plain
from jshell.io.sheets import NUMBER

FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a spreadsheet begins a formula


def as_json(content: Any) -> bytes:
    """Numbers, texts and arrays as JSON; NaN is null."""
    return json.dumps(plain(content), ensure_ascii=False, allow_nan=False).encode()


def as_csv(rows: Iterable[Iterable[Any]]) -> bytes:
    """Rows as a table."""
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows(rows)
    return file.getvalue().encode()


def neutral(cell: str) -> str:
    """A cell that a spreadsheet takes for text: formulas lose their meaning, numbers stay numbers."""
    return f"'{cell}" if cell.lstrip(" ").startswith(FORMULA) and not NUMBER.fullmatch(cell) else cell


def neutral_csv(content: bytes) -> bytes:
    """A CSV export in which no cell is a formula; lines `# key: value` stay as they are."""
    rows = csv.reader(content.decode().splitlines(keepends=True))
    return as_csv([neutral(cell) for cell in row] for row in rows)

"""Columns of a spreadsheet, `.xlsx`: its first sheet with numbers, read as the text that it would be exported to."""

import csv
import datetime
import io as streams
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import Any

from jshell.errors import BadFile, require_extra
from jshell.files import NamedBytes
from jshell.io import text
from jshell.io.choices import Reading
from jshell.io.files import SPOILED, check_size, spoiled
from jshell.io.sheets import Sheet

WORDS = "spreadsheet (.xlsx)"


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a spreadsheet; rows are counted as it counts them.

    Raises:
        BadFile: No spreadsheet, none with numbers, too large, or as for text.
        MissingExtra: openpyxl is not installed.
    """
    library = require_extra("openpyxl", "instruments", "spreadsheets")
    try:
        with zipfile.ZipFile(streams.BytesIO(file.content)) as archive:
            check_size(file.name, sum(member.file_size for member in archive.infolist()))
        book = library.load_workbook(streams.BytesIO(file.content), read_only=True, data_only=True)
        sheets = [(sheet.title, list(sheet.iter_rows(values_only=True))) for sheet in book.worksheets]
    except BadFile:
        raise
    except SPOILED as error:
        raise spoiled(file.name, WORDS, error) from None
    full = [
        (title, rows) for title, rows in sheets if any(isinstance(cell, int | float) for row in rows for cell in row)
    ]
    if not full:
        raise BadFile(
            file.name, found="no sheet with numbers", expected="a table", remedy="Save formulas with their values."
        )
    title, rows = full[0]
    made = streams.StringIO()
    csv.writer(made, lineterminator="\n").writerows([_cell(cell) for cell in row] for row in rows)
    found = text.read(NamedBytes(file.name, made.getvalue().encode()), choices, required)
    if len(full) == 1:
        return found
    others = ", ".join(f"`{other}`" for other, _ in full[1:])
    said = f"sheet `{title}` read, the first of {len(full)} with numbers ({others} not)"
    return replace(found, taken=(*found.taken, said))


def encode(sheet: Sheet) -> bytes:
    """Nothing: spreadsheets are not written.

    Raises:
        BadFile: Always.
    """
    raise not_written(sheet)


def not_written(sheet: Sheet) -> BadFile:
    """The refusal to write a format that is only read."""
    suffix = PurePath(sheet.file).suffix
    return BadFile(
        sheet.file, found=f"a format that is only read, {suffix}", expected="a format of traces", remedy="Write .csv."
    )


def _cell(value: Any) -> str:
    """A cell as text, numbers with all their digits."""
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, float):
        return repr(value)
    return str(value)

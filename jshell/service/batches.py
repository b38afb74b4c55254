"""Thousands of traces in one file, and what was found for each in another.

A batch is an `.npz` of arrays (`save_recordings`), a `.zip` of trace files, or several
uploads. A file of a zip that cannot be read costs its own row and no other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from jshell.calibration import BatchResult, Recordings, fit_batch, recordings_file
from jshell.errors import BadFile, BadValue, JshellError, Outcome
from jshell.files import NamedBytes
from jshell.io import read_trace, zip_files
from jshell.io.zip_files import Content
from jshell.renamed import renamed
from jshell.service.encoding import as_csv, neutral
from jshell.trace import Trace

FREE = "free_directions"
PLAIN = (FREE, "absolute", "loss", "channels")  # of a result: all but its columns
_FILE = "jshell.calibration.recordings_file"
__getattr__ = renamed(__name__, {"pack": f"{_FILE}:encode", "unpack": f"{_FILE}:decode", "count": f"{_FILE}:count"})


@dataclass(frozen=True)
class Batch:
    """Traces to fit one by one; names and, where a file could not be read, why."""

    records: Recordings | list[Trace]
    names: tuple[str, ...]
    refused: Mapping[int, JshellError]


def read(files: Sequence[tuple[str, Content]], needed: Sequence[str] | None = None) -> Batch:
    """The traces of uploads.

    Args:
        files: Name and bytes of each.
        needed: Channels that a trace must have; None asks for V and S where one of the traces has both.

    Raises:
        BadFile: An archive that cannot be read.
        BadValue: No trace.
    """
    if len(files) == 1 and files[0][0].lower().endswith(".npz"):
        name, content = files[0]
        if "values" in zip_files.names(content, name):
            records = recordings_file.decode(content, name)
            return Batch(records, tuple(numbered(np.shape(records.values)[0])), {})
    listed: list[tuple[str, Content]] = []
    for name, content in files:
        listed += zip_files.files(name, content) if name.lower().endswith(".zip") else [(name, content)]
    if not listed:
        raise BadValue("traces", found="none", expected="at least one trace", remedy="Upload one.")
    made: dict[int, Trace] = {}
    refused: dict[int, JshellError] = {}
    for row, (name, content) in enumerate(listed):
        try:
            made[row] = read_trace(NamedBytes(name, content))
            if made[row].conditions is None:
                raise BadFile(name, found="no conditions", expected="a header with them", remedy="Add `# d_hat: …`.")
        except JshellError as error:
            refused[row] = error
    whole = [row for row in made if row not in refused]
    if needed is None:
        needed = ("V", "S") if any({"V", "S"} <= set(made[row].channels) for row in whole) else ()
    traces = []
    for row in whole:
        try:
            for channel in needed:
                _ = made[row][channel]  # refused here where it has none
            traces.append(made[row])
        except JshellError as error:
            refused[row] = error
    return Batch(traces, tuple(name for name, _ in listed), dict(sorted(refused.items())))


def fitted(given: Batch, options: Mapping[str, Any]) -> BatchResult:
    """Fit every trace; rows of files that could not be read are `unusable_data`."""
    if not given.refused:
        return fit_batch(given.records, **options)
    rows = len(given.names)
    kept = np.setdiff1d(np.arange(rows), list(given.refused))
    if not kept.size:
        raise next(iter(given.refused.values()))
    found = fit_batch(given.records, **options)
    values = {}
    for field in fields(BatchResult):
        part = getattr(found, field.name)
        if isinstance(part, np.ndarray):
            blank = np.nan if part.dtype.kind == "f" else int(Outcome.UNUSABLE_DATA) if field.name == "outcome" else 0
            values[field.name] = np.full((rows, *part.shape[1:]), blank, part.dtype)
            values[field.name][kept] = part
    directions = tuple((int(kept[row]), words) for row, words in found.free_directions)
    return replace(found, **values, free_directions=directions)


def pack_result(found: BatchResult, names: Sequence[str] | None = None) -> bytes:
    """A result as `.npz`, to the bit; with the names of its rows where they are not just numbers."""
    arrays = {field.name: np.asarray(getattr(found, field.name)) for field in fields(BatchResult) if field.name != FREE}
    arrays["free_rows"] = np.array([row for row, _ in found.free_directions], dtype=int)
    arrays["free_words"] = np.array([words for _, words in found.free_directions], dtype=str)
    if names is not None and list(names) != numbered(len(found)):
        arrays["names"] = np.array(names, dtype=str)
    return zip_files.pack(arrays)


def unpack_result(content: bytes) -> BatchResult:
    """A result from such a file.

    Raises:
        BadFile: Not such a file.
    """
    name = "record.npz"
    arrays = zip_files.unpack(content, name)
    arrays.pop("names", None)
    try:
        directions = zip(arrays.pop("free_rows").tolist(), map(str, arrays.pop("free_words")), strict=True)
        absolute = bool(arrays.pop("absolute"))
        choices = {"loss": str(arrays.pop("loss"))} if "loss" in arrays else {}
        choices |= {"channels": tuple(arrays.pop("channels").tolist())} if "channels" in arrays else {}
        return BatchResult(**arrays, **choices, free_directions=tuple(directions), absolute=absolute)  # pyright: ignore
    except (KeyError, TypeError, ValueError) as error:
        raise BadFile(name, found=str(error), expected="the record of a batch", remedy="Download it again.") from None


def table(record: bytes) -> bytes:
    """The table of a batch as CSV, one row per trace, from its record.

    Raises:
        BadFile: Not such a record.
    """
    found = unpack_result(record)
    given = zip_files.unpack(record, "record.npz").get("names")
    names = numbered(len(found)) if given is None else given.tolist()
    columns = found.columns()
    rows = zip(map(neutral, names), *(values.tolist() for values in columns.values()), strict=True)
    return as_csv([("trace", *columns), *rows])


def numbered(rows: int) -> list[str]:
    """Names of rows that have none of their own."""
    return [str(row + 1) for row in range(rows)]

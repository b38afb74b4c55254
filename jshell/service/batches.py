"""Thousands of traces in one file, and what was found for each in another.

A batch is an `.npz` of arrays (`pack`), a `.zip` of trace files, or several
uploads. A file of a zip that cannot be read costs its own row and no other.
"""

import csv
import io as streams
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import PurePath
from typing import Any

import numpy as np

from jshell.calibration import BatchResult, Recordings, fit_batch
from jshell.errors import BadFile, BadValue, JshellError, Outcome
from jshell.io.files import SPOILED, check_size
from jshell.shell import Reduced
from jshell.trace import Trace

CONDITIONS = ("thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio")
FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True)
class Batch:
    """Traces to fit one by one; names and, where a file could not be read, why."""

    records: Recordings | list[Trace]
    names: tuple[str, ...]
    refused: Mapping[int, JshellError]


def pack(records: Recordings) -> bytes:
    """Records of V and S as one `.npz`, for an upload."""
    rows = np.shape(records.values)[0]
    arrays = {"times": np.asarray(records.times), "values": np.asarray(records.values)}
    for name in CONDITIONS:
        arrays[name] = np.broadcast_to(np.asarray(getattr(records.conditions, name), float), (rows,))
    for name in ("sigma", "counts"):
        if getattr(records, name) is not None:
            arrays[name] = np.asarray(getattr(records, name))
    file = streams.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpack(content: bytes, name: str = "batch.npz") -> Recordings:
    """Records from such a file.

    Raises:
        BadFile: No archive of plain arrays, or one of them is missing.
        BadShape: Arrays that do not fit together.
    """
    arrays = _arrays(content, name)
    missing = [key for key in ("times", "values", *CONDITIONS) if key not in arrays]
    if missing:
        raise BadFile(
            name,
            found=f"no array {', '.join(missing)}",
            expected="times, values and the conditions",
            remedy="Write it with jshell.service.batches.pack.",
        )
    conditions = Reduced(*(arrays[key] for key in CONDITIONS))
    return Recordings(arrays["times"], arrays["values"], conditions, arrays.get("sigma"), arrays.get("counts"))


def read(files: Sequence[tuple[str, bytes]], trace: Callable[[str, bytes], Trace]) -> Batch:
    """The traces of uploads.

    Args:
        files: Name and bytes of each.
        trace: Reads one trace.

    Raises:
        BadFile: An archive that cannot be read.
        BadValue: No trace.
    """
    if len(files) == 1 and files[0][0].lower().endswith(".npz"):
        name, content = files[0]
        if "values" in _names(content, name):
            records = unpack(content, name)
            return Batch(records, tuple(str(i + 1) for i in range(np.shape(records.values)[0])), {})
    listed: list[tuple[str, bytes]] = []
    for name, content in files:
        listed += _members(name, content) if name.lower().endswith(".zip") else [(name, content)]
    if not listed:
        raise BadValue("traces", found="none", expected="at least one trace", remedy="Upload one.")
    traces, refused = [], {}
    for row, (name, content) in enumerate(listed):
        try:
            made = trace(name, content)
            if made.conditions is None:
                raise BadFile(name, found="no conditions", expected="a header with them", remedy="Add `# d_hat: …`.")
            _ = made["V"], made["S"]  # refused here where it has none
            traces.append(made)
        except JshellError as error:
            refused[row] = error
    return Batch(traces, tuple(name for name, _ in listed), refused)


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


def pack_result(found: BatchResult) -> bytes:
    """A result as `.npz`, to the bit."""
    arrays = {field.name: getattr(found, field.name) for field in fields(BatchResult)}
    directions = arrays.pop("free_directions")
    arrays["free_rows"] = np.array([row for row, _ in directions], dtype=int)
    arrays["free_words"] = np.array([words for _, words in directions], dtype=str)
    file = streams.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpack_result(content: bytes, name: str = "record.npz") -> BatchResult:
    """A result from such a file.

    Raises:
        BadFile: Not such a file.
    """
    arrays = _arrays(content, name)
    try:
        directions = zip(arrays.pop("free_rows").tolist(), arrays.pop("free_words").tolist(), strict=True)
        absolute = bool(arrays.pop("absolute"))
        return BatchResult(**arrays, free_directions=tuple(directions), absolute=absolute)  # pyright: ignore
    except (KeyError, TypeError, ValueError) as error:
        raise BadFile(name, found=str(error), expected="the record of a batch", remedy="Download it again.") from None


def table(found: BatchResult, names: Sequence[str]) -> bytes:
    """The table of a batch as CSV, one row per trace."""
    columns = found.columns()
    file = streams.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["trace", *columns])
    writer.writerows(zip(map(cell, names), *(values.tolist() for values in columns.values()), strict=True))
    return file.getvalue().encode()


def cell(text: str) -> str:
    """A text that a spreadsheet does not take for a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


def _arrays(content: bytes, name: str) -> dict[str, np.ndarray]:
    _names(content, name)
    try:
        with np.load(streams.BytesIO(content), allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except SPOILED as error:
        raise _no_archive(name, error) from None


def _names(content: bytes, name: str) -> set[str]:
    """Names of the arrays of an archive, once their sizes are known to be bearable."""
    try:
        with zipfile.ZipFile(streams.BytesIO(content)) as archive:
            check_size(name, sum(member.file_size for member in archive.infolist()))
            return {member.filename.removesuffix(".npy") for member in archive.infolist()}
    except BadFile:
        raise
    except SPOILED as error:
        raise _no_archive(name, error) from None


def _members(name: str, content: bytes) -> list[tuple[str, bytes]]:
    _names(content, name)
    try:
        with zipfile.ZipFile(streams.BytesIO(content)) as archive:
            files = [member for member in archive.infolist() if not member.is_dir()]
            return [(PurePath(member.filename).name, archive.read(member)) for member in files]
    except SPOILED as error:
        raise _no_archive(name, error) from None


def _no_archive(name: str, error: BaseException) -> BadFile:
    return BadFile(
        name,
        found=f"no archive that can be read ({str(error) or type(error).__name__})",
        expected="arrays in .npz, or trace files in .zip",
        remedy="Write it again.",
    )

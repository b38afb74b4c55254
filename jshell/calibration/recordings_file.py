"""Recordings in one `.npz`, and back.

Arrays are named as the fields of `Recordings` and of its conditions: `times`, `values`, `thickness`, …
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jshell.calibration.recordings import Recordings
from jshell.errors import BadFile
from jshell.io import zip_files
from jshell.io.files import read_bytes
from jshell.io.zip_files import Content
from jshell.shell.parameters import CONDITION_FIELDS, Reduced

CONDITIONS = tuple(CONDITION_FIELDS.values())
LARGE = ("times", "values")


def encode(records: Recordings) -> bytes:
    """Recordings as one file; it names their channels unless they are V and S."""
    rows = np.shape(records.values)[0]
    arrays = {"times": np.asarray(records.times), "values": np.asarray(records.values)}
    for name in CONDITIONS:
        arrays[name] = np.broadcast_to(np.asarray(getattr(records.conditions, name), float), (rows,))
    for name in ("sigma", "counts"):
        if getattr(records, name) is not None:
            arrays[name] = np.asarray(getattr(records, name))
    if records.channels != ("V", "S"):
        arrays["channels"] = np.array(records.channels, dtype=str)
    return zip_files.pack(arrays)


def decode(content: Content, name: str = "batch.npz") -> Recordings:
    """Recordings from such a file.

    Raises:
        BadFile: No archive of plain arrays, or one of them is missing.
        BadShape, BadValue: As `Recordings`.
    """
    return _records(zip_files.unpack(content, name), name)


def count(content: bytes, name: str) -> int:
    """Records in an `.npz` of them, or 0 where it holds something else; of times and values only the heads are read.

    Raises:
        BadFile, BadShape, BadValue: As `decode`, as far as heads tell.
    """
    if "values" not in zip_files.names(content, name):
        return 0
    return np.shape(_records(zip_files.unpack(content, name, heads=LARGE), name).values)[0]


def _records(arrays: Mapping[str, np.ndarray], name: str) -> Recordings:
    missing = [key for key in ("times", "values", *CONDITIONS) if key not in arrays]
    channels = arrays.get("channels", np.array(["V", "S"]))
    if missing or channels.dtype.kind != "U" or channels.ndim != 1:
        raise BadFile(
            name,
            found=f"no array {', '.join(missing)}" if missing else f"channels: {channels.dtype} {channels.shape}",
            expected="times, values, the conditions, and a row of names where there are channels",
            remedy="Write it with `jshell.calibration.save_recordings`.",
        )
    conditions = Reduced(*(arrays[key] for key in CONDITIONS))
    return Recordings(
        arrays["times"], arrays["values"], conditions, arrays.get("sigma"), arrays.get("counts"),
        tuple(channels.tolist()),
    )  # fmt: skip


def save_recordings(records: Recordings, path: str | Path) -> Path:
    """Write recordings as one `.npz`, which `load_recordings` reads and the fitting service takes.

    Raises:
        BadFile: Nothing can be written there.
    """
    path = Path(path)
    try:
        path.write_bytes(encode(records))
    except OSError as error:
        raise BadFile(
            str(path), found=error.strerror or "an error", expected="a file in a folder that exists", remedy="Check it."
        ) from error
    return path


def load_recordings(path: str | Path) -> Recordings:
    """Read recordings from such a file.

    Raises:
        BadFile: No archive of plain arrays, or one of them is missing.
        BadShape, BadValue: As `Recordings`.
    """
    return decode(read_bytes(path).content, str(path))

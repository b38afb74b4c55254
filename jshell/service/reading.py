"""An upload looked into: what it holds, in which units, under what conditions."""

import functools
import json
import tempfile
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path, PurePath

from jshell import io
from jshell.calibration.data import usual_channels
from jshell.errors import JshellError
from jshell.io.formats import FORMATS, read_sheet
from jshell.io.headers import CONDITION_KEYS
from jshell.io.units import PURE
from jshell.service.store import Store
from jshell.shell.parameters import Reduced
from jshell.trace import CONDITION_FIELDS, Trace

TEXT = ("", ".csv", ".txt", ".dat", ".tsv", ".tab")
KEPT = 64  # traces that stay in memory once read
ROOM = threading.BoundedSemaphore(4)  # uploads that are in memory at the same time; others wait on the disk


@dataclass(frozen=True)
class Look:
    """What is in a file of a trace.

    Attributes:
        trace: Dimensionless.
        units: Column to unit, as the file spells it.
        warnings: What the reader should know.
    """

    trace: Trace
    units: Mapping[str, str]
    warnings: tuple[str, ...]

    @property
    def loss(self) -> str:
        """The loss that a fit of this trace takes by itself."""
        return usual_channels([self.trace])[0]


def look(name: str, content: bytes) -> Look:
    """Read an upload.

    Args:
        name: As its owner calls it; the suffix tells the format, and errors say it.
        content: Its bytes.

    Raises:
        JshellError: As `jshell.io.read_trace`.
    """
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        path = Path(folder) / f"trace{_suffix(name)}"
        path.write_bytes(content)
        try:
            trace = io.read_trace(path)
            sheet = read_sheet(path, ("t",))
        except JshellError as error:
            raise _named(error, str(path), name) from None
        units = {one: unit or PURE for one, unit in zip(sheet.names, sheet.units, strict=True)}
        told = dict.fromkeys(str(one.message).replace(str(path), name) for one in caught)
    return Look(trace, units, tuple(told))


def check_one_readable(files: Sequence[tuple[str, bytes]]) -> None:
    """Refuse trace files of which none can be read; archives are for the worker to open.

    Raises:
        JshellError: Why the first cannot.
    """
    first: JshellError | None = None
    for name, content in files:
        if name.lower().endswith((".zip", ".npz")):
            return
        try:
            look(name, content)
        except JshellError as error:
            first = first or error
        else:
            return
    if first is not None:
        raise first


def looked(store: Store, trace: str) -> tuple[str, Look]:
    """Name and content of a stored trace; read once as long as it is asked for often.

    Raises:
        NotFound: No such trace.
    """
    return _looked(store, trace)


@functools.lru_cache(maxsize=KEPT)
def _looked(store: Store, trace: str) -> tuple[str, Look]:
    row = store.trace(trace)
    return row.name, look(row.name, store.trace_content(trace))


def with_conditions(name: str, content: bytes, given: Mapping[str, float]) -> tuple[str, bytes]:
    """The same trace with conditions in its header, so that the file says all that a fit needs.

    Text keeps its numbers as they stand; other formats are written again as JSON.

    Args:
        name: Of the file.
        content: Its bytes.
        given: Keys of a header to numbers: `d_hat`, … or `R0_m`, …

    Raises:
        JshellError: The conditions are incomplete, contradict the file's own, or the file cannot be read.
    """
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path, meta = Path(folder) / f"trace{_suffix(name)}", Path(folder) / "conditions.json"
        path.write_bytes(content)
        meta.write_text(json.dumps(dict(given)), encoding="utf-8")
        try:
            trace = io.read_trace(path, meta=meta)
            own = {line.key for line in read_sheet(path, ("t",)).entries}
            if own & set(CONDITION_KEYS):  # the file has its own, and they agree
                return name, content
            if path.suffix in TEXT:
                head = "".join(f"# {key}: {value!r}\n" for key, value in given.items())
                return name, head.encode() + content.removeprefix(b"\xef\xbb\xbf")
            again = Path(folder) / "again.json"
            io.write_trace(again, trace, units="si" if trace.scales is not None else "reduced")
        except JshellError as error:
            named = _named(error, str(path), name)
            raise _named(named, str(meta), "conditions") from None
        return f"{PurePath(name).stem}.json", again.read_bytes()


def example(name: str) -> Path:
    """A file of `data/examples`, from a checkout or from the installed package."""
    checkout = Path(__file__).resolve().parents[2] / "data" / "examples" / name
    return checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / name))


def conditions_of(problem: Reduced | None) -> dict[str, float] | None:
    """Conditions under the names that files have for them."""
    if problem is None:
        return None
    return {key: float(getattr(problem, field)) for key, field in CONDITION_FIELDS.items()}


def _suffix(name: str) -> str:
    suffix = PurePath(name).suffix.lower()
    return suffix if suffix in FORMATS else ".csv"


def _named(error: JshellError, path: str, name: str) -> JshellError:
    """The same error, calling the file by its owner's name."""
    if path not in str(error):
        return error
    words = {key: text.replace(path, name) for key, text in error.record().items() if key != "code"}
    return type(error)(**words)

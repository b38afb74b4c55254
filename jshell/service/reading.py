"""An upload looked into: what it holds, in which units, under what conditions."""

import functools
import json
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from jshell.calibration.data import usual_channels
from jshell.errors import BadValue, JshellError
from jshell.files import NamedBytes
from jshell.io.choices import Reading
from jshell.io.files import in_utf8
from jshell.io.formats import FORMATS, READ_ONLY, read_sheet
from jshell.io.headers import CONDITION_KEYS
from jshell.io.tables import Understood, understood
from jshell.io.units import PURE
from jshell.service import sending
from jshell.service.problems import brief, listed, of_validation
from jshell.service.store import Store
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

Schema = TypeVar("Schema", bound=BaseModel)

TEXT = ("", ".csv", ".txt", ".dat", ".tsv", ".tab")
MAX_CACHED_TRACES = 64  # traces that stay in memory once read
MAX_UPLOADS = 4  # in memory at the same time; others wait on the disk
UPLOAD_SLOTS = threading.BoundedSemaphore(MAX_UPLOADS)


@dataclass(frozen=True)
class TraceContent:
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


def inspect(name: str, content: bytes) -> TraceContent:
    """Read an upload.

    Args:
        name: As its owner calls it; the suffix tells the format, and errors say it.
        content: Its bytes.

    Raises:
        JshellError: As `jshell.io.read_trace`.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = _understood(NamedBytes(name, content))
    units = {one: unit or PURE for one, unit in zip(found.sheet.names, found.sheet.units, strict=True)}
    said = [f"{name}: {one}" for one in found.taken]
    return TraceContent(found.trace, units, tuple(dict.fromkeys([*said, *(str(one.message) for one in caught)])))


def _understood(file: NamedBytes, meta: NamedBytes | None = None, reading: Reading | None = None) -> Understood:
    reading = reading or Reading()
    return understood(read_sheet(file, reading, ("t",)), meta, reading)


def settled(name: str, content: bytes, reading: Reading) -> tuple[str, bytes]:
    """A file read as its owner says, as one that says all of it by itself.

    Args:
        name: Of the file.
        content: Its bytes.
        reading: What the file leaves open.

    Raises:
        JshellError: As `jshell.io.read_trace`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        trace = _understood(NamedBytes(name, content), reading=reading).trace
    return _rewritten(name, trace)


def _rewritten(name: str, trace: Trace) -> tuple[str, bytes]:
    name, content = sending.written(trace, f"{PurePath(name).stem}.json")
    return name, bytes(content)


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
            inspect(name, content)
        except JshellError as error:
            first = first or error
        else:
            return
    if first is not None:
        raise first


def read_json(text: str | bytes) -> Any:
    """JSON that every reader understands alike: UTF-8, no name twice in an object, no half of a character.

    Raises:
        ValueError, RecursionError: It is none.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            raise ValueError(f"the name {next(name for name in names if names.count(name) > 1)!r} twice")
        return found

    found = json.loads(text.decode() if isinstance(text, bytes) else text, object_pairs_hook=once)
    json.dumps(found, ensure_ascii=False).encode()
    return found


def json_field(place: str, text: str, expected: str) -> Any:
    """What a field of a form says in JSON.

    Raises:
        BadValue: It is none.
    """
    try:
        return read_json(text)
    except (ValueError, RecursionError) as error:
        words = f"{brief(text)} ({brief(str(error) or 'too deep')})"
        raise BadValue(place, found=words, expected=expected, remedy="Write names and values as JSON.") from None


def options_of(kind: type[Schema], text: str) -> Schema:
    """What the field `options` of a form asks for.

    Raises:
        BadValue: It is no JSON, or not what the API's page says of it.
    """
    try:
        return kind.model_validate(json_field("options, JSON", text, "{…}"))
    except ValidationError as error:
        found = of_validation(error.errors())
        where = ", ".join(one["place"] for one in listed(error.errors())) or "JSON"
        raise BadValue(f"options, {where}", found=found.found, expected=found.expected, remedy=found.remedy) from None


@functools.lru_cache(maxsize=MAX_CACHED_TRACES)
def inspected(store: Store, trace: str) -> tuple[str, TraceContent]:
    """Name and content of a stored trace; read once as long as it is asked for often.

    Raises:
        NotFound: No such trace.
    """
    row = store.trace(trace)
    return row.name, inspect(row.name, store.trace_content(trace))


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
    file = NamedBytes(name, content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = _understood(file, NamedBytes("conditions", json.dumps(dict(given)).encode()))
    if {line.key for line in found.sheet.entries} & set(CONDITION_KEYS):  # the file has its own, and they agree
        return name, content
    if file.suffix in TEXT or file.suffix not in FORMATS | READ_ONLY:
        head = "".join(f"# {key}: {value!r}\n" for key, value in given.items())
        return name, head.encode() + bytes(in_utf8(file)[0].content).removeprefix(b"\xef\xbb\xbf")
    return _rewritten(name, found.trace)


def conditions_of(problem: Reduced | None) -> dict[str, float] | None:
    """Conditions under the names that files have for them."""
    return None if problem is None else sending.numbers(problem)

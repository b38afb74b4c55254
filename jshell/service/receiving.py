"""What a client receives: taken apart, with every part of the kind that it must have.

At an address anything may answer, and a proxy may answer in jshell's place. Here an answer is either what the service
says or refused: a number that is a text would be trusted until it fails far from here. `asking` adds the address.
"""

import math
import re
import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

import jshell.errors
from jshell import io
from jshell.calibration import BatchResult, FitResult, load
from jshell.calibration.estimate import Estimate, Start
from jshell.calibration.noise import Noise
from jshell.dynamics import Mode, OrderMode
from jshell.errors import JshellError, NotOk
from jshell.files import NamedBytes
from jshell.service import batches
from jshell.service.kinds import PLURAL
from jshell.service.sending import is_id
from jshell.trace import Trace

STATES = ("queued", "running", "done", "failed", "cancelled")
ROOT = "/api/v1/"
NAME = re.compile(r"[0-9a-f]{8,64}")
QUERY = re.compile(r"[\w/?&=.-]{1,500}", re.ASCII)
FILE = "record.json"
WHOLE = (FitResult, BatchResult, Estimate, Start, Noise, Mode, OrderMode)  # of these every field is looked at
# what taking apart an answer of somebody else's may end in
SPOILED = (JshellError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


def part(found: Any, name: str, *kinds: Any) -> Any:
    """A part of an object, which must be of one of these kinds, as annotations write them.

    Raises:
        ValueError: It is not there, or of another kind.
    """
    if not isinstance(found, dict) or name not in found:
        raise ValueError(f"no {name}")
    if not any(_is(found[name], kind) for kind in kinds):
        raise ValueError(f"{name} of another kind")
    return found[name]


def job(found: Any) -> dict[str, Any]:
    """A job as fields of `Job`."""
    id, kind, state = (part(found, name, str) for name in ("id", "kind", "state"))
    if not NAME.fullmatch(id) or kind not in PLURAL or state not in STATES:
        raise ValueError("no such id, kind or state of a job")
    progress, error = part(found, "progress", float), part(found, "error", dict, None)
    if not 0 <= progress <= 1:
        raise ValueError("progress beyond 0 to 1")
    failure = None if error is None else error_of(error)
    fields_of = {"id": id, "kind": kind, "state": state, "progress": float(progress), "error": failure}
    return fields_of | {"specification": part(found, "specification", dict)}


def page(found: Any) -> tuple[list[dict[str, Any]], str | None]:
    """Jobs of a page, and the address of the next one below the API's root."""
    jobs, following = [job(one) for one in part(found, "jobs", list)], part(found, "next", str, None)
    if following is None:
        return jobs, None
    _, root, rest = following.partition(ROOT)  # a proxy may show the service below a path of its own
    if not root or not jobs or not QUERY.fullmatch(rest):
        raise ValueError("no address of a next page")
    return jobs, f"/{rest}"


def upload(found: Any) -> str:
    """The name of an upload."""
    if not is_id(part(found, "id", str)):
        raise ValueError("no id of an upload")
    return found["id"]


def profile(found: Any) -> dict[str, Any] | None:
    """Profile intervals of a fit, where it has them."""
    given = part(found, "result", dict, None)
    if given is None or given.get("profile") is None:
        return None
    record = part(given, "profile", dict)
    part(record, "level", float)
    part(record, "criterion", str)
    for one in part(record, "intervals", dict).values():
        part(one, "reason", str)
        for name in ("value", "low", "high"):
            part(one, name, float, None)
    return record


def modes(found: Any) -> tuple[Mode, ...] | tuple[OrderMode, ...]:
    """A row per mode."""
    kind = OrderMode if "azimuth" in _some(found, list)[0] else Mode
    hints = typing.get_type_hints(kind)
    number: Any = lambda name, x: float(x) if _is(x, int) and hints.get(name) is not int else x  # noqa: E731
    rows = tuple(_whole(kind(**{name: number(name, value) for name, value in row.items()})) for row in found)
    numbers = (value for row in rows for value in asdict(row).values() if isinstance(value, float))
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number that is not finite")
    return rows


def inversion(found: Any) -> dict[str, Any]:
    """An inversion's record."""
    for name in ("title", "outcome"):
        part(found, name, str)
    for one in _some(part(found, "estimates", list), list):
        part(one, "name", str)
        for name in ("value", "stderr"):
            part(one, name, float, None)
    for ends in part(found, "intervals", dict).values():
        if not _is(ends, list[float | None]) or len(ends) != 2:
            raise ValueError("no interval")
    return found


def fit(content: bytes) -> FitResult:
    """A fit's record."""
    return _whole(load(NamedBytes(FILE, content)))


def batch(content: bytes) -> BatchResult:
    """A batch's record."""
    found = _whole(batches.unpack_result(content))
    arrays = {one.name: value for one in fields(found) if isinstance(value := getattr(found, one.name), np.ndarray)}
    for name, array in arrays.items():
        if array.dtype.kind not in "biuf" or array.shape[:1] != (found.outcome.size,):
            raise ValueError(f"{name} of another kind or length")
    if found.outcome.dtype.kind not in "iu" or found.values.ndim != 2:
        raise ValueError("no outcomes or no table of values")
    _ = found.outcomes  # refused where one of them is unknown
    return found


def trace(content: bytes) -> Trace:
    """A trace."""
    return io.read_trace(NamedBytes(FILE, content))


def error_of(found: Any) -> JshellError:
    """An error of the library from its words."""
    code, place = part(found, "code", str), part(found, "place", str)
    words = {name: part(found, name, str) for name in ("found", "expected", "remedy")}
    words["expected"] = words["expected"] or "a result"
    kinds = [kind for kind in vars(jshell.errors).values() if isinstance(kind, type) and issubclass(kind, JshellError)]
    kind = next((one for one in kinds if one.code == code and one is not NotOk), JshellError)
    error = kind(place, **words)
    error.code = code
    return error


def _some(found: Any, kind: type) -> Any:
    if not isinstance(found, kind) or not found:
        raise ValueError("nothing in it")
    return found


def _whole(found: Any) -> Any:
    """A result of which every field is what its class says."""
    if not _is(found, type(found)):
        raise ValueError(f"fields of another kind than those of {type(found).__name__}")
    return found


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is what an annotation says; whole numbers are numbers, truth values are not."""
    made, inner = typing.get_origin(kind), typing.get_args(kind)
    if kind is None or kind is types.NoneType:
        return value is None
    if made in (types.UnionType, typing.Union):
        return any(_is(value, one) for one in inner)
    if made is list or (made is tuple and inner[1:] == (...,)):
        return isinstance(value, made) and all(_is(one, inner[0]) for one in value)
    if made is tuple:
        return isinstance(value, tuple) and len(value) == len(inner) and all(map(_is, value, inner))
    if made is not None and issubclass(made, Mapping):
        return isinstance(value, Mapping) and all(_is(k, inner[0]) and _is(v, inner[1]) for k, v in value.items())
    if kind in (int, float) and isinstance(value, int):
        return not isinstance(value, bool) and abs(value) < 2**63
    if kind in WHOLE:
        hints = typing.get_type_hints(kind)
        return isinstance(value, kind) and all(_is(getattr(value, f.name), hints[f.name]) for f in fields(kind))
    return isinstance(value, kind)

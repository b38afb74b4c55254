"""What a client receives: checked as the replies that the service sends, and made into the library's objects.

At an address anything may answer, and a proxy may answer in jshell's place. Here an answer is either what the service
says or refused: a number that is a text would be trusted until it fails far from here. `asking` adds the address.
"""

import re
from dataclasses import fields
from typing import Any

import numpy as np

import jshell.errors
from jshell import io
from jshell.calibration import BatchResult, FitResult, load
from jshell.dynamics import Mode, OrderMode
from jshell.errors import JshellError, NotOk, require_extra
from jshell.files import NamedBytes
from jshell.service import batches
from jshell.trace import Trace

require_extra("pydantic", "service", "jshell.Client")  # of which the replies are made
from jshell.service.replies import (  # noqa: E402
    Failure,
    FitOut,
    Health,
    InversionFound,
    JobOut,
    JobPage,
    ModeOut,
    OrderModeOut,
    ProfileOut,
    TraceOut,
)

ROOT = "/api/v1/"
QUERY = re.compile(r"[\w/?&=.-]{1,500}", re.ASCII)
FILE = "record.json"
# what taking apart an answer of somebody else's may end in
SPOILED = (JshellError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)


def job(found: Any) -> dict[str, Any]:
    """A job as fields of `Job`.

    Raises:
        ValueError: It is none; so all of these.
    """
    return _job(JobOut.model_validate(found, strict=True))


def _job(one: JobOut) -> dict[str, Any]:
    same = {name: getattr(one, name) for name in ("id", "kind", "state", "progress", "specification")}
    return same | {"error": None if one.error is None else _error(one.error)}


def page(found: Any) -> tuple[list[dict[str, Any]], str | None]:
    """Jobs of a page, and the address of the next one below the API's root."""
    given = JobPage.model_validate(found, strict=True)
    jobs = [_job(one) for one in given.jobs]
    if given.next is None:
        return jobs, None
    _, root, rest = given.next.partition(ROOT)  # a proxy may show the service below a path of its own
    if not root or not jobs or not QUERY.fullmatch(rest):
        raise ValueError("no address of a next page")
    return jobs, f"/{rest}"


def upload(found: Any) -> str:
    """The name of an upload."""
    return TraceOut.model_validate(found, strict=True).id


def healthy(found: Any) -> bool:
    """Whether the service says that it is well."""
    return Health.model_validate(found, strict=True).status == "ok"


def profile(found: Any) -> dict[str, Any] | None:
    """Profile intervals of a fit, where it has them."""
    given = (FitOut.model_validate(found, strict=True).result or {}).get("profile")
    return None if given is None else ProfileOut.model_validate(given, strict=True).model_dump()


def modes(found: Any) -> tuple[Mode, ...] | tuple[OrderMode, ...]:
    """A row per mode."""
    kinds: Any = (OrderModeOut, OrderMode) if "azimuth" in found[0] else (ModeOut, Mode)
    reply, kind = kinds
    return tuple(kind(**reply.model_validate(row, strict=True).model_dump()) for row in found)


def inversion(found: Any) -> dict[str, Any]:
    """An inversion's record."""
    InversionFound.model_validate(found, strict=True)
    return found


def fit(content: bytes) -> FitResult:
    """A fit's record."""
    return load(NamedBytes(FILE, content))


def batch(content: bytes) -> BatchResult:
    """A batch's record."""
    found = batches.unpack_result(content)
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
    return _error(Failure.model_validate(found, strict=True))


def _error(given: Failure) -> JshellError:
    kinds = [kind for kind in vars(jshell.errors).values() if isinstance(kind, type) and issubclass(kind, JshellError)]
    kind = next((one for one in kinds if one.code == given.code and one is not NotOk), JshellError)
    error = kind(given.place, found=given.found, expected=given.expected or "a result", remedy=given.remedy)
    error.code = given.code
    return error

"""How a failed request is reported to a program or a person: RFC 9457, in the library's own words.

Every refusal carries code, place, cause and remedy of the library's error. What
nobody foresaw has an identifier and no traceback; the traceback stands in the log.

Source     RFC 9457, Problem Details for HTTP APIs; RFC 6585 (429)
"""

import re
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from jshell.errors import JshellError
from jshell.service.log import log, trace_of
from jshell.service.rows import JobFailure

MEDIA_TYPE = "application/problem+json"
RETRY_AFTER = 5  # seconds after which a refused request may be worth another try
SHOWN = 120  # characters of what was found that a message repeats


class Refused(JshellError):
    """A request that the service itself refuses; its code is one of `KINDS`."""

    def __init__(
        self, place: str, *, found: str, expected: str, remedy: str, code: str = "bad_request", after: int = 0
    ) -> None:
        super().__init__(place, found=found, expected=expected, remedy=remedy)
        self.code, self.after = code, after  # [s] after which it may be worth another try


@dataclass(frozen=True)
class Kind:
    """One sort of problem: its status, its title, and what it means in a sentence."""

    status: int
    title: str
    words: str


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "bad_value": Kind(422, "A value that cannot be", "A number or an option is outside its meaning."),
        "bad_shape": Kind(422, "An array of the wrong shape", "Arrays that belong together differ in length."),
        "bad_name": Kind(422, "An unknown name", "A channel, a constant or an option that does not exist here."),
        "bad_file": Kind(422, "A file that cannot be read", "The file is not what its name claims it to be."),
        "bad_units": Kind(422, "Units that do not fit", "Units are unknown, missing, mixed, or without SI conditions."),
        "not_ok": Kind(422, "A computation without an answer", "The computation ended with an outcome other than ok."),
        "missing_extra": Kind(501, "An optional package is missing", "The server lacks a package that this needs."),
        "bad_request": Kind(400, "A request that cannot be understood", "It is not what HTTP or the API asks for."),
        "not_found": Kind(404, "Nothing there", "Nothing of that name is kept here."),
        "wrong_method": Kind(405, "A method that this address does not know", "Allow lists those that it knows."),
        "not_ready": Kind(409, "No result", "The job has not ended, or ended without a result."),
        "key_conflict": Kind(409, "A key used twice", "The Idempotency-Key belongs to a different request."),
        "too_large": Kind(413, "Too large", "The body is larger than the service takes."),
        "too_slow": Kind(408, "Too slow", "The body did not arrive in time."),
        "no_token": Kind(401, "A token is needed", "The service is open to other machines and asks for its token."),
        "cross_site": Kind(403, "A request from another site", "Another site may read and change nothing here."),
        "wrong_host": Kind(421, "A name that is not this server's", "The Host header is not among the allowed hosts."),
        "too_many": Kind(429, "Too many at once", "More from one address than the service takes; try again later."),
        "queue_full": Kind(429, "The queue is full", "As many jobs wait as may wait; try again later."),
        "store_unavailable": Kind(503, "The database does not answer", "It cannot be read or written now; try again."),
        "bad_store": Kind(503, "The database is damaged", "It was refused and left as it is; see the remedy."),
        "limit_reached": Kind(422, "A limit was reached", "The job took more time or memory than the service allows."),
        "worker_lost": Kind(500, "A worker was lost", "The process that computed this died."),
        "worker_died": Kind(500, "A worker died", "The process that computed this died as often as may be tried."),
        "internal": Kind(500, "An error of the service", "Nobody foresaw this; the log has it under the identifier."),
    }
)  # fmt: skip
Page = Callable[[Request, JshellError, Kind], Response]
_BY_STATUS = MappingProxyType({400: "bad_request", 404: "not_found", 405: "wrong_method", 413: "too_large"})


def brief(text: object) -> str:
    """What was found, short enough for a message."""
    words = (text if isinstance(text, str) else repr(text)).encode(errors="replace").decode()
    return words if len(words) <= SHOWN else words[: SHOWN - 1] + "…"


def answer(
    error: JshellError, path: str, more: Mapping[str, Any] = MappingProxyType({}), root: str = ""
) -> JSONResponse:
    """An error as the problem object of RFC 9457; `root` is where a proxy in front shows the service."""
    kind = KINDS.get(error.code, KINDS["bad_request"])
    words = JobFailure(**error.record()).words()
    body = {
        "type": f"{root}/problems/{error.code}",
        "title": kind.title,
        "status": kind.status,
        "detail": f"{error.place}: {words['cause']}. {error.remedy}",
        "instance": root + path,
        **words,
        **more,
    }
    return JSONResponse(body, kind.status, headers=headers_of(error), media_type=MEDIA_TYPE)


def headers_of(error: JshellError) -> dict[str, str]:
    """What beside the body a refusal says."""
    if error.code in ("queue_full", "store_unavailable", "too_many"):
        return {"Retry-After": str(getattr(error, "after", 0) or RETRY_AFTER)}
    if error.code == "too_slow":
        return {"Connection": "close"}  # what comes later would be taken for the next request
    return {"WWW-Authenticate": 'Bearer realm="jshell"'} if error.code == "no_token" else {}


def of_validation(errors: Sequence[Any]) -> JshellError:
    """The first thing that a request's schema refuses, as an error of the library's kind."""
    first = errors[0]
    place, error = _place(first) or "request", (first.get("ctx") or {}).get("error")
    if isinstance(error, JshellError):  # the library's own refusal, which a validator let through
        place = brief(f"{place}, {error.place}")
        return Refused(place, found=brief(error.found), expected=error.expected, remedy=error.remedy, code=error.code)
    code = {"extra_forbidden": "bad_name", "json_invalid": "bad_request"}.get(str(first.get("type")), "bad_value")
    return Refused(
        place,
        found=brief(first.get("input")) if "input" in first else "nothing",
        expected=_cause(first) or "another value",
        remedy="See the API's page at /api.",
        code=code,
    )


def _place(one: Any) -> str:
    return brief(".".join(str(part) for part in one.get("loc", ())))


def _cause(one: Any) -> str:
    """What a schema says of a value, without the kind of exception that a validator raised."""
    return brief(str(one.get("msg", "")).removeprefix("Value error, "))


def listed(errors: Sequence[Any]) -> list[dict[str, str]]:
    """Every thing that a schema refuses: place and cause."""
    return [{"place": _place(one), "cause": _cause(one)} for one in errors[:20]]


def of_status(status: int, detail: object, path: str) -> JshellError:
    """A plain HTTP error as one of the library's kind."""
    code = _BY_STATUS.get(status, "bad_request" if status < 500 else "internal")
    known = {
        404: ("no such address", "an address of this service", "Start from / or /api."),
        405: ("a method that it does not know", "one of those in the header Allow", "See the API's page at /api."),
    }
    found, expected, remedy = known.get(
        status, (brief(str(detail)), "a request that the API describes", "See the API's page at /api.")
    )
    return Refused(path, found=found, expected=expected, remedy=remedy, code=code)


def unforeseen(error: BaseException, path: str) -> JshellError:
    """An error that nobody foresaw: an identifier for the user, and for the log where it came from, in one record."""
    identifier = uuid.uuid4().hex[:12]
    log.error("error %s at %s\n%s", identifier, path, trace_of(error))
    return Refused(
        path, found=f"an error of the service, {identifier}", expected="none", code="internal",
        remedy=f"Try again; if it stays, look for {identifier} in the service's log.",
    )  # fmt: skip


def allowed(description: Mapping[str, Any], path: str) -> list[str]:
    """The methods that an address of the API knows; none for other addresses."""
    for shape, operations in description["paths"].items():
        pattern = "".join(
            r"[^/.]+" if part.startswith("{") else re.escape(part) for part in re.split(r"(\{\w+\})", shape)
        )
        if re.fullmatch(pattern, path):
            return sorted(method.upper() for method in operations)
    return []


def rendered(request: Request, error: JshellError, page: Page, more: Mapping[str, Any] = {}) -> Response:
    """An error as whoever asks can read it: a program a problem, a browser a page."""
    path = request.scope["path"]
    if path.startswith(("/api/v1", "/healthz", "/metrics", "/openapi.json")):
        return answer(error, path, more, request.app.state.service.settings.root_path)
    return page(request, error, KINDS.get(error.code, KINDS["bad_request"]))


def render_errors(app: FastAPI, page: Page) -> None:
    """Have every error of an application answered as a problem.

    Args:
        app: The application.
        page: Makes of a request, an error and its kind the HTML that a browser is shown.
    """

    @app.exception_handler(JshellError)
    def of_library(request: Request, error: JshellError) -> Response:
        return rendered(request, error, page)

    @app.exception_handler(RequestValidationError)
    def of_schema(request: Request, error: RequestValidationError) -> Response:
        return rendered(request, of_validation(error.errors()), page, {"errors": listed(error.errors())})

    @app.exception_handler(HTTPException)
    def of_http(request: Request, error: HTTPException) -> Response:
        found = of_status(error.status_code, error.detail, request.url.path)
        response = rendered(request, found, page)
        response.headers.update(error.headers or {})
        if error.status_code == 405:  # a router names the methods of one route, not those of the address
            methods = allowed(app.openapi(), request.url.path)
            response.headers.update({"Allow": ", ".join(methods)} if methods else {})
        return response

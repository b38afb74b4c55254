"""The page's routes: the list, errors, the token, the API's description, what is static."""

import hmac
import time
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, FastAPI, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles

from jshell.errors import JshellError, NotFound
from jshell.service.jobs import PLURAL, summary
from jshell.service.problems import KINDS, Kind, NoToken
from jshell.service.safety import COOKIE
from jshell.service.state import Here
from jshell.service.store import JobRow, Store
from jshell.service.web import fits, new, settle, simulations
from jshell.service.web.templates import shown

STATIC = Path(__file__).parent / "static"
ROWS = 25
router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


def mount(app: FastAPI) -> None:
    """Give an application its page."""
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    for part in (router, new.router, settle.router, fits.router, simulations.router):
        app.include_router(part)


def sorry(request: Request, error: JshellError, kind: Kind) -> Response:
    """The page that says what went wrong, and what to try."""
    if kind.status == 401 and request.method == "GET":
        return RedirectResponse(f"/login?next={request.url.path}", 303)
    return shown(request, "error.html", {"error": error, "kind": kind}, kind.status)


@router.get("/")
def index(request: Request, here: Here, before: str | None = None) -> Response:
    """The list of jobs."""
    rows = here.store.jobs(None, ROWS, before)
    more = rows[-1].id if len(rows) == ROWS else None
    listed = [line(here.store, row) for row in rows]
    busy = any(not row.over for row in rows)
    given = {"rows": listed, "more": more, "first": before is None, "busy": busy, "counts": here.store.counts()}
    return shown(request, "index.html", given)


def line(store: Store, job: JobRow) -> dict[str, Any]:
    """A job's line in the list."""
    names = [_name(store, trace) for trace in job.traces[:3]]
    more = len(job.traces) - len(names)
    title = ", ".join(names) + (f" and {more} more" if more > 0 else "")
    return {
        "job": job,
        "title": title or ("modes" if job.kind == "modes" else "simulation"),
        "link": f"/{PLURAL[job.kind]}/{job.id}",
        "words": summary(store, job),
    }


def _name(store: Store, trace: str) -> str:
    try:
        return store.trace(trace).name
    except NotFound:
        return "an upload that is gone"


@router.get("/login")
def login(request: Request, next: str = "/") -> Response:
    """Where a browser gives the token."""
    return shown(request, "login.html", {"next": _inside(next), "error": None})


@router.post("/login")
def logged_in(
    request: Request, here: Here, token: Annotated[str, Form()] = "", next: Annotated[str, Form()] = "/"
) -> Response:
    """Keep a right token in a cookie that scripts and other sites cannot read."""
    wanted = here.settings.token
    if wanted and not hmac.compare_digest(token.strip().encode(), wanted.encode()):
        time.sleep(0.5)  # guessing is slow
        error = NoToken("token", found="another token", expected="the service's token", remedy="Ask its keeper for it.")
        return shown(request, "login.html", {"next": _inside(next), "error": error}, 401)
    response = RedirectResponse(_inside(next), 303)
    secure = request.url.scheme == "https"
    response.set_cookie(COOKIE, token.strip(), max_age=30 * 86400, httponly=True, samesite="strict", secure=secure)
    return response


def _inside(address: str) -> str:
    """An address of this service; another one becomes the list."""
    good = address.startswith("/") and not address.startswith(("//", "/\\")) and address.isprintable()
    return address if good else "/"


@router.get("/problems/{code}")
def explained(request: Request, code: str) -> Response:
    """What a problem's code means."""
    if code not in KINDS:
        raise NotFound("problem", found="no such code", expected=", ".join(KINDS), remedy="Check the code.")
    return shown(request, "problem.html", {"code": code, "kind": KINDS[code]})


@router.get("/api")
def described(request: Request) -> Response:
    """The API's description, for people, without the net."""
    found = request.app.openapi()
    groups: dict[str, list[dict[str, Any]]] = {}
    for path, operations in found["paths"].items():
        for method, operation in operations.items():
            tag = (operation.get("tags") or ["service"])[0]
            groups.setdefault(tag, []).append({"path": path, "method": method.upper(), **operation})
    schemas = found["components"]["schemas"]
    return shown(request, "api.html", {"groups": groups, "schemas": schemas, "kinds": KINDS})


@router.get("/licences")
def licences(request: Request) -> Response:
    """What the page itself is made of."""
    return shown(request, "licences.html", {"text": (STATIC / "LICENSES").read_text(encoding="utf-8")})

"""The page's routes: the list, errors, the token, the API's description, what is static."""

import hmac
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, FastAPI, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

from jshell.errors import JshellError, NotFound
from jshell.service import jobs, sessions
from jshell.service.problems import KINDS, Kind, Refused, headers_of
from jshell.service.safety import COOKIE
from jshell.service.state import Here
from jshell.service.web import films, fits, inversions, new, settle, simulations
from jshell.service.web.forms import ids_checked
from jshell.service.web.templates import shown

STATIC = Path(__file__).parent / "static"
ROWS = 25
router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


def mount(app: FastAPI) -> None:
    """Give an application its page."""
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    for part in (router, new.router, settle.router, films.router, fits.router, inversions.router, simulations.router):
        app.include_router(part, dependencies=[Depends(ids_checked)])


def sorry(request: Request, error: JshellError, kind: Kind) -> Response:
    """The page that says what went wrong, and what to try."""
    if kind.status == 401 and request.method == "GET":
        return RedirectResponse(f"/login?next={quote(request.scope['path'])}", 303)
    response = shown(request, "error.html", {"error": error, "kind": kind}, kind.status)
    response.headers.update(headers_of(error))
    return response


@router.get("/")
def index(request: Request, here: Here, before: str | None = None) -> Response:
    """The list of jobs."""
    rows = here.store.jobs(None, ROWS, before)
    more = rows[-1].id if len(rows) == ROWS else None
    words = lambda row: {"title": jobs.title(here.store, row), "words": jobs.summary(here.store, row)}  # noqa: E731
    listed = [{"job": row, "link": jobs.page(row)} | words(row) for row in rows]
    busy = any(not row.over for row in rows)
    given = {"rows": listed, "more": more, "first": before is None, "busy": busy, "counts": here.store.counts()}
    return shown(request, "index.html", given)


@router.get("/login")
def login(request: Request, next: str = "/") -> Response:
    """Where a browser gives the token."""
    return shown(request, "login.html", {"next": _inside(next), "error": None})


@router.post("/login")
async def logged_in(
    request: Request, here: Here, token: Annotated[str, Form()] = "", next: Annotated[str, Form()] = "/"
) -> Response:
    """Begin a session for who gives the right token; its cookie no script and no other site can read."""
    address, wanted = request.client.host if request.client else "", here.settings.token or ""
    if not here.guesses.may(address):
        raise Refused(
            "token", found=f"{sessions.GUESSES} wrong ones in a minute", expected="fewer",
            remedy="Wait a minute, and ask the service's keeper for the token.", code="too_many", after=60,
        )  # fmt: skip
    if not hmac.compare_digest(token.strip().encode(errors="replace"), wanted.encode()):
        here.guesses.was_wrong(address)
        error = Refused("token", found="another token", expected="the service's token", remedy="Ask its keeper for it.")
        return shown(request, "login.html", {"next": _inside(next), "error": error}, 401)
    response = RedirectResponse(_inside(next), 303)
    if wanted:  # without a token everybody is in, and a session would be a row for nothing
        name = await run_in_threadpool(sessions.begin, here.store.database)
        response.set_cookie(COOKIE, name, sessions.SECONDS, **_only_here(request))
    return response


@router.post("/logout")
def logged_out(request: Request, here: Here) -> Response:
    """End the session, here and wherever its cookie may have gone."""
    sessions.end(here.store.database, request.cookies.get(COOKIE, ""))
    response = RedirectResponse("/login", 303)
    response.delete_cookie(COOKIE, **_only_here(request))
    return response


def _only_here(request: Request) -> dict[str, Any]:
    path = request.app.state.service.settings.root_path
    return {"path": path or "/", "httponly": True, "samesite": "strict", "secure": request.url.scheme == "https"}


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

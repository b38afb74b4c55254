"""The service put together: gate, API, page, and the worker beside them."""

import contextlib
import re
import threading
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import unquote_to_bytes

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from python_multipart.multipart import parse_options_header
from starlette import formparsers
from starlette.formparsers import MultiPartParser
from starlette.requests import Request
from starlette.routing import Match

import jshell
from jshell.oscillator import SOURCE, decay_by_law
from jshell.service import reduced, safety, shape
from jshell.service.api import films, health, jobs, simulate, traces
from jshell.service.problems import render_errors, rendered
from jshell.service.replies import ProblemOut
from jshell.service.settings import Settings
from jshell.service.state import Counted, Metrics, Service
from jshell.service.store import Store
from jshell.service.web import pages
from jshell.service.worker import Worker
from jshell.shell.presets import R

DRAIN = 7.0  # seconds that running jobs have when the service is told to stop; requests under way had two before
API = "/api/v1"
MAX_IN_MEMORY_BYTES = 16 * 2**20  # of a file on its way in; larger ones wait on the disk


def create_app(settings: Settings, store: Store, worker: Worker | None = None) -> FastAPI:
    """The service as an ASGI application.

    Args:
        settings: What its keeper chose.
        store: Where traces and jobs are; closed by whoever opened it.
        worker: Started and stopped with the application; None leaves jobs waiting for another process.
    """

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        if worker is not None:
            worker.start()
        if settings.warm:
            threading.Thread(target=_warm, name="warm", daemon=True).start()
        try:
            yield
        finally:
            if worker is not None:
                worker.stop(DRAIN)

    app = FastAPI(
        title="jshell", version=jshell.__version__, lifespan=lifespan, docs_url=None, redoc_url=None,
        openapi_url="/openapi.json", redirect_slashes=False,
        summary="Fits of the short model of buckling shells, as jobs.",
    )  # fmt: skip
    MultiPartParser.spool_max_size = MAX_IN_MEMORY_BYTES
    formparsers.parse_options_header = _with_long_names
    service = Service(settings, store, Metrics())
    app.state.service = service
    for router in (traces.router, jobs.router, films.router, simulate.router):
        app.include_router(router, prefix=API)
    app.include_router(health.router)
    pages.mount(app)
    render_errors(app, pages.sorry)
    refuse = lambda scope, error: rendered(Request(scope), error, pages.sorry)  # noqa: E731
    at = lambda path: {"type": "http", "method": "GET", "path": path, "headers": []}  # noqa: E731
    own = lambda path: any(one.matches(at(path))[0] is not Match.NONE for one in app.routes)  # noqa: E731
    app.add_middleware(safety.Gate, settings=settings, database=store.database, refuse=refuse, own=own)
    app.add_middleware(Counted, metrics=service.metrics)
    app.openapi = lambda: _described(app)  # pyright: ignore[reportAttributeAccessIssue]
    return app


def _with_long_names(header: bytes | str | None) -> tuple[bytes, dict[bytes, bytes]]:
    """A part's header, `filename*` understood: some clients name a file with accents by it alone (RFC 8187)."""
    kind, options = parse_options_header(header)
    text = header.encode("latin-1") if isinstance(header, str) else header or b""
    found = re.search(rb"filename\*=utf-8'[^']*'([^;\s]+)", text, re.IGNORECASE)
    return kind, options if found is None else {**options, b"filename": unquote_to_bytes(found[1])}


def _warm() -> None:
    """Compile what the page of the short model needs before somebody waits for it."""
    reduced.answer(R.conditions, SOURCE)
    decay_by_law(R.conditions)
    shape.answer(R.conditions)
    shape.exact(R.conditions)


def _described(app: FastAPI) -> dict[str, Any]:
    """The description of the API: problems and the token included, the page's own routes left out."""
    if app.openapi_schema is None:
        root = app.state.service.settings.root_path
        found = get_openapi(
            title=app.title, version=app.version, summary=app.summary, routes=app.routes,
            servers=[{"url": root}] if root else None,
        )  # fmt: skip
        parts = found.setdefault("components", {})
        parts.setdefault("schemas", {})["ProblemOut"] = ProblemOut.model_json_schema(
            ref_template="#/components/schemas/{model}"
        )
        if app.state.service.settings.token:
            parts["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
            for path, operations in found["paths"].items():
                if path != "/healthz":
                    for operation in operations.values():
                        operation["security"] = [{"token": []}]
        app.openapi_schema = found
    return app.openapi_schema

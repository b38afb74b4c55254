"""Is the service well, and how busy."""

from typing import Any

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse

import jshell
from jshell.errors import StoreUnavailable
from jshell.service.api.answers import problem_responses
from jshell.service.replies import Health
from jshell.service.state import Here

router = APIRouter(tags=["service"])
_TEXT = {200: {"description": "Prometheus' text format.", "content": {"text/plain": {"schema": {"type": "string"}}}}}


@router.get("/healthz", response_model=Health, responses=problem_responses(), summary="Is the service well")
def healthy(here: Here) -> dict[str, Any]:
    """200 where jobs can be taken, 503 where the database takes no write."""
    if not here.store.healthy():
        in_file = here.store.database.sqlite
        disk = "its disk is full or read-only, or another program holds it"
        remedy = f"Look whether {disk if in_file else 'PostgreSQL runs, can be reached, and has room on its disk'}."
        raise StoreUnavailable("database", found="no write", expected="a write", remedy=remedy)
    return {"status": "ok", "version": jshell.__version__}


@router.get(
    "/metrics", response_class=PlainTextResponse, responses=problem_responses(more=_TEXT), summary="How busy it is"
)
def metrics(here: Here) -> Response:
    """Jobs by state, requests by status, time to answer: in Prometheus' text format."""
    text = here.metrics.text(here.store.counts(), jshell.__version__)
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4; charset=utf-8")

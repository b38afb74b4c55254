"""The page of a file that leaves something open: its columns to be named, its units, the rate of its samples."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.concurrency import run_in_threadpool

from jshell.errors import JshellError
from jshell.files import NamedBytes
from jshell.io import Reading
from jshell.io.formats import read_sheet
from jshell.quantities import QUANTITIES
from jshell.service.reading import inspect, settled
from jshell.service.state import Here, Service
from jshell.service.web.templates import shown

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
ROLES = ("t", "V", "S", "H", "W", "P", "P_ext")
MOST = 40  # columns that the page lists
FIRST = 3  # numbers of each that it shows
OWN = "own"


@dataclass(frozen=True)
class Column:
    """A column as the page lists it."""

    place: int
    name: str
    unit: str
    first: str


def columns(name: str, content: bytes) -> list[Column]:
    """The columns that can be seen in a file, however little it says; none where there is no table."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sheet = read_sheet(NamedBytes(name, content), Reading.of(missing="drop"), ("t",))
    except JshellError:
        return []
    places = sheet.places or tuple(range(1, len(sheet.names) + 1))
    rows = zip(places, sheet.names, sheet.units, sheet.columns, strict=True)
    listed = [
        Column(place, title, unit or "", ", ".join(f"{x:.6g}" for x in values[:FIRST]))
        for place, title, unit, values in rows
    ]
    return listed[:MOST]


@router.get("/traces/settle")
def ask(request: Request, here: Here) -> Response:
    """What a file holds, and what is to be said of it."""
    return page(request, here, str(request.query_params.get("trace", "")), {}, None)


@router.post("/traces/settle")
async def settle(request: Request, here: Here) -> Response:
    """Read the file as its owner says, and go on."""
    async with request.form() as sent:
        fields = {key: value.strip() for key, value in sent.items() if isinstance(value, str)}
    return await run_in_threadpool(_settled, request, here, fields)


def page(request: Request, here: Service, trace: str, fields: Mapping[str, str], error: JshellError | None) -> Response:
    """The page of one file."""
    row = here.store.trace(trace)
    seen = columns(row.name, here.store.trace_content(trace))
    if error is None and not fields:
        try:
            inspect(row.name, here.store.trace_content(trace))
        except JshellError as refused:
            error = refused
    roles = [(one, f"{one}, {QUANTITIES[one].words}") for one in ROLES]
    given: dict[str, Any] = {"row": row, "columns": seen, "fields": fields, "error": error, "roles": roles}
    return shown(request, "settle.html", given, 200 if error is None else 422)


def reading(fields: Mapping[str, str], seen: list[Column]) -> Reading:
    """What the page's fields say of a file.

    Raises:
        BadName, BadValue: As `jshell.io.Reading`.
    """
    named: dict[str, str | int] = {}
    units: dict[str, str] = {}
    for one in seen:
        role, unit = fields.get(f"role.{one.place}", ""), fields.get(f"unit.{one.place}", "")
        name = one.name or f"column {one.place}" if role == OWN else role
        if name:
            named[name] = one.place
        if unit and unit != one.unit:
            units[name or one.name] = unit
    rate = fields.get("rate", "").replace(",", ".")
    return Reading.of(
        named,
        units,
        number(rate) if rate else None,
        fields.get("time_from") or None,
        fields.get("rows") or None,
        "drop" if fields.get("missing") else "refuse",
    )


def number(text: str) -> float:
    """A rate as it was typed; what is no number is refused as no rate."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _settled(request: Request, here: Service, fields: dict[str, str]) -> Response:
    trace = fields.pop("trace", "")
    row, content = here.store.trace(trace), here.store.trace_content(trace)
    try:
        name, content = settled(row.name, content, reading(fields, columns(row.name, content)))
        bare = inspect(name, content).trace.conditions is None
    except JshellError as error:
        return page(request, here, trace, fields, error)
    chosen = urlencode({"trace": here.store.add_trace(name, content).id})
    return RedirectResponse(f"/traces/conditions?{chosen}" if bare else f"/fits/new?{chosen}", 303)

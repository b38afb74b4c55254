"""The page of a file that leaves something open: its columns to be named, its units, the rate of its samples."""

import warnings
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from jshell.errors import JshellError
from jshell.files import NamedBytes
from jshell.io import Reading
from jshell.io.formats import read_sheet
from jshell.quantities import QUANTITIES
from jshell.service.reading import inspect, settled
from jshell.service.state import Here, Service
from jshell.service.web.forms import PageForm, Sent, onward
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
def ask(request: Request, here: Here, trace: str = "") -> Response:
    """What a file holds, and what is to be said of it."""
    return page(request, here, PageForm([trace]))


@router.post("/traces/settle")
def settle(request: Request, here: Here, sent: Sent) -> Response:
    """Read the file as its owner says, and go on."""
    trace = sent.text("trace")
    row, content = here.store.trace(trace), here.store.trace_content(trace)
    try:
        name, content = settled(row.name, content, reading(sent, columns(row.name, content)))
        bare = inspect(name, content).trace.conditions is None
    except JshellError as error:
        sent.error = error
        return page(request, here, sent)
    return onward(bare, [here.store.add_trace(name, content).id])


def page(request: Request, here: Service, sent: PageForm) -> Response:
    """The page of one file."""
    row = here.store.trace(sent.traces[0] if sent.traces else "")
    content, error = here.store.trace_content(row.id), sent.error
    if error is None:
        try:
            inspect(row.name, content)
        except JshellError as refused:
            error = refused
    roles = [(one, f"{one}, {QUANTITIES[one].words}") for one in ROLES]
    given: dict[str, Any] = {
        "row": row,
        "columns": columns(row.name, content),
        "fields": sent.fields,
        "error": error,
        "roles": roles,
    }
    return shown(request, "settle.html", given, 200 if error is None else 422)


def reading(sent: PageForm, seen: list[Column]) -> Reading:
    """What the page's fields say of a file.

    Raises:
        BadName, BadValue: As `jshell.io.Reading`.
    """
    named: dict[str, str | int] = {}
    units: dict[str, str] = {}
    for one in seen:
        role, unit = sent.text(f"role.{one.place}"), sent.text(f"unit.{one.place}")
        name = one.name or f"column {one.place}" if role == OWN else role
        if name:
            named[name] = one.place
        if unit and unit != one.unit:
            units[name or one.name] = unit
    return Reading.of(
        named,
        units,
        sent.number("rate") if sent.text("rate") else None,
        sent.text("time_from") or None,
        sent.text("rows") or None,
        "drop" if sent.text("missing") else "refuse",
    )

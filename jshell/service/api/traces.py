"""Traces: uploaded, listed, looked into, given back."""

from collections.abc import Callable
from typing import Annotated, Any, TypeVar, no_type_check

import numpy as np
from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.responses import JSONResponse
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from jshell.errors import BadValue, JshellError
from jshell.io import Reading
from jshell.service.api.answers import ONCE, Before, Limit, Name, binary, problem_responses
from jshell.service.problems import brief
from jshell.service.reading import (
    UPLOAD_SLOTS,
    TraceContent,
    conditions_of,
    inspect,
    inspected,
    json_field,
    settled,
    with_conditions,
)
from jshell.service.replies import TraceOut, TracePage, TraceRead
from jshell.service.rows import JobFailure
from jshell.service.safety import attachment, clean_name
from jshell.service.schemas import ReadingFields
from jshell.service.state import Here
from jshell.service.uploads import TraceRow

router = APIRouter(prefix="/traces", tags=["traces"])
Made = TypeVar("Made")
_numbers, _fields = TypeAdapter(dict[str, FiniteFloat]), TypeAdapter(ReadingFields)
# fields of a form in JSON: what is expected, what to try, what it is made into
CONDITIONS = '{"d_hat": 0.22, …}', "Write names and finite numbers.", _numbers.validate_python
READING = (
    '{"columns": {"t": "Time"}, …}', "Write the fields of `jshell.io.Reading`.",
    lambda found: Reading.from_record(_fields.validate_python(found)),
)  # fmt: skip


@router.post(
    "",
    status_code=201,
    response_model=TraceRead,
    responses=problem_responses(made=(201,)),
    summary="Upload a trace",
    dependencies=[ONCE],
)
@no_type_check  # FastAPI hands in Starlette's UploadFile where its own is announced
def upload(
    here: Here,
    file: Annotated[UploadFile, File(description="Columns t, and V, S, H, W, …: CSV, JSON, NetCDF, .mat or .npz.")],
    conditions: Annotated[
        str | None, Form(description='Conditions of a file without them, as JSON: {"d_hat": 0.22, …} or {"R0_m": …}.')
    ] = None,
    reading: Annotated[
        str | None,
        Form(
            description='What the file leaves open, as JSON: {"columns": {"t": "Time (s)", "H": "3"}, '
            '"units": {"H": "mm"}, "rate": 1000, "time_from": "frame", "rows": "12:400", "missing": "drop"}.'
        ),
    ] = None,
) -> Response:
    """Read and keep a trace; the same bytes are kept once."""
    with UPLOAD_SLOTS:
        name, content = clean_name(file.filename), file.file.read()
        if reading:
            name, content = settled(name, content, _field("reading", reading, *READING))
        if conditions:
            name, content = with_conditions(name, content, _field("conditions", conditions, *CONDITIONS))
        found = inspect(name, content)
        row = here.store.add_trace(name, content)
    return JSONResponse(read_out(row, found), 201, headers={"Location": f"/api/v1/traces/{row.id}"})


@router.get("", response_model=TracePage, responses=problem_responses(404), summary="List the traces")
def index(here: Here, limit: Limit = 50, before: Before = None) -> dict[str, Any]:
    """Traces, the latest first."""
    rows = here.store.traces(limit, before)
    root = here.settings.root_path
    more = f"{root}/api/v1/traces?limit={limit}&before={rows[-1].id}" if len(rows) == limit else None
    return {"traces": [row_out(row) for row in rows], "next": more}


@router.get(
    "/{id:key}/content",
    response_class=Response,
    responses=problem_responses(404, more=binary("application/octet-stream", "The file.")),
    summary="The file of a trace",
)
def content(here: Here, id: Name) -> Response:
    """The bytes that a fit reads."""
    row = here.store.trace(id)
    given = {"Content-Disposition": attachment(row.name)}
    return Response(here.store.trace_content(id), headers=given, media_type="application/octet-stream")


@router.get("/{id:key}", response_model=TraceRead, responses=problem_responses(404), summary="Look into a trace")
def one(here: Here, id: Name) -> dict[str, Any]:
    """What was read in a trace: channels, units, conditions."""
    row = here.store.trace(id)
    try:
        found = inspected(here.store, id)[1]
    except JshellError as error:
        return unread(row, error)
    return read_out(row, found)


def _field(place: str, text: str, expected: str, remedy: str, make: Callable[[Any], Made]) -> Made:
    """What is made of the JSON in a field of a form."""
    found = json_field(place, text, expected)
    try:
        return make(found)
    except (ValidationError, TypeError) as error:
        words = f"{brief(text)} ({brief(str(error))})"
        raise BadValue(place, found=words, expected=expected, remedy=remedy) from None


def row_out(row: TraceRow) -> dict[str, Any]:
    """Fields of `TraceOut`."""
    return {name: getattr(row, name) for name in TraceOut.model_fields}


def read_out(row: TraceRow, found: TraceContent) -> dict[str, Any]:
    """Fields of `TraceRead`."""
    trace = found.trace
    times = np.asarray(trace.times, dtype=float)
    scales = trace.scales
    return row_out(row) | {
        "samples": int(times.size),
        "duration": float(times[-1] - times[0]),
        "channels": list(trace.channels),
        "sigma": list(trace.sigma),
        "units": dict(found.units),
        "conditions": conditions_of(trace.conditions),
        "scales": None
        if scales is None
        else {"length": scales.length, "pressure": scales.pressure, "density": scales.density},
        "loss": found.loss,
        "warnings": list(found.warnings),
        "error": None,
    }


def unread(row: TraceRow, error: JshellError) -> dict[str, Any]:
    """Fields of `TraceRead` of a file that cannot be read by itself."""
    blank = dict.fromkeys(("samples", "duration", "conditions", "scales", "loss"))
    words = JobFailure(**error.record()).words()
    return row_out(row) | blank | {"channels": [], "sigma": [], "units": {}, "warnings": [], "error": words}

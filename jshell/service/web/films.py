"""The pages of a film: its first frame with what is to be said of the camera, then height and width in time."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from jshell.errors import JshellError
from jshell.service import jobs
from jshell.service.jobs import of_kind, page
from jshell.service.schemas import FilmOptions
from jshell.service.state import Here, Service
from jshell.service.store import JobRow
from jshell.service.uploads import Upload
from jshell.service.web import drawing, series
from jshell.service.web.fits import common, handed_in
from jshell.service.web.forms import PageForm, Sent, onward, validated
from jshell.service.web.templates import shown

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
HOLDER = ("top", "bottom", "left", "right")
NUMBERS = ("rate", "start", "stop")
MILLIMETRE = 1e-3  # in which the page asks for a pixel's size
MODES = (
    ("slow frequency f₋", "f_minus_Hz", "omega_minus", "Hz"),
    ("fast frequency f₊", "f_plus_Hz", "omega_plus", "Hz"),
    ("decay time τ", "tau_s", "tau", "s"),
)


def looked(here: Service, film: str | Upload, fields: Mapping[str, str] | None = None) -> Response:
    """Go to the first look at a film."""
    job = here.store.submit("look", {}, [film]).job
    return RedirectResponse(page(job) + (f"?{urlencode(fields)}" if fields else ""), 303)


@router.get("/looks/{id}")
def look(request: Request, here: Here, id: str, sent: Sent) -> Response:
    """The first frame of a film, and what is to be said of the camera."""
    return _asking(request, here, of_kind(here.store, id, "look"), sent)


def _asking(request: Request, here: Service, job: JobRow, sent: PageForm) -> Response:
    given = common(here, job) | {"fields": sent.fields, "error": sent.error, "film": job.traces[0]}
    if job.state == "done":
        given["seen"] = jobs.found_by(here.store, job)
    return shown(request, "look.html", given, 200 if sent.error is None else 422)


@router.post("/looks")
def again(here: Here, sent: Sent) -> Response:
    """Back to a film's first look, with what was said of the camera."""
    fields = {name: text for name, text in sent.fields.items() if text}
    return looked(here, fields.pop("film", ""), fields)


@router.post("/films")
def measure(request: Request, here: Here, sent: Sent) -> Response:
    """Hand the measurement in, and go to its page; or say what is wrong, with all fields as they were."""
    looked = of_kind(here.store, sent.fields.pop("look", ""), "look")
    try:
        grid: list[Any] = [Upload.of(*one) for one in sent.uploads("grid")[:1]]
        if not grid and sent.text("kept"):
            grid = [sent.text("kept")]
        asked = jobs.specification(_options(sent)) | ({"grid": True} if grid else {})
        return handed_in(here, "film", asked, [looked.traces[0], *grid])
    except JshellError as error:
        sent.error = error
        return _asking(request, here, looked, sent)


def _options(form: PageForm) -> FilmOptions:
    """The API's request, from the form's fields.

    Raises:
        BadValue: No number, or one outside its meaning.
    """
    asked: dict[str, Any] = {name: form.number(name) for name in NUMBERS if form.text(name)}
    if form.text("pixel"):
        asked["pixel"] = MILLIMETRE * form.number("pixel")
    if form.text("find") or form.text("axis"):
        asked["axis"] = None if form.text("find") else form.number("axis")
    asked |= {name: True for name in ("bright", "section") if form.text(name)}
    if any(form.text(name) for name in HOLDER):
        asked["holder"] = tuple(form.number(name) for name in HOLDER)
    return validated(FilmOptions, asked, "Correct the field.")


def _fields(job: JobRow) -> dict[str, str]:
    """The fields that ask for a measurement once more."""
    asked = job.specification
    fields = {name: f"{asked[name]:.10g}" for name in NUMBERS if asked.get(name) is not None}
    if asked.get("pixel"):
        fields["pixel"] = f"{asked['pixel'] / MILLIMETRE:.10g}"
    if "axis" in asked:
        fields |= {"find": "on"} if asked["axis"] is None else {"axis": f"{asked['axis']:.10g}"}
    fields |= {name: "on" for name in ("bright", "section") if asked.get(name)}
    fields |= dict(zip(HOLDER, map(str, asked.get("holder") or ()), strict=False))
    return fields | ({"kept": job.traces[1]} if len(job.traces) > 1 else {})


@router.get("/films/{id}")
def film(request: Request, here: Here, id: str) -> Response:
    """A film: where it stands, and what it shows."""
    job = of_kind(here.store, id, "film")
    given = common(here, job) | {"asked": job.specification, "again": [("film", job.traces[0]), *_fields(job).items()]}
    if job.state == "done":
        found, trace = jobs.found_by(here.store, job), jobs.trace_of(here.store, job.id)
        signature = found["signature"]
        scale = _in_hertz(signature)
        rows = []
        for words, key, error, unit in MODES:
            sigma = signature["stderr"].get(error)
            rows.append((words, signature.get(key), sigma * scale[unit] if sigma is not None and scale else None, unit))
        given |= {"found": found, "signature": signature, "rows": rows}
        given["plots"] = series.of_trace(trace, list(trace.channels))
        given["fits"] = "H" in trace.channels or "V" in trace.channels
    return shown(request, "film.html", given)


def _in_hertz(signature: Mapping[str, Any]) -> dict[str, float] | None:
    """How many Hz, and how many s, are one unit of the signature's numbers."""
    if not signature.get("omega_minus") or not signature.get("f_minus_Hz"):
        return None
    unit = signature["f_minus_Hz"] / signature["omega_minus"]
    seconds = signature["tau_s"] / signature["tau"] if signature.get("tau") and signature.get("tau_s") else 1.0
    return {"Hz": unit, "s": seconds}


@router.get("/films/{id}/trace.svg")
def drawn(here: Here, id: str) -> Response:
    """Height and width in time for a browser without JavaScript."""
    trace = jobs.trace_of(here.store, of_kind(here.store, id, "film").id)
    return Response(drawing.svg(series.of_trace(trace, list(trace.channels))), media_type="image/svg+xml")


@router.get("/films/{id}/overlay.png")
def overlay(here: Here, id: str) -> Response:
    """Frames with their outlines."""
    return Response(here.store.result(of_kind(here.store, id, "film").id, "overlay.png"), media_type="image/png")


@router.get("/looks/{id}/frame.png")
def frame(here: Here, id: str) -> Response:
    """The first frame."""
    return Response(here.store.result(of_kind(here.store, id, "look").id, "frame.png"), media_type="image/png")


@router.post("/films/{id}/fit")
def fit(here: Here, id: str) -> Response:
    """Go on to a fit of what the film shows, as if it had been uploaded."""
    job = of_kind(here.store, id, "film")
    name = jobs.file_name(here.store, job, "json")
    row = here.store.add_trace(name, here.store.result(job.id, "trace.json"))
    return onward(True, [row.id])

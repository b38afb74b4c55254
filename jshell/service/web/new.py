"""The page of a new fit: files in, what was found in them, what is to be fitted."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from jshell import io
from jshell.calibration.data import usual_channels
from jshell.calibration.options import CONSTANTS
from jshell.errors import BadFile, BadValue, JshellError
from jshell.io.headers import REDUCED_KEYS, SHARED_KEYS, SI_KEYS
from jshell.quantities import QUANTITIES
from jshell.service.films import is_film
from jshell.service.jobs import packed, refuse_too_many, specification
from jshell.service.preview import Preview, preview
from jshell.service.reading import UPLOAD_SLOTS, TraceContent, conditions_of, inspect, inspected, with_conditions
from jshell.service.state import Here, Service
from jshell.service.uploads import Upload
from jshell.service.web import drawing, series, settle
from jshell.service.web.films import looked
from jshell.service.web.fits import handed_in
from jshell.service.web.forms import CONDITIONS, MODAL, STRICT, PageForm, Sent, choice, onward, selects
from jshell.service.web.templates import shown, symbol, words

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
EXAMPLE = "attached_R_HW.csv"
_SI_WORDS = {
    "R0_m": "radius R₀ [m]",
    "d_m": "thickness d [m]",
    "E_Pa": "Young's modulus E [Pa]",
    "P0_Pa": "gas pressure P₀ [Pa]",
    "Pext_Pa": "outer pressure Pₑₓₜ [Pa]",
    "rho_f_kg_m3": "density of the liquid ρ [kg/m³]",
    "eta_f_Pa_s": "viscosity of the liquid η [Pa s]",
}


@router.get("/fits/new")
def form(request: Request, here: Here, asked: Sent) -> Response:
    """Where files are handed in; and, with traces chosen, the form of the fit."""
    if not asked.traces:
        return shown(request, "upload.html", {"error": None, "limit": here.settings.upload})
    return configured(request, here, asked, 200)


@router.get("/fits/new/preview.svg")
def drawn(here: Here, asked: Sent) -> Response:
    """The preview's curves for a browser without JavaScript."""
    names, looks = _looks(here, asked.traces)
    plots = series.of_preview(_previewed(asked, looks), [one.trace for one in looks], names)
    return Response(drawing.svg(plots), media_type="image/svg+xml")


@router.post("/traces")
def upload(request: Request, here: Here, sent: Sent) -> Response:
    """Take files, and go on to the form, to their conditions, or, for an archive, to the batch."""
    with UPLOAD_SLOTS:
        return _kept(request, here, sent.uploads("file"))


def _kept(request: Request, here: Service, given: Sequence[tuple[str, bytes]]) -> Response:
    try:
        if not given:
            raise BadValue("file", found="none", expected="a file", remedy="Choose one first.")
        films = [name for name, content in given if is_film(name, content)]
        if films and len(given) > 1:
            raise BadValue(
                films[0], found="a film among other files", expected="one film by itself",
                remedy="Send it alone; a grid's picture is asked for next.",
            )  # fmt: skip
        if films:
            return looked(here, Upload.of(*given[0]))
        if len(given) == 1 and (found := traces_in(*given[0])) is not None:
            refuse_too_many(found, here.settings.traces)
            return handed_in(here, "batch", {}, [Upload.of(*given[0])])
        ids, lacking = [], False
        for name, content in given:
            lacking |= inspect(name, content).trace.conditions is None
            ids.append(here.store.add_trace(name, content).id)
    except JshellError as error:
        if len(given) == 1 and settle.columns(*given[0]):  # it holds a table: its owner may say what it leaves open
            return settle.page(request, here, PageForm([here.store.add_trace(*given[0]).id], error=error))
        return shown(request, "upload.html", {"error": error, "limit": here.settings.upload}, 422)
    return onward(lacking, ids)


def traces_in(name: str, content: bytes) -> int | None:
    """How many traces a file of many holds; None where it is a file of one.

    Raises:
        BadFile: An archive that cannot be opened.
    """
    suffix = PurePath(name).suffix.lower()
    found = packed(name, content) if suffix in (".zip", ".npz") else 1
    return found if suffix == ".zip" or found > 1 else None


@router.post("/examples")
def try_example(here: Here) -> Response:
    """The example recording, as if it had been uploaded."""
    row = here.store.add_trace(EXAMPLE, io.example(EXAMPLE).read_bytes())
    return onward(False, [row.id])


@router.get("/traces/conditions")
def ask_conditions(request: Request, here: Here, sent: Sent) -> Response:
    """The shell and its load, for files that do not say."""
    return _conditions(request, here, sent)


@router.post("/traces/conditions")
def give_conditions(request: Request, here: Here, sent: Sent) -> Response:
    """Write the conditions into the files, and go on to the form."""
    try:
        numbers = {key: sent.number(key) for key in (*REDUCED_KEYS, *SI_KEYS, *SHARED_KEYS) if sent.text(key)}
        ids = []
        for trace in sent.traces:
            row = here.store.trace(trace)
            name, content = with_conditions(row.name, here.store.trace_content(trace), numbers)
            if inspect(name, content).trace.conditions is None:
                raise BadFile(
                    "conditions", found="none", expected="thickness, pressures, viscosity", remedy="Fill in one column."
                )
            ids.append(here.store.add_trace(name, content).id)
    except JshellError as error:
        sent.error = error
        return _conditions(request, here, sent)
    return onward(False, ids)


def _conditions(request: Request, here: Service, sent: PageForm) -> Response:
    given = {
        "rows": [here.store.trace(one) for one in sent.traces],
        "fields": sent.fields,
        "error": sent.error,
        "reduced": [(key, f"{QUANTITIES[key].symbol}, {QUANTITIES[key].words}") for key in REDUCED_KEYS],
        "si": list(_SI_WORDS.items()),
        "shared": [(key, f"{QUANTITIES[key].symbol}, {QUANTITIES[key].words}") for key in SHARED_KEYS],
    }
    return shown(request, "conditions.html", given, 200 if sent.error is None else 422)


@router.post("/fits")
def submit(request: Request, here: Here, asked: Sent) -> Response:
    """Hand the fit in, and go to its page; or say what is wrong, with all fields as they were."""
    try:
        _unsay_usual_channels(here, asked)
        wanted = asked.request()
        return handed_in(here, "fit", specification(wanted), wanted.traces)
    except JshellError as error:
        asked.error = error
        return configured(request, here, asked, 429 if error.code == "queue_full" else 422)


def _unsay_usual_channels(here: Service, asked: PageForm) -> None:
    """Channels that the library would choose itself are not said, so that the same fit is the same job."""
    traces = [one.trace for one in _looks(here, asked.traces)[1]]
    if traces and set(asked.channels) == set(usual_channels(traces, asked.text("loss") or None)[1]):
        asked.channels = []


def configured(request: Request, here: Service, asked: PageForm, status: int) -> Response:
    """The form of a fit of chosen traces; without any, the page where they are handed in."""
    if not asked.traces:
        return without_traces(request, here)
    names, looks = _looks(here, asked.traces)
    if any(one.trace.conditions is None for one in looks):
        return onward(True, asked.traces)
    found, refused = None, None
    try:
        found = _previewed(asked, looks)
    except JshellError as error:
        refused = error
    loss = found.loss if found is not None else asked.text("loss") or looks[0].loss
    shared = [name for name in looks[0].trace.channels if all(name in one.trace.channels for one in looks)]
    own = STRICT if loss == "strict" else MODAL
    given = {
        "form": asked,
        "traces": [_facts(id, name, one) for id, name, one in zip(asked.traces, names, looks, strict=True)],
        "preview": found,
        "plots": [] if found is None else series.of_preview(found, [one.trace for one in looks], names),
        "refused": refused,
        "loss": loss,
        "channels": shared,
        "parameters": [(name, symbol(name), words(name), _begin(found, name)) for name in own],
        "uncertain": list(CONDITIONS.items()),
        "losses": choice("loss").values[1:],
        "rest": choice("equilibrium"),
        "selects": selects(loss),
        "query": str(request.url.query) if request.method == "GET" else "&".join(f"trace={t}" for t in asked.traces),
        "time": _time(looks),
        "drags": _drags(looks, _time(looks)),
        "lone": len(looks) == 1 and loss == "modal" and not any(asked.role(name) == "fixed" for name in CONSTANTS),
    }
    return shown(request, "new.html", given, status)


def without_traces(request: Request, here: Service) -> Response:
    """The page where files are handed in, for a form that came without any."""
    error = BadValue("traces", found="none", expected="at least one", remedy="Choose a file first.")
    return shown(request, "upload.html", {"error": error, "limit": here.settings.upload}, 422)


def _looks(here: Service, traces: Sequence[str]) -> tuple[list[str], list[TraceContent]]:
    pairs = [inspected(here.store, trace) for trace in traces]
    return [name for name, _ in pairs], [one for _, one in pairs]


def _previewed(asked: PageForm, looks: Sequence[TraceContent]) -> Preview:
    fix = {
        name: asked.number(f"value.{name}")
        for name in CONSTANTS
        if asked.role(name) == "fixed" and asked.text(f"value.{name}")
    }
    ends = {name: asked.time(name) for name in ("start", "stop") if asked.text(name)}
    return preview(
        [one.trace for one in looks],
        asked.text("loss") or None,
        asked.channels or None,
        equilibrium=asked.text("equilibrium") or "plateau",
        fix=fix,
        **ends,
    )


def _time(looks: Sequence[TraceContent]) -> tuple[str, float]:
    """In which unit the form asks for times, and how many of it are one dimensionless unit."""
    read = [series.axis(one.trace, "t") for one in looks]
    if len({(one.unit, one.factor) for one in read}) > 1 or not read[0].unit:
        return "dimensionless", 1.0
    return read[0].unit, read[0].factor


def _drags(looks: Sequence[TraceContent], time: tuple[str, float]) -> bool:
    """Whether the curves' time is the form's, so that a window can be dragged."""
    return time[0] != "dimensionless" or all(one.trace.scales is None for one in looks)


def _begin(found: Preview | None, name: str) -> str:
    if found is None:
        return "–"
    values = [value for key, value in found.start.items() if key.partition("[")[0] == name]
    return ", ".join(f"{value:.4g}" for value in values[:4]) + (" …" if len(values) > 4 else "") or "–"


def _facts(id: str, name: str, found: TraceContent) -> dict[str, Any]:
    trace = found.trace
    times = np.asarray(trace.times, dtype=float)
    time = series.axis(trace, "t")
    columns = [
        {"name": one, "unit": unit, "words": QUANTITIES[one].words if one in QUANTITIES else "a channel of your own"}
        for one, unit in found.units.items()
    ]
    return {
        "id": id,
        "name": name,
        "samples": times.size,
        "span": f"{time.factor * times[0]:.4g} to {time.factor * times[-1]:.4g} {time.unit or '√(ρ R₀³/E d)'}",
        "columns": columns,
        "conditions": [
            (QUANTITIES[key].symbol, QUANTITIES[key].words, value)
            for key, value in (conditions_of(trace.conditions) or {}).items()
        ],
        "unit": trace.scales,
        "warnings": found.warnings,
    }

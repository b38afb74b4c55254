"""The page of a shell with its sliders; and that of a simulator's run."""

import json
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse

from jshell.errors import JshellError
from jshell.oscillator import SOURCE
from jshell.service import jobs, shape
from jshell.service.api.simulate import answered, conditions
from jshell.service.jobs import modes_specification, of_kind, simulator_specification
from jshell.service.schemas import ModesRequest, SimulateRequest
from jshell.service.state import Here
from jshell.service.web import drawing, series
from jshell.service.web.fits import common, handed_in
from jshell.service.web.forms import PageForm, Sent, validated
from jshell.service.web.templates import shown

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
# name, symbol, words, lowest, highest, step: the ranges of the source's simulations
SLIDERS = (
    ("d_hat", "d̂", "thickness over radius", 0.02, 0.3, 0.005),
    ("P0_hat", "P̂₀", "gas pressure", 0.2, 5.0, 0.05),
    ("Pext_hat", "P̂ₑₓₜ", "outer pressure", 0.2, 8.0, 0.01),
    ("eta_hat", "η̂", "viscosity of the liquid", 0.0, 0.1, 0.001),
)
MASSES = ("alpha1", "alpha2", "k_vs")
CHANNELS = ("V", "S", "H", "W")


@router.get("/simulate")
def sliders(request: Request, here: Here, sent: Sent) -> Response:
    """A shell: the simulator's rest shape and modes, the short model beside."""
    fields = sent.fields
    asked, found, error = SimulateRequest(), None, None  # pyright: ignore[reportCallIssue]
    try:
        asked = _asked(sent)
        found = answered(asked)
    except JshellError as wrong:
        error = wrong
    slow, sphere = (None, None) if found is None else (found["omega_minus"], found["omega_sphere"])
    given = {
        "asked": asked,
        "found": found,
        "error": error,
        "plots": [] if found is None else series.of_answer(found),
        "sliders": [
            (name, symbol, words, low, high, step, fields.get(name, f"{getattr(asked, name):.6g}"))
            for name, symbol, words, low, high, step in SLIDERS
        ],
        # β₁ stays empty until somebody gives one: empty, the simulator's modes say how fast it rings down
        "constants": [(name, fields.get(name) or f"{float(getattr(SOURCE, name)):.5g}", "") for name in MASSES]
        + [("beta1", fields.get("beta1", ""), "as the simulator")],
        "query": urlencode({name: text for name, text in fields.items() if text}),
        "drop": sphere / slow if slow and sphere else None,
    }
    return shown(request, "simulate.html", given, 200 if error is None else 422)


@router.get("/simulate.svg")
def drawn(sent: Sent) -> Response:
    """The same curves for a browser without JavaScript."""
    return Response(drawing.svg(series.of_answer(answered(_asked(sent)))), media_type="image/svg+xml")


@router.get("/simulate/shape")
def shaped(sent: Sent) -> Response:
    """Rest shape and modes as numbers, while the sliders move; the short model's beside them."""
    asked = _asked(sent)
    short = answered(asked)
    beside = {
        "omega": [short["omega_minus"], short["omega_plus"]],
        "tau": short["tau"],
        "load": short["softening"]["load"],
    }
    return JSONResponse(shape.answer(conditions(asked)) | {"short": beside})


@router.get("/simulate/exact")
def exactly(sent: Sent) -> Response:
    """Its modes in the exact liquid, and whether it is round."""
    return JSONResponse(shape.exact(conditions(_asked(sent))))


@router.get("/simulate/shape.svg")
def shape_drawn(sent: Sent) -> Response:
    """The shell for a browser without JavaScript."""
    return Response(drawing.shell(shape.found_of(conditions(_asked(sent))).found), media_type="image/svg+xml")


@router.post("/simulations")
def run(here: Here, sent: Sent) -> Response:
    """Hand a run of the simulator in."""
    return handed_in(here, "simulate", simulator_specification(_asked(sent)), [])


@router.post("/modes")
def find_modes(here: Here, sent: Sent) -> Response:
    """Ask for the modes of the shell on the sliders, in the exact liquid."""
    return handed_in(here, "modes", modes_specification(ModesRequest.model_validate(_asked(sent).shell())), [])


@router.get("/modes/{id}")
def modes(request: Request, here: Here, id: str) -> Response:
    """The modes of a shell."""
    job = of_kind(here.store, id, "modes")
    given = common(here, job) | {"asked": job.specification, "conditions": job.specification.get("conditions", {})}
    if job.state == "done":
        given |= {"rows": jobs.found_by(here.store, job)}
    return shown(request, "modes.html", given)


@router.get("/simulations/{id}")
def simulation(request: Request, here: Here, id: str) -> Response:
    """A run of the simulator: its conditions, its motion."""
    job = of_kind(here.store, id, "simulate")
    given = common(here, job) | {"conditions": job.specification.get("conditions", {})}
    if job.state == "done":
        trace = jobs.trace_of(here.store, job.id)
        given |= {"plots": series.of_trace(trace, [one for one in CHANNELS if one in trace.channels])}
        given["film"] = "film.json" in here.store.result_names(job.id)
    return shown(request, "simulation.html", given)


@router.get("/simulations/{id}/film")
def film(here: Here, id: str) -> Response:
    """Its shapes in time."""
    found = here.store.result(of_kind(here.store, id, "simulate").id, "film.json")
    return Response(found, media_type="application/json")


@router.get("/simulations/{id}/film.svg")
def film_drawn(here: Here, id: str) -> Response:
    """Some of them for a browser without JavaScript."""
    found = here.store.result(of_kind(here.store, id, "simulate").id, "film.json")
    return Response(drawing.strip(json.loads(found)), media_type="image/svg+xml")


@router.get("/simulations/{id}/trace.svg")
def simulation_drawn(here: Here, id: str) -> Response:
    """Its motion for a browser without JavaScript."""
    trace = jobs.trace_of(here.store, of_kind(here.store, id, "simulate").id)
    plots = series.of_trace(trace, [one for one in CHANNELS if one in trace.channels])
    return Response(drawing.svg(plots), media_type="image/svg+xml")


def _asked(form: PageForm) -> SimulateRequest:
    """The API's request, from the form's fields.

    Raises:
        BadValue: No number, or one outside its meaning.
    """
    names = [name for name in SimulateRequest.model_fields if name != "model" and form.text(name)]
    return validated(SimulateRequest, {name: form.number(name) for name in names}, "Move the slider.")

"""The pages of an inversion: what is known of the shell and what is asked, then what shell it is."""

import json
from typing import Any
from urllib.parse import urlencode

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.concurrency import run_in_threadpool

from jshell.errors import BadValue, JshellError, NotFound
from jshell.inversion.recording import header
from jshell.inversion.response import CHANNELS
from jshell.inversion.unknowns import PLAIN, SI, Number
from jshell.plot.inversions import shown_in
from jshell.plot.style import BLACK, BLUE, CHANNEL
from jshell.quantities import QUANTITIES
from jshell.service import jobs
from jshell.service.jobs import invert_specification, of_kind
from jshell.service.reading import TraceContent, inspected
from jshell.service.schemas import InvertRequest
from jshell.service.state import Here, Service
from jshell.service.store import JobRow
from jshell.service.web import drawing
from jshell.service.web.fits import common
from jshell.service.web.forms import FitForm, read, received, validated
from jshell.service.web.series import Line, Plot, thinned
from jshell.service.web.templates import shown

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
WORDS = {
    "youngs_modulus": "Young's modulus E",
    "gas_pressure": "gas pressure P₀ of the stress-free shell",
    "outer_pressure": "outer pressure Pₑₓₜ",
    "thickness": "thickness d",
    "radius": "radius R₀",
    "density": "density of the liquid ρ",
    "viscosity": "viscosity of the liquid η",
    "pad": "half-angle of the holder's pad, 0 is free",
    "weak_spot": "relative loss of thickness at the buckling pole",
    "kappa": "polytropic exponent of the gas κ",
    "poisson_ratio": "Poisson's ratio ν",
}
WAYS = ("free_rest", "exact")  # what is ticked or not
TIMES = ("start", "stop", "ramp", "origin")
MARK = "asks"  # a field that says that the form was filled in, so that what is not ticked means no


@router.get("/inversions/new")
def form(request: Request, here: Here) -> Response:
    """What is known and what is asked of traces that were handed in."""
    asked = read(request.query_params)
    if not asked.traces:
        return RedirectResponse("/fits/new", 303)
    return _configured(request, here, asked, 200)


@router.post("/inversions")
async def submit(request: Request, here: Here) -> Response:
    """Hand the inversion in, and go to its page; or say what is wrong, with all fields as they were."""
    return await run_in_threadpool(_submitted, request, here, await received(request))


def _submitted(request: Request, here: Service, asked: FitForm) -> Response:
    try:
        wanted = _asked(asked)
        job = here.store.submit("invert", invert_specification(wanted), wanted.traces).job
    except JshellError as error:
        asked.error = error
        return _configured(request, here, asked, 429 if error.code == "queue_full" else 422)
    return RedirectResponse(f"/inversions/{job.id}", 303)


def _configured(request: Request, here: Service, asked: FitForm, status: int) -> Response:
    looks = [inspected(here.store, trace) for trace in asked.traces]
    si = _in_si([one for _, one in looks])
    said = header(looks[0][1].trace, si)
    known = {name: _number(said[name]) for name in said}
    given = {
        "form": asked,
        "names": [name for name, _ in looks],
        "rows": [(name, WORDS[name], one, _said(name, one, known)) for name, one in _table(si).items()],
        "channels": [name for name in CHANNELS if all(name in one.trace.channels for _, one in looks)],
        "time": "s" if si or looks[0][1].trace.conditions is None else "time unit",
        "fresh": not asked.text(MARK),
        "several": len(looks) > 1,
        "mark": MARK,
    }
    return shown(request, "ask_shell.html", given, status)


def _in_si(looks: list[TraceContent]) -> bool:
    """Whether the form asks in SI: the files have units, or say nothing of the shell."""
    return any(one.trace.scales is not None for one in looks) or all(one.trace.conditions is None for one in looks)


def _table(si: bool) -> dict[str, Number]:
    table = SI if si else PLAIN
    return {name: table[name] for name in WORDS if name in table}


def _said(name: str, one: Number, known: dict[str, str]) -> str:
    """What is taken of a number where nobody says anything."""
    if name in known:
        return known[name]
    return "" if one.usual is None else f"{one.usual:g}, usual"


def _number(value: float) -> str:
    return f"{value:.6g}"


def _asked(form: FitForm) -> InvertRequest:
    """The API's request, from the form's fields.

    Raises:
        BadValue: No number, one outside its meaning, or nothing asked.
    """
    asked: dict[str, Any] = {"traces": form.traces, "unknown": [], "known": {}, "bounds": {}, "priors": {}, "local": []}
    for name in WORDS:
        role = form.role(name)
        if role == "known":
            asked["known"][name] = form.number(f"value.{name}")
        elif role in ("asked", "local"):
            asked["unknown"].append(name)
            asked["local"] += [name] if role == "local" else []
            if form.text(f"value.{name}") or form.text(f"error.{name}"):
                asked["priors"][name] = {
                    "mean": form.number(f"value.{name}"), "sigma": form.number(f"error.{name}")
                }  # fmt: skip
            low, high = (
                form.number(f"{end}.{name}") if form.text(f"{end}.{name}") else None for end in ("low", "high")
            )
            if low is not None or high is not None:
                asked["bounds"][name] = (low, high)
    if not asked["unknown"]:
        raise BadValue(
            "what is asked", found="nothing", expected="a number of the shell",
            remedy="Choose `asked` for one, such as Young's modulus.",
        )  # fmt: skip
    if form.channels:
        asked["channels"] = form.channels
    if form.text("level"):
        asked["level"] = form.text("level")
    for name in TIMES:
        if form.text(name):
            asked[name] = form.number(name)
    if form.text("nuisance"):
        asked["nuisance"] = form.text("nuisance") == "yes"
    if form.text(MARK):
        asked |= {name: form.text(name) == "on" for name in WAYS}
    return validated(InvertRequest, asked, "Correct the field.")


def _again(job: JobRow) -> list[tuple[str, str]]:
    """The fields that ask for a job once more, for a link to the form."""
    asked = job.specification
    pairs = [("trace", trace) for trace in job.traces] + [("channel", name) for name in asked.get("channels") or ()]
    for name, value in (asked.get("known") or {}).items():
        pairs += [(f"role.{name}", "known"), (f"value.{name}", f"{value:.10g}")]
    for name in asked.get("unknown") or ():
        pairs.append((f"role.{name}", "local" if name in asked.get("local", ()) else "asked"))
    for name, prior in (asked.get("priors") or {}).items():
        pairs += [(f"value.{name}", f"{prior['mean']:.10g}"), (f"error.{name}", f"{prior['sigma']:.10g}")]
    for name, ends in (asked.get("bounds") or {}).items():
        pairs += [(f"{end}.{name}", f"{x:.10g}") for end, x in zip(("low", "high"), ends, strict=True) if x is not None]
    pairs += [(name, f"{asked[name]:.10g}") for name in TIMES if asked.get(name) is not None]
    pairs += [("level", asked["level"])] if "level" in asked else []
    if asked.get("nuisance") is not None:
        pairs.append(("nuisance", "yes" if asked["nuisance"] else "no"))
    pairs += [(name, "on") for name, usual in zip(WAYS, (False, True), strict=True) if asked.get(name, usual)]
    return [*pairs, (MARK, "on")]


@router.get("/inversions/{id}")
def inversion(request: Request, here: Here, id: str) -> Response:
    """An inversion: where it stands, and what it found."""
    job = of_kind(here.store, id, "invert")
    given = common(here, job) | {"again": urlencode(_again(job)), "asked": job.specification}
    if job.state == "done":
        found = jobs.inverted(here.store, job.id)
        given |= {"found": found, "words": WORDS, "plots": _plots(here, job)}
    return shown(request, "inversion.html", given)


@router.get("/inversions/{id}/inversion.svg")
def drawn(here: Here, id: str) -> Response:
    """Data and curve for a browser without JavaScript."""
    plots = _plots(here, of_kind(here.store, id, "invert"))
    if not plots:
        raise NotFound(
            f"job {id!r}", found="no curve", expected="a search that ended somewhere", remedy="Ask for fewer unknowns."
        )
    return Response(drawing.svg(plots), media_type="image/svg+xml")


def _plots(here: Service, job: JobRow) -> list[Plot]:
    """Every recording and channel with the simulator's curve; none where the search ended nowhere."""
    try:
        told = json.loads(here.store.result(job.id, "curves.json"))
    except NotFound:
        return []
    plots = []
    for one in told:
        times = np.asarray(one["t"], dtype=float)
        second, clock = shown_in("t", times, one["si"])
        for channel, both in one["channels"].items():
            row = QUANTITIES[channel]
            factor, unit = shown_in(channel, np.asarray(both["data"], dtype=float), one["si"])
            at, data, curve = thinned(
                second * times, *(factor * np.asarray(both[name], dtype=float) for name in ("data", "curve"))
            )
            left = float(np.std(data - curve) / max(float(np.std(data)), 1e-300))
            of = f"{one['name']}: " if len(told) > 1 else ""
            label, time = f"{row.symbol} [{unit}]", f"t [{clock}]" if one["si"] else "t"
            words = f"{of}{label} over {time}: data and simulator, which leaves {100 * left:.2g} % of the scatter."
            lines = (
                Line("data", CHANNEL.get(channel, BLUE), data, 1, dots=True), Line("simulator", BLACK, curve, 1.3)
            )  # fmt: skip
            plots.append(Plot(f"{of}{label}", words, time, label, at, lines))
    return plots

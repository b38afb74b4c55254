"""The pages of an inversion: what is known of the shell and what is asked, then what shell it is."""

import json
from typing import Any
from urllib.parse import urlencode

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from jshell.errors import BadValue, JshellError, NotFound
from jshell.inversion.recording import header
from jshell.inversion.response import CHANNELS
from jshell.inversion.unknowns import PLAIN, SI
from jshell.plot.inversions import shown_in
from jshell.quantities import QUANTITIES
from jshell.service import jobs
from jshell.service.jobs import of_kind, specification
from jshell.service.reading import inspected
from jshell.service.schemas import InvertRequest
from jshell.service.state import Here, Service
from jshell.service.store import JobRow
from jshell.service.web import drawing
from jshell.service.web.fits import common, handed_in
from jshell.service.web.forms import PageForm, Sent, validated
from jshell.service.web.new import without_traces
from jshell.service.web.series import Plot, compared, thinned
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
    "retardation": "Kelvin–Voigt time of the wall, 0 loses nothing",
    "pad": "half-angle of the holder's pad, 0 is free",
    "weak_spot": "relative loss of thickness at the buckling pole",
    "kappa": "polytropic exponent of the gas κ",
    "poisson_ratio": "Poisson's ratio ν",
}
WAYS = ("free_rest", "exact")  # what is ticked or not
TIMES = ("start", "stop", "ramp", "origin")
MARK = "asks"  # a field that says that the form was filled in, so that what is not ticked means no


@router.get("/inversions/new")
def form(request: Request, here: Here, asked: Sent) -> Response:
    """What is known and what is asked of traces that were handed in."""
    if not asked.traces:
        return RedirectResponse("/fits/new", 303)
    return _configured(request, here, asked, 200)


@router.post("/inversions")
def submit(request: Request, here: Here, asked: Sent) -> Response:
    """Hand the inversion in, and go to its page; or say what is wrong, with all fields as they were."""
    try:
        wanted = _asked(asked)
        return handed_in(here, "invert", specification(wanted), wanted.traces)
    except JshellError as error:
        asked.error = error
        return _configured(request, here, asked, 429 if error.code == "queue_full" else 422)


def _configured(request: Request, here: Service, asked: PageForm, status: int) -> Response:
    if not asked.traces:
        return without_traces(request, here)
    looks = [inspected(here.store, trace) for trace in asked.traces]
    traces = [one.trace for _, one in looks]
    # in SI where the files have units, or say nothing of the shell
    si = any(one.scales is not None for one in traces) or all(one.conditions is None for one in traces)
    table = SI if si else PLAIN
    said = {name: f"{one.usual:g}, usual" for name, one in table.items() if one.usual is not None}
    said |= {name: f"{value:.6g}" for name, value in header(traces[0], si).items()}
    given = {
        "form": asked,
        "names": [name for name, _ in looks],
        "rows": [(name, words, table[name], said.get(name, "")) for name, words in WORDS.items() if name in table],
        "channels": [name for name in CHANNELS if all(name in one.channels for one in traces)],
        "time": "s" if si or traces[0].conditions is None else "time unit",
        "fresh": not asked.text(MARK),
        "several": len(looks) > 1,
        "mark": MARK,
    }
    return shown(request, "ask_shell.html", given, status)


def _asked(form: PageForm) -> InvertRequest:
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
            if form.bounds(name) != (None, None):
                asked["bounds"][name] = form.bounds(name)
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
        found = jobs.found_by(here.store, job)
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
        curves = json.loads(here.store.result(job.id, "curves.json"))
    except NotFound:
        return []
    plots = []
    for one in curves:
        times = np.asarray(one["t"], dtype=float)
        second, clock = shown_in("t", times, one["si"])
        for channel, both in one["channels"].items():
            row = QUANTITIES[channel]
            factor, unit = shown_in(channel, np.asarray(both["data"], dtype=float), one["si"])
            columns = (factor * np.asarray(both[name], dtype=float) for name in ("data", "curve"))
            of = f"{one['name']}: " if len(curves) > 1 else ""
            labels = f"t [{clock}]" if one["si"] else "t", f"{row.symbol} [{unit}]"
            plots.append(compared("simulator", of, labels, channel, thinned(second * times, *columns)))
    return plots

"""The page of a job: a fit with all that is known of it, a batch, and what both need."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import urlencode

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from jshell.calibration import Estimate, FitResult
from jshell.errors import RangeWarning
from jshell.service import jobs
from jshell.service.jobs import files, of_kind, page, title
from jshell.service.kinds import PLURAL
from jshell.service.reading import conditions_of
from jshell.service.state import Here, Service
from jshell.service.store import JobRow
from jshell.service.uploads import Upload
from jshell.service.web import drawing, series
from jshell.service.web.forms import again, python
from jshell.service.web.templates import shown
from jshell.shell.rest import buckled_state

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)
ROWS = 50  # of a batch's table on its page
FREQUENCIES = ("omega_minus", "omega_plus")


@router.get("/fits/{id}")
def fit(request: Request, here: Here, id: str) -> Response:
    """A fit: where it stands, and what it found."""
    job = of_kind(here.store, id, "fit")
    given = common(here, job) | {"again": urlencode(again(job))}
    if job.state == "done":
        given |= _found(here, job)
    return shown(request, "fit.html", given)


@router.get("/fits/{id}/fit.svg")
def fit_drawn(here: Here, id: str) -> Response:
    """Data, fit and residual for a browser without JavaScript."""
    job = of_kind(here.store, id, "fit")
    pairs = series.of_fit(jobs.fit_result(here.store, job.id), _names(here, job))
    plots = [plot for pair in pairs for plot in pair]
    return Response(drawing.svg(plots), media_type="image/svg+xml")


@router.get("/batches/{id}")
def batch(request: Request, here: Here, id: str) -> Response:
    """A batch: how many ended how, and the first rows."""
    job = of_kind(here.store, id, "batch")
    given = common(here, job)
    if job.state == "done":
        found = jobs.batch_result(here.store, job.id)
        outcomes = found.outcomes
        counts = {o: outcomes.count(o) for o in dict.fromkeys(outcomes)}
        spread = {}
        for name in ("alpha1", "alpha2", "k_vs", "tau"):
            good = found[name][found.ok & np.isfinite(found[name])]
            if good.size:
                spread[name] = np.quantile(good, [0.16, 0.5, 0.84]).tolist()
        given |= {"found": found, "counts": counts, "spread": spread, "rows": found.rows()[:ROWS], "most": ROWS}
    return shown(request, "batch.html", given)


@router.post("/{plural}/{id}/cancel")
def cancel(here: Here, plural: str, id: str) -> Response:
    """Call a job off, and go back to its page."""
    kind = {many: one for one, many in PLURAL.items()}.get(plural, "fit")
    return RedirectResponse(page(here.store.cancel(of_kind(here.store, id, kind).id)), 303)


def handed_in(here: Service, kind: str, specification: Mapping[str, Any], traces: Sequence[str | Upload]) -> Response:
    """Hand a job in, and go to its page."""
    return RedirectResponse(page(here.store.submit(kind, specification, traces).job), 303)


def _names(here: Service, job: JobRow) -> list[str]:
    return [here.store.trace(trace).name for trace in job.traces]


def common(here: Service, job: JobRow) -> dict[str, Any]:
    """What every page of a job is given."""
    words = title(here.store, job)
    return {
        "job": job,
        "names": _names(here, job),
        "title": words if job.traces else words.capitalize(),
        "files": list(files(job).items()),
        "link": page(job),
    }


def _found(here: Service, job: JobRow) -> dict[str, Any]:
    result = jobs.fit_result(here.store, job.id)
    names = _names(here, job)
    profile = jobs.profile_of(here.store, job)
    statistics = dict(result.statistics)
    shown_first = [one for one in result.estimates if one.role != "nuisance"]
    own = [one for one in result.estimates if one.role == "nuisance"]
    unit = result.traces[0].scales.frequency if result.traces and result.traces[0].scales is not None else None
    cautions = [*result.free_directions, *result.warnings]
    return {
        "result": result,
        "plots": series.of_fit(result, names),
        "chi": statistics,
        "estimates": [_row(result, one, profile) for one in shown_first],
        "own": [_row(result, one, None) for one in own],
        "derived": [_row(result, one, None) for one in result.derived],
        "profile": profile,
        "hertz": unit,
        "time": None if unit is None else 1 / (2 * np.pi * unit),
        "read": _read(here, job, result),
        "frequencies": FREQUENCIES,
        "warnings": list(dict.fromkeys(cautions)),
        "notes": [text for text in result.notes if text not in cautions],
        "rests": _rests(result, names),
        "python": python(job, names, result.specification),
        "agree": (sum(one.agrees for one in result.starts), len(result.starts)),
    }


def _read(here: Service, job: JobRow, result: FitResult) -> list[dict[str, Any]]:
    """What of every recording was fitted."""
    rows = []
    for name, trace, curves in zip(_names(here, job), result.traces, result.curves(), strict=True):
        times = np.asarray(trace.times, dtype=float)
        time = series.axis(trace, "t")
        rows.append(
            {
                "name": name,
                "channels": list(curves),
                "samples": times.size,
                "window": f"{time.factor * times[0]:.4g} to {time.factor * times[-1]:.4g} {time.unit}".strip(),
                "conditions": list((conditions_of(trace.conditions) or {}).items()),
            }
        )
    return rows


def _row(result: FitResult, one: Estimate, profile: Mapping[str, Any] | None) -> dict[str, Any]:
    """A parameter's line: value, error, interval."""
    interval = None
    if np.isfinite(one.stderr) and one.role != "fixed":
        interval = result.interval(one.name)
    found = (profile or {}).get("intervals", {}).get(one.name)
    return vars(one) | {
        "undetermined": one.undetermined,
        "stderr": one.stderr if np.isfinite(one.stderr) else None,
        "percent": one.percent,
        "interval": interval,
        "profile": found,
    }


def _rests(result: FitResult, names: list[str]) -> list[dict[str, Any]]:
    """Where every shell rests: by the plateau law, and where its record settles."""
    settled = {one.name: one.value for one in result.estimates if one.role == "nuisance"}
    rows = []
    for number, trace in enumerate(result.traces, 1):
        if trace.conditions is None:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RangeWarning)  # the fit's own notes say the range of the law
            state = buckled_state(trace.conditions)
        volume, pressure = float(state.volume), float(state.pressure)
        unit = trace.scales.pressure if trace.scales is not None else None
        rows.append(
            {
                "name": names[number - 1] if number <= len(names) else f"trace {number}",
                "volume": volume,
                "ratio": volume / (4 * np.pi / 3),
                "pressure": pressure,
                "pascal": None if unit is None else unit * pressure,
                "settles": settled.get(f"V at rest [{number}]"),
            }
        )
    return rows

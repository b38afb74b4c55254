"""Jobs as the API and the page see them: accepted, shown, their results given out."""

import functools
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import jshell
from jshell.calibration import BatchResult, FitResult
from jshell.errors import BadFile, JshellError, NotFound
from jshell.files import NamedBytes
from jshell.service import batches
from jshell.service.kinds import PLURAL
from jshell.service.problems import Refused
from jshell.service.replies import JobOut, finite
from jshell.service.safety import neutral_csv
from jshell.service.schemas import Conditions, FilmOptions, FitRequest, InvertRequest, ModesRequest, SimulateRequest
from jshell.service.store import JobRow, Store
from jshell.trace import Trace

FILES = {  # by suffix; table and report of a batch are made of its record when they are asked for
    "fit": {"json": "record.json", "csv": "table.csv", "nc": "record.nc", "txt": "report.txt"},
    "batch": {"npz": "record.npz", "csv": "table.csv", "txt": "report.txt"},
    "simulate": {"json": "trace.json", "csv": "trace.csv", "nc": "trace.nc"},
    "modes": {"json": "modes.json", "csv": "modes.csv"},
    "look": {"json": "look.json", "png": "frame.png"},
    "film": {"json": "film.json", "csv": "trace.csv", "nc": "outlines.nc", "png": "overlay.png"},
    "invert": {"json": "inversion.json", "csv": "table.csv", "txt": "report.txt"},
}
MEDIA = {
    "json": "application/json",
    "csv": "text/csv; charset=utf-8",
    "nc": "application/x-netcdf",
    "npz": "application/zip",
    "png": "image/png",
    "txt": "text/plain; charset=utf-8",
}
EVERY = 0.1  # dimensionless time between the samples of a simulated trace
MAX_CACHED_RESULTS = 32  # results that stay in memory once read


def address(job: JobRow, suffix: str = "") -> str:
    """Where the API has a job, or one of its files."""
    return f"/api/v1/{PLURAL[job.kind]}/{job.id}{suffix}"


def shown(job: JobRow) -> dict[str, Any]:
    """A job as the API shows it; fields of `JobOut`."""
    links = {"self": address(job), "page": f"/{PLURAL[job.kind]}/{job.id}"}
    if job.state == "done":
        links |= {suffix: address(job, f".{suffix}") for suffix in FILES[job.kind]}
    return {name: getattr(job, name) for name in JobOut.model_fields if name != "links"} | {
        "traces": list(job.traces),
        "specification": finite(dict(job.specification)),
        "error": None if job.error is None else job.error.words(),
        "links": links,
    }


def of_kind(store: Store, job: str, kind: str) -> JobRow:
    """A job of a kind.

    Raises:
        NotFound: No such job, or one of another kind.
    """
    found = store.job(job)
    if found.kind != kind:
        raise NotFound(
            f"job {job!r}", found=f"a job of kind {found.kind}", expected=f"one of kind {kind}",
            remedy=f"Look at {address(found)}.",
        )  # fmt: skip
    return found


def file_of(store: Store, job: JobRow, suffix: str) -> bytes:
    """A result of a job; tables without formulas.

    Raises:
        Refused: The job is not done.
    """
    if job.state != "done":
        raise Refused(
            f"job {job.id!r}",
            code="not_ready",
            found=f"state {job.state}",
            expected="state done",
            remedy="Wait until it is done." if not job.over else f"See {address(job)} for why it has no result.",
        )
    if job.kind == "batch" and suffix != "npz":
        return batch_table(store, job.id) if suffix == "csv" else str(batch_result(store, job.id)).encode()
    content = store.result(job.id, FILES[job.kind][suffix])
    return neutral_csv(content) if suffix == "csv" else content


def file_name(store: Store, job: JobRow, suffix: str) -> str:
    """The name under which a browser keeps a result."""
    if not job.traces:
        return f"{job.kind}-{job.id[:8]}.{suffix}"
    return f"{PurePath(store.trace(job.traces[0]).name).stem}-{job.kind}-{job.id[:8]}.{suffix}"


def fit_specification(options: FitRequest) -> dict[str, Any]:
    """What a worker is asked to fit: only what differs from the library's defaults."""
    return options.model_dump(mode="json", exclude={"traces"}, exclude_defaults=True)


def simulator_specification(asked: SimulateRequest) -> dict[str, Any]:
    """What a worker is asked to simulate."""
    options = {name: getattr(asked, name) for name in ("duration", "ramp", "elements")}
    return {"model": "simulator", "conditions": _conditions(asked), "every": EVERY, **options}


def modes_specification(asked: ModesRequest) -> dict[str, Any]:
    """What modes a worker is asked for."""
    options = {name: getattr(asked, name) for name in ModesRequest.model_fields if name not in Conditions.model_fields}
    orders = options.pop("azimuth")
    if orders is None:
        return {"conditions": _conditions(asked), **options}
    if "liquid" not in asked.model_fields_set:
        options["liquid"] = None  # the best that is known of each order
    return {"conditions": _conditions(asked), **options, "azimuth": sorted(set(orders))}


def film_specification(asked: FilmOptions, grid: bool) -> dict[str, Any]:
    """What a worker is asked to measure in a film: only what differs from the usual."""
    return asked.model_dump(mode="json", exclude_defaults=True) | ({"grid": True} if grid else {})


def invert_specification(asked: InvertRequest) -> dict[str, Any]:
    """What a worker is asked to invert: only what differs from the usual."""
    return asked.model_dump(mode="json", exclude={"traces"}, exclude_defaults=True)


def _conditions(asked: Conditions) -> dict[str, float]:
    return {name: getattr(asked, name) for name in Conditions.model_fields}


@functools.lru_cache(maxsize=MAX_CACHED_RESULTS)
def fit_result(store: Store, job: str) -> FitResult:
    """The result of a fit that is done, as the library's own object."""
    return jshell.load(NamedBytes("record.json", store.result(job, "record.json")))


@functools.lru_cache(maxsize=4)
def batch_result(store: Store, job: str) -> BatchResult:
    """The result of a batch that is done, as the library's own object."""
    return batches.unpack_result(store.result(job, "record.npz"))


@functools.lru_cache(maxsize=4)
def batch_table(store: Store, job: str) -> bytes:
    """The table of a batch that is done; made when it is first asked for, for that takes longer than the fits."""
    return neutral_csv(batches.table(store.result(job, "record.npz")))


@functools.lru_cache(maxsize=8)
def simulated(store: Store, job: str) -> Trace:
    """The trace of a simulation that is done."""
    return jshell.io.read_trace(NamedBytes("trace.json", store.result(job, "trace.json")))


def modes_found(store: Store, job: str) -> list[dict[str, Any]]:
    """The modes that a job found; fields of `ModeOut`."""
    return json.loads(store.result(job, "modes.json"))


@functools.lru_cache(maxsize=8)
def filmed(store: Store, job: str) -> Trace:
    """The trace of a film that has been measured."""
    return jshell.io.read_trace(NamedBytes("trace.json", store.result(job, "trace.json")))


def film_found(store: Store, job: JobRow) -> dict[str, Any]:
    """What a look at a film, or its measurement, has found: `look.json` or `film.json`."""
    return json.loads(store.result(job.id, FILES[job.kind]["json"]))


def inverted(store: Store, job: str) -> dict[str, Any]:
    """What an inversion that is done found, as `jshell.inversion.Inversion.record` says it."""
    return json.loads(store.result(job, "inversion.json"))


def profile_of(store: Store, job: JobRow) -> Mapping[str, Any] | None:
    """Profile intervals, where they were asked for."""
    if not job.specification.get("profile"):
        return None
    try:
        return json.loads(store.result(job.id, "profile.json"))
    except NotFound:
        return None


def fit_shown(store: Store, job: JobRow) -> dict[str, Any]:
    """A fit with its result, as the API shows it; fields of `FitOut`."""
    if job.state != "done":
        return shown(job) | {"result": None}
    record = fit_result(store, job.id).record()
    return shown(job) | {"result": finite(record | {"profile": profile_of(store, job)})}


def modes_shown(store: Store, job: JobRow) -> dict[str, Any]:
    """A job for modes with its result, as the API shows it; fields of `ModesOut`."""
    return shown(job) | {"result": modes_found(store, job.id) if job.state == "done" else None}


def film_shown(store: Store, job: JobRow) -> dict[str, Any]:
    """A look at a film, or its measurement, with what was found, as the API shows it; fields of `FilmOut`."""
    return shown(job) | {"result": finite(film_found(store, job)) if job.state == "done" else None}


def inversion_shown(store: Store, job: JobRow) -> dict[str, Any]:
    """An inversion with its result, as the API shows it; fields of `InversionOut`."""
    return shown(job) | {"result": finite(inverted(store, job.id)) if job.state == "done" else None}


def summary(store: Store, job: JobRow) -> str:
    """What came of a job, in a few words; empty while nothing has."""
    if job.state == "failed" and job.error is not None:
        return job.error.cause
    if job.state != "done":
        return ""
    try:
        if job.kind == "fit":
            found = fit_result(store, job.id)
            return f"{found.outcome.word.replace('_', ' ')}, χ²/ν {found.reduced_chi_square:.3g}"
        if job.kind == "batch":
            table = batch_result(store, job.id)
            return f"{int(table.ok.sum())} of {len(table)} ok"
        if job.kind == "modes":
            heard = [one["omega"] for one in modes_found(store, job.id)]
            return "ω " + ", ".join("–" if omega is None else f"{omega:.3g}" for omega in heard)
        if job.kind == "look":
            seen = film_found(store, job)
            return f"{seen['frames']} frames of {seen['rows']} × {seen['columns']}"
        if job.kind == "film":
            seen = film_found(store, job)
            heard = [seen["signature"].get(name) for name in ("f_minus_Hz", "f_plus_Hz")]
            return f"{seen['frames']} frames, " + ", ".join("–" if f is None else f"{f:.4g} Hz" for f in heard)
        if job.kind == "invert":
            told = inverted(store, job.id)
            return f"{told['outcome'].replace('_', ' ')}: {', '.join(told['varied'])}"
    except JshellError as error:
        return str(error)
    return "trace"


def packed(name: str, content: bytes) -> int:
    """Traces in an upload of a batch, as far as can be told without reading them all.

    Raises:
        BadFile: Neither arrays nor an archive.
    """
    if not content.strip():
        raise BadFile(name, found="an empty file", expected="traces", remedy="Check how the file was written.")
    if name.lower().endswith(".npz") and (found := batches.count(content, name)):
        return found
    if name.lower().endswith(".zip"):
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                return sum(not member.is_dir() for member in archive.infolist())
        except zipfile.BadZipFile as error:
            raise BadFile(
                name, found=f"no archive ({error})", expected="a .zip of trace files", remedy="Pack it again."
            ) from None
    return 1

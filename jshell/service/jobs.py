"""Jobs as the API and the page see them: accepted, shown, their results given out."""

import functools
import json
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import jshell
from jshell.calibration import BatchResult, FitResult, recordings_file
from jshell.errors import BadFile, BadValue, JshellError, NotFound
from jshell.files import NamedBytes
from jshell.io import zip_files
from jshell.service import batches
from jshell.service.encoding import neutral_csv
from jshell.service.kinds import KINDS, PLURAL
from jshell.service.problems import Refused
from jshell.service.replies import JobOut, finite
from jshell.service.schemas import Conditions, ModesRequest, SimulateRequest, Wire
from jshell.service.store import JobRow, Store
from jshell.trace import Trace

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


def page(job: JobRow) -> str:
    """Where a browser finds a job."""
    return f"/{PLURAL[job.kind]}/{job.id}"


def files(job: JobRow) -> dict[str, str]:
    """Suffix and address of what a job has made; nothing before it is done."""
    return {suffix: address(job, f".{suffix}") for suffix in KINDS[job.kind].files} if job.state == "done" else {}


def shown(job: JobRow, root: str) -> dict[str, Any]:
    """A job as the API shows it; fields of `JobOut`.

    Args:
        job: What is shown.
        root: Where a proxy in front shows the service: what its addresses begin with.
    """
    links = {name: root + there for name, there in {"self": address(job), "page": page(job), **files(job)}.items()}
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
    content = store.result(job.id, KINDS[job.kind].files[suffix])
    return neutral_csv(content) if suffix == "csv" else content


def file_name(store: Store, job: JobRow, suffix: str) -> str:
    """The name under which a browser keeps a result."""
    if not job.traces:
        return f"{job.kind}-{job.id[:8]}.{suffix}"
    return f"{PurePath(store.trace(job.traces[0]).name).stem}-{job.kind}-{job.id[:8]}.{suffix}"


def specification(asked: Wire) -> dict[str, Any]:
    """What a worker is asked, beside the traces: only what differs from the library's defaults."""
    return asked.model_dump(mode="json", exclude={"traces"}, exclude_defaults=True)


def simulator_specification(asked: SimulateRequest) -> dict[str, Any]:
    """What a worker is asked to simulate."""
    options = {name: getattr(asked, name) for name in ("duration", "ramp", "elements")}
    return {"model": "simulator", "conditions": asked.shell(), "every": EVERY, **options}


def modes_specification(asked: ModesRequest) -> dict[str, Any]:
    """What modes a worker is asked for."""
    options = {name: getattr(asked, name) for name in ModesRequest.model_fields if name not in Conditions.model_fields}
    orders = options.pop("azimuth")
    if orders is None:
        return {"conditions": asked.shell(), **options}
    if "liquid" not in asked.model_fields_set:
        options["liquid"] = None  # the best that is known of each order
    return {"conditions": asked.shell(), **options, "azimuth": sorted(set(orders))}


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
    return batches.table(store.result(job, "record.npz"))


@functools.lru_cache(maxsize=8)
def trace_of(store: Store, job: str) -> Trace:
    """The trace of a simulation or a film that is done."""
    return jshell.io.read_trace(NamedBytes("trace.json", store.result(job, "trace.json")))


def found_by(store: Store, job: JobRow) -> Any:
    """What a job that is done has found, as its `.json` says it."""
    return json.loads(store.result(job.id, KINDS[job.kind].files["json"]))


def profile_of(store: Store, job: JobRow) -> Mapping[str, Any] | None:
    """Profile intervals, where they were asked for."""
    if not job.specification.get("profile"):
        return None
    try:
        return json.loads(store.result(job.id, "profile.json"))
    except NotFound:
        return None


def with_result(store: Store, job: JobRow, root: str) -> dict[str, Any]:
    """A job with its result, as the API shows it; `root` as for `shown`."""
    if job.state != "done":
        return shown(job, root) | {"result": None}
    if job.kind == "fit":
        found = fit_result(store, job.id).record() | {"profile": profile_of(store, job)}
    else:
        found = found_by(store, job)
    return shown(job, root) | {"result": finite(found)}


def title(store: Store, job: JobRow) -> str:
    """A job by the names of its files, or by its kind where it has none."""
    names, more = [store.trace(trace).name for trace in job.traces[:3]], len(job.traces) - 3
    words = ", ".join(names) + (f" and {more} more" if more > 0 else "")
    return words or ("modes" if job.kind == "modes" else "simulation")


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
        if job.kind == "simulate":
            return "trace"
        seen = found_by(store, job)
        if job.kind == "modes":
            return "ω " + ", ".join("–" if one["omega"] is None else f"{one['omega']:.3g}" for one in seen)
        if job.kind == "look":
            return f"{seen['frames']} frames of {seen['rows']} × {seen['columns']}"
        if job.kind == "film":
            frequencies = [seen["signature"].get(name) for name in ("f_minus_Hz", "f_plus_Hz")]
            return f"{seen['frames']} frames, " + ", ".join("–" if f is None else f"{f:.4g} Hz" for f in frequencies)
        return f"{seen['outcome'].replace('_', ' ')}: {', '.join(seen['varied'])}"
    except JshellError as error:
        return str(error)


def packed(name: str, content: bytes) -> int:
    """Traces in an upload of a batch, as far as can be told without reading them all.

    Raises:
        BadFile: Neither arrays nor an archive.
    """
    if not content.strip():
        raise BadFile(name, found="an empty file", expected="traces", remedy="Check how the file was written.")
    if name.lower().endswith(".npz") and (found := recordings_file.count(content, name)):
        return found
    if not name.lower().endswith(".zip"):
        return 1
    with zip_files.opened(content, name) as archive:
        return sum(not member.is_dir() for member in archive.infolist())


def refuse_too_many(found: int, most: int) -> None:
    """Refuse more traces than a job may have.

    Raises:
        BadValue: Saying how many.
    """
    if found > most:
        raise BadValue("traces", found=f"{found}", expected=f"at most {most}", remedy="Hand them in as several jobs.")

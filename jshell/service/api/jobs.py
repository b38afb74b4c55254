"""Fits, batches and simulations: handed in, looked at, called off, their results."""

from typing import Annotated, Any, no_type_check

from fastapi import APIRouter, Body, File, Form, Header, Path, Query, Response, UploadFile
from fastapi.responses import JSONResponse

from jshell.service.api.answers import ONCE, Before, Limit, Name, Route, binary, problem_responses
from jshell.service.jobs import (
    MEDIA,
    address,
    file_name,
    file_of,
    modes_specification,
    of_kind,
    packed,
    refuse_too_many,
    shown,
    specification,
    with_result,
)
from jshell.service.kinds import KINDS
from jshell.service.reading import UPLOAD_SLOTS, check_one_readable, options_of
from jshell.service.replies import FilmOut, FitOut, InversionOut, JobOut, JobPage, ModesOut
from jshell.service.safety import attachment, clean_name
from jshell.service.schemas import BatchOptions, FitRequest, InvertRequest, Key, ModesRequest, State
from jshell.service.settings import MAX_BODY_BYTES
from jshell.service.state import Here
from jshell.service.store import Submission
from jshell.service.uploads import Upload

router = APIRouter(route_class=Route)
BYTES = "application/octet-stream"
OPTIONS = 'Options of `jshell.calibration.fit_batch` as JSON, e.g. {"equilibrium": "trace"}.'
IdempotencyKey = Annotated[
    Key | None,
    Header(alias="Idempotency-Key", description="Your own name for this request: sent again, it is the same job."),
]
ACCEPTED = problem_responses(404, 409, 429, made=(200, 202))
_WORDS = {200: "The same job was accepted before.", 202: "Accepted: the job is on the disk."}
for _status, _text in _WORDS.items():
    ACCEPTED[_status] |= {"description": _text, "model": JobOut}


def accepted(here: Here, submission: Submission) -> JSONResponse:
    """202 for a job made just now, 200 for one that was there."""
    job = submission.job
    return JSONResponse(
        shown(job, here.settings.root_path), 202 if submission.created else 200, headers={"Location": address(job)}
    )


@router.post("/fits", tags=["fits"], status_code=202, responses=ACCEPTED, summary="Fit traces")
def fit(here: Here, asked: FitRequest, key: IdempotencyKey = None) -> Response:
    """Fit traces that share their constants. The same data and options are the same job."""
    refuse_too_many(len(asked.traces), here.settings.traces)
    return accepted(here, here.store.submit("fit", specification(asked), asked.traces, key))


@router.post("/inversions", tags=["inversions"], status_code=202, responses=ACCEPTED, summary="Ask what shell it is")
def invert(here: Here, asked: InvertRequest, key: IdempotencyKey = None) -> Response:
    """Fit the simulator's small vibrations to ring-downs of one shell. The same data and question are the same job."""
    return accepted(here, here.store.submit("invert", specification(asked), asked.traces, key))


@router.post("/modes", tags=["modes"], status_code=202, responses=ACCEPTED, summary="Find a shell's modes")
def modes(here: Here, asked: ModesRequest, key: IdempotencyKey = None) -> Response:
    """Frequencies and decay times of the small vibrations about the rest shape. The same shell is the same job."""
    return accepted(here, here.store.submit("modes", modes_specification(asked), [], key))


@router.post(
    "/batches",
    tags=["batches"],
    status_code=202,
    responses=ACCEPTED,
    summary="Fit thousands of traces",
    dependencies=[ONCE],
)
@no_type_check  # FastAPI hands in Starlette's UploadFile where its own is announced
def batch(
    here: Here,
    files: Annotated[
        list[UploadFile],
        File(
            min_length=1,
            description="One .npz of arrays (`jshell.calibration.save_recordings`), one .zip of traces, or traces.",
        ),
    ],
    options: Annotated[str, Form(description=OPTIONS)] = "{}",
    key: IdempotencyKey = None,
) -> Response:
    """Fit each of many traces by itself; a trace that fails costs no other."""
    with UPLOAD_SLOTS:
        return _batch(here, [(clean_name(file.filename), file.file.read()) for file in files], options, key)


@router.post(
    "/batches/file/{name}",
    tags=["batches"],
    status_code=202,
    responses=ACCEPTED,
    summary="Fit thousands of traces, sent without a form",
)
def batch_file(
    here: Here,
    name: Annotated[str, Path(description="Its name; the suffix tells the format.", examples=["batch.npz"])],
    content: Annotated[
        bytes, Body(media_type=BYTES, description=f"The file, of up to {MAX_BODY_BYTES >> 20} MiB.")
    ] = b"",
    options: Annotated[str, Query(description=OPTIONS)] = "{}",
    key: IdempotencyKey = None,
) -> Response:
    """One `.npz`, `.zip` or trace as the body of the request, which takes less than a form."""
    return _batch(here, [(clean_name(name), content)], options, key)


def _batch(here: Here, uploads: list[tuple[str, bytes]], options: str, key: str | None) -> Response:
    chosen = options_of(BatchOptions, options)
    refuse_too_many(sum(packed(name, content) for name, content in uploads), here.settings.traces)
    check_one_readable(uploads)
    given = [Upload.of(name, content) for name, content in uploads]
    return accepted(here, here.store.submit("batch", specification(chosen), given, key))


def _routes(kind: str, out: type[JobOut]) -> None:
    """The routes that every kind of job has: list, look, call off, results."""
    plural, words = KINDS[kind].plural, KINDS[kind].words
    described: dict[str, Any] = {"responses": problem_responses(404), "tags": [plural]}

    @router.get(f"/{plural}", response_model=JobPage, summary=f"List the {plural}", **described)
    def index(
        here: Here, limit: Limit = 50, before: Before = None, state: Annotated[State | None, Query()] = None
    ) -> dict[str, Any]:
        """The latest first."""
        rows = here.store.jobs(state, limit, before, kind)
        wanted = "" if state is None else f"&state={state}"
        root = here.settings.root_path
        more = f"{root}/api/v1/{plural}?limit={limit}&before={rows[-1].id}{wanted}" if len(rows) == limit else None
        return {"jobs": [shown(row, root) for row in rows], "next": more}

    for suffix in KINDS[kind].files:
        _download(kind, suffix)

    @router.get(f"/{plural}/{{id:key}}", response_model=out, summary=f"Show one {words}", **described)
    def one(here: Here, id: Name) -> dict[str, Any]:
        """State, progress, error, and what came out."""
        job, root = of_kind(here.store, id, kind), here.settings.root_path
        return with_result(here.store, job, root) if "result" in out.model_fields else shown(job, root)

    @router.delete(f"/{plural}/{{id:key}}", response_model=JobOut, summary=f"Cancel one {words}", **described)
    def cancel(here: Here, id: Name) -> dict[str, Any]:
        """Give it up where it still waits or runs; one that is over stays as it is. Its line in the list stays."""
        of_kind(here.store, id, kind)
        return shown(here.store.cancel(id), here.settings.root_path)


def _download(kind: str, suffix: str) -> None:
    plural, words = KINDS[kind].plural, KINDS[kind].words
    media, json = MEDIA[suffix].partition(";")[0], "array" if kind == "modes" else "object"

    @router.get(
        f"/{plural}/{{id:key}}.{suffix}",
        tags=[plural],
        response_class=Response,
        responses=problem_responses(404, 409, more=binary(media, f"The {words} as a file.", json)),
        summary=f"The {words} as .{suffix}",
    )
    def download(here: Here, id: Name) -> Response:
        """Its result as a file."""
        job = of_kind(here.store, id, kind)
        given = {"Content-Disposition": attachment(file_name(here.store, job, suffix))}
        return Response(file_of(here.store, job, suffix), headers=given, media_type=MEDIA[suffix])


_OUT = {"fit": FitOut, "modes": ModesOut, "look": FilmOut, "film": FilmOut, "invert": InversionOut}
for _kind in KINDS:
    _routes(_kind, _OUT.get(_kind, JobOut))

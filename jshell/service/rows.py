"""A job as it is reported: its state, what was asked, why it failed."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from jshell.errors import KeyConflict, NotFound, QueueFull
from jshell.service.tables import CANCELLED, DONE, FAILED

DIED = "worker_died"


@dataclasses.dataclass(frozen=True)
class JobFailure:
    """Why a job has no result, in the words of the library's errors.

    Attributes:
        code, place, found, remedy: As of `JshellError`.
        expected: As well; empty where there is no more to it than that the job should have ended.
    """

    code: str
    place: str
    found: str
    expected: str
    remedy: str

    @property
    def cause(self) -> str:
        """What was found and expected, as a sentence."""
        return f"found {self.found}; expected {self.expected}" if self.expected else self.found

    def words(self) -> dict[str, str]:
        """The failure as the API renders it; fields of `schemas.Failure`."""
        return dataclasses.asdict(self) | {"cause": self.cause}


@dataclasses.dataclass(frozen=True)
class JobRow:
    """A job as it stands.

    Attributes:
        id: Its name.
        kind: `fit`, `batch` or `simulate`.
        state: `queued`, `running`, `done`, `failed` or `cancelled`.
        specification: What was asked, as JSON.
        traces: Identifiers of the traces it reads.
        attempt: How often it was begun.
        owner: Who works or worked on it.
        created, started, finished: Times [s since 1970].
        progress: 1 once it is done, 0 before: no job says how far it has come.
        error: Why it failed.
    """

    id: str
    kind: str
    state: str
    specification: Mapping[str, Any]
    traces: tuple[str, ...]
    attempt: int
    owner: str | None
    created: float
    started: float | None
    finished: float | None
    progress: float
    error: JobFailure | None

    @property
    def over(self) -> bool:
        """Whether nothing will change any more."""
        return self.state in (DONE, FAILED, CANCELLED)


@dataclasses.dataclass(frozen=True)
class Submission:
    """A job, and whether it was made just now."""

    job: JobRow
    created: bool


def job_of(row: Any) -> JobRow:
    """A job from its row in the database."""
    return JobRow(
        row.id, row.kind, row.state, json.loads(row.specification), tuple(json.loads(row.traces)), row.attempt,
        row.owner, row.created, row.started, row.finished, float(row.progress),
        None if row.error is None else JobFailure(**json.loads(row.error)),
    )  # fmt: skip


def content_of(kind: str, specification: str, traces: Sequence[str]) -> str:
    """What makes two requests the same: data, specification, version."""
    import jshell

    whole = json.dumps([kind, specification, list(traces), jshell.__version__])
    return hashlib.sha256(whole.encode()).hexdigest()


def key_conflict(key: str) -> KeyConflict:
    """The refusal of a key that stands for another request."""
    return KeyConflict(
        f"key {key!r}",
        found="a request other than the one it was first sent with",
        expected="the same request under the same key",
        remedy="Take a new key for a new request.",
    )


def queue_full(waiting: int, most: int) -> QueueFull:
    """The refusal of a job while many others wait."""
    return QueueFull("queue", found=f"{waiting} waiting jobs", expected=f"fewer than {most}", remedy="Try again later.")


def given_up_after(deaths: int) -> JobFailure:
    """Why a job is not tried any more."""
    return JobFailure(
        DIED,
        "worker",
        f"worker died: {deaths} times in the middle of this job",
        "",
        "Look at the memory of the machine and at the log of the service; a shorter record needs less. "
        "Sent again, it is tried anew.",
    )


def unknown_job(job: str) -> NotFound:
    """The refusal of a name that no job has."""
    return NotFound(f"job {job!r}", found="no such job", expected="the id of a job", remedy="Look at the list of jobs.")

"""The service from a program: the library's objects in, the library's objects out.

A request that was lost on the way is sent again under the same
Idempotency-Key, so that it is one job; a full queue is waited for.
"""

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jshell.calibration import BatchResult, FitResult, Recordings, recordings_file
from jshell.calibration.recordings import stacked
from jshell.dynamics import Mode, OrderMode
from jshell.errors import BadValue, JshellError, require_extra
from jshell.service import chunks, receiving, sending
from jshell.service.asking import Asking
from jshell.service.asking import Unreachable as Unreachable
from jshell.service.kinds import PLURAL
from jshell.service.settings import MAX_BODY_BYTES
from jshell.shell import Reduced
from jshell.trace import Trace

LOCAL = "http://127.0.0.1:8765"
OVER = ("done", "failed", "cancelled")
Data = str | Path | Trace


class NotDone(BadValue):
    """A job that was called off, or is not over in time."""


@dataclass(frozen=True)
class Job:
    """A job as it stood when it was last looked at.

    Attributes:
        client: Where it is.
        id: Its name.
        kind: `fit`, `batch`, `simulate`, `modes` or `invert`.
        state: `queued`, `running`, `done`, `failed` or `cancelled`.
        progress: 1 once it is done, 0 before: no job says how far it has come.
        specification: What was asked.
        error: Why it failed, in the library's words.
    """

    client: "Client"
    id: str
    kind: str
    state: str
    progress: float
    specification: Mapping[str, Any]
    error: JshellError | None = None

    @property
    def over(self) -> bool:
        """Whether nothing will change any more."""
        return self.state in OVER

    def now(self) -> "Job":
        """The job as it stands now."""
        return self.client.job(self.id, self.kind)

    def wait(self, seconds: float | int = 600.0) -> "Job":
        """The job once it is over; as it stands after `seconds` where it is not. A service may be restarted meanwhile.

        Raises:
            Unreachable: There is no service at the end of that time.
        """
        begun, job = time.monotonic(), self
        until = begun + max(seconds, 0.1)
        while not job.over:
            # whoever waits for a job waits for its service, too
            job = self.client._ask_job("GET", f"/{PLURAL[self.kind]}/{self.id}", until=until)
            spent = time.monotonic() - begun
            if spent >= seconds:
                break
            time.sleep(0 if job.over else min(max(0.02, 0.1 * spent), 1.0, seconds - spent))  # a tenth late at most
        return job

    def cancel(self) -> "Job":
        """Call it off."""
        return self.client.cancel(self)

    def result(self, seconds: float | int = 600.0) -> Any:
        """What it found, waiting for it: a `FitResult`, a `BatchResult`, a `Trace`, a row per mode, or a record.

        Raises:
            JshellError: The error with which it failed.
            NotDone: It was cancelled, or is not over after `seconds`.
        """
        job = self.wait(seconds)
        if job.error is not None:
            raise job.error
        if job.state != "done":
            raise NotDone(
                f"job {self.id}",
                found=f"state {job.state}",
                expected="done",
                remedy="Wait longer, or hand it in again.",
            )
        return self.client.result(job)


class Client(Asking):
    """A running service.

    Args:
        url: Its address, as `jshell serve` prints it.
        token: Where the service asks for one; by default the environment's JSHELL_TOKEN.
        timeout: Longest time for one answer, from its request to its last byte [s]; what is sent has its own time
            beside it, a second for every 64 KiB and two minutes at most.
        patience: Time for which lost requests and a full queue are tried again [s].

    Raises:
        MissingExtra: The extra `service` is not installed.

    Example:
        >>> from jshell import Client
        >>> with Client("http://127.0.0.1:8765") as service:  # doctest: +SKIP
        ...     print(service.fit("recording.csv", fix={"alpha2": 1.1}))
    """

    def __init__(
        self, url: str = LOCAL, *, token: str | None = None, timeout: float | int = 60.0, patience: float | int = 60.0
    ) -> None:
        httpx = require_extra("httpx", "service", "jshell.Client")
        token = os.environ.get("JSHELL_TOKEN") if token is None else token
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self.url, self.patience, self.timeout = url.rstrip("/"), patience, timeout
        try:
            self._http = httpx.Client(base_url=self.url, headers=headers, timeout=timeout, trust_env=False)
        except (httpx.InvalidURL, TypeError) as error:
            raise BadValue(
                "url", found=f"{url!r} ({error})", expected=LOCAL, remedy="Write http://HOST:PORT."
            ) from None

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def fit(self, traces: Data | Sequence[Data], *, seconds: float | int = 600.0, **options: Any) -> FitResult:
        """Fit traces as `jshell.calibration.fit_trajectories` does, there.

        Args:
            traces: Files, traces, or identifiers that `upload` gave.
            seconds: Longest time to wait.
            **options: Those of `fit_trajectories`, in plain values; `profile=True` asks for profiles as well.

        Raises:
            JshellError: What the service or the fit refuses, as the library itself would raise it.
        """
        return self.submit(traces, **options).result(seconds)

    def submit(self, traces: Data | Sequence[Data], *, key: str | None = None, **options: Any) -> Job:
        """Hand a fit in and return at once: when this returns, the job is on the service's disk.

        Args:
            traces: As in `fit`.
            key: Your own name for this request; sent again, it is the same job.
            **options: As in `fit`.
        """
        words = sending.fit_options(options) | {"traces": self._uploaded(traces)}
        return self._ask_job("POST", "/fits", json=words, key=key)

    def _uploaded(self, traces: Data | Sequence[Data]) -> list[str]:
        """Identifiers of traces, handed in where they are not yet."""
        listed = [traces] if isinstance(traces, str | Path | Trace) else list(traces)
        return [str(one) if sending.is_id(one) else self.upload(one) for one in listed]

    def fit_batch(
        self, traces: Recordings | Sequence[Trace] | str | Path, *, seconds: float | int = 3600.0, **options: Any
    ) -> BatchResult:
        """Fit each of many traces by itself as `jshell.calibration.fit_batch` does, there.

        They go up in chunks, each a job: one is fitted while the next is on its way, and several workers share them.

        Args:
            traces: As in `submit_batch`.
            seconds: Longest time to wait.
            **options: Those of `fit_batch`, in plain values.

        Raises:
            JshellError: As `fit`; chunks that are still under way are then called off.
        """
        whole = [] if options.get("starts") else sending.whole(traces)
        if chunks.count(whole) < 2:
            return self.submit_batch(traces, **options).result(seconds)
        try:
            return chunks.fitted(whole, lambda chunk: self._submit_batch(*chunk, None, options), seconds)
        except NotDone:
            raise
        except JshellError:
            if isinstance(whole, Recordings):
                raise
            return self.submit_batch(traces, **options).result(seconds)  # a chunk of which no file can be read

    def submit_batch(
        self, traces: Recordings | Sequence[Trace] | str | Path, *, key: str | None = None, **options: Any
    ) -> Job:
        """Hand a batch in and return at once.

        Args:
            traces: Arrays, traces, or a file: `.npz` of arrays, `.zip` of trace files.
            key: Your own name for this request.
            **options: Those of `fit_batch`, in plain values.
        """
        if isinstance(traces, str | Path):
            return self._submit_batch(*sending.content(traces), key, options)
        records = traces if isinstance(traces, Recordings) else stacked(list(traces))
        return self._submit_batch("batch.npz", recordings_file.encode(records), key, options)

    def _submit_batch(self, name: str, content: bytes, key: str | None, options: Mapping[str, Any]) -> Job:
        words = json.dumps(sending.plain(options))
        if len(content) <= MAX_BODY_BYTES:  # without a form, which takes less
            there = f"/batches/file/{quote(name, safe='')}"
            return self._ask_job("POST", there, key=key, params={"options": words}, body=content)
        given = {"files": {"files": (name, content)}, "data": {"options": words}}
        return self._ask_job("POST", "/batches", key=key, **given)

    def simulate(self, conditions: Reduced, *, seconds: float | int = 600.0, **options: Any) -> Trace:
        """A run of the simulator, there.

        Args:
            conditions: The shell and its load.
            seconds: Longest time to wait.
            **options: `duration`, `ramp`, `elements`.
        """
        asked = sending.numbers(conditions)
        words = asked | {"model": "simulator"} | sending.plain(options)
        return self._ask_job("POST", "/simulate", json=words).result(seconds)

    def modes(
        self, conditions: Reduced, *, seconds: float | int = 600.0, **options: Any
    ) -> tuple[Mode, ...] | tuple[OrderMode, ...]:
        """Small vibrations of a shell about its rest shape, found there.

        Args:
            conditions: The shell and its load.
            seconds: Longest time to wait.
            **options: `liquid`, `count`, `elements`, `attached`, `azimuth`, as in `jshell.dynamics.modes`; with
                `azimuth` the rows are `OrderMode`.
        """
        asked = sending.numbers(conditions)
        return self._ask_job("POST", "/modes", json=asked | sending.plain(options)).result(seconds)

    def invert(
        self,
        traces: Data | Sequence[Data],
        unknown: Iterable[str] | Mapping[str, Any],
        known: Mapping[str, float | int] | None = None,
        *,
        seconds: float | int = 600.0,
        **options: Any,
    ) -> dict[str, Any]:
        """What shell ring-downs are of, asked there, as `jshell.invert` does.

        Args:
            traces: As in `fit`.
            unknown: What is asked: names, or names with None, bounds (low, high), a `Prior` or an `Unknown`.
            known: What is known, over the traces' headers.
            seconds: Longest time to wait.
            **options: `local`, `channels`, `start`, `stop`, `free_rest`, `nuisance`, `exact`, `elements`,
                `level`; of that `trace` also `ramp` and `origin`.

        Returns:
            What `jshell.inversion.Inversion.record` says.
        """
        words = sending.question(unknown, known, options) | {"traces": self._uploaded(traces)}
        return self._ask_job("POST", "/inversions", json=words).result(seconds)

    def upload(self, trace: Data, conditions: Mapping[str, float] | None = None, **said: Any) -> str:
        """Hand a trace in; the same bytes are kept once.

        Args:
            trace: A file as it is, or a trace.
            conditions: For a file without: keys of a header to numbers.
            **said: What the file leaves open, as of `jshell.io.read_trace`: `columns`, `units`, `rate`, …

        Returns:
            Its identifier.
        """
        if isinstance(trace, Trace):
            name, content = sending.written(trace)
        else:
            name, content = sending.content(trace)
        data = {} if conditions is None else {"conditions": json.dumps(dict(conditions))}
        data |= {"reading": sending.reading(said)} if said else {}
        return self._ask(receiving.upload, "POST", "/traces", files={"file": (name, content)}, data=data)

    def job(self, id: str, kind: str = "fit") -> Job:
        """A job as it stands.

        Raises:
            NotFound: No such job.
        """
        return self._ask_job("GET", f"/{PLURAL[kind]}/{id}")

    def jobs(self, kind: str = "fit", state: str | None = None) -> Iterator[Job]:
        """All jobs of a kind, the latest first."""
        address: str | None = f"/{PLURAL[kind]}?limit=200" + ("" if state is None else f"&state={state}")
        seen: list[str] = []

        def read(found: Any) -> tuple[list[dict[str, Any]], str | None]:
            jobs, following = receiving.page(found)
            if following in seen:
                raise ValueError("a next page that was seen before")
            return jobs, following

        while address is not None:
            seen.append(address)
            page, address = self._ask(read, "GET", address)
            yield from (Job(self, **one) for one in page)

    def cancel(self, job: Job | str, kind: str = "fit") -> Job:
        """Call a job off; one that is over stays as it is."""
        id, kind = (job.id, job.kind) if isinstance(job, Job) else (job, kind)
        return self._ask_job("DELETE", f"/{PLURAL[kind]}/{id}")

    def result(self, job: Job | str, kind: str = "fit") -> Any:
        """What a job that is done found: `FitResult`, `BatchResult`, `Trace`, a row per mode, or an inversion's record.

        Raises:
            JshellError: There is no such job, or it has no result.
        """
        id, kind = (job.id, job.kind) if isinstance(job, Job) else (job, kind)
        there = f"/{PLURAL[kind]}/{id}"
        if kind == "batch":
            return self._fetch(receiving.batch, f"{there}.npz")
        if kind in ("modes", "invert"):
            return self._ask(receiving.modes if kind == "modes" else receiving.inversion, "GET", f"{there}.json")
        return self._fetch(receiving.fit if kind == "fit" else receiving.trace, f"{there}.json")

    def profile(self, job: Job | str) -> dict[str, Any] | None:
        """Profile intervals of a fit, where they were asked for; as `Profile.record()` says them."""
        id = job.id if isinstance(job, Job) else job
        return self._ask(receiving.profile, "GET", f"/fits/{id}")

    def healthy(self) -> bool:
        """Whether jshell's service is there and takes jobs."""
        import httpx

        try:
            answer = self._answer(self.timeout, "GET", "/healthz")
            return answer.status_code == 200 and receiving.healthy(answer.json())
        except (httpx.RequestError, *receiving.SPOILED):
            return False

    def _ask_job(self, method: str, address: str, **given: Any) -> Job:
        return self._ask(lambda found: Job(self, **receiving.job(found)), method, address, **given)

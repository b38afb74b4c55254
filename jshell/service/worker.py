"""Who does the jobs: lease one, run it on the engine, say so again and again, record what came out.

Every slot is a thread with an engine of its own, so that a job that has to be
killed takes no other along. The engine is there, and everything imported,
before a job is leased: time to start is nobody's death.
"""

import contextlib
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Executor, Future
from concurrent.futures import TimeoutError as NotYet
from dataclasses import dataclass
from pathlib import Path

import jax

from jshell import engines
from jshell.engines import Processes
from jshell.errors import BadStore, JshellError, LimitReached, StoreUnavailable, WorkerLost
from jshell.service import tasks
from jshell.service.log import log
from jshell.service.settings import Settings
from jshell.service.shared_file import FileRef, SharedFile
from jshell.service.store import JobFailure, JobRow, Store

PROGRAMS = "jax_compilation_cache_dir"
LARGE = 2**20  # bytes of the files of a job from which they are shared with its process through a file
LOOK = 0.1  # [s] between two looks at a running job
IDLE = 0.5  # [s] between two looks for work that came from elsewhere
GRACE = 0.25  # [s] after the death of a process in which the order to stop may come that was its end, too
BACKOFF = (0.5, 1.0, 2.0, 5.0, 10.0)  # [s] between attempts to reach an engine or the database


class Worker:
    """Does the jobs of a store until it is stopped.

    Args:
        settings: Engine, slots, lease and limits.
        store: Where the jobs are.
    """

    def __init__(self, settings: Settings, store: Store) -> None:
        self.settings, self.store = settings, store
        self.name = f"{socket.gethostname()}:{os.getpid()}:{secrets.token_hex(3)}"
        self.stopping = threading.Event()  # no new jobs
        self.ending = threading.Event()  # no old ones either
        self._slots = [_Slot(self, number) for number in range(settings.workers)]
        self._keeper = threading.Thread(target=self._keep, name="jshell keeps leases", daemon=True)

    def start(self) -> None:
        """Begin; returns at once."""
        if self.settings.engine != "inline":
            _keep_programs_in(self.settings.cache)
        self._keeper.start()
        for slot in self._slots:
            slot.thread.start()

    def stop(self, drain: float | int = 10.0) -> None:
        """End within `drain` seconds: jobs that are not done by then are given back, and no process is left behind."""
        deadline = time.monotonic() + drain
        self.stopping.set()
        soon = threading.Timer(0.4 * drain, self.ending.set)  # what is killed has to be buried, too
        soon.start()
        for slot in self._slots:
            slot.join(deadline)
        soon.cancel()
        self.ending.set()
        for slot in self._slots:
            slot.close(max(1.0, deadline - time.monotonic()))

    def _keep(self) -> None:
        """Say of every running job that it is worked on; take back those whose workers have fallen silent."""
        while not self.ending.wait(min(1.0, self.settings.lease / 5)):
            try:
                for slot in self._slots:
                    slot.heartbeat()
                self.store.reap_expired(self.settings.lease)
            except (StoreUnavailable, BadStore) as error:
                log.warning("the database does not answer: %s", error)


@dataclass(frozen=True)
class _Stopped:
    """A job that was stopped from here: what to record, or nothing where it is no longer ours."""

    failure: JobFailure | None


class _Slot:
    """One job at a time."""

    def __init__(self, worker: Worker, number: int) -> None:
        self.worker, self.settings, self.store = worker, worker.settings, worker.store
        self.owner = f"{worker.name}:{number}"
        self.thread = threading.Thread(target=self._live, name=f"jshell slot {number}", daemon=True)
        self.job: JobRow | None = None
        self._lost: JobRow | None = None
        self._engine: Executor | None = None
        self._process: int | None = None
        self._shared: SharedFile | None = None

    def heartbeat(self) -> None:
        """Keep the lease of the job under way; note where it is no longer ours."""
        job = self.job
        if job is None or job is self._lost:
            return
        if not self.store.heartbeat(job.id, self.owner, job.attempt, seconds=self.settings.lease):
            self._lost = job

    def join(self, deadline: float) -> None:
        """Wait until the slot has ended."""
        if self.thread.ident is not None:
            self.thread.join(max(0.1, deadline - time.monotonic()))

    def close(self, patience: float | int = 2.0) -> None:
        """End the engine and its processes; what takes longer goes on by itself."""
        engine, self._engine, self._process = self._engine, None, None
        if engine is None:
            return

        def end() -> None:
            try:
                if isinstance(engine, Processes):
                    engine.__exit__(InterruptedError, None, None)  # kills what runs
                else:
                    engine.shutdown(wait=False, cancel_futures=True)
            except (OSError, RuntimeError, CancelledError) as error:
                log.info("an engine ended badly: %s", error)

        thread = threading.Thread(target=end, name="jshell ends an engine", daemon=True)
        thread.start()
        thread.join(patience)

    def _live(self) -> None:
        failures = 0
        while not self.worker.stopping.is_set():
            try:
                if not self._is_ready():
                    continue
                seen = self.store.notifier.count
                job = self.store.lease(self.owner, self.settings.lease)
            except Exception as error:  # whatever an engine may say: without its slots the service would wait for ever
                log.warning("not ready for a job: %s", error, exc_info=not isinstance(error, JshellError | OSError))
                self.close()
                self.worker.stopping.wait(BACKOFF[min(failures, len(BACKOFF) - 1)])
                failures += 1
                continue
            failures = 0
            if job is None:
                self.store.notifier.wait(seen, IDLE)
                continue
            self.job = job
            try:
                self._do(job)
            except (StoreUnavailable, BadStore) as error:
                log.warning("job %s is left to its lease: %s", job.id, error)
            finally:
                self.job = None
        self.close()
        if self._shared is not None:
            self._shared.close()

    def _is_ready(self) -> bool:
        """Whether the engine answers; opens it where there is none, and waits until everything is imported.

        Raises:
            WorkerLost: Its process died.
            JshellError: It cannot be opened.
        """
        if self._engine is None:
            name = self.settings.engine
            self._engine = engines.open("processes:1" if name == "processes" else name)
        nice = self.settings.nice if isinstance(self._engine, Processes) else None
        first = self._engine.submit(tasks.ready, self.settings.warm, nice)
        while not self.worker.stopping.is_set():
            try:
                self._process = first.result(timeout=LOOK)
                return True
            except NotYet:
                continue
        return False

    def _do(self, job: JobRow) -> None:
        """Run a leased job to its end, whatever that is."""
        assert self._engine is not None
        files = self.store.files(job.traces)
        try:
            given = self._written(files)
            ended = self._watch(job, self._engine.submit(tasks.run, job.kind, dict(job.specification), given))
        except (WorkerLost, OSError, RuntimeError, CancelledError) as error:
            self._put_back(job, error)
            return
        except Exception as error:  # a cluster without jshell, or another one: for the log, not for the user
            ended = _Stopped(self._fault(job, repr(error)))
        if isinstance(ended, _Stopped):
            outcome = ended.failure
        elif ended.fault is not None:
            outcome = self._fault(job, ended.fault)
        else:
            outcome = ended.files if ended.error is None else JobFailure(**ended.error)
        if outcome is None:
            return
        if not self._insist(lambda: self.store.finish(job.id, self.owner, job.attempt, outcome)):
            log.info("job %s, attempt %d: came too late, and was not recorded", job.id, job.attempt)

    def _written(self, files: Sequence[tuple[str, bytes]]) -> Sequence[tuple[str, bytes | FileRef]]:
        """The files of a job as its process is given them: large ones by reference."""
        if not isinstance(self._engine, Processes) or sum(len(content) for _, content in files) < LARGE:
            return files
        if self._shared is None:
            self._shared = SharedFile()
        return self._shared.write(files)

    def _put_back(self, job: JobRow, error: BaseException) -> None:
        """After the loss of a worker: the job's fault, unless the whole cluster was lost or everything is to stop."""
        died = isinstance(self._engine, Processes) or "KilledWorker" in str(error)
        died = died and not self.worker.stopping.wait(GRACE)
        log.warning("job %s, attempt %d: %s", job.id, job.attempt, error)
        self._insist(lambda: self.store.release(job.id, self.owner, job.attempt, died=died))
        if not isinstance(self._engine, Processes):
            self.close()
            self.worker.stopping.wait(BACKOFF[1])

    def _watch(self, job: JobRow, future: Future) -> tasks.TaskResult | _Stopped:
        """Wait for a job; end it where it reaches a limit, is no longer ours, or the service ends."""
        began = time.monotonic()
        while True:
            try:
                return future.result(timeout=LOOK)
            except NotYet:
                if future.done():
                    raise
            if self.worker.ending.is_set():
                self._end(future)
                self._insist(lambda: self.store.release(job.id, self.owner, job.attempt))
                return _Stopped(None)
            if self._lost is job:
                self._end(future)
                return _Stopped(None)
            reached = self._limit(time.monotonic() - began)
            if reached is not None:
                self._end(future)
                return _Stopped(reached)

    def _limit(self, seconds: float) -> JobFailure | None:
        """The limit that a job has reached, if any; only of processes, which can be killed."""
        if not isinstance(self._engine, Processes):
            return None
        if seconds > self.settings.seconds:
            return _reached("time", f"{seconds:.1f} s", f"at most {self.settings.seconds:g} s", "Fit a shorter record")
        held = _resident(self._process)
        if held is not None and held > self.settings.memory:
            found, most = f"{held / 2**20:.0f} MiB", f"at most {self.settings.memory / 2**20:.0f} MiB"
            return _reached("memory", found, most, "Fit fewer or shorter records at once")
        return None

    def _end(self, future: Future) -> None:
        """Stop a running job: its process is killed; on a cluster it runs on, and what it delivers is refused."""
        if isinstance(self._engine, Processes):
            self._engine.stop(future)
            with contextlib.suppress(NotYet, CancelledError):
                future.exception(timeout=2.0)
        else:
            future.cancel()

    def _insist(self, change: Callable[[], bool]) -> bool:
        """A change of the store, tried again while the database does not answer."""
        for pause in BACKOFF:
            try:
                return change()
            except StoreUnavailable as error:
                log.warning("the database does not answer: %s", error)
                if self.worker.ending.wait(pause):
                    break
        return change()

    def _fault(self, job: JobRow, words: str) -> JobFailure:
        number = secrets.token_hex(4)
        log.error("job %s, error %s: %s", job.id, number, words)
        return JobFailure(
            "internal",
            f"job {job.id}",
            f"a fault of jshell itself, error {number} in the log of the service",
            "",
            "Tell whoever keeps the service this number; the same job will fail again.",
        )


def _reached(what: str, found: str, most: str, advice: str) -> JobFailure:
    error = LimitReached(f"{what} of a job", found=found, expected=most, remedy=f"{advice}, or raise the setting.")
    return JobFailure(**error.record())


def _resident(process: int | None) -> int | None:
    """Memory that a process holds [bytes]; None where nobody tells."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return None


def _keep_programs_in(folder: str | None) -> None:
    """Let processes keep what they compile in this folder; None is where importing jshell has put it."""
    if folder is None:
        return
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        log.warning("compiled programs are not kept: %s", error)
        return
    jax.config.update(PROGRAMS, folder)

"""An existing Dask cluster, reached by its scheduler's address.

Who submits owns the retries: a task whose worker died is never run again
behind the caller's back, since that kills one worker after another.

Source     Dask: Client.get_executor; distributed.scheduler.allowed-failures
"""

import concurrent.futures
import contextlib
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from functools import partial

from jshell.errors import BadValue, WorkerLost, require_extra

PATIENCE = 15.0  # [s] to find the scheduler


class Cluster(Executor):
    """A running Dask scheduler and its workers, which need the same version of jshell installed.

    A task whose worker, scheduler or connection is lost ends with `WorkerLost`. The scheduler's `allowed_failures` is
    set to 0, and stays so. Leaving the `with` block leaves the cluster running.

    Args:
        address: `tcp://host:port` of the scheduler.

    Raises:
        MissingExtra: Dask is not installed.
        BadValue: No scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        distributed = require_extra("distributed", "distributed", "engine")
        try:
            self._client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as fault:
            raise BadValue(
                f"engine {address!r}",
                found=f"no Dask scheduler ({type(fault).__name__})",
                expected="the address of a running one",
                remedy="Start it with `dask scheduler` and `dask worker`, or use inline or processes.",
            ) from None
        self._lost: type[Exception] = distributed.KilledWorker
        self._closed: type[Exception] = distributed.client.ClosedClientError
        self._client.run_on_scheduler(_no_second_tries)
        self._inner = self._client.get_executor(pure=False, retries=0)
        self._open: set[Future] = set()

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """Schedule a call of an importable function on any worker.

        Raises:
            RuntimeError: The engine is closed.
            WorkerLost: Its client has given its scheduler up.
        """
        name = f"task {getattr(fn, '__qualname__', repr(fn))}({', '.join(repr(value)[:60] for value in args)})"
        try:
            inner = self._inner.submit(partial(fn, *args, **kwargs))
        except self._closed as fault:
            raise _loss(name, fault) from None
        outer: Future = Future()
        self._open.add(outer)
        outer.add_done_callback(lambda done: inner.cancel() if done.cancelled() else None)
        inner.add_done_callback(lambda done: self._finished(name, outer, done))
        # a client that is closing may have let go of all that it held before it held this one: nothing would end it
        if self._client.status in ("closing", "closed"):
            inner.cancel()
            self._end(outer, _loss(name, CancelledError()))
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks and leave the cluster; it runs on."""
        if cancel_futures:
            for future in list(self._open):
                future.cancel()
        if wait:
            concurrent.futures.wait(list(self._open))
        with contextlib.suppress(self._closed):  # it has given its scheduler up: nothing is left to call off
            self._inner.shutdown(wait=wait)
        self._client.close()

    def __exit__(self, kind, fault, traceback) -> None:
        self.shutdown(wait=kind is None, cancel_futures=kind is not None)

    def _finished(self, name: str, outer: Future, inner: Future) -> None:
        fault = CancelledError() if inner.cancelled() else inner.exception()
        if isinstance(fault, self._lost | CancelledError | OSError):
            fault = _loss(name, fault)
        self._end(outer, fault, None if fault is not None else inner.result())

    def _end(self, outer: Future, fault: BaseException | None, result: object = None) -> None:
        """Tell who waits how a task ended, once."""
        try:
            self._open.remove(outer)
        except KeyError:  # somebody has
            return
        if not outer.set_running_or_notify_cancel():
            return
        if fault is not None:
            outer.set_exception(fault)
        else:
            outer.set_result(result)


def _loss(name: str, fault: BaseException) -> WorkerLost:
    return WorkerLost(
        name,
        found=f"its worker or the scheduler was lost ({type(fault).__name__})",
        expected="a cluster that lives until the task is done",
        remedy="Submit it again; look at the memory of the workers if it is lost again.",
    )


def _no_second_tries(dask_scheduler) -> None:
    """On the scheduler: a task whose worker died has failed."""
    dask_scheduler.allowed_failures = 0

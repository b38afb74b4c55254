"""A pool of spawned processes in which the death of one costs one task.

The standard pool is broken for ever once a worker dies, and takes every task
in it along. Here each worker is a pool of its own with one task at a time: when it dies,
the task it ran is lost and said to be, the worker is replaced, and whatever
waits or runs elsewhere goes on. Spawned, never forked: JAX has threads.

Source     Python standard library: concurrent.futures.ProcessPoolExecutor, BrokenProcessPool
"""

import concurrent.futures
import multiprocessing
import os
import signal
import tempfile
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass

import jax

from jshell.errors import BadValue, WorkerLost

CACHE_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


@dataclass(eq=False)
class Task:
    """A call that waits for a worker or has one."""

    future: Future
    call: tuple[Callable, tuple, dict]

    @property
    def name(self) -> str:
        fn, args, _ = self.call
        shown = ", ".join(repr(value)[:60] for value in args)
        return f"task {getattr(fn, '__qualname__', repr(fn))}({shown})"


@dataclass(eq=False)
class Worker:
    """One process, as a pool of one; its process id once it has begun."""

    pool: ProcessPoolExecutor
    process: Future
    task: Task | None = None

    def kill(self) -> None:
        """End the process now; one that has not begun yet is awaited first, so that it cannot outlive us."""
        try:
            os.kill(self.process.result(timeout=60), signal.SIGKILL)
        except (BrokenExecutor, TimeoutError, ProcessLookupError):
            return  # already gone


class Processes(Executor):
    """Spawned processes, JAX set up alike in each, compiled programs shared between them.

    A task whose process dies ends with `WorkerLost`, which names it; the caller decides whether to submit it again.
    Leaving the `with` block waits for all tasks; leaving it by an exception drops the waiting ones and kills the
    running ones. No process outlives the engine: a worker whose parent was killed ends itself.

    Args:
        workers: How many processes.

    Raises:
        BadValue: Fewer than one process.
    """

    def __init__(self, workers: int) -> None:
        if workers < 1:
            raise BadValue(
                "workers", found=str(workers), expected="at least 1", remedy="Use as many as there are cores."
            )
        self._context = multiprocessing.get_context("spawn")
        self._settings = {name: getattr(jax.config, name) for name in CACHE_SETTINGS}
        self._settings |= {name: getattr(jax.config, name) for name in ("jax_enable_x64", "jax_numpy_rank_promotion")}
        self._cache = None
        if not self._settings["jax_compilation_cache_dir"]:
            self._cache = tempfile.TemporaryDirectory(prefix="jshell-compiled-", ignore_cleanup_errors=True)
            self._settings["jax_compilation_cache_dir"] = self._cache.name
        self._change = threading.RLock()
        self._waiting: deque[Task] = deque()
        self._closed = False
        self._workers = [self._worker() for _ in range(workers)]

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """Schedule a call of an importable function; its arguments and its result are pickled.

        Raises:
            RuntimeError: The engine is closed.
        """
        with self._change:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            task = Task(Future(), (fn, args, kwargs))
            self._waiting.append(task)
        self._hand_out()
        return task.future

    def stop(self, future: Future) -> bool:
        """Kill the process that runs a future, which then ends with `WorkerLost`; cancel one that waits.

        Returns:
            Whether there was anything to stop.
        """
        if future.cancel():
            return True
        with self._change:
            worker = next((w for w in self._workers if w.task is not None and w.task.future is future), None)
        if worker is None:
            return False
        worker.kill()
        return True

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks; waiting ones are still done unless cancelled."""
        with self._change:
            self._closed = True
            dropped = list(self._waiting) if cancel_futures else []
            for task in dropped:
                self._waiting.remove(task)
            unfinished = [w.task.future for w in self._workers if w.task] + [task.future for task in self._waiting]
        for task in dropped:
            task.future.cancel()
            task.future.set_running_or_notify_cancel()
        if wait:
            concurrent.futures.wait(unfinished)
            self._end()

    def __exit__(self, kind, fault, traceback) -> None:
        if kind is not None:
            self.shutdown(wait=False, cancel_futures=True)
            for worker in [worker for worker in self._workers if worker.task is not None]:
                worker.kill()
        self.shutdown(wait=True)

    def _end(self) -> None:
        for worker in self._workers:
            worker.pool.shutdown(wait=True)
        if self._cache is not None:
            self._cache.cleanup()

    def _worker(self) -> Worker:
        pool = ProcessPoolExecutor(1, self._context, initializer=_begin, initargs=(self._settings,))
        return Worker(pool, pool.submit(os.getpid))

    def _hand_out(self) -> None:
        """Give waiting tasks to idle workers; callbacks are added outside the lock."""
        begun = []
        with self._change:
            for place, idle in enumerate(self._workers):
                while idle.task is None and self._waiting:
                    task = self._waiting.popleft()
                    if not task.future.set_running_or_notify_cancel():
                        continue
                    worker, inner = self._start(idle, task)
                    self._workers[place] = idle = worker
                    begun.append((worker, inner))
        for worker, inner in begun:
            inner.add_done_callback(lambda done, worker=worker: self._finished(worker, done))

    def _start(self, worker: Worker, task: Task) -> tuple[Worker, Future]:
        """The task's own future on a worker, or on its replacement where the worker died while idle."""
        fn, args, kwargs = task.call
        try:
            inner = worker.pool.submit(fn, *args, **kwargs)
        except BrokenExecutor:
            worker.pool.shutdown(wait=False)
            worker = self._worker()
            inner = worker.pool.submit(fn, *args, **kwargs)
        worker.task = task
        return worker, inner

    def _finished(self, worker: Worker, inner: Future) -> None:
        fault = inner.exception()
        task = worker.task
        assert task is not None
        lost = isinstance(fault, BrokenExecutor)
        with self._change:
            worker.task = None
        if lost:
            task.future.set_exception(
                WorkerLost(
                    task.name,
                    found="its process died",
                    expected="a process that lives until its task is done",
                    remedy="Submit it again; if it dies again, it needs more memory than there is, or the script that "
                    "starts it lacks `if __name__ == '__main__':`.",
                )
            )
        elif fault is not None:
            task.future.set_exception(fault)
        else:
            task.future.set_result(inner.result())
        self._hand_out()


def _begin(settings: dict) -> None:
    """In the new process: JAX as in the parent, and an end as soon as the parent is gone."""
    for name, value in settings.items():
        jax.config.update(name, value)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True, name="jshell parent watch").start()

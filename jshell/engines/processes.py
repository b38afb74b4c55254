"""A pool of spawned processes in which the death of one costs one task.

The standard pool is broken for ever once a worker dies, and takes every task
in it along; and a worker that is killed while its result is on the way leaves
it waiting for ever, for it holds the writing end of its own pipe. Here each
worker has a pipe of which only it holds the other end, so that its death is
the end of the pipe. It is replaced, and whatever waits or runs elsewhere goes
on. Spawned, never forked: JAX has threads.

Source     Python standard library: multiprocessing, concurrent.futures.Executor
"""

import contextlib
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import jax

from jshell.errors import BadValue, WorkerLost
from jshell.programs import LOGGING, quiet

SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
    "jax_enable_x64",
    "jax_numpy_rank_promotion",
    LOGGING,
)
PATIENCE = 10.0  # [s] in which an idle process ends by itself


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


class _ProcessWorker:
    """One process and our end of its pipe; replaced when it has died.

    Args:
        settings: Of JAX, by name.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.task: Task | None = None
        self._settings = dict(settings)
        self._begin()

    def ask(self, call: bytes) -> tuple[Any, Exception | None]:
        """What a call returned, or what it raised.

        Raises:
            EOFError, OSError: The process died.
        """
        try:
            self._pipe.send_bytes(call)
            return pickle.loads(self._pipe.recv_bytes())
        except (EOFError, OSError):
            self.kill()
            raise

    def make_ready(self) -> None:
        """Replace the process where it has died.

        Raises:
            OSError: Another could not be started.
        """
        if self._killed or not self._process.is_alive():
            self.end()
            self._begin()

    def kill(self) -> None:
        """End the process now."""
        self._killed = True
        if self._process.pid is not None:  # else it could not even be started
            self._process.kill()

    def end(self) -> None:
        """End the process, which has nothing to do."""
        self._pipe.close()
        if self._process.pid is None:
            return
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, self._settings), daemon=True)
        self._killed = False
        try:
            self._process.start()
        finally:
            other.close()  # else its end would not be the end of the pipe


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
        settings = {name: getattr(jax.config, name) for name in SETTINGS}
        self._cache = None
        if not settings["jax_compilation_cache_dir"]:
            self._cache = tempfile.TemporaryDirectory(prefix="jshell-compiled-", ignore_cleanup_errors=True)
            settings["jax_compilation_cache_dir"] = self._cache.name
            settings[LOGGING] = quiet(settings[LOGGING])
        self._change = threading.Condition()
        self._waiting: deque[Task] = deque()
        self._closed = False
        self._workers = [_ProcessWorker(settings) for _ in range(workers)]
        self._threads = [
            threading.Thread(target=self._live, args=(worker,), name=f"jshell process {number}", daemon=True)
            for number, worker in enumerate(self._workers)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """Schedule a call of an importable function; its arguments and its result are pickled.

        Raises:
            RuntimeError: The engine is closed.
        """
        task = Task(Future(), (fn, args, kwargs))
        with self._change:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            self._waiting.append(task)
            self._change.notify()
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
            if worker is not None:
                worker.kill()
        return worker is not None

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks; waiting ones are still done unless cancelled."""
        with self._change:
            self._closed = True
            dropped = list(self._waiting) if cancel_futures else []
            for task in dropped:
                self._waiting.remove(task)
            self._change.notify_all()
        for task in dropped:
            task.future.cancel()
            task.future.set_running_or_notify_cancel()
        if wait:
            for thread in self._threads:
                thread.join()
            if self._cache is not None:
                self._cache.cleanup()

    def __exit__(self, kind, fault, traceback) -> None:
        if kind is not None:
            self.shutdown(wait=False, cancel_futures=True)
            with self._change:
                for worker in self._workers:
                    if worker.task is not None:
                        worker.kill()
        self.shutdown(wait=True)

    def _live(self, worker: _ProcessWorker) -> None:
        """Let a worker do one task after another, until the engine is closed and none waits."""
        while (task := self._next()) is not None:
            with contextlib.suppress(OSError):  # then the task is lost, and says so
                worker.make_ready()
            with self._change:  # from here on whoever stops the task finds a process to kill
                if not task.future.set_running_or_notify_cancel():
                    continue
                worker.task = task
            value, fault = _asked(worker, task)
            with self._change:
                worker.task = None
            if fault is None:
                task.future.set_result(value)
            else:
                task.future.set_exception(fault)
        worker.end()

    def _next(self) -> Task | None:
        with self._change:
            while not self._waiting and not self._closed:
                self._change.wait()
            return self._waiting.popleft() if self._waiting else None


def _asked(worker: _ProcessWorker, task: Task) -> tuple[Any, Exception | None]:
    """What a task returned, or why it did not."""
    try:
        call = pickle.dumps(task.call)
    except Exception as fault:  # whatever an object raises that cannot be pickled
        return None, fault
    try:
        return worker.ask(call)
    except (EOFError, OSError):
        return None, WorkerLost(
            task.name,
            found="its process died",
            expected="a process that lives until its task is done",
            remedy="Submit it again; if it dies again, it needs more memory than there is, or the script that "
            "starts it lacks `if __name__ == '__main__':`.",
        )
    except Exception as fault:  # whatever an object raises that cannot be unpickled
        return None, fault


def _serve(pipe: Connection, settings: Mapping[str, Any]) -> None:
    """In the new process: JAX as in the parent, then call after call until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, which ends what it began
    for name, value in settings.items():
        jax.config.update(name, value)
    threading.Thread(target=_end_with_parent, daemon=True, name="jshell parent watch").start()
    with contextlib.suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _answer(call: bytes) -> bytes:
    try:
        fn, args, kwargs = pickle.loads(call)
        return pickle.dumps((fn(*args, **kwargs), None))
    except Exception as fault:  # the task's own, kept for whoever asks for its result
        fault.add_note("In a process of the engine:\n" + "".join(traceback.format_exception(fault)))
        try:
            return pickle.dumps((None, fault))
        except Exception:  # an exception that holds what cannot be pickled
            return pickle.dumps((None, RuntimeError("".join(traceback.format_exception(fault)))))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)

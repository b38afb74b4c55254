"""This process: a task runs when it is submitted, and is done when `submit` returns.

Source     Python standard library: concurrent.futures.Executor
"""

from collections.abc import Callable
from concurrent.futures import Executor, Future


class Inline(Executor):
    """Runs every task at once, in the caller's thread. An interruption (Ctrl-C) goes to the caller, not to a future."""

    def __init__(self) -> None:
        self._closed = False

    def submit(self, fn: Callable, /, *args, **kwargs) -> Future:
        """A finished future: the value of `fn`, or what it raised.

        Raises:
            RuntimeError: The engine is closed.
        """
        if self._closed:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future: Future = Future()
        future.set_running_or_notify_cancel()
        try:
            value = fn(*args, **kwargs)
        except Exception as fault:  # the task's own, kept for whoever asks for its result
            future.set_exception(fault)
        else:
            future.set_result(value)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks."""
        self._closed = True

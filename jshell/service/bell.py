"""What wakes those who wait for something to do."""

import threading


class Bell:
    """Rung whenever there is something new; who looks at `rung`, then for work, then waits, misses nothing."""

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._rung = 0

    @property
    def rung(self) -> int:
        """How often it was rung until now."""
        return self._rung

    def ring(self) -> None:
        """Wake everybody."""
        with self._change:
            self._rung += 1
            self._change.notify_all()

    def wait(self, heard: int, seconds: float | int) -> bool:
        """Wait until it is rung, at most so many seconds; whether it was.

        Args:
            heard: What `rung` was before the look for work: rung since then, it returns at once.
            seconds: Longest time to wait.
        """
        with self._change:
            return self._change.wait_for(lambda: self._rung != heard, seconds)

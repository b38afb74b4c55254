"""What wakes those who wait for something to do.

Without it a worker that has found no work would see a new job half a second later, when it looks again.
"""

import threading


class Notifier:
    """Notified whenever there is something new; who looks at `count`, then for work, then waits, misses nothing."""

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._count = 0

    @property
    def count(self) -> int:
        """Notifications until now."""
        return self._count

    def notify(self) -> None:
        """Wake everybody."""
        with self._change:
            self._count += 1
            self._change.notify_all()

    def wait(self, seen: int, seconds: float | int) -> bool:
        """Wait until it is notified, at most so many seconds; whether it was.

        Args:
            seen: What `count` was before the look for work: notified since then, it returns at once.
            seconds: Longest time to wait.
        """
        with self._change:
            return self._change.wait_for(lambda: self._count != seen, seconds)

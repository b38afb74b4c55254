"""Who has fallen silent, as one observer sees it on a clock that nobody sets."""

import time
from collections.abc import Iterable

Heartbeat = tuple[str, int, float]  # a job, its attempt, and what its owner said last


class Silence:
    """The last heartbeat of every lease, and since when it has been the same."""

    def __init__(self) -> None:
        self._since: dict[Heartbeat, float] = {}
        self._looked = 0.0

    def of(self, heartbeats: Iterable[Heartbeat], seconds: float | int) -> list[Heartbeat]:
        """Those that have stood still for so long; to be asked again and again.

        After a pause of its own an observer begins anew: others may have spoken meanwhile, or were frozen as well.
        """
        now = time.monotonic()
        before = self._since if now - self._looked <= seconds else {}
        self._since = {heartbeat: before.get(heartbeat, now) for heartbeat in heartbeats}
        self._looked = now
        return [heartbeat for heartbeat, since in self._since.items() if now - since >= seconds]

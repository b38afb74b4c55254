"""Who has fallen silent, as one observer sees it on a clock that nobody sets."""

import time
from collections.abc import Iterable

Beat = tuple[str, int, float]  # a job, its attempt, and what its owner said last


class Silence:
    """What was heard of every lease, and since when it has been the same."""

    def __init__(self) -> None:
        self._since: dict[Beat, float] = {}
        self._looked = 0.0

    def of(self, beats: Iterable[Beat], seconds: float | int) -> list[Beat]:
        """Those that have stood still for so long; to be asked again and again.

        After a pause of its own an observer begins anew: others may have spoken meanwhile, or were frozen as well.
        """
        now = time.monotonic()
        before = self._since if now - self._looked <= seconds else {}
        self._since = {beat: before.get(beat, now) for beat in beats}
        self._looked = now
        return [beat for beat, since in self._since.items() if now - since >= seconds]

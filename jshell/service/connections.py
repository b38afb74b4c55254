"""Connections that ask for nothing: how long they may stay, and who goes when there are many.

uvicorn counts time only after an answer. Of 50 half headers and 50 silent connections it dropped none, granian the
headers after 30 s, hypercorn all after 5 s; none of them limits one address. So: a time in which a header is there as a
whole, and the oldest silent ones give way, those of a crowded address first.
"""

from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD = 10.0  # [s] in which the line and the headers of a request must have arrived
FROM_ONE = 64  # connections of one address that have not asked for anything yet
YOUNG = 1.0  # [s] in which nobody is silent: what it sends may be on its way
MOST = 1024  # connections


class Connection(H11Protocol):
    """uvicorn's protocol with an end to waiting."""

    began = 0.0
    until: float | None = None  # when the header under way must be there
    silent: dict[str, dict["Connection", None]]  # of every address, the oldest first

    def connection_made(self, transport: Any) -> None:
        """A new connection; the oldest silent one of its address, or of the most crowded one, may have to go."""
        super().connection_made(transport)
        self.began, address = self.loop.time(), self.client[0] if self.client else ""
        self.silent = vars(self.server_state).setdefault("silent", {})
        self._near = self.silent.setdefault(address, {})
        self._near[self] = None
        self._wait()
        first = next(iter(self._near))
        if len(self._near) > FROM_ONE and first.began < self.began - YOUNG:
            first._leave()
        elif len(self.connections) > MOST:
            next(iter(max(self.silent.values(), key=len)))._leave()

    def connection_lost(self, exc: Exception | None) -> None:
        """The end of a connection."""
        super().connection_lost(exc)
        self._unset_keepalive_if_required()
        self._near.pop(self, None)
        if not self._near and self.client is not None:
            self.silent.pop(self.client[0], None)

    def data_received(self, data: bytes) -> None:
        """Part of a request; the time for a header does not begin anew with every byte of it."""
        super().data_received(data)
        if self.transport.is_closing():
            return
        if self.cycle is None or self.cycle.response_complete:
            self._wait()
        else:
            self.until = None
        if self.cycle is not None:
            self._near.pop(self, None)

    def _wait(self) -> None:
        self._unset_keepalive_if_required()
        now = self.loop.time()
        self.until = self.until or now + HEAD
        self.timeout_keep_alive_task = self.loop.call_later(self.until - now, self._leave)

    def _leave(self) -> None:
        self._near.pop(self, None)
        self.transport.abort()

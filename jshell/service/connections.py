"""Connections that ask for nothing, or do not read: how long they may stay, and who goes when there are many.

uvicorn counts time only after an answer, and waits for ever until one is read, even where it has closed the line. Of 50
half headers and 50 silent connections it dropped none, granian the headers after 30 s, hypercorn all after 5 s; none of
them limits one address. So: a time in which a header is there as a whole, a rate at which answers are read, and where
lines are short those give way that serve nobody, the oldest of a crowded address first.
"""

import asyncio
import contextlib
import socket
import struct
from collections import Counter
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD = 10.0  # [s] in which the line and the headers of a request must have arrived
FROM_ONE = 64  # connections of one address that have not asked for anything yet
YOUNG = 1.0  # [s] in which nobody is silent: what it sends may be on its way
MOST = 1024  # connections; above, they give way to new ones
SPARE = 16  # of anonymous ones that give way at a time, so that looking for them is not the service's main work
READ = 10.0  # [s] after which an anonymous caller must have read some of its answer, and again and again
READ_KNOWN = 120.0  # [s] the same of who may ask: a slow reader's own system passes on much at a time, and seldom
RATE = 2048.0  # bytes a second that are read by then; half of what is asked of bodies, for the same reason
SENDING = 128 * 1024  # bytes of an answer that the system may hold, so that reading is seen here
ANONYMOUS, SERVED_ANONYMOUS, IDLE, UNREAD, SERVED = range(5)  # who goes where lines are short, the first ones first
ADMITTED = "admitted"  # in the state of a request: it may ask for more than what stands open


class Connection(H11Protocol):
    """uvicorn's protocol with an end to waiting."""

    began = since = 0.0  # of the connection; of what it does now
    until: float | None = None  # when the header under way must be there
    unread = 0  # bytes that waited to be sent when somebody last looked
    timer: asyncio.TimerHandle | None = None  # until it is checked whether the answer is read
    silent: dict[str, dict["Connection", None]]  # of every address, the oldest first

    def connection_made(self, transport: Any) -> None:
        """A new connection; one that is silent, idle or does not read may have to go for it."""
        super().connection_made(transport)
        self._set(socket.SO_SNDBUF, SENDING)
        transport.set_write_buffer_limits(high=0)  # whatever waits to be sent is noticed
        self.began = self.since = self.loop.time()
        self.address = self.client[0] if self.client else ""
        self.silent = vars(self.server_state).setdefault("silent", {})
        self._near = self.silent.setdefault(self.address, {})
        self._near[self] = None
        self._wait()
        first = next(iter(self._near))
        if len(self._near) > FROM_ONE and first.began < self.began - YOUNG:
            first._leave()
        elif len(self.connections) > MOST:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """The end of a connection."""
        super().connection_lost(exc)
        self._unset_keepalive_if_required()
        self._stop_checking()
        self._near.pop(self, None)
        if not self._near:
            self.silent.pop(self.address, None)

    def data_received(self, data: bytes) -> None:
        """Part of a request; the time for a header does not begin anew with every byte of it."""
        before = self.cycle
        super().data_received(data)
        if self.transport.is_closing():
            return
        if self.cycle is not before:
            self.since = self.loop.time()
        if self.cycle is None or self.cycle.response_complete:
            self._wait()
        else:
            self.until = None
        if self.cycle is not None:
            self._near.pop(self, None)

    def on_response_complete(self) -> None:
        """An answer is on its way, and the connection waits for another request."""
        self.since = self.loop.time()
        super().on_response_complete()

    def pause_writing(self) -> None:
        """More is written than the line takes: from now on it must be read."""
        super().pause_writing()
        self._check_later()

    def resume_writing(self) -> None:
        """All that was written is on its way."""
        super().resume_writing()
        self._stop_checking()

    def _wait(self) -> None:
        self._unset_keepalive_if_required()
        now = self.loop.time()
        self.until = self.until or now + HEAD
        self.timeout_keep_alive_task = self.loop.call_later(self.until - now, self._leave)

    def _check_later(self) -> None:
        self._stop_checking()
        seconds = READ_KNOWN if self._admitted() else READ
        self.unread = self.transport.get_write_buffer_size()
        self.timer = self.loop.call_later(seconds, self._check_reading, seconds)

    def _check_reading(self, seconds: float) -> None:
        """Whether so much was read in so many seconds that the connection may stay."""
        if self.unread - self.transport.get_write_buffer_size() < RATE * seconds:
            self._leave()
        else:
            self._check_later()

    def _stop_checking(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None

    def _admitted(self) -> bool:
        """Whether the last request was one of who may ask."""
        return self.scope is not None and ADMITTED in self.scope.get("state", ())

    def _make_room(self) -> None:
        """Some others go, the oldest of the most crowded address first; none where all of them are being served.

        This one stays in any case: whoever may ask begins as an anonymous caller whose request is on its way.
        """
        now = self.loop.time()
        others = [(one._use(now), one) for one in self.connections if isinstance(one, Connection) and one is not self]
        crowd = Counter((use, one.address) for use, one in others)
        others.sort(key=lambda other: (other[0], -crowd[other[0], other[1].address], other[1].since))
        for count, (use, one) in enumerate(others[:SPARE]):
            if use <= SERVED_ANONYMOUS or (use < SERVED and count == 0):
                one._leave()

    def _use(self, now: float) -> int:
        """What would be lost with a connection: the least first."""
        served = self.cycle is not None and not self.cycle.response_complete
        if not self._admitted():
            if self.flow.write_paused or not served:
                return ANONYMOUS
            return SERVED_ANONYMOUS if now - self.since > YOUNG else SERVED  # its token is perhaps being looked at
        if not self.flow.write_paused:
            return SERVED if served else IDLE
        stands = self.transport.get_write_buffer_size() == self.unread and now - self.since > READ
        return UNREAD if stands else SERVED

    def _leave(self) -> None:
        self._near.pop(self, None)
        self.connections.discard(self)
        if self.flow.write_paused or not self._admitted():  # else the system keeps what nobody reads, and the line
            self._set(socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.transport.abort()

    def _set(self, option: int, value: int | bytes) -> None:
        with contextlib.suppress(OSError):  # it has gone already
            self.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, option, value)

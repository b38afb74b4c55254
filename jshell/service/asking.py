"""Requests of a client: tried again while that can help, answered in time, refused in the library's own words."""

import queue
import threading
import time
import uuid
from collections.abc import Callable
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any

from jshell.errors import JshellError
from jshell.service import sending
from jshell.service.receiving import SPOILED, error_of

if TYPE_CHECKING:
    import httpx

AGAIN = (429, 502, 503, 504)  # worth another try
ARRIVAL = 120.0  # [s] that a body may take beside the time for its answer, at most: what a service grants
RATE = 64 * 1024.0  # [bytes/s] of a slow line, at which a body is granted its time


class Unreachable(JshellError, OSError):
    """No service answers at the address, or something that is none."""

    code = "unreachable"


class Asking:
    """One address, asked again and again."""

    url: str
    timeout: float | int
    patience: float | int
    _http: "httpx.Client"

    def _ask(self, read: Callable[[Any], Any], method: str, address: str, **given: Any) -> Any:
        """What an answer in JSON says; as `_fetch`."""
        response = self._send(method, address, **given)
        return _taken(response, lambda: read(response.json()))

    def _fetch(self, read: Callable[[bytes], Any], address: str) -> Any:
        """What a file of the service says.

        Raises:
            Unreachable: It is not an answer of jshell's.
        """
        response = self._send("GET", address)
        return _taken(response, lambda: read(response.content))

    def _send(
        self, method: str, address: str, *, key: str | None = None, body: bytes | None = None,
        until: float | None = None, **given: Any,
    ) -> "httpx.Response":  # fmt: skip
        """A request, tried again while that can help, or until a time; errors as the library's."""
        import httpx

        if method == "POST":
            given["headers"] = {"Idempotency-Key": key or uuid.uuid4().hex}
        if body is not None:
            given["headers"] |= {"Content-Type": "application/octet-stream", "Content-Length": str(len(body))}
        end, pause, waits = until or time.monotonic() + self.patience, 0.1, until is not None
        while True:
            left = self.timeout if until is None else min(self.timeout, max(until - time.monotonic(), 0.1))
            try:
                if body is not None:
                    given["content"] = sending.pieces(body)
                response = self._answer(left, method, f"/api/v1{address}", **given)
            except httpx.RequestError as error:
                if time.monotonic() + pause > end or (isinstance(error, httpx.ConnectError) and not waits):
                    raise Unreachable(
                        self.url, found=str(error) or type(error).__name__, expected="an answer",
                        remedy="Start it with `jshell serve`, or check the address.",
                    ) from None  # fmt: skip
            else:
                if response.status_code < 300:
                    return response
                pause = max(pause, min(_seconds(response.headers.get("Retry-After", "")), 2.0))
                if response.status_code not in AGAIN or time.monotonic() + pause > end:
                    raise _problem(response)
            time.sleep(pause)
            pause = min(2 * pause, 2.0)

    def _answer(self, seconds: float | int, method: str, address: str, **given: Any) -> "httpx.Response":
        """One answer within so many seconds and what its own body takes; httpx limits only the time between two bytes.

        Raises:
            httpx.RequestError: None came.
        """
        import httpx

        request = self._http.build_request(method, address, **given)
        whole = seconds + min(int(request.headers.get("Content-Length", 0)) / RATE, ARRIVAL)
        # what was written may still be on its way when the answer is waited for
        request.extensions["timeout"] = httpx.Timeout(whole, connect=seconds).as_dict()
        box: queue.SimpleQueue[httpx.Response | Exception] = queue.SimpleQueue()

        def ask() -> None:
            try:
                box.put(self._http.send(request))
            except Exception as error:  # handed to who waits
                box.put(error)

        threading.Thread(target=ask, daemon=True, name="jshell client").start()
        try:
            found = box.get(timeout=whole)
        except queue.Empty:
            raise httpx.ReadTimeout(f"no whole answer within {whole:.3g} s") from None
        if isinstance(found, Exception):
            raise found
        return found


def _seconds(text: str) -> float:
    """What Retry-After asks for, in seconds or as a date; 0 where it is neither."""
    try:
        return float(text) if text.isdecimal() else parsedate_to_datetime(text).timestamp() - time.time()
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError, OSError):  # of years beyond any calendar
        return 0.0


def _problem(response: "httpx.Response") -> JshellError:
    """The error that a problem of RFC 9457 carries."""
    try:
        return error_of(response.json())
    except SPOILED as error:
        return _not_ours(response, error)


def _taken(response: "httpx.Response", read: Callable[[], Any]) -> Any:
    """What is read of an answer.

    Raises:
        Unreachable: It is not an answer of jshell's.
    """
    try:
        return read()
    except SPOILED as error:
        raise _not_ours(response, error) from None


def _not_ours(response: "httpx.Response", error: Exception) -> Unreachable:
    kind = response.headers.get("Content-Type", "nothing")
    words = error.found if isinstance(error, JshellError) else str(error) or type(error).__name__
    return Unreachable(
        str(response.url), found=f"status {response.status_code} and {kind} from something else ({words[:120]})",
        expected="jshell's service", remedy="Check the address.",
    )  # fmt: skip

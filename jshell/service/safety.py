"""Who may ask, by what name, and how much: checked before a request is read.

Neither Starlette nor uvicorn limits the size of a whole body, so its bytes are
counted here, chunked ones too. A page of another site can make a browser send
requests to this machine: the Host header must be one of ours (rebinding), and
what changes anything must come from our own pages or from no page at all.
There is no CORS: no other site may read an answer.
"""

import asyncio
import contextlib
import hmac
import re
import unicodedata
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import quote

from fastapi.security.utils import get_authorization_scheme_param
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection

from jshell.errors import BadValue, JshellError
from jshell.service import sessions
from jshell.service.connections import ADMITTED
from jshell.service.database import Database
from jshell.service.problems import Refused, unforeseen
from jshell.service.settings import LOCAL, MAX_BODY_BYTES, Settings

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
Refuse = Callable[[Scope, JshellError], App]

COOKIE = "jshell_session"
OPEN = ("/healthz", "/login", "/static/")  # what needs no token
SAFE = ("GET", "HEAD", "OPTIONS")
LARGE = 2**20  # bytes of a body that is no form from which only some are read at the same time
MAX_LARGE_BODIES = 8  # of these; the others wait in the network, and their time does not run
DOOR = 4096  # bytes of a body where no token is asked for, whether the service has one or not
AT_DOOR = 8  # of these from one address at the same time
SLOWEST = 4096.0  # bytes a second that a body must bring, once it has had
FIRST = 10.0  # [s] to begin
NAME = 120  # characters of a file's name that are kept
HEADERS = {
    "content-security-policy": "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


def check_open(settings: Settings) -> None:
    """Refuse to listen where other machines can ask, without a token.

    Raises:
        BadValue: An address other than this machine's own, and no token, or one that is easily guessed.
    """
    if settings.host in LOCAL:
        return
    if not settings.token:
        raise BadValue(
            "--host",
            found=f"{settings.host}, where other machines can ask, and no token",
            expected="127.0.0.1, or a token",
            remedy="Set JSHELL_TOKEN to a long random text, e.g. of `openssl rand -hex 24`.",
        )
    if len(settings.token) < 16:
        raise BadValue(
            "token", found=f"{len(settings.token)} characters", expected="at least 16",
            remedy="Take a random one, e.g. of `openssl rand -hex 24`.",
        )  # fmt: skip


class Gate:
    """The first thing a request meets: name, token, origin, size, time.

    Args:
        app: What comes after.
        settings: Names, token and limits.
        database: Knows the sessions of browsers.
        refuse: Makes of an error the answer.
        own: Whether an address is one of the service's.
    """

    def __init__(
        self, app: App, settings: Settings, database: Database, refuse: Refuse, own: Callable[[str], bool]
    ) -> None:
        self.app, self.settings, self.database, self.refuse, self.own = app, settings, database, refuse, own
        self.hosts = {host.lower().strip("[]") for host in settings.allowed_hosts}
        self.large_bodies = asyncio.Semaphore(MAX_LARGE_BODIES)
        self.at_door: Counter[str] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        dressed = self._dressed(send)
        if (inner := self._inner(scope["path"])) != scope["path"]:
            scope = {**scope, "path": inner, "raw_path": b""}
        path, address = scope["path"], (scope.get("client") or ("",))[0]
        at_door = is_open(path) and scope["method"] not in SAFE
        most = DOOR if is_open(path) else self._most(headers)
        error = await self._refusal(scope, headers, most)
        if error is None and at_door and self.at_door[address] >= AT_DOOR:
            error = Refused(
                "address", found=f"{AT_DOOR} requests without a token under way", expected="fewer at once",
                remedy="Try again later.", code="too_many",
            )  # fmt: skip
        if error is not None:
            await self.refuse(scope, error)(scope, receive, dressed)
            return
        if not is_open(path):
            scope.setdefault("state", {})[ADMITTED] = True  # its connection may read slowly, and is the last to go
        counted = _Counted(receive, most, FIRST if at_door else self.settings.arrival, _is_form(headers))
        started = False
        self.at_door[address] += at_door

        async def watched(message: Message) -> None:
            nonlocal started
            if counted.error is None or started:  # what others make of a body that was cut off is not said
                started = True
                await dressed(message)

        try:
            async with self.large_bodies if _is_large(headers) and not is_open(path) else contextlib.nullcontext():
                # what looks is answered without its body, which the server leaves out by the scope it was given
                asked = {**scope, "method": "GET"} if scope["method"] == "HEAD" else scope
                await self.app(asked, counted, watched)
        except Exception as fault:  # the outer edge: one record in the log, an answer where none has begun
            counted.error = counted.error or unforeseen(fault, scope["path"])
        finally:
            self.at_door[address] -= at_door
            if not self.at_door[address]:
                del self.at_door[address]
        if counted.error is not None and not started:
            await self.refuse(scope, counted.error)(scope, receive, dressed)

    def _inner(self, path: str) -> str:
        """An address without the part that a proxy in front may take away, or not.

        An address of ours may begin like that part, as `/fits/new` below `/fits`: it stays where the rest is none.
        """
        root = self.settings.root_path
        while root and path.startswith(f"{root}/"):
            rest = path[len(root) :]
            if self.own(path) and not self.own(rest):
                break
            path = rest
        return path

    async def _refusal(self, scope: Scope, headers: Headers, most: int) -> JshellError | None:
        """Why a request goes no further; one whose headers nobody foresaw neither, with one record in the log."""
        try:
            return self._error(scope, headers, most) or await self._anonymous(HTTPConnection(scope))
        except Exception as fault:  # an outer edge, as the one above: headers come from anybody
            return unforeseen(fault, scope["path"])

    def _error(self, scope: Scope, headers: Headers, most: int) -> JshellError | None:
        host = headers.get("host", "")
        if _name(host) not in self.hosts:
            return Refused(
                "header Host",
                code="wrong_host",
                found=repr(host[:80]),
                expected="one of " + ", ".join(sorted(self.hosts)),
                remedy="Call the service by one of its names, or start it with --allow-host NAME.",
            )
        if scope["method"] not in SAFE:
            error = _cross_site(headers, host)
            if error is not None:
                return error
        charset = re.search(r"charset=[\"']?([^;\"'\s]*)", headers.get("content-type", "").lower())
        if charset is not None and charset[1] not in ("utf-8", "utf8", "us-ascii"):
            return Refused(
                "header Content-Type", found=repr(charset[1][:80]), expected="UTF-8", remedy="Send it as UTF-8."
            )
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length) > most:
            return too_large(int(length), most, _is_form(headers))
        return None

    async def _anonymous(self, asker: HTTPConnection) -> JshellError | None:
        """The refusal of who shows neither the token nor the cookie of a session."""
        token, session = self.settings.token, asker.cookies.get(COOKIE, "")
        kind, given = get_authorization_scheme_param(asker.headers.get("authorization"))
        given = given.strip() if kind.lower() == "bearer" else ""
        if not token or is_open(asker.scope["path"]) or hmac.compare_digest(given.encode(), token.encode()):
            return None
        try:
            if session and await run_in_threadpool(sessions.is_known, self.database, session):
                return None
        except JshellError as error:
            return error
        return Refused(
            "header Authorization", code="no_token",
            found="another token" if given else "a session that has ended" if session else "no token",
            expected="Bearer and the service's token",
            remedy="Ask its keeper for the token; a browser gives it at /login.",
        )  # fmt: skip

    def _most(self, headers: Headers) -> int:
        """The largest body: files of a form wait on the disk, anything else in memory."""
        return self.settings.upload if _is_form(headers) else min(MAX_BODY_BYTES, self.settings.upload)

    def _dressed(self, send: Send) -> Send:
        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                if headers.get("location", "").startswith("/"):
                    headers["location"] = self.settings.root_path + headers["location"]
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        return dressed


class _Counted:
    """A body whose bytes and seconds are counted while it arrives."""

    def __init__(self, receive: Receive, most: int, seconds: float | int, form: bool) -> None:
        self.receive, self.most, self.seconds, self.form = receive, most, seconds, form
        self.bytes, self.begun, self.done = 0, 0.0, False
        self.error: JshellError | None = None

    async def __call__(self) -> Message:
        if self.error is not None:
            raise self.error
        if self.done:
            return await self.receive()
        now = asyncio.get_running_loop().time()
        self.begun = self.begun or now
        until = self.begun + min(self.seconds, FIRST + self.bytes / SLOWEST)
        try:
            async with asyncio.timeout_at(until):
                message = await self.receive()
        except TimeoutError:
            self.error = Refused(
                "body", found=f"{self.bytes} bytes after {now - self.begun:.3g} s, and no end", code="too_slow",
                expected=f"all of it within {self.seconds:g} s, and {SLOWEST / 1024:g} KiB/s on the way",
                remedy="Send less at once, or over a faster line.",
            )  # fmt: skip
            raise self.error from None
        if message["type"] == "http.request":
            self.bytes += len(message.get("body", b""))
            self.done = not message.get("more_body", False)
            if self.bytes > self.most:
                self.error = too_large(self.bytes, self.most, self.form)
                raise self.error
        return message


def _is_form(headers: Headers) -> bool:
    return headers.get("content-type", "").lower().startswith("multipart/form-data")


def _is_large(headers: Headers) -> bool:
    """Whether a body takes much memory, or does not say how much."""
    if _is_form(headers):
        return False
    length = headers.get("content-length", "0")
    return "transfer-encoding" in headers or not length.isdecimal() or int(length) > LARGE


def too_large(found: int, most: int, form: bool) -> Refused:
    """The refusal of a body that is larger than `most` bytes; a form may hold more than others."""
    more = "" if form else "; as files of a form they may be larger"
    return Refused(
        "body",
        code="too_large",
        found=f"{found / 2**20:.3g} MiB or more",
        expected=f"at most {most / 2**20:.3g} MiB",
        remedy=f"Keep every tenth row, cut the record, or send several uploads{more}.",
    )


def is_open(path: str) -> bool:
    """Whether an address asks for no token."""
    return any(path == one or (one[-1] == "/" and path.startswith(one)) for one in OPEN)


def _name(host: str) -> str:
    """The name in a Host header, without its port; empty where it is no name."""
    found = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(?::\d{1,5})?", host)
    return found[1].strip("[]").lower() if found else ""


def _cross_site(headers: Headers, host: str) -> JshellError | None:
    """The refusal of a request that another site's page makes a browser send."""
    origin = headers.get("origin")
    site = headers.get("sec-fetch-site", "none")
    strange = origin is not None and origin.partition("://")[2].lower() != host.lower()  # it has no path: RFC 6454
    if not strange and site in ("none", "same-origin"):
        return None
    return Refused(
        "header Origin", code="cross_site", found=repr((origin or site)[:80]), expected="this service's own pages",
        remedy="Open the service's page itself, or use its API from a program.",
    )  # fmt: skip


def clean_name(name: str | None) -> str:
    """A file's name as it may be kept and shown: no path, no control or direction marks, of bearable length."""
    last = re.split(r"[/\\]", name or "")[-1]
    plain = "".join(letter for letter in last if unicodedata.category(letter)[0] != "C").strip().strip(".")
    stem, dot, suffix = plain.rpartition(".")
    if not dot or len(suffix) > 8:
        stem, dot, suffix = plain, "", ""
    return (stem[: NAME - 9] or "trace") + dot + suffix


def attachment(name: str) -> str:
    """The header that lets a browser keep an answer as a file of this name."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", name)
    return f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"

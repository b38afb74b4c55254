"""Who holds a line and asks for nothing; who guesses; who comes through a proxy."""

import contextlib
import json
import logging
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from jshell.service import connections, safety, sessions
from jshell.service.settings import Settings
from jshell.service.store import Store

from .conftest import listening

SCRIPT = Path(__file__).with_name("attack.py")
TOKEN = "a-long-random-token-of-the-group"
LOGIN = b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-www-form-urlencoded\r\n"


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Store]]:
    """A service with a token behind a proxy that shows it under /fit."""
    db = f"sqlite:///{tmp_path_factory.mktemp('guarded') / 'jobs.db'}"
    settings = Settings(db=db, warm=False, token=TOKEN, proxy="127.0.0.1", root_path="/fit")
    with listening(settings) as found:
        yield found


@pytest.fixture
def line(guarded, monkeypatch) -> Iterator[socket.socket]:
    monkeypatch.setattr(connections, "HEAD", 0.4)
    with socket.create_connection(("127.0.0.1", urlsplit(guarded[0]).port), 10) as made:
        yield made


@pytest.fixture
def browser(guarded) -> Iterator[httpx.Client]:
    """What comes from the proxy, in the name of a browser that spoke TLS."""
    headers = {"X-Forwarded-Proto": "https", "X-Forwarded-For": "192.0.2.7"}
    with httpx.Client(base_url=guarded[0], headers=headers, timeout=30, trust_env=False) as made:
        yield made


def dropped(line: socket.socket, drip: bytes = b"") -> float:
    """Seconds until a line is closed, a byte of something sent again and again."""
    begun = time.monotonic()
    line.settimeout(0.05)
    while time.monotonic() - begun < 10:
        try:
            if drip:
                line.sendall(drip)
            if not line.recv(4096):
                break
        except TimeoutError:
            continue
        except OSError:
            break
    return time.monotonic() - begun


@pytest.mark.parametrize(
    "first", [b"", b"GET / HTTP/1.1\r\nX: ", b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\nGET"]
)
def test_who_never_ends_a_header_is_dropped_however_it_drips(line, first):
    line.sendall(first)
    assert dropped(line, b"a" if first else b"") < 5


def test_the_silent_of_a_crowded_address_give_way_and_who_asks_stays(guarded, monkeypatch):
    monkeypatch.setattr(connections, "FROM_ONE", 3)
    monkeypatch.setattr(connections, "YOUNG", -1.0)  # even in one moment
    port = urlsplit(guarded[0]).port
    with contextlib.ExitStack() as held, httpx.Client(base_url=guarded[0], timeout=30, trust_env=False) as http:
        assert http.get("/healthz").status_code == 200
        lines = [held.enter_context(socket.create_connection(("127.0.0.1", port), 10)) for _ in range(8)]
        assert all(dropped(one) < 5 for one in lines[:3])
        assert http.get("/healthz").status_code == 200


STATIC = b"GET /static/uPlot.iife.min.js HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.fixture
def large(guarded) -> bytes:
    """A request, with the token, for what the system holds only in parts."""
    trace = guarded[1].add_trace("large.csv", bytes(1_000_000)).id
    head = f"GET /api/v1/traces/{trace}/content HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\n"
    return (head + "Connection: close\r\n\r\n").encode()


def narrow(port: int, sent: bytes, held: int = 4096) -> socket.socket:
    """A line that takes little before it is read, and what was asked on it."""
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, held)
    made.connect(("127.0.0.1", port))
    made.sendall(sent)
    return made


def reset(line: socket.socket, seconds: float = 5.0) -> bool:
    """Whether a line that nobody reads is dropped within this time."""
    asked = select.poll()
    asked.register(line, 0)  # errors alone
    return bool(asked.poll(1000 * seconds))


@pytest.mark.parametrize(("known", "limit"), [(False, "READ"), (True, "READ_KNOWN")])
def test_who_does_not_read_its_answer_is_dropped(guarded, large, monkeypatch, known, limit):
    monkeypatch.setattr(connections, limit, 0.1)
    with narrow(urlsplit(guarded[0]).port, large if known else STATIC * 8) as line:
        assert reset(line)


def test_who_reads_a_large_answer_slowly_gets_all_of_it(guarded, large, monkeypatch):
    monkeypatch.setattr(connections, "READ_KNOWN", 0.15)
    monkeypatch.setattr(connections, "RATE", 1e5)
    begun, found = time.monotonic(), 0
    with narrow(urlsplit(guarded[0]).port, large, 30_000) as line:
        line.settimeout(5)
        while part := line.recv(20_000):
            found += len(part)
            time.sleep(0.01)
    assert time.monotonic() - begun > connections.READ_KNOWN
    assert found > 1_000_000


@pytest.mark.parametrize("known", [False, True])
def test_who_holds_lines_gives_way_to_who_comes_with_the_token(guarded, large, monkeypatch, known):
    monkeypatch.setattr(connections, "MOST", 8)
    monkeypatch.setattr(connections, "READ", 0.0 if known else 60.0)  # they go for others, not for their silence
    port = urlsplit(guarded[0]).port
    asked = f"GET /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\n\r\n".encode()
    monkeypatch.setattr(connections, "YOUNG", 0.0)

    def served(line: socket.socket) -> bool:
        line.sendall(asked)
        return b" 200 " in line.recv(65536)[:20]

    with contextlib.ExitStack() as held:
        made = lambda: held.enter_context(socket.create_connection(("127.0.0.1", port), 5))  # noqa: E731
        lines = [held.enter_context(narrow(port, large if known else STATIC * 8)) for _ in range(10)]
        regular, until = made(), time.monotonic() + 5
        assert served(regular)
        while not any(reset(one, 0.001) for one in lines):
            with socket.create_connection(("127.0.0.1", port), 5) as new:
                assert served(new)
            assert time.monotonic() < until
        if not known:  # who has shown the token keeps its line, and is served on it
            assert served(regular)


def test_a_body_without_a_token_is_small_and_soon_there(line, browser, monkeypatch):
    assert browser.post("/login", content=b"&" * 5000).status_code == 413
    monkeypatch.setattr(safety, "FIRST", 0.3)
    line.sendall(LOGIN + b"Content-Length: 100\r\n\r\nt")
    assert line.recv(4096).split(b"\r\n")[0].endswith(b"408 Request Timeout")
    assert dropped(line) < 5
    refused = browser.post("/api/v1/fits", content=(b"a" for _ in range(3)))
    assert refused.status_code == 401


def test_a_body_at_the_door_is_small_also_where_there_is_no_token(http, browser):
    kind = {"Content-Type": "application/x-www-form-urlencoded"}
    for one in (http, browser):
        assert one.post("/login", content=b"&" * 5000, headers=kind).status_code == 413
        assert one.post("/login", content=(b"&" * 3000 for _ in range(2)), headers=kind).status_code == 413
        assert one.post("/login", files={"token": b"&" * 5000}).status_code == 413
        assert one.request("GET", "/healthz", content=b"&" * 5000).status_code == 413  # and whatever is asked there
    assert http.post("/login", data={"token": "x"}).status_code == 401


def test_only_some_bodies_without_a_token_come_from_one_address(line, browser, guarded, monkeypatch):
    monkeypatch.setattr(safety, "AT_DOOR", 1)
    line.sendall(LOGIN + b"Content-Length: 100\r\n\r\nt")
    with socket.create_connection(line.getpeername(), 10) as other:
        time.sleep(0.1)
        other.sendall(LOGIN + b"Content-Length: 7\r\n\r\ntoken=x")
        assert b"429" in other.recv(4096).split(b"\r\n")[0]
    assert browser.post("/login", data={"token": "x"}).status_code == 401  # from elsewhere


STRANGE = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: eA==\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n\r\n",
    b"no request\r\n\r\n",
    b"GET / HTTP/9.9\r\n\r\n",
    b"\x16\x03\x01 what begins TLS\r\n\r\n",
    b"GET / HTTP/1.1\r\nX: " + b"x" * 20_000,
)


@pytest.mark.parametrize("sent", STRANGE)
def test_what_anybody_sends_leaves_no_line_in_the_log(line, sent, caplog):
    log = logging.getLogger("uvicorn.error")
    log.addHandler(caplog.handler)
    try:
        line.sendall(sent)
        assert line.recv(4096).split(b"\r\n")[0].split()[1] in (b"303", b"400", b"421")
    finally:
        log.removeHandler(caplog.handler)
    assert [one.getMessage() for one in caplog.records if one.levelname != "INFO"] == []


def test_guesses_of_an_address_come_to_an_end_and_nobody_else_waits(browser, guarded):
    begun = time.monotonic()
    asked = [
        browser.post("/login", data={"token": "guess"}, headers={"X-Forwarded-For": "192.0.2.9"}) for _ in range(12)
    ]
    assert [one.status_code for one in asked] == [401] * sessions.GUESSES + [429] * 2
    assert asked[-1].headers["retry-after"] == "60"
    assert time.monotonic() - begun < 5  # nobody sleeps
    assert browser.post("/login", data={"token": TOKEN}).status_code == 303


def test_a_session_is_not_the_token_and_ends_when_it_is_ended(browser, guarded):
    entered = browser.post("/login", data={"token": TOKEN, "next": "/simulate"})
    assert entered.headers["location"] == "/fit/simulate"
    cookie = entered.headers["set-cookie"]
    assert TOKEN not in cookie
    assert all(word in cookie for word in ("Secure", "HttpOnly", "SameSite=strict", "Path=/fit"))
    name = cookie.split("=", 1)[1].split(";")[0]
    held = {"Cookie": f"{safety.COOKIE}={name}"}
    page = browser.get("/fit/", headers=held)  # with the proxy's part of the address, or without
    assert page.status_code == browser.get("/", headers=held).status_code == 200
    assert 'href="/fit/static/jshell.css"' in page.text
    assert 'action="/fit/logout"' in page.text
    assert browser.get("/", headers={"Cookie": f"{safety.COOKIE}={TOKEN}"}).status_code == 303
    assert browser.post("/logout", headers=held).headers["location"] == "/fit/login"
    assert browser.get("/", headers=held).status_code == 303  # wherever the cookie has gone
    again = browser.post("/login", data={"token": TOKEN}).headers["set-cookie"].split("=", 1)[1].split(";")[0]
    database = guarded[1].database
    assert sessions.is_known(database, again)
    with database.writing() as connection:
        connection.execute(sessions.sessions.update().values(ends=1.0))
    assert not sessions.is_known(database, again)


def test_the_description_says_where_the_service_stands(browser):
    found = browser.get("/openapi.json", headers={"Authorization": f"Bearer {TOKEN}"}).json()
    assert found["servers"] == [{"url": "/fit"}]


@pytest.mark.slow
def test_eight_clients_are_served_while_a_thousand_lines_are_held():
    done = subprocess.run([sys.executable, "-W", "ignore", SCRIPT, "attack", "15"], capture_output=True, timeout=300)
    found = json.loads(done.stdout)
    assert found["wrong"] == [[], []]
    assert found["p95_attacked_ms"] < 2 * found["p95_quiet_ms"]
    assert found["left"] == 0
    assert all(seconds < 20 for _, seconds in found["gone"].values())
    assert found["33 MB of &"][0] == 413
    assert found["longest guess"] < 2
    assert found["code"] == 0

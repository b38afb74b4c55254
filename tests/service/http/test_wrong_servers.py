"""The client and what is no service, or is none for a while: typed errors, within the time asked."""

import contextlib
import json
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

import jshell
from jshell.errors import JshellError
from jshell.service import asking
from jshell.service.asking import Unreachable, _seconds
from jshell.service.settings import Settings
from jshell.shell.presets import R

from .conftest import RECORDING, listening

OK = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
HTML = b"<html><h1>Welcome to nginx</h1></html>"


def whole(head: bytes, body: bytes) -> bytes:
    return head + b"Connection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body


def drip(line: socket.socket, first: bytes, drop: bytes = b" ") -> None:
    line.sendall(first)
    for _ in range(60):
        line.sendall(drop)
        time.sleep(0.05)


MISBEHAVIOURS: dict[str, bytes | Callable[[socket.socket], None]] = {
    "html": whole(b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n", HTML),
    "html 502": whole(b"HTTP/1.1 502 Bad Gateway\r\nContent-Type: text/html\r\n", HTML),
    "redirect": whole(b"HTTP/1.1 302 Found\r\nLocation: https://login.example/\r\n", b""),
    "a date to come back": whole(b"HTTP/1.1 503 Later\r\nRetry-After: Fri, 31 Dec 2100 23:59:59 GMT\r\n", b"{}"),
    "another's json": whole(OK, b'{"ok": true}'),
    "a list": whole(OK, b"[1, 2]"),
    "too deep": whole(OK, b"[" * 20_000),
    "no text": whole(OK, b"\xff\xfe\x00"),
    "not http": b"220 mail.example ESMTP\r\n",
    "nothing": b"",
    "half of it": OK + b"Content-Length: 1000\r\n\r\n{",
    "no gzip": whole(OK + b"Content-Encoding: gzip\r\n", b"not at all"),
    "a date beyond calendars": whole(
        b"HTTP/1.1 503 Later\r\nRetry-After: 1 Oct %s 07:28:00 GMT\r\n" % (b"9" * 20), b"{}"
    ),
    "a problem that is none": whole(b"HTTP/1.1 422 No\r\n", b'{"code": [], "place": 1, "found": 1, "expected": {}}'),
    "a slow body": lambda line: drip(line, OK + b"Content-Length: 1000\r\n\r\n"),
    "a slow header": lambda line: drip(line, OK + b"X-1: "),
    "continue without end": lambda line: drip(line, b"", b"HTTP/1.1 100 Continue\r\n\r\n"),
    "silence": lambda line: time.sleep(3),
}


@contextlib.contextmanager
def answering(answer: bytes | Callable[[socket.socket], None]) -> Iterator[str]:
    """Address of a server that sends this, or does this, whatever it is asked."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    line, _ = server.accept()
                except OSError:
                    return
                threading.Thread(target=reply, args=(line,), daemon=True).start()

        def reply(line: socket.socket) -> None:
            with line:
                try:
                    if isinstance(answer, bytes):
                        line.recv(65536)
                        line.sendall(answer)
                    else:
                        answer(line)
                    # what is left unread at the end would reset the line, and the answer with it
                    line.shutdown(socket.SHUT_WR)
                    while line.recv(65536):
                        pass
                except OSError:
                    return

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


@pytest.fixture
def wrong(request: pytest.FixtureRequest) -> Iterator[str]:
    """Address of a server that misbehaves."""
    with answering(MISBEHAVIOURS[request.param]) as address:
        yield address


@pytest.mark.parametrize("wrong", MISBEHAVIOURS, indirect=True)
def test_what_is_no_service_is_told_in_time(wrong):
    with jshell.Client(wrong, timeout=0.15, patience=0.1) as client:
        begun = time.monotonic()
        with pytest.raises(JshellError) as found:
            client.job("0" * 24)
        assert isinstance(found.value, Unreachable)
        assert time.monotonic() - begun < 2
        begun = time.monotonic()
        assert not client.healthy()
        assert time.monotonic() - begun < 2


@pytest.mark.parametrize("wrong", ["a slow body", "a slow header", "continue without end"], indirect=True)
def test_what_is_sent_has_the_time_of_its_own_bytes_and_no_more(wrong):
    with jshell.Client(wrong, timeout=0.1, patience=0) as client:
        begun = time.monotonic()
        with pytest.raises(Unreachable):
            client.simulate(R.conditions)
        assert time.monotonic() - begun < 1  # a few hundred bytes had been granted two minutes


@pytest.mark.long
def test_a_large_body_on_a_slow_line_is_waited_for(monkeypatch, tmp_path):
    def slow(line: socket.socket) -> None:
        head = line.recv(4096)
        left = int(re.search(rb"Content-Length: (\d+)", head)[1]) - len(head.partition(b"\r\n\r\n")[2])
        for _ in range(6):
            time.sleep(0.05)
            left -= len(line.recv(2**16))
        while left:
            left -= len(line.recv(2**20))
        answer = {"id": "0" * 32, "name": "long.csv", "sha256": "", "size": 2**20, "created": 0.0}
        line.sendall(whole(OK, json.dumps(answer).encode()))

    path = tmp_path / "long.csv"
    path.write_bytes(bytes(2**20))
    with answering(slow) as address, jshell.Client(address, timeout=0.15, patience=0) as client:
        monkeypatch.setattr(asking, "RATE", 2.0**19)
        assert client.upload(path) == "0" * 32
        monkeypatch.setattr(asking, "RATE", 2.0**40)
        with pytest.raises(Unreachable):
            client.upload(path)


def test_a_date_to_come_back_is_understood():
    assert _seconds("3") == 3.0
    assert _seconds("Fri, 31 Dec 2100 23:59:59 GMT") > 1e6
    assert _seconds("soon") == _seconds("") == 0.0
    assert _seconds("9" * 5000) == float("inf")
    for year in ("9" * 20, "0001", "0"):
        assert _seconds(f"Wed, 21 Oct {year} 07:28:00 -0000") <= 0.0


@pytest.mark.parametrize("answer", [b"[" * 20_000, b"1" * 5000, b"[]", b"{}", b"null", b'{"jobs": [], "next": 5}'])
def test_what_is_no_result_is_told_with_its_address(answer):
    with answering(whole(OK, answer)) as address, jshell.Client(address, timeout=5, patience=0) as client:
        for kind in ("fit", "batch", "simulate", "modes", "invert"):
            with pytest.raises(Unreachable, match=f"^{address}/api/v1/.*{'0' * 24}"):
                client.result("0" * 24, kind)
        for ask in (lambda: next(client.jobs()), lambda: client.upload(RECORDING), lambda: client.profile("0" * 24)):
            with pytest.raises(Unreachable, match=f"^{address}/api/v1/"):
                ask()


def test_a_list_of_jobs_that_names_itself_as_the_next_page_ends():
    times = dict.fromkeys(("created", "started", "finished"), 1.0)
    job = {"id": "0" * 24, "kind": "fit", "state": "done", "progress": 1, "specification": {}, "error": None}
    job |= times | {"attempt": 1, "traces": [], "links": {}}
    listed = json.dumps({"jobs": [job], "next": "/fits/api/v1/fits?limit=200&before=1"}).encode()
    with answering(whole(OK, listed)) as address, jshell.Client(address, timeout=5, patience=0) as client:
        jobs = client.jobs()
        assert next(jobs).id == "0" * 24
        with pytest.raises(Unreachable, match="seen before"):
            next(jobs)


@pytest.mark.long
def test_who_waits_for_a_job_waits_through_a_restart(tmp_path):
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with jshell.Client(f"http://127.0.0.1:{port}", patience=0.2) as client:
        with listening(settings, port):
            job = client.submit(RECORDING)
            assert client.healthy()
        assert not client.healthy()
        with pytest.raises(Unreachable, match="jshell serve"):
            job.now()  # who does not wait is told at once
        over: list[str] = []
        waiter = threading.Thread(target=lambda: over.append(job.wait(30).state))
        waiter.start()
        time.sleep(0.5)
        with listening(settings, port) as (_, store):
            store.cancel(job.id)
            waiter.join(30)
        assert over == ["cancelled"]
        begun = time.monotonic()
        with pytest.raises(Unreachable):
            job.wait(0.5)
        assert time.monotonic() - begun < 3

"""A service with a token, asked by clients that behave while others do not. Run as a script; prints JSON.

The attackers are a process of their own, so that only the service is shared.
"""

import contextlib
import json
import os
import re
import select
import selectors
import socket
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np

RECORDING = Path(__file__).parents[3] / "data" / "examples" / "attached_R_HW.csv"
TOKEN = "a-long-random-token-of-the-group"
HEAD = b"POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/x-www-form-urlencoded\r\n"
STATIC = b"GET /static/uPlot.iife.min.js HTTP/1.1\r\nHost: localhost\r\n\r\n"
CLIENTS = 8
WATCH = 30.0  # [s] that the attackers stay


def asked(address: str, seconds: float) -> tuple[list[float], list[int]]:
    """Times of answers to clients with a token, and the statuses that were not as they should be."""
    times: list[float] = []
    wrong: list[int] = []

    def client(number: int) -> None:
        headers = {"Authorization": f"Bearer {TOKEN}"}
        until = time.monotonic() + seconds
        with httpx.Client(base_url=address, headers=headers, timeout=30, trust_env=False) as http:
            turn = 0
            while time.monotonic() < until:
                turn += 1
                begun = time.monotonic()
                try:
                    if turn % 4:
                        found = http.get("/api/v1/fits?limit=20").status_code
                    else:
                        content = f"# {number} {turn}\n".encode() + RECORDING.read_bytes()
                        found = http.post("/api/v1/traces", files={"file": ("a.csv", content)}).status_code
                except httpx.TransportError:
                    found = 0
                times.append(time.monotonic() - begun)
                if found not in (200, 201):
                    wrong.append(found)
                if turn % 10 == 0:
                    time.sleep(0.2)

    threads = [threading.Thread(target=client, args=(number,)) for number in range(CLIENTS)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    return times, wrong


def attacked(port: int) -> dict:
    """Half headers, silence, slow bodies, answers that nobody reads, wrong tokens: how long each was borne."""
    begun: dict[str, list[socket.socket]] = {
        "half headers": [_line(port, b"GET / HTTP/1.1\r\nHost: localhost\r\nX-1: ") for _ in range(200)],
        "silent": [_line(port, b"") for _ in range(600)],
        "slow bodies": [_line(port, HEAD + b"Content-Length: 4000\r\n\r\n") for _ in range(20)],
        "slow chunked bodies": [_line(port, HEAD + b"Transfer-Encoding: chunked\r\n\r\n") for _ in range(20)],
    }
    unread = {line.fileno(): line for line in (_line(port, STATIC * 20, 4096) for _ in range(100))}
    errors = select.poll()
    for line in unread:
        errors.register(line, 0)
    start = time.monotonic()
    with ThreadPoolExecutor(101) as pool:
        pending = [pool.submit(_guess, port) for _ in range(100)]
        many = pool.submit(_ampersands, port)
        gone: dict[str, list[float]] = {name: [] for name in (*begun, "unread")}
        watched = selectors.DefaultSelector()
        for name, lines in begun.items():
            for line in lines:
                watched.register(line, selectors.EVENT_READ, name)
        last = 0.0
        while (watched.get_map() or unread) and time.monotonic() - start < WATCH:
            for number, _ in errors.poll(0):
                gone["unread"].append(time.monotonic() - start)
                errors.unregister(number)
                unread.pop(number).close()
            for key, _ in watched.select(0.2):
                line: socket.socket = key.fileobj  # pyright: ignore[reportAssignmentType]
                with contextlib.suppress(OSError):
                    if line.recv(4096):
                        continue
                gone[key.data].append(time.monotonic() - start)
                watched.unregister(line)
                line.close()
            if time.monotonic() - last > 1:  # a byte a second, of headers and bodies
                last = time.monotonic()
                for key in list(watched.get_map().values()):
                    if key.data != "silent":
                        with contextlib.suppress(OSError):
                            key.fileobj.send(b"1\r\na\r\n" if "chunked" in key.data else b"a")  # pyright: ignore
    guesses = [one.result() for one in pending]
    statuses = {status: [s for s, _ in guesses].count(status) for status in {s for s, _ in guesses}}
    return {
        "gone": {name: [len(times), round(max(times, default=0.0), 1)] for name, times in gone.items()},
        "left": len(watched.get_map() or ()) + len(unread),
        "guesses": statuses,
        "longest guess": round(max(took for _, took in guesses), 2),
        "33 MB of &": many.result(),
    }


def _line(port: int, first: bytes, held: int = 0) -> socket.socket:
    """A line on which something is said; `held` bytes of the answer are all that this end takes unread."""
    line = socket.socket()
    line.settimeout(30)
    if held:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, held)
    line.connect(("127.0.0.1", port))
    line.sendall(first)
    line.setblocking(False)
    return line


def _guess(port: int) -> tuple[int, float]:
    begun = time.monotonic()
    with contextlib.suppress(OSError, IndexError), socket.create_connection(("127.0.0.1", port), 30) as line:
        line.sendall(HEAD + b"Content-Length: 11\r\nConnection: close\r\n\r\ntoken=wrong")
        return int(line.recv(4096).split()[1]), time.monotonic() - begun
    return 0, time.monotonic() - begun


def _ampersands(port: int) -> list[float]:
    begun = time.monotonic()
    kind = {"Content-Type": "application/x-www-form-urlencoded"}
    try:
        status = httpx.post(
            f"http://127.0.0.1:{port}/login", content=b"&" * 33_000_000, headers=kind, timeout=30, trust_env=False
        ).status_code
    except httpx.TransportError:
        status = 0
    return [status, round(time.monotonic() - begun, 2)]


def attack(seconds: float) -> dict:
    """Clients alone, then with attackers beside them."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        command = [
            sys.executable,
            "-m",
            "jshell",
            "serve",
            "--port",
            "0",
            "--cold",
            "--db",
            f"sqlite:///{folder}/jobs.db",
        ]
        with log.open("wb") as out:
            server = subprocess.Popen(command, stdout=out, stderr=out, env=os.environ | {"JSHELL_TOKEN": TOKEN})
        try:
            while (found := re.search(r"http://\S+", log.read_text())) is None or not _answers(found[0]):
                time.sleep(0.1)
            time.sleep(10)  # its worker process has started
            asked(found[0], 2)
            quiet, wrong_quiet = asked(found[0], seconds)
            port = urlsplit(found[0]).port
            others = subprocess.Popen([sys.executable, __file__, "attackers", str(port)], stdout=subprocess.PIPE)
            time.sleep(0.3)
            loud, wrong = asked(found[0], seconds)
            told, _ = others.communicate(timeout=120)
        finally:
            server.terminate()
            code = server.wait(60)
        lines = len(log.read_text().splitlines())
    p95 = lambda times: round(1000 * float(np.quantile(times, 0.95)), 1)  # noqa: E731
    return {
        "p95_quiet_ms": p95(quiet), "p95_attacked_ms": p95(loud),
        "longest_ms": [round(1000 * max(quiet)), round(1000 * max(loud))],
        "asked": [len(quiet), len(loud)], "wrong": [wrong_quiet, wrong], **json.loads(told), "code": code, "log": lines,
    }  # fmt: skip


def _answers(address: str) -> bool:
    try:
        return httpx.get(f"{address}/healthz", timeout=5, trust_env=False).status_code == 200
    except httpx.TransportError:
        return False


if __name__ == "__main__":
    what, value = sys.argv[1:]
    print(json.dumps(attacked(int(value)) if what == "attackers" else attack(float(value))))

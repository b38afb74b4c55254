"""Fifty-four names that files have, and thirty requests as no client writes them: never a fault of the service."""

import re
import socket
import unicodedata
from urllib.parse import quote, urlsplit

import pytest

pytestmark = pytest.mark.long

HEADER = "".join(f"# {key}\n" for key in ("d_hat: 0.22", "P0_hat: 0.9", "Pext_hat: 1.62", "eta_hat: 0.004"))
SMALL = (HEADER + "t,V,S\n" + "".join(f"{k},{3 + 0.01 * (k % 7)},12.5\n" for k in range(40))).encode()
NAMES = (
    "a.csv", "A.CSV", "été.csv", "e\u0301te\u0301.csv", "Messung Nr. 3 (µm).csv", "скорлупа.csv", "貝殻.csv", "🐚.csv",
    "שלום.csv", "a b.csv", " a.csv ", "a.csv.csv", "a.tar.csv", ".csv", "..csv", "...", "..", ".", "", "a", "a.",
    "../../etc/passwd", "..\\..\\windows\\win.ini", "/etc/shadow", "C:\\a.csv", "\\\\host\\share\\a.csv", "a/b/c.csv",
    "~/a.csv", "-rf.csv", "--help", "a;rm -rf.csv", "$(id).csv", "`id`.csv", "a|b.csv", "a&b.csv", "a'b.csv", 'a"b.csv',
    "a%00.csv", "a%2e%2e%2f.csv", "a\x00.csv", "a\nb.csv", "a\r\nX-Evil: 1.csv", "a\x1b[31m.csv", "a\u202evsc.exe",
    "a\u200b.csv", "a\ufeff.csv", "<b>a</b>.csv", "{{7*7}}.csv", "a?x=1#y.csv", "=cmd|' /C calc'!A0.csv", "CON.csv",
    "a" * 300 + ".csv", "a." + "b" * 300, "é" * 250 + ".csv",
)  # fmt: skip

HEAD = b"Host: 127.0.0.1\r\n"
JSON = HEAD + b"Content-Type: application/json\r\n"
FORM = HEAD + b"Content-Type: multipart/form-data; boundary=x\r\n"
FITS, TRACES = b"POST /api/v1/fits HTTP/1.1\r\n", b"POST /api/v1/traces HTTP/1.1\r\n"


def sized(start: bytes, body: bytes) -> bytes:
    return start + b"Content-Length: %d\r\nConnection: close\r\n\r\n" % len(body) + body


REQUESTS = {
    "no HTTP": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(40),
    "nothing but ends of lines": b"\r\n" * 2000,
    "no version": b"GET /\r\n\r\n",
    "version 9": b"GET / HTTP/9.9\r\n" + HEAD + b"\r\n",
    "no host": b"GET / HTTP/1.1\r\n\r\n",
    "two hosts": b"GET / HTTP/1.1\r\n" + HEAD + b"Host: evil.example\r\n\r\n",
    "another host": b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n",
    "a host with a path": b"GET / HTTP/1.1\r\nHost: 127.0.0.1/evil\r\n\r\n",
    "the address of another": b"GET http://evil.example/ HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a tunnel": b"CONNECT evil.example:443 HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a method of no one": b"BREW /pot HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a trace of the way": b"TRACE / HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "an upgrade": b"GET / HTTP/1.1\r\n" + HEAD + b"Connection: Upgrade, close\r\nUpgrade: websocket\r\n\r\n",
    "a folded header": b"GET / HTTP/1.1\r\n" + HEAD + b"X: a\r\n b\r\nConnection: close\r\n\r\n",
    "a blank before the colon": b"GET / HTTP/1.1\r\nHost : 127.0.0.1\r\n\r\n",
    "a zero in a header": b"GET / HTTP/1.1\r\n" + HEAD + b"X: a\x00b\r\n\r\n",
    "a path upwards": b"GET /static/../../../etc/passwd HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a path upwards, encoded": b"GET /static/%2e%2e/%2e%2e/x HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a zero in the path": b"GET /static/a%00.css HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "half a character in the path": b"GET /fits/%ff%fe HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a path without end": b"GET /" + b"a/" * 20000 + b" HTTP/1.1\r\n" + HEAD + b"\r\n",
    "a query of a thousand names": b"GET /api/v1/fits?" + b"&".join(b"a%d=1" % k for k in range(1000))
    + b" HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a limit of no number": b"GET /api/v1/fits?limit=9e99 HTTP/1.1\r\n" + HEAD + b"Connection: close\r\n\r\n",
    "a length below zero": FITS + JSON + b"Content-Length: -1\r\n\r\n{}",
    "a length of words": FITS + JSON + b"Content-Length: many\r\n\r\n{}",
    "two lengths": FITS + JSON + b"Content-Length: 2\r\nContent-Length: 3\r\n\r\n{}",
    "a length and pieces": FITS + JSON + b"Content-Length: 2\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n"
    b"2\r\n{}\r\n0\r\n\r\n",
    "a piece of no size": FITS + JSON + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n",
    "a form without parts": sized(TRACES + FORM, b""),
    "a part without an end": sized(TRACES + FORM, b'--x\r\nContent-Disposition: form-data; name="file"; filename="a'),
}  # fmt: skip


def test_there_are_as_many_as_are_told():
    assert (len(set(NAMES)), len(REQUESTS)) == (54, 30)


@pytest.mark.parametrize("end", [".csv", ""])
def test_a_file_of_any_name_is_kept_under_one_that_can_be_shown(http, end):
    """Half of the names are sent as they are, in a form; the others by the address of a batch."""
    for number, name in enumerate(NAMES):
        content = SMALL + f"# {number}\n".encode() * (number + 1)
        if end:
            sent = http.post("/api/v1/traces", files={"file": (name, content)})
        else:
            sent = http.post(f"/api/v1/batches/file/{quote(name, safe='')}", content=content)
        assert sent.status_code < 500, (name, sent.text)
        if sent.status_code not in (201, 202):
            assert sent.json()["remedy"], name
            continue
        kept = sent.json()["name"] if end else http.get(f"/api/v1/traces/{sent.json()['traces'][0]}").json()["name"]
        assert kept
        assert len(kept) <= 120
        assert not re.search(r"[/\\]", kept)
        assert not any(unicodedata.category(letter)[0] == "C" for letter in kept), kept
        if end:
            there = http.get(f"/api/v1/traces/{sent.json()['id']}/content")
            assert "\n" not in there.headers["content-disposition"]
            assert "x-evil" not in there.headers
    for path in ("/", "/api/v1/traces?limit=200", "/api/v1/batches?limit=200"):
        found = http.get(path)
        assert found.status_code == 200
        assert "<b>a</b>" not in found.text or "json" in found.headers["content-type"]


@pytest.mark.parametrize("what", REQUESTS)
def test_a_request_as_no_client_writes_it_is_refused_or_answered(http, quiet, what):
    with socket.create_connection(("127.0.0.1", urlsplit(quiet).port), 10) as line:
        line.settimeout(20)
        answer = b""
        try:
            line.sendall(REQUESTS[what])
            line.shutdown(socket.SHUT_WR)
            while piece := line.recv(65536):
                answer += piece
        except ConnectionError:
            pass  # closed in the middle of it
    assert not answer or re.match(rb"HTTP/1\.1 [2-4]\d\d ", answer), answer[:300]
    assert b"root:" not in answer
    assert b"Traceback" not in answer
    assert http.get("/healthz").status_code == 200

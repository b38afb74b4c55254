"""Who may ask, by what name, how much; and what leaves the house."""

import functools
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
import sqlalchemy as sa

from jshell.errors import BadValue
from jshell.service import safety, tables
from jshell.service.encoding import neutral, neutral_csv
from jshell.service.safety import attachment, check_open, clean_name
from jshell.service.settings import Settings

from .conftest import RECORDING, listening

TOKEN = "a-long-random-token-of-the-group"


def test_another_host_is_refused(http):
    for host in ("evil.example", "127.0.0.1.evil.example", "", "localhost:80:80", "127.0.0.1@evil.example"):
        answer = http.get("/healthz", headers={"Host": host})
        assert answer.status_code in (400, 421), host
    assert http.get("/healthz", headers={"Host": "localhost:1234"}).status_code == 200
    assert http.get("/api/v1/fits", headers={"Host": "evil.example"}).json()["code"] == "wrong_host"


def test_another_sites_page_can_change_nothing_and_read_nothing(http, quiet, recording):
    asked = {"traces": [recording], "seed": 301}
    strange = ("https://evil.example", "null", "http://[", "http://]", "//[", "", quiet.removeprefix("http://"))
    for headers in ({"Sec-Fetch-Site": "cross-site"}, *({"Origin": one} for one in strange)):
        answer = http.post("/api/v1/fits", json=asked, headers=headers)
        assert answer.status_code == 403, headers
        assert answer.json()["code"] == "cross_site"
    assert http.post("/api/v1/fits", json=asked, headers={"Origin": quiet}).status_code == 202
    asked_before = http.options(
        "/api/v1/fits", headers={"Origin": "https://evil.example", "Access-Control-Request-Method": "POST"}
    )
    read = http.get("/api/v1/fits", headers={"Origin": "https://evil.example"})
    for answer in (asked_before, read):
        assert not [name for name in answer.headers if name.startswith("access-control")]
    assert read.headers["cross-origin-resource-policy"] == "same-origin"


def test_a_header_that_nobody_foresaw_is_refused_with_one_record_in_the_log(http, monkeypatch, caplog):
    def fails(*_: object) -> None:
        raise ValueError("nobody thought of this header")

    for name in ("_cross_site", "HTTPConnection"):
        with monkeypatch.context() as broken:
            broken.setattr(safety, name, fails)
            caplog.clear()
            for path in ("/api/v1/fits", "/fits"):
                answer = http.post(path)
                assert answer.status_code == 500, path
                assert "an error of the service" in answer.text, path
                assert "nobody thought" not in answer.text
                assert answer.headers["x-content-type-options"] == "nosniff"
            faults = [one.getMessage() for one in caplog.records if one.levelname == "ERROR"]
            assert [one.split()[0] for one in faults] == ["error", "error"], caplog.text


def test_pages_carry_the_headers_that_hold_scripts_back(http):
    headers = http.get("/").headers
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"


def test_a_body_above_the_limit_is_refused_whether_it_says_so_or_not(http):
    large = bytes(2**20 + 1)
    told = http.post("/api/v1/traces", content=large, headers={"Content-Type": "application/octet-stream"})
    assert told.status_code == 413
    assert told.json()["code"] == "too_large"

    def pieces(first: bytes = b""):
        yield first
        for _ in range(40):
            yield bytes(65536)

    part = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n'
    chunked = http.post(
        "/api/v1/traces", content=pieces(part), headers={"Content-Type": "multipart/form-data; boundary=x"}
    )
    assert chunked.status_code == 413, chunked.text
    assert "of a form" not in chunked.json()["remedy"]  # it is one
    as_json = http.post("/api/v1/fits", content=pieces(), headers={"Content-Type": "application/json"})
    assert as_json.status_code == 413, as_json.text
    assert http.get("/healthz").status_code == 200


def test_what_is_no_form_stays_in_memory_and_has_a_limit_of_its_own(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(safety, "MAX_BODY_BYTES", 2**16)
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)
    with listening(settings) as (address, _), httpx.Client(base_url=address, timeout=30, trust_env=False) as http:
        there, octets = "/api/v1/batches/file/a.csv", {"Content-Type": "application/octet-stream"}
        told = http.post(there, content=bytes(2**16 + 1), headers=octets)
        assert (told.status_code, told.json()["code"]) == (413, "too_large")
        assert "files of a form" in told.json()["remedy"]
        untold = (bytes(2**14) for _ in range(5))
        chunked = http.post(there, content=untold, headers=octets)
        assert (chunked.status_code, chunked.json()["code"]) == (413, "too_large")
        in_a_form = http.post("/api/v1/batches", files={"files": ("a.csv", bytes(2**16 + 1))})
        assert in_a_form.status_code == 422, in_a_form.text  # read, and found to be no trace


def test_only_some_large_bodies_are_in_memory_at_the_same_time(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(safety, "LARGE", 1000)
    monkeypatch.setattr(safety, "MAX_LARGE_BODIES", 1)
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)
    with (
        listening(settings) as (address, _),
        socket.create_connection(("127.0.0.1", urlsplit(address).port), 10) as line,
        ThreadPoolExecutor(1) as pool,
    ):
        line.sendall(b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2000\r\n\r\n{")
        time.sleep(0.3)  # it is being read
        post = functools.partial(httpx.post, f"{address}/api/v1/fits", timeout=30, trust_env=False)
        large = pool.submit(post, content=bytes(2000))
        assert post(content=bytes(1000)).status_code == 422  # a small one does not wait, and is no JSON
        assert post(files={"file": bytes(2000)}).status_code == 422  # nor does a form
        time.sleep(0.3)
        assert not large.done()
        line.close()
        assert large.result(20).status_code == 422


def test_a_body_that_does_not_arrive_is_given_up(tmp_path: Path):
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False, arrival=0.3)
    with (
        listening(settings) as (address, _),
        socket.create_connection(("127.0.0.1", urlsplit(address).port), 10) as line,
    ):
        line.sendall(b"POST /api/v1/fits HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n")
        line.sendall(b"Content-Length: 100\r\n\r\n{")
        begun = time.monotonic()
        answer = line.recv(4096)
        assert b"408" in answer.split(b"\r\n")[0]
        assert time.monotonic() - begun < 5


def test_a_giant_header_is_refused_and_the_service_goes_on(http, quiet):
    with socket.create_connection(("127.0.0.1", urlsplit(quiet).port), 10) as line:
        line.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 200_000)
        answer = line.recv(4096)
    assert answer == b"" or b"400" in answer.split(b"\r\n")[0]
    assert http.get("/healthz").status_code == 200


def test_a_token_is_asked_for_everywhere_but_at_the_door(tmp_path: Path):
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False, token=TOKEN)
    with listening(settings) as (address, _), httpx.Client(base_url=address, timeout=30, trust_env=False) as http:
        assert http.get("/healthz").status_code == 200
        refused = http.get("/api/v1/fits")
        assert refused.status_code == 401
        assert refused.headers["www-authenticate"].startswith("Bearer")
        for path in ("/metrics", "/openapi.json", "/api/v1/traces"):
            assert http.get(path, headers={"Authorization": "Bearer wrong"}).status_code == 401, path
        assert http.get("/api/v1/fits", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200

        away = http.get("/simulate")
        assert away.status_code == 303
        assert away.headers["location"] == "/login?next=/simulate"
        assert http.post("/login", data={"token": "wrong"}).status_code == 401
        entered = http.post("/login", data={"token": TOKEN, "next": "https://evil.example/"})
        assert entered.headers["location"] == "/"
        cookie = entered.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert http.get("/").status_code == 200
        assert TOKEN not in http.get("/").text


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.2", "::"])
def test_an_open_address_needs_a_token_that_is_not_guessed(host):
    with pytest.raises(BadValue, match="JSHELL_TOKEN"):
        check_open(Settings(host=host))
    with pytest.raises(BadValue, match="at least 16"):
        check_open(Settings(host=host, token="short"))
    check_open(Settings(host=host, token=TOKEN))
    check_open(Settings())


def test_names_are_escaped_wherever_they_are_shown(http):
    name = "<img src=x onerror=alert(1)>&\"'.csv"
    sent = http.post("/api/v1/traces", files={"file": (name, RECORDING.read_bytes() + b"\n")})
    trace = sent.json()["id"]
    job = http.post("/api/v1/fits", json={"traces": [trace], "seed": 302}).json()["id"]
    for path in ("/", f"/fits/{job}", f"/fits/new?trace={trace}"):
        text = http.get(path).text
        assert "<img src=x" not in text, path
        assert "&lt;img" in text, path
    assert "<script>" not in http.get("/fits/new?trace=<script>alert(1)</script>").text
    assert "<b>" not in http.get("/problems/<b>x").text


def test_cells_that_a_spreadsheet_would_run_become_text():
    for cell in ("=1+1", "+1+cmd", "-2+3", "@SUM(A1)", "\t=1", " =1", "\r=1"):
        assert neutral(cell).startswith("'"), cell
    for cell in ("-1.5", "+2e-3", "alpha1", "3", "1e5", ""):
        assert neutral(cell) == cell
    assert neutral_csv(b'name,value\n"=cmd, x",-1.5\n') == b'name,value\n"\'=cmd, x",-1.5\n'


def test_names_of_downloads_stay_on_one_line():
    assert "\n" not in attachment(clean_name('a\r\nSet-Cookie: x="y".csv'))
    assert clean_name("..") == "trace"
    assert clean_name(None) == "trace"
    assert clean_name("dir/été \u2066x.csv") == "été x.csv"


def test_a_service_without_a_token_keeps_no_sessions(tmp_path):
    with listening(Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)) as (address, store):
        for _ in range(3):
            found = httpx.post(f"{address}/login", data={"token": ""}, trust_env=False)
            assert (found.status_code, "set-cookie" in found.headers) == (303, False)
        with store.database.reading() as connection:
            assert connection.execute(sa.select(sa.func.count()).select_from(tables.sessions)).scalar() == 0

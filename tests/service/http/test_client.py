"""The client where no service helps it: what it says then."""

import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import jshell
from jshell.cli.main import app
from jshell.errors import BadFile, BadValue, KeyConflict, NotFound
from jshell.service import client
from jshell.service.client import Unreachable

from .conftest import RECORDING


def test_without_the_extra_the_client_says_which_one(monkeypatch):
    monkeypatch.setitem(sys.modules, "httpx", None)
    with pytest.raises(jshell.errors.MissingExtra, match=r"jshell\[service\]"):
        jshell.Client()


def test_nobody_at_the_address():
    with pytest.raises(Unreachable, match="jshell serve"), jshell.Client("http://127.0.0.1:9", patience=0) as client:
        client.job("0" * 24)


def test_errors_are_the_librarys_own(quiet, tmp_path):
    with jshell.Client(quiet) as client:
        with pytest.raises(NotFound):
            client.job("0" * 24)
        empty = tmp_path / "empty.csv"
        empty.write_text("")
        with pytest.raises(BadFile, match="empty"):
            client.upload(empty)
        client.submit(RECORDING, key="one", seed=401)
        with pytest.raises(KeyConflict):
            client.submit(RECORDING, key="one", seed=402)
        with pytest.raises(BadValue, match="jobs are data"):
            client.submit(RECORDING, tie={"alpha2": lambda known: known["alpha1"]})
        job = client.submit(RECORDING, seed=403)
        assert job.wait(0.1).state == "queued"
        assert job.cancel().state == "cancelled"
        with pytest.raises(BadValue, match="cancelled"):
            job.result(1)
        assert job.id in [one.id for one in client.jobs(state="cancelled")]


@pytest.mark.parametrize("held", [2**25, 0])
def test_a_batch_goes_without_a_form_where_memory_may_hold_it(quiet, monkeypatch, held):
    monkeypatch.setattr(client, "MAX_BODY_BYTES", held)
    sent = []
    with jshell.Client(quiet) as service:
        once = service._http.send
        monkeypatch.setattr(service._http, "send", lambda asked: sent.append(asked.url.path) or once(asked))
        job = service.submit_batch(RECORDING, seed=405 + held, bounds={"tau": (0.0, np.inf)})
    assert sent == [f"/api/v1/batches/file/{RECORDING.name}" if held else "/api/v1/batches"]
    assert (job.kind, job.state) == ("batch", "queued")
    assert job.specification == {"seed": 405 + held, "bounds": {"tau": [0.0, None]}}


def test_a_lost_batch_is_sent_again_whole(quiet, monkeypatch, tmp_path):
    import httpx

    path = tmp_path / "once.csv"
    path.write_bytes(RECORDING.read_bytes() + b"\n\n")  # the latest upload, then

    with jshell.Client(quiet) as client:
        once, lost = client._http.send, []

        def send(request):
            if not lost:
                lost.append(b"".join(request.stream))  # read to its end, and then the line breaks
                raise httpx.ReadError("cut")
            return once(request)

        monkeypatch.setattr(client._http, "send", send)
        job = client.submit_batch(path)
        assert job.state == "queued"
        assert lost == [path.read_bytes()]
        kept = next(iter(client._send("GET", "/traces").json()["traces"]))
        assert client._send("GET", f"/traces/{kept['id']}/content").content == path.read_bytes()


def test_a_trace_of_this_process_is_the_one_that_arrives(quiet):
    trace = jshell.io.read_trace(RECORDING)
    with jshell.Client(quiet) as client:
        found = client._send("GET", f"/traces/{client.upload(trace)}").json()
    assert found["samples"] == trace.times.size
    assert found["scales"]["pressure"] == pytest.approx(trace.scales.pressure, rel=1e-14)


def test_jshell_submit_hands_in_and_tells_the_job(quiet):
    done = CliRunner().invoke(app, ["submit", str(RECORDING), "--url", quiet, "--seed", "404", "--no-wait"])
    assert done.exit_code == 0, done.output
    with jshell.Client(quiet) as client:
        job = next(iter(client.jobs()))
    assert job.id in done.stdout
    assert job.specification == {"seed": 404}
    nobody = CliRunner().invoke(app, ["submit", str(RECORDING), "--url", "http://127.0.0.1:9"])
    assert nobody.exit_code == 2
    assert "jshell serve" in nobody.output


def test_jshell_serve_refuses_an_open_address_without_a_token(monkeypatch):
    monkeypatch.delenv("JSHELL_TOKEN", raising=False)
    done = CliRunner().invoke(app, ["serve", "--host", "0.0.0.0"])
    assert done.exit_code == 2
    assert "JSHELL_TOKEN" in done.output

"""Inversions as jobs, on a stand-in for the simulator that needs no compilation."""

import csv
import io
import json
from collections.abc import Iterator
from urllib.parse import parse_qs

import httpx
import pytest

import jshell
from jshell.calibration import Prior
from jshell.errors import BadValue, Outcome
from jshell.service import sending, tasks
from jshell.service.schemas import InvertRequest
from jshell.service.settings import Settings
from jshell.service.store import Store

from ...inversion.conftest import make_recording, no_compilation  # noqa: F401  (fixtures)
from .conftest import listening

ASKED = {"unknown": ["youngs_modulus", "gas_pressure"], "nuisance": False, "exact": False}
FIELDS = {"asks": "on", "nuisance": "no", "role.youngs_modulus": "asked", "role.gas_pressure": "asked"}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[httpx.Client, Store]]:
    """A service whose jobs are done here, and its store."""
    db = f"sqlite:///{tmp_path_factory.mktemp('inversions') / 'jobs.db'}"
    with listening(Settings(db=db, warm=False)) as (address, store), httpx.Client(base_url=address, timeout=30) as http:
        yield http, store


def uploaded(http: httpx.Client, trace: jshell.Trace) -> str:
    sent = http.post("/api/v1/traces", files={"file": ("ring.json", bytes(sending.written(trace).content))})
    assert sent.status_code == 201, sent.text
    return sent.json()["id"]


def done(store: Store, id: str) -> None:
    """Do a job as a worker does."""
    job = store.job(id)
    held = store.lease("me", 15)
    assert held is not None
    made = tasks.run(job.kind, job.specification, store.files(job.traces))
    assert made.error is None, made
    assert made.fault is None, made
    assert store.finish(job.id, "me", held.attempt, made.files)


@pytest.mark.usefixtures("no_compilation")
def test_an_inversion_is_the_librarys_own(own, make_recording):  # noqa: F811
    http, store = own
    trace = make_recording()
    sent = http.post("/api/v1/inversions", json=ASKED | {"traces": [uploaded(http, trace)]})
    assert sent.status_code == 202, sent.text
    address = sent.headers["location"]
    assert http.get(address).json()["result"] is None
    assert "waiting" in http.get(f"/inversions/{sent.json()['id']}").text.lower()
    done(store, sent.json()["id"])

    trace = jshell.io.read_trace(sending.written(trace))  # as it was sent
    expected = jshell.invert(trace, unknown=tuple(ASKED["unknown"]), nuisance=False, exact=False)
    assert expected.outcome == Outcome.OK
    found = http.get(address).json()["result"]
    assert found == json.loads(http.get(f"{address}.json").text)
    assert found["intervals"] == json.loads(json.dumps({n: expected.interval(n) for n in expected.varied}))
    assert [row["value"] for row in found["estimates"]] == [one.value for one in expected.estimates]
    assert http.get(f"{address}.txt").text == expected.report()
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(http.get(f"{address}.csv").text))}
    assert float(rows["youngs_modulus"]["value"]) == expected["youngs_modulus"].value
    assert float(rows["youngs_modulus"]["high"]) == expected.interval("youngs_modulus")[1]
    assert rows["youngs_modulus"]["unit"] == "Pa"
    assert "d_hat" in rows
    with jshell.Client(str(http.base_url)) as client:
        assert client.result(sent.json()["id"], "invert") == found

    page = http.get(f"/inversions/{sent.json()['id']}").text
    assert f'data-value="{expected["gas_pressure"].value}"' in page
    assert "H [mm]" in page
    drawn = http.get(f"/inversions/{sent.json()['id']}/inversion.svg")
    assert drawn.headers["content-type"].startswith("image/svg+xml")
    assert "ok: youngs_modulus, gas_pressure" in http.get("/").text


@pytest.mark.usefixtures("no_compilation")
def test_what_is_left_open_is_said_on_the_page(own, make_recording):  # noqa: F811
    http, store = own
    trace = uploaded(http, make_recording(channels=("H",), size=(1, 0, 0)))
    unknown = ["gas_pressure", "outer_pressure", "youngs_modulus"]
    asked = ASKED | {"unknown": unknown, "free_rest": True, "traces": [trace]}
    id = http.post("/api/v1/inversions", json=asked).json()["id"]
    done(store, id)
    found = http.get(f"/api/v1/inversions/{id}").json()["result"]
    assert found["outcome"] == "rank_deficient"
    page = http.get(f"/inversions/{id}").text
    assert "undetermined" in page
    assert "would separate them" in page


@pytest.mark.usefixtures("no_compilation")
def test_an_echo_is_asked_about_and_drawn_in_a_laboratorys_units(own, make_recording):  # noqa: F811
    http, store = own
    trace = uploaded(http, make_recording(channels=("p_scattered",)))
    sent = http.post("/inversions", data=FIELDS | {"trace": trace, "role.gas_pressure": "free"})
    assert sent.status_code == 303, sent.text
    address = sent.headers["location"]
    done(store, address.rpartition("/")[2])
    page = http.get(address).text
    assert "p_s [kPa]" in page
    assert "t [s]" in page


def test_the_form_asks_what_the_api_asks(own, make_recording):  # noqa: F811
    http, store = own
    trace = uploaded(http, make_recording())
    form = http.get(f"/inversions/new?trace={trace}")
    assert form.status_code == 200
    assert "500000" in form.text  # the modulus that the file says
    fields = FIELDS | {
        "trace": trace, "channel": ["H", "W"], "value.thickness": "0,003", "error.thickness": "6e-5",
        "role.thickness": "asked", "low.gas_pressure": "1e4", "role.density": "known", "value.density": "1150",
        "start": "0.01", "free_rest": "on",
    }  # fmt: skip
    sent = http.post("/inversions", data=fields)
    assert sent.status_code == 303, sent.text
    job = store.job(sent.headers["location"].rpartition("/")[2])
    assert job.specification == {
        "unknown": ["youngs_modulus", "gas_pressure", "thickness"], "known": {"density": 1150.0},
        "bounds": {"gas_pressure": [1e4, None]}, "priors": {"thickness": {"mean": 0.003, "sigma": 6e-5}},
        "channels": ["H", "W"], "start": 0.01, "free_rest": True, "nuisance": False, "exact": False,
    }  # fmt: skip
    store.cancel(job.id)
    again = http.get(f"/inversions/{job.id}").text.split('href="/inversions/new?')[-1].partition('"')[0]
    again = again.replace("&amp;", "&")
    assert 'value="0.003"' in http.get(f"/inversions/new?{again}").text
    sent = http.post("/inversions", data=parse_qs(again))
    assert store.job(sent.headers["location"].rpartition("/")[2]).specification == job.specification


def test_a_record_through_the_snap_is_simulated_whole(own, make_recording, monkeypatch):  # noqa: F811
    http, store = own
    seen: dict = {}
    monkeypatch.setattr("jshell.service.inversions.invert_traces", lambda *given, **options: seen.update(options))
    trace = uploaded(http, make_recording())
    sent = http.post("/inversions", data=FIELDS | {"trace": trace, "level": "trace", "ramp": "0.05", "exact": "on"})
    job = store.job(sent.headers["location"].rpartition("/")[2])
    asked = {"unknown": ASKED["unknown"], "nuisance": False, "level": "trace", "ramp": 0.05}
    assert job.specification == asked
    assert tasks.run(job.kind, job.specification, store.files(job.traces)).fault  # the stand-in's answer is none
    assert seen["level"] == jshell.inversion.Snap(ramp=0.05)
    store.cancel(job.id)
    again = http.get(f"/inversions/{job.id}").text.split('href="/inversions/new?')[-1].partition('"')[0]
    assert "level=trace" in again
    assert "ramp=0.05" in again


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"role.youngs_modulus": "free", "role.gas_pressure": "free"}, "Choose `asked`"),
        ({"role.thickness": "known"}, "value.thickness"),
        ({"value.gas_pressure": "1e5"}, "error.gas_pressure"),
        ({"low.gas_pressure": "2e5", "high.gas_pressure": "1e5"}, "the lowest value must be below"),
        ({"start": "soon"}, "field start"),
    ],
)
def test_a_question_that_cannot_be_is_refused_with_its_fields_kept(own, make_recording, fields, words):  # noqa: F811
    http, _ = own
    sent = http.post("/inversions", data=FIELDS | fields | {"trace": uploaded(http, make_recording()), "stop": "77.5"})
    assert sent.status_code == 422
    assert words in sent.text
    assert 'value="77.5"' in sent.text


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"unknown": []}, "nothing is asked"),
        ({"known": {"gas_pressure": 1e5}}, "cannot be known and asked"),
        ({"local": ["radius"]}, "radius can only be local"),
        ({"unknown": ["E"]}, "youngs_modulus"),
        ({"bounds": {"thickness": [2, 1]}}, "the lowest value"),
        ({"channels": ["Q"]}, "x_front"),
        ({"elements": 400}, "elements"),
    ],
)
def test_the_api_refuses_what_no_recording_could_answer(own, make_recording, wrong, words):  # noqa: F811
    http, _ = own
    sent = http.post("/api/v1/inversions", json=ASKED | {"traces": [uploaded(http, make_recording())]} | wrong)
    assert sent.status_code == 422
    assert words in sent.text


def test_the_client_sends_what_python_says():
    said = {
        "youngs_modulus": None, "gas_pressure": (1e4, 1e5), "thickness": Prior(0.003, 6e-5),
        "outer_pressure": jshell.inversion.Unknown(local=True),
    }  # fmt: skip
    words = sending.question(said, {"density": 1150}, {"exact": False})
    asked = InvertRequest(**words, traces=["0123456789abcdef"])
    assert asked.unknown == list(said)
    assert asked.bounds == {"gas_pressure": (1e4, 1e5)}
    assert asked.priors["thickness"].sigma == 6e-5
    assert asked.local == ["outer_pressure"]
    assert (asked.known, asked.exact) == ({"density": 1150.0}, False)
    assert sending.question("youngs_modulus", None, {})["unknown"] == ["youngs_modulus"]
    with pytest.raises(BadValue, match="Unknown"):
        sending.question({"thickness": "thin"}, None, {})

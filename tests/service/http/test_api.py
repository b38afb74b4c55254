"""The API: what it takes, what it answers, and what it says when it refuses."""

import io
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import quote

import httpx
import numpy as np
import pytest

import jshell
from jshell.calibration import recordings_file
from jshell.calibration.recordings import Recordings
from jshell.oscillator import SOURCE, fitted_decay_time, frequencies
from jshell.service.settings import Settings

from .conftest import RECORDING, listening

GOOD = b"# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.62\n# eta_hat: 0.004\nt,V\n0,3.0\n1,2.9\n2,3.1\n"
BARE = b"t,V\n0,3.0\n1,2.9\n2,3.1\n"


def uploaded(http: httpx.Client, content: bytes, name: str = "trace.csv", **data: str) -> httpx.Response:
    return http.post("/api/v1/traces", files={"file": (name, content)}, data=data)


def refused(response: httpx.Response, status: int, code: str) -> dict:
    """The problem in an answer, whole and of the right kind."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    found = response.json()
    assert found["code"] == code, found
    assert found["status"] == status
    assert all(found[name] for name in ("type", "title", "detail", "instance", "place", "cause", "remedy"))
    return found


def test_an_upload_tells_channels_units_and_conditions(http, recording):
    found = http.get(f"/api/v1/traces/{recording}").json()
    assert found["channels"] == ["H", "W"]
    assert found["units"] == {"t": "ms", "H": "mm", "W": "mm"}
    assert found["conditions"]["Pext_hat"] == pytest.approx(1.62)
    assert found["scales"]["length"] == 0.0225
    assert found["loss"] == "modal"
    assert http.get(f"/api/v1/traces/{recording}/content").content == RECORDING.read_bytes()
    assert any(row["id"] == recording for row in http.get("/api/v1/traces").json()["traces"])


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (b"", "bad_file", "empty"),
        (b"t,V\n0,3.0\n", "bad_file", "single row"),
        (GOOD.replace(b"2.9", b"nan"), "bad_value", "row 7, column `V`"),
        (GOOD.replace(b"t,V", b"t [furlong],V [mm^3]"), "bad_units", "furlong"),
        (BARE.replace(b"t,V", b"t,V [mm^3]"), "bad_units", "no unit"),
        (GOOD.replace(b"0.22", b"-1"), "bad_value", "d_hat"),
        (GOOD.replace(b"t,V", b"x,V"), "bad_name", "`t`"),
        (GOOD.replace(b"3.0", b"three"), "bad_file", "three"),
        (b"\x89HDF\r\n\x1a\n" + bytes(200), "bad_file", ""),
        (b"# " + b"x" * 300_000 + b"\n" + BARE, "bad_file", "200000"),
    ],
    ids=["empty", "one row", "NaN", "unit", "units alone", "no shell", "no t", "words", "binary", "long header"],
)  # fmt: skip
def test_a_bad_file_is_refused_with_its_place_and_a_remedy(http, content, code, words):
    found = refused(uploaded(http, content, "weird name.csv"), 422, code)
    assert words in found["detail"]
    assert "/tmp" not in found["detail"]


def test_a_file_without_conditions_takes_them_from_the_request(http):
    assert uploaded(http, BARE).json()["conditions"] is None
    given = uploaded(http, BARE, conditions='{"d_hat": 0.1, "P0_hat": 1, "Pext_hat": 1.3}')
    assert given.json()["conditions"]["d_hat"] == 0.1
    body = http.get(f"/api/v1/traces/{given.json()['id']}/content").content
    assert body.endswith(BARE)  # the numbers stand as they stood
    refused(uploaded(http, BARE, conditions='{"d_hat": 0.1}'), 422, "bad_file")
    refused(uploaded(http, GOOD, conditions='{"d_hat": 0.1, "P0_hat": 1, "Pext_hat": 1.3}'), 422, "bad_value")
    refused(uploaded(http, BARE, conditions='{"d_hat": NaN}'), 422, "bad_value")


TRACKED = b"frame,Height,note\n" + b"".join(b"%d,%d,ok\n" % (k, 30 + k) for k in range(20))


def test_what_a_file_leaves_open_is_said_with_it(http):
    refused(uploaded(http, TRACKED), 422, "bad_name")
    said = '{"rate": 1000, "columns": {"H": "Height"}, "units": {"H": "mm"}}'
    found = uploaded(http, TRACKED, reading=said).json()
    assert (found["channels"], found["samples"], found["units"]) == (["H"], 20, {"t": "s", "H": "m"})
    assert found["duration"] == pytest.approx(0.019)
    assert uploaded(http, TRACKED, reading=said).json()["id"] == found["id"]
    for wrong, code in (
        ('{"rate": -1}', "bad_value"),
        ('{"rat": 1}', "bad_name"),
        ("[", "bad_value"),
        ("[1]", "bad_value"),
    ):
        refused(uploaded(http, TRACKED, reading=wrong), 422, code)


def test_the_page_asks_for_what_a_file_leaves_open(http):
    asked = http.post("/traces", files={"file": ("film.csv", TRACKED)})
    assert asked.status_code == 422
    for words in ("What film.csv leaves open", "Height", "30, 31, 32", "--rate 1000"):
        assert words in asked.text
    trace = asked.text.partition('name="trace" value="')[2].partition('"')[0]
    fields = {"trace": trace, "role.2": "H", "unit.2": "mm", "rate": "fast"}
    assert http.post("/traces/settle", data=fields).status_code == 422
    done = http.post("/traces/settle", data=fields | {"rate": "1000"}, follow_redirects=False)
    assert done.status_code == 303
    assert done.headers["location"].startswith("/traces/conditions?trace=")


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "C:\\x\\<script>alert(1)</script>.csv",
        "\u202evsc.exe.csv",
        "=1+1.csv",
        "",
        "n" * 400 + ".csv",
    ],
)
def test_a_strange_name_loses_what_could_harm(http, name):
    content = GOOD + f"3,3.0\n4,{2 + len(name) / 1000}\n".encode()
    kept = uploaded(http, content, name or "x.csv").json()["name"]
    assert "/" not in kept
    assert "\\" not in kept
    assert kept.isprintable()
    assert 0 < len(kept) <= 120


def test_fifty_submits_with_one_key_are_one_job_and_another_body_conflicts(http, recording):
    asked = {"traces": [recording], "seed": 101}

    def submit(_: int) -> tuple[int, str]:
        response = http.post("/api/v1/fits", json=asked, headers={"Idempotency-Key": "fifty"})
        return response.status_code, response.json()["id"]

    with ThreadPoolExecutor(50) as pool:
        answers = list(pool.map(submit, range(50)))
    assert sorted({status for status, _ in answers}) == [200, 202]
    assert [status for status, _ in answers].count(202) == 1
    assert len({job for _, job in answers}) == 1
    other = http.post("/api/v1/fits", json=asked | {"seed": 102}, headers={"Idempotency-Key": "fifty"})
    refused(other, 409, "key_conflict")


def test_the_same_content_is_the_same_job_without_a_key(http, recording):
    first = http.post("/api/v1/fits", json={"traces": [recording], "seed": 7})
    assert first.status_code == 202
    assert first.headers["location"] == f"/api/v1/fits/{first.json()['id']}"
    again = http.post("/api/v1/fits", json={"traces": [recording], "seed": 7, "loss": None, "fix": {}})
    assert again.status_code == 200
    assert again.json()["id"] == first.json()["id"]


def test_delete_cancels_and_stays_cancelled(http, recording):
    job = http.post("/api/v1/fits", json={"traces": [recording], "seed": 8}).json()["id"]
    refused(http.get(f"/api/v1/fits/{job}.csv"), 409, "not_ready")
    assert http.delete(f"/api/v1/fits/{job}").json()["state"] == "cancelled"
    assert http.delete(f"/api/v1/fits/{job}").json()["state"] == "cancelled"
    assert http.get(f"/api/v1/fits/{job}").json()["state"] == "cancelled"
    assert job in [row["id"] for row in http.get("/api/v1/fits?state=cancelled").json()["jobs"]]
    refused(http.delete("/api/v1/fits/0123456789abcdef"), 404, "not_found")


def test_a_job_is_found_under_its_own_noun_only(http, recording):
    job = http.post("/api/v1/fits", json={"traces": [recording], "seed": 9}).json()["id"]
    refused(http.get(f"/api/v1/batches/{job}"), 404, "not_found")


@pytest.mark.parametrize(
    ("asked", "place"),
    [
        ({"traces": []}, "traces"),
        ({"fix": {"alpha9": 1.0}}, "alpha9"),
        ({"bounds": {"alpha1": [2.0, 1.0]}}, "bounds"),
        ({"fix": {"alpha1": "1"}}, "fix"),
        ({"starts": 10_000}, "starts"),
        ({"code": "print(1)"}, "code"),
    ],
)
def test_what_the_schema_does_not_know_is_refused_with_its_place(http, recording, asked, place):
    found = http.post("/api/v1/fits", json={"traces": [recording]} | asked)
    assert found.status_code == 422
    assert place in found.json()["place"]


def test_json_that_is_none_is_a_problem_too(http):
    answer = http.post("/api/v1/fits", content=b'{"traces": [', headers={"Content-Type": "application/json"})
    refused(answer, 400, "bad_request")


def test_an_unknown_trace_is_not_found(http):
    refused(http.post("/api/v1/fits", json={"traces": ["0" * 32]}), 404, "not_found")


def test_a_full_queue_says_when_to_come_back(tmp_path: Path):
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False, queue=2)
    with listening(settings) as (address, _), httpx.Client(base_url=address, timeout=30, trust_env=False) as http:
        trace = uploaded(http, RECORDING.read_bytes()).json()["id"]
        statuses = [http.post("/api/v1/fits", json={"traces": [trace], "seed": n}).status_code for n in range(3)]
        assert statuses == [202, 202, 429]
        full = http.post("/api/v1/fits", json={"traces": [trace], "seed": 9})
        refused(full, 429, "queue_full")
        assert int(full.headers["retry-after"]) > 0


def test_a_wrong_method_names_the_right_ones(http):
    answer = http.put("/api/v1/fits")
    refused(answer, 405, "wrong_method")
    assert answer.headers["allow"] == "GET, POST"


def test_pages_of_a_list_hold_every_row_once(http, recording):
    made = {http.post("/api/v1/fits", json={"traces": [recording], "seed": 200 + n}).json()["id"] for n in range(5)}
    seen, address = [], "/api/v1/fits?limit=2"
    while address:
        page = http.get(address).json()
        seen += [row["id"] for row in page["jobs"]]
        address = page["next"]
    assert made <= set(seen)
    assert len(seen) == len(set(seen))


def packed_batch() -> bytes:
    times = np.arange(40.0)
    values = np.stack([np.stack([3 + 0.1 * np.cos(times), 12 + 0.1 * np.sin(times)])] * 3)
    conditions = jshell.Reduced(
        np.full(3, 0.1), np.ones(3), np.full(3, 1.4), np.full(3, 0.01), np.full(3, 1.4), np.full(3, 0.5)
    )
    return recordings_file.encode(Recordings(times, values, conditions))


def test_a_batch_is_checked_at_the_door(http):
    packed = packed_batch()
    sent = http.post("/api/v1/batches", files={"files": ("many.npz", packed)}, data={"options": '{"starts": 2}'})
    assert sent.status_code == 202, sent.text
    assert sent.json()["specification"] == {"starts": 2}
    damaged = http.post("/api/v1/batches", files={"files": ("many.npz", packed[: len(packed) // 2] + b"x")})
    assert damaged.status_code in (202, 422)  # read as a single trace, it fails as a job
    refused(http.post("/api/v1/batches", files={"files": ("many.zip", b"no zip")}), 422, "bad_file")
    bad = http.post("/api/v1/batches", files={"files": ("many.npz", packed)}, data={"options": '{"nothing": 1}'})
    assert "nothing" in refused(bad, 422, "bad_value")["place"]


def test_a_batch_without_a_form_is_the_same_job_and_checked_alike(http):
    packed, octets = packed_batch(), {"Content-Type": "application/octet-stream"}

    def bare(name: str, content: bytes, options: str = "{}") -> httpx.Response:
        there = f"/api/v1/batches/file/{quote(name, safe='')}"
        return http.post(there, params={"options": options}, content=content, headers=octets)

    in_a_form = http.post("/api/v1/batches", files={"files": ("many.npz", packed)}, data={"options": '{"seed": 9}'})
    sent = bare("other.npz", packed, '{"seed": 9}')
    assert (in_a_form.status_code, sent.status_code) == (202, 200)  # the same content and options
    assert sent.json()["id"] == in_a_form.json()["id"]
    assert sent.headers["location"] == f"/api/v1/batches/{sent.json()['id']}"
    trace = http.get("/api/v1/traces").json()["traces"][0]
    assert http.get(f"/api/v1/traces/{trace['id']}/content").content == packed
    refused(bare("many.zip", b"no zip"), 422, "bad_file")
    refused(bare("a.csv", b"-184841"), 422, "bad_name")
    assert "nothing" in refused(bare("many.npz", packed, '{"nothing": 1}'), 422, "bad_value")["place"]
    assert "empty" in refused(bare("many.npz", b""), 422, "bad_file")["cause"]
    assert bare("<i>strange</i> ü.npz".replace("/", ""), packed, '{"seed": 10}').status_code == 202
    refused(http.get("/api/v1/batches/file/many.npz"), 405, "wrong_method")


def test_a_batch_of_which_no_file_can_be_read_is_refused_at_once(http):
    none = [("files", ("a.csv", b"-184841")), ("files", ("b.csv", b"{}"))]
    assert "a.csv" in refused(http.post("/api/v1/batches", files=none), 422, "bad_name")["place"]
    one = [("files", ("a.csv", b"-184841")), ("files", ("b.csv", GOOD))]
    assert http.post("/api/v1/batches", files=one).status_code == 202


def test_a_field_that_stands_twice_is_refused(http):
    twice = http.post("/api/v1/batches", files={"files": ("a.csv", GOOD)}, data={"options": ["", '{"starts": 1}']})
    refused(twice, 422, "bad_value")


def test_a_batch_may_be_a_zip_of_traces(http):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.csv", GOOD)
    assert http.post("/api/v1/batches", files={"files": ("many.zip", file.getvalue())}).status_code == 202


def test_the_short_model_answers_at_once_with_the_librarys_numbers(http):
    asked = {"d_hat": 0.08, "P0_hat": 0.9, "Pext_hat": 1.2, "eta_hat": 0.01}
    found = http.post("/api/v1/simulate", json=asked).json()
    wanted = frequencies(jshell.Reduced(0.08, 0.9, 1.2), SOURCE)
    # the same formulas, compiled together: rounding only
    assert found["omega_minus"] == pytest.approx(float(wanted.omega_minus), rel=1e-12)
    assert found["omega_plus"] == pytest.approx(float(wanted.omega_plus), rel=1e-12)
    assert found["outcome"] == "ok"
    assert found["tau"] == pytest.approx(float(fitted_decay_time(jshell.Reduced(0.08, 0.9, 1.2, 0.01))), rel=1e-12)
    assert found["tau"] == pytest.approx(3.6 / (2 * found["coefficients"]["beta1"] * 0.01), rel=1e-12)
    assert found["decay"]["origin"] == "law"
    given = http.post("/api/v1/simulate", json=asked | {"beta1": float(SOURCE.beta1)}).json()
    assert given["tau"] == pytest.approx(3.6 / (2 * float(SOURCE.beta1) * 0.01), rel=1e-12)
    assert given["decay"]["origin"] == "given beta1"
    assert given["decay"]["error"] is None
    assert found["trace"]["V"][0] == pytest.approx(1.01 * found["volume"], rel=1e-12)
    sphere = http.post("/api/v1/simulate", json=asked | {"Pext_hat": 0.5}).json()
    assert sphere["outcome"] == "no_buckled_state"
    assert sphere["omega_minus"] is None
    assert sphere["tau"] is None
    assert sphere["coefficients"]["beta1"] is None


def test_the_short_model_rings_r_as_long_as_the_simulator_does(http):
    found = http.post("/api/v1/simulate", json={}).json()
    assert found["tau"] == pytest.approx(7.180, rel=0.1)  # the simulator's slow mode in the exact liquid
    swing = np.abs(np.array(found["trace"]["V"]) / found["volume"] - 1)
    late = np.array(found["trace"]["t"]) > 30
    assert swing[late].max() < 0.03 * swing.max()  # e^(-30/7.2) = 1.6 %; with the source's β1 70 %
    far = http.post("/api/v1/simulate", json={"d_hat": 0.35, "Pext_hat": 2.2}).json()
    assert far["tau"] > 0
    assert far["decay"]["outside"] == ["d_hat = 0.35 (0.02 to 0.3)"]


def test_the_simulator_runs_as_a_job(http):
    sent = http.post("/api/v1/simulate", json={"model": "simulator", "duration": 1.0})
    assert sent.status_code == 202
    assert sent.headers["location"] == f"/api/v1/simulations/{sent.json()['id']}"
    assert http.get(sent.headers["location"]).json()["specification"]["conditions"]["d_hat"] == 0.22


def test_modes_are_a_job(http):
    asked = {"elements": 16, "liquid": "ideal"}
    sent = http.post("/api/v1/modes", json=asked)
    assert sent.status_code == 202
    found = http.get(sent.headers["location"]).json()
    assert found["specification"] | asked == found["specification"]
    assert found["specification"]["conditions"]["d_hat"] == 0.22
    assert found["result"] is None
    assert "waiting" in http.get(f"/modes/{found['id']}").text.lower()
    assert http.post("/api/v1/modes", json=asked).json()["id"] == found["id"]
    assert found["specification"].keys().isdisjoint({"azimuth"})
    around = {"elements": 16, "azimuth": [2, 0, 2]}
    sent = http.post("/api/v1/modes", json=around)
    found = http.get(sent.headers["location"]).json()
    assert found["specification"] | {"azimuth": [0, 2], "liquid": None} == found["specification"]
    assert "second for m" in http.get(f"/modes/{found['id']}").text
    refused(http.post("/api/v1/modes", json={"liquid": "water"}), 422, "bad_value")
    for wrong in ({"azimuth": [41]}, {"azimuth": [0.5]}, {"azimuth": []}, {"azimuth": [1], "liquid": "exact"},
                  {"azimuth": [1], "count": 6, "elements": 12}):  # fmt: skip
        refused(http.post("/api/v1/modes", json=wrong), 422, "bad_value")
    refused(http.get(f"{sent.headers['location']}.csv"), 409, "not_ready")


def test_health_says_where_to_look(tmp_path, monkeypatch):
    with listening(Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)) as (address, store):
        monkeypatch.setattr(store, "healthy", lambda: False)
        for in_file, words in ((True, "disk is full or read-only"), (False, "PostgreSQL runs")):
            monkeypatch.setattr(store.database, "sqlite", in_file)
            found = refused(httpx.get(f"{address}/healthz", trust_env=False), 503, "store_unavailable")
            assert words in found["remedy"]
        monkeypatch.undo()


def test_metrics_and_health(http):
    assert http.get("/healthz").json() == {"status": "ok", "version": jshell.__version__}
    text = http.get("/metrics").text
    assert 'jshell_jobs{state="queued"}' in text
    assert 'jshell_requests_total{method="GET",status="200"}' in text
    counted = [line for line in text.splitlines() if line.startswith("jshell_request_seconds_count")]
    assert float(counted[0].split()[1]) > 0
    told = set(re.findall(r"^# TYPE (\w+) (\w+)$", text, re.M))
    assert told == {
        ("jshell_info", "gauge"),
        ("jshell_jobs", "gauge"),
        ("jshell_requests_total", "counter"),
        ("jshell_request_seconds", "histogram"),
    }


def test_what_nobody_foresaw_has_an_identifier_and_no_traceback(tmp_path, monkeypatch, caplog):
    with listening(Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)) as (address, store):

        def spoiled() -> dict:
            raise RuntimeError("secret of the house")

        monkeypatch.setattr(store, "counts", spoiled)
        answer = httpx.get(f"{address}/metrics", timeout=30, trust_env=False)
    found = refused(answer, 500, "internal")
    assert "secret" not in answer.text
    assert "Traceback" not in answer.text
    identifier = found["found"].split(", ")[1]
    assert ["Traceback" in one.getMessage() for one in caplog.records if identifier in one.getMessage()] == [True]


def test_the_example_of_the_page_is_the_librarys(http):
    sent = http.post("/examples", follow_redirects=False)
    assert sent.status_code == 303
    trace = re.search(r"[0-9a-f]{32}", sent.headers["location"])[0]
    content = http.get(f"/api/v1/traces/{trace}/content").content
    assert content == jshell.io.example("attached_R_HW.csv").read_bytes()

"""Requests that nobody means well: each refused when it comes, in words, and none a fault of the service."""

import io
import json
import logging
import zipfile
from itertools import product
from pathlib import Path
from urllib.parse import unquote

import httpx
import numpy as np
import pytest
import xarray

from jshell.errors import StoreUnavailable
from jshell.io.records import write_groups
from jshell.service.log import plain
from jshell.service.settings import Settings
from jshell.service.store import Store

from .conftest import RECORDING, listening

JSON = {"Content-Type": "application/json"}
FITS = "/api/v1/fits"


def fit(trace: str, more: str) -> bytes:
    return f'{{"traces": ["{trace}"], {more}}}'.encode()


@pytest.mark.parametrize(
    "more",
    [
        '"seed": 1, "seed": 2',
        '"tie": {"alpha1": "1", "alpha1": "2"}',
        '"tie": {"alpha1": "\\ud800"}',
        '"\\udfff": 1',
        '"channels": ["\\ud83d"]',
        '"channels": ["\xed\xa0\x80"]',
        '"seed": ' + "[" * 9000,
    ],
)
def test_json_that_means_two_things_or_none_is_refused(http, recording, more):
    content = fit(recording, more)
    if "\xed" in more:
        content = content.replace("\xed\xa0\x80".encode(), b"\xed\xa0\x80")  # half a character, in bytes
    found = http.post(FITS, content=content, headers=JSON)
    assert (found.status_code, found.json()["code"]) == (400, "bad_request"), found.text
    assert "twice" in found.text or more.count("seed") < 2


@pytest.mark.parametrize(
    "tie",
    [
        "9**9**9**9", "1/0", "alpha2 + 1/0", "__import__('os')", "sqrt(-1)", "1e999", "alpha1.real", "gamma", "x" * 200,
        "(" * 199, "-" * 199, "alpha2 alpha2", "\x00", "alpha2[0]", "lambda: 1", "1 if alpha2 else 2", "log(0)",
    ],
)  # fmt: skip
def test_a_tie_that_cannot_be_is_refused_when_it_comes(http, recording, tie):
    found = http.post(FITS, json={"traces": [recording], "tie": {"alpha1": tie}})
    assert (found.status_code, found.json()["code"]) == (422, "bad_value"), found.text
    assert "tie" in found.json()["place"]


@pytest.mark.parametrize(
    "more",
    [
        {"fix": {"alpha1": 0}}, {"fix": {"alpha1": 1e-320}}, {"fix": {"alpha1": -1}}, {"tie": {"alpha1": "0"}},
        {"tie": {"alpha1": "-alpha2"}}, {"tie": {"alpha1": "alpha1"}},
        {"tie": {"alpha1": "alpha2", "alpha2": "alpha1"}},
        {"tie": {"alpha1": "alpha2[99999]"}}, {"tie": {"alpha1": "tau"}, "loss": "strict"}, {"fix": {"alpha1[5]": 1}},
        {"fix": {"alpha1": 1}, "tie": {"alpha1": "alpha2"}}, {"bounds": {"alpha1": [-1e12, -1e11]}},
    ],
)  # fmt: skip
def test_wishes_that_cannot_be_are_refused_when_they_come(http, recording, more):
    found = http.post(FITS, json={"traces": [recording], **more})
    assert (found.status_code, found.json()["code"]) == (422, "bad_value"), found.text
    assert "Value error" not in found.text
    if set(more) == {"fix"} and "alpha1" in more["fix"]:
        options = {"files": {"files": ("a.csv", b"t,V\n")}, "data": {"options": json.dumps(more)}}
        assert http.post("/api/v1/batches", **options).json()["place"].startswith("options")


def test_a_long_name_is_not_repeated(http, recording):
    found = http.post(FITS, json={"traces": [recording], "x" * 10**5: 1})
    assert (found.status_code, found.json()["code"]) == (422, "bad_name")
    assert len(found.content) < 2000


def test_a_preview_refuses_the_value_of_a_constant_as_the_fit_does(http, recording):
    asked = {"trace": recording, "loss": "modal", "role.alpha1": "fixed", "value.alpha1": "0"}
    found = http.get("/fits/new", params=asked)
    assert found.status_code == 200
    assert "1e-12 to 1e+12 for alpha1" in found.text


@pytest.mark.parametrize("tie", ["0.3*alpha2", "sqrt(alpha2) - 1/k_vs", "1/log(alpha2)", "alpha2**2", "k_vs - alpha2"])
def test_a_tie_that_can_be_is_taken(http, recording, tie):
    assert http.post(FITS, json={"traces": [recording], "tie": {"alpha1": tie}}).status_code in (200, 202)


@pytest.mark.parametrize(
    ("options", "words"), [('{"seed": 1, "seed": 2}', "twice"), ('"\\ud800"', "surrogates"), ("{", "JSON")]
)
def test_options_and_conditions_in_a_form_are_as_strict(http, options, words):
    batch = http.post("/api/v1/batches", files={"files": RECORDING.read_bytes()}, data={"options": options})
    trace = http.post("/api/v1/traces", files={"file": RECORDING.read_bytes()}, data={"conditions": options})
    for found in (batch, trace):
        assert (found.status_code, found.json()["code"]) == (422, "bad_value"), found.text
        assert words in found.text


def test_rows_beyond_any_file_are_refused_by_api_and_page(http, recording):
    for rows in ([1, 10**20], [2**63, None], f"1:{10**20}"):
        reading = json.dumps({"rows": rows})
        found = http.post("/api/v1/traces", files={"file": ("a.csv", b"t,V\n0,1\n1,2\n")}, data={"reading": reading})
        assert (found.status_code, found.json()["code"]) == (422, "bad_value"), found.text
    asked = {"trace": recording, "rows": f"1:{10**20}"}
    assert http.post("/traces/settle", data=asked).status_code == 422


def test_the_page_without_a_trace_asks_for_one(http):
    empty = ({}, {"seed": "1"}, {"trace": []}, {"role.radius": "asked"})
    for address, data in product(("/fits", "/inversions"), empty):
        found = http.post(address, data=data)
        assert found.status_code == 422, address
        assert "Choose a file first" in found.text
    assert http.post("/traces/conditions", data={}).status_code in (303, 422)


@pytest.mark.parametrize("number", ["1e999", "-1e999", "24.7", "1e300"])
def test_a_number_of_a_form_that_is_not_whole_is_not_made_so(http, recording, number):
    look = http.post("/looks", data={"film": recording}).headers["location"].rpartition("/")[2]
    asked = {"look": look, "top": "1", "bottom": "50", "left": "1", "right": "50"}
    for name in ("top", "bottom", "left", "right"):
        assert http.post("/films", data=asked | {name: number}).status_code == 422, name
    for address in ("/simulations", "/modes"):
        assert http.post(address, data={"elements": number}).status_code == 422, address
    for address, more in (("/simulations", {"elements": "24.0"}), ("/films", asked | {"top": "2.0"})):
        assert http.post(address, data=more).status_code == 303, address


@pytest.mark.long
def test_an_identifier_that_no_database_takes_is_not_found(cluster):
    settings = Settings(db=cluster.database(), warm=False)
    with listening(settings) as (address, _), httpx.Client(base_url=address, timeout=30, trust_env=False) as client:
        for odd in ("%00", "a%00b", "A" * 300):
            for path in (
                "/fits/{}", "/?before={}", "/fits/new?trace={}", "/traces/settle?trace={}", "/films/{}/trace.svg",
                "/simulations/{}", "/inversions/new?trace={}", "/traces/conditions?trace={}", "/fits/{}/fit.svg",
            ):  # fmt: skip
                assert client.get(path.format(odd)).status_code == 404, path
            assert client.post(f"/fits/{odd}/cancel").status_code == 404
            for path in ("/fits", "/looks", "/films", "/traces/settle", "/traces/conditions", "/inversions"):
                sent = {"trace": unquote(odd), "film": unquote(odd), "look": unquote(odd), "kept": unquote(odd)}
                assert client.post(path, data=sent).status_code == 404, path


def test_an_identifier_of_another_form_never_reaches_the_database(http, monkeypatch):
    def fail(*_):
        raise AssertionError

    monkeypatch.setattr(Store, "job", fail)
    monkeypatch.setattr(Store, "trace", fail)
    for path in ("/fits/%00", "/simulations/a%00b", "/fits/new?trace=%00", "/traces/settle?trace=no"):
        assert http.get(path).status_code == 404, path
    for path in ("/fits", "/looks", "/films", "/traces/settle", "/traces/conditions", "/fits/%00/cancel"):
        assert http.post(path, data={"trace": "\x00", "film": "\x00", "look": "\x00"}).status_code == 404, path


@pytest.mark.long
def test_a_form_in_another_alphabet_is_refused(http):
    part = b'--x\r\nContent-Disposition: form-data; name="trace"\r\n\r\n\\ud800\r\n--x--\r\n'
    for charset in ("unicode_escape", "undefined", "utf-7"):
        kind = {"Content-Type": f"multipart/form-data; boundary=x; charset={charset}"}
        assert http.post("/fits", content=part, headers=kind).status_code == 400, charset


@pytest.mark.long
def test_a_channel_with_a_slash_is_taken_and_exported(http, tmp_path):
    lines = RECORDING.read_text().splitlines()
    head = next(row for row, line in enumerate(lines) if not line.startswith("#"))
    lines[head] += ",H/R0 [-]"
    content = "\n".join([*lines[: head + 1], *(line + ",0.5" for line in lines[head + 1 :])]).encode()
    assert http.post("/api/v1/traces", files={"file": ("a.csv", content)}).status_code == 201
    variables = {name: (("t",), np.zeros(2)) for name in ("H/R0", ".", "..", "H")}
    write_groups(tmp_path / "a.nc", {"trace1": variables})  # what a fit writes beside its record
    with xarray.open_dataset(tmp_path / "a.nc", group="trace1") as found:
        assert sorted(found.data_vars) == ["H", "H_per_R0", "dot", "dotdot"]


def test_nobody_writes_lines_into_the_log(caplog):
    assert plain("a\nERROR forged\r\x1b[2J\x85\u202e") == "a\n    ERROR forged\\r\\x1b[2J\\x85\\u202e"
    logging.getLogger("jshell.service").warning("job %s", "x\x1b[31m\nERROR y")
    assert caplog.records[-1].getMessage() == "job x\\x1b[31m\n    ERROR y"


def test_a_head_is_answered_as_a_get_without_its_body(http, recording):
    for path in ("/", "/healthz", f"/api/v1/traces/{recording}", "/static/jshell.css", "/openapi.json", "/nothing"):
        full, head = http.get(path), http.head(path)
        assert (head.status_code, head.content) == (full.status_code, b""), path
        assert head.headers["content-type"] == full.headers["content-type"]


def test_a_database_that_does_not_answer_tells_nobody_where_it_lies(tmp_path: Path, monkeypatch, caplog):
    settings = Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False)
    with listening(settings) as (address, store), httpx.Client(base_url=address, trust_env=False) as http:
        unavailable = store.database._unavailable

        def lost(*_: object) -> None:
            raise unavailable(f'connection to server on socket "{tmp_path}/.s.PGSQL.5432" failed: {tmp_path}/x')

        for name in ("jobs", "counts", "trace"):
            monkeypatch.setattr(Store, name, lost)
        for path in (FITS, "/metrics", f"/api/v1/traces/{'0' * 32}", "/"):
            found = http.get(path)
            assert found.status_code == 503, path
            assert found.headers["retry-after"]
            assert str(tmp_path) not in found.text
            assert "jobs.db" not in found.text
    assert str(tmp_path) in caplog.text  # for its keeper
    with pytest.raises(StoreUnavailable, match=str(tmp_path)):  # and where it cannot be opened at all
        Store.open(f"sqlite:///{tmp_path}/none/jobs.db")


def test_the_description_of_records_is_true(http):
    paths = http.get("/openapi.json").json()["paths"]
    for kind in ("fits", "simulations", "modes"):
        schema = paths[f"/api/v1/{kind}/{{id}}.json"]["get"]["responses"]["200"]["content"]["application/json"]
        assert "string" not in json.dumps(schema)


def test_the_page_names_a_column_without_a_unit_as_the_api_does(http):
    content = b"t,V [mm^3]\n0,3\n1,2\n2,2\n"
    api = http.post("/api/v1/traces", files={"file": ("a.csv", content)}).json()
    page = http.post("/traces", files={"file": ("a.csv", content)})
    assert (api["code"], page.status_code) == ("bad_units", 422)
    assert "column `t`" in api["place"]
    assert "column `t`" in page.text
    bare = http.post("/traces", files={"file": ("a.csv", content.replace(b"t,", b"t [s],"))})
    assert bare.headers["location"].startswith("/traces/conditions")  # which are asked for


NUMBERS = {name: np.full(3, 0.5) for name in ("thickness", "gas_pressure", "outer_pressure", "viscosity")}
ARRAYS = {"times": np.arange(20.0), "values": np.ones((3, 2, 20)), **NUMBERS}
ARRAYS |= {"kappa": np.full(3, 1.4), "poisson_ratio": np.full(3, 0.5)}


@pytest.mark.parametrize(
    "odd",
    [
        {"channels": np.array(3.0)}, {"channels": np.array([["V", "S"]])}, {"channels": np.array([b"V", b"S"])},
        {"thickness": np.array(["a", "b", "c"])}, {"thickness": np.zeros(3, "V0")}, {"thickness": np.full((3, 3), 0.2)},
        {"thickness": np.zeros(3, "M8[s]")}, {"values": np.zeros((0, 2, 20))},
        {"values": np.zeros((3, 2, 20), "M8[s]")},
        {"counts": np.array(["a"] * 3)}, {"sigma": np.array("a")}, {"times": np.zeros(20, [("a", "f8")])},
        {"values": np.ones((3, 2, 20)) + 1j},
    ],
    ids=str,
)  # fmt: skip
def test_arrays_that_are_no_records_are_refused_by_name(http, odd):
    file = io.BytesIO()
    np.savez(file, **(ARRAYS | odd))
    found = http.post("/api/v1/batches", files={"files": ("odd.npz", file.getvalue())})
    assert (found.status_code, found.json()["code"]) in ((422, "bad_file"), (422, "bad_shape"), (422, "bad_value"))
    assert next(iter(odd)) in found.json()["detail"]
    assert http.post("/traces", files={"file": ("odd.npz", file.getvalue())}).status_code == 422


def test_the_page_takes_no_archive_that_the_service_refuses(http):
    many = io.BytesIO()
    with zipfile.ZipFile(many, "w") as archive:
        for number in range(10_001):
            archive.writestr(f"{number}.csv", "")
    for content in (b"no archive", many.getvalue()):
        page = http.post("/traces", files={"file": ("many.zip", content)})
        api = http.post("/api/v1/batches", files={"files": ("many.zip", content)})
        assert page.status_code == api.status_code == 422

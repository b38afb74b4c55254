"""What the client takes for an answer: every part of its kind, else refused before anybody counts on it."""

import dataclasses
import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from jshell.calibration import BatchResult, load
from jshell.errors import BadFile, BadValue, MissingExtra
from jshell.files import NamedBytes
from jshell.service import batches, receiving

GOLDEN = Path(__file__).parents[1] / "calibration" / "golden" / "saved"
SAVED = sorted(path for path in GOLDEN.glob("*.json") if ".record" not in path.name)
ERROR = {"code": "bad_value", "place": "here", "cause": "1", "found": "1", "expected": "2", "remedy": "Try 2."}
JOB = {
    "id": "0" * 24, "kind": "fit", "state": "failed", "created": 1.0, "started": None, "finished": 2, "attempt": 1,
    "progress": 0, "traces": [], "specification": {}, "error": ERROR, "links": {},
}  # fmt: skip
UPLOAD = {"id": "a" * 32, "name": "a.csv", "sha256": "0" * 64, "size": 1, "created": 1.0}
MODE = {"mode": 1, "omega": 1.0, "Omega": 1.0, "tau": None, "dV": 0.5, "dS": -2, "outcome": "ok"}
ORDER = MODE | {"azimuth": 2, "growth": None, "dH": 0.0, "dW": 0.1, "seen": "V"}
INTERVAL = {"value": 1.0, "low": None, "high": 2.0, "reason": ""}
PROFILE = {"level": 0.95, "criterion": "F", "intervals": {"alpha1": INTERVAL}}
ESTIMATE = {"name": "gas_pressure", "value": 1.0, "stderr": None}
INVERSION = {"title": "", "outcome": "ok", "estimates": [ESTIMATE], "intervals": {"gas_pressure": [None, 2.0]}}
ODD = (None, True, "x", -5, 0.5, 10**400, float("nan"), float("inf"), [1], {}, [])  # one of them is no progress, …


def refused(read, found) -> bool:
    try:
        read(found)
    except receiving.SPOILED:
        return True
    return False


def odd_parts(read, whole: dict) -> dict[str, int]:
    """How many odd values each part of an answer refuses."""
    return {name: sum(refused(read, whole | {name: odd}) for odd in ODD) for name in whole}


def test_a_job_is_what_the_service_says_or_refused():
    found = receiving.job(JOB)
    assert (found["progress"], found["state"]) == (0.0, "failed")
    assert isinstance(found["error"], BadValue)
    counts = odd_parts(receiving.job, JOB)
    kinds = {"id": 11, "kind": 11, "state": 11, "progress": 10, "specification": 10, "error": 10}
    assert {name: counts[name] for name in kinds} == kinds
    assert min(counts.values()) > 5
    assert odd_parts(receiving.error_of, ERROR) == dict.fromkeys(ERROR, 10)  # any text
    for name in JOB:
        assert refused(receiving.job, {key: value for key, value in JOB.items() if key != name})
    assert refused(receiving.upload, UPLOAD | {"id": "x" * 32})
    assert receiving.upload(UPLOAD) == "a" * 32


@pytest.mark.parametrize("following", [5, "", "http://evil/", "/api/v1/", "/api/v1/fits?\0", "/api/v1/" + "f" * 70_000])
def test_a_next_page_is_below_the_service(following):
    assert refused(receiving.page, {"jobs": [JOB], "next": following})
    assert receiving.page({"jobs": [], "next": None}) == ([], None)
    assert receiving.page({"jobs": [JOB], "next": "/shown/api/v1/fits?limit=2&before=a"})[1] == "/fits?limit=2&before=a"
    assert refused(receiving.page, {"jobs": [], "next": "/api/v1/fits?limit=2"})  # without end


def test_rows_and_records_are_of_their_kinds():
    assert receiving.modes([MODE])[0].tau is None
    assert receiving.modes([ORDER])[0].azimuth == 2
    one = lambda row: receiving.modes([row])  # noqa: E731
    # null is no number of a mode, though it is a decay time; not finite is never one
    assert odd_parts(one, MODE) == {"mode": 11, "omega": 8, "Omega": 8, "tau": 8, "dV": 8, "dS": 8, "outcome": 10}
    assert refused(receiving.modes, [ORDER, MODE])
    assert refused(receiving.modes, [])
    assert receiving.inversion(INVERSION) == INVERSION
    counts = odd_parts(receiving.inversion, INVERSION)
    assert counts == {"title": 10, "outcome": 10, "estimates": 11, "intervals": 10}
    assert receiving.profile(JOB | {"result": None}) is receiving.profile(JOB | {"result": {}}) is None
    told = lambda profile: receiving.profile(JOB | {"result": {"profile": profile}})  # noqa: E731
    assert told(PROFILE) == PROFILE
    of = lambda interval: told(PROFILE | {"intervals": {"a": interval}})  # noqa: E731
    assert refused(of, INTERVAL | {"low": "0"})
    assert refused(of, {})


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_every_saved_fit_is_an_answer(path):
    content = path.read_bytes()
    assert receiving.fit(content).report() == load(NamedBytes("record.json", content)).report()


@pytest.mark.parametrize("change", [{"title": 5}, {"notes": [1]}, {"varied": "ab"}, {"n_data": 1e999}, {"dipole": {}}])
def test_a_fit_with_a_field_of_another_kind_is_refused(change):
    spoiled = json.dumps(json.loads(SAVED[0].read_bytes()) | change).encode()
    assert refused(receiving.fit, spoiled)
    with pytest.raises(BadFile, match="a field that is missing or of another kind"):  # a file on the disk as well
        load(NamedBytes("saved.json", spoiled))


def test_without_the_extra_the_client_says_which_one(monkeypatch):
    monkeypatch.setitem(sys.modules, "pydantic", None)
    monkeypatch.delitem(sys.modules, "jshell.service.receiving")
    with pytest.raises(MissingExtra, match=r"jshell\[service\]"):
        importlib.import_module("jshell.service.receiving")


def batch(**change) -> bytes:
    shapes = {"values": 5, "stderr": 5, "omega": 2, "state": 6, "rest": 2, "start": 4, "memory": 2, "omega_stderr": 2}
    rows = {field.name: np.zeros(3) for field in dataclasses.fields(BatchResult) if field.type is np.ndarray}
    rows |= {name: np.zeros((3, width)) for name, width in shapes.items()} | {"outcome": np.zeros(3, int)}
    made = BatchResult(**rows, free_directions=(), absolute=True)  # pyright: ignore
    for name, value in change.items():
        object.__setattr__(made, name, value)
    return batches.pack_result(made)


def test_a_batch_has_a_row_for_every_outcome():
    assert len(receiving.batch(batch())) == 3
    for change in (
        {"values": np.zeros((2, 5))}, {"values": np.zeros(3)}, {"stderr": np.full((3, 5), "x")}, {"tried": np.zeros(4)},
        {"outcome": np.zeros((3, 2), int)}, {"outcome": np.full(3, 99)}, {"outcome": np.zeros(())},
    ):  # fmt: skip
        assert refused(receiving.batch, batch(**change)), change

"""What jobs do, without database and processes: files in, files out."""

import csv
import dataclasses
import io as streams
import json
import warnings
import zipfile

import jax
import numpy as np
import pytest

import jshell
from jshell import calibration, dynamics, io
from jshell.calibration import BatchResult, Recordings, fit_batch, recordings_file
from jshell.calibration.recordings import stacked
from jshell.errors import BadFile, JshellError, Outcome
from jshell.io import zip_files
from jshell.oscillator import random_shell, random_trace
from jshell.service import batches, chunks, tasks
from jshell.trace import Trace

CONDITIONS = {"d_hat": 0.08, "P0_hat": 0.9, "Pext_hat": 1.2, "eta_hat": 0.004}
OSCILLATOR = {"model": "oscillator", "conditions": CONDITIONS, "duration": 10.0, "every": 0.1}


@pytest.fixture(scope="module")
def noisy() -> Trace:
    return random_trace(random_shell(0), 0)


def written(trace: Trace, folder, name: str = "trace.csv") -> bytes:
    path = folder / name
    io.write_trace(path, trace)
    return path.read_bytes()


def cut(trace: Trace, count: int) -> Trace:
    channels = {name: np.asarray(values)[:count] for name, values in trace.channels.items()}
    return Trace(np.asarray(trace.times)[:count], channels, trace.conditions)


def test_a_model_runs_and_its_trace_reads_back(tmp_path):
    answer = tasks.run("simulate", OSCILLATOR, [])
    assert answer.error is None
    assert set(answer.files) == {"trace.json", "trace.csv", "trace.nc"}
    expected, film = tasks.motion(OSCILLATOR)
    assert film is None
    for name, content in answer.files.items():
        (tmp_path / name).write_bytes(content)
        read = io.read_trace(tmp_path / name)
        np.testing.assert_allclose(read["V"], expected["V"], rtol=1e-11)  # text has twelve digits, the others all
    assert np.asarray(expected.times).shape == (101,)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"model": "bubble"}, "simulator or oscillator"),
        ({"elements": 4}, "option 'elements'"),
        ({"conditions": None}, "conditions"),
        ({"conditions": {"d_hat": 0.2}}, "P0_hat"),
        ({"duration": float("inf")}, "every"),
    ],
)
def test_a_model_that_cannot_run_says_why(change, words):
    answer = tasks.run("simulate", OSCILLATOR | change, [])
    assert not answer.files
    assert answer.error is not None
    assert words in json.dumps(answer.error, ensure_ascii=False)


@pytest.mark.long
def test_modes_are_the_librarys_own():
    R = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.62, "eta_hat": 0.004}
    asked = {"conditions": R, "elements": 16, "count": 2, "liquid": "ideal"}
    answer = tasks.run("modes", asked)
    assert answer.error is None
    rows = json.loads(answer.files["modes.json"])
    found = dynamics.modes(jshell.Reduced(*R.values()), elements=16, count=2, liquid="ideal")
    assert [dynamics.Mode(**row) for row in rows] == list(found.table())
    assert rows[0]["tau"] is None  # without loss
    assert answer.files["modes.csv"].decode().splitlines()[0] == "mode,omega,Omega,tau,dV,dS,outcome"
    assert "liquid" in str(tasks.run("modes", asked | {"liquid": "water"}).error)
    assert "azimuth" in str(tasks.run("modes", asked | {"azimuth": [41]}).error)
    assert "option 'ramp'" in str(tasks.run("modes", asked | {"ramp": 3}).error)


@pytest.mark.long
def test_modes_of_several_orders_are_the_librarys_own():
    R = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.0}
    asked = {"conditions": R, "elements": 24, "liquid": "ideal", "azimuth": [0, 1, 2, 3, 4]}
    answer = tasks.run("modes", asked)
    assert answer.error is None
    rows = json.loads(answer.files["modes.json"])
    found = dynamics.modes(jshell.Reduced(*R.values()), azimuth=range(5), elements=24, liquid="ideal")
    assert tuple(dynamics.OrderMode(**row) for row in rows) == found.table()
    assert [row["azimuth"] for row in rows[:4]] == [0, 2, 1, 0]  # two between the frequencies of m = 0
    assert answer.files["modes.csv"].decode().startswith("azimuth,mode,omega,Omega,tau,growth,")


def test_a_fault_of_our_own_is_no_error_of_the_user():
    answer = tasks.run("simulate", OSCILLATOR | {"initial": "four"}, [])
    assert answer.error is None
    assert answer.fault is not None
    assert "Traceback" in answer.fault


def test_a_fit_is_the_librarys_own_to_the_bit(noisy, tmp_path):
    content = written(cut(noisy, 300), tmp_path)
    answer = tasks.run(
        "fit", {"fix": {"k_vs": 0.23}, "bounds": {"alpha1": [1, None]}, "seed": 4}, [("my.csv", content)]
    )
    assert answer.error is None
    (tmp_path / "record.json").write_bytes(answer.files["record.json"])
    found = jshell.load(tmp_path / "record.json")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = calibration.fit_trajectories(
            io.read_trace(tmp_path / "trace.csv"), "strict", channels=("V", "S"), fix={"k_vs": 0.23},
            bounds={"alpha1": (1.0, np.inf)}, seed=4,
        )  # fmt: skip
    assert found == expected
    assert found.outcome == Outcome.OK
    assert answer.files["report.txt"].decode() == expected.report()
    first = answer.files["table.csv"].decode().splitlines()[1].split(",")
    assert (first[0], float(first[1]), float(first[2])) == (
        "alpha1", expected["alpha1"].value, expected["alpha1"].stderr,
    )  # fmt: skip
    assert answer.files["record.nc"].startswith(b"\x89HDF")
    named = dataclasses.replace(expected.estimates[0], name="offset[V, left]")
    rows = csv.reader(streams.StringIO(tasks._parameters(dataclasses.replace(expected, estimates=(named,))).decode()))
    assert list(rows)[1][:2] == ["offset[V, left]", repr(named.value)]  # a comma in a name parts no cells


def test_fits_of_many_lengths_share_their_programs(noisy, tmp_path):
    compiled: list[str] = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, _, **more: compiled.append(name) if name.endswith("backend_compile_duration") else None
    )
    for count in (300, 301, 399, 400, 270):
        answer = tasks.run(
            "fit", {"netcdf": False, "fix": {"k_vs": 0.23}}, [("a.csv", written(cut(noisy, count), tmp_path))]
        )
        assert answer.error is None
        if count == 300:
            compiled.clear()
    assert not compiled


def test_errors_call_a_file_by_its_owners_name(tmp_path):
    answer = tasks.run("fit", {}, [("../camera 3.csv", b"t,V\n1,2\n")])
    assert answer.error is not None
    assert answer.error["place"] == "../camera 3.csv"
    assert "tmp" not in json.dumps(answer.error)
    answer = tasks.run(
        "fit", {"conditions": {"d_hat": -1, "P0_hat": 0.9, "Pext_hat": 1.6}}, [("a.csv", b"t,V\n1,2\n2,3\n")]
    )
    assert "tmp" not in json.dumps(answer.error)
    answer = tasks.run("fit", {"exec": "rm"}, [])
    assert answer.error["code"] == "bad_name"


@pytest.mark.parametrize("name", ["a.exe", "a", "a.csv\0", "a." + "x" * 300])
def test_any_suffix_is_read_as_text(name):
    answer = tasks.run("fit", {}, [(name, b"\xff\xfe nothing")])
    assert answer.fault is None
    assert answer.error["code"] == "bad_file"


@pytest.fixture
def short() -> Recordings:
    """Records too short to be fitted: a result without a compilation."""
    conditions = jshell.Reduced(*(np.full(2, x) for x in (0.22, 0.9, 1.6, 0.004, 1.4, 0.5)))
    values = np.random.default_rng(0).normal(size=(2, 2, 20))
    return Recordings(0.1 * np.arange(20.0), values, conditions, np.full((2, 2), 0.1), np.array([20, 19]))


def test_records_and_results_travel_to_the_bit(short):
    back = recordings_file.decode(recordings_file.encode(short))
    with pytest.warns(DeprecationWarning, match="encode"):
        assert batches.pack(short) == recordings_file.encode(short)
    for name in ("times", "values", "sigma", "counts"):
        np.testing.assert_array_equal(getattr(back, name), getattr(short, name))
    np.testing.assert_array_equal(back.conditions.viscosity, short.conditions.viscosity)
    found = fit_batch(short)
    again = batches.unpack_result(batches.pack_result(found))
    assert again.absolute == found.absolute
    assert again.free_directions == found.free_directions
    for name in BatchResult.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(again, name), getattr(found, name))


def test_an_upload_of_arrays_is_a_batch(short):
    answer = tasks.run("batch", {}, [("many.npz", recordings_file.encode(short))])
    assert answer.error is None
    found = batches.unpack_result(answer.files["record.npz"])
    assert [one.word for one in found.outcomes] == ["unusable_data"] * 2
    assert batches.table(answer.files["record.npz"]).decode().splitlines()[1].startswith("1,unusable_data,nan")


def test_recordings_of_a_camera_are_a_batch_as_they_are_and_strange_among_others():
    """Height and width were refused for want of V, though the fit that follows reads any channels."""
    head = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.62\n# eta_hat: 0.004\n"
    camera = (head + "t,H,W\n0,1.3,2.1\n1,1.2,2.2\n").encode()
    simulated = (head + "t,V,S\n0,2.9,12.0\n1,2.8,12.1\n").encode()
    alone = batches.read([("a.csv", camera), ("b.csv", camera)])
    assert len(alone.records) == 2
    assert not alone.refused
    mixed = batches.read([("a.csv", camera), ("bad.csv", b"t,V\n0,x\n"), ("b.csv", simulated)])
    assert list(mixed.refused) == [0, 1]
    assert "V" in str(mixed.refused[0])


def test_a_batch_of_other_channels_travels_with_their_names(short):
    values, sigma = np.asarray(short.values)[:, :1], np.full((2, 1), 0.1)
    heights = Recordings(short.times, values, short.conditions, sigma, short.counts, ("H",))
    answer = tasks.run("batch", {"channels": ["H"], "noise": "white"}, [("many.npz", recordings_file.encode(heights))])
    found = batches.unpack_result(answer.files["record.npz"])
    assert (found.loss, found.channels) == ("modal", ("H",))
    assert "H_slow_cos" in batches.table(answer.files["record.npz"]).decode()
    assert chunks.chosen(heights, np.array([1])).channels == ("H",)
    assert tasks.run("batch", {"loss": "strict"}, [("many.npz", recordings_file.encode(heights))]).error is not None


def same(found: BatchResult, expected: BatchResult) -> None:
    for name in BatchResult.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def test_chunks_of_a_batch_are_put_together_in_their_order(short, monkeypatch):
    monkeypatch.setattr(chunks, "STEP", 1)
    monkeypatch.setattr(chunks, "MAX_CHUNK_BYTES", 1)
    assert [np.shape(chunk.values)[0] for chunk in chunks.split(short)] == [1, 1]
    expected = dataclasses.replace(fit_batch(short), free_directions=((1, "k_vs"),), tried=np.array([0, 7]))
    first, second = (fit_batch(chunk) for chunk in chunks.split(short))
    second = dataclasses.replace(second, free_directions=((0, "k_vs"),), tried=np.array([7]))
    whole = chunks.joined([first, second])
    same(whole, expected)
    again = chunks.tried_again(whole)
    assert list(again) == [1]
    other = dataclasses.replace(second, n_data=np.array([18]), free_directions=((0, "alpha1"),))
    placed = chunks.placed(whole, again, other)
    assert list(placed.n_data) == [whole.n_data[0], 18]
    assert placed.free_directions == ((1, "alpha1"),)


@pytest.mark.parametrize(("steps", "most", "sizes"), [(1, 1, [1]), (10, 3, [1, 2, 3, 2, 2]), (5, 1, [1] * 5)])
def test_chunks_are_small_at_both_ends(steps, most, sizes):
    assert chunks._sizes(steps, most) == sizes


@pytest.mark.slow
def test_chunks_of_a_batch_are_the_whole_to_the_bit(monkeypatch):
    monkeypatch.setattr(chunks, "STEP", 64)
    monkeypatch.setattr(chunks, "MAX_CHUNK_BYTES", 1)
    records = stacked([random_trace(random_shell(seed), seed, noise=0.01) for seed in range(150)])
    values = np.array(records.values)
    other = np.cos(3.1 * np.asarray(records.times).reshape(-1, values.shape[2])[0])
    for row in (3, 20, 70, 71, 100, 130, 149):  # a motion of neither mode: they are tried again, with random starts
        values[row] += 0.3 * values[row].std(axis=-1, keepdims=True) * other
    records = Recordings(records.times, values, records.conditions, records.sigma, records.counts)
    expected = fit_batch(records, seed=3)
    assert len(set(np.flatnonzero(expected.tried > 1) // 64)) >= 2  # in several chunks
    found = chunks.joined([fit_batch(chunk, seed=3) for chunk in chunks.split(records)])
    again = chunks.tried_again(found)
    same(chunks.placed(found, again, fit_batch(chunks.chosen(records, again), seed=3)), expected)


def test_a_bad_file_of_an_archive_costs_its_own_row(noisy, tmp_path, monkeypatch):
    def numbered(records, **options):
        return dataclasses.replace(fit_batch(records, **options), n_data=np.array([40, 42]))

    monkeypatch.setattr(batches, "fit_batch", numbered)
    file = streams.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("in/=cmd.csv", written(cut(noisy, 20), tmp_path))
        archive.writestr("in/b.csv", b"nonsense")
        archive.writestr("in/c.csv", written(cut(noisy, 21), tmp_path))
    answer = tasks.run("batch", {}, [("many.zip", file.getvalue())])
    assert answer.error is None
    found = batches.unpack_result(answer.files["record.npz"])
    assert len(found) == 3
    assert list(found.n_data) == [40, 0, 42]  # the row of the file that could not be read stands where it stood
    lines = batches.table(answer.files["record.npz"]).decode().splitlines()
    assert [line.split(",")[0] for line in lines[1:]] == ["'=cmd.csv", "b.csv", "c.csv"]  # no formula


def test_an_archive_is_numpys_own_and_read_without_its_numbers(short):
    arrays = {"values": short.values, "one": np.array(1.5), "none": np.array([], dtype=str)}
    expected = streams.BytesIO()
    np.savez(expected, allow_pickle=False, **arrays)
    assert zip_files.pack(arrays) == expected.getvalue()
    squeezed = streams.BytesIO()
    np.savez_compressed(squeezed, **arrays | {"values": np.asfortranarray(short.values)})
    by_columns = streams.BytesIO()
    np.savez(by_columns, **arrays | {"values": np.asfortranarray(short.values)})
    for file in (expected, squeezed, by_columns):
        found = zip_files.unpack(file.getvalue(), "a.npz")
        for name, array in arrays.items():
            assert found[name].dtype == array.dtype
            np.testing.assert_array_equal(found[name], array, strict=True)
    assert recordings_file.count(recordings_file.encode(short), "a.npz") == 2
    assert recordings_file.count(expected.getvalue().replace(b"values", b"volume"), "a.npz") == 0
    spoiled = bytearray(expected.getvalue())
    spoiled[spoiled.index(b"NUMPY") + 200] ^= 1  # in the middle of the numbers
    with pytest.raises(BadFile, match=r"CRC|damaged"):
        zip_files.unpack(bytes(spoiled), "a.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 torn", b"no archive"], ids=["empty", "torn", "text"])
@pytest.mark.parametrize("name", ["a.npz", "a.zip"])
def test_a_damaged_archive_is_refused(name, content):
    answer = tasks.run("batch", {}, [(name, content)])
    assert answer.fault is None
    assert answer.error["code"] == "bad_file"
    with pytest.raises(BadFile):
        batches.unpack_result(content)


def test_an_array_that_claims_more_than_it_holds_is_refused_before_memory_is_asked_for():
    file, head = streams.BytesIO(), streams.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)})
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("values.npy", head.getvalue() + bytes(16))
    with pytest.raises(BadFile, match="holds 16 bytes for a claim of 8000000000000000"):
        zip_files.unpack(file.getvalue(), "a.npz")


def test_pickles_are_never_opened():
    file = streams.BytesIO()
    np.savez(file, values=np.array([{"code": "any"}], dtype=object), times=np.zeros(3))
    answer = tasks.run("batch", {}, [("a.npz", file.getvalue())])
    assert answer.error["code"] == "bad_file"


def test_a_batch_without_a_readable_trace_says_why():
    with pytest.raises(JshellError, match=r"a\.csv"):
        tasks.batch({}, [("a.csv", b"nonsense\n"), ("b.csv", b"nonsense\n")])


@pytest.mark.slow
def test_a_batch_is_the_librarys_own_to_the_bit(tmp_path):
    traces = [random_trace(random_shell(seed), seed) for seed in range(100)]
    file = streams.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for number, trace in enumerate(traces):
            archive.writestr(f"{number:03}.npz", written(trace, tmp_path, "trace.npz"))
    expected = fit_batch(traces)
    for content, name in ((file.getvalue(), "a.zip"), (recordings_file.encode(stacked(traces)), "a.npz")):
        found = batches.unpack_result(tasks.run("batch", {}, [(name, content)]).files["record.npz"])
        for field in BatchResult.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))

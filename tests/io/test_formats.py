"""Every format: what is written comes back, to the bit where bits are kept; what is wrong is refused at its place."""

import json
import os
import warnings
import zipfile

import numpy as np
import pytest
import scipy.io

from jshell.errors import BadFile, BadName, BadShape, BadUnits, BadValue, MissingExtra, Outcome
from jshell.files import NamedBytes
from jshell.io import encode_trace, read_conditions, read_table, read_trace, write_trace
from jshell.io.files import LIMIT
from jshell.shell import Reduced, Scales
from jshell.trace import Trace

EXACT = ("json", "nc", "mat", "npz")
ALL = ("csv", "tsv", "txt", *EXACT)
SETTINGS = (("note", "a: b, µ"), ("seed", "3"))
FACTS = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6}


def _trace(count=50):
    """Numbers whose every bit matters, the smallest and the negative zero among them."""
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.01, 0.1, count))
    own = rng.normal(size=count) * 10.0 ** rng.integers(-300, 300, count)
    own[:3] = 5e-324, -0.0, np.nextafter(1, 2)
    channels = {"V": rng.uniform(2, 3, count), "mine": own}
    problem = Reduced(0.1 + 0.2 / 3, 0.9, 1.6, 0.004 / 3, 1.3, 0.45)
    sigma = {"V": rng.uniform(0, 0.01, count)}
    return Trace(times, channels, problem, sigma, int(Outcome.CONTACT), SETTINGS, Scales(2.3e-3, 1.9e4, 998.0))


def _bits(trace):
    numbers = [trace.times, *trace.channels.values(), *trace.sigma.values()]
    problem = trace.conditions
    conditions = [problem.thickness, problem.gas_pressure, problem.outer_pressure]
    conditions += [problem.viscosity, problem.kappa, problem.poisson_ratio]
    return [np.asarray(values, dtype=np.float64).tobytes() for values in (*numbers, conditions)]


@pytest.mark.parametrize("suffix", EXACT)
def test_a_reduced_trace_comes_back_to_the_bit(tmp_path, suffix):
    trace, path = _trace(), tmp_path / f"a.{suffix}"
    write_trace(path, trace)
    found = read_trace(path)
    assert _bits(found) == _bits(trace)
    assert (list(found.channels), list(found.sigma)) == (["V", "mine"], ["V"])
    assert found.outcome == Outcome.CONTACT
    assert found.settings == SETTINGS


@pytest.mark.parametrize("suffix", ALL)
def test_an_si_trace_comes_back_with_its_scales(tmp_path, suffix):
    trace, path = _trace(), tmp_path / f"a.{suffix}"
    write_trace(path, trace, units="si")
    found = read_trace(path)
    np.testing.assert_allclose(found.times, trace.times, rtol=1e-15)
    np.testing.assert_allclose(found["V"], trace["V"], rtol=1e-11)  # text keeps twelve digits
    np.testing.assert_allclose(found.scales.pressure, 1.9e4, rtol=1e-15)
    assert found.settings == SETTINGS


@pytest.mark.parametrize("suffix", ALL)
def test_a_name_with_bytes_is_read_and_written_as_the_file_is(tmp_path, suffix):
    path = tmp_path / f"a.{suffix.upper()}"
    write_trace(path, _trace())
    content = path.read_bytes()
    for given in (content, memoryview(content)):
        assert _bits(read_trace(NamedBytes(f"a.{suffix.upper()}", given))) == _bits(read_trace(path))
    made = encode_trace(f"b.{suffix}", _trace())
    assert made.name == f"b.{suffix}"
    assert _bits(read_trace(made)) == _bits(read_trace(path))
    if suffix not in ("mat", "npz"):  # whose heads hold the time of writing
        assert made.content == content


@pytest.mark.parametrize("suffix", ALL)
def test_a_refused_name_with_bytes_is_called_by_its_name(suffix):
    for content in (b"", b"\x01\xff", b"PK\x03\x04", b"MATLAB 5.0", b"\x89HDF", b"{}"):
        with pytest.raises((BadFile, BadName)) as caught:
            read_trace(NamedBytes(f"../camera 3.{suffix}", content))
        assert caught.value.place.startswith(f"../camera 3.{suffix}")


def test_conditions_may_be_a_name_with_bytes():
    trace, meta = NamedBytes("a.csv", b"t,V\n0,3\n1,3\n"), NamedBytes("conditions", json.dumps(FACTS).encode())
    assert read_trace(trace, meta=meta).conditions == read_conditions(meta)[0]
    with pytest.raises(BadValue, match=r"^conditions, key `d_hat`"):
        read_trace(trace, meta=NamedBytes("conditions", json.dumps(FACTS | {"d_hat": -1}).encode()))


def test_what_xarray_writes_is_read(tmp_path):
    trace = _trace()
    trace.to_xarray().to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert _bits(read_trace(tmp_path / "a.nc")) == _bits(trace)


def test_a_dataset_has_the_words_of_the_registry_and_the_conditions():
    data = _trace().to_xarray()
    assert data["V"].dims == ("t",)
    assert (data["V"].attrs["long_name"], data["V"].attrs["scale"]) == ("volume", "R₀³")
    assert data["sigma_V"].attrs["long_name"] == "standard error of the volume"
    assert (data.attrs["kappa"], data.attrs["outcome"]) == (1.3, "contact")


def test_a_batch_becomes_a_dataset_with_its_conditions_as_coordinates():
    times = np.stack([np.arange(4.0), np.arange(4.0) + 1])
    outcome = np.array([0, int(Outcome.CONTACT)])
    batch = Trace(times, {"V": 0 * times + 3}, Reduced(np.array([0.2, 0.1]), 0.9, 1.6), outcome=outcome)
    data = batch.to_xarray()
    assert dict(data.sizes) == {"case": 2, "sample": 4}
    np.testing.assert_array_equal(data["d_hat"], [0.2, 0.1])
    assert data["outcome"].values.tolist() == ["ok", "contact"]
    assert data.attrs["P0_hat"] == 0.9
    with pytest.raises(BadShape, match="one level of the batch"):
        Trace(times[None], {"V": times[None]}).to_xarray()
    with pytest.raises(BadName, match="dimension or coordinate"):
        Trace(times, {"case": times}).to_xarray()


def test_netcdf_and_datasets_name_the_extra_that_is_missing(tmp_path, monkeypatch):
    write_trace(tmp_path / "a.nc", _trace())
    monkeypatch.setitem(__import__("sys").modules, "xarray", None)
    monkeypatch.setitem(__import__("sys").modules, "h5netcdf", None)
    for job in (_trace().to_xarray, lambda: read_trace(tmp_path / "a.nc")):
        with pytest.raises(MissingExtra, match=r"pip install 'jshell\[io\]'"):
            job()


def test_the_files_of_matlab_and_numpy_users_are_read(tmp_path):
    times, volume = np.arange(3.0), np.array([3.0, 3.1, 3.2])
    scipy.io.savemat(tmp_path / "a.mat", {"t": times, "V": volume, **FACTS, "who": "me"}, do_compression=True)
    np.savez_compressed(tmp_path / "a.npz", t=np.arange(3), V=volume.astype(">f4"), **FACTS, who="me")
    for name in ("a.mat", "a.npz"):
        found = read_trace(tmp_path / name)
        np.testing.assert_allclose(found["V"], volume, rtol=1e-7)  # single precision
        assert found.conditions.outer_pressure == 1.6
        assert found.settings == (("who", "me"),)


def test_matlab_units_stand_in_a_text_of_their_own(tmp_path):
    facts = {"R0_m": 2e-3, "d_m": 4e-4, "E_Pa": 1e5, "P0_Pa": 18000, "Pext_Pa": 32000}
    facts |= {"rho_f_kg_m3": 1000, "eta_f_Pa_s": 1e-3}
    columns = {"t": np.arange(3.0), "H": np.full(3, 3.0), "units": "t: ms\nH: mm"}
    scipy.io.savemat(tmp_path / "a.mat", facts | columns)
    np.testing.assert_allclose(read_trace(tmp_path / "a.mat")["H"], 1.5, rtol=1e-15)
    scipy.io.savemat(tmp_path / "b.mat", facts | columns | {"units": "t: ms\nh: mm"})
    with pytest.raises(BadName, match="units of `h`: found a unit of no column"):
        read_trace(tmp_path / "b.mat")


def test_big_endian_matlab_files_and_rows_of_letters_are_read(tmp_path):
    def element(kind, data):
        return np.array([kind, len(data)], ">u4").tobytes() + data + bytes(-len(data) % 8)

    def variable(name, flags, shape, kind, data):
        head = element(6, np.array([flags, 0], ">u4").tobytes()) + element(5, np.array(shape, ">i4").tobytes())
        return element(14, head + element(1, name) + element(kind, data))

    raw = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\0MI"
    raw += variable(b"t", 6, (3, 1), 2, bytes([0, 1, 2]))  # doubles that fit into bytes
    raw += variable(b"V", 6, (1, 3), 9, np.array([3.0, 3.1, 3.2], ">f8").tobytes())
    raw += variable(b"settings", 4, (2, 4), 4, np.array([ord(x) for x in "ab:: 3xy"], ">u2").tobytes())
    (tmp_path / "a.mat").write_bytes(raw)
    found = read_trace(tmp_path / "a.mat")
    np.testing.assert_array_equal(found["V"], [3.0, 3.1, 3.2])
    assert found.settings == (("a", "x"), ("b", "3y"))


def test_semicolons_tabs_and_decimal_commas_change_nothing(tmp_path):
    texts = [
        "t,V,x\n0,3.5,1e3\n0.5,3.25,-2\n",
        "t;V;x\n0;3,5;1e3\n0,5;3,25;-2\n",
        "x\tt\tV\n1e3\t0\t3,5\n-2\t0,5\t3,25\n",
    ]
    texts += [text.replace("\n", ends) for text in texts[:2] for ends in ("\r\n", "\r")] + ["\ufeff" + texts[1]]
    for text in texts:
        (tmp_path / "a.csv").write_bytes(text.encode())
        found = read_trace(tmp_path / "a.csv")
        np.testing.assert_array_equal(found.times, [0, 0.5])
        np.testing.assert_array_equal(found["V"], [3.5, 3.25])
        np.testing.assert_array_equal(found["x"], [1e3, -2])


MIXED = [
    ("marks", "t;V\n0,5;3,5\n1,5;3.4\n", BadFile, "row 3, column `V`: found '3.4', while the numbers above have `,`"),
    ("marks turned", "t;V\n0.5;3.5\n1.5;3,4\n", BadFile, "row 3, column `V`: found '3,4'"),
    ("thousands alone", "t;V\n0,5;3,5\n1.000;3,4\n", BadFile, "row 3, column `t`: found '1.000'"),
    ("separators in the names", "t;V,S\n0;3;12\n", BadFile, "row 1: found commas and semicolons between the names"),
    ("separators below", "t,V\n0,3\n1;3\n", BadFile, "row 3: found 1 cells; .* separated by commas"),
    (
        "comma columns",
        "t,V\n0,5,3,5\n1,5,3,4\n",
        BadFile,
        "row 1: found 2 names over 4 .* Commas used as decimal points",
    ),
    ("header", "# d_hat: 0,22\nt;V\n0;3\n1;3\n", BadValue, "row 1, key `d_hat`: .* headers have no decimal commas"),
    ("utf-16", "t,V\n0,3\n1,3\n".encode("utf-16")[:-1], BadFile, "UTF-16 .*breaks off; .* save it as CSV in UTF-8"),
    ("utf-32", "t,V\n0,3\n1,3\n".encode("utf-32"), BadFile, "save it as CSV in UTF-8"),
    ("latin", "t [µs]\n".encode("latin-1"), BadFile, "no rows below the column row 1"),
    ("letters", b"t,V\n" + bytes(range(0xC0, 0x100)), BadFile, "row 2: found byte 0xc0"),
    ("blank", " \n\n", BadFile, "an empty file"),
    ("long line", "x" * 200_001, BadFile, "a line of more than"),
]


ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252")


@pytest.mark.parametrize("codec", ENCODINGS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_table_is_the_same_in_every_encoding_that_windows_writes(tmp_path, codec, end):
    lines = [
        "Gerät;Kamera in Kühlraum",
        "t [µs];H [µm]",
        *(f"{k},5;{40 + k / 7:.4f}".replace(".", ",") for k in range(40)),
    ]
    (tmp_path / "a.csv").write_bytes(end.join(lines).encode(codec))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = read_trace(tmp_path / "a.csv")
    np.testing.assert_allclose(found.times, 1e-6 * (np.arange(40) + 0.5))
    np.testing.assert_allclose(found["H"], 1e-6 * np.round(40 + np.arange(40) / 7, 4))
    words = " ".join(str(one.message) for one in caught)
    name = "" if codec.startswith("utf-8") else "UTF-16" if codec.startswith("utf-16") else "Windows-1252"
    assert ("the text is" in words) == bool(name)
    assert name in words


@pytest.mark.parametrize(("text", "kind", "match"), [row[1:] for row in MIXED], ids=[row[0] for row in MIXED])
def test_mixed_text_is_refused_at_its_place(tmp_path, text, kind, match):
    (tmp_path / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(kind, match=match):
        read_trace(tmp_path / "a.csv")


def _columns(**columns):
    return json.dumps({"columns": {"t": [0, 1], **columns}})


OBJECTS = [
    ("list", "[1, 2]", BadFile, "a JSON list"),
    ("syntax", '{"columns": {"t": [0, 1],}}', BadFile, "row 1, position"),
    ("no columns", "{}", BadFile, "key `columns`: found no JSON object"),
    ("other columns", '{"columns": [1]}', BadFile, "another value"),
    ("twice", '{"columns": {"t": [0, 1], "V": [3, 3], "V": [3, 3]}}', BadFile, "column `V`: found the name twice"),
    ("word", _columns(V=[3, "x"]), BadFile, "row 2, column `V`: found '\"x\"'"),
    ("truth", _columns(V=[3, True]), BadFile, "row 2, column `V`: found 'true'"),
    ("null", _columns(V=[None, 3]), BadFile, "row 1, column `V`: found 'null'"),
    ("nan", _columns(V=[3, np.nan]), BadValue, "row 2, column `V`: found nan"),
    ("large", _columns(V=[3, 10**400]), BadValue, "row 2, column `V`: .* a finite number"),
    ("number", _columns(V=3), BadFile, "column `V`: found '3'; expected a list"),
    ("short", _columns(V=[3]), BadFile, "column `V`: found 1 rows; expected 2, as in column `t`"),
    ("empty", '{"columns": {"t": [], "V": []}}', BadFile, "column `t`: found no rows"),
    ("half a letter", '{"note": "\\ud800", "columns": {"t": [0, 1], "V": [3, 3]}}', BadFile, "surrogates"),
    ("unit", _columns(**{"V [mm^3]": [3, 3]}), BadUnits, "column `t`: found no unit"),
]


@pytest.mark.parametrize(("text", "kind", "match"), [row[1:] for row in OBJECTS], ids=[row[0] for row in OBJECTS])
def test_a_wrong_object_is_refused_at_its_place(tmp_path, text, kind, match):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(kind, match=match):
        read_trace(tmp_path / "a.json")


ARRAYS = [
    ("pickles", {"t": np.array([0, 1], object)}, BadFile, "array `t`: found an array of objects"),
    ("truths", {"t": np.array([True, False])}, BadFile, "an array of truth values"),
    ("complex", {"t": np.array([0, 1j])}, BadFile, "an array of complex numbers"),
    ("dates", {"t": np.array(["2020-01-01"], "M8[D]")}, BadFile, "an array of dates"),
    ("words", {"t": np.array(["0", "1"])}, BadName, "no columns; expected a column `t`"),
    ("matrix", {"t": np.zeros((2, 2))}, BadFile, r"an array of shape \(2, 2\)"),
    ("nan", {"t": np.array([0, 1.0]), "V": np.array([3, np.nan])}, BadValue, "row 2, column `V`: found nan"),
    ("lengths", {"t": np.array([0, 1.0]), "V": np.ones(3)}, BadFile, "column `V`: found 3 rows; expected 2"),
    ("no rows", {"t": np.zeros(0), "V": np.zeros(0)}, BadFile, "column `t`: found no rows"),
    ("twice", {"t": np.arange(2), "V": np.ones(2), "V [-]": np.ones(2)}, BadFile, "the name twice"),
    ("time", {"t": np.array([0, 0]), "V": np.ones(2)}, BadValue, "row 2, column `t`: found t = 0 after 0"),
    ("volume", {"t": np.array([0, 1]), "V": np.full(2, 5)}, BadValue, "row 1, column `V`: found V = 5"),
]


@pytest.mark.parametrize(("arrays", "kind", "match"), [row[1:] for row in ARRAYS], ids=[row[0] for row in ARRAYS])
def test_a_wrong_archive_is_refused_at_its_place(tmp_path, arrays, kind, match):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(kind, match=match):
        read_trace(tmp_path / "a.npz")


def test_a_claim_of_gigabytes_is_refused_before_memory_is_asked_for(tmp_path):
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (%d,)}"

    def claim(count, zeros):
        with (
            zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open("t.npy", "w") as file,
        ):
            text = (header % count).ljust(117) + "\n"
            file.write(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + bytes(zeros))

    claim(2**28, 64)
    with pytest.raises(BadFile, match=r"array `t`: found 2 GiB; expected at most 0\.5 GiB"):
        read_trace(tmp_path / "a.npz")
    claim(2**20, 64)
    with pytest.raises(BadFile, match="holds 64 bytes for a claim of 8388608"):
        read_trace(tmp_path / "a.npz")
    raw = bytearray((tmp_path / "a.npz").read_bytes())
    at = raw.index(b"PK\x01\x02") + 24  # the size after unpacking, in the list of members
    raw[at : at + 4] = (2**31).to_bytes(4, "little")
    (tmp_path / "a.npz").write_bytes(raw)
    with pytest.raises(BadFile, match="found 2 GiB"):
        read_trace(tmp_path / "a.npz")

    import h5py

    with h5py.File(tmp_path / "a.nc", "w") as file:  # nothing is stored, all is fill value
        file.create_dataset("t", (2**28,), "f8", chunks=(2**20,))
    with pytest.raises(BadFile, match="variable `t`: found 2 GiB"):
        read_trace(tmp_path / "a.nc")

    with (tmp_path / "a.csv").open("wb") as file:
        file.truncate(LIMIT + 1)
    with pytest.raises(BadFile, match=r"found 0\.5 GiB"):
        read_trace(tmp_path / "a.csv")


def test_netcdf_that_hides_its_numbers_is_refused(tmp_path):
    import h5py

    def refused(match, build):
        with h5py.File(tmp_path / "a.nc", "w") as file:
            file["t"] = np.arange(3.0)
            build(file)
        with pytest.raises(BadFile, match=match):
            read_trace(tmp_path / "a.nc")

    def packed(file):
        file["V"] = np.arange(3)
        file["V"].attrs["scale_factor"] = 0.1

    def filled(file):
        file["V"] = np.array([3.0, -999.0, 3.0])
        file["V"].attrs["_FillValue"] = -999.0

    def elsewhere(file):
        file["V"] = h5py.ExternalLink("b.nc", "V")

    def outside(file):
        file.create_dataset("V", (3,), "f8", external=[(str(tmp_path / "b.raw"), 0, 24)])

    refused("attribute `scale_factor`: found packed numbers", packed)
    refused(r"rows that are missing \(-999", filled)
    refused("a group, or a link to elsewhere", elsewhere)
    refused("a group, or a link to elsewhere", outside)
    refused("a group, or a link to elsewhere", lambda file: file.create_group("V"))


def test_cells_and_other_versions_of_matlab_are_refused(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t": np.arange(3.0), "info": np.array([1, "a"], object)})
    with pytest.raises(BadFile, match="variable `info`: found an array of objects"):
        read_trace(tmp_path / "a.mat")
    scipy.io.savemat(tmp_path / "a.mat", {"t": np.arange(3.0)}, format="4")
    with pytest.raises(BadFile, match=r"version 7\.3 or 4.*-v7"):
        read_trace(tmp_path / "a.mat")


def test_a_file_under_the_wrong_suffix_says_what_it_is(tmp_path):
    for suffix, words in (("nc", "HDF5"), ("mat", "MATLAB"), ("npz", "zip archive")):
        write_trace(tmp_path / f"a.{suffix}", _trace())
        (tmp_path / f"a.{suffix}").rename(tmp_path / f"{suffix}.csv")
        with pytest.raises(BadFile, match=words):
            read_trace(tmp_path / f"{suffix}.csv")
    for suffix in ("nc", "mat", "npz", "json"):
        (tmp_path / f"text.{suffix}").write_text("t,V\n0,3\n1,3\n")
        with pytest.raises(BadFile, match=f"text.{suffix}"):
            read_trace(tmp_path / f"text.{suffix}")


def test_pipes_devices_and_forbidden_files_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", "/dev/zero"):
        with pytest.raises(BadFile, match="a pipe or a device"):
            read_trace(path)
    for suffix in ALL:
        (tmp_path / f"empty.{suffix}").touch()
        with pytest.raises(BadFile, match="an empty file"):
            read_trace(tmp_path / f"empty.{suffix}")
        (tmp_path / f"folder.{suffix}").mkdir()
        with pytest.raises(BadFile, match="a directory"):
            read_trace(tmp_path / f"folder.{suffix}")
        with pytest.raises(BadFile, match=r"[Dd]irectory|folder"):
            write_trace(tmp_path / f"folder.{suffix}", _trace())


def test_a_file_without_permission_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("t,V\n0,3\n1,3\n")
    path.chmod(0)
    if os.geteuid() == 0:  # the superuser may read everything: say no in the system's stead

        def denied(*_, **__):
            raise PermissionError(13, "Permission denied", str(path))

        monkeypatch.setattr(type(path), "open", denied)
    with pytest.raises(BadFile, match=r"Permission denied.*Check name and permissions"):
        read_trace(path)


@pytest.mark.parametrize(
    ("suffix", "trace", "match"),
    [
        ("h5", _trace(), "suffix .h5; expected one of .csv"),
        ("mat", Trace(np.arange(2.0), {"a b": np.ones(2)}), ".mat files cannot hold"),
        ("mat", Trace(np.arange(2.0), {"d_hat": np.ones(2)}), ".mat files cannot hold"),
        ("npz", Trace(np.arange(2.0), {"settings": np.ones(2)}), ".npz files cannot hold"),
        ("nc", Trace(np.arange(2.0), {"a/b": np.ones(2)}), ".nc files cannot hold"),
        ("json", Trace(np.arange(2.0), {"a": np.ones(2)}, settings=(("columns", "2"),)), "setting 'columns'"),
        ("json", Trace(np.arange(2.0), {"a": np.ones(2)}, settings=(("a", "1"), ("a", "2"))), "setting 'a'"),
        ("csv", Trace(np.arange(2.0), {"a": np.ones(2)}, settings=(("a", "\ud800"),)), "setting 'a'"),
        ("csv", Trace(np.arange(2.0), {"a;b": np.ones(2)}), "cannot hold"),
    ],
)
def test_what_a_format_cannot_hold_is_not_written(tmp_path, suffix, trace, match):
    with pytest.raises(BadName, match=match):
        write_trace(tmp_path / f"a.{suffix}", trace)
    assert not (tmp_path / f"a.{suffix}").exists()


def test_a_table_is_read_from_any_format(tmp_path):
    columns = {"P0_hat": [0.9, 1.0], "omega_minus": [1.5, 1.4]}
    (tmp_path / "a.json").write_text(json.dumps({"columns": columns}))
    np.savez(tmp_path / "a.npz", **columns)
    for name in ("a.json", "a.npz"):
        found = read_table(tmp_path / name, ("P0_hat", "omega_minus"), ())
        assert {key: values.tolist() for key, values in found.items()} == columns

"""Files of every format, spoiled at random: each is read as a sound trace or refused in words, soon."""

import io
import time
import warnings
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from jshell import Reduced, Trace
from jshell.errors import BadFile, GuessWarning, JshellError, RangeWarning
from jshell.io import read_trace, write_trace
from jshell.shell import Scales

QUICK, SLOW = 300, 20_000  # files, over all formats
LONGEST = 10.0  # seconds that a reader may take for one of them
FORMATS = ("csv", "semicolon.csv", "tsv", "json", "nc", "mat", "packed.mat", "npz", "inside.npz")
PIECES = [b",", b"\n", b"#", b"# ", b":", b";", b"\t", b"[", b"]", b"{", b"}", b"-", b"e9", b"nan", b"NaN", b"Infinity"]
PIECES += [b"\xff", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0", b"\0\0\0\0", b"\r", b'"', b" ", b"_", b"V", b"t"]
PIECES += [b"1e999", b"9" * 400, b"\xef\xbb\xbf", b"\x0e\0\0\0", b"\x0f\0\0\0", b"[ms]", b"[m^99]", b"[Hz]", b"true"]
SPREAD = st.randoms(use_true_random=False).map(lambda random: random.random())  # as likely anywhere
MUTATION = st.tuples(
    st.floats(0, 1) | SPREAD, st.integers(0, 6), st.one_of(st.sampled_from(PIECES), st.binary(max_size=3))
)


def _seed(folder, name):
    """A sound file, in SI where the format is text."""
    times = np.linspace(0, 20, 12)
    channels = {"V": 3.5 + 0.1 * np.sin(times), "S": 12 + 0 * times, "mine": np.cos(times)}
    conditions = Reduced(0.22, 0.9, 1.6, 0.004)
    trace = Trace(times, channels, conditions, {"V": 0 * times + 0.1}, 0, (("note", "a"),), Scales(2e-3, 2e4, 1e3))
    path = folder / name
    write_trace(path, trace, "si" if name.endswith(("csv", "json")) else "reduced")
    if name == "semicolon.csv":
        lines = path.read_text().replace(",", ";").split("\n")
        path.write_text("\n".join(line if line.startswith("#") else line.replace(".", ",") for line in lines))
    if name == "packed.mat":
        import scipy.io

        plain = {key: value for key, value in scipy.io.loadmat(path).items() if not key.startswith("_")}
        scipy.io.savemat(path, plain, do_compression=True)
    return path.read_bytes()


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seeds")
    return {name: _seed(folder, name) for name in FORMATS}


def _spoil(raw, mutations):
    for place, removed, inserted in mutations:
        start = int(place * len(raw))
        raw = raw[:start] + inserted + raw[start + removed :]
    return raw


def _spoil_inside(raw, mutations):
    """The arrays of an archive spoiled, under check sums that are right."""
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as source, zipfile.ZipFile(packed, "w") as target:
        for at, member in enumerate(source.infolist()):
            content = source.read(member)
            target.writestr(member.filename, _spoil(content, mutations[at % len(mutations) :][:1]))
    return packed.getvalue()


def _read_or_refuse(path, raw):
    path.write_bytes(raw)
    began, refusal, found = time.perf_counter(), None, None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RangeWarning)
            warnings.simplefilter("ignore", GuessWarning)  # said, such as that the text is Latin-1
            found = read_trace(path)
    except JshellError as error:
        refusal = error
    assert time.perf_counter() - began < LONGEST
    if refusal is not None:
        assert all(refusal.record().values())
        assert str(path) in refusal.place
    else:
        assert np.all(np.diff(found.times) > 0)
        assert all(values.dtype == np.float64 for values in found.channels.values())
        assert all(np.all(np.isfinite(values)) for values in (*found.channels.values(), *found.sigma.values()))


def _try_many(count, name, raw, folder):
    spoil = _spoil_inside if name == "inside.npz" else _spoil

    @settings(max_examples=count, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
    @given(st.lists(MUTATION, min_size=1, max_size=4))
    @example([(0.0, 0, b"")])
    def one(mutations):
        _read_or_refuse(folder / f"spoiled.{name}", spoil(raw, mutations))

    one()


def test_the_seeds_are_sound(seeds, tmp_path):
    for name, raw in seeds.items():
        (tmp_path / name).write_bytes(raw)
        assert read_trace(tmp_path / name).times.size == 12


@pytest.mark.parametrize("name", FORMATS)
def test_a_spoiled_file_is_read_or_refused_but_never_crashes(seeds, tmp_path, name):
    _try_many(QUICK // len(FORMATS) + 1, name, seeds[name], tmp_path)


WIDE = ",".join(f"c{number}" for number in range(20_000))
LONG = [  # what a pattern, a search or a list that is not careful would take hours for
    ("name", "csv", "t" + " " * 190_000 + "]V\n0,1\n"),
    ("brackets", "csv", "t,V " + "[" * 190_000 + "\n0,1\n"),
    ("digits", "csv", "t,V\n0,1\n1," + "1" * 2_000_000 + "x\n"),
    ("key", "csv", "# " + "a" * 190_000 + "\nt,V\n0,1\n"),
    ("number", "csv", "# d_hat: " + "1" * 190_000 + "x\nt,V\n0,1\n"),
    ("unit", "csv", "t [s],V [" + "m*" * 90_000 + "m]\n0,1\n1,1\n"),
    ("names", "csv", f"{WIDE},c1\n0,1\n"),
    ("no time", "csv", f"{WIDE}\n0,1\n"),
    ("comments", "csv", "#\n" * 500_000 + "t,V\n0,1\n"),
    ("depth", "json", '{"columns": ' * 50_000),
    ("digits in JSON", "json", '{"columns": {"t": [0, ' + "1" * 1_000_000 + "]}}"),
]


@pytest.mark.parametrize(("name", "text"), [row[1:] for row in LONG], ids=[row[0] for row in LONG])
def test_a_long_piece_is_refused_soon_and_in_few_words(tmp_path, name, text):
    (tmp_path / f"a.{name}").write_text(text)
    began = time.perf_counter()
    with pytest.raises(JshellError) as caught:
        read_trace(tmp_path / f"a.{name}")
    assert time.perf_counter() - began < LONGEST
    assert len(str(caught.value)) < 2_000


def test_a_compressed_file_is_refused_before_all_of_it_is_unpacked(tmp_path, monkeypatch):
    from jshell.io import files, matlab

    monkeypatch.setattr(files, "LIMIT", 2**20)
    monkeypatch.setattr(matlab, "LIMIT", 2**20)
    data = zlib.compress(bytes(2**26), 1)
    raw = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + np.array([15, len(data)], "<u4").tobytes() + data
    (tmp_path / "a.mat").write_bytes(raw)
    with pytest.raises(BadFile, match=r"found 0\.000977 GiB; expected at most"):  # unpacked to the limit and a byte
        read_trace(tmp_path / "a.mat")


@pytest.mark.parametrize(
    "element",
    [(15, zlib.compress(b"")), (14, b""), (14, np.array([6, 8, 6, 0], "<u4").tobytes())],
    ids=["compressed nothing", "a variable of nothing", "a variable that ends after its flags"],
)
def test_a_mat_file_that_ends_where_an_element_should_stand_is_refused(tmp_path, element):
    kind, data = element
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM"
    (tmp_path / "a.mat").write_bytes(head + np.array([kind, len(data)], "<u4").tobytes() + data)
    with pytest.raises(BadFile, match="nothing where an element should stand"):
        read_trace(tmp_path / "a.mat")


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_twenty_thousand_spoiled_files_are_read_or_refused(seeds, tmp_path, name):
    _try_many(SLOW // len(FORMATS) + 1, name, seeds[name], tmp_path)

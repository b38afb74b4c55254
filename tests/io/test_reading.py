"""What a file leaves open: said by its reader, or taken for what it most likely is, and told; never silently."""

import json

import numpy as np
import pytest

from jshell import Reduced, Trace
from jshell.errors import BadFile, BadName, BadUnits, BadValue, GuessWarning
from jshell.files import NamedBytes
from jshell.io import Reading, encode_trace, read_trace
from jshell.io.clock import even_stamps
from jshell.io.columns import SECONDS
from jshell.shell import Scales

REDUCED = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.6\n"
SI = (
    "# R0_m: 2e-3\n# d_m: 4e-4\n# E_Pa: 1e5\n# P0_Pa: 18000\n# Pext_Pa: 32000\n"
    "# rho_f_kg_m3: 1000\n# eta_f_Pa_s: 1e-3\n"
)


def _file(text, name="a.csv"):
    return NamedBytes(name, text.encode())


PLAIN = [  # other spellings of t 0, 0.5, 1 and V 3.5, 3.25, 3.4
    '"t","V"\n"0","3.5"\n"0.5","3.25"\n"1","3.4"\n',
    "sep=;\nt;V\n0;3,5\n0,5;3,25\n1;3,4\n",
    "t,V,,\n0,3.5,,\n0.5,3.25,,\n1,3.4,,\n",
    "t V\n0 3.5\n0.5    3.25\n 1 3.4\n",
    "t\tV\r\n0\t3.5\r\n0.5\t3.25\r\n1\t3.4\r\n",
    "t|V\n0|3.5\n0.5|3.25\n1|3.4\n",
    't;V\n"0";"3,5"\n"0,5";"3,25"\n"1";"3,4"\n',
    '"t","V"\n"0","3,5"\n"0,5","3,25"\n"1","3,4"\n',
    "Recorded by me, in a hurry\n\nGain,3\n\nt,V\n0,3.5\n0.5,3.25\n1,3.4\n",
]


@pytest.mark.parametrize("text", PLAIN)
def test_the_numbers_decide_where_the_table_begins(text):
    found = read_trace(_file(text))
    np.testing.assert_array_equal(found.times, [0, 0.5, 1])
    np.testing.assert_array_equal(found["V"], [3.5, 3.25, 3.4])


@pytest.mark.parametrize(
    "names", ["t [ms],V [mm^3]", "t (ms),V (mm3)", '"t, ms","V, mm³"', "t / ms,V in mm3", "t_ms,V_mm3"]
)
def test_units_stand_in_any_brackets_or_behind(names):
    rows = "0,28\n1,27\n"
    unit = np.sqrt(1000 * 8e-9 / (1e5 * 4e-4))  # by hand: sqrt(ρ R0³/(E d))
    with pytest.warns(GuessWarning) if "_" in names else _silence():
        found = read_trace(_file(SI + names + "\n" + rows))
    np.testing.assert_allclose(found.times, [0, 1e-3 / unit], rtol=1e-14)
    np.testing.assert_allclose(found["V"], [3.5, 27 / 8], rtol=1e-14)


def _silence():
    import contextlib

    return contextlib.nullcontext()


def test_units_may_fill_a_row_of_their_own_and_words_a_column():
    text = SI + "t,who,V\n(ms),,(mm^3)\n0,me,28\n1,you,27\n"
    with pytest.warns(GuessWarning, match="column `who` of words"):
        assert list(read_trace(_file(text)).channels) == ["V"]


SETTLED = [  # a file that is refused, what its refusal must name, and the words that it names, followed
    ("0,3.5\n1,3.4\n", "--columns t=1,V=2", {"columns": "t=1,V=2"}),
    ("T,V\n0,3.5\n1,3.4\n", "--columns t=T", {"columns": "t=T"}),
    ("x,V\n0,3.5\n1,3.4\n", "--columns t=NAME", {"columns": {"t": "x"}}),
    ("x,V\n0,3.5\n1,3.4\n", "--rate 1000", {"rate": 1}),
    ("n,V\n0,3.5\n1,3.4\n", "--columns t=NAME", {"time_from": "n"}),
    ("t,V\n0,3.5\n1,3.4\nmean,3.45\n", "--rows :3", {"rows": ":3"}),
    ("t,V\n0,3.5\n1,3.4\n0,3.5\n1,3.4\n", "--rows :3", {"rows": ":3"}),
    ("t,V\n0,3.5\n1,3.4\n0,3.5\n1,3.4\n", "--rows 4:", {"rows": "4:"}),
    ("t,V\n0,3.5\n1,3.4\n2,\n", "--missing drop", {"missing": "drop"}),
    ("t,V\n0,3.5\n1,3.4\n2,inf\n", "--missing drop", {"missing": "drop"}),
    (REDUCED + "t [s],V [V]\n0,3.5\n1,3.4\n", "--units t=-", {"units": "t=-,V=-"}),
    ("t [s],V [V]\n0,3.5\n1,3.4\n", "--columns signal=V", {"columns": "signal=V"}),
    ("t,H [mm]\n0,3.5\n1,3.4\n", "--units t=s", {"units": "t=s"}),
    ("time,timestamp,V\n0,5,3.5\n1,6,3.4\n", "--columns t=1", {"columns": "t=1"}),
    ("a,b,c\n0,3.5\n1,3.4\n", "--columns t=1,V=2", {"columns": "t=1,V=2"}),
    ("t,V,V\n0,3.5,1\n1,3.4,1\n", "Rename or remove", {"columns": "V=2"}),
]


@pytest.mark.parametrize(("text", "words", "said"), SETTLED)
@pytest.mark.filterwarnings("ignore::jshell.errors.GuessWarning")
def test_a_refusal_names_a_remedy_that_works_when_it_is_followed(text, words, said):
    with pytest.raises((BadFile, BadName, BadValue, BadUnits)) as caught:
        read_trace(_file(text))
    assert words in caught.value.remedy
    found = read_trace(_file(text), **said)
    np.testing.assert_allclose(found.times, [0, 1])
    values = list(found.channels.values())[-1]
    np.testing.assert_allclose(values[1] / values[0], 3.4 / 3.5)


@pytest.mark.parametrize(
    ("said", "kind", "match"),
    [
        ({"columns": "t"}, BadValue, "columns: found 't'"),
        ({"columns": "t=1,H=1"}, BadName, "'1' for two names"),
        ({"columns": "H=9"}, BadName, "no such column of numbers .* 1 `t`, 2 `V`"),
        ({"units": "H=mm"}, BadName, "units, H: found a unit of no column"),
        ({"rate": -1}, BadValue, "rate: found -1"),
        ({"rate": 5, "units": "t=ms"}, BadUnits, "ms beside a rate"),
        ({"rows": "a:b"}, BadValue, "rows: found 'a:b'"),
        ({"rows": "9:3"}, BadValue, "rows: found 9 to 3"),
        ({"rows": "77:"}, BadFile, "no complete row"),
        # whole numbers that meet C, and digits that are none of a number
        ({"rows": (1, 10**20)}, BadValue, "rows: found 1 to 1000"),
        ({"rows": f"{2**63}:"}, BadValue, "rows: found 9223"),
        ({"rows": "1:" + "9" * 5000}, BadValue, "rows: found '1:999"),
        ({"rows": "1:²"}, BadValue, "rows: found '1:²'"),
        ({"columns": "t=1,V=²"}, BadName, "no such column"),
        ({"columns": "t=1,V=" + "9" * 5000}, BadName, "no such column"),
        ({"missing": "guess"}, BadName, "no such missing"),
        ({"colums": "t=1"}, BadName, "no such field"),
    ],
)
def test_what_is_said_wrongly_is_refused(said, kind, match):
    with pytest.raises(kind, match=match):
        read_trace(_file("t,V\n0,3.5\n1,3.4\n"), **said)


def test_frames_that_skip_are_counted_only_where_the_reader_says_so():
    text = "frame,H\n3,3.5\n4,3.4\n7,3.3\n"
    with pytest.raises(BadValue, match="frames that skip"):
        read_trace(_file(text), rate=100)
    with pytest.warns(GuessWarning, match="frames of column `frame`"):
        np.testing.assert_allclose(read_trace(_file(text), rate=100, time_from="frame").times, [0, 0.01, 0.04])
    with pytest.warns(GuessWarning, match="times from rows"):
        np.testing.assert_allclose(read_trace(_file(text), rate=100, time_from="rows").times, [0, 0.01, 0.02])


@pytest.mark.parametrize(("digits", "step"), [(2, 1.25e-3), (3, 4e-4)])
def test_stamps_that_rounding_repeats_are_seen_as_such(digits, step):
    times = np.arange(400) * step
    stamps = np.array([float(f"{t:.{digits}f}") for t in times])
    np.testing.assert_allclose(even_stamps(stamps), times, atol=1e-12)
    rows = "".join(f"{t},{3 + 1e-3 * k}\n" for k, t in enumerate(stamps))
    with pytest.warns(GuessWarning, match="stamps repeat: they were rounded"):
        np.testing.assert_allclose(read_trace(_file("t [s],H [mm]\n" + rows)).times, times, atol=1e-12)


def test_stamps_that_repeat_for_another_reason_are_refused():
    stamps = np.sort(np.r_[np.arange(100), 50.0])  # one row twice
    rows = "".join(f"{t},3\n" for t in stamps)
    assert even_stamps(stamps) is None
    with pytest.raises(BadValue, match="t = 50 after 50"):
        read_trace(_file("t,H\n" + rows))


def test_a_record_without_conditions_stays_in_si_and_comes_back(tmp_path):
    found = read_trace(_file("t [ms],H [mm],CH1 [mV]\n0,3,1\n1,2,5\n"))
    assert found.scales == SECONDS
    for suffix in ("csv", "json", "npz", "mat", "nc"):
        again = read_trace(encode_trace(f"a.{suffix}", found))
        np.testing.assert_allclose(again.times, [0, 1e-3], rtol=1e-14)
        np.testing.assert_allclose(again["H"], [3e-3, 2e-3], rtol=1e-14)
        assert again.scales == SECONDS
        assert dict(again.settings) == {"channel_units": "CH1: mV"}


def test_a_frame_of_pandas_is_read_by_the_rules_of_files():
    pandas = pytest.importorskip("pandas", reason="no pandas: pip install pandas")
    frame = pandas.DataFrame({"H [mm]": [3.0, 2.0], "who": ["a", "b"]}, index=pandas.to_timedelta([0, 1], "ms"))
    with pytest.warns(GuessWarning, match="`who` of words"):
        found = Trace.from_pandas(frame)
    np.testing.assert_allclose(found.times, [0, 1e-3])
    np.testing.assert_allclose(found["H"], [3e-3, 2e-3])
    bare = pandas.DataFrame({"t": [0.0, 1.0], "V": [3.5, 3.4]})
    problem = Reduced(0.22, 0.9, 1.6)
    assert Trace.from_pandas(bare, conditions=problem).conditions.outer_pressure == 1.6
    with pytest.raises(BadName, match="a column `t`"):
        Trace.from_pandas(bare, columns="V=V,S=t").times  # noqa: B018


def test_what_became_a_dataset_comes_back():
    times = np.arange(20) * 0.1
    problem = Reduced(0.22, 0.9, 1.6, 0.004)
    trace = Trace(times, {"V": 3 + 0.1 * np.sin(times)}, problem, {"V": 0.01 + 0 * times}, settings=(("a", "b"),))
    again = Trace.from_xarray(trace.to_xarray())
    np.testing.assert_array_equal(again["V"], trace["V"])
    np.testing.assert_array_equal(again.sigma["V"], trace.sigma["V"])
    assert again.conditions.viscosity == 0.004
    assert again.settings == trace.settings
    data = trace.to_xarray().rename(t="when").drop_attrs(deep=False)
    with pytest.warns(GuessWarning, match="`when`, which the others lie along"):
        assert Trace.from_xarray(data, conditions=problem, scales=Scales(2e-3, 1e4, 1e3)).times.size == 20


def test_structures_of_matlab_are_read_by_their_fields(tmp_path):
    import scipy.io

    scope = {"time": np.arange(5.0), "signals": {"values": np.arange(10.0).reshape(5, 2), "label": "x"}, "n": 5.0}
    scipy.io.savemat(tmp_path / "a.mat", {"ScopeData": scope})
    with pytest.warns(GuessWarning, match="`time` taken for `t`"):
        found = read_trace(tmp_path / "a.mat")
    np.testing.assert_array_equal(found["signals.values.1"], [0, 2, 4, 6, 8])
    np.testing.assert_array_equal(found["signals.values.2"], [1, 3, 5, 7, 9])
    assert dict(found.settings)["signals.label"] == "x"


def test_choices_are_one_record_for_python_terminal_and_service():
    said = {"columns": {"t": "Time (s)", "H": "3"}, "units": {"H": "mm"}, "rate": 1000, "rows": [3, None]}
    found = Reading.from_record(json.loads(json.dumps(said)))
    assert found == Reading.of("t=Time (s),H=3", "H=mm", 1000, rows="3:")

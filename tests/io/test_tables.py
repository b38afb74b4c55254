"""Traces and tables in files: what is written comes back, what is wrong is refused at its place."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadFile, BadName, BadShape, BadUnits, BadValue, Outcome
from jshell.io import read_conditions, read_table, read_trace, write_trace
from jshell.io.text import STRETCH
from jshell.quantities import UNITS
from jshell.shell import Reduced, Scales
from jshell.trace import Trace

REDUCED = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.6\n# eta_hat: 0.004\n"
SI = (
    "# R0_m: 2e-3\n# d_m: 4e-4\n# E_Pa: 1e5\n# P0_Pa: 18000\n# Pext_Pa: 32000\n"
    "# rho_f_kg_m3: 1000\n# eta_f_Pa_s: 1e-3\n# kappa: 1.3\n# nu: 0.45\n"
)
# By hand from the definitions: R0 = 2 mm, E d/R0 = 2e4 Pa, time sqrt(ρ R0³/(E d)), viscosity sqrt(E d ρ R0).
SI_TIME = np.sqrt(1000 * 8e-9 / (1e5 * 4e-4))
SI_PROBLEM = Reduced(0.2, 0.9, 1.6, 1e-3 / np.sqrt(1e5 * 4e-4 * 1000 * 2e-3), 1.3, 0.45)
GOOD = REDUCED + "t,V,S,H,W\n0,3.5,11.9,1.1,1.2\n0.1,3.4,11.8,1.0,1.2\n0.2,3.3,11.8,0.9,1.2\n"
FIELDS = ("thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio")


def _write(folder, text, name="trace.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _same(found, expected, rtol=1e-15):
    for name in FIELDS:
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=rtol)


def _trace(scales=None):
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.01, 0.1, 50))
    volume = 3.5 + 0.1 * np.sin(times)
    channels = {"V": volume, "S": 11.9 + 0.01 * np.cos(times), "P": rng.uniform(1, 2, 50), "mine": rng.normal(size=50)}
    problem = Reduced(0.1 + 0.2 / 3, 0.9, 1.6, 0.004 / 3, 1.3, 0.45)
    made = (("solver", "Kvaerno5"), ("note", "a: b, c"), ("seed", "3"))
    return Trace(times, channels, problem, {"V": 0.01 * volume}, int(Outcome.CONTACT), made, scales)


def _assert_equal(found, expected, time_rtol):
    np.testing.assert_allclose(found.times, expected.times, rtol=time_rtol)
    assert list(found.channels) == list(expected.channels)
    assert list(found.sigma) == list(expected.sigma)
    for name in expected.channels:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-11)  # twelve digits are written
    np.testing.assert_allclose(found.sigma["V"], expected.sigma["V"], rtol=1e-11)
    assert found.outcome == expected.outcome
    assert found.settings == expected.settings


def test_a_reduced_file_brings_a_trace_back(tmp_path):
    trace = _trace()
    write_trace(tmp_path / "a.csv", trace)
    found = read_trace(tmp_path / "a.csv")
    _assert_equal(found, trace, time_rtol=0)
    _same(found.conditions, trace.conditions, rtol=0)
    assert found.scales is None


def test_an_si_file_brings_a_trace_and_its_scales_back(tmp_path):
    trace = _trace(Scales(2.3e-3, 1.9e4, 998.0))
    write_trace(tmp_path / "a.csv", trace, units="si")
    text = (tmp_path / "a.csv").read_text()
    assert "t [s],V [m^3],S [m^2],P [Pa],mine [-],sigma_V [m^3]" in text
    found = read_trace(tmp_path / "a.csv")
    _assert_equal(found, trace, time_rtol=1e-15)
    _same(found.conditions, trace.conditions)
    for name in ("length", "pressure", "density"):
        np.testing.assert_allclose(getattr(found.scales, name), getattr(trace.scales, name), rtol=1e-15)


def test_a_trace_without_conditions_comes_back_without_them(tmp_path):
    trace = Trace(np.arange(3.0), {"V": np.array([3.0, 3.1, 3.2])})
    write_trace(tmp_path / "a.csv", trace)
    found = read_trace(tmp_path / "a.csv")
    assert found.conditions is None
    assert found.settings == ()
    assert found.outcome == Outcome.OK


def test_the_long_columns_of_a_run_stay_small_on_disk(tmp_path):
    rng = np.random.default_rng(0)
    trace = Trace(np.arange(1400) * 0.05, {f"c{number}": rng.normal(size=1400) for number in range(12)})
    write_trace(tmp_path / "a.csv", trace)
    assert (tmp_path / "a.csv").stat().st_size < 300_000


def test_millimetres_and_milliseconds_are_read_with_si_conditions(tmp_path):
    rows = "t [ms],V [mm^3],S [mm²],H [mm],x [μm],P [kPa],sigma_V [mm^3]\n"
    rows += "0,28,47.5,2.5,100,20,0.1\n1.5,27,47,2.4,200,21,0.2\n"
    found = read_trace(_write(tmp_path, SI + "# day: 3 May\n" + rows))
    np.testing.assert_allclose(found.times, np.array([0, 1.5e-3]) / SI_TIME, rtol=1e-14)
    np.testing.assert_allclose(found["V"], [28 / 8, 27 / 8], rtol=1e-14)
    np.testing.assert_allclose(found["S"], [47.5 / 4, 47 / 4], rtol=1e-14)
    np.testing.assert_allclose(found["H"], [1.25, 1.2], rtol=1e-14)
    np.testing.assert_allclose(found["x"], [0.05, 0.1], rtol=1e-14)  # not in the registry: scaled by its unit
    np.testing.assert_allclose(found["P"], [1, 1.05], rtol=1e-14)
    np.testing.assert_allclose(found.sigma["V"], [0.1 / 8, 0.2 / 8], rtol=1e-14)
    _same(found.conditions, SI_PROBLEM, rtol=1e-14)
    assert found.scales.length == 2e-3
    assert found.settings == (("day", "3 May"),)


def test_bare_columns_stay_as_they_are_under_si_conditions(tmp_path):
    found = read_trace(_write(tmp_path, SI + "t,V\n0,3.5\n1,3.4\n"))
    np.testing.assert_array_equal(found["V"], [3.5, 3.4])
    assert found.scales is not None


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_every_unit_of_the_registry_is_read_as_its_factor_says(tmp_path, unit):
    dimension, factor = UNITS[unit]
    found = read_trace(_write(tmp_path, SI + f"t [s],mine [{unit}]\n0,1\n1,2\n"))
    np.testing.assert_allclose(found["mine"] * found.scales.of(dimension), [factor, 2 * factor], rtol=1e-14)


def test_missing_numbers_take_the_defaults_of_the_problem(tmp_path):
    text = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.6\nt,V\n0,3.5\n1,3.4\n"
    _same(read_trace(_write(tmp_path, text)).conditions, Reduced(0.22, 0.9, 1.6))


def test_byte_order_mark_line_ends_blank_lines_and_comments_change_nothing(tmp_path):
    plain = read_trace(_write(tmp_path, GOOD))
    odd = "\ufeff# a comment\n# see https://example.org\n\n" + GOOD.replace("\n0.1", "\n\n0.1") + "\n\n"
    found = read_trace(_write(tmp_path, odd.replace("\n", "\r\n")))
    np.testing.assert_array_equal(found["V"], plain["V"])
    assert found.settings == ()
    _same(found.conditions, plain.conditions, rtol=0)


def test_meta_supplies_the_conditions_that_a_file_lacks(tmp_path):
    meta = {"R0_m": 2e-3, "d_m": 4e-4, "E_Pa": 1e5, "P0_Pa": 18000, "Pext_Pa": 32000}
    meta |= {"rho_f_kg_m3": 1000, "eta_f_Pa_s": 1e-3, "kappa": 1.3, "nu": 0.45, "camera": "fast", "outcome": "contact"}
    meta = _write(tmp_path, json.dumps(meta), "meta.json")
    found = read_trace(_write(tmp_path, "# lens: 50\nt [ms],H [mm]\n0,2.5\n1,2.4\n"), meta)
    _same(found.conditions, SI_PROBLEM, rtol=1e-14)
    np.testing.assert_allclose(found["H"], [1.25, 1.2], rtol=1e-14)
    assert found.settings == (("lens", "50"), ("camera", "fast"))
    assert found.outcome == Outcome.CONTACT
    problem, unit = read_conditions(meta)
    _same(problem, SI_PROBLEM, rtol=1e-14)
    assert unit == found.scales


def test_meta_that_contradicts_the_file_is_refused(tmp_path):
    path = _write(tmp_path, GOOD)
    same = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}
    assert read_trace(path, _write(tmp_path, json.dumps(same), "m.json")).conditions is not None
    other = _write(tmp_path, json.dumps(same | {"P0_hat": 0.8}), "m.json")
    with pytest.raises(BadValue, match=r"gas_pressure 0\.9 in one and 0\.8 in the other"):
        read_trace(path, other)


ROWS = "t,V\n0,3.5\n1,3.4\n"
REFUSALS = [
    ("empty", "", BadFile, "an empty file"),
    ("binary", b"\x93NUMPY\x01\x00\x00\x01", BadFile, "row 1: found byte 0x93"),
    ("latin", b"t,V\n0,1\n1,\xb51\n", BadFile, "row 3, column `V`: found 'µ1'"),
    ("nul", b"t,V\n0,1\n1,\0\n", BadFile, "row 3: found byte 0x00"),
    ("comments only", "# d_hat: 1\n# hello\n", BadFile, "comments only"),
    ("no t", "x,V\n0,1\n1,1\n", BadName, "row 1: found the columns `x`, `V`; expected a column `t`"),
    ("two times", "time,timestamp,V\n0,0,1\n1,1,1\n", BadName, "`time` and `timestamp`, .*--columns t=1"),
    ("capital T", "T,V\n0,1\n1,1\n", BadName, "Rename `T`"),
    ("no names", "0,1\n1,1\n", BadName, "Add a row of names"),
    ("names too few", "t V\n0,1\n1,1\n", BadFile, "row 1: found 1 names over 2 columns"),
    ("names too many", "t,V,S\n0,1\n1,1\n", BadFile, "row 1: found 3 names over 2 columns"),
    ("first row", "t,V\n0,one\n1,1\n2,1\n", BadFile, "row 2, column 2: found 'one' beside numbers"),
    ("t alone", "t\n0\n1\n", BadName, "no column but `t`"),
    ("header only", REDUCED + "t,V\n", BadFile, "no rows below the column row 5"),
    ("blank rows only", "t,V\n\n\n", BadFile, "no rows below the column row 1"),
    ("single row", "t,V\n0,1\n", BadFile, "a single row"),
    ("word", REDUCED + "t,V\n0,1\n\n1,one\n", BadFile, "row 8, column `V`: found 'one'"),
    ("underscore", "t,V\n0,1\n1,1_0\n", BadFile, "row 3, column `V`: found '1_0'"),
    ("empty cell", "t,V\n0,1\n1,\n", BadFile, "row 3, column `V`: found an empty cell"),
    ("nan", "t,V\n0,1\n1,nan\n", BadValue, "row 3, column `V`: found nan"),
    ("inf", "t,V\n0,1\n-inf,1\n", BadValue, "row 3, column `t`: found -inf"),
    ("overflow", "t,V\n0,1\n1,1e999\n", BadValue, "row 3, column `V`: found '1e999', which overflows"),
    ("short row", "t,V\n0,1\n1\n", BadFile, "row 3: found 1 cells; expected 2"),
    ("long row", "t,V\n0,1\n1,1,7\n2,1\n", BadFile, "row 3: found 3 cells; expected 2"),
    ("lost condition", "d_hat: 0.2\n" + ROWS, BadFile, "row 1: found `d_hat: 0.2`; expected `# d_hat: value`"),
    ("late comment", "t,V\n0,1\n# d_hat: 1\n1,1\n", BadFile, "row 3: found a `#` line"),
    ("duplicate", "t,V,V\n0,1,1\n1,1,1\n", BadFile, "row 1, column `V`: found the name twice, as columns 2 and 3"),
    (
        "duplicate unit",
        SI + "t [s],V [m^3],V [mm^3]\n0,1,1\n1,1,1\n",
        BadFile,
        "row 10, column `V`: found the name twice",
    ),
    ("no name", "t,,V\n0,1,1\n1,1,1\n", BadFile, "row 1, column 2: found an empty column name"),
    ("brackets", "t,V]x[\n0,1\n1,1\n", BadFile, r"row 1, column 2: found the name 'V\]x\['"),
    ("time stands", "t,V\n0,1\n1,1\n\n1,1\n", BadValue, "row 5, column `t`: found t = 1 after 1"),
    ("time returns", "t,V\n0,1\n1,1\n0.5,1\n", BadValue, "row 4, column `t`: found t = 0.5 after 1"),
    ("no volume", "t,V\n0,1\n1,0\n", BadValue, "row 3, column `V`: found V = 0"),
    ("too much volume", "t,V\n0,1\n1,4.3\n", BadValue, "row 3, column `V`: found V = 4.3; .* Wrong units"),
    ("small area", "t,V,S\n0,3.5,11.9\n1,3.5,11\n", BadValue, "row 3, column `S`: found S = 11"),
    ("height", "t,H\n0,1\n1,-1\n", BadValue, "row 3, column `H`: found H = -1"),
    ("width", "t,W\n0,1\n1,0\n", BadValue, "row 3, column `W`: found W = 0"),
    ("sigma", "t,H,sigma_H\n0,1,0\n1,1,-1\n", BadValue, "row 3, column `sigma_H`: found sigma_H = -1"),
    ("lone sigma", "t,V,sigma_H\n0,1,0\n1,1,1\n", BadName, "row 1, column `sigma_H`: .* which is no channel"),
    ("bad number", REDUCED.replace("0.22", "abc") + ROWS, BadValue, "row 1, key `d_hat`: found 'abc'"),
    ("number with unit", SI.replace("2e-3", "2 mm") + ROWS, BadValue, "row 1, key `R0_m`: found '2 mm'"),
    ("thick", REDUCED.replace("0.22", "1.2") + ROWS, BadValue, "row 1, key `d_hat`: found 1.2; expected 0 < d_hat < 1"),
    ("vacuum", REDUCED.replace("0.9", "0") + ROWS, BadValue, "row 2, key `P0_hat`: found 0"),
    ("viscosity", REDUCED.replace("0.004", "-1") + ROWS, BadValue, "row 4, key `eta_hat`: found -1"),
    ("kappa", SI.replace("1.3", "0.3") + ROWS, BadValue, "row 8, key `kappa`: found 0.3"),
    ("nu", SI.replace("0.45", "0.6") + ROWS, BadValue, "row 9, key `nu`: found 0.6"),
    ("radius", SI.replace("2e-3", "-2e-3") + ROWS, BadValue, "row 1, key `R0_m`: found -0.002"),
    ("thick in SI", SI.replace("4e-4", "4e-3") + ROWS, BadValue, "found d_hat = 2, made from d_m and R0_m"),
    ("huge", SI.replace("2e-3", "2e200") + ROWS, BadValue, "overflow"),
    ("tiny", SI.replace("2e-3", "2e-200") + ROWS, BadValue, "overflow"),
    ("families", REDUCED + "# R0_m: 1\n" + ROWS, BadUnits, r"row 5, key `R0_m`: found SI keys \(R0_m\) beside"),
    ("incomplete", "# d_hat: 0.22\n" + ROWS, BadFile, "conditions without P0_hat, Pext_hat"),
    ("incomplete SI", SI.replace("# E_Pa: 1e5\n", "") + ROWS, BadFile, "conditions without E_Pa"),
    ("no viscosity in SI", SI.replace("# eta_f_Pa_s: 1e-3\n", "") + ROWS, BadFile, "conditions without eta_f_Pa_s"),
    ("exponent alone", "# kappa: 1.4\n" + ROWS, BadFile, "conditions without d_hat, P0_hat, Pext_hat"),
    ("twice", REDUCED + "# d_hat: 0.2\n" + ROWS, BadName, "row 5, key `d_hat`: found `d_hat` a second time"),
    ("capitals", "# D_hat: 0.2\n" + ROWS, BadName, "row 1, key `D_hat`: .* Write it `d_hat`"),
    ("equals sign", "# d_hat = 0.2\n" + ROWS, BadFile, "row 1: found `d_hat =`"),
    ("outcome", "# outcome: fine\n" + ROWS, BadName, "row 1, key `outcome`: found the outcome 'fine'"),
    ("time without unit", "t,V [m^3]\n0,1\n1,1\n", BadUnits, "row 1, column `t`: found no unit.*--units t=s"),
    ("unit with reduced", REDUCED + "t [s],V [m^3]\n0,1\n1,1\n", BadUnits, "row 5, column `t`"),
    ("mixed units", SI + "t [s],V\n0,1\n1,1\n", BadUnits, "row 10, column `V`: found no unit"),
    (
        "unknown unit",
        SI + "t [hour glass],V [m^3]\n0,1\n1,1\n",
        BadUnits,
        "column `t`: found the unit 'hour glass'; .*ms, us",
    ),
    ("empty unit", SI + "t [],V [m^3]\n0,1\n1,1\n", BadUnits, "row 10, column `t`: found the unit ''"),
    ("wrong unit", SI + "t [s],V [mm]\n0,1\n1,1\n", BadUnits, "row 10, column `V`: .* a unit of volume: m.3, mm.3"),
    ("wrong sigma", SI + "t [s],V [m^3],sigma_V [m]\n0,1,1\n1,1,1\n", BadUnits, "row 10, column `sigma_V`"),
    ("far apart", "t,V\n-1e308,1\n1e308,5\n", BadValue, "row 3, column `V`: found V = 5"),
    ("SI overflow", SI + "t [s],H [m]\n0,1e-3\n1e308,1e-3\n", BadValue, "row 12, column `t`: found t = inf"),
    ("SI volume", SI + "t [s],V [m^3]\n0,28e-9\n1,28\n", BadValue, r"row 12, column `V`: found V = 3.5e\+09"),
]


@pytest.mark.parametrize(("text", "kind", "match"), [row[1:] for row in REFUSALS], ids=[row[0] for row in REFUSALS])
def test_a_wrong_file_is_refused_at_its_place(tmp_path, text, kind, match):
    path = _write(tmp_path, text)
    with pytest.raises(kind, match=match) as caught:
        read_trace(path)
    assert str(path) in caught.value.place
    assert all(caught.value.record().values())


def test_an_error_deep_in_a_long_file_has_its_own_line_number(tmp_path):
    lines = [f"{number},3.5" for number in range(3 * STRETCH)]
    lines[2 * STRETCH + 7] = "x,3.5"
    with pytest.raises(BadFile, match=f"row {2 * STRETCH + 9}, column `t`: found 'x'"):
        read_trace(_write(tmp_path, "t,V\n" + "\n".join(lines)))


def test_a_missing_file_is_refused_with_the_name_that_may_be_meant(tmp_path):
    _write(tmp_path, GOOD, "trace.csv")
    with pytest.raises(BadFile, match=r"Did you mean trace\.csv"):
        read_trace(tmp_path / "trase.csv")
    with pytest.raises(BadFile, match="no folder"):
        read_trace(tmp_path / "nowhere" / "trace.csv")
    with pytest.raises(BadFile, match="found a directory"):
        read_trace(tmp_path)
    with pytest.raises(BadFile, match="no such file"):
        read_trace(tmp_path / "trace.csv", tmp_path / "meta.json")
    with pytest.raises(BadFile, match="embedded null"):
        read_trace("a\0b")


@pytest.mark.parametrize(
    ("text", "kind", "match"),
    [
        ("{", BadFile, "row 1, position 2"),
        ("[1]", BadFile, "a JSON list"),
        ("{}", BadFile, "no conditions"),
        ("[" * 100_000, BadFile, "recursion"),
        ('{"d_hat": ' + "9" * 5000 + "}", BadFile, "Exceeds the limit"),
        ('{"d_hat": 0.2, "d_hat": 0.3}', BadName, "key `d_hat`: found `d_hat` a second time"),
        ('{"d_hat": true}', BadValue, "key `d_hat`: found 'true'"),
        ('{"d_hat": NaN}', BadValue, "key `d_hat`: found 'nan'"),
        ('{"d_hat": {"a": 1}}', BadValue, "key `d_hat`: found"),
        ('{"d_hat": 2, "P0_hat": 1, "Pext_hat": 1}', BadValue, "key `d_hat`: found 2"),
        ('{"d_hat": 0.2, "R0_m": 1}', BadUnits, "key `R0_m`: found SI keys"),
    ],
)
def test_wrong_conditions_in_json_are_refused_at_their_key(tmp_path, text, kind, match):
    with pytest.raises(kind, match=match):
        read_conditions(_write(tmp_path, text, "conditions.json"))


def test_a_table_gives_the_columns_asked_for(tmp_path):
    path = _write(tmp_path, "# d_hat: 0.2\nP0_hat,omega_minus,sigma_omega_minus\n0.9,1.5,0.1\n")
    found = read_table(path, ("P0_hat", "omega_minus"), ("sigma_omega_minus",))
    assert {name: values.tolist() for name, values in found.items()} == {
        "P0_hat": [0.9],
        "omega_minus": [1.5],
        "sigma_omega_minus": [0.1],
    }
    assert list(read_table(path)) == list(found)
    with pytest.raises(BadName, match="expected a column `tau`"):
        read_table(path, ("tau",))
    with pytest.raises(BadName, match="column `sigma_omega_minus`"):
        read_table(path, ("P0_hat", "omega_minus"), ())


def test_a_table_with_units_is_made_dimensionless(tmp_path):
    found = read_table(_write(tmp_path, SI + "P_ext [kPa],H [mm]\n32,2\n30,1\n"), ("P_ext", "H"))
    np.testing.assert_allclose(found["P_ext"], [1.6, 1.5], rtol=1e-14)
    np.testing.assert_allclose(found["H"], [1, 0.5], rtol=1e-14)


def _with(**changes):
    given = {"times": np.array([0.0, 1.0]), "channels": {"V": np.array([3.0, 3.1])}}
    return Trace(**(given | changes))


@pytest.mark.parametrize(
    ("trace", "units", "kind", "match"),
    [
        (_with(), "si", BadUnits, "no scales"),
        (_with(scales=Scales(2.0, 1.0, 1.0)), "si", BadUnits, "no conditions"),
        (_with(), "SI", BadName, "expected reduced or si"),
        (_with(channels={}), "reduced", BadName, "no column but `t`"),
        (_with(channels={"a,b": np.zeros(2)}), "reduced", BadName, "cannot hold"),
        (_with(channels={"sigma_V": np.zeros(2)}), "reduced", BadName, "cannot hold"),
        (_with(channels={"V": np.array([3.0, np.nan])}), "reduced", BadValue, "channel `V`, sample 1"),
        (_with(times=np.array([0.0, 0.0])), "reduced", BadValue, "channel `t`, sample 1"),
        (_with(sigma={"V": np.zeros(3)}), "reduced", BadShape, "sigma_V"),
        (_with(sigma={"H": np.zeros(2)}), "reduced", BadName, "no channel here"),
        (_with(times=np.zeros((1, 2)), channels={"V": np.ones((1, 2))}), "reduced", BadShape, "batch"),
        (_with(outcome=42), "reduced", BadValue, "found 42"),
        (_with(conditions=Reduced(np.full(3, 0.2), 0.9, 1.6)), "reduced", BadShape, "batch"),
        (_with(settings=(("d_hat", "1"),)), "reduced", BadName, "setting 'd_hat'"),
        (_with(settings=(("two words", "1"),)), "reduced", BadName, "setting 'two words'"),
        (_with(settings=(("note", "two\nlines"),)), "reduced", BadName, "setting 'note'"),
    ],
)
def test_a_trace_that_could_not_be_read_back_is_not_written(tmp_path, trace, units, kind, match):
    with pytest.raises(kind, match=match):
        write_trace(tmp_path / "a.csv", trace, units)
    assert not (tmp_path / "a.csv").exists()


def test_a_frequency_has_no_unit_in_an_si_file(tmp_path):
    conditions, scales = Reduced(0.2, 0.9, 1.6), Scales(1e-3, 1e4, 1e3)
    trace = _with(channels={"omega_minus": np.ones(2)}, conditions=conditions, scales=scales)
    with pytest.raises(BadUnits, match="a frequency"):
        write_trace(tmp_path / "a.csv", trace, "si")


def test_a_number_that_overflows_in_si_is_not_written(tmp_path):
    conditions, scales = Reduced(0.2, 0.9, 1.6), Scales(1e-3, 1e4, 1e3)
    trace = _with(channels={"P": np.array([1.0, 1e305])}, conditions=conditions, scales=scales)
    with pytest.raises(BadValue, match="channel `P`, sample 1: found P = inf"):
        write_trace(tmp_path / "a.csv", trace, "si")


def test_arrays_of_jax_are_written_as_those_of_numpy(tmp_path):
    problem = Reduced(jnp.asarray(0.1), 0.9, 1.6)
    trace = Trace(jnp.arange(3.0), {"V": jnp.full(3, 1 / 3)}, problem, outcome=jnp.asarray(2))
    write_trace(tmp_path / "a.csv", trace)
    found = read_trace(tmp_path / "a.csv")
    assert found.outcome == Outcome.CONTACT
    assert found.conditions.thickness == 0.1
    assert isinstance(found["V"], np.ndarray)


def test_a_folder_that_does_not_exist_is_not_written_to(tmp_path):
    with pytest.raises(BadFile, match="Check folder and permissions"):
        write_trace(tmp_path / "nowhere" / "a.csv", _with())

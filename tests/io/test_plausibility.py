"""Units at the door: legal ones of any kind, slips between them, and noise about the sphere."""

import warnings

import numpy as np
import pytest

from jshell.errors import BadUnits, BadValue, RangeWarning
from jshell.io import read_trace, write_trace
from jshell.io.columns import SPHERE
from jshell.quantities import QUANTITIES
from jshell.shell import Reduced, Scales
from jshell.trace import Trace

SI = (
    "# R0_m: 2e-3\n# d_m: 4e-4\n# E_Pa: 1e5\n# P0_Pa: 18000\n# Pext_Pa: 32000\n"
    "# rho_f_kg_m3: 1000\n# eta_f_Pa_s: 1e-3\n"
)
TIME = np.sqrt(1000 * 8e-9 / (1e5 * 4e-4))  # 0.447 ms by hand


def _read(folder, text):
    path = folder / "a.csv"
    path.write_text(text)
    return read_trace(path)


def _record(step, unit, count=40):
    return SI + f"t [{unit}],H [mm]\n" + "".join(f"{step * k:.9g},3\n" for k in range(count))


# SI value of one unit, from the definitions: hour, torr, inch, litre, poise, erg, knot-like speeds.
@pytest.mark.parametrize(
    ("unit", "factor", "dimension"),
    [
        ("min", 60.0, "time"),
        ("hour", 3600.0, "time"),
        ("inch", 0.0254, "length"),
        ("dm^3", 1e-3, "volume"),
        ("nL", 1e-12, "volume"),
        ("cm²", 1e-4, "area"),
        ("mm/ms", 1.0, "speed"),
        ("hPa", 100.0, "pressure"),
        ("dyn/cm^2", 0.1, "pressure"),
        ("mmHg", 133.322387415, "pressure"),
        ("psi", 0.45359237 * 9.80665 / 0.0254**2, "pressure"),
        ("erg", 1e-7, "energy"),
        ("cP", 1e-3, "viscosity"),
    ],
)
def test_an_uncommon_but_legal_unit_is_read_as_its_definition_says(tmp_path, unit, factor, dimension):
    found = _read(tmp_path, SI + f"t [s],mine [{unit}]\n0,1\n1,2\n")
    np.testing.assert_allclose(found["mine"] * found.scales.of(dimension), [factor, 2 * factor], rtol=1e-12)


@pytest.mark.parametrize(
    ("column", "match"),
    [
        ("V [psi]", "found the unit psi, of pressure; expected a unit of volume"),
        ("mine [hour glass]", "the unit 'hour glass'"),
        ("V [kg]", "the unit 'kg' on the volume; .*--columns signal=V"),
        ("mine [2 mm]", "the unit '2 mm'"),
        ("mine [m^99999999]", "the unit 'm"),
        ("mine [m^(99999999)]", "the unit 'm"),
        # a power of a power has more digits than a memory holds: none of these is evaluated
        ("mine [s**9**9**9]", "the unit 's"),
        ("mine [s^(9^9^9)]", "the unit 's"),
        ("mine [((km^9)^9)^9]", "."),
        ("mine [km⁹⁹⁹⁹⁹⁹⁹⁹⁹]", "the unit 'km"),
        ("mine [sq square cubic km cubed]", "the unit 'sq square"),
        ("mine [1/0]", "the unit '1/0'"),
        ("mine [mm^]", "the unit 'mm"),
        ("mine [a.b.c((]", "the unit"),
        ("omega_minus [Hz]", "the unit 'Hz'"),  # cycles or radians? Pint takes both for 1/s
        ("omega_minus [rad/s]", "the unit 'rad/s'"),
    ],
)
def test_what_is_no_unit_of_a_trace_is_refused(tmp_path, column, match):
    with pytest.raises(BadUnits, match=match):
        _read(tmp_path, SI + f"t [s],{column}\n0,1\n1,2\n")


def test_without_pint_uncommon_units_name_the_extra(tmp_path, monkeypatch):
    from jshell.io import units

    units._uncommon.cache_clear()
    monkeypatch.setattr(units, "_registry", lambda: None)
    with pytest.raises(BadUnits, match=r"pint knows \(extra `io`\)"):
        _read(tmp_path, SI + "t [s],P [psi]\n0,1\n1,2\n")
    units._uncommon.cache_clear()


@pytest.mark.parametrize(
    ("step", "unit", "right"),
    [
        (50, "s", "us"),  # 0.05 ms in us
        (0.05, "s", "ms"),
        (5e-5, "ms", "s"),
        (5e-2, "us", "ms"),
    ],
)
def test_a_slip_of_the_time_unit_is_named(tmp_path, step, unit, right):
    with pytest.warns(RangeWarning, match=rf"row 8, column `t`: .* write `t \[{right}\]`"):
        _read(tmp_path, _record(step, unit))


def test_seconds_in_a_bare_column_are_named(tmp_path):
    text = SI + "t,V\n" + "".join(f"{5e-5 * k:.9g},3\n" for k in range(40))
    with pytest.warns(RangeWarning, match=r"write `t \[s\]`"):
        _read(tmp_path, text)
    reduced = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.6\n" + text[len(SI) :]
    with pytest.warns(RangeWarning, match="Check its unit"):
        _read(tmp_path, reduced)


def test_a_record_of_any_useful_sampling_passes_in_silence(tmp_path):
    for step, unit in ((5e-5, "s"), (0.05, "ms"), (50, "us"), (1e-6, "min"), (1.0, "ms")):
        _read(tmp_path, _record(step, unit, count=100))


@pytest.mark.parametrize(
    ("column", "value", "hint"),
    [
        ("V [mm^3]", 28e-9, r"write `V \[m\^3\]`"),
        ("S [m^2]", 47e-0, r"write `S \[mm\^2\]`"),
        ("H [m]", 3.0, r"write `H \[mm\]`"),
        ("W [mm]", 3e-3, r"write `W \[m\]`"),
        ("P [MPa]", 20.0, r"write `P \[kPa\]`"),
        ("P_ext [Pa]", 32.0, r"write `P_ext \[kPa\]`"),
    ],
)
def test_a_slip_of_another_unit_is_named(tmp_path, column, value, hint):
    with pytest.warns(RangeWarning, match=hint):
        _read(tmp_path, SI + f"t [ms],{column}\n0,{value}\n1,{value}\n")


def test_noise_about_the_sphere_is_judged_by_its_standard_error(tmp_path):
    rng = np.random.default_rng(0)
    noisy = SPHERE * (1 + 0.02 * rng.normal(size=1000))
    times = np.arange(1000) * 0.1
    with pytest.raises(BadValue, match="channel `V`"):
        write_trace(tmp_path / "a.csv", Trace(times, {"V": noisy}))
    trace = Trace(times, {"V": noisy}, sigma={"V": np.full(1000, 0.02 * SPHERE)})
    with pytest.warns(RangeWarning, match="within 6 of its standard errors"):
        write_trace(tmp_path / "a.csv", trace)
    with pytest.warns(RangeWarning, match="column `V`: .* % above the volume of the stress-free sphere"):
        found = read_trace(tmp_path / "a.csv")
    np.testing.assert_allclose(found["V"], noisy, rtol=1e-11)
    far = Trace(times, {"V": noisy * 1.2}, sigma=trace.sigma)
    with pytest.raises(BadValue, match="stress-free sphere"):
        write_trace(tmp_path / "a.csv", far)


def test_a_slightly_overstretched_sphere_is_written_and_read_with_a_warning(tmp_path):
    V = SPHERE * np.array([1.0, 1.0005, 1.015])
    S = 4 * np.pi * (V / SPHERE) ** (2 / 3)
    with pytest.warns(RangeWarning, match="sample 2: V = .* 1.5 % above .* overstretched wall"):
        write_trace(tmp_path / "a.npz", Trace(np.arange(3.0), {"V": V, "S": S}))
    with pytest.warns(RangeWarning, match="row 3, column `V`"):
        assert read_trace(tmp_path / "a.npz")["V"][2] == V[2]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_trace(tmp_path / "a.npz", Trace(np.arange(2.0), {"V": V[:2], "S": S[:2]}))


def test_an_area_below_the_sphere_of_its_volume_is_judged_by_the_errors_of_both(tmp_path):
    V, S = np.full(3, 3.5), np.array([11.9, 11.9, 11.0])  # a sphere of 3.5 has 11.147
    sigma = {"V": np.full(3, 0.02), "S": np.full(3, 0.05)}
    with pytest.raises(BadValue, match="sample 2: found S = 11;"):
        write_trace(tmp_path / "a.csv", Trace(np.arange(3.0), {"V": V, "S": S}))
    with pytest.warns(RangeWarning, match="S = 11 is 4.1 % .* within 6"):
        write_trace(tmp_path / "a.csv", Trace(np.arange(3.0), {"V": V, "S": S}, sigma=sigma))


def test_every_quantity_that_is_ranged_is_in_the_registry():
    from jshell.io.plausibility import _RANGES

    assert set(_RANGES) <= set(QUANTITIES)


def test_a_reduced_simulation_is_left_alone(tmp_path):
    trace = Trace(
        np.arange(0, 70, 0.05), {"V": np.full(1400, 2.9)}, Reduced(0.22, 0.9, 1.6), scales=Scales(0.0225, 1.1e5, 1260.0)
    )
    for units in ("reduced", "si"):
        write_trace(tmp_path / "a.csv", trace, units)
        assert read_trace(tmp_path / "a.csv").times.size == 1400

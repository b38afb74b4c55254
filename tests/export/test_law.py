"""A buckled shell as one equation: the short model's energy, frequency and thresholds, in files of other codes."""

import runpy
from dataclasses import fields

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import jshell as js
from jshell.errors import BadFile, BadName, NotOk, UnusableData
from jshell.export import radial_law, read_law, run, write_apecss, write_jbubble, write_law
from jshell.oscillator.lagrangian import kinetic_energy, potential_energy
from jshell.shell.rest import RestState

R = js.presets.R.conditions
SCALES = js.shell.scales(js.Shell(0.0225, 0.00495, 0.5e6), js.Liquid(1260.0, 1.06))
CONSTANTS = js.Coefficients(3.6, 1.1, 0.23, beta1=9.0)
REST = RestState(jnp.asarray(2.913284), jnp.asarray(1.496341))  # printed with the source's constants
OMEGA, TAU = 0.988525, 3.6 / (2 * 9.0 * 0.004)  # of the slow mode there; equal decay, α1/2β1η


@pytest.fixture(scope="module", params=["mode", "rest"])
def law(request):
    return radial_law(R, CONSTANTS, SCALES, along=request.param, equilibrium=REST)


def test_the_law_run_rings_and_stores_as_the_short_model_does(law):
    omega, tau = law.slow_mode()
    assert omega * SCALES.time == pytest.approx(OMEGA, rel=1e-4)
    assert tau / SCALES.time == pytest.approx(TAU, rel=1e-6)
    times = np.linspace(0, 40, 401) * SCALES.time
    found = run(law, lambda t: law.rest_pressure, times, rate=1e-4 * law.rest_volume / SCALES.time)
    x, t = found.volume / law.rest_volume - 1, times / SCALES.time
    damped = np.sqrt(OMEGA**2 - 1 / TAU**2)
    np.testing.assert_allclose(x, 1e-4 / damped * np.exp(-t / TAU) * np.sin(damped * t), atol=1e-7)


def test_the_laws_energy_is_that_of_the_short_model_on_its_line(law):
    row, e = law.buckled, SCALES.length**3 * SCALES.pressure
    V = jnp.asarray(row.volume / SCALES.length**3)
    ratio = 0.23 / REST.volume  # the wall's A_VS; A_SS is 1/4π
    squared = OMEGA**2 * 2 * 1.1 * REST.volume**2 / (9 * np.pi**3)
    slope = -ratio / (1 / (4 * np.pi) - (squared if law.along == "mode" else 0.0))
    S = 4 * np.pi + slope * (V - REST.volume)
    exact = np.array(potential_energy((V, S), REST, CONSTANTS, R))
    work = CubicSpline(row.volume, law.rest_pressure - row.pressure).antiderivative()
    serialized = (work(row.volume) - work(law.rest_volume)) / e
    np.testing.assert_allclose(serialized, exact, rtol=1e-3, atol=1e-9)
    if law.along == "mode":
        moving = np.array(kinetic_energy((V, S), (jnp.ones_like(V), slope * jnp.ones_like(V)), CONSTANTS))
        own = row.mass / 2 * (SCALES.length**3 / SCALES.time) ** 2 / e
        np.testing.assert_allclose(own, moving, rtol=1e-3)


@pytest.mark.slow
def test_how_far_the_law_is_from_the_simulator_is_what_the_how_to_says(law):
    """The simulator's own swing along its slow mode, by a rate of the volume of 1e-3."""
    still = js.modes(R, count=2, elements=24, liquid="second")
    rate = 1e-3
    along = jnp.real(still.shapes[0]) * rate / still.dV[0]
    swing = js.simulate(R, start=still.rest, velocity=along, duration=40.0, every=0.1, elements=24)
    assert float(swing["V_rate"][0]) == pytest.approx(rate, rel=1e-6)
    simulated = js.extract(swing, "V", start=0.0).omega_minus
    omega, _ = law.slow_mode()
    assert omega * SCALES.time / simulated - 1 == pytest.approx(-0.041, abs=0.003)
    unit = SCALES.pressure * SCALES.time**2 / SCALES.length**3
    mass = float(np.interp(law.rest_volume, law.buckled.volume, law.buckled.mass)) / unit
    off = mass * rate**2 / 2 / float(swing["kinetic"][0]) - 1
    assert off == pytest.approx({"mode": 0.11, "rest": -0.69}[law.along], abs=0.01)


@pytest.mark.long
def test_a_slow_load_unbuckles_and_buckles_where_the_short_model_says():
    law = radial_law(R, CONSTANTS, SCALES, along="rest", equilibrium=REST, rows=101)
    ends = js.oscillator.thresholds(R, CONSTANTS, REST)
    long = 800 * SCALES.time
    outer = lambda t: law.rest_pressure * (1 - 0.3 * np.sin(np.pi * t / long))  # noqa: E731
    found = run(law, outer, np.linspace(0, long, 50), rtol=1e-6)
    loads = [outer(t) / SCALES.pressure for t in found.switches]
    assert loads == pytest.approx([ends.unbuckling_pressure, ends.buckling_pressure], rel=2e-3)
    assert list(found.buckled[[0, 25, -1]]) == [1, 0, 1]
    with pytest.raises(NotOk, match="out_of_range"):
        run(law, lambda t: 0.3 * law.rest_pressure, np.linspace(0, long, 50), rtol=1e-6)


def test_a_table_comes_back_as_it_was_written(law, tmp_path):
    write_law(tmp_path / "law.csv", law)
    back = read_law(tmp_path / "law.csv")
    for field in fields(law):
        one, other = getattr(law, field.name), getattr(back, field.name)
        if field.name in ("buckled", "sphere"):
            for part in fields(one):
                np.testing.assert_allclose(getattr(other, part.name), getattr(one, part.name), rtol=1e-14)
        else:
            assert one == other
    (tmp_path / "bad.csv").write_text("V,P\n1,2\n")
    with pytest.raises(BadFile, match="no law"):
        read_law(tmp_path / "bad.csv")


def _rings(density, rest, kappa_gas, gas, tension, slope, viscosity):
    """ω and τ of ρ(R R̈ + 3/2 Ṙ²) = P_gas - 2σ/R - 4µ Ṙ/R - P_ext about a radius."""
    stiffness = 3 * kappa_gas * gas / rest + 2 * slope / rest - 2 * tension / rest**2
    return np.sqrt(stiffness / (density * rest)), density * rest**2 / (2 * viscosity)


def test_jbubbles_module_rings_as_the_law_by_what_jbubble_documents(law, tmp_path):
    write_jbubble(tmp_path / "shell.py", law)
    said = runpy.run_path(str(tmp_path / "shell.py"))
    R0, radii, sigma = said["R0"], np.array(said["R"]), np.array(said["SIGMA"])
    held, slope = np.interp(R0, radii, sigma), np.interp(R0, radii, np.gradient(sigma, radii))
    gas = said["P_AMB"] + 2 * held / R0  # as its `initial_state` takes it
    assert gas == pytest.approx(float(REST.pressure) * SCALES.pressure, rel=1e-5)
    viscosity = np.interp(R0, radii, said["KAPPA_S"]) / R0
    found = _rings(said["RHO"], R0, said["GAMMA"], gas, held, slope, viscosity)
    np.testing.assert_allclose(found, (OMEGA / SCALES.time, TAU * SCALES.time), rtol=1e-3)
    jbubble = pytest.importorskip("jbubble", reason="no jbubble: pip install jbubble")
    assert jbubble is not None
    still = said["equation_of_motion"]()
    assert abs(still(0.0, still.initial_state(), lambda t: 0.0 * t).R_dot) < 1e-6 * R0 / SCALES.time**2


def test_apecss_options_ring_as_the_law_by_what_its_manual_says(law, tmp_path):
    write_apecss(tmp_path / "shell.apecss", law)
    said, section = {}, ""
    for line in (tmp_path / "shell.apecss").read_text().splitlines():
        if line.startswith("#"):
            continue
        words = line.split()
        if len(words) == 1:
            section = "" if words[0] == "END" else words[0]
        else:
            said[section, words[0]] = words[1]
    number = lambda *key: float(said[key])  # noqa: E731
    R0, gas, held = (
        number(*key)
        for key in (
            ("BUBBLE", "InitialRadius"),
            ("BUBBLE", "InitialGasPressure"),
            ("INTERFACE", "SurfaceTensionCoeff"),
        )
    )
    assert gas - 2 * held / R0 == pytest.approx(number("BUBBLE", "PressureAmbient"), rel=1e-9)
    density, viscosity = number("LIQUID", "ReferenceDensity"), number("LIQUID", "Viscosity")
    found = _rings(density, R0, number("GAS", "PolytropicExponent"), gas, held, 0.0, viscosity)
    np.testing.assert_allclose(found, (OMEGA / SCALES.time, TAU * SCALES.time), rtol=1e-3)
    header = (tmp_path / "shell.h").read_text()
    assert f"JSHELL_ROWS {len(law.buckled.volume)}" in header


def test_what_has_no_law_is_refused():
    with pytest.raises(BadName):
        radial_law(R, CONSTANTS, SCALES, along="both", equilibrium=REST)
    with pytest.raises(UnusableData, match="no buckled rest state"):
        radial_law(
            R.replace(outer_pressure=0.9), CONSTANTS, SCALES, equilibrium=RestState(jnp.asarray(4.3), jnp.asarray(0.85))
        )

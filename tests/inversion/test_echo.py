"""What is heard of a shell, in µs and kPa: on a stand-in for the simulator, and of the simulator where it is slow."""

import jax.numpy as jnp
import numpy as np
import pytest

import jshell as js
from jshell.errors import BadName, BadValue, Outcome
from jshell.inversion.response import CHANNELS, DIRECTIONS, ECHO, FIELDS, response_program, standing_program
from jshell.shell import Liquid, Reduced, Shell, scales

RADIUS, THICKNESS, MODULUS, WATER = 2e-6, 3e-7, 2.5e6, Liquid(1000.0, 1e-3)
AGENT = scales(Shell(RADIUS, THICKNESS, MODULUS), WATER)
KNOWN = {"radius": RADIUS, "thickness": THICKNESS, "density": WATER.density}


def identified(make_recording, tmp_path, *, gain=17.0, zero=2.0, **options):
    """A file of a hydrophone: its distance, calibration and zero are nobody's business."""
    trace = make_recording(pad=0.0, channels=(ECHO,), viscosity=0.012, **options)
    times, values = np.asarray(trace.times) * AGENT.time, np.asarray(trace[ECHO]) * AGENT.pressure
    kilopascal = (gain * values + zero * np.abs(values).max()) / 1e3
    path = tmp_path / f"echo_{gain:g}.csv"
    rows = "\n".join(f"{t * 1e6!r},{p!r}" for t, p in zip(times.tolist(), kilopascal.tolist(), strict=True))
    path.write_text(f"t [us],{ECHO} [kPa]\n{rows}\n", encoding="utf-8")
    return js.io.read_trace(path)


def known(gas=1.0, outer=1.7):
    return KNOWN | {"gas_pressure": gas * AGENT.pressure, "outer_pressure": outer * AGENT.pressure}


@pytest.mark.long
@pytest.mark.usefixtures("no_compilation")
def test_modulus_and_viscosity_come_out_of_an_echo_of_any_loudness(make_recording, tmp_path):
    ask = {"unknown": ("youngs_modulus", "viscosity"), "exact": False, "nuisance": False}
    loud, soft = (js.invert(identified(make_recording, tmp_path, gain=g), known(), **ask) for g in (17.0, 1e-4))
    truth = {"youngs_modulus": MODULUS, "viscosity": 0.012 * AGENT.pressure * AGENT.time}
    for found in (loud, soft):
        assert found.outcome == Outcome.OK, found.report()
        assert found.warnings == ()
        for name, value in truth.items():
            assert abs(found[name].value - value) < 3.5 * found[name].stderr
            assert found[name].stderr < 0.05 * value
    for name in truth:  # the same but for the file's digits
        assert soft[name].value == pytest.approx(loud[name].value, rel=1e-6)


@pytest.mark.usefixtures("no_compilation")
def test_an_echo_and_a_film_of_one_shell_are_two_recordings(make_recording):
    seen = make_recording(pad=0.0)
    ring = make_recording(pad=0.0, channels=(ECHO,), seed=1)
    ask = {"unknown": ("youngs_modulus", "gas_pressure"), "exact": False, "nuisance": False}
    both, alone = js.invert([seen, ring], **ask), js.invert(seen, **ask)
    assert both.outcome == Outcome.OK
    assert [one.channels for one in both.recordings] == [("H", "W"), (ECHO,)]
    assert both["youngs_modulus"].stderr < alone["youngs_modulus"].stderr
    together = js.Trace(seen.times, {**seen.channels, ECHO: ring[ECHO]}, seen.conditions, scales=seen.scales)
    with pytest.raises(BadValue, match="p_scattered alone"):
        js.invert(together, channels=("H", ECHO), **ask)
    with pytest.raises(BadName, match="modal"):
        js.invert(ring, level=js.inversion.Snap(ramp=0.0), **ask)


@pytest.mark.usefixtures("no_compilation")
def test_the_ring_down_of_an_echo_begins_after_its_loudest(make_recording):
    ring = make_recording(pad=0.0, channels=(ECHO,))
    step = float(ring.times[1] - ring.times[0])
    period = 60 * step  # five in 300 samples
    snap = 20 * np.max(np.abs(ring[ECHO])) * np.exp(-(((np.arange(150) - 145) / 2.0) ** 2))
    times = step * np.arange(450)
    whole = js.Trace(times, {ECHO: np.concatenate([snap, ring[ECHO]])}, ring.conditions, scales=ring.scales)
    ask = {"unknown": ("youngs_modulus",), "exact": False, "nuisance": False}
    begin = js.invert(whole, **ask).recordings[0].times[0] / ring.scales.time
    assert begin == pytest.approx(145 * step + period / 2, abs=0.1 * period)
    assert js.invert(ring, **ask).recordings[0].times[0] == 0


@pytest.mark.slow
def test_the_echo_of_a_contrast_agent_tells_its_modulus():
    """Made by another mesh; R0 2 µm, a wall of 300 nm known, gas 100 kPa, in water."""
    gas, outer = 100e3, 190e3
    agent = Reduced.from_si(Shell(RADIUS, THICKNESS, MODULUS), js.Gas(gas), WATER, js.Load(outer))
    numbers = jnp.array([*(float(getattr(agent, name)) for name in FIELDS[:6]), 0.0, 0.0, 0.0])
    near = standing_program(28, False)(numbers)
    made, _ = response_program(28, False)(numbers, jnp.zeros((DIRECTIONS, len(FIELDS))), near)
    rates, shapes = np.asarray(made.rates)[:2], np.asarray(made.shapes)[:2]
    V, p = shapes[:, CHANNELS.index("V")], shapes[:, CHANNELS.index(ECHO)]
    times = np.linspace(0, 4 * 2 * np.pi / rates[0].imag, 400)
    # a mode moves the volume as exp(st): its second derivative by differences is 4π of the channel
    h = 1e-3
    wave = lambda t: np.real(V[0] * np.exp(rates[0] * t))  # noqa: E731
    slope = (wave(times + h) - 2 * wave(times) + wave(times - h)) / h**2
    np.testing.assert_allclose(
        slope, 4 * np.pi * np.real(p[0] * np.exp(rates[0] * times)), atol=1e-5 * abs(slope).max()
    )

    pressure = np.real(np.array([1.0, 0.5j]) / np.abs(p) * p @ np.exp(np.outer(rates, times)))
    pressure += 0.01 * np.abs(pressure).max() * np.random.default_rng(0).standard_normal(times.size)
    trace = js.Trace(times * AGENT.time, {ECHO: 2.5e3 * pressure}, scales=js.shell.Scales(1.0, 1.0, 1.0))
    assert 1e5 < rates[0].imag / (2 * np.pi * AGENT.time) < 5e6  # MHz
    said = KNOWN | {"gas_pressure": gas, "outer_pressure": outer, "viscosity": WATER.viscosity}
    found = js.invert(trace, said, unknown=("youngs_modulus",), exact=False, nuisance=False)
    assert found.outcome == Outcome.OK, found.report()
    assert abs(found["youngs_modulus"].value - MODULUS) < 3 * found["youngs_modulus"].stderr + 1e-3 * MODULUS
    assert found["youngs_modulus"].stderr < 0.02 * MODULUS  # in water it is silent after two periods

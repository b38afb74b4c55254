"""Pressures in time, and their conventions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jshell
from jshell.errors import BadName, BadShape, BadValue
from jshell.pressure import Pulse, Ramp, Recorded, Step, Sum, Tone, Zero
from jshell.shell import presets


@pytest.mark.parametrize("window", ["hann", "flat"])
@pytest.mark.parametrize("cycles", [1, 2, 3, 8])
def test_a_pulse_has_its_peak_negative_pressure_and_its_cycles(cycles, window):
    pulse = Pulse(0.3, 2.0, cycles, 1.0, window)
    t = np.linspace(0.0, 2.0 + pulse.duration, 200001)
    p = np.asarray(pulse(t))
    assert p.min() == pytest.approx(-0.3, rel=1e-7)  # the grid may miss the crest by half a sample
    assert np.all(p[(t < 1.0) | (t > 1.0 + pulse.duration)] == 0)
    assert pulse.duration == pytest.approx(cycles * np.pi)
    first = p[np.nonzero(p)[0][0]]
    assert first < 0  # rarefaction first
    assert np.sum(np.diff(np.sign(p[p != 0])) != 0) == 2 * cycles - 1


def test_ultrasound_units_lead_to_reduced_ones():
    unit = presets.R_MICRO.unit
    assert unit is not None
    pulse = Pulse.from_si(100e3, 50e3, 4, unit, start=1e-5)
    t = np.linspace(0, 2e-4, 100001)
    p = np.asarray(pulse(t / unit.time)) * unit.pressure
    assert p.min() == pytest.approx(-100e3, rel=1e-6)
    inside = t[p != 0]
    assert inside[-1] - inside[0] == pytest.approx(4 / 50e3, rel=1e-3)
    tone = Tone.from_si(1e3, 50e3, unit)
    assert float(tone(jnp.asarray(5e-6 / unit.time))) * unit.pressure == pytest.approx(1e3)


def test_steps_ramps_and_records():
    t = jnp.array([0.0, 1.0, 1.5, 2.0, 9.0])
    np.testing.assert_allclose(Step(0.2, 1.5)(t), [0, 0, 0.2, 0.2, 0.2])
    np.testing.assert_allclose(Ramp(stop=0.2, duration=1.0, begin=1.0)(t), [0, 0, 0.1, 0.2, 0.2])
    np.testing.assert_allclose(Recorded(np.array([1.0, 2.0]), np.array([0.0, 1.0]))(t), [0, 0, 0.5, 1, 1])
    np.testing.assert_allclose(Sum((Step(1.0), Zero()))(t), 1.0)
    slope = jax.grad(lambda a: jnp.sum(Ramp(stop=a, duration=1.0, begin=1.0)(t)))(0.2)
    assert slope == pytest.approx(2.5)


def test_wrong_pressures_are_refused():
    with pytest.raises(BadName, match="window"):
        Pulse(0.1, 1.0, window="box")
    with pytest.raises(BadValue, match="angular_frequency"):
        Tone(0.1, 0.0)
    with pytest.raises(BadValue, match="increase"):
        Recorded(np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    with pytest.raises(BadShape):
        Recorded(np.array([1.0, 2.0]), np.array([0.0]))


def test_one_ramp_serves_both_models():
    t = jnp.array([-1.0, 0.0, 0.25, 0.5, 9.0])
    np.testing.assert_allclose(Ramp(start=0.9, stop=1.6, duration=0.5)(t), [0.9, 0.9, 1.25, 1.6, 1.6], rtol=1e-14)
    np.testing.assert_array_equal(Ramp(start=0.9, stop=1.6, duration=0.0, begin=0.5)(t), [0.9, 0.9, 0.9, 1.6, 1.6])
    assert jshell.dynamics.Ramp is jshell.oscillator.Ramp is Ramp


def test_arguments_of_a_ramp_must_be_named():
    with pytest.raises(BadValue, match="without names"):
        Ramp(0.9, 1.6, 25.0)
    with pytest.raises(BadValue, match="no stop"):
        Ramp(start=0.9)
    with pytest.raises(BadValue, match="duration"):
        Ramp(stop=0.2, duration=-1.0)
    with pytest.warns(DeprecationWarning, match="stop=, begin="):
        before = Ramp(amplitude=0.2, duration=1.0, start=1.0)
    assert before == Ramp(stop=0.2, duration=1.0, begin=1.0)

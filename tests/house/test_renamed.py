"""Former public names answer for one release, and say the new one."""

import importlib

import jax.numpy as jnp
import numpy as np
import pytest

from jshell import calibration, comparators, contour, export, flow, oscillator, plot, pressure, sensitivity

RENAMED = {
    "jshell.calibration": {"Comparison": calibration.ModelComparison},
    "jshell.contour": {"Family": contour.SplineBasis},
    "jshell.export": {"Branch": export.LawBranch, "Run": export.RadialMotion},
    "jshell.sensitivity": {"Design": sensitivity.MatchingShells},
    "jshell.dynamics": {"Sampled": pressure.Recorded},
    "jshell.plot": {"heard": plot.identified_modes},
    "jshell.flow": {"turning": flow.gyroscopic},
    "jshell.oscillator": {
        "Passage": oscillator.Trajectory,
        "follow": oscillator.simulate_regimes,
        "Still": pressure.Zero,
        "Swing": pressure.RaisedCosine,
        "Together": pressure.Sum,
    },
}


@pytest.mark.parametrize("room", RENAMED)
def test_former_names_lead_to_the_new(room):
    module = importlib.import_module(room)
    for name, new in RENAMED[room].items():
        with pytest.warns(DeprecationWarning, match=rf"{room}\.{name} is now .*{new.__name__}"):
            assert getattr(module, name) is new
    with pytest.raises(AttributeError, match="nonesuch"):
        _ = module.nonesuch


def test_a_forced_protocol_is_a_sum():
    with pytest.warns(DeprecationWarning, match="forced"):
        made = importlib.import_module("jshell.dynamics").Forced(pressure.Hold(1.0), pressure.Step(0.5))
    assert made == pressure.Sum((pressure.Hold(1.0), pressure.Step(0.5)))


@pytest.mark.parametrize("kind", [pressure.Tone, pressure.Pulse])
def test_a_pulsation_is_an_angular_frequency(kind):
    with pytest.warns(DeprecationWarning, match="pulsation of .* is now angular_frequency"):
        made = kind(0.1, pulsation=2.0)
    assert made == kind(0.1, 2.0)
    with pytest.warns(DeprecationWarning, match=r"pulsation is now \w+\.angular_frequency"):
        assert made.pulsation == 2.0
    bubble = comparators.Marmottant(2e-6, 0.5)
    with pytest.warns(DeprecationWarning, match="linear_angular_frequencies"):
        assert bubble.linear_pulsations == bubble.linear_angular_frequencies


def test_former_keywords_of_functions_answer():
    times = jnp.linspace(0.0, 60.0, 601)
    wanted = oscillator.harmonics(times, jnp.sin(times), 1.0)
    with pytest.warns(DeprecationWarning, match="harmonics is now angular_frequency"):
        found = oscillator.harmonics(times, jnp.sin(times), pulsation=1.0)
    np.testing.assert_array_equal(found, wanted)

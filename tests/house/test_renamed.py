"""Former public names answer for one release, and say the new one."""

import importlib

import pytest

from jshell import flow, oscillator, pressure

RENAMED = {
    "jshell.dynamics": {"Sampled": pressure.Recorded},
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

"""What is called in a loop compiles once, whatever numbers it is given."""

import jax
import numpy as np
import pytest

import jshell as js
from jshell.oscillator import SOURCE, frequencies, ringing, simulate, thresholds
from jshell.oscillator.unbuckling import unbuckling_volume
from jshell.shell import buckled_state, sphere_state
from jshell.shell.sphere import buckling_load, sphere_frequency_at_load
from jshell.shell.unbuckling import unbuckling_load

TIMES = np.linspace(0.0, 20.0, 201)


def shell(load):
    return js.Reduced(0.08, 0.9, load, 0.004)


CALLS = {
    "frequencies": lambda x: frequencies(shell(x), SOURCE),
    "simulate": lambda x: simulate(shell(x), SOURCE, initial=(0.1, 0.0, 0.0, 0.0), times=TIMES),
    "sphere_state": lambda x: sphere_state(shell(x)),
    "sphere_frequency_at_load": lambda x: sphere_frequency_at_load(shell(x)),
    "buckling_load": lambda x: buckling_load(shell(x)),
    "unbuckling_load": lambda x: unbuckling_load(shell(x)),
    "unbuckling_volume": lambda x: unbuckling_volume(shell(x), SOURCE, buckled_state(shell(x))),
    "ringing": lambda x: ringing(shell(x)),
    "thresholds": lambda x: thresholds(shell(x), SOURCE),
}


@pytest.fixture
def compiled():
    """How many programs were compiled, counted by JAX."""
    seen = []
    note = lambda event, seconds, **_: seen.append(event) if event.endswith("compile_duration") else None  # noqa: E731
    jax.monitoring.register_event_duration_secs_listener(note)
    yield seen
    jax.monitoring.unregister_event_duration_listener(note)


@pytest.mark.parametrize("name", CALLS)
def test_a_second_call_compiles_nothing(name, compiled):
    CALLS[name](1.2)
    CALLS[name](1.21)
    compiled.clear()
    for load in (1.22, 1.23, 1.24):
        CALLS[name](load)
    assert compiled == []

"""What is called in a loop, whatever numbers it is given, gives its memory back."""

import gc
from functools import cache

import jax.numpy as jnp
import numpy as np
import psutil
import pytest

import jshell as js
from jshell import comparators, membrane, oscillator, pressure, shell, signals
from jshell.oscillator import SOURCE
from jshell.shell.sphere import buckling_load, marmottant_frequency, minnaert_frequency, sphere_frequency_at_load
from jshell.shell.unbuckling import unbuckling_load

TIMES = np.linspace(0.0, 20.0, 201)
MOST = 50.0  # MB
OFTEN, SELDOM, RARE = 10_000, 1_000, 50  # calls: of what takes under a millisecond, of what takes longer, or seconds


def reduced(x):
    return js.Reduced(0.08, 0.9, x, 0.004)


def state(x):
    return shell.buckled_state(reduced(x))


def from_si(x):
    return js.Reduced.from_si(
        js.Shell(0.0225, 5e-3, 5e5), js.Gas(1e5), js.Liquid(1260.0, 1.0), js.Load(1.4e5 * x)
    )  # fmt: skip


@cache
def record():
    return oscillator.random_trace(oscillator.random_shell(0), 0)


def louder(x):
    clean = record()
    return js.Trace(clean.times, {name: x * values for name, values in clean.channels.items()}, clean.conditions)


@cache
def thick():
    return membrane.rest(js.presets.R.conditions, elements=12)


QUICK = {
    "Reduced.from_si": from_si,
    "moduli": lambda x: shell.moduli(0.1 * x, 0.5),
    "plateau_pressure": lambda x: shell.plateau_pressure(0.1 * x, 0.5),
    "buckling_threshold": lambda x: shell.buckling_threshold(0.1 * x, 0.5),
    "sphere_energy": lambda x: shell.sphere_energy(0.7 * x, 0.22, 0.5),
    "gas_pressure": lambda x: shell.gas_pressure(2.0 * x, reduced(x)),
    "buckled_state": state,
    "sphere_state": lambda x: shell.sphere_state(reduced(x)),
    "sphere_frequency_at_load": lambda x: sphere_frequency_at_load(reduced(x)),
    "marmottant_frequency": lambda x: marmottant_frequency(reduced(x)),
    "minnaert_frequency": lambda x: minnaert_frequency(x, 1.4),
    "buckling_load": lambda x: buckling_load(reduced(x)),
    "unbuckling_load": lambda x: unbuckling_load(reduced(x)),
    "frequencies": lambda x: oscillator.frequencies(reduced(x), SOURCE),
    "simulate": lambda x: oscillator.simulate(reduced(x), SOURCE, initial=(0.1, 0.0, 0.0, 0.0), times=TIMES),
    "squared_frequencies": lambda x: oscillator.squared_frequencies(
        volume=2.8, pressure=x, alpha1=3.6, alpha2=1.1, k_vs=0.23, kappa=1.4, area_modulus=1.0
    ),
    "matrices": lambda x: oscillator.matrices(SOURCE, state(x), reduced(x)),
    "stability_margin": lambda x: oscillator.stability_margin(state(x), SOURCE, reduced(x)),
    "decay_time": lambda x: oscillator.decay_time(SOURCE, 0.004 * x),
    "drag_coefficient": lambda x: oscillator.drag_coefficient(jnp.asarray(30.0 * x)),
    "ringing": lambda x: oscillator.ringing(reduced(x)),
    "thresholds": lambda x: oscillator.thresholds(reduced(x), SOURCE),
    "unbuckling_volume": lambda x: oscillator.unbuckling.unbuckling_volume(reduced(x), SOURCE, state(x)),
    "thinnest_round": lambda x: membrane.thinnest_round(0.6 * x),
    "radial_frequencies": lambda x: comparators.radial_frequencies(reduced(x)),
}
SLOW = {
    "damped_modes": lambda x: oscillator.damped_modes(oscillator.matrices(SOURCE, state(x), reduced(x))),
    "drive": lambda x: oscillator.drive(reduced(x), SOURCE, pressure.Tone(0.02 * x, 1.2), times=TIMES),
    "simulate_regimes": lambda x: oscillator.simulate_regimes(
        reduced(x), SOURCE, pressure.Ramp(start=0.9, stop=1.1 * x, duration=5.0, begin=0.0), times=TIMES
    ),
    "extract": lambda x: signals.extract(louder(x), start=0.0),
    "fit, strict": lambda x: js.fit(record()),
    "fit, modal": lambda x: js.fit(louder(x), "modal", channels=["V"]),
    "fit_batch": lambda x: js.calibration.fit_batch([record()] * 8),
    "rest": lambda x: membrane.rest(js.presets.R.conditions.replace(outer_pressure=1.35 * x), elements=12),
    "stability": lambda x: membrane.stability(thick(), orders=(2, 3)),
    "modes": lambda x: js.modes(
        js.presets.R.conditions.replace(outer_pressure=1.35 * x), elements=12, liquid="second", count=2
    ),
    "read_trace": lambda x: js.io.read_trace(js.io.encode_trace("a.csv", record())),
}
SLOWEST = {
    "fit, posterior": lambda x: js.fit(louder(x)).posterior(50, warmup=50, chains=1),
    "fit, profile": lambda x: js.fit(louder(x)).profile(),
    "fit, bootstrap": lambda x: js.fit(louder(x)).bootstrap(20),
}


def grown(call, count):
    """How much more memory a process holds after so many calls [MB]."""
    near = np.linspace(1.2, 1.21, count)
    for x in near[:: max(1, count // 100)]:
        call(float(x))
    gc.collect()
    before = psutil.Process().memory_info().rss
    for x in near:
        call(float(x))
    gc.collect()
    return (psutil.Process().memory_info().rss - before) / 2**20


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", QUICK)
def test_ten_thousand_calls_keep_no_memory(name):
    assert grown(QUICK[name], OFTEN) < MOST


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SLOW)
def test_a_thousand_slower_calls_keep_no_memory(name):
    assert grown(SLOW[name], SELDOM) < MOST


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SLOWEST)
def test_fifty_calls_of_seconds_keep_no_memory(name):
    assert grown(SLOWEST[name], RARE) < MOST


def test_memory_that_is_kept_is_seen():
    kept = []
    assert grown(lambda x: kept.append(np.full(2**20, x)), 20) > MOST

"""Public functions that are called differentiable: eager and compiled, in every number, against differences.

Modes have theirs in `tests/dynamics/test_modes.py`, runs of the simulator in `tests/dynamics/test_simulate.py`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell import membrane, pressure
from jshell.oscillator import (
    Coefficients,
    damped_modes,
    decay_time,
    drag_coefficient,
    drive,
    frequencies,
    matrices,
    simulate,
    squared_frequencies,
    stability_margin,
    thresholds,
)
from jshell.shell import (
    Gas,
    Liquid,
    Load,
    Reduced,
    Shell,
    buckled_state,
    buckling_threshold,
    gas_pressure,
    moduli,
    plateau_pressure,
    sphere_energy,
    sphere_state,
)
from jshell.shell.rest import RestState
from jshell.shell.sphere import buckling_load, marmottant_frequency, minnaert_frequency, sphere_frequency_at_load

R = {
    "thickness": 0.22,
    "gas_pressure": 0.9,
    "outer_pressure": 1.6,
    "viscosity": 0.004,
    "kappa": 1.4,
    "poisson_ratio": 0.45,
}
C = {"alpha1": 3.6, "alpha2": 1.1, "k_vs": 0.23, "beta1": 5.0, "beta2": 2.0}
SI = {
    "radius": 0.0225, "thickness": 5e-3, "youngs_modulus": 5e5, "poisson_ratio": 0.45, "gas": 1e5, "kappa": 1.4,
    "density": 1260.0, "viscosity": 1.0, "load": 1.77e5,
}  # fmt: skip
TIMES = np.linspace(0.0, 8.0, 9)


class Subject(NamedTuple):
    """A function of numbers, and where its derivative is taken.

    Attributes:
        number: Of the arguments by name.
        at: The arguments.
        step: Of the difference, relative to each.
        near: Relative error that the difference is allowed, of the largest derivative that an argument has.
        alone: Arguments that are also differentiated by themselves, the others plain numbers; None is each of them.
    """

    number: Callable[..., Any]
    at: dict[str, float]
    step: float = 1e-4
    near: float = 1e-6
    alone: tuple[str, ...] | None = None


def _conditions(**given: Any) -> Reduced:
    return Reduced(*(given[name] for name in R))


def _short(**given: Any) -> tuple[Reduced, Coefficients]:
    return _conditions(**given), Coefficients(*(given[name] for name in C))


def _weighed(*parts: Any) -> Any:
    """One number of several, so that none of their derivatives hides behind another's."""
    flat = jnp.concatenate([jnp.ravel(jnp.asarray(part)) for part in parts])
    return jnp.sum(flat * (1 + jnp.arange(flat.size)) / flat.size)


def _from_si(**x: Any) -> Any:
    shell = Shell(x["radius"], x["thickness"], x["youngs_modulus"], x["poisson_ratio"])
    liquid = Liquid(x["density"], x["viscosity"])
    made = Reduced.from_si(shell, Gas(x["gas"], x["kappa"]), liquid, Load(x["load"]))
    return _weighed(*(getattr(made, name) for name in R))


def _simulated(**x: Any) -> Any:
    initial = tuple(x[name] for name in ("delta_V", "delta_S", "V_rate", "S_rate"))
    trace = simulate(*_short(**x), initial=initial, times=TIMES)
    return _weighed(trace["V"], trace["S"])


def _driven(**x: Any) -> Any:
    tone = pressure.Tone(x["amplitude"], x["angular_frequency"])
    motion = drive(*_short(**x), tone, times=TIMES, initial=(0.1, -0.1, 0.0, 0.0), budget=False)
    return _weighed(motion.motion.V, motion.motion.S)


def _at_rest(**x: Any) -> Any:
    shape = membrane.rest(_conditions(**x), elements=16)
    return _weighed(shape.volume, shape.area, shape.pressure)


def _forcing(make: Callable[..., Any], **x: Any) -> Any:
    t = x.pop("t")
    return make(**x)(t)


LAWS = {
    "step": (pressure.Step, {"amplitude": 0.3, "start": 0.5, "t": 2.0}),
    "ramp": (pressure.Ramp, {"stop": 1.6, "start": 0.9, "duration": 5.0, "begin": 0.5, "t": 2.0}),
    "tone": (pressure.Tone, {"amplitude": 0.2, "angular_frequency": 1.3, "phase": 0.4, "rise": 2.0, "t": 3.0}),
    "raised cosine": (pressure.RaisedCosine, {"low": 0.9, "high": 1.6, "period": 7.0, "t": 3.0}),
}
FLOWING = Subject(lambda **x: drag_coefficient(x["reynolds"]), {"reynolds": 30.0})
SUBJECTS = {
    "from_si": Subject(_from_si, SI),
    "moduli": Subject(lambda **x: _weighed(*moduli(**x)), {"thickness": 0.22, "poisson_ratio": 0.45}),
    "sphere_energy": Subject(sphere_energy, {"radius": 0.9, "thickness": 0.22, "poisson_ratio": 0.45}),
    "buckling_threshold": Subject(buckling_threshold, {"thickness": 0.22, "poisson_ratio": 0.45}),
    "plateau_pressure": Subject(plateau_pressure, {"thickness": 0.22, "poisson_ratio": 0.45}),
    "gas_pressure": Subject(lambda **x: gas_pressure(x["volume"], _conditions(**x)), R | {"volume": 2.8}),
    "buckled_state": Subject(lambda **x: _weighed(*buckled_state(_conditions(**x))), R),
    "sphere_state": Subject(lambda **x: _weighed(*sphere_state(_conditions(**x))), R),
    "sphere_frequency": Subject(lambda **x: sphere_frequency_at_load(_conditions(**x)), R),
    "marmottant_frequency": Subject(lambda **x: marmottant_frequency(_conditions(**x)), R),
    "minnaert_frequency": Subject(minnaert_frequency, {"pressure": 1.6, "kappa": 1.4}),
    "buckling_load": Subject(lambda **x: buckling_load(_conditions(**x)), R),
    "squared_frequencies": Subject(
        lambda **x: _weighed(squared_frequencies(**x)),
        {"volume": 2.8, "pressure": 1.6, "alpha1": 3.6, "alpha2": 1.1, "k_vs": 0.23, "kappa": 1.4, "area_modulus": 1.0},
    ),
    "frequencies": Subject(lambda **x: _weighed(*jax.tree.leaves(frequencies(*_short(**x)))), R | C),
    "matrices": Subject(
        lambda **x: _weighed(*jax.tree.leaves(matrices(_short(**x)[1], RestState(x["V"], x["P"]), _conditions(**x)))),
        R | C | {"V": 2.8, "P": 1.6},
    ),
    "damped_modes": Subject(
        lambda **x: _weighed(*map(jnp.real, jax.tree.leaves(damped_modes(
            matrices(_short(**x)[1], RestState(x["V"], x["P"]), _conditions(**x))
        )))),
        R | C | {"V": 2.8, "P": 1.6},
    ),
    "stability_margin": Subject(
        lambda **x: stability_margin(RestState(x["V"], x["P"]), _short(**x)[1], _conditions(**x)),
        R | C | {"V": 2.8, "P": 1.6},
    ),
    "decay_time": Subject(lambda **x: decay_time(_short(**x)[1], x["viscosity"]), R | C),
    "drag_coefficient": FLOWING,
    "simulate": Subject(_simulated, R | C | {"delta_V": 0.1, "delta_S": -0.1, "V_rate": 0.05, "S_rate": 0.02}),
    "thresholds": Subject(lambda **x: _weighed(*jax.tree.leaves(thresholds(*_short(**x)))), R | C),
    **{name: Subject(lambda make=make, **x: _forcing(make, **x), at) for name, (make, at) in LAWS.items()},
}  # fmt: skip
# what compiles for seconds
DEAR = {
    "buckled_state", "buckling_load", "damped_modes", "drive", "frequencies", "from_si", "rest", "simulate",
    "sphere_frequency", "sphere_state", "thresholds",
}  # fmt: skip
SUBJECTS |= {
    "drive": Subject(_driven, R | C | {"amplitude": 0.02, "angular_frequency": 1.2}, 1e-3, 1e-5, ("k_vs",)),
    "rest": Subject(_at_rest, R, 1e-3, 1e-4, ("thickness",)),
}  # fmt: skip


def check(subject: Subject) -> None:
    """Every derivative at once, eager and compiled; and by itself, the others plain numbers, as a user writes it."""
    at = {name: float(value) for name, value in subject.at.items()}
    number = lambda x: jnp.asarray(subject.number(**x))  # noqa: E731
    compiled = jax.jit(number)
    whole, eager = jax.jit(jax.grad(number))(at), jax.grad(number)(at)
    size = max(abs(float(value) * at[name]) for name, value in whole.items())
    for name, value in at.items():
        alone = lambda one, name=name: number(at | {name: one})  # noqa: E731
        step = subject.step * abs(value)
        moved = [float(compiled(at | {name: value + k * step})) for k in (-2, -1, 1, 2)]
        difference = (8 * (moved[2] - moved[1]) - (moved[3] - moved[0])) / (12 * step)  # to the fourth order
        allowed = subject.near * max(size / abs(value), abs(difference))
        kinds = {"eager": eager[name], "jitted": whole[name]}
        if subject.alone is None or name in subject.alone:
            kinds["alone"] = jax.grad(alone)(value)
        for kind, found in kinds.items():
            assert abs(float(found) - difference) <= allowed, (name, kind, float(found), difference)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")  # of the plateau law at this thickness
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in DEAR else ()) for name in SUBJECTS]
)
def test_a_derivative_is_the_difference(name):
    check(SUBJECTS[name])

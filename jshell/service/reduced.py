"""The short model of one shell, at once: frequencies, how much it softens, how it rings.

One compiled program serves every request: sizes are fixed, and all that a
request brings is numbers.

Symbols    ω± angular frequencies [sqrt(E d/(ρ_f R0³))]   V volume [R0³]   S area [R0²]   τ decay time
Source     Mokbel et al. 2021: eq:defw, fig:soft, eq:taureal
"""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell import oscillator
from jshell.errors import Outcome
from jshell.oscillator import SOURCE, Coefficients
from jshell.oscillator.linear import matrices, uniform_propagator
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState

SAMPLES = 481  # of the trace
LOADS = 121  # outer pressures of the curve
PUSH = 0.01  # of the volume at rest: the motion shown is that after such a push, released at rest
REACH = 1.6  # the curve goes up to so many buckling loads
Array = jax.Array | np.ndarray


class ModelAnswer(eqx.Module):
    """What the short model says of a shell; NaN where it says nothing.

    Attributes:
        outcome: Of the shell at its load, a code of `Outcome`.
        omega: ω-, ω+, the sphere's, Marmottant's.
        rest: Volume and pressure at rest.
        softening: Buckling load, then sphere before over ω-, ω+ and Marmottant's after.
        loads: (LOADS,) outer pressures.
        crossing: (4, LOADS) angular frequencies of sphere, ω-, ω+, Marmottant.
        times: (SAMPLES,).
        motion: (2, SAMPLES) V and S.
    """

    outcome: Array
    omega: Array
    rest: Array
    softening: Array
    loads: Array
    crossing: Array
    times: Array
    motion: Array


def answer(conditions: Reduced, coefficients: Coefficients = SOURCE, duration: float | int = 60.0) -> ModelAnswer:
    """All that the short model says of a shell.

    Args:
        conditions: The shell and its load.
        coefficients: Constants of the short model.
        duration: Of the trace, dimensionless.
    """
    c = coefficients
    numbers = [c.alpha1, c.alpha2, c.k_vs, c.beta1, float(duration)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the page and the API say the range of the law beside the numbers
        return jax.device_get(_all(conditions.as_arrays(), jnp.asarray(numbers, dtype=float)))


@eqx.filter_jit
def _all(conditions: Reduced, numbers: jax.Array) -> ModelAnswer:
    alpha1, alpha2, k_vs, beta1, duration = numbers
    c = Coefficients(alpha1, alpha2, k_vs, beta1)
    found = oscillator.frequencies(conditions, c)
    state = RestState(found.volume, found.pressure)
    fall = oscillator.softening(conditions.thickness, conditions.gas_pressure, c)
    top = jnp.where(jnp.isfinite(fall.load), REACH * fall.load, 2 * conditions.gas_pressure)
    top = jnp.maximum(top, 1.1 * conditions.outer_pressure)
    loads = conditions.gas_pressure + (top - conditions.gas_pressure) * jnp.linspace(0.0, 1.0, LOADS)
    curve = oscillator.crossing(conditions.thickness, conditions.gas_pressure, c, loads)
    over = jnp.stack([curve.sphere, curve.slow, curve.fast, curve.marmottant]) * curve.unit

    step = duration / (SAMPLES - 1)
    motion = uniform_propagator(matrices(c, state, conditions), step, SAMPLES)
    pushed = motion[:, :2, 0] * (PUSH * state.volume)
    area = 4 * jnp.pi
    channels = jnp.stack([state.volume + pushed[:, 0], area + pushed[:, 1]])
    omega = jnp.stack([found.omega_minus, found.omega_plus, found.omega_sphere, found.omega_marmottant])
    buckled = found.outcome != int(Outcome.NO_BUCKLED_STATE)
    omega = jnp.where(jnp.array([1, 1, 0, 1]).astype(bool) & ~buckled, jnp.nan, omega)
    rest = jnp.where(buckled, jnp.stack([state.volume, state.pressure]), jnp.nan)
    ok = found.outcome == int(Outcome.OK)
    return ModelAnswer(
        found.outcome,
        omega,
        rest,
        jnp.stack([fall.load, fall.slow, fall.fast, fall.marmottant]),
        loads,
        over,
        step * jnp.arange(SAMPLES),
        jnp.where(ok, channels, jnp.nan),
    )

"""Where a dimple vanishes: the volume at which the buckled branch meets the sphere's.

Slowly unloaded, the buckled wall bears the plateau pressure and, away from
its rest state, what its coupling to the area adds. A sphere bears just that at
one volume: there the two rest states share volume, gas pressure and load. The
dimple has shrunk to nothing and the shell is a sphere. Buckling needs the
higher classical pressure: between the two loads both states stand.

Symbols    V volume [R0³]   R radius [R0]   A_VS, A_SS slopes of the wall's energy
Valid for  the short model around one rest state
Source     Mokbel et al. 2021: eq:US, eq:NRJsph; the criterion is this project's
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients
from jshell.scalar_root import root_of
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState
from jshell.shell.unbuckling import wall_pressure


def borne(volume: Any, conditions: Reduced, coefficients: Coefficients, state: RestState) -> Any:
    """Pressure difference that the buckled wall bears at a volume, its area at rest there [E d/R0].

    The plateau ΔP_pl of the rest state, and A_VS²/A_SS per volume beyond it.
    """
    A_VS = coefficients.k_vs / state.volume
    A_SS = moduli(conditions.thickness, conditions.poisson_ratio).area / SPHERE_AREA
    return conditions.outer_pressure - state.pressure + A_VS**2 / A_SS * (volume - state.volume)


def unbuckling_volume(conditions: Reduced, coefficients: Coefficients, state: RestState) -> Float[Array, "*batch"]:
    """Volume at which the dimple is gone [R0³]; NaN where the two branches do not meet. Batches are welcome."""
    at_rest = borne(state.volume, conditions, coefficients, state)
    slope = borne(state.volume + 1.0, conditions, coefficients, state) - at_rest

    given = (at_rest, slope, state.volume, conditions.thickness, conditions.poisson_ratio)
    numbers = jnp.broadcast_arrays(*(jnp.asarray(x, dtype=float) for x in given))
    return _meeting(*numbers)


@jax.jit
@jnp.vectorize
def _meeting(plateau: Any, slope: Any, V_e: Any, thickness: Any, ratio: Any) -> jax.Array:
    like = Reduced(thickness, 1.0, 1.0, poisson_ratio=ratio)
    excess = lambda R, _: wall_pressure(R, like) - plateau - slope * (SPHERE_VOLUME * R**3 - V_e)  # noqa: E731
    return SPHERE_VOLUME * root_of(excess, jnp.asarray(1.0)) ** 3

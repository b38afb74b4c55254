"""Where a dimple vanishes: the volume at which the buckled branch meets the sphere's.

A buckled wall bears the plateau pressure whatever its volume. A sphere bears
exactly that at one radius: there the two rest states share volume, gas
pressure and load, the dimple has shrunk to nothing, and the shell is a sphere.
Buckling needs the higher classical pressure: between the two loads both stand.

Symbols    R radius [R0]   V volume [R0³]   ΔP_pl plateau, ΔP_b buckling threshold [E d/R0]
Valid for  the plateau law's range of thickness
Source     Mokbel et al. 2021: eq:equiplateau, eq:NRJsph; the criterion is this project's
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.scalar_root import root_of
from jshell.shell.elasticity import SPHERE_VOLUME, Scalar, buckling_threshold, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure, plateau_pressure


def wall_pressure(radius: Scalar, conditions: Reduced) -> Float[Array, "..."]:
    """Pressure difference that a sphere of radius R bears, -U'(R)/(4πR²) [E d/R0]."""
    K, R = moduli(conditions.thickness, conditions.poisson_ratio), jnp.asarray(radius)
    return 4 * (1 - R) * (K.area * R * (2 * R - 1) + K.bending) / R**2


def radius_bearing(pressure: Scalar, conditions: Reduced) -> Float[Array, "..."]:
    """Radius of the sphere whose wall bears a pressure difference; NaN where none does. Batches are welcome."""
    numbers = (jnp.asarray(x, dtype=float) for x in (pressure, conditions.thickness, conditions.poisson_ratio))
    return _radius_bearing(*jnp.broadcast_arrays(*numbers))


@jax.jit
@jnp.vectorize
def _radius_bearing(pressure: jax.Array, thickness: jax.Array, ratio: jax.Array) -> jax.Array:
    like = Reduced(thickness, 1.0, 1.0, poisson_ratio=ratio)
    excess = lambda R, args: wall_pressure(R, like) - pressure  # noqa: E731
    return root_of(excess, jnp.asarray(1.0))


def unbuckling_volume(conditions: Reduced) -> Float[Array, "..."]:
    """Volume above which a dimple is gone [R0³]."""
    plateau = plateau_pressure(conditions.thickness, conditions.poisson_ratio)
    return SPHERE_VOLUME * radius_bearing(plateau, conditions) ** 3


def unbuckling_load(conditions: Reduced) -> Float[Array, "..."]:
    """Outer pressure at which the two branches of rest states meet [E d/R0]; that of `conditions` is not read."""
    plateau = plateau_pressure(conditions.thickness, conditions.poisson_ratio)
    return gas_pressure(unbuckling_volume(conditions), conditions) + plateau


def buckling_volume(conditions: Reduced) -> Float[Array, "..."]:
    """Volume of the sphere whose wall bears the classical threshold ΔP_b [R0³]."""
    threshold = buckling_threshold(conditions.thickness, conditions.poisson_ratio)
    return SPHERE_VOLUME * radius_bearing(threshold, conditions) ** 3

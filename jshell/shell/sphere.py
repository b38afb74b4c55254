"""The intact sphere: how it rings, and the load at which it buckles.

One coordinate, the radius. Both the short model and the radial comparators
hold their buckled shell against these numbers.

Symbols    R radius [R0]   P inner pressure [E d/R0]
           ω angular frequency [sqrt(E d/(ρ_f R0³))]   ΔP_b buckling threshold [E d/R0]
Valid for  small radial oscillations about any compressed sphere
Source     Mokbel et al. 2021: eq:wsphere, eq:NRJsph; section "Softening of buckled shells"
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.shell.elasticity import SPHERE_VOLUME, Scalar, buckling_threshold, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, gas_pressure, sphere_state
from jshell.shell.unbuckling import buckling_volume


def sphere_frequency(state: RestState, conditions: Reduced) -> Float[Array, ""]:
    """Angular frequency of the sphere about a compressed rest state, undamped.

    Written in the radius; in volumes it is the printed form.

    Returns:
        ω [sqrt(E d/(ρ_f R0³))]; NaN where the sphere would not stand.

    Source:
        eq:wsphere.
    """
    R, P = jnp.cbrt(state.volume / SPHERE_VOLUME), state.pressure
    K = moduli(conditions.thickness, conditions.poisson_ratio)

    gas = 3 * conditions.kappa * P
    wall = 4 * K.area * (2 * R**2 - 1) / R + 4 * K.bending * (2 - R) / R**2
    return jnp.sqrt(gas + wall) / R


def sphere_frequency_at_load(conditions: Reduced) -> Float[Array, ""]:
    """Angular frequency of the sphere compressed by the outer pressure of `conditions`, had it not buckled."""
    return sphere_frequency(sphere_state(conditions), conditions)


def minnaert_frequency(pressure: Scalar, kappa: Scalar = 1.4) -> Float[Array, ""]:
    """Angular frequency sqrt(3 κ P) of a bare bubble of radius R0 at a pressure [sqrt(E d/(ρ_f R0³))]."""
    return jnp.sqrt(3 * kappa * jnp.asarray(pressure))


def marmottant_frequency(conditions: Reduced) -> Float[Array, ""]:
    """Angular frequency of a buckled shell that resists nothing: a bubble of radius R0 at the outer pressure.

    Source:
        Caption of fig:soft, after Marmottant et al. 2005.
    """
    return minnaert_frequency(conditions.outer_pressure, conditions.kappa)


def buckling_load(conditions: Reduced) -> Float[Array, ""]:
    """Outer pressure at which the compressed sphere reaches the classical threshold [E d/R0].

    The wall bears ΔP_b at a radius R, and the gas, compressed to R, the rest.
    The outer pressure of `conditions` is not read.

    Returns:
        P̂ext; NaN where the wall bears less than ΔP_b at any radius (very thick walls).

    Source:
        Section "Softening of buckled shells"; eq:NRJsph.
    """
    threshold = jnp.asarray(buckling_threshold(conditions.thickness, conditions.poisson_ratio))
    return gas_pressure(buckling_volume(conditions), conditions) + threshold

"""Energies of the short model, and the motion that follows from them.

Kinetic energy T, potential energy U and dissipation D are functions of volume
and area; Euler and Lagrange do the rest by automatic differentiation. This is
the nonlinear model. Its linear part is written out in `linear`.

A position is anything that unpacks into V and S: an array (2,), or a pair of
arrays of one shape, a batch in their last axis; a velocity likewise.

Symbols    q = (V, S) volume [R0³], area [R0²]   P inner pressure [E d/R0]
           T, U [E d R0²]   D [E d R0² / time]   g dipole moment per area rate [R0²]
Valid for  a buckled shell: T is singular at S = 2π R0²; U_S is quadratic about rest
Source     Mokbel et al. 2021: eq:Lag, eq:Ug, eq:Upext, eq:US, eq:T, eq:D
"""

from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients, dipole_dissipation
from jshell.shell.elasticity import SPHERE_AREA, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState

Values: TypeAlias = Float[Array, "*batch"]
Pair: TypeAlias = Float[Array, "2"] | tuple[Values, Values]
SMALLEST_AREA = 2 * jnp.pi  # the flat state, where the midsurface has no slope and a dipole costs no end of energy


def dipole_moment(position: Pair) -> Values:
    """Dipole moment per rate of area, g(V, S) [R0²]; at rest g² = 4 V²/(3π²).

    At the flat state S = 2π and below it is infinite: a motion ends there (`events`), it is not continued.
    """
    V, S = position
    square = S**2 - SMALLEST_AREA**2
    bent = square > 0
    slope = jnp.where(bent, jnp.sqrt(jnp.where(bent, square, 1.0)), 0.0)
    return jnp.asarray(-V * S / (jnp.pi * slope))


def kinetic_energy(position: Pair, velocity: Pair, coefficients: Coefficients) -> Values:
    """Kinetic energy of the liquid: a source and a dipole (eq:T)."""
    dV, dS = velocity
    g = dipole_moment(position)
    source = coefficients.alpha1 * dV**2 / (8 * jnp.pi)
    return jnp.asarray(source + coefficients.alpha2 * (g * dS) ** 2 / (12 * jnp.pi))


def gas_energy(position: Pair, state: RestState, conditions: Reduced) -> Values:
    """Work that the gas can do, P_e V_e/(κ-1) (V_e/V)^(κ-1) less its value at κ = 1 where that diverges (eq:Ug)."""
    V, _ = position
    V_e, P_e = state
    kappa = jnp.asarray(conditions.kappa, dtype=float)

    x = jnp.log(V / V_e)
    power = kappa - 1
    near = jnp.abs(power) < 1e-4  # the power of eq:Ug becomes a logarithm: its series, exact to 1e-13 there
    series = -x * (1 - power * x / 2 * (1 - power * x / 3))
    return P_e * V_e * jnp.where(near, series, jnp.expm1(-power * x) / jnp.where(near, 1.0, power))


def wall_energy(position: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced) -> Values:
    """Elastic energy of the wall, from that of the rest state.

    The plateau ΔP_pl of eq:US is what the rest state bears, P_ext - P_e, so
    the shell rests there whichever law gave the state.

    Source:
        eq:US; A_SS = K_A/S_e, which is E d/S_e at ν = 1/2.
    """
    V, S = position
    V_e, P_e = state
    S_e = SPHERE_AREA
    A_VS = coefficients.k_vs / V_e
    A_SS = moduli(conditions.thickness, conditions.poisson_ratio).area / S_e
    plateau = conditions.outer_pressure - P_e
    return jnp.asarray(-plateau * (V - V_e) + A_VS * (V - V_e) * (S - S_e) + A_SS * (S - S_e) ** 2 / 2)


def potential_energy(position: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced) -> Values:
    """Energy of gas, wall and steady outer pressure, from that of the rest state (eq:Ug, eq:Upext, eq:US)."""
    V, _ = position
    V_e, _ = state
    outer = conditions.outer_pressure * (V - V_e)
    return gas_energy(position, state, conditions) + outer + wall_energy(position, state, coefficients, conditions)


def dissipation(position: Pair, velocity: Pair, coefficients: Coefficients, conditions: Reduced) -> Values:
    """Rayleigh's dissipation function, half the power lost in the liquid (eq:D, dipole as `coefficients` say)."""
    dV, dS = velocity
    g = dipole_moment(position)
    source = coefficients.beta1 * dV**2 / (2 * jnp.pi)
    dipole = coefficients.area_damping * dipole_dissipation(coefficients.dipole) * (g * dS) ** 2
    return jnp.asarray(conditions.viscosity * (source + dipole))


def masses(position: Pair, coefficients: Coefficients) -> tuple[Values, Values]:
    """Inertia of volume and area, ∂²T/∂q̇²; T has no mixed term."""
    V, S = position
    q, still, one = (V, S), jnp.zeros_like(V), jnp.ones_like(V)

    def momentum(v: Any) -> Any:
        return _slopes(lambda v: kinetic_energy(q, v, coefficients), v)

    mass_V = jax.jvp(momentum, ((still, still),), ((one, still),))[1][0]
    mass_S = jax.jvp(momentum, ((still, still),), ((still, one),))[1][1]
    return mass_V, mass_S


def inertial_force(position: Pair, velocity: Pair, coefficients: Coefficients) -> tuple[Values, Values]:
    """∂T/∂q less the part of d/dt ∂T/∂q̇ that comes from the motion of q alone."""
    q, v = _pair(position), _pair(velocity)

    def momentum(q: Any) -> Any:
        return _slopes(lambda v: kinetic_energy(q, v, coefficients), v)

    drift = jax.jvp(momentum, (q,), (v,))[1]
    pushforward = _slopes(lambda q: kinetic_energy(q, v, coefficients), q)
    return pushforward[0] - drift[0], pushforward[1] - drift[1]


def elastic_force(
    position: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced
) -> tuple[Values, Values]:
    """-∂U/∂q: what gas, wall and steady outer pressure do to volume and area."""
    up = _slopes(lambda q: potential_energy(q, state, coefficients, conditions), _pair(position))
    return -up[0], -up[1]


def viscous_force(
    position: Pair, velocity: Pair, coefficients: Coefficients, conditions: Reduced
) -> tuple[Values, Values]:
    """-∂D/∂q̇ (eq:Lag)."""
    up = _slopes(lambda v: dissipation(_pair(position), v, coefficients, conditions), _pair(velocity))
    return -up[0], -up[1]


def acceleration(
    position: Pair, velocity: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced
) -> Float[Array, "2 *batch"]:
    """Acceleration of volume and area under the steady load, by Euler–Lagrange (eq:Lag)."""
    parts = (
        inertial_force(position, velocity, coefficients),
        elastic_force(position, state, coefficients, conditions),
        viscous_force(position, velocity, coefficients, conditions),
    )
    mass = masses(position, coefficients)
    return jnp.stack([sum(part[i] for part in parts) / mass[i] for i in (0, 1)])


def _slopes(function: Any, at: Any) -> Any:
    """Gradient of a function that acts on each lane of a batch by itself."""
    return jax.grad(lambda at: jnp.sum(function(at)))(at)


def _pair(q: Pair) -> tuple[Any, Any]:
    V, S = q
    return V, S

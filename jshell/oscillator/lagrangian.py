"""Energies of the short model, and the motion that follows from them.

Kinetic energy T, potential energy U and dissipation D are functions of volume
and area; Euler and Lagrange do the rest by automatic differentiation. This is
the nonlinear model. Its linear part is written out in `linear`.

Symbols    q = (V, S) volume [R0³], area [R0²]   P pressure [E d/R0]
           T, U [E d R0²]   D [E d R0² / time]   g dipole moment per area rate [R0²]
Valid for  a buckled shell: T is singular at S = 2π R0²; U_S is quadratic about rest
Source     Mokbel et al. 2021: eq:Lag, eq:Ug, eq:Upext, eq:US, eq:T, eq:D
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients, dipole_dissipation
from jshell.shell.elasticity import SPHERE_AREA, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState

Pair = Float[Array, "2"]


def dipole_moment(position: Pair) -> Float[Array, ""]:
    """Dipole moment per rate of area, g(V, S) [R0²]; at rest g² = 4 V²/(3π²)."""
    V, S = position
    return -V * S / (jnp.pi * jnp.sqrt(S**2 - 4 * jnp.pi**2))


def kinetic_energy(position: Pair, velocity: Pair, coefficients: Coefficients) -> Float[Array, ""]:
    """Kinetic energy of the liquid: a source and a dipole (eq:T)."""
    dV, dS = velocity
    g = dipole_moment(position)
    return coefficients.alpha1 * dV**2 / (8 * jnp.pi) + coefficients.alpha2 * (g * dS) ** 2 / (12 * jnp.pi)


def potential_energy(
    position: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced
) -> Float[Array, ""]:
    """Energy of gas, wall and outer pressure, from that of the rest state.

    The plateau ΔP_pl of eq:US is what the rest state bears, P_ext - P_e, so
    the shell rests there whichever law gave the state.

    Source:
        eq:Ug, eq:Upext, eq:US; A_SS = K_A/S_e, which is E d/S_e at ν = 1/2.
    """
    V, S = position
    V_e, P_e = state
    S_e = SPHERE_AREA
    kappa = jnp.asarray(conditions.kappa, dtype=float)

    x = jnp.log(V / V_e)
    power = kappa - 1
    near = jnp.abs(power) < 1e-4  # the power of eq:Ug becomes a logarithm: its series, exact to 1e-13 there
    series = -x * (1 - power * x / 2 * (1 - power * x / 3))
    gas = P_e * V_e * jnp.where(near, series, jnp.expm1(-power * x) / jnp.where(near, 1.0, power))

    outer = conditions.outer_pressure * (V - V_e)

    A_VS = coefficients.k_vs / V_e
    A_SS = moduli(conditions.thickness, conditions.poisson_ratio).area / S_e
    plateau = conditions.outer_pressure - P_e
    wall = -plateau * (V - V_e) + A_VS * (V - V_e) * (S - S_e) + A_SS * (S - S_e) ** 2 / 2

    return gas + outer + wall


def dissipation(position: Pair, velocity: Pair, coefficients: Coefficients, conditions: Reduced) -> Float[Array, ""]:
    """Rayleigh's dissipation function, half the power lost in the liquid (eq:D, dipole as `coefficients` say)."""
    dV, dS = velocity
    g = dipole_moment(position)
    source = coefficients.beta1 * dV**2 / (2 * jnp.pi)
    dipole = coefficients.area_damping * dipole_dissipation(coefficients.dipole) * (g * dS) ** 2
    return conditions.viscosity * (source + dipole)


def acceleration(
    position: Pair, velocity: Pair, state: RestState, coefficients: Coefficients, conditions: Reduced
) -> Pair:
    """Acceleration of volume and area, by Euler–Lagrange (eq:Lag)."""

    def momentum(q: Pair) -> Pair:
        return jax.grad(kinetic_energy, argnums=1)(q, velocity, coefficients)

    def lagrangian(q: Pair) -> Float[Array, ""]:
        return kinetic_energy(q, velocity, coefficients) - potential_energy(q, state, coefficients, conditions)

    mass = jnp.diag(jax.hessian(kinetic_energy, argnums=1)(position, velocity, coefficients))  # T has no cross term
    drift = jax.jvp(momentum, (position,), (velocity,))[1]
    drag = jax.grad(dissipation, argnums=1)(position, velocity, coefficients, conditions)
    return (jax.grad(lagrangian)(position) - drift - drag) / mass

"""Newton iterations to a shape at rest, under a pressure or at a volume.

Down to a minimum a saddle-free iteration walks, every eigenvalue of the
Hessian taken by its size; a plain one finds saddles too. At a given volume the
pressure difference is an unknown, and the Hessian is bordered by ∇V. What
converged is frozen: one more Newton step, with the conditions traced, then
carries the derivative (implicit function theorem).

Symbols    q coordinates [R0]   U potential energy [E d R0²]   K its Hessian [E d]   p = ΔP pressure difference [E d/R0]
Valid for  as the elastic energy
Source     Dauphin et al. 2014 for the saddle-free step
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Meridian, volume
from jshell.membrane.energy import elastic_energy, potential_energy, stiffness, stiffness_at, wall

STEPS = 120
BORDERED_STEPS = 25
TOLERANCE = 1e-9  # largest Newton step [R0]; the error left is its square
GAUGE = 10.0  # stiffness that pins the free translation; zero energy in any rest shape


class Equilibrium(NamedTuple):
    """A shape where the iteration ended, its Hessian and the smallest eigenvalue of that.

    `difference` is the pressure difference where it was an unknown, else zero.
    """

    q: Float[Array, "coordinates"]
    K: Float[Array, "free free"]
    lowest: Float[Array, ""]
    converged: Array
    difference: Float[Array, ""]


def pin(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Energy that holds the free translation, at no cost in any shape."""
    return GAUGE / 2 * (shape.shift @ (q - shape.sphere) / shape.x_size) ** 2


def pinned(shape: Meridian, K: Float[Array, "coordinates coordinates"]) -> Float[Array, "free free"]:
    """A Hessian with the pin, its free part."""
    K = K + GAUGE / shape.x_size**2 * jnp.outer(shape.shift, shape.shift)
    return K[shape.active][:, shape.active]


def pinned_energy(q, shape, conditions, profile, area):
    """Potential energy with the pin."""
    return potential_energy(shape, q, wall(shape, conditions, profile), conditions, area) + pin(shape, q)


def settle_under_pressure(shape, conditions, profile, start, minimise, area) -> Equilibrium:
    """Walk from a start to a shape where the pinned energy is stationary; a minimum where asked for."""
    moduli = wall(shape, conditions, profile)
    energy = lambda q: pinned_energy(q, shape, conditions, profile, area)  # noqa: E731
    stiff = lambda q: pinned(shape, stiffness(shape, q, moduli, conditions, area))  # noqa: E731

    def step(state):
        q, U, damping, _, count = state
        slope = shape.free(jax.grad(energy)(q))
        values, vectors = jnp.linalg.eigh(stiff(q))
        scale = jnp.abs(values) + damping if minimise else values
        move = -vectors @ ((vectors.T @ slope) / scale)
        size = jnp.max(jnp.abs(move))
        move = move * jnp.minimum(1.0, 0.3 / size)
        trial = q.at[shape.active].add(move)
        lower = energy(trial)
        if minimise:
            accept = jnp.isfinite(lower) & (lower <= U + 1e-12 * (1 + jnp.abs(U)))
        else:
            accept = jnp.isfinite(lower)
        damping = jnp.where(accept, damping / 8, jnp.maximum(8 * damping, 1e-3))
        q, U = jnp.where(accept, trial, q), jnp.where(accept, lower, U)
        # a short step counts only when nothing shortened it
        honest = jnp.where(accept & (damping < 1e-3), size, jnp.inf)
        return q, U, damping, honest, count + 1

    def unsettled(state):
        _, _, _, size, count = state
        return (size > TOLERANCE) & (count < STEPS)

    state = (start, energy(start), jnp.asarray(1e-2), jnp.asarray(jnp.inf), 0)
    q, U, _, size, _ = jax.lax.while_loop(unsettled, step, state)
    K = stiff(q)
    lowest = jnp.linalg.eigvalsh(jnp.where(jnp.isfinite(K), K, 0.0))[0]
    converged = (size <= TOLERANCE) & jnp.isfinite(U)
    K = jnp.where(converged, K, jnp.eye(K.shape[0]))
    return Equilibrium(q, K, lowest, converged, jnp.zeros(()))


def residual_at_volume(q, p, shape, conditions, profile, wanted, area):
    """Gradient of elastic energy + pin + p V on the free coordinates, and V less the volume wanted."""
    moduli = wall(shape, conditions, profile)
    energy = lambda q: elastic_energy(shape, q, moduli, area) + pin(shape, q) + p * volume(shape, q)  # noqa: E731
    return jnp.append(shape.free(jax.grad(energy)(q)), volume(shape, q) - wanted)


def bordered(shape, q, p, conditions, profile, area) -> Float[Array, "unknowns unknowns"]:
    """Its Jacobian in the free coordinates and p."""
    K = pinned(shape, stiffness_at(shape, q, wall(shape, conditions, profile), p, area))
    slope = shape.free(jax.grad(lambda q: volume(shape, q))(q))[:, None]
    return jnp.block([[K, slope], [slope.T, jnp.zeros((1, 1))]])


def settle_at_volume(shape, conditions, profile, start, p, wanted, area) -> Equilibrium:
    """Plain Newton iteration in the coordinates and the pressure difference; `K` is the bordered Hessian."""
    size = shape.active.shape[0]

    def step(state):
        q, p, _, count = state
        move = -jnp.linalg.solve(
            bordered(shape, q, p, conditions, profile, area),
            residual_at_volume(q, p, shape, conditions, profile, wanted, area),
        )
        length = jnp.max(jnp.abs(move[:size]))
        move = move * jnp.minimum(1.0, 0.1 / length)
        return q.at[shape.active].add(move[:size]), p + move[size], length, count + 1

    def unsettled(state):
        return (state[2] > TOLERANCE) & jnp.isfinite(state[1]) & (state[3] < BORDERED_STEPS)

    q, p, length, _ = jax.lax.while_loop(unsettled, step, (start, p, jnp.asarray(1.0), 0))
    J = bordered(shape, q, p, conditions, profile, area)
    converged = (length <= TOLERANCE) & jnp.isfinite(p)
    J = jnp.where(converged, J, jnp.eye(size + 1))
    return Equilibrium(q, J, lowest_on_tangent(J), converged, p)


def lowest_on_tangent(J: Float[Array, "unknowns unknowns"]) -> Float[Array, ""]:
    """Smallest eigenvalue of K among motions that keep the volume, from the bordered Hessian."""
    K, slope = J[:-1, :-1], J[:-1, -1]
    unit = slope / jnp.linalg.norm(slope)
    along = jnp.eye(K.shape[0]) - jnp.outer(unit, unit)
    held = along @ K @ along + jnp.linalg.norm(K) * jnp.outer(unit, unit)
    return jnp.linalg.eigvalsh((held + held.T) / 2)[0]

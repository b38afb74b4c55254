"""Solid, gas and liquid in one equation of motion, and one step of it.

    p = M(q) u,   dp/dt = ½ ∂(u·M u)/∂q - ∂U/∂q - R G(q) u

with M the added mass, that of the Stokes layer included. The step is the
generalised-α method, solved by one Newton iteration about an extrapolated
state: one assembly and one factorisation per step, second order, and the
spectral radius at infinity of choice. That damping settles the tangential
motion of a massless wall, which is a constraint rather than a motion. The
gyroscopic force of the moving wall is stiff for the same reason and lies in
the matrix too: left explicit, it breaks the step at any length.

The kinetic energy's gradient needs no derivative of a matrix: with the
potential y and an adjoint z of the boundary equation held, it is the gradient
of one scalar.

Symbols    q coordinates, u velocities, p momenta   U potential energy   R, μ resistance and mass of the layer
Valid for  small η̂; poles apart
Source     Hamilton's equations (equivalent to Bernoulli on the moving wall);
           Jansen, Whiting and Hulbert 2000 for the step
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Float

from jshell.contour import Meridian, speed
from jshell.flow import SingleFrequency, flow, slip_matrix, turning
from jshell.flow.panels import flux_of, green_of, layers, single_layer_of
from jshell.membrane import Wall, potential_energy, stiffness
from jshell.membrane.energy import Area
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced

SLIDING_TIME = 0.01  # what moves liquid moves by the square of it, 1e-4 of a displacement
SLIDING_STEPS = 4  # Newton steps


class Body(NamedTuple):
    """All that does not change in time: discretisation, wall, conditions, Stokes layer."""

    shape: Meridian
    wall: Wall
    conditions: Reduced
    layer: SingleFrequency


class State(NamedTuple):
    """Where the motion is: position, momentum, their rates, and the last two stage velocities."""

    q: Float[Array, "coordinates"]
    velocity: Float[Array, "coordinates"]
    momentum: Float[Array, "coordinates"]
    force: Float[Array, "coordinates"]
    stage: Float[Array, "coordinates"]
    earlier_stage: Float[Array, "coordinates"]


class Inertia(NamedTuple):
    """Mass with the layer's, slip matrix G, gradient of the kinetic energy at fixed velocity, and ∂(M u)/∂q."""

    mass: Float[Array, "coordinates coordinates"]
    slip: Float[Array, "coordinates coordinates"]
    thrust: Float[Array, "coordinates"]
    turning: Float[Array, "coordinates coordinates"]


def inertia(body: Body, q: Float[Array, "coordinates"], u: Float[Array, "coordinates"]) -> Inertia:
    """Mass, slip matrix and ½ ∂(u·M u)/∂q of a shape moving with velocity u."""
    shape = body.shape
    current = flow(shape, q)
    G = slip_matrix(shape, current)
    ux, ur = shape.split(u)
    wall_x, wall_r = shape.x_basis[0] @ ux, shape.r_basis[0] @ ur

    def kinetic(q, y):
        curve = shape.at_points(q)
        ds = speed(curve)
        bulk = -jnp.pi * jnp.sum(shape.weights * (shape.potential_basis[0] @ y) * flux_of(curve, wall_x, wall_r))
        slip = (curve.x1 * wall_x + curve.r1 * wall_r - shape.potential_basis[1] @ y) / ds
        return bulk + jnp.pi * body.layer.mass * jnp.sum(shape.weights * curve.r * ds * slip**2)

    def constrained(q, y, z):
        parts = layers(shape, q)
        return kinetic(q, y) + z @ (green_of(shape, parts, y) + single_layer_of(shape, parts, u))

    y = current.potential @ u
    z = -jsl.lu_solve(current.factors, jax.grad(kinetic, argnums=1)(q, y), trans=1)
    thrust = jax.grad(constrained)(q, y, z)
    return Inertia(current.mass + body.layer.mass * G, G, thrust, turning(shape, q, current, u))


def at_pressure(conditions: Reduced, pressure: Scalar) -> Reduced:
    """The same problem under another outer pressure."""
    c = conditions
    return Reduced(c.thickness, c.gas_pressure, pressure, c.viscosity, c.kappa, c.poisson_ratio)


@eqx.filter_jit
def relax(
    body: Body, q: Float[Array, "coordinates"], pressure: Scalar, area: Area | str
) -> Float[Array, "coordinates"]:
    """Let a displaced wall slide along itself until no tangential force is left, its shape all but unmoved.

    Newton steps in which inertia over a short time holds whatever moves liquid; what moves none is free.
    """
    shape, loaded, free = body.shape, at_pressure(body.conditions, pressure), body.shape.active

    def slide(q, _):
        slope = jax.grad(lambda q: potential_energy(shape, q, body.wall, loaded, area))(q)
        held = stiffness(shape, q, body.wall, loaded, area) + flow(shape, q).mass / SLIDING_TIME**2
        return q.at[free].add(-jnp.linalg.solve(held[free][:, free], slope[free])), None

    return jax.lax.scan(slide, q, None, length=SLIDING_STEPS)[0]


def launch(
    body: Body, q: Float[Array, "coordinates"], u: Float[Array, "coordinates"], pressure: Scalar, area: Area | str
) -> State:
    """The state of a shape that starts with a velocity under an outer pressure."""
    start = inertia(body, q, u)
    slope = jax.grad(lambda q: potential_energy(body.shape, q, body.wall, at_pressure(body.conditions, pressure), area))
    force = start.thrust - slope(q) - body.layer.resistance * (start.slip @ u)
    held = jnp.zeros_like(q).at[body.shape.active].set(1.0)
    return State(q, u, start.mass @ u, force * held, u, u)


def advance(body: Body, state: State, pressure: Scalar, step: Scalar, radius: float, area: Area | str) -> State:
    """One step of generalised-α.

    Args:
        pressure: Outer pressure at the stage, a fraction 1/(1 + radius) of the step after its start.
        step: Step length [time unit].
        radius: Spectral radius at infinite frequency, 0 to 1: how much of the unresolved motion a step keeps.
    """
    shape = body.shape
    alpha_m = (3 - radius) / (2 * (1 + radius))
    alpha_f = 1 / (1 + radius)
    gamma = 0.5 + alpha_m - alpha_f
    new, old = alpha_f * step * gamma / alpha_m, alpha_f * step * (1 - gamma / alpha_m)

    # the stage: q + old v + new u, with u extrapolated for the matrices and then solved for
    guess = 2 * state.stage - state.earlier_stage
    q = state.q + old * state.velocity + new * guess
    loaded = at_pressure(body.conditions, pressure)
    now = inertia(body, q, guess)
    slope = jax.grad(lambda q: potential_energy(shape, q, body.wall, loaded, area))(q)
    K = stiffness(shape, q, body.wall, loaded, area)

    resistance = body.layer.resistance * now.slip
    matrix = now.mass + new * (now.turning - now.turning.T + resistance) + new**2 * K
    push = state.momentum + old * state.force
    excess = push + new * (now.thrust - slope - resistance @ guess) - now.mass @ guess
    free = shape.active
    correction = jnp.zeros_like(q).at[free].set(jnp.linalg.solve(matrix[free][:, free], excess[free]))
    u = guess + correction
    momentum = now.mass @ u + new * (now.turning @ correction)

    velocity = state.velocity + (u - state.velocity) / alpha_m
    stage_force = jnp.zeros_like(q).at[free].set(((momentum - push) / new)[free])
    force = state.force + (stage_force - state.force) / alpha_m
    blend = lambda before, after: step * ((1 - gamma) * before + gamma * after)  # noqa: E731
    return State(
        state.q + blend(state.velocity, velocity),
        velocity,
        state.momentum + blend(state.force, force),
        force,
        u,
        state.stage,
    )

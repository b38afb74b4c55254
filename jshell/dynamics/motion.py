"""Solid, gas and liquid in one equation of motion, and one step of it.

    p = M(q) u,   dp/dt = ½ ∂(u·M u)/∂q - ∂U/∂q - C(q) u - Wᵀ[ r w + Σ a_k (w - y_k) ],   w = W(q) u

with M the added mass and that of the Stokes layer, C the losses of bulk, wall
and drag, y_k the velocities the layer remembers. The step is the generalised-α
method on q, p and y_k, solved by one Newton iteration about an extrapolated
state: one assembly and one factorisation per step, second order, and the
spectral radius at infinity of choice. The gyroscopic force of the moving wall
lies in the matrix: left explicit, it breaks the step at any length.

A massless wall slides without inertia. Sliding finer than an element is given
one, ε h⁴ ∮ |u''|² dA: without it the step would lose control of that sliding
as it gets shorter; motions that the mesh resolves do not feel it.

The rate of q that the method carries lags behind the true velocity by a
fraction of a step; velocities are read from the last two stages instead.

Symbols    q coordinates, u velocities, p momenta   U potential energy   h element length
Valid for  small η̂; a wall that does not touch itself
Source     Hamilton's equations (equivalent to Bernoulli on the moving wall);
           Jansen, Whiting and Hulbert 2000 for the step
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Float

from jshell.contour import Meridian, volume
from jshell.dynamics.operators import Body, dense, free
from jshell.membrane import potential_energy, stiffness
from jshell.membrane.energy import Area
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced

UNRESOLVED_BENDING = 1 / 6  # of ∮ h⁴ |u''|²: a motion with as much of it as of ∮ |u|² counts as half resolved
SLIDING_INERTIA = 1e-4  # ε: 2e-6 of the liquid's inertia for mode 3, 5e-3 for the finest sliding, on 24 elements


class EnergyLedger(NamedTuple):
    """Energy since the start [E d R0²]: work of the outer pressure, and what each loss took.

    `stored` is what the Stokes layer holds as motion of its own and may give back; `layer` what it dissipated.
    """

    work: Float[Array, ""]
    layer: Float[Array, ""]
    stored: Float[Array, ""]
    bulk: Float[Array, ""]
    wall: Float[Array, ""]
    drag: Float[Array, ""]


class Rates(NamedTuple):
    """The rates of change that generalised-α carries along."""

    q: Float[Array, "coordinates"]
    momentum: Float[Array, "coordinates"]
    memory: Float[Array, "terms points"]
    ledger: EnergyLedger


class State(NamedTuple):
    """Where the motion is: position, momentum, the layer's memory, ledger; their rates; the last two stages."""

    q: Float[Array, "coordinates"]
    momentum: Float[Array, "coordinates"]
    memory: Float[Array, "terms points"]
    ledger: EnergyLedger
    rates: Rates
    stage: Float[Array, "coordinates"]
    earlier_stage: Float[Array, "coordinates"]


class Loads(NamedTuple):
    """Outer pressure at a step's start, at its stage, a fraction 1/(1 + radius) of the step later, and at its end."""

    start: Scalar
    stage: Scalar
    end: Scalar


def solid_mass(
    shape: Meridian, profile: Float[Array, "points"], thickness: Scalar, shell_density: Scalar
) -> Float[Array, "coordinates coordinates"]:
    """Mass of the wall itself, ρ_s d ∮ |u|² dA over the stress-free sphere, and the inertia of unresolved sliding."""
    # the wall keeps its mass: it is weighed on the stress-free sphere, once for all shapes
    sphere = 2 * jnp.pi * shape.weights * jnp.sin(shape.angles)
    lengths = jnp.repeat(jnp.diff(shape.nodes), shape.angles.size // shape.elements)
    heavy = sphere * profile * thickness * shell_density
    # h⁴: motions that the mesh resolves hardly feel it, and it vanishes as the mesh is refined
    fine = SLIDING_INERTIA * lengths**4 * sphere
    blocks = [
        (basis[0].T * heavy[None]) @ basis[0] + (basis[2].T * fine[None]) @ basis[2]
        for basis in (shape.x_basis, shape.r_basis)
    ]
    return jsl.block_diag(*blocks)


def resolved_motions(shape: Meridian) -> Float[Array, "coordinates coordinates"]:
    """What of a motion the mesh resolves: 1/(1 + (h k/π)⁸ · 260) of a wave number k, h the element's length.

    A wave of twelve elements keeps 1 - 1e-4 of itself, one of two elements 1/260.
    """
    moves = jnp.zeros_like(shape.sphere).at[shape.active].set(1.0)
    lengths = jnp.repeat(jnp.diff(shape.nodes), shape.angles.size // shape.elements)

    def blocks(order, weights):
        parts = [(basis[order].T * weights[None]) @ basis[order] for basis in (shape.x_basis, shape.r_basis)]
        return jsl.block_diag(*parts) * moves[:, None] * moves[None]

    # coordinates that are held have no motion: 1 on the diagonal keeps the matrix regular
    gram = blocks(0, shape.weights) + jnp.diag(1 - moves)
    bends = UNRESOLVED_BENDING * blocks(2, shape.weights * lengths**4)
    # G + B G⁻¹ B filters with the eighth power of the wave number, symmetric in the energy of the motion
    return jnp.linalg.solve(gram + bends @ jnp.linalg.solve(gram, bends), gram)


def at_pressure(conditions: Reduced, pressure: Scalar) -> Reduced:
    """The same problem under another outer pressure."""
    return conditions.replace(outer_pressure=pressure)


def velocity(state: State, radius: float) -> Float[Array, "coordinates"]:
    """Velocity now, from the last two stages."""
    # the last stage lies 1/(1 + radius) of a step after the start: extrapolate from the last two to the end
    ahead = 1 - 1 / (1 + radius)
    return state.stage + ahead * (state.stage - state.earlier_stage)


def initialise(
    body: Body, q: Float[Array, "coordinates"], u: Float[Array, "coordinates"], pressure: Scalar, area: Area | str
) -> State:
    """The state of a shape that starts with a velocity under an outer pressure, its layer at rest before."""
    at_rest = jnp.zeros((body.layer.rates.size, body.shape.angles.size))
    nothing = EnergyLedger(*jnp.zeros(len(EnergyLedger._fields)))
    return restart(body, q, u, at_rest, nothing, pressure, area)


def restart(body: Body, q, u, memory, ledger: EnergyLedger, pressure: Scalar, area: Area | str) -> State:
    """The state of a motion under way, all its rates computed afresh."""
    start = dense(body, q, u)
    loaded = at_pressure(body.conditions, pressure)
    # the momentum is what is carried in time: M moves with the wall, and d(M u)/dt needs no derivative of u
    slope = jax.grad(lambda q: potential_energy(body.shape, q, body.wall, loaded, area))(q)
    w, p = start.W @ u, start.M @ u
    strain, fade = body.layer.weights[:, None], body.layer.rates[:, None]
    # the layer resists the slip at once, and through what it remembers of earlier slip
    traction = body.layer.resistance * w + jnp.sum(strain * (w[None] - memory), axis=0)
    losses = start.B @ u + start.C @ u + start.drag * p
    force = start.kinetic_gradient - slope - losses - start.W.T @ (start.surface * traction)
    held = jnp.zeros_like(q).at[body.shape.active].set(1.0)
    power = _power(body, start.surface, w, memory, u @ start.B @ u, u @ start.C @ u, start.drag * (u @ p))
    rates = Rates(u, force * held, fade * (w[None] - memory), power)
    return State(q, p, memory, ledger, rates, u, u)


def _power(body: Body, surface, w, memory, bulk, wall, drag) -> EnergyLedger:
    """What the losses take per time; the pressure's work is booked from the volume itself."""
    # each exponential of the memory is a spring and a dashpot in series: one stores energy, the other loses it
    left = w[None] - memory
    strain = body.layer.weights[:, None]
    layer = surface @ (body.layer.resistance * w**2 + jnp.sum(strain * left**2, axis=0))
    stored = surface @ jnp.sum(strain * left * memory, axis=0)
    return EnergyLedger(jnp.zeros(()), layer, stored, bulk, wall, drag)


class _Stage(NamedTuple):
    """Generalised-α at its stage y + old y' + new f: coefficients, position, extrapolated velocity, and the memory
    y_k there but for the slip; the layer's `resistance` to the slip and the `traction` of its memory.
    """

    alpha_m: float
    gamma: float
    new: Scalar
    q: Float[Array, "coordinates"]
    guess: Float[Array, "coordinates"]
    predicted: Float[Array, "coordinates"]
    remembered: Float[Array, "terms points"]
    resistance: Scalar
    traction: Float[Array, "points"]


def _stage(body: Body, state: State, step: Scalar, radius: float) -> _Stage:
    # Jansen, Whiting and Hulbert: second order, with this spectral radius at infinite frequency
    alpha_m = (3 - radius) / (2 * (1 + radius))
    alpha_f = 1 / (1 + radius)
    gamma = 0.5 + alpha_m - alpha_f
    new, old = alpha_f * step * gamma / alpha_m, alpha_f * step * (1 - gamma / alpha_m)
    # extrapolated from two stages, the guess is of second order: one Newton iteration then is enough
    guess = 2 * state.stage - state.earlier_stage
    q = state.q + old * state.rates.q + new * guess
    predicted = state.momentum + old * state.rates.momentum
    layer = body.layer
    # each memory obeys its own linear equation: solve it for the slip of the stage, so that it adds no unknowns
    remembered = (state.memory + old * state.rates.memory) / (1 + new * layer.rates[:, None])
    resistance = layer.resistance + jnp.sum(layer.weights / (1 + new * layer.rates))
    traction = jnp.sum(layer.weights[:, None] * remembered, axis=0)
    return _Stage(alpha_m, gamma, new, q, guess, predicted, remembered, resistance, traction)


class _Found(NamedTuple):
    """What solving the stage gave: velocity, momentum, slip there, and the power lost in bulk, wall and drag."""

    u: Float[Array, "coordinates"]
    momentum: Float[Array, "coordinates"]
    slip: Float[Array, "points"]
    surface: Float[Array, "points"]
    bulk: Scalar
    wall: Scalar
    drag: Scalar


def _finish(body: Body, state: State, loads: Loads, step: Scalar, at: _Stage, found: _Found) -> State:
    """The state after a step, from what was found at its stage."""
    shape, u, w = body.shape, found.u, found.slip
    fade = body.layer.rates[:, None]
    # the memories at the stage, now that its slip is known
    memory = at.remembered + (at.new * fade) / (1 + at.new * fade) * w[None]
    held = jnp.zeros_like(u).at[shape.active].set(1.0)
    power = _power(body, found.surface, w, memory, found.bulk, found.wall, found.drag)
    # momentum = predicted + new · force: the force that was found, without computing it again
    stage = Rates(u, (found.momentum - at.predicted) / at.new * held, fade * (w[None] - memory), power)

    # the rates at the end follow from those at the start and at the stage, the values from both rates
    after = jax.tree.map(lambda before, at_stage: before + (at_stage - before) / at.alpha_m, state.rates, stage)
    moved = lambda value, before, now: value + step * ((1 - at.gamma) * before + at.gamma * now)  # noqa: E731
    values = Rates(state.q, state.momentum, state.memory, state.ledger)
    values = jax.tree.map(moved, values, state.rates, after)
    # work of the pressure on the volume truly swept, by the trapezium rule: energy then balances to second order
    swept = volume(shape, values.q) - volume(shape, state.q)
    ledger = values.ledger._replace(work=values.ledger.work - (loads.start + loads.end) / 2 * swept)
    return State(values.q, values.momentum, values.memory, ledger, after, u, state.stage)


def _force(body: Body, loads: Loads, area: Area | str):
    """Gradient of the potential energy under the load of the stage, a function of the coordinates."""
    loaded = at_pressure(body.conditions, loads.stage)
    return jax.grad(lambda q: potential_energy(body.shape, q, body.wall, loaded, area))


def _step(body: Body, state: State, loads: Loads, step: Scalar, radius: float, area: Area | str):
    """One step with matrices; what its derivative needs comes along."""
    at = _stage(body, state, step, radius)
    q, guess, ones = at.q, at.guess, body.shape.active
    # all matrices at the extrapolated stage: the only assembly of the step
    now = dense(body, q, guess)
    K = stiffness(body.shape, q, body.wall, at_pressure(body.conditions, loads.stage), area)
    # everything that resists a velocity: layer, bulk, wall, drag
    resistance = at.resistance * ((now.W.T * now.surface[None]) @ now.W) + now.B + now.C + now.drag * now.M
    # Newton's matrix of the momentum balance; T - Tᵀ is the gyroscopic force, stiff where a massless wall slides
    matrix = now.M + at.new * (now.T - now.T.T + resistance) + at.new**2 * K
    forces = (
        now.kinetic_gradient - _force(body, loads, area)(q) - resistance @ guess + now.W.T @ (now.surface * at.traction)
    )
    # what the guess leaves of the balance
    excess = at.predicted + at.new * forces - now.M @ guess
    factors = jsl.lu_factor(matrix[ones][:, ones])
    correction = jnp.zeros_like(q).at[ones].set(jsl.lu_solve(factors, excess[ones]))

    u = guess + correction
    p = now.M @ u
    # M has moved with the shape that the correction implies: its first-order change is T times the correction
    momentum = p + at.new * (now.T @ correction)
    found = _Found(u, momentum, now.W @ u, now.surface, u @ now.B @ u, u @ now.C @ u, now.drag * (u @ p))
    return _finish(body, state, loads, step, at, found), (correction, factors, now)


@eqx.filter_custom_jvp
def advance(body: Body, state: State, loads: Loads, step: Scalar, radius: float, area: Area | str) -> State:
    """One step of generalised-α; its derivative is exact and needs no derivative of a matrix.

    Args:
        loads: Outer pressure over the step.
        step: Step length [time unit].
        radius: Spectral radius at infinite frequency, 0 to 1: how much of the unresolved motion a step keeps.
    """
    return _step(body, state, loads, step, radius, area)[0]


@advance.def_jvp
def _advance_derivative(primals, tangents):
    body, state, loads, step, radius, area = primals
    after, (correction, factors, matrices) = _step(*primals)

    def again(body, state, loads):
        at = _stage(body, state, step, radius)
        now = free(body, at.q, at.guess, matrices.inverse)
        force = _force(body, loads, area)
        u = at.guess + correction
        y = now.potential(u)
        momentum, changed = now.mass(u, y), now.gyroscopic(correction)
        w, surface = now.slip(u, y), now.surface
        bulk, wall = now.bulk(u), now.solid(u)
        losses = now.slip_transposed(surface * (at.resistance * w - at.traction)).plus(momentum, now.drag)
        p = now.on_wall(momentum.plus(changed, at.new))
        # the same balance, by actions: no matrix has to be differentiated
        left = at.predicted - p - at.new * (now.on_wall(losses) + bulk + wall)
        left = left + at.new * (now.kinetic_gradient - force(at.q) + now.gyroscopic_transposed(correction))
        left = left - at.new**2 * jax.jvp(force, (at.q,), (correction,))[1]

        # zero, with the derivative of the solution: on it the matrices may act as they are
        ones = body.shape.active
        change = jnp.zeros_like(u).at[ones].set(jsl.lu_solve(factors, left[ones]))
        p = p + matrices.M @ change + at.new * (matrices.T @ change)
        in_bulk = u @ bulk + 2 * u @ matrices.B @ change
        in_drag = now.drag * (u @ momentum.direct + y @ momentum.potential + 2 * u @ matrices.M @ change)
        in_wall = u @ wall + 2 * u @ matrices.C @ change
        found = _Found(u + change, p, w + matrices.W @ change, surface, in_bulk, in_wall, in_drag)
        return _finish(body, state, loads, step, at, found)

    _, derivative = eqx.filter_jvp(again, (body, state, loads), tuple(tangents[:3]))
    return after, derivative

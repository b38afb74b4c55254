"""The deflation branch: every dimpled shape of a shell, from the sphere to contact, through its folds.

Neither pressure nor volume grows steadily along it, so it is followed by its
own length: a step along the tangent, then Newton steps across it. The nodes
follow the rim from step to step.

Symbols    V volume [R0³]   p = ΔP pressure difference [E d/R0]   s length along the branch
           D mean distance from the nearest sphere [R0]
Valid for  axial symmetry, one dimple
Source     Keller 1977 for pseudo-arclength
"""

from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.contour import Meridian, carry, clearance, gap, regrade, rim_breaks, thinned, transfer, volume
from jshell.errors import BadValue, Outcome
from jshell.membrane.energy import Area, check_area, elastic_energy, stiffness, wall
from jshell.membrane.equilibrium import RestShape, cached_meridian
from jshell.membrane.newton import TOLERANCE, bordered, lowest_on_tangent, pinned, residual_at_volume
from jshell.membrane.rest import rest
from jshell.shell.elasticity import SPHERE_VOLUME, buckling_threshold
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure

LONGEST = 0.04  # step along the branch; lengths in R0, pressures as a fraction of the classical threshold
SHORTEST = 1e-7
BEFORE_CONTACT = 2e-3  # how near along the branch the last shape lies to the first whose wall touches itself
SHARE = 0.5  # of its distance from the sphere a shape moves in a step, at most
NEWTON_STEPS = 9
AT_SPHERE = 0.02  # D below this share of d̂: the branch has come back to the sphere


@dataclass(frozen=True)
class Fold:
    """A turning point of a branch.

    Attributes:
        of: What turns: `difference` (dead pressure), `volume` (held volume) or `load` (outer pressure over the gas).
        volume_ratio, difference: Where [-], [E d/R0].
    """

    of: str
    volume_ratio: float
    difference: float


@dataclass(frozen=True, eq=False)
class Branch:
    """A chain of equilibria, (states,), from the sphere's side to the most deflated.

    Attributes:
        length: Length along the branch, from its first state.
        volume_ratio: V/V0 [-].
        difference: ΔP [E d/R0]; `outer_pressure` adds the gas.
        elastic: Elastic energy [E d R0²].
        stability: Smallest eigenvalue under outer pressure and gas [E d]: negative is unstable.
        held_stability: The same at held volume.
        gap: Distance between the poles [R0].
        clearance: Least free space between two places of the wall that face each other [R0].
        folds: Turning points in the order of the states.
        outcome: ok; not_converged where a step failed before an end was reached, contact where the last state touches.
        nodes, coordinates: (states, ·) the shapes, see `shape`.
    """

    length: np.ndarray
    volume_ratio: np.ndarray
    difference: np.ndarray
    outer_pressure: np.ndarray
    elastic: np.ndarray
    stability: np.ndarray
    held_stability: np.ndarray
    gap: np.ndarray
    clearance: np.ndarray
    folds: tuple[Fold, ...]
    outcome: Outcome
    nodes: np.ndarray
    coordinates: np.ndarray
    base: Meridian

    def shape(self, state: int) -> tuple[Meridian, Float[Array, "coordinates"]]:
        """Discretisation and coordinates of one state."""
        return _on_nodes(self.base, jnp.asarray(self.nodes[state])), jnp.asarray(self.coordinates[state])


_on_nodes = eqx.filter_jit(regrade)


class _Point(NamedTuple):
    """A state on the branch and its tangent."""

    shape: Meridian
    q: Float[Array, "coordinates"]
    p: Float[Array, ""]
    along_q: Float[Array, "coordinates"]
    along_p: Float[Array, ""]


class _Numbers(NamedTuple):
    """What is recorded of a state."""

    volume: Float[Array, ""]
    difference: Float[Array, ""]
    load: Float[Array, ""]
    elastic: Float[Array, ""]
    stability: Float[Array, ""]
    held_stability: Float[Array, ""]
    gap: Float[Array, ""]
    clearance: Float[Array, ""]
    away: Float[Array, ""]
    pace: Float[Array, ""]
    step: Float[Array, ""]
    newton: Float[Array, ""]


def deflation_branch(
    conditions: Reduced,
    *,
    elements: int = 32,
    area: Area | str = "current",
    start: float = 0.7,
    lowest: float = 0.3,
    most: int = 600,
) -> Branch:
    """Follow the dimpled shapes of a shell both ways from one of them.

    Args:
        conditions: The problem without units; its gas counts for outer pressures and stability only, its outer
            pressure for nothing.
        elements: Elements of the meridian; they follow the rim.
        area: Which elastic energy.
        start: V/V0 of the first shape [-].
        lowest: V/V0 at which the deflated end stops, if the poles have not met before [-].
        most: States at most, each way.

    Raises:
        BadValue: `start` not between `lowest` and 1.
        NotOk: The first shape was not found.
    """
    check_area(area)
    if not 0 < lowest < start < 1:
        raise BadValue(
            "start", found=f"{start:g}", expected=f"between lowest = {lowest:g} and 1", remedy="0.7 is usual."
        )
    conditions = conditions.as_arrays()
    first = rest(conditions, volume_ratio=start, elements=elements, area=area, throw=True)
    inflating, ended_up = _follow(first, conditions, area, +1.0, lowest, most)
    deflating, ended_down = _follow(first, conditions, area, -1.0, lowest, most)
    states = [*reversed(inflating), *deflating[1:]]
    outcome = ended_up if ended_up != Outcome.OK else ended_down
    return _collected(states, outcome, cached_meridian(elements, 0.0))


def _follow(first: RestShape, conditions: Reduced, area: str, way: float, lowest: float, most: int):
    """States one way from the first, and how that ended."""
    point, numbers = _begin(first, conditions, area, way)
    states = [(point, numbers)]
    step = LONGEST / 4
    while len(states) < most:
        step = min(step, LONGEST, SHARE * float(numbers.away / numbers.pace))
        candidate, reached = _step(point, conditions, area, jnp.asarray(step))
        if float(reached.clearance) < 0:
            # the last shape with room left is approached by smaller steps
            if step < BEFORE_CONTACT:
                return states, Outcome.CONTACT
            step /= 2
            continue
        if not float(reached.newton) < NEWTON_STEPS or not np.isfinite(float(reached.volume)):
            step /= 2
            if step < SHORTEST:
                return states, Outcome.NOT_CONVERGED
            continue
        point, numbers = candidate, reached
        states.append((point, numbers))
        step *= 1.5 if float(numbers.newton) <= 5 else 1.0
        if float(numbers.volume) < lowest * SPHERE_VOLUME or float(numbers.away) < AT_SPHERE * float(
            conditions.thickness
        ):
            return states, Outcome.OK
    return states, Outcome.NOT_CONVERGED


def _metric(shape: Meridian, u: Float[Array, "coordinates"]) -> Float[Array, "coordinates"]:
    """Mean square over the sphere as a quadratic form, times a vector."""
    weights = shape.weights * jnp.sin(shape.angles) / 2
    ux, ur = shape.split(u)
    X, R = shape.x_basis[0], shape.r_basis[0]
    return jnp.concatenate([X.T @ (weights * (X @ ux)), R.T @ (weights * (R @ ur))])


def _jacobian(point: _Point, q, p, conditions, profile, area):
    """Bordered Hessian whose last row is the tangent instead of ∇V."""
    J = bordered(point.shape, q, p, conditions, profile, area)
    unit = buckling_threshold(conditions.thickness, conditions.poisson_ratio)
    row = jnp.append(point.shape.free(_metric(point.shape, point.along_q)), point.along_p / unit**2)
    return J.at[-1].set(row)


def _with_tangent(point: _Point, conditions, profile, area) -> _Point:
    """The point with its own tangent, of length 1, on the same side as the one it has."""
    shape = point.shape
    J = _jacobian(point, point.q, point.p, conditions, profile, area)
    way = jnp.linalg.solve(J, jnp.zeros(J.shape[0]).at[-1].set(1.0))
    along_q = jnp.zeros_like(point.q).at[shape.active].set(way[:-1])
    unit = buckling_threshold(conditions.thickness, conditions.poisson_ratio)
    length = jnp.sqrt(along_q @ _metric(shape, along_q) + (way[-1] / unit) ** 2)
    return _Point(shape, point.q, point.p, along_q / length, way[-1] / length)


def _numbers(point: _Point, conditions, profile, area, step, newton) -> _Numbers:
    shape, q = point.shape, point.q
    moduli = wall(shape, conditions, profile)
    V = volume(shape, q)
    load = gas_pressure(V, conditions) + point.p
    loaded = eqx.tree_at(lambda c: c.outer_pressure, conditions, load)
    K = pinned(shape, stiffness(shape, q, moduli, loaded, area))
    held = lowest_on_tangent(bordered(shape, q, point.p, conditions, profile, area))
    curve, weights = shape.at_points(q), shape.weights * jnp.sin(shape.angles) / 2
    centre = jnp.sum(weights * curve.x)
    radius = jnp.hypot(curve.x - centre, curve.r)
    away = jnp.sqrt(jnp.sum(weights * (radius - jnp.sum(weights * radius)) ** 2))
    elastic = elastic_energy(shape, q, moduli, area)
    pace = jnp.sqrt(point.along_q @ _metric(shape, point.along_q))
    lowest, poles, free = jnp.linalg.eigvalsh(K)[0], gap(shape, q), clearance(shape, q, moduli.thickness)
    return _Numbers(V, point.p, load, elastic, lowest, held, poles, free, away, pace, step, newton)


@eqx.filter_jit
def _begin(first: RestShape, conditions: Reduced, area: str, way) -> tuple[_Point, _Numbers]:
    shape, q, p = first.meridian, first.coordinates, first.difference
    profile = jnp.ones_like(shape.angles)
    # the tangent is where a volume a little larger or smaller would lie
    J = bordered(shape, q, p, conditions, profile, area)
    move = jnp.linalg.solve(J, jnp.zeros(J.shape[0]).at[-1].set(way))
    point = _Point(shape, q, p, jnp.zeros_like(q).at[shape.active].set(move[:-1]), move[-1])
    point = _with_tangent(point, conditions, profile, area)
    return point, _numbers(point, conditions, profile, area, jnp.zeros(()), jnp.zeros(()))


@eqx.filter_jit
def _step(point: _Point, conditions: Reduced, area: str, step: Float[Array, ""]) -> tuple[_Point, _Numbers]:
    """One step along the branch, on nodes that follow the rim."""
    shape = regrade(point.shape, rim_breaks(point.shape, point.q))
    profile = thinned(shape, 0.0, 1.0)
    along_q = carry(point.along_q, point.shape, shape)
    point = _Point(shape, transfer(point.q, point.shape, shape), point.p, along_q, point.along_p)
    size = shape.active.shape[0]
    ahead_q, ahead_p = point.q + step * along_q, point.p + step * point.along_p

    def newton(state):
        q, p, _, count = state
        J = _jacobian(point, q, p, conditions, profile, area)
        across = J[-1, :-1] @ shape.free(q - ahead_q) + J[-1, -1] * (p - ahead_p)
        residual = residual_at_volume(q, p, shape, conditions, profile, 0.0, area).at[-1].set(across)
        move = -jnp.linalg.solve(J, residual)
        return q.at[shape.active].add(move[:size]), p + move[size], jnp.max(jnp.abs(move[:size])), count + 1

    unsettled = lambda state: (state[2] > TOLERANCE) & (state[3] < NEWTON_STEPS) & (state[2] < 0.3)  # noqa: E731
    q, p, length, count = jax.lax.while_loop(unsettled, newton, (ahead_q, ahead_p, jnp.asarray(0.1), 0))
    count = jnp.where(length <= TOLERANCE, count, NEWTON_STEPS)
    reached = _with_tangent(point._replace(q=q, p=p), conditions, profile, area)
    return reached, _numbers(reached, conditions, profile, area, step, jnp.asarray(count, float))


def _collected(states, outcome: Outcome, base: Meridian) -> Branch:
    column = lambda name: np.array([float(getattr(numbers, name)) for _, numbers in states])  # noqa: E731
    V, p = column("volume"), column("difference")
    steps = column("step")
    first = int(np.argmin(steps))  # the state both ways began at; its step is zero
    length = np.concatenate([np.cumsum(steps[:first][::-1])[::-1] * -1.0, [0.0], np.cumsum(steps[first + 1 :])])
    length = length - length[0]
    outer = column("load")
    ratio = V / SPHERE_VOLUME
    folds = [
        (at, Fold(name, *(float(np.interp(at, length, values)) for values in (ratio, p))))
        for name, turning in (("difference", p), ("volume", ratio), ("load", outer))
        for at in _turning_points(length, turning)
    ]
    return Branch(
        length=length,
        volume_ratio=ratio,
        difference=p,
        outer_pressure=outer,
        elastic=column("elastic"),
        stability=column("stability"),
        held_stability=column("held_stability"),
        gap=column("gap"),
        clearance=column("clearance"),
        folds=tuple(fold for _, fold in sorted(folds, key=lambda pair: pair[0])),
        outcome=outcome,
        nodes=np.stack([np.asarray(point.shape.nodes) for point, _ in states]),
        coordinates=np.stack([np.asarray(point.q) for point, _ in states]),
        base=base,
    )


def _turning_points(length: np.ndarray, values: np.ndarray) -> list[float]:
    """Where a quantity turns along the branch, by the parabola through three states."""
    found = []
    for k in range(1, len(length) - 1):
        rise, fall = values[k] - values[k - 1], values[k + 1] - values[k]
        if rise * fall < 0:
            a, b = length[k] - length[k - 1], length[k + 1] - length[k]
            slope = (rise * b / a + fall * a / b) / (a + b)
            curvature = 2 * (fall / b - rise / a) / (a + b)
            found.append(length[k] - slope / curvature)
    return found

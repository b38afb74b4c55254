"""The rest shape: where elastic energy, gas and outer pressure balance.

A saddle-free Newton iteration with exact Hessians walks down from a mirrored
cap (buckled branch); a plain one finds the compressed sphere whether it is
stable or not. One more Newton step with frozen matrix then carries the
derivative: the rest shape is differentiable in every condition.

Symbols    q coordinates [R0]   V, S volume and area   P inner pressure [E d/R0]
Valid for  as the elastic energy; poles apart
Source     Mokbel et al. 2021, numerical method; implicit function theorem for the derivative
"""

from functools import lru_cache
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import (
    NO_WEAK_SPOT,
    Meridian,
    WeakSpot,
    area,
    compressed_sphere,
    dimple,
    gap,
    height,
    meridian,
    volume,
    wall_profile,
)
from jshell.errors import BadName, NotOk, Outcome
from jshell.membrane.energy import Area, check_area, potential_energy, stiffness, wall
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure, plateau_pressure, sphere_state

Branch = Literal["buckled", "sphere"]
BRANCHES = ("buckled", "sphere")
STEPS = 120
TOLERANCE = 1e-9  # largest Newton step [R0]; the error left is its square
CONTACT_GAP = 0.01  # poles nearer than this count as touching [R0]
DIMPLE_DEPTH = 0.01  # a buckling pole this far below the top counts as buckled [R0]
GAUGE = 10.0  # stiffness that pins the free translation; zero energy in any rest shape


class RestShape(eqx.Module):
    """A shell at rest.

    Attributes:
        coordinates: Spline coefficients of the meridian [R0].
        volume, area: V [R0³] and S [R0²]; `volume_ratio`, `area_ratio` against the stress-free sphere.
        pressure: Inner pressure [E d/R0].
        gap: Distance between the poles [R0].
        stability: Smallest eigenvalue of the stiffness, negative where the shape is unstable [E d].
        outcome: Integer of `Outcome`: ok, not_converged, contact or no_buckled_state.
    """

    coordinates: Float[Array, "coordinates"]
    volume: Float[Array, ""]
    area: Float[Array, ""]
    pressure: Float[Array, ""]
    gap: Float[Array, ""]
    stability: Float[Array, ""]
    outcome: Int[Array, ""]
    meridian: Meridian
    profile: Float[Array, "points"]

    @property
    def volume_ratio(self) -> Float[Array, "..."]:
        return self.volume / SPHERE_VOLUME

    @property
    def area_ratio(self) -> Float[Array, "..."]:
        return self.area / SPHERE_AREA


def rest(
    conditions: Reduced,
    *,
    branch: Branch | str = "buckled",
    elements: int = 32,
    attached: float = 0.0,
    weak_spot: WeakSpot = NO_WEAK_SPOT,
    area: Area | str = "current",
    throw: bool = False,
) -> RestShape:
    """Rest shape of a shell on one branch; differentiable and vmappable in the conditions.

    Args:
        conditions: The problem without units.
        branch: `buckled`, or `sphere` (found whether stable or not).
        elements: Elements of the meridian.
        attached: Half-angle of the pad that holds the shell [rad]; 0 is free.
        weak_spot: Thinner wall around the buckling pole; none by default.
        area: Which elastic energy, see `jshell.membrane.energy.density`.
        throw: Raise `NotOk` unless the outcome is ok (outside `jit` only).

    Returns:
        The shape; read its `outcome` before its numbers.

    Raises:
        BadName, BadValue: An option that does not exist, or a number outside its meaning.

    Example:
        >>> import jshell as js
        >>> shape = js.membrane.rest(js.presets.R.conditions)
        >>> print(shape.volume_ratio.round(4), shape.pressure.round(4))
        0.6992 1.4853
    """
    if branch not in BRANCHES:
        raise BadName("branch", found=repr(branch), expected="one of " + ", ".join(BRANCHES), remedy="Choose one.")
    check_area(area)
    shape = cached_meridian(elements, attached)
    found = rest_shape(shape, conditions.as_arrays(), wall_profile(shape, weak_spot), branch, area)
    if throw:
        raise_unless_ok("rest shape", found.outcome)
    return found


@lru_cache(maxsize=16)
def cached_meridian(elements: int, attached: float) -> Meridian:
    """The discretisation of a size and pad; built once."""
    with jax.ensure_compile_time_eval():
        return meridian(elements, attached)


def raise_unless_ok(place: str, outcome: Int[Array, ""]) -> None:
    """Raise `NotOk` for a concrete outcome other than ok."""
    if int(outcome) != Outcome.OK:
        raise NotOk(place, Outcome(int(outcome)))


@eqx.filter_jit
def rest_shape(
    shape: Meridian, conditions: Reduced, profile: Float[Array, "points"], branch: str, area: str
) -> RestShape:
    """Rest shape on a given discretisation and thickness profile."""
    if branch == "buckled":
        excess = conditions.outer_pressure - plateau_pressure(conditions.thickness, conditions.poisson_ratio)
        ratio = (conditions.gas_pressure / jnp.maximum(excess, 1e-6)) ** (1 / conditions.kappa)
        start = dimple(shape, jnp.clip(ratio, 0.3, 0.95), conditions.thickness)
    else:
        start = compressed_sphere(shape, (sphere_state(conditions).volume / SPHERE_VOLUME) ** (1 / 3))
    return settle(shape, conditions, profile, start, branch, area)


def settle(
    shape: Meridian,
    conditions: Reduced,
    profile: Float[Array, "points"],
    start: Float[Array, "coordinates"],
    branch: str,
    area: str,
) -> RestShape:
    """Newton iteration from a start, and the measures of what it finds."""
    solution = _iterate(*jax.lax.stop_gradient((shape, conditions, profile, start)), branch, area)

    # The derivative: q(p) = q* - K⁻¹ ∇U(q*, p), with q* and K frozen.
    frozen = jax.lax.stop_gradient(solution.q)
    slope = shape.free(jax.grad(_pinned)(frozen, shape, conditions, profile, area))
    correction = -jnp.linalg.solve(jax.lax.stop_gradient(solution.K), slope)
    correction = jnp.where(solution.converged, correction, 0.0)
    q = frozen.at[shape.active].add(correction)

    V = volume(shape, q)
    distance = gap(shape, q)
    sunk = height(shape, q) - distance
    outcome = jnp.where(solution.converged, Outcome.OK, Outcome.NOT_CONVERGED)
    if branch == "buckled":
        outcome = jnp.where(solution.converged & (sunk < DIMPLE_DEPTH), Outcome.NO_BUCKLED_STATE, outcome)
    outcome = jnp.where(distance < CONTACT_GAP, Outcome.CONTACT, outcome)
    return RestShape(
        q, V, area_of(shape, q), gas_pressure(V, conditions), distance, solution.lowest, outcome, shape, profile
    )


area_of = area


class _Solution(NamedTuple):
    q: Float[Array, "coordinates"]
    K: Float[Array, "free free"]
    lowest: Float[Array, ""]
    converged: Array


def _pinned(q, shape, conditions, profile, area):
    """Potential energy, the free translation pinned at no cost in energy."""
    U = potential_energy(shape, q, wall(shape, conditions, profile), conditions, area)
    return U + GAUGE / 2 * (shape.shift @ (q - shape.sphere) / shape.x_size) ** 2


def _iterate(shape, conditions, profile, start, branch, area) -> _Solution:
    moduli = wall(shape, conditions, profile)
    gauge = GAUGE / shape.x_size**2 * jnp.outer(shape.shift, shape.shift)
    energy = lambda q: _pinned(q, shape, conditions, profile, area)  # noqa: E731
    minimise = branch == "buckled"

    def stiff(q):
        K = stiffness(shape, q, moduli, conditions, area) + gauge
        return K[shape.active][:, shape.active]

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
    return _Solution(q, K, lowest, converged)

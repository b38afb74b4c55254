"""Finding a shape at rest: where to start, where the nodes go, what has been found.

A mirrored cap is let down to the buckled branch, on nodes that crowd at its rim
and then at the rim of the shape; the compressed sphere is found whether it is
stable or not. What has been found carries its derivative in the conditions;
where the nodes are is not differentiated.

Symbols    q coordinates [R0]   V volume [R0³]   P inner pressure, ΔP pressure difference [E d/R0]
Valid for  as the elastic energy; a wall that does not touch itself
Source     implicit function theorem for the derivative
"""

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import (
    Meridian,
    clearance,
    compressed_sphere,
    dimple,
    dimple_breaks,
    gap,
    height,
    meridian,
    regrade,
    resampled,
    rim_breaks,
    thinned,
    transfer,
    volume,
)
from jshell.contour import (
    area as area_of,
)
from jshell.display import PRESSURE, ended, number, readable, shown
from jshell.errors import NotOk, Outcome
from jshell.membrane.energy import elastic_energy, wall
from jshell.membrane.newton import (
    Equilibrium,
    pinned_energy,
    residual_at_volume,
    settle_at_volume,
    settle_under_pressure,
)
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure, plateau_pressure, sphere_state
from jshell.undetermined import undetermined

DIMPLE_DEPTH = 0.01  # a buckling pole this far below the top counts as buckled [R0]
FOLLOWING = 2  # solutions: on nodes that follow the seed, then on nodes that follow the shape
CUSHIONS = (1.0, 5.0, 50.0, 50.0)  # pressures of gases that hold a volume, each correcting the next one's load
THICK = 0.12  # a deep dimple of a thicker wall is not near its mirrored cap: begin with a shallow one


class RestShape(eqx.Module):
    """A shell at rest.

    Attributes:
        coordinates: Spline coefficients of the meridian [R0].
        volume, area: V [R0³] and S [R0²]; `volume_ratio`, `area_ratio` against the stress-free sphere.
        pressure: Inner pressure [E d/R0].
        gap: Distance between the poles, from middle surface to middle surface [R0].
        clearance: Least free space between two places of the wall that face each other, their thickness taken off
            [R0]; below 0 the wall would pass through itself, and the outcome is contact.
        stability: Smallest eigenvalue of the stiffness, negative where the shape is unstable [E d]; at a given
            volume, among the motions that keep it.
        outcome: Integer of `Outcome`: ok, not_converged, contact, no_buckled_state or out_of_range.
        difference: Outer less inner pressure, ΔP [E d/R0].
        elastic: Elastic energy [E d R0²].
        meridian, profile: Its discretisation; thickness over its nominal value at the Gauss points [-].
        conditions: What it was asked for under; where a volume was, the outer pressure found is `outer_pressure`.
        energy: Which elastic energy, `area` of `rest`.
    """

    coordinates: Float[Array, "coordinates"]
    volume: Float[Array, ""]
    area: Float[Array, ""]
    pressure: Float[Array, ""]
    gap: Float[Array, ""]
    clearance: Float[Array, ""]
    stability: Float[Array, ""]
    outcome: Int[Array, ""]
    meridian: Meridian
    profile: Float[Array, "points"]
    difference: Float[Array, ""]
    elastic: Float[Array, ""]
    conditions: Reduced
    energy: str = eqx.field(static=True)

    @readable
    def __repr__(self) -> str:
        return shown(
            self,
            f"V/V0 {number(self.volume_ratio)}",
            f"S/S0 {number(self.area_ratio)}",
            f"inner pressure {number(self.pressure, PRESSURE)}",
            f"outer pressure {number(self.outer_pressure, PRESSURE)}",
            f"smallest stiffness {number(self.stability, 'E d')}",
            f"{self.meridian.elements} elements",
            ended(self.outcome),
        )

    @property
    def volume_ratio(self) -> Float[Array, "..."]:
        return self.volume / SPHERE_VOLUME

    @property
    def area_ratio(self) -> Float[Array, "..."]:
        return self.area / SPHERE_AREA

    @property
    def outer_pressure(self) -> Float[Array, "..."]:
        return self.pressure + self.difference


@eqx.filter_jit
def reworked(
    found: RestShape,
    base: Meridian,
    breaks: Float[Array, "nodes"],
    conditions: Reduced,
    branch: str,
    area: str,
    volume_ratio: Float[Array, ""] | None,
) -> RestShape:
    """A rest shape settled anew on other nodes, of a mesh like `base`; the thickness of its wall comes along."""
    # the old shape, read off at the new nodes, is close enough for Newton to start from
    shape = regrade(base, breaks)
    start = transfer(found.coordinates, found.meridian, shape)
    profile = resampled(found.profile, found.meridian, shape)
    if volume_ratio is None:
        return settle(shape, conditions, profile, start, branch, area)
    wanted = volume_ratio * SPHERE_VOLUME
    settled = settle_at_volume(shape, conditions, profile, start, found.difference, wanted, area)
    return measured(settled, shape, conditions, profile, branch, area, volume_ratio)


def settle(
    shape: Meridian,
    conditions: Reduced,
    profile: Float[Array, "points"],
    start: Float[Array, "coordinates"],
    branch: str,
    area: str,
    volume_ratio: Float[Array, ""] | None = None,
) -> RestShape:
    """Newton iteration from a start, and the measures of what it finds."""
    # the iteration is not differentiated: `measured` puts the exact derivative on what it has found
    given = jax.lax.stop_gradient((shape, conditions, profile, start, volume_ratio))
    return measured(iterate(*given, branch, area), shape, conditions, profile, branch, area, volume_ratio)


@eqx.filter_jit
def find(
    shape: Meridian,
    conditions: Reduced,
    spot: tuple[Float[Array, ""], Float[Array, ""]],
    branch: str,
    area: str,
    volume_ratio: Float[Array, ""] | None,
    graded: bool,
) -> RestShape:
    """Rest shape from a seed, on even nodes or on nodes that follow the rim."""
    if not graded:
        # even nodes serve the sphere, whose curvature is the same everywhere
        start = seed(shape, conditions, branch, volume_ratio)
        return settle(shape, conditions, thinned(shape, *spot), start, branch, area, volume_ratio)

    # where the nodes go is a choice of discretisation: the shape must not depend on it, so it has no derivative
    fixed, ratio, at_spot = jax.lax.stop_gradient((conditions, volume_ratio, spot))
    like = shape_like(fixed, ratio)

    def follow(k, state):
        breaks, before, found = state
        now = regrade(before, breaks)
        # the first solution begins at the mirrored cap, the second at the first one's shape on its own nodes
        start = jnp.where(k == 0, dimple(now, like, fixed.thickness), transfer(found.q, before, now))
        found = iterate(now, fixed, thinned(now, *at_spot), start, ratio, branch, area)
        return rim_breaks(now, found.q), now, found

    size = shape.active.shape[0] + (volume_ratio is not None)
    zero = jnp.zeros(())
    nothing = Equilibrium(shape.sphere, jnp.zeros((size, size)), zero, jnp.asarray(False), zero)
    began = dimple_breaks(shape, like, fixed.thickness), shape, nothing
    _, shape, found = jax.lax.fori_loop(0, FOLLOWING, follow, began)
    return measured(found, shape, conditions, thinned(shape, *spot), branch, area, volume_ratio)


def shape_like(conditions: Reduced, volume_ratio: Float[Array, ""] | None) -> Float[Array, ""]:
    """V/V0 of the mirrored cap to start from."""
    if volume_ratio is None:
        # on the plateau the wall bears about ΔP: what is left of the outer pressure is the gas, P0 (V0/V)^κ, hence V
        excess = conditions.outer_pressure - plateau_pressure(conditions.thickness, conditions.poisson_ratio)
        volume_ratio = jnp.asarray((conditions.gas_pressure / jnp.maximum(excess, 1e-6)) ** (1 / conditions.kappa))
    # a cap too deep touches the far pole, one too shallow falls back to the sphere: either is no start
    least = jnp.where(conditions.thickness > THICK, 0.7, 0.3)
    return jnp.clip(volume_ratio, least, 0.97)


def seed(
    shape: Meridian, conditions: Reduced, branch: str, volume_ratio: Float[Array, ""] | None
) -> Float[Array, "coordinates"]:
    """Where an iteration starts: a mirrored cap of about the volume, or the compressed sphere."""
    if branch == "buckled":
        return dimple(shape, shape_like(conditions, volume_ratio), conditions.thickness)
    if volume_ratio is None:
        volume_ratio = sphere_state(conditions).volume / SPHERE_VOLUME
    return compressed_sphere(shape, volume_ratio ** (1 / 3))


def iterate(shape, conditions, profile, start, volume_ratio, branch, area) -> Equilibrium:
    """Newton iteration under the outer pressure or at a volume."""
    if volume_ratio is None:
        return settle_under_pressure(shape, conditions, profile, start, branch == "buckled", area)
    plateau = jnp.asarray(plateau_pressure(conditions.thickness, conditions.poisson_ratio))
    wanted = volume_ratio * SPHERE_VOLUME
    if branch == "sphere":
        return settle_at_volume(shape, conditions, profile, start, plateau, wanted, area)

    # only a minimum at the volume will do: gases ever stiffer hold it while the shape is let down
    pressures = jnp.asarray(CUSHIONS)

    def let_down(k, state):
        q, p = state
        # a stiff gas of the wanted volume holds the shape near it, and leaves it free otherwise
        soft = eqx.tree_at(lambda c: c.gas_pressure, conditions, pressures[k])
        loaded = eqx.tree_at(lambda c: c.outer_pressure, soft, gas_pressure(wanted, soft) + p)
        q = settle_under_pressure(shape, loaded, profile, q, True, area).q
        # the difference that the wall bears at this shape corrects the load of the next, stiffer gas
        return q, loaded.outer_pressure - gas_pressure(volume(shape, q), soft)

    q, p = jax.lax.fori_loop(0, len(CUSHIONS), let_down, (start, plateau))
    return settle_at_volume(shape, conditions, profile, q, p, wanted, area)


def measured(
    found: Equilibrium,
    shape: Meridian,
    conditions: Reduced,
    profile: Float[Array, "points"],
    branch: str,
    area: str,
    volume_ratio: Float[Array, ""] | None = None,
) -> RestShape:
    """What an iteration has found, with its derivative in the conditions and in the volume."""
    # q(c) = q* - K⁻¹ ∇U(q*, c), with q* and K frozen; at a volume ΔP is one more unknown
    shape = jax.lax.stop_gradient(shape)
    frozen, K, p, sound = jax.lax.stop_gradient((found.q, found.K, found.difference, found.converged))
    # the residual where the iteration stopped: zero in value, its derivative by the conditions is what is wanted
    if volume_ratio is None:
        slope = shape.free(jax.grad(pinned_energy)(frozen, shape, conditions, profile, area))
    else:
        slope = residual_at_volume(frozen, p, shape, conditions, profile, volume_ratio * SPHERE_VOLUME, area)
    # one Newton step with the frozen matrix: it moves q by rounding, and carries dq/dc = -K⁻¹ ∂²U/∂q∂c
    correction = undetermined(~sound, -jnp.linalg.solve(K, slope))
    q = frozen.at[shape.active].add(correction[: shape.active.shape[0]])

    V = volume(shape, q)
    P = gas_pressure(V, conditions)
    difference = conditions.outer_pressure - P if volume_ratio is None else p + correction[-1]
    distance = gap(shape, q)
    # how it ended is told by the shape that was reached, even where that is no answer
    reached = gap(shape, frozen)
    sunk = height(shape, frozen) - reached
    # later lines overrule earlier ones: a wall that touches itself is said whatever else holds
    outcome = jnp.where(sound, Outcome.OK, Outcome.NOT_CONVERGED)
    if branch == "buckled":
        outcome = jnp.where(sound & (sunk < DIMPLE_DEPTH), Outcome.NO_BUCKLED_STATE, outcome)
    moduli = wall(shape, conditions, profile)
    free = clearance(shape, q, moduli.thickness)
    outcome = jnp.where(sound & (free < 0), Outcome.CONTACT, outcome)
    outcome = jnp.where(~sound & (reached < 0), Outcome.CONTACT, outcome)
    elastic = elastic_energy(shape, q, moduli, area)
    return RestShape(
        coordinates=q,
        volume=V,
        area=area_of(shape, q),
        pressure=P,
        gap=distance,
        clearance=free,
        stability=found.lowest,
        outcome=outcome,
        meridian=shape,
        profile=profile,
        difference=jnp.asarray(difference),
        elastic=elastic,
        conditions=conditions,
        energy=str(area),
    )


@lru_cache(maxsize=16)
def cached_meridian(elements: int, attached: float, crowded: bool = False) -> Meridian:
    """The discretisation of a size and pad, crowded at its edge or not; built once."""
    with jax.ensure_compile_time_eval():
        return meridian(elements, attached, crowded=crowded)


def raise_unless_ok(place: str, outcome: Int[Array, ""]) -> None:
    """Raise `NotOk` for a concrete outcome other than ok."""
    if int(outcome) != Outcome.OK:
        raise NotOk(place, Outcome(int(outcome)))

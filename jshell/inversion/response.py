"""How a shell at rest rings: rates, how each mode moves every channel, and where the channels rest; with derivatives.

One compiled program serves every shell that has as many elements, a pad or none, and a wall with losses or without:
thickness, pressures, viscosity, exponents, the pad's size, the weak spot and the wall's retardation are its arguments.
What the program has found carries its derivative by the implicit function theorem, the pad's by nodes that stretch
along with it.

Symbols    s = -1/τ + iΩ rate [1/time]   φ change of a channel along a mode   θ* angle of an extremum [rad]
Valid for  small vibrations; liquid `second`: η̂ < 0.03, `exact`: any
Source     `jshell.membrane.equilibrium` for the rest shape, `jshell.dynamics.roots` for the rates; scattered pressure
           ρ V̈/(4π r) of a source, beside which a dipole's falls with r², as in `jshell.oscillator.drive`
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from jshell.contour import Meridian, area, carry, thinned, volume, with_pad, with_small_edge
from jshell.contour.splines import ParitySplines
from jshell.dynamics.roots import matrices, roots
from jshell.dynamics.vibrations import RESIDUAL
from jshell.errors import Outcome
from jshell.membrane import WallLoss, stiffness, wall
from jshell.membrane.equilibrium import RestShape, cached_meridian, find, settle
from jshell.membrane.newton import pinned, pinned_energy
from jshell.shell.parameters import Reduced

FIELDS = (
    "thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio", "pad", "weak_spot",
    "retardation",
)  # fmt: skip
PAD_FIELD, SPOT_FIELD, RETARDATION_FIELD = 6, 7, 8  # places among the fields; before them those of `Reduced`
ECHO = "p_scattered"  # far away, times distance
ACROSS = {"W_25": 0.25, "W_50": 0.5, "W_75": 0.75}  # widths, and the shares of the height that they are taken at
CHANNELS = ("H", "W", "V", "S", "x_front", "x_back", ECHO, *ACROSS)
MODES = 4
SEARCHED = "second"  # the liquid of a search; benchmarks put its first order there
DIRECTIONS = 4  # tangents that one call carries
NOMINAL_PAD = 0.3  # [rad]; a mesh with a pad is made for this size and stretched to the one asked for
BESIDE = 4  # elements more on each side of a pad's edge
SHARP, BLUNT = 2.0, 1.5  # ratio of neighbours there; of the two meshes that tell the limit
SPOT_WIDTH = 0.35  # [rad]
QUICKLY = {"xla_backend_optimization_level": 1}  # runs as fast, compiles sooner
AT_EXTREMUM, AT_HEIGHT = 4, 6  # Newton steps to an extremum of a spline, to where it has a value


class ModalResponse(NamedTuple):
    """Rates (modes,), changes of the channels along them (modes, channels), rest values (channels,), outcomes (modes,).

    Of tangents the same with one leading axis.
    """

    rates: Any
    shapes: Any
    rest: Any
    outcome: Any


@lru_cache(maxsize=8)
def mesh(elements: int, held: bool) -> Meridian:
    """The discretisation that a program is made for; of a held shell with small elements at the pad's edge."""
    with jax.ensure_compile_time_eval():
        return with_small_edge(plain_mesh(elements, held), BESIDE, SHARP) if held else plain_mesh(elements, held)


def plain_mesh(elements: int, held: bool) -> Meridian:
    """The one that a shell at rest is sought on."""
    return cached_meridian(elements, NOMINAL_PAD if held else 0.0)


def conditions_of(numbers: Float[Array, "fields"]) -> Reduced:
    """The problem among the arguments."""
    return Reduced(*(numbers[k] for k in range(PAD_FIELD)))


def loss_of(numbers: Float[Array, "fields"], lossy: bool) -> WallLoss | None:
    """What the wall loses itself, of a shell that was said to."""
    return WallLoss(retardation=numbers[RETARDATION_FIELD]) if lossy else None


class Standing(NamedTuple):
    """Where a response is sought from: nodes, how a shape on them differs from the sphere, how finding it ended."""

    nodes: Float[Array, "nodes"]
    displacement: Float[Array, "coordinates"]
    outcome: Array


@lru_cache(maxsize=8)
def standing_program(elements: int, held: bool) -> Callable[[Any], Standing]:
    """Compiled: numbers (fields,) to a shell at rest on nodes that follow its rim."""
    base = plain_mesh(elements, held)

    def standing(numbers):
        spot = numbers[SPOT_FIELD], jnp.asarray(SPOT_WIDTH)
        found = find(with_pad(base, numbers[PAD_FIELD]), conditions_of(numbers), spot, "buckled", "current", None, True)
        return Standing(found.meridian.nodes, found.coordinates - found.meridian.sphere, found.outcome)

    return jax.jit(standing, compiler_options=QUICKLY)


@lru_cache(maxsize=8)
def sharpening_program(elements: int) -> Callable[[Standing, Any], Standing]:
    """Compiled: a held shell at rest on nodes that crowd at the pad's edge, neighbours of a ratio."""
    base = plain_mesh(elements, True)

    def sharpened(near, ratio):
        before = with_pad(base, jnp.pi - near.nodes[base.edge], near.nodes)
        after = with_small_edge(before, BESIDE, ratio)
        return Standing(after.nodes, carry(near.displacement, before, after), near.outcome)

    return jax.jit(sharpened, compiler_options=QUICKLY)


@lru_cache(maxsize=8)
def response_program(
    elements: int, held: bool, lossy: bool = False
) -> Callable[..., tuple[ModalResponse, ModalResponse]]:
    """Compiled: the response of a shell near another one, and its change along tangents; the liquid to second order.

    Its arguments are numbers (fields,), tangents (DIRECTIONS, fields) and a `Standing`. On given nodes it is a smooth
    function, and its change is exact. A pad of another size stretches them.
    """
    base = mesh(elements, held)

    def response(numbers, tangents, near):
        at = lambda x: _response(x, near, base, (SEARCHED,), lossy)[0]  # noqa: E731
        pushforward = lambda direction: jax.jvp(at, (numbers,), (direction,))  # noqa: E731
        return jax.vmap(pushforward, out_axes=(None, 0))(tangents)

    return jax.jit(response, compiler_options=QUICKLY)


@lru_cache(maxsize=8)
def liquids_program(
    elements: int, held: bool, lossy: bool = False
) -> Callable[..., tuple[ModalResponse, ModalResponse]]:
    """Compiled: the response in the liquid of second order and in the exact one, on the plain mesh.

    The exact liquid's waves are not resolved by elements that shrink quickly.
    """
    base = plain_mesh(elements, held)
    both = lambda numbers, near: _response(numbers, near, base, ("second", "exact"), lossy)  # noqa: E731
    return jax.jit(both, compiler_options=QUICKLY)


def _response(
    numbers: Float[Array, "fields"], near: Standing, base: Meridian, liquids: tuple[str, ...], lossy: bool
) -> tuple[ModalResponse, ...]:
    conditions = conditions_of(numbers)
    shape = with_pad(base, numbers[PAD_FIELD], near.nodes)
    profile = thinned(shape, numbers[SPOT_FIELD], jnp.asarray(SPOT_WIDTH))
    rest = _at_rest(shape, conditions, profile, near)
    loss = loss_of(numbers, lossy)
    return tuple(_in_liquid(shape, rest, conditions, liquid, loss) for liquid in liquids)


def _in_liquid(
    shape: Meridian, rest: RestShape, conditions: Reduced, liquid: str, loss: WallLoss | None
) -> ModalResponse:
    found = roots(matrices(rest, conditions, liquid, loss=loss), conditions.viscosity, MODES)
    v = jnp.zeros((MODES, shape.sphere.shape[0]), complex).at[:, shape.active].set(found.vectors)
    values, along = _channels(shape, rest.coordinates, v, found.s)
    lost = ~(found.residual < RESIDUAL)
    outcome = jnp.where(rest.outcome != Outcome.OK, rest.outcome, jnp.where(lost, Outcome.NOT_CONVERGED, Outcome.OK))
    return ModalResponse(found.s, along, values, jax.lax.stop_gradient(outcome).astype(float))


def _at_rest(shape: Meridian, conditions: Reduced, profile, near: Standing) -> RestShape:
    """The rest shape on given nodes, with its derivative in conditions, wall and nodes."""
    # displacements are carried along, so that what the pad holds stays on the sphere
    start = shape.sphere + near.displacement
    fixed = jax.lax.stop_gradient((shape, conditions, profile))
    found = settle(*fixed, jax.lax.stop_gradient(start), "buckled", "current")
    begun = shape.sphere + jax.lax.stop_gradient(found.coordinates - shape.sphere)
    K = pinned(fixed[0], stiffness(fixed[0], found.coordinates, wall(*fixed), fixed[1], "current"))
    slope = shape.free(jax.grad(pinned_energy)(begun, shape, conditions, profile, "current"))
    K = jnp.where(found.outcome == Outcome.OK, K, jnp.eye(K.shape[0]))
    q = begun.at[shape.active].add(-jnp.linalg.solve(jax.lax.stop_gradient(K), slope))
    return eqx.tree_at(lambda s: (s.coordinates, s.meridian, s.profile), found, (q, shape, profile))


def _channels(
    shape: Meridian,
    q: Float[Array, "coordinates"],
    v: Complex[Array, "modes coordinates"],
    s: Complex[Array, "modes"],
) -> tuple[Float[Array, "channels"], Complex[Array, "modes channels"]]:
    """Every channel at rest, and its change along each mode."""
    (qx, qr), vx, vr = shape.split(q), v[:, : shape.x_size], v[:, shape.x_size :]
    front, back = shape.x_nodes[0], shape.x_nodes[-1]
    # the lowest place is the pole opposite to the dimple
    top = _highest(ParitySplines(shape.nodes, "even", shape.edge), shape.x_nodes, qx)
    wide = _highest(ParitySplines(shape.nodes, "odd", shape.edge), shape.r_nodes, qr)
    V, dV = jax.value_and_grad(lambda q: volume(shape, q))(q)
    S, dS = jax.value_and_grad(lambda q: area(shape, q))(q)
    widths, across = _across(shape, q, v, top, back)
    values = jnp.stack([(top - back) @ qx, 2 * wide @ qr, V, S, front @ qx, back @ qx, jnp.zeros(())])
    identified = s**2 * (v @ dV) / (4 * jnp.pi)
    along = [vx @ (top - back), 2 * vr @ wide, v @ dV, v @ dS, vx @ front, vx @ back, identified]
    return jnp.concatenate([values, widths]), jnp.concatenate([jnp.stack(along, axis=1), across], axis=1)


def _across(
    shape: Meridian, q: Float[Array, "coordinates"], v: Complex[Array, "modes coordinates"], top, back
) -> tuple[Float[Array, "widths"], Complex[Array, "modes widths"]]:
    """Widths across the axis at shares of the height, as a camera sees them from aside, and their changes.

    Args:
        shape, q, v: The shell, its rest shape, its modes.
        top, back: (x_size,) values of all basis functions at the two ends of the height.
    """
    (qx, qr), vx, vr = shape.split(q), v[:, : shape.x_size], v[:, shape.x_size :]
    even, odd = (ParitySplines(shape.nodes, parity, shape.edge) for parity in ("even", "odd"))
    share = jnp.array(list(ACROSS.values()))[:, None]
    at = (1 - share) * back[None] + share * top[None]
    fixed, nodes = jax.lax.stop_gradient(qx), jax.lax.stop_gradient(shape.nodes)
    height = jax.lax.stop_gradient(at) @ fixed
    # from the outermost node that lies above: what a dimple hides lies before it
    above = (shape.x_nodes @ fixed)[None] >= height[:, None]
    k = jnp.minimum(nodes.size - 1 - jnp.argmax(above[:, ::-1], axis=1), nodes.size - 2)
    low, high = nodes[k], nodes[k + 1]
    still = ParitySplines(nodes, "even", shape.edge)

    def step(_, theta):
        slope = still(theta, 1) @ fixed
        return jnp.clip(theta - (still(theta) @ fixed - height) / jnp.where(slope < 0, slope, -1.0), low, high)

    theta = jax.lax.fori_loop(0, AT_HEIGHT, step, (low + high) / 2)
    # the step carries the derivative of the place
    slope = jax.lax.stop_gradient(still(theta, 1) @ fixed)
    theta = theta - (even(theta) @ qx - at @ qx) / jnp.where(slope < 0, slope, -1.0)
    lean = (odd(theta, 1) @ qr) / (even(theta, 1) @ qx)
    changes = vr @ odd(theta).T - (vx @ (even(theta) - at).T) * lean[None]
    return jnp.asarray(2 * odd(theta) @ qr), jnp.asarray(2 * changes)


def _highest(splines: ParitySplines, at_nodes, coefficients: Float[Array, "size"]) -> Float[Array, "size"]:
    """Values of all basis functions where their sum is largest."""
    nodes = jax.lax.stop_gradient(splines.breaks)
    fixed = jax.lax.stop_gradient(coefficients)
    k = jnp.argmax(at_nodes @ fixed)
    low, high = nodes[jnp.maximum(k - 1, 0)], nodes[jnp.minimum(k + 1, nodes.shape[0] - 1)]

    def step(_, theta):
        slope, bend = (jax.lax.stop_gradient(splines(theta, order)) @ fixed for order in (1, 2))
        return jnp.clip(theta - slope / jnp.where(bend < 0, bend, -1.0), low, high)

    theta = jax.lax.fori_loop(0, AT_EXTREMUM, step, nodes[k])
    bend = jax.lax.stop_gradient(splines(theta, 2)) @ fixed
    # the step carries the derivative of the place, where the change along a mode needs it
    moved = (splines(theta, 1) @ coefficients) / jnp.where(bend < 0, bend, -1.0)
    return jnp.asarray(splines(theta - jnp.where((theta > low) & (theta < high), moved, 0.0)))

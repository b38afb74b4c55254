"""Whether a rest shape stays round: its stiffness against motions that vary around the axis.

Of every order m = 1, 2, … the smallest eigenvalue of K_m is taken, against the
mean square of the displacement over the stress-free sphere; a negative one means
that the shape is none in three dimensions. Too few elements at a rim hide
that, so the shape is settled on more of them until the answer stays.

Symbols    λ eigenvalue [E d/R0²]   m order around the axis   V volume [R0³]
Valid for  any rest shape, free or attached; small motions about it
Source     second variation of the energy; Quilliet 2006 and Knoche and Kierfeld 2014 for polygonal dimples
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jshell.contour import Azimuthal, Meridian, azimuthal, rim_breaks
from jshell.display import ended, number, readable, shown
from jshell.errors import BadShape, BadValue, Outcome
from jshell.membrane.azimuthal import (
    density_in_space,
    jet_matrix,
    jet_of,
    null_motions,
    order_of,
    point_hessians,
    to_components,
)
from jshell.membrane.energy import wall
from jshell.membrane.equilibrium import RestShape, cached_meridian, raise_unless_ok, reworked

HIGHEST_ORDER = 40  # order: more than the thinnest rest shape needs
FEWEST = 4  # orders that are always looked at
FINER = 1.5  # elements from one look to the next
LOOKS = 5
SETTLED = 0.01  # relative change of the lowest eigenvalue at which the elements are enough
NULL_STIFFNESS = 100.0  # stiffness given to motions that cost nothing


class Stability(eqx.Module):
    """What a rest shape costs to push out of round; arrays are (orders,).

    Attributes:
        orders: m.
        eigenvalues: Lowest of each order [E d/R0²]; negative where the shape is not round.
        shapes: (orders, motions) the motions, coordinates (a, b + c, b - c), unit mean square integral.
        rest: The rest shape on the elements that were enough.
        error: What the lowest eigenvalue still changed by [E d/R0²].
        outcome: ok; not_converged where no number of elements was enough; or how the rest shape ended.
    """

    orders: Int[Array, "orders"]
    eigenvalues: Float[Array, "orders"]
    shapes: Float[Array, "orders motions"]
    rest: RestShape
    error: Float[Array, ""]
    outcome: Int[Array, ""]

    @readable
    def __repr__(self) -> str:
        lowest = f"lowest eigenvalue {number(self.eigenvalue, 'E d/R0²')} at m = {int(self.order)}"
        return shown(self, self.verdict, lowest, f"{self.rest.meridian.elements} elements", ended(self.outcome))

    @property
    def lowest(self) -> Int[Array, ""]:
        """Index of the softest order."""
        return jnp.argmin(self.eigenvalues)

    @property
    def order(self) -> Int[Array, ""]:
        """m of the softest motion."""
        return self.orders[self.lowest]

    @property
    def eigenvalue(self) -> Float[Array, ""]:
        """The lowest eigenvalue of all orders [E d/R0²]."""
        return self.eigenvalues[self.lowest]

    @property
    def is_round(self) -> bool:
        """Whether no motion out of round lowers the energy; false too where the outcome is not ok."""
        return int(self.outcome) == Outcome.OK and float(self.eigenvalue) > 0

    @property
    def verdict(self) -> str:
        """`round`, `not round` with the softest order, or `unknown`."""
        if int(self.outcome) != Outcome.OK:
            return "unknown"
        return "round" if self.is_round else f"not round: m = {int(self.order)}"


def stability(
    rest: RestShape, *, orders: Sequence[int] | None = None, elements: int | None = None, throw: bool = False
) -> Stability:
    """Whether a rest shape is round; the eigenvalues are differentiable in the conditions of the rest shape.

    Args:
        rest: From `jshell.membrane.rest`, not batched.
        orders: Which m, from 1 on; by default as many as its thickness can make unstable.
        elements: Look once, on so many elements. By default the shape is settled on ever more of them until the lowest
            eigenvalue keeps its sign and changes by less than 1 %.
        throw: Raise `NotOk` unless the outcome is ok (outside `jit` only).

    Raises:
        BadValue: An order below 1 or above 40, or none; under `jit`, orders or elements not given.
        BadShape: A batch of rest shapes.

    Example:
        >>> import jshell as js
        >>> shape = js.membrane.rest(js.presets.R.conditions, elements=24)
        >>> print(js.membrane.stability(shape, orders=range(1, 9), elements=24).verdict)
        round
    """
    if rest.volume.ndim:
        raise BadShape(
            "rest", found=f"a batch {rest.volume.shape}", expected="one rest shape", remedy="Take them one by one."
        )
    thickness, outcome = jax.lax.stop_gradient((rest.conditions.thickness, rest.outcome))
    if isinstance(outcome, Tracer) and (orders is None or elements is None):
        raise BadValue(
            "orders, elements",
            found="None under `jit` or `vmap`",
            expected="both given, as they depend on the shape",
            remedy="For example orders=range(1, 9), elements=48.",
        )
    chosen = jnp.asarray(usual_orders(float(thickness)) if orders is None else checked_orders(orders))
    state = rest if elements in (None, rest.meridian.elements) else refined(rest, int(elements or 0))
    values, shapes = spectrum(state, chosen)
    error, enough = jnp.zeros(()), elements is not None or int(outcome) != Outcome.OK
    for _ in range(LOOKS):
        if enough:
            break
        finer = refined(state, int(np.ceil(FINER * state.meridian.elements / 4) * 4))
        if int(jax.lax.stop_gradient(finer.outcome)) != Outcome.OK:
            break
        before, (state, (values, shapes)) = values, (finer, spectrum(finer, chosen))
        error = jax.lax.stop_gradient(jnp.abs(jnp.min(values) - jnp.min(before)))
        # a motion that costs next to nothing is one of the shapes' own, and its sign is not known: look again
        now, before = jax.lax.stop_gradient((values, before))
        enough = bool(error < SETTLED * jnp.abs(jnp.min(now))) and bool(jnp.all((now > 0) == (before > 0)))
    outcome = jnp.where(jnp.asarray(enough), state.outcome, int(Outcome.NOT_CONVERGED))
    if throw:
        raise_unless_ok("stability", outcome)
    return Stability(chosen, values, shapes, state, error, outcome)


def usual_orders(thickness: float) -> np.ndarray:
    """Orders that a shell of a thickness can lose its symmetry by, and some more."""
    return np.arange(1, int(np.clip(np.ceil(2.0 / np.sqrt(thickness)), FEWEST, HIGHEST_ORDER)) + 1)


def checked_orders(orders: int | Sequence[int]) -> np.ndarray:
    """Orders as an array, each from 1 to the highest."""
    chosen = np.atleast_1d(np.asarray(orders))
    whole = chosen.size > 0 and np.issubdtype(chosen.dtype, np.integer)
    if not (whole and chosen.min() >= 1 and chosen.max() <= HIGHEST_ORDER):
        raise BadValue(
            "orders",
            found=repr(orders),
            expected=f"integers from 1 to {HIGHEST_ORDER}",
            remedy="Axisymmetric motions (m = 0) are in `rest.stability` and `modes`.",
        )
    return chosen


def refined(state: RestShape, elements: int) -> RestShape:
    """A rest shape settled at its volume on another number of elements, crowded at its rim."""
    frozen = jax.lax.stop_gradient(state)
    base = cached_meridian(elements, state.meridian.attached)
    breaks = spread(frozen, base.edge, elements)
    # told as a sphere: that it has a dimple has been judged already
    return reworked(frozen, base, breaks, state.conditions, "sphere", state.energy, state.volume_ratio)


def spread(state: RestShape, edge: int | None, elements: int) -> Float[Array, "nodes"]:
    """Breakpoints that crowd where the shape bends, as many as wanted."""
    old = state.meridian
    nodes = rim_breaks(old, state.coordinates)
    index = jnp.linspace(0.0, 1.0, elements + 1)
    if edge is None or old.edge is None:
        return jnp.interp(index, jnp.linspace(0.0, 1.0, old.elements + 1), nodes)
    k = jnp.arange(elements + 1)
    moving = jnp.interp(k / edge * old.edge, jnp.arange(old.elements + 1.0), nodes)
    share = (k - edge) / (elements - edge) * (old.elements - old.edge) + old.edge
    held = jnp.interp(share, jnp.arange(old.elements + 1.0), nodes)
    return jnp.where(k <= edge, moving, held)


def spectrum(
    state: RestShape, orders: Int[Array, "orders"]
) -> tuple[Float[Array, "orders"], Float[Array, "orders motions"]]:
    """Lowest eigenvalue and motion of each order of a rest shape, on its own elements."""
    frozen = jax.lax.stop_gradient(state)
    splines, hessians, nulls = shared(frozen)
    values, shapes = jax.lax.stop_gradient(_softest(frozen.meridian, splines, hessians, nulls, orders))
    if not isinstance(state.difference, Tracer):
        return values, shapes
    # with the motion held, its energy carries the derivative of the eigenvalue
    energies = jax.vmap(lambda m, v: twice_energy(state, splines, m, v))(orders, shapes)
    return values + (energies - jax.lax.stop_gradient(energies)), shapes


@eqx.filter_jit
def _softest(shape: Meridian, splines: Azimuthal, hessians, nulls, orders):
    """Lowest eigenvalue and motion of each order."""

    def lowest(m):
        order = order_of(shape, splines, hessians, nulls, m)
        held = order.gram @ order.nulls
        L = jnp.linalg.cholesky(order.gram)
        half = jax.scipy.linalg.solve_triangular(L, order.K + NULL_STIFFNESS * held @ held.T, lower=True)
        compact = jax.scipy.linalg.solve_triangular(L, half.T, lower=True)
        values, vectors = jnp.linalg.eigh((compact + compact.T) / 2)
        return values[0], jax.scipy.linalg.solve_triangular(L.T, vectors[:, 0], lower=False)

    return jax.vmap(lowest)(orders)


def shared(state: RestShape) -> tuple[Azimuthal, Float[Array, "points 17 17"], Float[Array, "motions 3"]]:
    """What all orders of a rest shape share: splines, Hessians of the density, null motions."""
    shape, q = state.meridian, state.coordinates
    splines = azimuthal(shape)
    moduli = wall(shape, state.conditions, state.profile)
    hessians = point_hessians(shape, q, moduli, state.difference, state.energy)
    uniform = jnp.max(jnp.abs(state.profile - 1)) < 1e-12
    return splines, hessians, null_motions(splines, shape, q, uniform)


def twice_energy(state: RestShape, splines: Azimuthal, m: Int[Array, ""], v: Float[Array, "motions"]):
    """v·K_m v by the second derivative along v alone, m >= 1."""
    shape = state.meridian
    moduli = wall(shape, state.conditions, state.profile)
    parts = zip(splines.motion(m), v.reshape(3, -1), strict=True)
    local = jnp.concatenate([family.values @ part for family, part in parts])
    along = jet_matrix(m) @ to_components() @ local

    def second(jet, way, moduli):
        energy = lambda size: density_in_space(jet + size * way, moduli, state.difference, state.energy)  # noqa: E731
        return jax.grad(jax.grad(energy))(0.0)

    bent = jax.vmap(second)(jet_of(shape.at_points(state.coordinates)).T, along.T, moduli)
    return jnp.pi * jnp.sum(shape.weights * bent)

"""The liquid away from the wall: potential and velocity at any point outside the shell.

Green's third identity for a liquid at rest far away, now at a point y in it,

    φ(y) = ∮ (φ - φ*) G' dθ - ∮ G v_n r ds/dθ dθ ,

φ* the potential of the wall point nearest to y: a constant brings nothing
outside a closed surface, and without it G' is tame beside the wall. The velocity
is the derivative by y of the same sum, exact on the axis too. G' of 1 itself
tells inside from outside: it sums to -1 and to 0.

Symbols    φ potential [sqrt(E d R0³/ρ)]   v = ∇φ velocity [sqrt(E d/(ρ R0))]   x along, r across the axis [R0]
Valid for  points further from the wall than `NEAREST` of the element beside them
Source     Lamb, Hydrodynamics, art. 58; kernels as on the wall, see `rings`
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jshell.contour import Curve, Meridian, speed
from jshell.contour.splines import ParitySplines
from jshell.errors import BadShape, BadValue
from jshell.flow.added_mass import Flow, flow
from jshell.flow.panels import flux_of
from jshell.flow.rings import kernels

PIECES = 4  # each element is cut into these
POINTS = 10  # Gauss points on a piece
NEAREST = 0.25  # of an element's length: nearer points are refused
BATCH = 256  # points at once: memory


class FluidField(eqx.Module):
    """The liquid at a set of points; arrays have the shape of the points.

    Attributes:
        potential: φ, zero far away [sqrt(E d R0³/ρ)].
        v_x, v_r: Velocity along and away from the axis [sqrt(E d/(ρ R0))].
        outside: Whether the point lies in the liquid, far enough from the wall to be computed. Elsewhere the
            numbers are 0 and mean nothing.
        distance: To the nearest wall point that was looked at, within 1e-3 of an element's length [R0].
    """

    potential: Float[Array, "..."]
    v_x: Float[Array, "..."]
    v_r: Float[Array, "..."]
    outside: Bool[Array, "..."]
    distance: Float[Array, "..."]

    @property
    def speed(self) -> Float[Array, "..."]:
        """|v| [sqrt(E d/(ρ R0))]."""
        return jnp.hypot(self.v_x, self.v_r)


class _Sources(eqx.Module):
    """The wall cut fine: quadrature weights, curve, ring flux, potential, and the shortest distance allowed."""

    weights: Float[Array, "sources"]
    curve: Curve
    flux: Float[Array, "sources"]
    potential: Float[Array, "sources"]
    nearest: Float[Array, "sources"]


def field(
    shape: Meridian,
    q: Float[Array, "coordinates"],
    velocity: Float[Array, "coordinates"],
    x: Float[Array, "..."] | Float[np.ndarray, "..."] | float,
    r: Float[Array, "..."] | Float[np.ndarray, "..."] | float,
    *,
    current: Flow | None = None,
    throw: bool = False,
) -> FluidField:
    """Potential and velocity of the liquid at points around a moving wall.

    Args:
        shape, q: The wall.
        velocity: (coordinates,) its velocity [R0/time unit].
        x, r: Points, arrays of one shape: position along the axis and distance to it [R0]; 0 on the axis.
        current: `flow(shape, q)`, where it is known already.
        throw: Raise where a point is refused (outside `jit` only).

    Returns:
        The field, with `outside` false at points inside the shell, or nearer to its wall than a quarter of the
        element beside them. At 32 elements or more the error of smooth shapes is that of φ on the wall.

    Raises:
        BadShape: `x` and `r` of different shapes.
        BadValue: With `throw`: a point inside the shell or too near; a negative distance to the axis.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.contour import meridian
        >>> from jshell.flow import field
        >>> shape = meridian(32)
        >>> print(field(shape, shape.sphere, shape.sphere, jnp.array([2.0]), jnp.array([0.0])).v_x.round(6))
        [0.25]
    """
    x, r = jnp.asarray(x, dtype=float), jnp.asarray(r, dtype=float)
    if x.shape != r.shape:
        raise BadShape(
            "x, r", found=f"shapes {x.shape} and {r.shape}", expected="one shape", remedy="Give both for every point."
        )
    if not isinstance(r, Tracer) and bool(jnp.any(r < 0)):
        raise BadValue(
            "r", found=f"{float(jnp.min(r)):g}", expected="distances to the axis of at least 0", remedy="Pass |r|."
        )
    found = _field(shape, q, velocity, current, x.ravel(), r.ravel())
    if throw and not bool(jnp.all(found.outside)):
        k = int(jnp.argmin(found.outside))
        raise BadValue(
            "x, r",
            found=f"{int(jnp.sum(~found.outside))} points inside the shell or too near its wall, "
            f"first ({float(x.ravel()[k]):g}, {float(r.ravel()[k]):g}), {float(found.distance[k]):.3g} from the wall",
            expected=f"points outside, further from it than {NEAREST:g} of an element",
            remedy="Drop them, take more elements, or read `outside` instead of throw=True.",
        )
    return jax.tree.map(lambda values: values.reshape(x.shape), found)


@eqx.filter_jit
def _field(shape: Meridian, q, velocity, current: Flow | None, x, r) -> FluidField:
    current = flow(shape, q) if current is None else current
    wall = _sources(shape, q, velocity, current.potential @ velocity)
    one = lambda point: _at(wall, *point)  # noqa: E731
    if x.shape[0] <= BATCH:
        return jax.vmap(one)((x, r))
    return jax.lax.map(one, (x, r), batch_size=BATCH)


def _sources(shape: Meridian, q, velocity, potential) -> _Sources:
    """The wall at the Gauss points of all pieces of all elements."""
    gauss, gauss_weights = np.polynomial.legendre.leggauss(POINTS)
    starts = 2 * np.arange(PIECES)[:, None] / PIECES - 1
    u = (starts + (gauss[None] + 1) / PIECES).ravel()
    share = np.tile(gauss_weights / 2 / PIECES, PIECES)

    even, odd = (ParitySplines(shape.nodes, parity, shape.edge) for parity in ("even", "odd"))
    phi = ParitySplines(shape.nodes, "even")
    values = lambda splines, numbers, k=0: (splines.within(u, k) @ numbers).ravel()  # noqa: E731
    (qx, qr), (ux, ur) = shape.split(q), shape.split(velocity)
    nothing = jnp.zeros(shape.elements * u.size)
    curve = Curve(
        values(even, qx), values(odd, qr), values(even, qx, 1), values(odd, qr, 1), nothing, nothing
    )  # fmt: skip
    lengths = jnp.diff(shape.nodes)
    weights = (lengths[:, None] * share[None]).ravel()
    nearest = NEAREST * jnp.repeat(lengths, u.size) * speed(curve)
    flux = flux_of(curve, values(even, ux), values(odd, ur))
    return _Sources(weights, curve, flux, values(phi, potential), nearest)


def _at(wall: _Sources, x: Float[Array, ""], r: Float[Array, ""]) -> FluidField:
    """The liquid at one point."""
    squared = (wall.curve.x - x) ** 2 + (wall.curve.r - r) ** 2
    k = jnp.argmin(squared)
    distance = jnp.sqrt(squared[k])
    far_enough = distance > wall.nearest[k]
    # a refused point is computed somewhere harmless instead
    x, r = jnp.where(far_enough, x, 10.0), jnp.where(far_enough, r, 10.0)

    def sums(place):
        x, r = place
        dx, dr = wall.curve.x - x, wall.curve.r - r
        shortest, longest = dx**2 + dr**2, dx**2 + (wall.curve.r + r) ** 2
        bend = (wall.curve.x1 * dr - wall.curve.r1 * dx) / shortest
        source, dipole = kernels(shortest, longest, bend, wall.curve.r, wall.curve.x1)
        value = jnp.sum(wall.weights * (dipole * (wall.potential - wall.potential[k]) - source * wall.flux))
        return value, (value, jnp.sum(wall.weights * dipole))

    (along, across), (value, enclosed) = jax.jacfwd(sums, has_aux=True)(jnp.stack([x, r]))
    outside = far_enough & (jnp.abs(enclosed) < 0.5)
    keep = lambda number: jnp.where(outside, number, 0.0)  # noqa: E731
    return FluidField(keep(value), keep(along), keep(across), outside, distance)

"""The meridian: how a closed surface of revolution is represented.

The wall is the curve x(θ), r(θ), 0 <= θ <= π, turned about the x axis; θ is
the polar angle a material point had on the stress-free sphere, and the
buckling pole sits at θ = 0. Both functions are quintic splines, even and odd
about the poles. Their coefficients, stacked as (x, r), are the shell's
coordinates q; everything else is a constant matrix times q.

Symbols    q coordinates [R0]   θ material angle [rad]   a angle held by a pad [rad]
Valid for  shapes that are smooth on the scale of one element
Source     the curve and its parameter: Mokbel et al. 2021, numerical method
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jshell.contour.splines import DEGREE, ParitySplines
from jshell.errors import BadValue

POINTS = 5  # Gauss points per element: a quintic's curvature squared is integrated to rounding
NEAR_POINTS = 10  # graded points on each element that touches a node
GRADING = 4  # s = u⁴ turns a logarithm at s = 0 into u³ log u
MINIMUM_ELEMENTS = 8


class Curve(NamedTuple):
    """Position and derivatives with respect to θ at a set of angles, each (…,)."""

    x: Float[Array, "..."]
    r: Float[Array, "..."]
    x1: Float[Array, "..."]
    r1: Float[Array, "..."]
    x2: Float[Array, "..."]
    r2: Float[Array, "..."]


class Near(NamedTuple):
    """Constants of the quadrature on the two elements that touch each node.

    Arrays are (nodes, near, ·): values and first derivatives of both bases,
    their divided differences from the node and the derivatives of those.
    """

    weights: Float[Array, "nodes near"]
    gaps: Float[Array, "nodes near"]
    x_slope: Float[Array, "nodes near even"]
    r_slope: Float[Array, "nodes near odd"]
    x_quotient: Float[Array, "nodes near even"]
    r_quotient: Float[Array, "nodes near odd"]
    x_quotient_slope: Float[Array, "nodes near even"]
    r_quotient_slope: Float[Array, "nodes near odd"]
    r_value: Float[Array, "nodes near odd"]
    x_value: Float[Array, "nodes near even"]
    potential: Float[Array, "nodes near nodes"]


class Meridian(eqx.Module):
    """The constant matrices of one discretisation. Build with `meridian`.

    Attributes:
        angles, weights: (points,) Gauss points [rad] and weights of all elements.
        x_basis, r_basis: (3, points, ·) values, first and second derivatives.
        potential_basis: (3, points, nodes) the same for the liquid's potential.
        nodes: (nodes,) breakpoints [rad]; `x_nodes`, `r_nodes` evaluate there.
        far: (nodes, points) Gauss weights with the elements touching a node left out.
        sphere: (coordinates,) the stress-free sphere.
        active: (free coordinates,) indices of the coordinates that may move.
        shift: (coordinates,) rigid translation along the axis, or zero when attached.
    """

    angles: Float[Array, "points"]
    weights: Float[Array, "points"]
    x_basis: Float[Array, "3 points even"]
    r_basis: Float[Array, "3 points odd"]
    potential_basis: Float[Array, "3 points nodes"]
    nodes: Float[Array, "nodes"]
    x_nodes: Float[Array, "nodes even"]
    r_nodes: Float[Array, "nodes odd"]
    potential_nodes: Float[Array, "nodes nodes"]
    far: Float[Array, "nodes points"]
    near: Near
    sphere: Float[Array, "coordinates"]
    active: Int[Array, "free"]
    shift: Float[Array, "coordinates"]
    elements: int = eqx.field(static=True)
    attached: float = eqx.field(static=True)

    @property
    def x_size(self) -> int:
        return self.x_basis.shape[2]

    def split(self, q: Float[Array, "coordinates"]) -> tuple[Float[Array, "even"], Float[Array, "odd"]]:
        """Coefficients of x and of r."""
        return q[: self.x_size], q[self.x_size :]

    def at_points(self, q: Float[Array, "coordinates"]) -> Curve:
        """The curve and its derivatives at the Gauss points."""
        qx, qr = self.split(q)
        x, x1, x2 = self.x_basis @ qx
        r, r1, r2 = self.r_basis @ qr
        return Curve(x, r, x1, r1, x2, r2)

    def at_nodes(self, q: Float[Array, "coordinates"]) -> tuple[Float[Array, "nodes"], Float[Array, "nodes"]]:
        """Axial position and distance to the axis at the nodes [R0]; exactly 0 at the poles."""
        qx, qr = self.split(q)
        return self.x_nodes @ qx, self.r_nodes @ qr

    def free(self, q: Float[Array, "coordinates"]) -> Float[Array, "free"]:
        """The coordinates that may move."""
        return q[self.active]

    def whole(self, z: Float[Array, "free"], held: Float[Array, "coordinates"]) -> Float[Array, "coordinates"]:
        """All coordinates, the held ones taken from another state."""
        return held.at[self.active].set(z)


def breakpoints(elements: int, attached: float = 0.0) -> tuple[np.ndarray, int | None]:
    """Breakpoints of the meridian [rad], and the index of a pad's edge.

    The edge of a pad is a breakpoint; the elements are shared between the free
    part and the pad in proportion to their lengths, two at least for the pad.
    """
    if attached == 0.0:
        return np.linspace(0.0, np.pi, elements + 1), None
    held = max(2, round(elements * attached / np.pi))
    edge = np.pi - attached
    moving = np.linspace(0.0, edge, elements - held + 1)
    return np.concatenate([moving, np.linspace(edge, np.pi, held + 1)[1:]]), elements - held


def meridian(elements: int = 32, attached: float = 0.0) -> Meridian:
    """A discretisation of the meridian.

    Args:
        elements: Number of spline elements from pole to pole, at least 8.
        attached: Half-angle of the pad that holds the shell around θ = π [rad]; 0 is a free shell.
            Position and slope are held from θ = π - attached on.

    Raises:
        BadValue: Too few elements, or a pad that leaves nothing free.

    Example:
        >>> from jshell.contour import meridian
        >>> meridian(16).nodes.shape
        (17,)
    """
    if not isinstance(elements, int | np.integer) or elements < MINIMUM_ELEMENTS:
        raise BadValue(
            "elements",
            found=repr(elements),
            expected=f"an integer of at least {MINIMUM_ELEMENTS}",
            remedy="32 is usual.",
        )
    if not 0.0 <= attached <= 2.0:
        raise BadValue("attached", found=repr(attached), expected="an angle from 0 to 2 rad", remedy="0.33 is usual.")
    breaks, edge = breakpoints(int(elements), float(attached))
    even, odd = ParitySplines(breaks, "even", edge), ParitySplines(breaks, "odd", edge)
    potential = ParitySplines(breaks, "even")

    gauss, gauss_weights = np.polynomial.legendre.leggauss(POINTS)
    lengths = np.diff(breaks)
    angles = (breaks[:-1, None] + lengths[:, None] * (gauss[None] + 1) / 2).ravel()
    weights = (lengths[:, None] * gauss_weights[None] / 2).ravel()
    element_of = np.repeat(np.arange(elements), POINTS)
    node = np.arange(elements + 1)[:, None]
    touching = (element_of[None] == node) | (element_of[None] == node - 1)

    sphere_x = np.linalg.lstsq(even(angles), np.cos(angles), rcond=None)[0]
    sphere_r = np.linalg.lstsq(odd(angles), np.sin(angles), rcond=None)[0]
    if edge is not None:
        held_from = float(breaks[edge])
        moves = np.concatenate([~even.touching(held_from), ~odd.touching(held_from)])
        shift = np.zeros(even.size + odd.size)
    else:
        moves = np.ones(even.size + odd.size, dtype=bool)
        shift = np.concatenate([np.ones(even.size), np.zeros(odd.size)])
    r_nodes = odd(breaks)
    r_nodes[[0, -1]] = 0.0
    return Meridian(
        angles=jnp.asarray(angles),
        weights=jnp.asarray(weights),
        x_basis=jnp.asarray(np.stack([even(angles, k) for k in range(3)])),
        r_basis=jnp.asarray(np.stack([odd(angles, k) for k in range(3)])),
        potential_basis=jnp.asarray(np.stack([potential(angles, k) for k in range(3)])),
        nodes=jnp.asarray(breaks),
        x_nodes=jnp.asarray(even(breaks)),
        r_nodes=jnp.asarray(r_nodes),
        potential_nodes=jnp.asarray(potential(breaks)),
        far=jnp.asarray(np.where(touching, 0.0, weights[None])),
        near=_near(breaks, even, odd, potential),
        sphere=jnp.asarray(np.concatenate([sphere_x, sphere_r])),
        active=jnp.asarray(np.flatnonzero(moves)),
        shift=jnp.asarray(shift),
        elements=int(elements),
        attached=float(attached),
    )


def _near(breaks: np.ndarray, even: ParitySplines, odd: ParitySplines, potential: ParitySplines) -> Near:
    """Graded quadrature beside every node, with divided differences from exact Taylor coefficients.

    A ring kernel near its own ring divides two small numbers, so differences
    from the node are never formed by subtraction.
    """
    gauss, gauss_weights = np.polynomial.legendre.leggauss(NEAR_POINTS)
    u = (gauss + 1) / 2
    graded, graded_weights = u**GRADING, GRADING * u ** (GRADING - 1) * gauss_weights / 2
    last = len(breaks) - 1
    rows = []
    for node in range(last + 1):
        sides = []
        for side in (-1, 1):
            element = node if side > 0 else node - 1
            inside = 0 <= element <= last - 1
            length = breaks[element + 1] - breaks[element] if inside else 0.0
            # beyond a pole there is no element: weight zero, geometry of the other side
            span = length if inside else breaks[1] - breaks[0] if node == 0 else breaks[last] - breaks[last - 1]
            way = side if inside else -side
            gaps = way * span * graded
            parts = [length * graded_weights, gaps]
            for basis in (even, odd):
                taylor = basis.taylor(node, way)
                power = np.arange(DEGREE + 1)
                value = gaps[:, None] ** power[None] @ taylor
                slope = gaps[:, None] ** power[None, :-1] @ (power[1:, None] * taylor[1:])
                quotient = gaps[:, None] ** power[None, :-1] @ taylor[1:]
                quotient_slope = gaps[:, None] ** power[None, :-2] @ (power[1:-1, None] * taylor[2:])
                parts += [value, slope, quotient, quotient_slope]
            parts.append(gaps[:, None] ** np.arange(DEGREE + 1)[None] @ potential.taylor(node, way))
            sides.append(parts)
        rows.append([np.concatenate(pair) for pair in zip(*sides, strict=True)])
    weights, gaps, xv, xs, xq, xqs, rv, rs, rq, rqs, pot = (
        jnp.asarray(np.stack(part)) for part in zip(*rows, strict=True)
    )
    return Near(
        weights=weights,
        gaps=gaps,
        x_slope=xs,
        r_slope=rs,
        x_quotient=xq,
        r_quotient=rq,
        x_quotient_slope=xqs,
        r_quotient_slope=rqs,
        r_value=rv,
        x_value=xv,
        potential=pot,
    )

"""The meridian: how a closed surface of revolution is represented.

The wall is the curve x(θ), r(θ), 0 <= θ <= π, turned about the x axis; θ is
the polar angle a material point had on the stress-free sphere, and the
buckling pole sits at θ = 0. Both functions are quintic splines, even and odd
about the poles. Their coefficients, stacked as (x, r), are the shell's
coordinates q; everything else is a constant matrix times q.

Symbols    q coordinates [R0]   θ material angle [rad]
Valid for  shapes that are smooth on the scale of one element
Source     the curve and its parameter: Mokbel et al. 2021, numerical method
"""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float, Int


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
    """The constant matrices of one discretisation. Build with `meridian`, move its nodes with `regrade`.

    Attributes:
        angles, weights: (points,) Gauss points [rad] and weights of all elements.
        x_basis, r_basis: (3, points, ·) values, first and second derivatives.
        potential_basis: (3, points, nodes) the same for the liquid's potential.
        nodes: (nodes,) breakpoints [rad]; `x_nodes`, `r_nodes` evaluate there.
        far: (nodes, points) Gauss weights with the elements touching a node left out.
        sphere: (coordinates,) the stress-free sphere.
        active: (free coordinates,) indices of the coordinates that may move.
        shift: (coordinates,) rigid translation along the axis, or zero when attached.
        elements, attached, edge: Their number, half-angle of the pad [rad], the breakpoint at its edge.
        crowded: Whether elements shrink towards the pad's edge, see `contour.grading`.
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
    edge: int | None = eqx.field(static=True)
    crowded: bool = eqx.field(static=True)

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

"""The boundary integrals of the exterior potential on the meridian.

For a liquid at rest far away, Green's third identity on the wall is

    (1/2 - D) φ = -S v_n ,

S and D the single and double layer. φ is an even spline, collocated at the
nodes; elements that touch a node are integrated with points graded towards it
and differences taken from the spline's own Taylor coefficients, so the
logarithm costs no digits.

Symbols    φ potential on the wall [sqrt(E d R0/ρ)]   v_n r ds/dθ flux through a ring per θ
Valid for  unbounded liquid at rest at infinity; poles further apart than an element
Source     eq:incompressibility without vorticity; Kress, Linear Integral Equations, ch. 6
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian
from jshell.flow.rings import kernels


class Layers(NamedTuple):
    """Ring kernels between every node and every source point.

    Attributes:
        far_source, near_source: Quadrature weight times G.
        far_dipole, near_dipole: Quadrature weight times G' and its area element.
        curve: The wall at the Gauss points.
        near_curve: The wall at the graded points beside each node.
    """

    far_source: Float[Array, "nodes points"]
    near_source: Float[Array, "nodes near"]
    far_dipole: Float[Array, "nodes points"]
    near_dipole: Float[Array, "nodes near"]
    curve: Curve
    near_curve: Curve


class RelativePositions(NamedTuple):
    """Where sources lie as seen from the nodes, (nodes, sources).

    Attributes:
        shortest, longest: Squared distances ρ₋², ρ₊² to the ring of a source [R0²].
        bend: B = (x_t Δr - r_t Δx)/ρ₋² [rad⁻¹].
        radius, x_slope: r' and dx/dθ at the source [R0].
    """

    shortest: Float[Array, "nodes sources"]
    longest: Float[Array, "nodes sources"]
    bend: Float[Array, "nodes sources"]
    radius: Float[Array, "nodes sources"]
    x_slope: Float[Array, "nodes sources"]


def pairs(shape: Meridian, q: Float[Array, "coordinates"]) -> tuple[RelativePositions, RelativePositions, Curve, Curve]:
    """Nodes against all Gauss points, and against the graded points beside them; the curve at both."""
    curve = shape.at_points(q)
    x0, r0 = shape.at_nodes(q)
    x0, r0 = x0[:, None], r0[:, None]

    # elements away from the node
    dx, dr = curve.x[None] - x0, curve.r[None] - r0
    shortest = dx**2 + dr**2
    longest = dx**2 + (curve.r[None] + r0) ** 2
    bend = (curve.x1[None] * dr - curve.r1[None] * dx) / shortest
    far = RelativePositions(shortest, longest, bend, _as(curve.r, dx), _as(curve.x1, dx))

    # the two elements that touch it: Δ = s Q(s), Q and Q' from Taylor coefficients
    near, (qx, qr) = shape.near, shape.split(q)
    Qx, Qr = near.x_quotient @ qx, near.r_quotient @ qr
    local = Curve(
        near.x_value @ qx,
        near.r_value @ qr,
        near.x_slope @ qx,
        near.r_slope @ qr,
        jnp.zeros_like(Qx),
        jnp.zeros_like(Qx),
    )
    squared = Qx**2 + Qr**2
    shortest = near.gaps**2 * squared
    longest = (near.gaps * Qx) ** 2 + (local.r + r0) ** 2
    bend = ((near.x_quotient_slope @ qx) * Qr - (near.r_quotient_slope @ qr) * Qx) / squared
    return far, RelativePositions(shortest, longest, bend, local.r, local.x1), curve, local


def layers(shape: Meridian, q: Float[Array, "coordinates"]) -> Layers:
    """Assemble both layers for a shape."""
    far, near, curve, local = pairs(shape, q)
    source, dipole = kernels(*far)
    far_source, far_dipole = shape.far * source, shape.far * dipole
    source, dipole = kernels(*near)
    near_source, near_dipole = shape.near.weights * source, shape.near.weights * dipole
    return Layers(far_source, near_source, far_dipole, near_dipole, curve, local)


def _as(row, matrix):
    return jnp.broadcast_to(row[None], matrix.shape)


def green(shape: Meridian, parts: Layers) -> Float[Array, "nodes nodes"]:
    """The matrix 1/2 - D acting on φ's coefficients."""
    near = jnp.einsum("ns,nsk->nk", parts.near_dipole, shape.near.potential)
    return shape.potential_nodes / 2 - parts.far_dipole @ shape.potential_basis[0] - near


def green_of(shape: Meridian, parts: Layers, y: Float[Array, "nodes"]) -> Float[Array, "nodes"]:
    """The same acting on one potential, without forming the matrix."""
    near = jnp.sum(parts.near_dipole * (shape.near.potential @ y), axis=1)
    return shape.potential_nodes @ y / 2 - parts.far_dipole @ (shape.potential_basis[0] @ y) - near


def flux_of(curve: Curve, ux: Float[Array, "..."], ur: Float[Array, "..."]) -> Float[Array, "..."]:
    """Flux through the ring at a point per θ and 2π: v_n r ds/dθ of a wall velocity."""
    return curve.r * (ux * curve.r1 - ur * curve.x1)


def flux_operator(shape: Meridian, curve: Curve) -> Float[Array, "points coordinates"]:
    """Matrix from coordinate velocities to the ring flux at the Gauss points."""
    X, R = shape.x_basis[0], shape.r_basis[0]
    return jnp.concatenate([(curve.r * curve.r1)[:, None] * X, -(curve.r * curve.x1)[:, None] * R], axis=1)


def single_layer(shape: Meridian, parts: Layers) -> Float[Array, "nodes coordinates"]:
    """Matrix from coordinate velocities to the single layer of their flux at the nodes."""
    far = parts.far_source @ flux_operator(shape, parts.curve)
    local, near = parts.near_curve, shape.near
    from_x = jnp.einsum("ns,nsk->nk", parts.near_source * local.r * local.r1, near.x_value)
    from_r = jnp.einsum("ns,nsk->nk", parts.near_source * local.r * local.x1, near.r_value)
    return far + jnp.concatenate([from_x, -from_r], axis=1)


def single_layer_of(shape: Meridian, parts: Layers, u: Float[Array, "coordinates"]) -> Float[Array, "nodes"]:
    """The single layer of one velocity, without forming the matrix."""
    ux, ur = shape.split(u)
    flux = flux_of(parts.curve, shape.x_basis[0] @ ux, shape.r_basis[0] @ ur)
    near = flux_of(parts.near_curve, shape.near.x_value @ ux, shape.near.r_value @ ur)
    return parts.far_source @ flux + jnp.sum(parts.near_source * near, axis=1)

"""The potential flow around a wall whose motion varies around the axis as cos mφ.

As for m = 0, (1/2 - D)φ = -S v_n, with ring kernels of order m,

    source   G_m  = Q_{m-1/2} / (2π √(r r'))
    dipole   G'_m = [P (2 r' B - x') + x' Q_{m-1/2}/2] / (2π √(r r')),   P = -t dQ_{m-1/2}/dt

per unit θ. φ has the parity of m and is collocated at the nodes; at the poles it
is zero, m >= 1. Of m = 0 it is free there, where the kernels are 1/(2ρ₋) and
r' B/(2ρ₋): that order is the axisymmetric flow of `added_mass`, to rounding.

Symbols    M_m added mass [ρ_f R0³]   Φ potential per coordinate velocity, without its cos mφ   B, x' as in `rings`
Valid for  unbounded, incompressible, irrotational liquid
Source     Q_{m-1/2} as the ring potential: Cohl and Tohline 1999; the rest as in `panels`
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import Azimuthal, Curve, Meridian
from jshell.flow.panels import RelativePositions, pairs
from jshell.flow.toroidal import downhill, toroidal


class OrderLayers(NamedTuple):
    """Quadrature weight times ring kernels of the orders 0 … most; the wall at the sources."""

    far_source: Float[Array, "orders nodes points"]
    near_source: Float[Array, "orders nodes near"]
    far_dipole: Float[Array, "orders nodes points"]
    near_dipole: Float[Array, "orders nodes near"]
    curve: Curve
    near_curve: Curve


class OrderFlow(NamedTuple):
    """The liquid of one order m around one shape; motions are coordinates (a, b + c, b - c).

    Attributes:
        mass: M_m, symmetric positive semidefinite [ρ_f R0³].
        potential: (nodes, motions) coefficients of φ per unit coordinate velocity.
    """

    mass: Float[Array, "motions motions"]
    potential: Float[Array, "nodes motions"]


@eqx.filter_jit
def order_layers(shape: Meridian, q: Float[Array, "coordinates"], most: int) -> OrderLayers:
    """Assemble the layers of every order up to `most` for a shape."""
    far, near, curve, local = pairs(shape, q)
    radius = shape.at_nodes(q)[1][:, None]
    source, dipole = _kernels(far, radius, most)
    far_source, far_dipole = shape.far[None] * source, shape.far[None] * dipole
    source, dipole = _kernels(near, radius, most)
    weights = shape.near.weights[None]
    near_source, near_dipole = weights * source, weights * dipole
    return OrderLayers(far_source, near_source, far_dipole, near_dipole, curve, local)


def order_flow(shape: Meridian, splines: Azimuthal, parts: OrderLayers, m: Int[Array, ""] | int) -> OrderFlow:
    """The potential flow of order m; `parts` must hold that order."""
    flux = flux_of_order(parts.curve, [f.values[0] for f in splines.motion(m)])
    beside = flux_of_order(parts.near_curve, [f.near for f in splines.motion(m)])
    potential = potential_of_flux(shape, splines, parts, m, flux, beside)
    around = jnp.where(m == 0, 2, 1) * jnp.pi
    half = -around / 2 * (flux.T * shape.weights[None]) @ (splines.potential(m).values[0] @ potential)
    return OrderFlow(half + half.T, potential)


def potential_of_flux(
    shape: Meridian,
    splines: Azimuthal,
    parts: OrderLayers,
    m: Int[Array, ""] | int,
    flux: Float[Array, "points columns"],
    beside: Float[Array, "nodes near columns"],
) -> Float[Array, "nodes columns"]:
    """Coefficients of φ of order m for fluxes per θ through the rings of Gauss points and of those near nodes."""
    family = splines.potential(m)
    near = jnp.einsum("ns,nsk->nk", parts.near_dipole[m], family.near)
    green = family.nodes / 2 - parts.far_dipole[m] @ family.values[0] - near
    # m >= 1, unknowns: as many functions as inner nodes; what is left is set to zero in the rows of the poles
    ends = jnp.zeros(green.shape[0], dtype=bool).at[jnp.array([0, -1])].set(jnp.asarray(m) > 0)
    green = jnp.where(ends[:, None] | ends[None], 0.0, green) + jnp.diag(ends.astype(float))
    single = parts.far_source[m] @ flux + jnp.einsum("ns,nsk->nk", parts.near_source[m], beside)
    return -jnp.linalg.solve(green, jnp.where(ends[:, None], 0.0, single))


def flux_of_order(curve: Curve, bases: list[Float[Array, "..."]]) -> Float[Array, "..."]:
    """Flux through a ring per θ of motions (a, b + c, b - c) by their splines: r (a r' - b x')."""
    along, across = (curve.r * curve.r1)[..., None], -(curve.r * curve.x1 / 2)[..., None]
    a, p, g = bases
    return jnp.concatenate([along * a, across * p, across * g], axis=-1)


def _kernels(where: RelativePositions, radius: Float[Array, "nodes 1"], most: int) -> tuple[Array, Array]:
    """Source and dipole of every order; the rows of the poles, rings of no radius, are those of m = 0 alone."""
    pole = jnp.zeros_like(radius, dtype=bool).at[jnp.array([0, -1])].set(True)
    between = jnp.where(pole, 1.0, radius) * where.radius
    t = where.shortest / (2 * between)
    Q = toroidal(t, most)
    P = downhill(t, Q)
    scale = (1 / (2 * jnp.pi * jnp.sqrt(between)))[None]
    slope, bent = where.x_slope[None], (2 * where.radius * where.bend - where.x_slope)[None]
    source, dipole = Q * scale, (P * bent + slope * Q / 2) * scale
    on_axis = 1 / (2 * jnp.sqrt(where.shortest))
    source = source.at[0].set(jnp.where(pole, on_axis, source[0]))
    return source, dipole.at[0].set(jnp.where(pole, where.radius * where.bend * on_axis, dipole[0]))

"""How the momentum of the liquid changes with the shape of the wall: ∂(M u)/∂q at fixed velocity.

The antisymmetric part of this matrix is the gyroscopic force of the moving
wall. A massless wall slides so lightly that this force is stiff, and a time
step must bear it implicitly. By shape calculus it costs two products of
constant-size matrices instead of a derivative of the assembly per coordinate:
with ξ the displacement of the wall,

    δφ = φ' + ξ_t ∂φ/∂s + ξ_n v_n ,
    ∂φ'/∂n = -w ∂ξ_n/∂s + ξ_n (Δ_s φ + 2 H v_n) + ξ_t (κ1 u_t - ∂v_n/∂s) ,

and Green's symmetry moves φ' onto potentials that are already known.

Symbols    ξ_t, ξ_n displacement along and across the wall [R0]   w = u_t - ∂φ/∂s slip   κ1, H curvatures [1/R0]
Valid for  as the potential flow; equal to the derivative of the discrete M up to discretisation error
Source     Hadamard's formula; Delfour and Zolésio, Shapes and Geometries, ch. 9
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian, speed
from jshell.flow.added_mass import Flow
from jshell.flow.wall_motion import (
    Columns,
    WallMotion,
    across_wall,
    across_wall_slope,
    along_wall,
    column,
    curvatures,
    every_motion,
    one_motion,
)


class GyroscopicParts(NamedTuple):
    """Change of momentum by displacements: sources that act through the potential, rings carried, rings held."""

    source: Columns
    carried: Columns
    held: Float[Array, "coordinates columns"]


def gyroscopic(
    shape: Meridian, q: Float[Array, "coordinates"], current: Flow, u: Float[Array, "coordinates"]
) -> Float[Array, "coordinates coordinates"]:
    """Matrix ∂(M u)/∂q of a shape moving with velocity u [ρ_f R0³ · velocity/R0]."""
    parts = gyroscopic_parts(shape, current.parts.curve, current.potential @ u, u, every_motion(shape))
    potentials = shape.potential_basis[0] @ current.potential
    return potentials.T @ parts.source + current.flux.T @ parts.carried + parts.held


def gyroscopic_parts(
    shape: Meridian, curve: Curve, y: Float[Array, "nodes"], u: Float[Array, "coordinates"], moved: WallMotion
) -> GyroscopicParts:
    """The parts of ∂(M u)/∂q that act on one displacement or on many; y is the potential of u."""
    ds = speed(curve)
    kappa1, twice_H, stretching = curvatures(curve)

    # the flow at the wall
    phi, phi1, phi2 = shape.potential_basis @ y
    now = one_motion(shape, u)
    u_t, v_n, v_n_s = (f(curve, now)[:, 0] for f in (along_wall, across_wall, across_wall_slope))
    phi_s = phi1 / ds
    surface_laplacian = (phi2 - phi1 * stretching / ds) / ds**2 + curve.r1 / (curve.r * ds) * phi_s

    # displacements along and across the wall
    tangential, normal, normal_s = (f(curve, moved) for f in (along_wall, across_wall, across_wall_slope))
    source = column(phi_s - u_t) * normal_s
    source = source + column(surface_laplacian + twice_H * v_n) * normal
    source = source + column(kappa1 * u_t - v_n_s) * tangential
    carried = column(phi_s) * tangential + column(v_n) * normal

    # the momentum's own rings, φ held
    weights = -2 * jnp.pi * shape.weights
    load = weights * phi
    on_x = shape.x_basis[0].T @ (column(load * curve.r1) * moved.r + column(load * curve.r) * moved.r1)
    on_r = -shape.r_basis[0].T @ (column(load * curve.r) * moved.x1 + column(load * curve.x1) * moved.r)
    held = jnp.concatenate([on_x, on_r])
    return GyroscopicParts(column(weights * curve.r * ds) * source, column(weights) * carried, held)

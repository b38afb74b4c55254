"""How a wall's momentum in the liquid turns with the wall: ∂(M u)/∂q at fixed velocity.

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

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Meridian, speed
from jshell.flow.added_mass import Flow


def turning(
    shape: Meridian, q: Float[Array, "coordinates"], current: Flow, u: Float[Array, "coordinates"]
) -> Float[Array, "coordinates coordinates"]:
    """Matrix ∂(M u)/∂q of a shape moving with velocity u [ρ_f R0³ · velocity/R0]."""
    curve = current.parts.curve
    X, R = shape.x_basis, shape.r_basis
    ds = speed(curve)
    stretching = (curve.x1 * curve.x2 + curve.r1 * curve.r2) / ds
    kappa1 = (curve.x1 * curve.r2 - curve.r1 * curve.x2) / ds**3
    twice_H = kappa1 - curve.x1 / (curve.r * ds)

    # the flow at the wall
    y = current.potential @ u
    phi, phi1, phi2 = shape.potential_basis @ y
    (ux, ux1, _), (ur, ur1, _) = (basis @ part for basis, part in zip((X, R), shape.split(u), strict=True))
    v_n = (ux * curve.r1 - ur * curve.x1) / ds
    u_t = (ux * curve.x1 + ur * curve.r1) / ds
    v_n_s = ((ux1 * curve.r1 + ux * curve.r2 - ur1 * curve.x1 - ur * curve.x2) / ds - v_n * stretching / ds) / ds
    phi_s = phi1 / ds
    surface_laplacian = (phi2 - phi1 * stretching / ds) / ds**2 + curve.r1 / (curve.r * ds) * phi_s

    # displacements along and across the wall, as matrices on the coordinates
    both = lambda along_x, along_r: jnp.concatenate([along_x, along_r], axis=1)  # noqa: E731
    column = lambda values: values[:, None]  # noqa: E731
    tangential = both(column(curve.x1 / ds) * X[0], column(curve.r1 / ds) * R[0])
    normal = both(column(curve.r1 / ds) * X[0], -column(curve.x1 / ds) * R[0])
    sloped = both(column(curve.r1) * X[1] + column(curve.r2) * X[0], -column(curve.x1) * R[1] - column(curve.x2) * R[0])
    normal_s = (sloped - column(stretching) * normal) / column(ds**2)

    source = column(phi_s - u_t) * normal_s
    source = source + column(surface_laplacian + twice_H * v_n) * normal
    source = source + column(kappa1 * u_t - v_n_s) * tangential
    carried = column(phi_s) * tangential + column(v_n) * normal

    weights = -2 * jnp.pi * shape.weights
    potentials = shape.potential_basis[0] @ current.potential
    moved = potentials.T @ (column(weights * curve.r * ds) * source) + current.flux.T @ (column(weights) * carried)

    # the momentum's own rings, φ held
    load = weights * phi
    x_r = X[0].T @ (column(load * curve.r1) * R[0] + column(load * curve.r) * R[1])
    r_x = -R[0].T @ (column(load * curve.r) * X[1])
    r_r = -R[0].T @ (column(load * curve.x1) * R[0])
    held = jnp.block([[jnp.zeros((X.shape[2], X.shape[2])), x_r], [r_x, r_r]])
    return moved + held

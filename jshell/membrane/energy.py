"""The energy of a shape, with its exact gradient and Hessian.

One elastic energy, differentiated; the source's printed forces are not coded,
because they are the gradient of none (eq:bendingForce has the wrong sign and
factor, eq:stretchingForce is linearised). The energy density depends on six
numbers at a point, so its Hessian is a small matrix per Gauss point between
constant matrices.

Symbols    λ1, λ2 stretches along and across the meridian [-]   H mean curvature [1/R0]
           U energy [E d R0²]
Valid for  small strains, any rotation; axial symmetry. Over the current area the energy has no floor: a wall that is
           squeezed to nothing along the meridian has none left
Source     Mokbel et al. 2021: Eq:bend, Eq:stretch (area="current"), eq:Ug, eq:Upext; Koiter: Koiter 1966
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian, speed, volume
from jshell.errors import choose
from jshell.shell.elasticity import SPHERE_VOLUME, Scalar, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure

Area = Literal["current", "reference", "koiter"]
AREAS = ("current", "reference", "koiter")


class Wall(NamedTuple):
    """The wall at the Gauss points: moduli of area, shear [E d], bending [E d R0²]; its angle, its thickness [R0]."""

    area: Float[Array, "points"]
    shear: Float[Array, "points"]
    bending: Float[Array, "points"]
    angles: Float[Array, "points"]
    thickness: Float[Array, "points"]


def wall(shape: Meridian, conditions: Reduced, profile: Float[Array, "points"]) -> Wall:
    """The wall of a shell whose thickness is d̂ times a profile; moduli follow the local thickness."""
    K = moduli(conditions.thickness, conditions.poisson_ratio)
    area, shear, bending = (jnp.asarray(modulus) for modulus in K)
    return Wall(
        area * profile, shear * profile, bending * profile**3, shape.angles, jnp.asarray(conditions.thickness * profile)
    )


def check_area(area: str) -> None:
    """Refuse an unknown choice of reference for the elastic energy."""
    choose("area", area, AREAS, remedy="current is the source's.")


def density(curve: Curve, wall: Wall, area: Area | str) -> Float[Array, "..."]:
    """Elastic energy per θ at a point [E d R0²/rad].

    Args:
        curve: Position and derivatives at the point.
        wall: Moduli there.
        area: `current` integrates over the deformed surface (the source), `reference` over the
            stress-free one, `koiter` uses Koiter's bending measures over the stress-free one.
    """
    sine = jnp.sin(wall.angles)
    along = speed(curve)
    across = curve.r / sine
    e1, e2 = along - 1, across - 1
    stretching = (wall.area + wall.shear) / 2 * (e1**2 + e2**2) + (wall.area - wall.shear) * e1 * e2

    kappa1 = (curve.x1 * curve.r2 - curve.r1 * curve.x2) / along**3
    kappa2 = -curve.x1 / (curve.r * along)
    if area == "koiter":
        b1, b2 = along * kappa1 - 1, across * kappa2 - 1
        nu = (wall.area - wall.shear) / (wall.area + wall.shear)
        bending = wall.bending / 2 * (b1**2 + b2**2 + 2 * nu * b1 * b2)
    else:
        bending = 2 * wall.bending * ((kappa1 + kappa2) / 2 - 1) ** 2
    surface = curve.r * along if area == "current" else sine
    return jnp.asarray(2 * jnp.pi * surface * (stretching + bending))


def elastic_energy(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, area: Area | str = "current"
) -> Float[Array, ""]:
    """Elastic energy of a shape [E d R0²]."""
    return jnp.sum(shape.weights * density(shape.at_points(q), wall, area))


def gas_energy(volume: Float[Array, ""], conditions: Reduced) -> Float[Array, ""]:
    """Energy of the adiabatic gas [E d R0²], zero at V0 (eq:Ug up to a constant); isothermal at κ = 1."""
    stretch = jnp.log(volume / SPHERE_VOLUME)
    power = conditions.kappa - 1
    near = jnp.abs(power) < 1e-4  # a quotient of two small numbers: its series, exact to 1e-13 there
    safe = jnp.where(near, 1.0, power)
    series = -stretch * (1 - power * stretch / 2 * (1 - power * stretch / 3))
    work = jnp.where(near, series, jnp.expm1(-power * stretch) / safe)
    return jnp.asarray(conditions.gas_pressure * SPHERE_VOLUME * work)


def potential_energy(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, conditions: Reduced, area: Area | str = "current"
) -> Float[Array, ""]:
    """Elastic energy, gas and the work of the outer pressure (eq:Upext), U [E d R0²]."""
    V = volume(shape, q)
    outer = conditions.outer_pressure * (V - SPHERE_VOLUME)
    return elastic_energy(shape, q, wall, area) + gas_energy(V, conditions) + outer


def stiffness(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, conditions: Reduced, area: Area | str = "current"
) -> Float[Array, "coordinates coordinates"]:
    """Hessian of the potential energy, K [E d].

    The gas adds κP/V ∇V∇Vᵀ and, with the outer pressure, (P_ext - P) ∇²V.
    """
    V = volume(shape, q)
    P = gas_pressure(V, conditions)
    slope = jax.grad(lambda q: volume(shape, q))(q)
    K = stiffness_at(shape, q, wall, conditions.outer_pressure - P, area)
    return K + conditions.kappa * P / V * jnp.outer(slope, slope)


def stiffness_at(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, difference: Scalar, area: Area | str = "current"
) -> Float[Array, "coordinates coordinates"]:
    """Hessian of the elastic energy plus ΔP V at constant ΔP, from 6 x 6 Hessians at the Gauss points."""

    def local(point, wall):
        curve = Curve(*point)
        return density(curve, wall, area) - difference * jnp.pi * curve.r**2 * curve.x1

    points = jnp.stack(shape.at_points(q), axis=1)
    hessian = jax.vmap(jax.hessian(local))(points, wall) * shape.weights[:, None, None]

    # a point's numbers are x, r, x', r', x'', r''; x itself never enters
    X = {2: shape.x_basis[1], 4: shape.x_basis[2]}
    R = {1: shape.r_basis[0], 3: shape.r_basis[1], 5: shape.r_basis[2]}

    def product(left, right):
        total = jnp.zeros(())
        for a, rows in left.items():
            weighted = jnp.zeros(())
            for b, columns in right.items():
                weighted = weighted + hessian[:, a, b, None] * columns
            total = total + rows.T @ weighted
        return total

    K_xx, K_xr, K_rr = product(X, X), product(X, R), product(R, R)
    return jnp.block([[K_xx, K_xr], [K_xr.T, K_rr]])

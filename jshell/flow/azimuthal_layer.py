"""A thin Stokes layer under motions of order m around the axis: slip in two directions, first and second order.

With the slip w tangential to the wall, of components along the meridian (cos mφ)
and around the axis (sin mφ),

    Z_m = s M_m + √(s η̂) G_m + η̂ D_m + O(η̂^{3/2}),   G = ∮ |w|² dA

    D = 2 ∫ e:e dV - 4 ∮ w·e_n dA + ∮ (H |w|² + w·κ·w) dA + ∮ div_S(w) N div_S(w) dA

e_n = ∇_S v - κ·u the shear of the potential flow at the wall, κ the curvature
tensor. For m = 0 these are the matrices of `stokes_layer` and `second_order`.

Symbols    v, u velocities of the liquid across and along the wall   N map from normal velocity to -φ
           κ1, κ2 curvatures along the meridian and across it, H their mean [1/R0]
Valid for  η̂ << 1, m times the layer's thickness small against the radius
Source     matched expansion as in `second_order`. Checked: on a sphere (n, m) equals (n, 0); where κ1 and κ2 differ, on
           bumped spheres by the symmetry of turns, and by the drag of spheroids that move sideways
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import Azimuthal, Meridian, speed
from jshell.flow.azimuthal import OrderFlow, OrderLayers, potential_of_flux
from jshell.flow.wall_motion import (
    Columns,
    WallMotion,
    across_wall,
    across_wall_slope,
    along_wall,
    column,
    curvatures,
)

Matrix = Float[Array, "motions motions"]


class OrderWall(NamedTuple):
    """What motions of order m do at the wall, (points, motions) each.

    v, v_s, v_f: velocity across the wall and its slopes along and around it. u_s, u_f: the liquid's along and around.
    w_s, w_f: the slip along and around. Those around the axis go with sin mφ.
    """

    v: Columns
    v_s: Columns
    v_f: Columns
    u_s: Columns
    u_f: Columns
    w_s: Columns
    w_f: Columns


def order_wall(
    shape: Meridian, splines: Azimuthal, parts: OrderLayers, current: OrderFlow, m: Int[Array, ""] | int
) -> OrderWall:
    """The wall and the potential flow beside it for every motion of order m >= 1."""
    curve, r = parts.curve, column(parts.curve.r)
    a, p, g = (family.values for family in splines.motion(m))
    no = jnp.zeros_like(a[0])
    wide = lambda *parts: jnp.concatenate(parts, axis=1)  # noqa: E731
    across = lambda k: wide(no, p[k] / 2, g[k] / 2)  # noqa: E731
    motion = WallMotion(wide(a[0], no, no), across(0), wide(a[1], no, no), across(1))
    around = wide(no, p[0] / 2, -g[0] / 2)

    potential = splines.potential(m).values
    v = across_wall(curve, motion)
    u_s = (potential[1] @ current.potential) / column(speed(curve))
    u_f = -m * (potential[0] @ current.potential) / r
    return OrderWall(
        v, across_wall_slope(curve, motion), -m * v / r, u_s, u_f, along_wall(curve, motion) - u_s, around - u_f
    )


def order_slip(shape: Meridian, parts: OrderLayers, wall: OrderWall) -> Matrix:
    """G_m = ∮ |w|² dA [R0²]."""
    surface = _surface(shape, parts)
    return wall.w_s.T @ (surface * wall.w_s) + wall.w_f.T @ (surface * wall.w_f)


def order_second(
    shape: Meridian, splines: Azimuthal, parts: OrderLayers, wall: OrderWall, m: Int[Array, ""] | int
) -> Matrix:
    """D_m, symmetric [R0]."""
    surface = _surface(shape, parts)
    bent = curvatures(parts.curve)
    kappa1, twice_H = column(bent.meridian), column(bent.twice_mean)
    kappa2 = twice_H - kappa1
    both = lambda left, right: left.T @ (surface * right) + right.T @ (surface * left)  # noqa: E731

    # 2 ∫ e:e dV = 2 ∮ (2H v² + u·κ·u - 2 u·∇_S v) dA
    bulk = both(wall.v, twice_H * wall.v) + both(wall.u_s, kappa1 * wall.u_s) + both(wall.u_f, kappa2 * wall.u_f)
    bulk = bulk - 2 * both(wall.u_s, wall.v_s) - 2 * both(wall.u_f, wall.v_f)
    shear = both(wall.w_s, wall.v_s - kappa1 * wall.u_s) + both(wall.w_f, wall.v_f - kappa2 * wall.u_f)
    mean = twice_H / 2
    curved = both(wall.w_s, (mean + kappa1) * wall.w_s) + both(wall.w_f, (mean + kappa2) * wall.w_f)

    # the liquid that the layer displaces, as a spline of order m
    family = splines.potential(m)
    ring = surface * family.values[0]
    keep = (family.order >= jnp.minimum(m, 2)) & (family.order >= 0)
    mass = jnp.where(keep[:, None] & keep[None], family.values[0].T @ ring, 0.0) + jnp.diag(jnp.where(keep, 0.0, 1.0))
    slope_s = surface * family.values[1] / column(speed(parts.curve))
    slope_f = -m * ring / column(parts.curve.r)
    gained = jnp.where(keep[:, None], -(slope_s.T @ wall.w_s + slope_f.T @ wall.w_f), 0.0)
    displaced = jnp.linalg.solve(mass, gained)
    across = lambda curve, values: (curve.r * speed(curve))[..., None] * values  # noqa: E731
    flux, beside = across(parts.curve, family.values[0]), across(parts.near_curve, family.near)
    potential = potential_of_flux(shape, splines, parts, m, flux, beside)
    answer = -displaced.T @ (ring.T @ (family.values[0] @ (potential @ displaced)))
    return bulk - 2 * shear + curved / 2 + (answer + answer.T) / 2


def _surface(shape: Meridian, parts: OrderLayers) -> Columns:
    return column(jnp.pi * shape.weights * parts.curve.r * speed(parts.curve))

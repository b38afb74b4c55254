"""How the wall moves along and across itself, and its curvatures.

A motion is x and r velocities at the Gauss points with their θ-derivatives,
one column per motion: a single velocity has one, `every_motion` has one per
coordinate.

Symbols    t, n unit tangent (θ rising) and outward normal   κ1, κ2 curvatures, 1 on the unit sphere [1/R0]
Source     differential geometry of a surface of revolution
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian, speed

Columns = Float[Array, "points columns"]


class WallMotion(NamedTuple):
    """Velocities of the wall and their θ-derivatives at the Gauss points, one column per motion."""

    x: Columns
    r: Columns
    x1: Columns
    r1: Columns


class Curvatures(NamedTuple):
    """Curvature of the meridian, twice the mean curvature [1/R0], and d(ds/dθ)/dθ [R0]."""

    meridian: Float[Array, "points"]
    twice_mean: Float[Array, "points"]
    stretching: Float[Array, "points"]


def every_motion(shape: Meridian) -> WallMotion:
    """One motion per coordinate."""
    X, R = shape.x_basis, shape.r_basis
    no_x, no_r = jnp.zeros(X.shape[1:]), jnp.zeros(R.shape[1:])
    wide = lambda x, r: jnp.concatenate([x, r], axis=1)  # noqa: E731
    return WallMotion(wide(X[0], no_r), wide(no_x, R[0]), wide(X[1], no_r), wide(no_x, R[1]))


def one_motion(shape: Meridian, u: Float[Array, "coordinates"]) -> WallMotion:
    """The motion of one coordinate velocity, as a single column."""
    ux, ur = shape.split(u)
    X, R = shape.x_basis, shape.r_basis
    return WallMotion(*(part[:, None] for part in (X[0] @ ux, R[0] @ ur, X[1] @ ux, R[1] @ ur)))


def curvatures(curve: Curve) -> Curvatures:
    """Curvatures of the wall at the points of a curve."""
    ds = speed(curve)
    kappa1 = (curve.x1 * curve.r2 - curve.r1 * curve.x2) / ds**3
    twice_mean = kappa1 - curve.x1 / (curve.r * ds)
    return Curvatures(kappa1, twice_mean, (curve.x1 * curve.x2 + curve.r1 * curve.r2) / ds)


def column(values: Float[Array, "points"]) -> Columns:
    """Values at the points, to multiply every motion by."""
    return values[:, None]


def along_wall(curve: Curve, motion: WallMotion) -> Columns:
    """Tangential velocity, u·t."""
    ds = speed(curve)
    return column(curve.x1 / ds) * motion.x + column(curve.r1 / ds) * motion.r


def across_wall(curve: Curve, motion: WallMotion) -> Columns:
    """Normal velocity, u·n."""
    ds = speed(curve)
    return column(curve.r1 / ds) * motion.x - column(curve.x1 / ds) * motion.r


def across_wall_slope(curve: Curve, motion: WallMotion) -> Columns:
    """Derivative of the normal velocity by arc length, ∂(u·n)/∂s."""
    ds = speed(curve)
    sloped = column(curve.r1) * motion.x1 + column(curve.r2) * motion.x
    sloped = sloped - column(curve.x1) * motion.r1 - column(curve.x2) * motion.r
    return (sloped - column(curvatures(curve).stretching) * across_wall(curve, motion)) / column(ds**2)

"""What can be measured on a shape: volume, area, height, width, poles.

Symbols    V volume [R0³]   S area [R0²]   H height along the axis, W width across it [R0]
Source     Mokbel et al. 2021: H and W are those of the convex envelope (fig:exptyp)
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour.curve import Curve, Meridian


def volume(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Enclosed volume V [R0³]."""
    curve = shape.at_points(q)
    return -jnp.pi * jnp.sum(shape.weights * curve.r**2 * curve.x1)


def area(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Surface area S [R0²]."""
    curve = shape.at_points(q)
    return 2 * jnp.pi * jnp.sum(shape.weights * curve.r * speed(curve))


def speed(curve: Curve) -> Float[Array, "..."]:
    """Length of the tangent, ds/dθ [R0]; the meridional stretch λ1."""
    return jnp.sqrt(curve.x1**2 + curve.r1**2)


def height(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Height of the convex envelope along the axis, H = max x - min x [R0]."""
    x, _ = shape.at_nodes(q)
    return _maximum(shape.nodes, x, 1.0) + _maximum(shape.nodes, -x, 1.0)


def width(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Width of the convex envelope across the axis, W = 2 max r [R0]."""
    _, r = shape.at_nodes(q)
    return 2 * _maximum(shape.nodes, r, -1.0)


def poles(shape: Meridian, q: Float[Array, "coordinates"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Axial position of the buckling pole and of the opposite one [R0]."""
    x, _ = shape.at_nodes(q)
    return x[0], x[-1]


def gap(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, ""]:
    """Distance between the two poles [R0]; zero when they touch, negative when they have crossed."""
    front, back = poles(shape, q)
    return front - back


def _maximum(angles: Float[Array, "nodes"], values: Float[Array, "nodes"], parity: float) -> Float[Array, ""]:
    """Largest value by the parabola through the three highest nodes, mirrored at the poles."""
    t = jnp.concatenate([-angles[1:2], angles, 2 * angles[-1:] - angles[-2:-1]])
    f = jnp.concatenate([parity * values[1:2], values, parity * values[-2:-1]])
    k = jnp.argmax(values) + 1
    left, right = t[k - 1] - t[k], t[k + 1] - t[k]
    down, up = f[k - 1] - f[k], f[k + 1] - f[k]
    curvature = (up / right - down / left) / (right - left)
    slope = down / left - curvature * left
    bent = curvature < 0
    safe = jnp.where(bent, curvature, -1.0)
    return f[k] - jnp.where(bent, slope**2 / (4 * safe), 0.0)

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


def clearance(
    shape: Meridian, q: Float[Array, "coordinates"], thickness: Float[Array, "points"], every: int = 1
) -> Float[Array, ""]:
    """Least free space between two places of the wall that face each other [R0]; negative where they overlap.

    The distance of their middle surfaces less half the thickness of each: pole to pole, and wherever over the whole
    cross-section the distance grows if either of the two places moves along the wall.

    Args:
        shape, q: The meridian.
        thickness: (points,) thickness of the wall at its Gauss points [R0].
        every: Take each such Gauss point only.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.contour import clearance, meridian
        >>> sphere = meridian(16)
        >>> print(f"{clearance(sphere, sphere.sphere, jnp.full(80, 0.2)):.6f}")
        1.800000
    """
    curve = shape.at_points(q)
    pace = speed(curve)
    parts = curve.x, curve.r, curve.x1 / pace, curve.r1 / pace, thickness
    x, r, tx, tr, t = (part[::every] for part in parts)
    # the cross-section is a closed curve: up one side, down the other
    x, r, t = (jnp.concatenate([part, side * part[::-1]]) for part, side in ((x, 1), (r, -1), (t, 1)))
    tx, tr = jnp.concatenate([tx, -tx[::-1]]), jnp.concatenate([tr, tr[::-1]])
    dx, dr = x[:, None] - x[None], r[:, None] - r[None]
    squared = dx**2 + dr**2
    size = x.shape[0]
    closest = ~jnp.eye(size, dtype=bool)  # a place is nearest to itself
    for axis in (0, 1):
        for shift in (1, -1):
            closest = closest & (squared <= jnp.roll(squared, shift, axis))
    # between its points a wall is its tangent: the distance to that line is the distance to the wall
    along = dx * tx[None] + dr * tr[None]
    free = jnp.sqrt(jnp.maximum(squared - along**2, 1e-30)) - (t[:, None] + t[None]) / 2
    return jnp.minimum(jnp.min(jnp.where(closest, free, jnp.inf)), gap(shape, q) - (t[0] + t[size // 2]) / 2)


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

"""Where the nodes go: crowded at the rim of a dimple and at a pad's edge, sparse elsewhere.

A buckled shell bends within a rim of width ~ √d̂ and hardly anywhere else.
Equal shares of a monitor, √(1 + (c b)²) with b the turning of the meridian per
θ, put the elements there. Neighbours must not differ much in length, or the
ring kernels of the liquid lose digits, so the element length is limited in
slope.

At the edge of a pad the splines hold the wall's stretch beside position and
slope, an error of first order in the element there and in that only. Elements
that shrink towards the edge by 1.6 each make it small; the exact liquid bears
that ratio, and no longer bears 2.

Symbols    b = κ1 λ1 turning of the meridian per θ [-]   h element length [rad]
Source     equidistribution: de Boor 1973; slope-limited element size: Persson 2006
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.contour.curve import Meridian

CONTRAST = 1.0  # c: weight of the turning in the monitor
SLOPE = 0.2  # how fast the element length may grow along θ
PASSES = 4  # the limiter changes the lengths it limits
SHRINKING, RATIO = 8, 1.6  # elements on each side of a pad's edge that shrink towards it, by this each
MORE = 6  # elements more on each side: eight that shrink are as long as 1.6 others


@eqx.filter_jit  # called one by one, its loop would be compiled anew each time
def rim_breaks(
    shape: Meridian,
    q: Float[Array, "coordinates"],
    contrast: float = CONTRAST,
    slope: float = SLOPE,
    onto: Meridian | None = None,
) -> Float[Array, "nodes"]:
    """Breakpoints that share the bending of a shape evenly [rad]; may be compiled.

    Args:
        shape: The present discretisation; as many breakpoints come back, a pad's edge stays.
        q: The shape.
        contrast: c, how much turning counts beside plain length; 0 is even spacing.
        slope: Largest growth of element length per θ, about the ratio of neighbours less 1.
        onto: The discretisation that the breakpoints are for, where it is another one.
    """
    curve = shape.at_points(q)
    turning = (curve.x1 * curve.r2 - curve.r1 * curve.x2) / (curve.x1**2 + curve.r1**2)
    return even_shares(shape if onto is None else onto, shape.angles, turning, contrast, slope)


def even_shares(
    shape: Meridian,
    angles: Float[Array, "samples"],
    turning: Float[Array, "samples"],
    contrast: float = CONTRAST,
    slope: float = SLOPE,
) -> Float[Array, "nodes"]:
    """Breakpoints for a turning per θ that is known at some angles between the poles, increasing."""
    everywhere = jnp.concatenate([jnp.zeros(1), angles, jnp.full(1, jnp.pi)])
    steps = jnp.diff(everywhere)

    def shares(size):
        density = 1 / jnp.concatenate([size[:1], size, size[-1:]])
        return jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps * (density[1:] + density[:-1]) / 2)])

    # an element's length is `size` times the total of the shares over the number of elements
    raw = 1 / jnp.sqrt(1 + (contrast * turning) ** 2)
    apart = jnp.abs(angles[:, None] - angles[None])
    limited = lambda _, size: jnp.min(raw[None] + slope * shape.elements / shares(size)[-1] * apart, axis=1)  # noqa: E731
    share = shares(jax.lax.fori_loop(0, PASSES, limited, raw))

    fractions = jnp.linspace(0.0, 1.0, shape.elements + 1)
    if shape.edge is None:
        targets = fractions * share[-1]
    else:
        at_edge = jnp.interp(shape.nodes[shape.edge], everywhere, share)
        moving, held = towards_edge(shape.edge, shape.elements, shape.crowded)
        targets = jnp.concatenate([moving * at_edge, share[-1] - held[1:] * (share[-1] - at_edge)])
    breaks = jnp.interp(targets, share, everywhere)
    breaks = breaks.at[0].set(0.0).at[-1].set(jnp.pi)
    return breaks if shape.edge is None else breaks.at[shape.edge].set(shape.nodes[shape.edge])


def towards_edge(edge: int, elements: int, crowded: bool) -> tuple[np.ndarray, np.ndarray]:
    """Places of the nodes on the free part (edge + 1,) from 0 to 1, and on the pad from 1 to 0, their ends included."""

    def places(count: int) -> np.ndarray:
        beyond = np.maximum(SHRINKING - np.arange(count)[::-1], 0) if crowded else np.zeros(count)
        lengths = RATIO**-beyond
        return np.concatenate([[0.0], np.cumsum(lengths) / np.sum(lengths)])

    return places(edge), places(elements - edge)[::-1]

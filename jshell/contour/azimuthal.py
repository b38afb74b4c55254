"""Splines for motions that vary around the axis as cos mφ: both parities, sorted by how they vanish at the poles.

A smooth function f(θ) cos kφ on a closed surface goes to zero as θ^k at the
poles and has the parity of k. Of a displacement a cos mφ along the axis,
b cos mφ away from it and c sin mφ around it, a has the order m, b + c the order
m + 1 and b - c the order |m - 1|: they are Cartesian components. One set of even
and one of odd splines serves every m; which functions may move is a mask.

Symbols    θ material angle [rad]   m order around the axis
Source     pole conditions as in any expansion on the sphere; Boyd, Chebyshev and Fourier Spectral Methods, sec. 18.2
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jshell.contour.curve import Meridian
from jshell.contour.mesh import POINTS, Beside
from jshell.contour.splines import ParitySplines

ENOUGH = 6  # a quintic spline has no more pole conditions than those below this order
DEAD = -1  # order of a column that only fills the array


class SplineBasis(NamedTuple):
    """Splines of one parity.

    Attributes:
        values: (3, points, size) values, first and second θ-derivatives at the Gauss points.
        near: (nodes, near, size) values at the graded points beside each node.
        nodes: (nodes, size) values at the nodes.
        order: (size,) how each vanishes at the poles; -1 where a column is empty.
        held: (size,) whether a pad holds it.
    """

    values: Float[Array, "3 points size"]
    near: Float[Array, "nodes near size"]
    nodes: Float[Array, "nodes size"]
    order: Int[Array, "size"]
    held: Bool[Array, "size"]


class Azimuthal(eqx.Module):
    """The splines of every order m on one meridian: `even` and `odd` for motions, the same for the potential."""

    even: SplineBasis
    odd: SplineBasis
    potential_even: SplineBasis
    potential_odd: SplineBasis

    @property
    def size(self) -> int:
        """Functions per component; a motion has three times as many coordinates."""
        return self.even.order.shape[0]

    def motion(self, m: Int[Array, ""] | int) -> tuple[SplineBasis, SplineBasis, SplineBasis]:
        """Splines of a, of b + c and of b - c for order m."""
        across = _either(m + 1, self.even, self.odd)
        return _either(m, self.even, self.odd), across, across

    def potential(self, m: Int[Array, ""] | int) -> SplineBasis:
        """Splines of the liquid's potential for order m."""
        return _either(m, self.potential_even, self.potential_odd)

    def moving(self, m: Int[Array, ""] | int) -> Bool[Array, "motions"]:
        """Which of the coordinates (a, b + c, b - c) may move."""
        orders = m, m + 1, jnp.abs(m - 1)
        parts = zip(self.motion(m), orders, strict=True)
        return jnp.concatenate([(f.order >= jnp.minimum(k, ENOUGH)) & (f.order != DEAD) & ~f.held for f, k in parts])


@eqx.filter_jit
def azimuthal(shape: Meridian) -> Azimuthal:
    """The splines of a meridian; its breakpoints may be traced."""
    breaks = shape.nodes
    beside = Beside(breaks)
    made = [_family(ParitySplines(breaks, parity, shape.edge), beside, shape) for parity in ("even", "odd")]
    if shape.edge is None:
        return Azimuthal(*made, *made)
    loose = [_family(ParitySplines(breaks, parity), beside, None) for parity in ("even", "odd")]
    return Azimuthal(*made, *loose)


def _either(order, even: SplineBasis, odd: SplineBasis) -> SplineBasis:
    if isinstance(order, int):
        return odd if order % 2 else even
    return SplineBasis(*(jnp.where(order % 2 == 0, a, b) for a, b in zip(even, odd, strict=True)))


def _family(splines: ParitySplines, beside: Beside, shape: Meridian | None) -> SplineBasis:
    """Splines whose first and last functions have one leading power each at their pole."""
    even = splines.parity == "even"
    powers = np.array([0, 2, 4] if even else [1, 3])
    count, size = len(powers), splines.size
    first = splines.taylor(1)[0][powers][:, :count]
    last = splines.taylor(-1)[-1][powers][:, size - count :]
    turn = jnp.eye(size).at[:count, :count].set(jnp.linalg.inv(first))
    turn = turn.at[size - count :, size - count :].set(jnp.linalg.inv(last))
    order = np.full(size, ENOUGH)
    order[:count], order[size - count :] = powers, powers

    gauss, _ = np.polynomial.legendre.leggauss(POINTS)
    points = POINTS * (len(splines.breaks) - 1)
    values = jnp.stack([jnp.asarray(splines.within(gauss, k)).reshape(points, size) for k in range(3)])
    near = beside.polynomials(splines, 1)[0]
    nodes = jnp.asarray(splines.at_breaks())
    if shape is None or shape.edge is None:
        held = np.zeros(size, dtype=bool)
    else:
        held = splines.beyond(shape.edge)
    # the odd ones are two fewer: an empty column at each end makes the sizes equal
    filled = lambda array: jnp.pad(array @ turn, [(0, 0)] * (array.ndim - 1) + [(0 if even else 1,) * 2])  # noqa: E731
    if not even:
        order, held = np.pad(order, 1, constant_values=DEAD), np.pad(held, 1)
    off_axis = jnp.ones((nodes.shape[0], 1)) if even else jnp.ones((nodes.shape[0], 1)).at[jnp.array([0, -1])].set(0.0)
    return SplineBasis(filled(values), filled(near), filled(nodes) * off_axis, jnp.asarray(order), jnp.asarray(held))

"""Shapes to start from: the sphere, a mirrored dimple; and the weak spot that starts a dimple.

Symbols    θ material angle [rad]   d̂ thickness [R0]
Source     Landau and Lifshitz: a buckled cap is the sphere's mirror image; weak spot: the source's numerical method
"""

from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour.curve import Meridian
from jshell.contour.grading import even_shares
from jshell.contour.mesh import fit
from jshell.errors import BadValue
from jshell.shell.elasticity import Scalar

RIM = 0.7  # width of a rim over √d̂: from the rest shapes themselves
SAMPLES = 400  # angles at which a seed's turning is known: a rim of d̂ = 0.001 is three of them wide


@dataclass(frozen=True)
class WeakSpot:
    """The wall is thinner around the buckling pole: thickness x (1 - depth exp(-(θ/width)²)).

    Args:
        depth: Relative loss of thickness at the pole [-], 0 <= depth < 1.
        width: Angular width [rad].
    """

    depth: float = 0.15
    width: float = 0.35

    def __post_init__(self) -> None:
        if not 0 <= self.depth < 1:
            raise BadValue(
                "weak spot depth", found=repr(self.depth), expected="0 <= depth < 1", remedy="0.15 is usual."
            )
        if not 0 < self.width <= 3:
            raise BadValue(
                "weak spot width", found=repr(self.width), expected="0 < width <= 3 rad", remedy="0.35 is usual."
            )


NO_WEAK_SPOT = WeakSpot(0.0, 0.35)


def wall_profile(shape: Meridian, spot: WeakSpot) -> Float[Array, "points"]:
    """Thickness over its nominal value at the Gauss points [-]."""
    return thinned(shape, spot.depth, spot.width)


def thinned(shape: Meridian, depth: Scalar, width: Scalar) -> Float[Array, "points"]:
    """The same for a spot's depth and width, which may be traced."""
    return jnp.asarray(1 - depth * jnp.exp(-((shape.angles / width) ** 2)))


def compressed_sphere(shape: Meridian, radius: Scalar) -> Float[Array, "coordinates"]:
    """Coordinates of a sphere of another radius [R0], its back pole where the pad is, if there is one."""
    if shape.crowded:
        # a kink at a pad's edge, in elements so small, is no start; the stress-free sphere is
        return shape.sphere
    moved = shape.sphere * radius
    if shape.attached:
        return shape.whole(shape.free(moved + (radius - 1) * _unit_shift(shape)), shape.sphere)
    return moved


def _unit_shift(shape: Meridian) -> Float[Array, "coordinates"]:
    ones, zeros = jnp.ones(shape.x_size), jnp.zeros(shape.sphere.shape[0] - shape.x_size)
    return jnp.concatenate([ones, zeros])


def dimple(shape: Meridian, volume_ratio: Scalar, thickness: Scalar) -> Float[Array, "coordinates"]:
    """Coordinates of a sphere whose cap is mirrored inwards, its rim rounded over the bending length.

    The meridian's tangent turns from the mirrored cap's to the sphere's and its length is kept: a rim that is
    squeezed along the meridian may be squeezed to nothing, where energies over the current area have no floor.

    Args:
        volume_ratio: V/V0 wanted [-], about met.
        thickness: d̂ [R0]; sets the width of the rim.
    """
    theta = shape.angles
    tangent, _ = _fold(theta, volume_ratio, thickness)
    return shape.sphere + fit(shape, jnp.sin(theta) - jnp.sin(tangent), jnp.cos(tangent) - jnp.cos(theta), derivative=1)


def dimple_breaks(shape: Meridian, volume_ratio: Scalar, thickness: Scalar) -> Float[Array, "nodes"]:
    """Breakpoints that crowd at the rim of a `dimple`, before there is a shape to follow [rad]."""
    theta = (jnp.arange(SAMPLES) + 0.5) * jnp.pi / SAMPLES
    return even_shares(shape, theta, _fold(theta, volume_ratio, thickness)[1])


def _fold(theta, volume_ratio, thickness):
    """Angle of the tangent along a mirrored cap, and its turning per θ."""
    # removed volume 2 π h² (3 - h)/3 = (1 - V/V0) V0: Newton for the cap's height h
    wanted = 2 * (1 - volume_ratio)
    h = jnp.sqrt(wanted / 3)
    for _ in range(6):
        h = h - (h**2 * (3 - h) - wanted) / (6 * h - 3 * h**2)
    edge = jnp.arccos(1 - h)
    width = edge * RIM * jnp.sqrt(thickness)
    side = jnp.tanh((theta**2 - edge**2) / (2 * width))
    return theta * side, side + theta**2 * (1 - side**2) / width

"""Rings of sources and of dipoles: the two kernels of axisymmetric potential flow.

Integrated over the azimuth, with 1 - m = ρ₋²/ρ₊² and K, E at m,

    source   G  = K/(π ρ₊)
    dipole   G' = [E (2 r' B - x') + x' K]/(2 π ρ₊),   B = (x_t Δr - r_t Δx)/ρ₋²

per unit θ along the curve, r' and the length of the tangent included in G' and
left out of G; x', r_t derivatives at the source. The form of B has no 0/0: at
its own ring it tends to half the curvature.

Symbols    Δx, Δr source minus target [R0]   ρ∓ shortest and longest distance of the ring [R0]
Source     Pozrikidis, Boundary Integral and Singularity Methods, sec. 2.4; B by differentiating K/ρ₊
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.flow.elliptic import complete


def kernels(
    shortest: Float[Array, "..."],
    longest: Float[Array, "..."],
    bend: Float[Array, "..."],
    radius: Float[Array, "..."],
    x_slope: Float[Array, "..."],
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Potential of a unit ring source, and of a unit ring dipole times its area element per θ.

    Args:
        shortest, longest: Squared distances ρ₋², ρ₊² [R0²].
        bend: B = (x_t Δr - r_t Δx)/ρ₋² [rad⁻¹].
        radius: Distance of the source from the axis, r' [R0].
        x_slope: dx/dθ at the source [R0].
    """
    K, E = complete(shortest / longest)
    scale = 1 / (jnp.pi * jnp.sqrt(longest))
    source = K * scale
    dipole = (E * (radius * bend - x_slope / 2) + x_slope / 2 * K) * scale
    return source, dipole

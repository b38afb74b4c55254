"""What the wall resists with: moduli, the sphere's energy, the buckling threshold.

Symbols    K_A area modulus, K_S shear modulus [E d]   K_B bending stiffness [E d R0²]
           ΔP_b buckling threshold [E d/R0]
Valid for  a thin wall (Koiter); thick walls through the midplane
Source     Mokbel et al. 2021: eq:moduli, eq:NRJsph; ΔP_b: classical (Zoelly)
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.shell.parameters import Number

Scalar = Number | Float[Array, ""]
SPHERE_VOLUME = 4 * jnp.pi / 3
SPHERE_AREA = 4 * jnp.pi


class Moduli(NamedTuple):
    """Two-dimensional moduli of the wall: area and shear [E d], bending [E d R0²]."""

    area: Scalar
    shear: Scalar
    bending: Scalar


def moduli(thickness: Scalar, poisson_ratio: Scalar = 0.5) -> Moduli:
    """Area, shear and bending modulus of a wall of thickness d̂ (eq:moduli)."""
    d, nu = thickness, poisson_ratio
    return Moduli(1 / (2 * (1 - nu)), 1 / (2 * (1 + nu)), d**2 / (12 * (1 - nu**2)))


def sphere_energy(radius: Scalar, thickness: Scalar, poisson_ratio: Scalar = 0.5) -> Scalar:
    """Elastic energy of a sphere of radius R [E d R0²] (eq:NRJsph)."""
    K = moduli(thickness, poisson_ratio)
    return 8 * jnp.pi * (1 - radius) ** 2 * (K.area * radius**2 + K.bending)


def buckling_threshold(thickness: Scalar, poisson_ratio: Scalar = 0.5) -> Scalar:
    """Classical buckling pressure difference ΔP_b = 2 d̂/sqrt(3 (1 - ν²)) [E d/R0]."""
    return 2 * thickness / jnp.sqrt(3 * (1 - poisson_ratio**2))

"""The liquid as inertia: kinetic energy ½ u·M(q)u of the potential flow around a moving wall.

Symbols    M added mass [ρ_f R0³]   Φ potential at the nodes per coordinate velocity
Valid for  unbounded, incompressible, irrotational liquid
Source     Lamb, Hydrodynamics, arts. 44 and 121; M is symmetric, as Green's identity wants
"""

from typing import NamedTuple

import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Float, Int

from jshell.contour import Meridian, speed
from jshell.flow.panels import Layers, flux_operator, green, layers, single_layer
from jshell.flow.wall_motion import along_wall, every_motion


class Flow(NamedTuple):
    """The linear map from wall velocity to liquid, for one shape.

    Attributes:
        mass: (coordinates, coordinates) added mass M, symmetric positive semidefinite [ρ_f R0³].
        potential: (nodes, coordinates) coefficients of φ per unit coordinate velocity.
        flux: (points, coordinates) ring flux at the Gauss points.
        parts, factors: The assembled layers and the factors of 1/2 - D, for further solves.
    """

    mass: Float[Array, "coordinates coordinates"]
    potential: Float[Array, "nodes coordinates"]
    flux: Float[Array, "points coordinates"]
    parts: Layers
    factors: tuple[Float[Array, "nodes nodes"], Int[Array, "nodes"]]


def flow(shape: Meridian, q: Float[Array, "coordinates"]) -> Flow:
    """The potential flow around a shape."""
    parts = layers(shape, q)
    factors = jsl.lu_factor(green(shape, parts))
    potential = -jsl.lu_solve(factors, single_layer(shape, parts))
    flux = flux_operator(shape, parts.curve)
    half = -jnp.pi * (flux.T * shape.weights[None]) @ (shape.potential_basis[0] @ potential)
    return Flow(half + half.T, potential, flux, parts, factors)


def added_mass(shape: Meridian, q: Float[Array, "coordinates"]) -> Float[Array, "coordinates coordinates"]:
    """Added mass M of a shape [ρ_f R0³]: the kinetic energy is ½ u·M u."""
    return flow(shape, q).mass


def slip_operator(shape: Meridian, current: Flow) -> Float[Array, "points coordinates"]:
    """Slip of the wall along the meridian over the potential flow, w = u·t - ∂φ/∂s, at the Gauss points."""
    curve = current.parts.curve
    return (
        along_wall(curve, every_motion(shape)) - (shape.potential_basis[1] @ current.potential) / speed(curve)[:, None]
    )

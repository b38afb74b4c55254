"""The Stokes layer: what a little viscosity does at a wall that slips through the potential flow.

To first order in sqrt(η̂) the vorticity stays in a layer thinner than the
shell. It resists the slip w with the impedance sqrt(η̂ s) per area at the
complex rate s: the half-order derivative of Basset.

Symbols    w slip along the meridian   G = ∮ WᵀW dA [R0²]   η̂ viscosity
Valid for  η̂ << 1: a layer thinner than the radius, attached flow
Source     Landau and Lifshitz, Fluid Mechanics, § 24; Stokes' second problem
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Meridian, speed
from jshell.flow.added_mass import Flow, slip_operator
from jshell.shell.elasticity import Scalar


class SingleFrequency(NamedTuple):
    """The layer at one reference frequency ω: an added mass and a resistance per G."""

    mass: Scalar
    resistance: Scalar


def slip_matrix(shape: Meridian, current: Flow) -> Float[Array, "coordinates coordinates"]:
    """G = ∮ WᵀW dA [R0²]: u·G u is the wall's integral of the squared slip."""
    W = slip_operator(shape, current)
    curve = current.parts.curve
    surface = 2 * jnp.pi * shape.weights * curve.r * speed(curve)
    return (W.T * surface[None]) @ W


def single_frequency(viscosity: Scalar, frequency: Scalar | complex) -> SingleFrequency:
    """The layer's mass and resistance, exact at one rate.

    At a real frequency ω the impedance sqrt(iωη̂) is iω times a mass sqrt(η̂/2ω) plus a resistance
    sqrt(ωη̂/2). At a decaying rate s = -1/τ + iΩ, given as a complex number, the two are chosen such that
    s·mass + resistance = sqrt(s η̂) there, so that a mode of that rate keeps its frequency and its decay.

    Args:
        viscosity: η̂ [-].
        frequency: Real ω, or complex s [1/time].
    """
    s = jnp.asarray(frequency)
    s = s if jnp.iscomplexobj(s) else 1j * s
    half = jnp.sqrt(s)
    mass = jnp.imag(half) / jnp.imag(s)
    return SingleFrequency(jnp.sqrt(viscosity) * mass, jnp.sqrt(viscosity) * (jnp.real(half) - jnp.real(s) * mass))

"""The radial motion of any sphere in a liquid: one equation, whatever the wall.

The compressed sphere of the short model and the radial rivals differ in what
their wall bears; inertia, gas, liquid, sound and wall viscosity are the same.

Symbols    R radius   P gas pressure   κ_s wall viscosity   c speed of sound; any consistent units with density 1
Valid for  R Ṙ²/c small (first order in the Mach number)
Source     Rayleigh & Plesset; Marmottant et al. 2005, eq. 3, for the sound and the wall's viscosity
"""

from typing import NamedTuple

from jaxtyping import Array, Float

from jshell.shell.parameters import Number

Values = Float[Array, "*batch"]


class Pressures(NamedTuple):
    """What drives a sphere's radius.

    Attributes:
        gas: Pressure of the gas.
        wall: Pressure that the wall adds to it, outwards positive; -2σ/R of a film.
        outer: Pressure far away.
    """

    gas: Values
    wall: Values
    outer: Values


def radial_acceleration(
    radius: Values,
    speed: Values,
    pressures: Pressures,
    *,
    viscosity: Number,
    kappa: Number,
    wall_viscosity: Number = 0.0,
    sound_speed: Number | None = None,
) -> Values:
    """R̈ of a sphere.

    Args:
        radius: R.
        speed: Ṙ.
        pressures: Inside, of the wall and outside.
        viscosity: Of the liquid.
        kappa: Polytropic exponent.
        wall_viscosity: κ_s.
        sound_speed: c; None is an incompressible liquid.

    Source:
        ρ (R R̈ + 3/2 Ṙ²) = P (1 - 3κ Ṙ/c) + wall - P_ext - 4η Ṙ/R - 4κ_s Ṙ/R².
    """
    gas, wall, outer = pressures
    radiated = 0.0 if sound_speed is None else 3 * kappa * gas * speed / sound_speed
    slowed = 4 * viscosity * speed / radius + 4 * wall_viscosity * speed / radius**2
    return (gas - radiated + wall - outer - slowed - 1.5 * speed**2) / radius

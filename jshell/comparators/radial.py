"""Radial rivals of the buckled shell: the intact sphere and the bare bubble.

Symbols    ω angular frequency [sqrt(E d/(ρ_f R0³))]   P̂ext outer pressure [E d/R0]
Valid for  small radial oscillations
Source     Mokbel et al. 2021: eq:wsphere, caption of fig:soft; Minnaert 1933
"""

from typing import NamedTuple

from jaxtyping import Array, Float

from jshell.shell.parameters import Reduced
from jshell.shell.sphere import (
    buckling_load,
    marmottant_frequency,
    minnaert_frequency,
    sphere_frequency,
    sphere_frequency_at_load,
)

__all__ = [
    "RadialFrequencies", "buckling_load", "marmottant_frequency", "minnaert_frequency", "radial_frequencies",
    "sphere_frequency", "sphere_frequency_at_load",
]  # fmt: skip


class RadialFrequencies(NamedTuple):
    """Angular frequencies of one problem by the radial models [sqrt(E d/(ρ_f R0³))].

    Attributes:
        sphere: The shell, compressed but not buckled.
        minnaert: A bare bubble of radius R0 at the gas pressure of the stress-free shell.
        marmottant: A bare bubble of radius R0 at the outer pressure.
    """

    sphere: Float[Array, ""]
    minnaert: Float[Array, ""]
    marmottant: Float[Array, ""]


def radial_frequencies(conditions: Reduced) -> RadialFrequencies:
    """The angular frequencies that radial models give a shell at a load.

    Source:
        eq:wsphere; caption of fig:soft.
    """
    return RadialFrequencies(
        sphere_frequency_at_load(conditions),
        minnaert_frequency(conditions.gas_pressure, conditions.kappa),
        marmottant_frequency(conditions),
    )

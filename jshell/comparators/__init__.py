"""Rivals of the buckled shell: what simpler models would say."""

from jshell.comparators import marmottant, radial, sphere
from jshell.comparators.marmottant import Marmottant, RadialRun, radial_run
from jshell.comparators.radial import RadialFrequencies, radial_frequencies
from jshell.comparators.sphere import SphereRun, sphere_run

__all__ = [
    "Marmottant", "RadialFrequencies", "RadialRun", "SphereRun", "marmottant", "radial", "radial_frequencies",
    "radial_run", "sphere", "sphere_run",
]  # fmt: skip

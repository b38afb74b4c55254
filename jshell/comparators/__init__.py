"""Rivals of the buckled shell: what simpler models would say."""

from jshell.comparators import radial
from jshell.comparators.radial import RadialFrequencies, radial_frequencies

__all__ = ["RadialFrequencies", "radial", "radial_frequencies"]

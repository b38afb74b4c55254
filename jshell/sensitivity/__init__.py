"""What depends on what: slopes, information, shares of variance, and shells made to order."""

from jshell.sensitivity import design as designs
from jshell.sensitivity import identifiability, local, variance
from jshell.sensitivity.design import Design, design, loaded
from jshell.sensitivity.identifiability import Information, NextExperiment, information, next_experiment
from jshell.sensitivity.local import INPUTS, OBSERVABLES, Elasticities, elasticities
from jshell.sensitivity.variance import Range, SobolIndices, sobol

__all__ = [
    "INPUTS", "OBSERVABLES", "Design", "Elasticities", "Information", "NextExperiment", "Range", "SobolIndices",
    "design", "designs", "elasticities", "identifiability", "information", "loaded", "local", "next_experiment",
    "sobol", "variance",
]  # fmt: skip

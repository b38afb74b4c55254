"""What depends on what: slopes, information, shares of variance, and shells made to order."""

from jshell.renamed import renamed
from jshell.sensitivity import design as designs
from jshell.sensitivity import identifiability, local, variance
from jshell.sensitivity.design import MatchingShells, design, loaded
from jshell.sensitivity.identifiability import Information, NextExperiment, information, next_experiment
from jshell.sensitivity.local import INPUTS, OBSERVABLES, Elasticities, elasticities
from jshell.sensitivity.variance import Range, SobolIndices, sobol

__all__ = [
    "INPUTS", "OBSERVABLES", "Elasticities", "Information", "MatchingShells", "NextExperiment", "Range", "SobolIndices",
    "design", "designs", "elasticities", "identifiability", "information", "loaded", "local", "next_experiment",
    "sobol", "variance",
]  # fmt: skip

__getattr__ = renamed(__name__, {"Design": "MatchingShells"})

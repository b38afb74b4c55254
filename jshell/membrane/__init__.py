"""The solid: one elastic energy and the shapes it rests in."""

from jshell.membrane.accuracy import ShapeError, estimate_error
from jshell.membrane.branch import Branch, Fold, deflation_branch
from jshell.membrane.energy import Wall, elastic_energy, gas_energy, potential_energy, stiffness, wall
from jshell.membrane.maxwell import Maxwell, maxwell_point
from jshell.membrane.plateau import plateau_pressure
from jshell.membrane.rest import RestShape, rest, rest_shape
from jshell.membrane.round import law_of, symmetry_by_law, symmetry_in_doubt, symmetry_words, thinnest_round
from jshell.membrane.stability import HIGHEST_ORDER, Stability, stability
from jshell.membrane.symmetry import CriticalThickness, SymmetryLoss, critical_thickness, critical_volume, symmetry_loss
from jshell.membrane.threshold import Threshold, buckling_eigenvalue
from jshell.membrane.viscous import WallLoss, wall_resistance

__all__ = [
    "HIGHEST_ORDER", "Branch", "CriticalThickness", "Fold", "Maxwell", "RestShape", "ShapeError", "Stability",
    "SymmetryLoss", "Threshold", "Wall", "WallLoss", "buckling_eigenvalue", "critical_thickness",
    "critical_volume", "deflation_branch", "elastic_energy", "estimate_error", "gas_energy", "law_of", "maxwell_point",
    "plateau_pressure", "potential_energy", "rest", "rest_shape", "stability", "stiffness", "symmetry_by_law",
    "symmetry_in_doubt", "symmetry_loss", "symmetry_words", "thinnest_round", "wall", "wall_resistance",
]  # fmt: skip

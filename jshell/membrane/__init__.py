"""The solid: one elastic energy and the shapes it rests in."""

from jshell.membrane.energy import Wall, elastic_energy, gas_energy, potential_energy, stiffness, wall
from jshell.membrane.rest import RestShape, rest, rest_shape

__all__ = [
    "RestShape", "Wall", "elastic_energy", "gas_energy", "potential_energy", "rest", "rest_shape", "stiffness", "wall",
]  # fmt: skip

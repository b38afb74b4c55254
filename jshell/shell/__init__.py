"""What a shell is: its parameters, its elasticity, its rest states, and the shells that have names."""

from jshell.shell import elasticity, presets, rest
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, buckling_threshold, moduli, sphere_energy
from jshell.shell.parameters import Gas, Liquid, Load, Reduced, Scales, Shell, scales
from jshell.shell.rest import buckled_state, gas_pressure, plateau_pressure, sphere_state

__all__ = [
    "SPHERE_AREA", "SPHERE_VOLUME", "Gas", "Liquid", "Load", "Reduced", "Scales", "Shell", "buckled_state",
    "buckling_threshold", "elasticity", "gas_pressure", "moduli", "plateau_pressure", "presets", "rest", "scales",
    "sphere_energy", "sphere_state",
]  # fmt: skip

"""The liquid: ring kernels, added mass, viscosity exact and by orders of a thin layer, the flow around the shell."""

from jshell.flow.added_mass import Flow, added_mass, flow, slip_operator
from jshell.flow.bulk_loss import bulk_resistance
from jshell.flow.elliptic import complete
from jshell.flow.field import FluidField, field
from jshell.flow.gyroscopic import gyroscopic
from jshell.flow.second_order import SecondOrder, second_order, second_resistance
from jshell.flow.stokes_layer import SingleFrequency, single_frequency, slip_matrix
from jshell.flow.viscous import ViscousLiquid, impedance, viscous_liquid
from jshell.renamed import renamed

__all__ = [
    "Flow", "FluidField", "SecondOrder", "SingleFrequency", "ViscousLiquid", "added_mass", "bulk_resistance",
    "complete", "field", "flow", "gyroscopic", "impedance", "second_order", "second_resistance", "single_frequency",
    "slip_matrix", "slip_operator", "viscous_liquid",
]  # fmt: skip
__getattr__ = renamed(__name__, {"turning": "gyroscopic"})

"""The liquid: ring kernels, added mass, Stokes layer, the flow around the shell."""

from jshell.flow.added_mass import Flow, added_mass, flow, slip_operator
from jshell.flow.bulk_loss import bulk_resistance
from jshell.flow.elliptic import complete
from jshell.flow.field import FluidField, field
from jshell.flow.stokes_layer import SingleFrequency, single_frequency, slip_matrix
from jshell.flow.turning import turning

__all__ = [
    "Flow", "FluidField", "SingleFrequency", "added_mass", "bulk_resistance", "complete", "field", "flow",
    "single_frequency", "slip_matrix", "slip_operator", "turning",
]  # fmt: skip

"""The liquid: ring kernels, added mass, Stokes layer."""

from jshell.flow.added_mass import Flow, added_mass, flow, slip_operator
from jshell.flow.elliptic import complete
from jshell.flow.stokes_layer import SingleFrequency, single_frequency, slip_matrix
from jshell.flow.turning import turning

__all__ = [
    "Flow", "SingleFrequency", "added_mass", "complete", "flow", "single_frequency", "slip_matrix", "slip_operator",
    "turning",
]  # fmt: skip

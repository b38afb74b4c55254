"""The shell in its liquid: small vibrations and motion in time."""

from jshell.dynamics.accuracy import ModesError, TraceError, estimate_error, estimate_modes_error
from jshell.dynamics.all_modes import AllModes
from jshell.dynamics.azimuthal import azimuthal_modes
from jshell.dynamics.losses import NO_LOSSES, Losses
from jshell.dynamics.many import simulate_many
from jshell.dynamics.modes import modes
from jshell.dynamics.offset import offset
from jshell.dynamics.order_modes import OrderMode, OrderModes
from jshell.dynamics.outputs import Meridians, far_pressure, liquid_at, meridians, mode_shapes, to_xarray
from jshell.dynamics.roundness import Roundness, roundness
from jshell.dynamics.simulate import LONGEST_STEP, Motion, record, simulate
from jshell.dynamics.starts import kick, swell
from jshell.dynamics.vibrations import Mode, Modes
from jshell.pressure import Hold, Ramp, Recorded, Sum
from jshell.renamed import renamed

__all__ = [
    "LONGEST_STEP", "NO_LOSSES", "AllModes", "Hold", "Losses", "Meridians", "Mode", "Modes", "ModesError", "Motion",
    "OrderMode", "OrderModes", "Ramp", "Recorded", "Roundness", "Sum", "TraceError", "azimuthal_modes",
    "estimate_error", "estimate_modes_error", "far_pressure", "kick", "liquid_at", "meridians", "mode_shapes", "modes",
    "offset", "record", "roundness", "simulate", "simulate_many", "swell", "to_xarray",
]  # fmt: skip
__getattr__ = renamed(__name__, {"Forced": "jshell.pressure:forced", "Sampled": "jshell.pressure:Recorded"})

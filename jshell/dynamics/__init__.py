"""The shell in its liquid: small vibrations and motion in time."""

from jshell.dynamics.accuracy import ModesError, TraceError, estimate_error, estimate_modes_error
from jshell.dynamics.losses import NO_LOSSES, Losses
from jshell.dynamics.many import simulate_many
from jshell.dynamics.modes import Mode, Modes, modes
from jshell.dynamics.outputs import Meridians, far_pressure, liquid_at, meridians, mode_shapes, to_xarray
from jshell.dynamics.protocol import Forced, Hold, Ramp, Sampled, offset
from jshell.dynamics.simulate import LONGEST_STEP, Motion, record, simulate
from jshell.dynamics.starts import kick, swell

__all__ = [
    "LONGEST_STEP", "NO_LOSSES", "Forced", "Hold", "Losses", "Meridians", "Mode", "Modes", "ModesError", "Motion",
    "Ramp", "Sampled", "TraceError", "estimate_error", "estimate_modes_error", "far_pressure", "kick", "liquid_at",
    "meridians", "mode_shapes", "modes", "offset", "record", "simulate", "simulate_many", "swell", "to_xarray",
]  # fmt: skip

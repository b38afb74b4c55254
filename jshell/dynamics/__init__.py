"""The simulator: small vibrations, and the snap in time."""

from jshell.dynamics.modes import Modes, modes
from jshell.dynamics.protocol import Hold, Ramp
from jshell.dynamics.simulate import LONGEST_STEP, simulate

__all__ = ["LONGEST_STEP", "Hold", "Modes", "Ramp", "modes", "simulate"]

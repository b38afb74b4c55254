"""The simulator: small vibrations, and the snap in time."""

from jshell.dynamics.modes import Modes, modes
from jshell.dynamics.protocol import Hold, Ramp
from jshell.dynamics.simulate import simulate

__all__ = ["Hold", "Modes", "Ramp", "modes", "simulate"]

"""Buckling spherical shells in a liquid: simulate, analyse, fit.

Rooms and names are loaded when they are first used, so that a terminal's help
and a script that reads one file need not wait for JAX.
"""

from jshell import starting as starting  # first: a service may be told to stop while the rest is imported

# isort: split
from typing import TYPE_CHECKING

from jshell import emitters, precision, programs, threads
from jshell.errors import JshellError, NotOk, Outcome, RangeWarning
from jshell.lazy import lazy

threads.ask_for_one()
precision.ask_for_double()
emitters.ask_for_the_elder()
programs.keep()

if TYPE_CHECKING:
    from jshell import (
        calibration,
        campaigns,
        comparators,
        dynamics,
        engines,
        export,
        inversion,
        io,
        membrane,
        oscillator,
        quantities,
        sensitivity,
        shell,
        signals,
    )
    from jshell import camera as camera  # rooms that `from jshell import *` leaves alone
    from jshell import contour as contour
    from jshell import flow as flow
    from jshell import memory as memory
    from jshell import plot as plot
    from jshell.calibration import FitResult, load
    from jshell.calibration import fit_trajectories as fit
    from jshell.dynamics import modes, simulate
    from jshell.inversion import invert
    from jshell.oscillator import Coefficients
    from jshell.service.client import Client
    from jshell.shell import Gas, Liquid, Load, Reduced, Scales, Shell, presets
    from jshell.signals import extract
    from jshell.trace import Trace

__version__ = "0.2.0"
__all__ = [
    "Client", "Coefficients", "FitResult", "Gas", "JshellError", "Liquid", "Load", "NotOk", "Outcome", "RangeWarning",
    "Reduced", "Scales", "Shell", "Trace", "calibration", "campaigns", "comparators", "dynamics", "engines", "export",
    "extract", "fit", "inversion", "invert", "io", "load", "membrane", "modes", "oscillator", "presets", "quantities",
    "sensitivity", "shell", "signals", "simulate",
]  # fmt: skip

_ROOMS = (
    "calibration", "camera", "campaigns", "comparators", "contour", "dynamics", "engines", "export", "flow",
    "inversion", "io", "membrane", "memory", "oscillator", "plot", "quantities", "sensitivity", "shell", "signals",
)  # fmt: skip
_HOMES = {
    "Client": "service.client", "Coefficients": "oscillator", "FitResult": "calibration", "Gas": "shell",
    "Liquid": "shell", "Load": "shell", "Reduced": "shell", "Scales": "shell", "Shell": "shell", "Trace": "trace",
    "extract": "signals", "fit": "calibration:fit_trajectories", "invert": "inversion", "load": "calibration",
    "modes": "dynamics", "presets": "shell", "simulate": "dynamics",
}  # fmt: skip
__getattr__, __dir__ = lazy(__name__, dict.fromkeys(_ROOMS, "") | _HOMES)

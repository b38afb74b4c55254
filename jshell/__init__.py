"""Buckling spherical shells in a liquid: simulate, listen, fit."""

from typing import TYPE_CHECKING, Any

from jshell import threads

threads.ask_for_one()

from jshell import precision  # noqa: E402

precision.ask_for_double()

from jshell import (  # noqa: E402
    calibration,
    campaigns,
    comparators,
    dynamics,
    engines,
    io,
    membrane,
    oscillator,
    quantities,
    sensitivity,
    shell,
    signals,
)
from jshell.calibration import FitResult, load  # noqa: E402
from jshell.errors import JshellError, NotOk, Outcome, RangeWarning  # noqa: E402
from jshell.oscillator import Coefficients  # noqa: E402
from jshell.shell import Gas, Liquid, Load, Reduced, Scales, Shell, presets  # noqa: E402
from jshell.trace import Trace  # noqa: E402

if TYPE_CHECKING:
    from jshell.service.client import Client

__version__ = "0.1.0"
__all__ = [
    "Client", "Coefficients", "FitResult", "Gas", "JshellError", "Liquid", "Load", "NotOk", "Outcome", "RangeWarning",
    "Reduced", "Scales", "Shell", "Trace", "calibration", "campaigns", "comparators", "dynamics", "engines", "io",
    "load", "membrane", "oscillator", "presets", "quantities", "sensitivity", "shell", "signals",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The client, once somebody asks for it: who fits on this machine needs nothing of the service."""
    if name == "Client":
        from jshell.service.client import Client

        return Client
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

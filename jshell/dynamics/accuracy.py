"""How wrong a run or a mode is: the same on a finer mesh with a shorter step.

Source     comparison with a refined solution; see `jshell.dynamics.refinement`
"""

from dataclasses import dataclass

import numpy as np

from jshell.dynamics.modes import modes
from jshell.dynamics.simulate import LONGEST_STEP, simulate, volume_apart
from jshell.dynamics.vibrations import Modes
from jshell.errors import Outcome
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

REFINED = 1.5  # elements of the finer run over those of the coarser


@dataclass(frozen=True)
class TraceError:
    """A run and its error.

    Attributes:
        volume: Largest difference of V from the refined run over V0 [-]; infinite where one of the two ended early.
        coarse, fine: The run asked about, and the refined one.
    """

    volume: float
    coarse: Trace
    fine: Trace


@dataclass(frozen=True)
class ModesError:
    """Modes and their relative errors: omega and tau against the refined ones, (modes,)."""

    omega: np.ndarray
    tau: np.ndarray
    coarse: Modes
    fine: Modes


def estimate_error(
    conditions: Reduced, *, elements: int = 32, step: float | int = LONGEST_STEP, **options
) -> TraceError:
    """Error of a run by one on 1.5 times the elements with half the step; takes the options of `simulate`."""
    coarse = simulate(conditions, elements=elements, step=step, **options)
    fine = simulate(conditions, elements=round(REFINED * elements), step=step / 2, **options)
    return TraceError(volume_apart(coarse, fine), coarse, fine)


def estimate_modes_error(conditions: Reduced, *, elements: int = 32, **options) -> ModesError:
    """Errors of modes by those on 1.5 times the elements; takes the options of `modes`, azimuth aside."""
    coarse = modes(conditions, elements=elements, **options)
    fine = modes(conditions, elements=round(REFINED * elements), **options)
    good = (np.asarray(coarse.outcome) == Outcome.OK) & (np.asarray(fine.outcome) == Outcome.OK)

    def relative(name):
        a, b = np.asarray(getattr(coarse, name)), np.asarray(getattr(fine, name))
        lossless = np.isinf(a) & np.isinf(b)
        with np.errstate(invalid="ignore"):
            apart = np.where(lossless, 0.0, np.abs(a / np.where(lossless, 1.0, b) - 1))
        return np.where(good, apart, np.inf)

    return ModesError(relative("omega"), relative("tau"), coarse, fine)

"""Whether a run's Stokes layer was thin enough, and the exact modes beside it where it was not.

In time the liquid is a series in √η̂ of which two terms are kept. What the second
took over what the first took, x, tells how far the third is: for small kicks
of R from η̂ = 0.004 to 0.05 the decay time is off by 0.2 x² (mode 1, within a
tenth of that) or half of it (mode 2); after a snap, in whose first moments the
second order takes more, by a third to a half of it.

Symbols    x loss of second order over loss of first [-]   τ decay time
Valid for  runs whose layer is of second order
Source     traces against exact modes, `tests/dynamics/test_losses.py`
"""

import warnings

import numpy as np

from jshell.contour import NO_WEAK_SPOT, WeakSpot
from jshell.dynamics.vibrations import Modes, vibrations
from jshell.errors import Outcome, RangeWarning
from jshell.membrane import RestShape, rest
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

SERIES_ERROR = 0.2  # of τ at most, over x²
TOLERATED = 0.05  # of τ: beyond it a run warns
SHOWN = 2  # exact modes beside a run that warns


def series_error(trace: Trace) -> float:
    """How far τ of a run is off, from what first and second order have taken since its dimple formed [-]."""
    times, said = np.asarray(trace.times), dict(trace.settings)
    since = "0"  # of a run that began at a rest shape: all of it rings
    if "ramp" in said:
        if "buckled_at" not in said:
            return 0.0  # a sphere that is compressed does not ring
        # while a sphere is slowly compressed the layer has time to thicken: that says nothing of the ringing
        since = said["buckled_at"]
    began = int(np.searchsorted(times, float(since)))
    layer, second = (np.asarray(trace[name]) for name in ("loss_layer", "loss_bulk"))
    taken, beside = (float(part[-1] - part[min(began, times.size - 1)]) for part in (layer, second))
    return SERIES_ERROR * (beside / taken) ** 2 if taken > 0 else 0.0


def warn_of_thick_layer(
    error: float,
    conditions: Reduced,
    start: RestShape | None,
    elements: int,
    attached: float,
    spot: WeakSpot | None,
    area: str,
) -> tuple[tuple[str, str], ...]:
    """Warn of a run whose decay is off by an `error`, with the exact modes of its shell at rest.

    Args:
        error: From `series_error`.
        conditions: Of the run; the rest shape is that under its outer pressure.
        start: The rest shape that the run began at, or None.
        elements, attached, spot, area: Of the run.

    Returns:
        The estimate and the exact modes, as settings of the trace.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)  # the run has said so already
        found = _exact(conditions, start, elements, attached, spot, area)
    settings = [("series_error", f"{error:.2g}")]
    words = f"the Stokes layer is so thick that its series may be off by {100 * error:.0f} % in tau"
    if int(found.rest.outcome) == Outcome.OK:
        modes = [
            f"tau {float(tau):.3g}, omega {float(omega):.3g}"
            if int(outcome) == Outcome.OK
            else f"tau {float(tau):.3g}, {Outcome(int(outcome)).word}"
            for tau, omega, outcome in zip(found.tau, found.omega, found.outcome, strict=True)
        ]
        settings += [("exact_modes", "; ".join(modes))]
        words += f"; exact modes about the rest shape: {'; '.join(modes)}"
    warnings.warn(words, RangeWarning, stacklevel=5)
    return tuple(settings)


def _exact(conditions: Reduced, start, elements, attached, spot, area) -> Modes:
    shape = start
    if shape is None:
        shape = rest(
            conditions,
            elements=elements,
            attached=attached,
            weak_spot=NO_WEAK_SPOT if spot is None else spot,
            area=area,
        )
    return vibrations(shape, conditions, SHOWN, "exact", area)

"""The curves of a trace fit, at the samples of its traces.

A result keeps the weighted residual, not the curve; with the weights that the
fit gave the same samples, curve = data + residual/weight, to rounding.
"""

from collections.abc import Sequence

import numpy as np

from jshell.calibration.data import weighted
from jshell.calibration.result import Fit
from jshell.errors import BadShape
from jshell.trace import Trace


def fitted_curves(result: Fit, traces: Sequence[Trace] | None = None) -> tuple[dict[str, np.ndarray], ...]:
    """Per trace, channel to the fitted curve (times,); NaN where a sample was left out.

    Args:
        result: Of a trace fit.
        traces: Those that were fitted, inside their windows; None takes them from the result.

    Raises:
        BadShape: The result is not one of a trace fit, or the traces are not the fit's.
    """
    names, traces = result.channels, result.traces if traces is None else traces
    if not names:
        raise BadShape(
            f"result {result.title!r}",
            found="no channels",
            expected="the result of a trace fit",
            remedy="Draw a fit of frequencies with `master_curve`.",
        )
    rows = [weighted(trace, names) for trace in traces]
    size = sum(data.size for data, _ in rows)
    if size != result.residual.size:
        raise BadShape(
            "traces",
            found=f"{size} samples of {', '.join(names)}",
            expected=f"the {result.residual.size} that were fitted",
            remedy="Give the traces, and `start` and `stop`, that the fit was given.",
        )
    found, at = [], 0
    for data, weight in rows:
        left = np.asarray(result.residual[at : at + data.size]).reshape(data.shape)
        used = weight > 0
        curve = np.where(used, data + left / np.where(used, weight, 1.0), np.nan)  # no datum, no residual
        found.append(dict(zip(names, curve, strict=True)))
        at += data.size
    return tuple(found)

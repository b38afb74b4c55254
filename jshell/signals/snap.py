"""Where the snap is in a record, and where the ring-down after it begins.

Symbols    t time [sqrt(ρ_f R0³/(E d))]
Source     Mokbel et al. 2021, fig:oscill: the fits begin after the buckling stage
"""

from collections.abc import Sequence

import numpy as np

from jshell.trace import Trace

AFTER_SNAP = 5.0  # the ring-down begins this long after the dip [time unit]
SNAP_SIZE = 8.0  # a record that starts further off than this many swings of its ring-down holds a snap
SMOOTHING = 1.0  # [time unit]


def dip(trace: Trace, names: Sequence[str] = ()) -> float:
    """Time of the dip that ends the snap: the minimum of V, else the first turning after the fastest change.

    Without V the steepest change of H (or of the first channel named) marks the snap; the dip is the
    first extremum after it, on a record smoothed over a time unit.
    """
    times = np.asarray(trace.times, dtype=float)
    if "V" in trace.channels:
        return float(times[int(np.argmin(np.asarray(trace["V"])))])
    name = "H" if "H" in trace.channels else (names or tuple(trace.channels))[0]
    width = max(1, round(SMOOTHING / float(np.median(np.diff(times)))))
    slope = np.gradient(_smoothed(np.asarray(trace[name], dtype=float), width), times)
    fastest = int(np.argmax(np.abs(slope)))
    turned = np.flatnonzero(slope[fastest:] * np.sign(slope[fastest]) <= 0)
    return float(times[fastest + int(turned[0])]) if turned.size else float(times[0])


def ring_down_start(trace: Trace) -> float | None:
    """When the ring-down after a snap begins; None where the record holds no snap.

    A record holds a snap when V (or H, or its first channel) starts further from where it settles than eight
    times the largest swing later than five units after the dip.
    """
    times = np.asarray(trace.times, dtype=float)
    name = next((known for known in ("V", "H") if known in trace.channels), next(iter(trace.channels)))
    values = np.asarray(trace[name], dtype=float)
    start = dip(trace, (name,)) + AFTER_SNAP
    after = values[times >= start]
    if after.size < 2:
        return None
    settled = float(np.mean(after[-max(1, after.size // 5) :]))
    holds = abs(values[0] - settled) > SNAP_SIZE * np.max(np.abs(after - settled))
    return start if holds else None


def _smoothed(values: np.ndarray, width: int) -> np.ndarray:
    """Running mean over about `width` samples, ends repeated."""
    reach = width // 2
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, np.full(2 * reach + 1, 1 / (2 * reach + 1)), mode="valid")

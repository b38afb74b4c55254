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
FALLEN = 0.9  # of its whole fall, that V has done where the snap ends
STAYED = 0.25  # of its way to where it settles, that a record at rest stays within


def dip(trace: Trace, names: Sequence[str] = ()) -> float:
    """Time of the dip that ends the snap: the minimum of V, else the first turning after the fastest change.

    Without V the steepest change of H (or of the first channel named) marks the snap; the dip is the
    first extremum after it, on a record smoothed over a time unit. With V it is so, too, where V all but ends its
    fall there: on a long plateau after the ring-down, noise or a drift may lie lowest.
    """
    times = np.asarray(trace.times, dtype=float)
    on_volume = "V" in trace.channels
    name = "V" if on_volume else "H" if "H" in trace.channels else (names or tuple(trace.channels))[0]
    values = np.asarray(trace[name], dtype=float)
    lowest = int(np.argmin(values))
    if times.size < 3:
        return float(times[lowest])
    # of a microshell's record in seconds a time unit is a million times the whole
    width = max(1, min(times.size, round(SMOOTHING / float(np.median(np.diff(times))))))
    slope = np.gradient(_smoothed(values, width), times)
    fastest = int(np.argmax(-slope if on_volume else np.abs(slope)))
    turned = np.flatnonzero(slope[fastest:] * np.sign(slope[fastest]) <= 0)
    if not turned.size:
        return float(times[lowest] if on_volume else times[0])
    first = fastest + int(turned[0])
    if not on_volume:
        return float(times[first])
    near = slice(fastest, int(np.searchsorted(times, times[first] + SMOOTHING, side="right")))
    here = fastest + int(np.argmin(values[near]))
    fallen = values[0] - values[here] > FALLEN * (values[0] - values[lowest])
    later = times[lowest] > times[here] + AFTER_SNAP
    return float(times[here if later and fallen else lowest])


def ring_down_start(trace: Trace) -> float | None:
    """When the ring-down after a snap begins; None where the record holds no snap.

    A record holds a snap when V (or H, or its first channel) starts further from where it settles than eight
    times the largest swing later than five units after the dip; or, twice that swing away, when it stays where it
    starts for five units.
    """
    times = np.asarray(trace.times, dtype=float)
    name = next((known for known in ("V", "H") if known in trace.channels), next(iter(trace.channels)))
    values = np.asarray(trace[name], dtype=float)
    start = dip(trace, (name,)) + AFTER_SNAP
    after = values[times >= start]
    if after.size < 2:
        return None
    settled = float(np.mean(after[-max(1, after.size // 5) :]))
    swing, away = float(np.max(np.abs(after - settled))), abs(float(values[0]) - settled)
    if away > SNAP_SIZE * swing:
        return start
    left = np.flatnonzero(np.abs(values - values[0]) > STAYED * away)
    rested = bool(left.size) and times[left[0]] - times[0] >= AFTER_SNAP
    return start if rested and away > 2 * swing else None


def _smoothed(values: np.ndarray, width: int) -> np.ndarray:
    """Running mean over about `width` samples, ends repeated."""
    reach = width // 2
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, np.full(2 * reach + 1, 1 / (2 * reach + 1)), mode="valid")

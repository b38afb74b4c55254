"""What an instrument did to a channel: clipped it, or took it in coarse steps.

Symbols    q step between neighbouring values of a digitised channel
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

FEWEST = 4  # equal samples at an extreme that make a clipped channel
LEVELS = 16  # a channel of fewer levels is too coarse for its frequencies
STEP_NOISE = 0.29  # rms of the error of rounding, over the step: 1/sqrt(12)


@dataclass(frozen=True)
class SampleFaults:
    """What is found.

    Attributes:
        clipped: (value, samples) of every extreme that is clipped.
        step: Step of a digitised channel; 0 where it takes no steps.
        levels: Values that the channel takes; 0 where it takes no steps.
    """

    clipped: tuple[tuple[float, int], ...]
    step: float
    levels: int


def sample_faults(values: Float[np.ndarray, "times"]) -> SampleFaults:
    """What is wrong with the samples of a channel."""
    known, counts = np.unique(values, return_counts=True)
    if known.size < 3:
        return SampleFaults((), float(np.ptp(values)), known.size)
    step = _step(values, known)
    levels = round(float(np.ptp(values)) / step) + 1 if step else 0
    # a peak that is not clipped holds its extreme once, or where it is digitised two or three times as often as the
    # level beside it
    ends = []
    for value, count, sign in ((known[0], counts[0], 1), (known[-1], counts[-1], -1)):
        beside = np.abs(known - (value + sign * step)) < 0.1 * step
        ends.append((float(value), int(count), int(counts[beside].sum())))
    clipped = tuple((value, count) for value, count, beside in ends if _held(values, value, count, beside, step))
    return SampleFaults(clipped, step, levels)


def _held(values: np.ndarray, value: float, count: int, beside: int, step: float) -> bool:
    """Whether an extreme is held: several samples on end, more than a rounded peak has."""
    if count < FEWEST or (step and count <= 4 * beside + 2):
        return False
    at = np.flatnonzero(values == value)
    together = np.flatnonzero(np.diff(at) == 1).size
    return together >= count / 2 and together >= FEWEST - 1


def _step(values: np.ndarray, known: np.ndarray) -> float:
    """The step of a channel whose values repeat and lie on a grid, else 0."""
    if known.size > 0.5 * values.size and known.size > 64:
        return 0.0
    gaps = np.diff(known)
    smallest = float(gaps[gaps > 1e-6 * np.ptp(values)].min(initial=np.inf))
    if not np.isfinite(smallest):
        return 0.0
    whole = gaps / smallest
    return smallest if bool(np.all(np.abs(whole - np.round(whole)) < 0.1)) else 0.0

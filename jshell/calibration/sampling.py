"""When a record was sampled: on an even grid, with samples missing, at stamps of few digits; and its noise.

Stamps in a file are rounded. Where every one of them lies on an even grid to the digits it
has, that grid is what was meant. Noise is taken from seven neighbours at a time: their sixth divided
difference, with weights of unit length, leaves of white noise its variance and of
a smooth motion next to nothing.

Symbols    t times   h step of the grid   w weights of seven samples, w_j ∝ 1/Π(t_j - t_k)
"""

from typing import NamedTuple

import numpy as np

NEGLIGIBLE = 1e-6  # of a step: a stamp as near to the grid as this is on it, whatever its digits
ROUNDED = 0.75  # of its last digit: by half of it rounding moves a stamp, the rest is left to the grid's fit
MOST_DIGITS = 12  # stamps of more digits than this are not rounded
RARE = 3  # steps that rounding makes longer or shorter must be at least so many: one alone is a pause
FEWEST = 16  # sixth differences
STRAY = 1.3  # windows that let a smooth motion through by more than this beside the best quarter hold a gap


class Sampling(NamedTuple):
    """The times of a record as a fit takes them.

    Attributes:
        times: (samples,) those given; where they are rounded the grid that was meant.
        even: Whether they are an even grid without gaps.
        rounding: What the stamps are rounded to; 0 where they are taken as given.
        missing: Samples of the grid that are not there.
    """

    times: np.ndarray
    even: bool
    rounding: float
    missing: int

    def words(self) -> str:
        """What was done, for a note; empty where the times are an even grid as they stand."""
        lost = f"{self.missing} samples of the grid are missing" if self.missing else ""
        if self.rounding:
            return f"stamps rounded to {self.rounding:.2g} are taken as the even grid they lie on" + (
                f"; {lost}" if lost else ""
            )
        return "" if self.even else lost or "times are uneven, and taken as given"


def sampling(times: np.ndarray) -> Sampling:
    """How a record was sampled.

    Args:
        times: (samples,) increasing.
    """
    t = np.asarray(times, dtype=float)
    steps = np.diff(t)
    if steps.size < 2 or not np.all(steps > 0):
        return Sampling(t, bool(steps.size), 0.0, 0)
    if np.all(np.abs(steps - steps.mean()) < 1e-9 * steps.mean()):
        return Sampling(t, True, 0.0, 0)

    # the number of each sample on the grid; a gap is a step of several
    typical = np.median(steps)
    for _ in range(2):
        whole = np.maximum(np.rint(steps / typical), 1.0)
        typical = float((t[-1] - t[0]) / whole.sum())
    number = np.append(0.0, np.cumsum(whole))
    middle, mean = number.mean(), t.mean()
    step = float((number - middle) @ (t - mean) / ((number - middle) @ (number - middle)))
    grid = mean + step * (number - middle)
    missing = int(number[-1]) + 1 - t.size
    off = float(np.max(np.abs(t - grid)))
    if off <= NEGLIGIBLE * step:
        return Sampling(grid, missing == 0, 0.0, missing)

    last = max(_last_digit(t), _two_lengths(steps[whole == 1]))
    if off <= ROUNDED * last and last < 0.5 * step:
        single = steps[whole == 1]
        usual = np.median(single)
        strange = min(int(np.sum(single < usual - 0.5 * last)) + int(np.sum(single > usual + 0.5 * last)), single.size)
        if strange >= RARE or off <= 1e-3 * step:
            return Sampling(grid, missing == 0, last, missing)
    return Sampling(t, False, 0.0, missing if off < 0.1 * step else 0)


def _last_digit(times: np.ndarray) -> float:
    """The last digit of the largest stamp, decimal or of single precision; 0 where stamps have more digits."""
    size = np.abs(times[times != 0])
    if not size.size:
        return 0.0
    unit = 10.0 ** (np.floor(np.log10(size) + 1e-12) + 1)
    # counted in their d-th digit, stamps of d digits are whole numbers
    for digits in range(1, MOST_DIGITS + 1):
        counted = size / unit * 10.0**digits
        if np.all(np.abs(counted - np.rint(counted)) < 1e-3):
            return float(unit.max() * 10.0**-digits)
    single = times.astype(np.float32)
    return float(np.spacing(np.abs(single).max())) if np.array_equal(single, times) else 0.0


def _two_lengths(steps: np.ndarray) -> float:
    """What the stamps were rounded to before their unit was changed: then steps are of two lengths, its multiples."""
    if not steps.size:
        return 0.0
    short, long = float(steps.min()), float(steps.max())
    last = long - short
    near = 1e-6 * last + 1e-12 * long
    if last <= 1e-9 * long or not np.all((steps - short < near) | (long - steps < near)):
        return 0.0
    return last if abs(short / last - np.rint(short / last)) < 1e-3 else 0.0


def noise_of(values: np.ndarray, times: np.ndarray | None = None) -> float:
    """Scatter of white noise on a smooth record, from its sixth differences.

    The motion hardly survives six differences where it is sampled ten times a
    period or more; coarser, this is an upper bound.

    Args:
        values: (samples,); NaN where a sample is left out.
        times: Their times; None is an even grid.
    """
    values = np.asarray(values, dtype=float)
    if times is None or sampling(times).even:
        differences = np.diff(values, 6)
        differences = differences[np.isfinite(differences)]
        if differences.size >= min(FEWEST, values.size - 6) and differences.size:
            return float(np.sqrt(np.mean(differences**2) / 924.0))  # 924 = (12 choose 6)
        times = np.arange(values.size, dtype=float) if times is None else times
    known = np.isfinite(values)
    return _uneven_noise(sampling(np.asarray(times, dtype=float)[known]).times, values[known])


def _uneven_noise(times: np.ndarray, values: np.ndarray) -> float:
    """The same from divided differences, each with weights of unit length; windows over a gap are left out."""
    count = values.size - 6
    if count < 1:
        return 0.0
    w, sign = np.empty((7, count)), np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    at = [times[j : j + count] for j in range(7)]
    scale = (at[6] - at[0]) / 6
    for j in range(7):
        apart = np.ones(count)
        for k in range(7):
            if k != j:
                apart = apart * np.abs(at[j] - at[k]) / scale
        w[j] = sign[j] / apart
    length = np.sqrt(np.sum(w**2, axis=0))
    through = scale**6 / length  # what a smooth motion of given sixth derivative leaves
    kept = through <= STRAY * np.quantile(through, 0.25)
    differences = sum(w[j] * values[j : j + count] for j in range(7)) / length
    return float(np.sqrt(np.mean(differences[kept] ** 2)))

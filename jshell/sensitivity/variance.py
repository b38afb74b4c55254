"""What a whole range does: Sobol indices of any number the short model gives.

Symbols    S_i first-order index: share of the variance that input i explains alone   T_i total index
Valid for  independent inputs, even in their range or in its logarithm
Source     Saltelli et al. 2010; estimators and bootstrap of `scipy.stats.sobol_indices`
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.errors import BadValue, choose
from jshell.oscillator.coefficients import Coefficients
from jshell.sensitivity.local import INPUTS, Observable, observable, point, problem
from jshell.shell.parameters import Reduced

MISSING = ("refuse", "drop")
SCALES = ("linear", "log")


@dataclass(frozen=True)
class Range:
    """Lowest and highest value of an input, and whether it is even in itself (`linear`) or in its `log`."""

    low: float | int
    high: float | int
    scale: str = "linear"

    def __post_init__(self) -> None:
        choose("scale", self.scale, SCALES)
        if not self.low < self.high or (self.scale == "log" and self.low <= 0):
            raise BadValue(
                "range",
                found=f"({self.low:g}, {self.high:g})",
                expected="low below high, and above 0 on a log scale",
                remedy="Check the order.",
            )

    def at(self, share: np.ndarray) -> np.ndarray:
        """Values at shares from 0 to 1."""
        if self.scale == "log":
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share


@dataclass(frozen=True)
class SobolIndices:
    """Shares of the variance.

    Attributes:
        name: Of the observable.
        inputs: Names of what was varied.
        first, total: (inputs,) indices.
        first_interval, total_interval: (inputs, 2) confidence intervals.
        confidence: Of the intervals.
        runs: How many were made.
        missing: How many gave no number.
        rows: Rows of the sampling plan that were used.
        variance: Of the observable.
    """

    name: str
    inputs: tuple[str, ...]
    first: np.ndarray
    total: np.ndarray
    first_interval: np.ndarray
    total_interval: np.ndarray
    confidence: float
    runs: int
    missing: int
    rows: int
    variance: float

    def record(self) -> dict[str, object]:
        """The numbers as one JSON object."""
        rows = zip(self.inputs, self.first, self.first_interval, self.total, self.total_interval, strict=True)
        return {
            "observable": self.name,
            "runs": self.runs,
            "missing": self.missing,
            "rows": self.rows,
            "confidence": self.confidence,
            "variance": self.variance,
            "inputs": {
                n: {"first": s, "first_interval": list(a), "total": t, "total_interval": list(b)}
                for n, s, a, t, b in rows
            },
        }


def plan(ranges: Mapping[str, Range], rows: int, seed: int) -> np.ndarray:
    """Saltelli's plan (inputs + 2, rows, inputs): A, B, and A with one column of B each, in the inputs' units."""
    count = len(ranges)
    from scipy import stats  # here: it is slow to load, and few need it

    draw = stats.qmc.Sobol(2 * count, seed=np.random.default_rng(seed))  # pyright: ignore[reportCallIssue]
    shares = draw.random(rows)
    A, B = shares[:, :count], shares[:, count:]
    mixed = [np.where(np.arange(count) == i, B, A) for i in range(count)]
    scale = lambda X: np.stack([one.at(X[:, i]) for i, one in enumerate(ranges.values())], axis=1)  # noqa: E731
    return np.stack([scale(X) for X in (A, B, *mixed)])


def sobol(
    which: str | Observable,
    ranges: Mapping[str, Range],
    conditions: Reduced,
    coefficients: Coefficients,
    *,
    rows: int = 1024,
    seed: int = 0,
    confidence: float = 0.95,
    missing: str = "refuse",
    at: Callable[[Reduced], Reduced] | None = None,
) -> SobolIndices:
    """First-order and total Sobol indices with confidence intervals.

    Args:
        which: A key of `OBSERVABLES`, or a function of conditions and coefficients.
        ranges: Name of each varied input (of `INPUTS`) to its range.
        conditions: The inputs that stay, and where the others are read from.
        coefficients: The same.
        rows: Of the sampling plan, a power of two; runs are rows × (inputs + 2).
        seed: Of the plan and of the bootstrap.
        confidence: Of the intervals.
        missing: What to do about runs that give no number: `refuse` raises with their count; `drop` leaves out
            every row that has one, keeps a power of two of the others, and says how many.
        at: Changes the conditions of every run, e.g. to load each shell at its own buckling threshold.

    Raises:
        BadName: No such input, observable or choice.
        BadValue: Rows that are not a power of two; runs without a number; an observable that does not vary.
    """
    name, function = observable(which)
    for key in ranges:
        choose("input", key, INPUTS)
    choose("missing", missing, MISSING, noun="choice")
    if rows < 2 or rows & (rows - 1) or not ranges or not 0 < confidence < 1:
        raise BadValue(
            "rows, ranges, confidence",
            found=f"{rows}, {len(ranges)} inputs, {confidence}",
            expected="a power of two, at least one input, a confidence between 0 and 1",
            remedy="Use 1024 rows and 0.95.",
        )
    inputs = plan(ranges, rows, seed)
    columns = np.array([INPUTS.index(key) for key in ranges])
    values = evaluate(function, inputs.reshape(-1, len(ranges)), columns, conditions, coefficients, at)
    return indices(name, tuple(ranges), values.reshape(inputs.shape[:2]), seed, confidence, missing)


def evaluate(
    function: Observable,
    inputs: np.ndarray,
    columns: np.ndarray,
    conditions: Reduced,
    coefficients: Coefficients,
    at: Callable[[Reduced], Reduced] | None = None,
) -> np.ndarray:
    """The observable at many inputs, (runs, inputs), in one compiled batch."""
    found = _many(
        function, at, jnp.asarray(inputs), jnp.asarray(columns), point(conditions, coefficients), coefficients
    )
    return np.asarray(found)


@eqx.filter_jit
def _many(function: Observable, at: Any, inputs: Any, columns: Any, base: Any, like: Coefficients) -> jax.Array:
    def one(row: jax.Array) -> jax.Array:
        shell, constants = problem(base.at[columns].set(row), like)
        return jnp.asarray(function(shell if at is None else at(shell), constants))

    return jax.vmap(one)(inputs)


def indices(
    name: str, inputs: tuple[str, ...], values: np.ndarray, seed: int, confidence: float, missing: str
) -> SobolIndices:
    """Indices from the observable on a plan, (inputs + 2, rows).

    Raises:
        BadValue: Runs without a number (unless dropped), or an observable that does not vary.
    """
    absent = ~np.isfinite(values)
    count = int(absent.sum())
    if count and missing == "refuse":
        raise BadValue(
            name,
            found=f"{count} of {values.size} runs without a number",
            expected="a number from every run",
            remedy='Narrow the ranges, or use missing="drop" to leave out their rows.',
        )
    kept = np.array(values[:, ~absent.any(axis=0)])  # a copy of its own: SciPy changes what it is given
    if kept.shape[1] < 32 or np.ptp(kept) == 0:
        raise BadValue(
            name,
            found=f"{kept.shape[1]} usable rows",
            expected="at least 32, and an observable that varies",
            remedy="Use more rows, or other ranges.",
        )
    kept = kept[:, : 2 ** int(np.log2(kept.shape[1]))]  # SciPy takes powers of two only
    f_A, f_B, f_AB = kept[0], kept[1], kept[2:]
    if len(inputs) == 1:  # of a single input SciPy makes a scalar, which its bootstrap cannot carry
        f_AB = np.repeat(f_AB, 2, axis=0)
    variance = float(np.var(np.concatenate([f_A, f_B])))
    from scipy import stats

    found = stats.sobol_indices(
        func={"f_A": f_A[None].copy(), "f_B": f_B[None].copy(), "f_AB": f_AB[:, None].copy()}, n=f_A.size
    )
    spread = found.bootstrap(confidence_level=confidence, n_resamples=999)

    def interval(part: Any, value: np.ndarray) -> np.ndarray:
        ends = np.stack([np.ravel(part.confidence_interval.low), np.ravel(part.confidence_interval.high)], axis=1)
        # an input without influence gives the same index in every resample, of which SciPy makes no interval
        return np.where(np.isfinite(ends), ends, np.ravel(value)[:, None])

    count_in = len(inputs)
    return SobolIndices(
        name,
        inputs,
        np.ravel(found.first_order)[:count_in],
        np.ravel(found.total_order)[:count_in],
        interval(spread.first_order, found.first_order)[:count_in],
        interval(spread.total_order, found.total_order)[:count_in],
        confidence,
        values.size,
        count,
        f_A.size,
        variance,
    )

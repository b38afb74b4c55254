"""One parameter of a fit with its error, and how one start ended."""

from dataclasses import dataclass

import numpy as np

from jshell.calibration.least_squares import SolverResult
from jshell.errors import Outcome


@dataclass(frozen=True)
class Estimate:
    """One parameter or derived number.

    Attributes:
        name: Its key.
        value: Its value.
        stderr: Standard error; NaN where there is none.
        reason: Why the error is missing.
        start: Value of the best start; NaN where it needs none.
        role: `constant`, `fixed`, `tied` (a function of others), `nuisance` (belongs to one trace) or `derived`.
    """

    name: str
    value: float
    stderr: float = float("nan")
    reason: str = ""
    start: float = float("nan")
    role: str = "constant"

    def line(self, width: int) -> str:
        """`name: value ± error (percent) (start = …)`."""
        head = f"{self.name + ':':{width + 1}} {self.value: .7g}"
        if self.role == "fixed":
            return f"{head} (fixed)"
        tied = " (tied)" if self.role == "tied" else ""
        if np.isfinite(self.stderr):
            percent = f" ({abs(100 * self.stderr / self.value):.2f}%)" if self.value else ""
            head += f" ± {self.stderr:.4g}{percent}"
        else:
            head += f" (no error: {self.reason or 'not asked for'})"
        return head + tied + (f" (start = {self.start:.5g})" if np.isfinite(self.start) else "")


@dataclass(frozen=True)
class Start:
    """How one start ended."""

    values: tuple[float, ...]
    cost: float
    outcome: Outcome
    steps: int
    agrees: bool


def starts_of(ending: SolverResult, natural: np.ndarray, same: np.ndarray) -> tuple[Start, ...]:
    """How every start ended.

    Args:
        ending: Of the solver.
        natural: (starts, parameters) where each began.
        same: Which ended in the best minimum.
    """
    cost, outcome, steps = (np.asarray(x) for x in (ending.cost, ending.outcome, ending.steps))
    return tuple(
        Start(
            tuple(float(x) for x in values),
            float(cost[i]),
            Outcome(int(outcome[i])),
            int(steps[i]),
            bool(same[i]),
        )
        for i, values in enumerate(natural)
    )

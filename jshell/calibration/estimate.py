"""The parameters of a fit with their errors, and how one start ended."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from jshell.calibration.least_squares import SolverResult
from jshell.calibration.uncertainty import MOST_PERCENT
from jshell.errors import Outcome, choose, require_extra

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Estimate:
    """One parameter or derived number.

    Attributes:
        name: Its key.
        value: Its value; NaN where the data do not determine it.
        stderr: Standard error; NaN where there is none.
        reason: Why the error, or the value, is missing.
        start: Value of the best start; NaN where it needs none.
        role: `constant`, `fixed`, `tied` (a function of others), `nuisance` (belongs to one trace) or `derived`.
    """

    name: str
    value: float
    stderr: float = float("nan")
    reason: str = ""
    start: float = float("nan")
    role: str = "constant"

    @property
    def undetermined(self) -> bool:
        """Whether the data do not determine it: its value is NaN, and `reason` says why."""
        return not np.isfinite(self.value)

    @property
    def percent(self) -> float | None:
        """The error in percent of the value; None where there is none, and where the value may be 0 for all it says."""
        if not (np.isfinite(self.stderr) and np.isfinite(self.value)):
            return None
        share = 100 * abs(self.stderr) / max(abs(self.value), 1e-300)
        return share if share < MOST_PERCENT else None

    def line(self, width: int) -> str:
        """`name: value ± error (percent) (start = …)`."""
        if self.undetermined:
            return f"{self.name + ':':{width + 1}}  undetermined" + (f" ({self.reason})" if self.reason else "")
        head = f"{self.name + ':':{width + 1}} {self.value: .7g}"
        if self.role == "fixed":
            return f"{head} (fixed)"
        tied = " (tied)" if self.role == "tied" else ""
        if np.isfinite(self.stderr):
            percent = "" if self.percent is None else f" ({self.percent:.2f}%)"
            head += f" ± {self.stderr:.4g}{percent}"
        else:
            head += f" (no error: {self.reason or 'not asked for'})"
        return head + tied + (f" (start = {self.start:.5g})" if np.isfinite(self.start) else "")


class ParameterTable(dict[str, Estimate]):
    """Estimates by name, in a report's order; it prints as the report does."""

    def __init__(self, estimates: Iterable[Estimate]) -> None:
        super().__init__((one.name, one) for one in estimates)

    def __missing__(self, name: str) -> Estimate:
        return choose("parameter", name, self)

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def lines(self, *, nuisance: bool = False) -> list[str]:
        """A line for each estimate; those that belong to single traces are counted only, unless asked for."""
        shown = [one for one in self.values() if nuisance or one.role != "nuisance"]
        width = max((len(one.name) for one in shown), default=0)
        rest = len(self) - len(shown)
        return [*(one.line(width) for one in shown), *([f"({rest} more belong to single traces)"] if rest else [])]

    def to_dataframe(self) -> "pandas.DataFrame":
        """The table for pandas: a row for each estimate, its fields as columns.

        Raises:
            MissingExtra: Without pandas, which the extra `io` brings.
        """
        pandas = require_extra("pandas", "io", "to_dataframe")
        return pandas.DataFrame([asdict(one) for one in self.values()]).set_index("name")


@dataclass(frozen=True)
class Start:
    """How one start ended."""

    values: tuple[float, ...]
    cost: float
    outcome: Outcome
    steps: int
    agrees: bool


def starts_of(solution: SolverResult, constrained: np.ndarray, same: np.ndarray) -> tuple[Start, ...]:
    """How every start ended.

    Args:
        solution: Of the solver.
        constrained: (starts, parameters) where each began.
        same: Which ended in the best minimum.
    """
    cost, outcome, steps = (np.asarray(x) for x in (solution.cost, solution.outcome, solution.steps))
    return tuple(
        Start(
            tuple(float(x) for x in values),
            float(cost[i]),
            Outcome(int(outcome[i])),
            int(steps[i]),
            bool(same[i]),
        )
        for i, values in enumerate(constrained)
    )

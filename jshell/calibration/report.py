"""What a fit found, and how to read it.

Statistics are defined as lmfit defines them, so that either report can be
held against the other.

Symbols    χ² sum of squared weighted residuals   N data   k varied parameters
           AIC = N ln(χ²/N) + 2k   BIC = N ln(χ²/N) + k ln N
"""

import html
from dataclasses import dataclass, field

import numpy as np

from jshell.calibration.least_squares import Ending
from jshell.errors import BadName, NotOk, Outcome
from jshell.oscillator.coefficients import Coefficients


class FitWarning(UserWarning):
    """A fit that ended, with something a reader must know."""


@dataclass(frozen=True)
class Estimate:
    """One parameter or derived number.

    Attributes:
        name: Its key.
        value: Its value.
        stderr: Standard error; NaN where there is none.
        reason: Why the error is missing.
        start: Value of the best start; NaN where it needs none.
        role: `constant`, `fixed`, `nuisance` (belongs to one trace) or `derived`.
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
        if np.isfinite(self.stderr):
            percent = f" ({abs(100 * self.stderr / self.value):.2f}%)" if self.value else ""
            head += f" ± {self.stderr:.4g}{percent}"
        else:
            head += f" (no error: {self.reason or 'not asked for'})"
        return head + (f" (start = {self.start:.5g})" if np.isfinite(self.start) else "")


@dataclass(frozen=True)
class Start:
    """How one start ended."""

    values: tuple[float, ...]
    cost: float
    outcome: Outcome
    steps: int
    agrees: bool


def starts_of(ending: Ending, natural: np.ndarray, same: np.ndarray) -> tuple[Start, ...]:
    """How every start ended.

    Args:
        ending: Of the solver.
        natural: (starts, parameters) where each began.
        same: Which ended in the best minimum.
    """
    return tuple(
        Start(
            tuple(float(x) for x in values),
            float(ending.cost[i]),
            Outcome(int(ending.outcome[i])),
            int(ending.steps[i]),
            bool(same[i]),
        )
        for i, values in enumerate(natural)
    )


@dataclass(frozen=True)
class FitResult:
    """What a fit found.

    Attributes:
        title: What was fitted, by what.
        outcome: How it ended.
        estimates: Constants, fixed ones, and what belongs to single traces.
        derived: Numbers that follow from the constants.
        covariance: Of the varied constants, in the order of `varied`.
        correlation: The same, as correlations.
        varied: Names of the varied constants.
        residual: Weighted residual.
        chi_square: Its sum of squares.
        n_data: Number of data.
        n_varied: Number of varied parameters, those of single traces included.
        absolute: Errors come from given standard errors of the data; else they are scaled by the reduced χ².
        free_directions: Combinations the data leave free, in words.
        starts: How each start ended.
        notes: What the reader should know of the method.
        warnings: What the reader must know.
        dipole: Convention of beta2.
    """

    title: str
    outcome: Outcome
    estimates: tuple[Estimate, ...]
    derived: tuple[Estimate, ...]
    covariance: np.ndarray
    correlation: np.ndarray
    varied: tuple[str, ...]
    residual: np.ndarray
    chi_square: float
    n_data: int
    n_varied: int
    absolute: bool
    free_directions: tuple[str, ...] = ()
    starts: tuple[Start, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    dipole: str = "corrected"
    statistics: tuple[tuple[str, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        logarithm = self.n_data * np.log(max(self.chi_square, 1e-250 * self.n_data) / self.n_data)
        values = (
            ("chi_square", self.chi_square),
            ("reduced_chi_square", self.chi_square / max(1, self.n_data - self.n_varied)),
            ("aic", float(logarithm + 2 * self.n_varied)),
            ("bic", float(logarithm + np.log(self.n_data) * self.n_varied)),
        )
        object.__setattr__(self, "statistics", values)

    def __getitem__(self, name: str) -> Estimate:
        known = {estimate.name: estimate for estimate in (*self.estimates, *self.derived)}
        if name not in known:
            raise BadName(
                f"parameter {name!r}", found="no such parameter", expected=", ".join(known), remedy="Choose one."
            )
        return known[name]

    @property
    def reduced_chi_square(self) -> float:
        return self.statistics[1][1]

    @property
    def aic(self) -> float:
        return self.statistics[2][1]

    @property
    def bic(self) -> float:
        return self.statistics[3][1]

    @property
    def coefficients(self) -> Coefficients:
        """The constants found, for the oscillator; undamped where the fit held no damping factor."""
        found = {estimate.name: estimate.value for estimate in self.estimates}
        return Coefficients(
            found["alpha1"], found["alpha2"], found["k_vs"], found.get("beta1", 0.0), found.get("beta2"), self.dipole
        )

    def require_ok(self) -> "FitResult":
        """The same result, or `NotOk`."""
        if self.outcome != Outcome.OK:
            raise NotOk(self.title, self.outcome)
        return self

    def record(self) -> dict:
        """The result as a JSON object; missing numbers are null."""
        number = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731

        def row(e: Estimate) -> dict:
            return {
                "name": e.name,
                "value": number(e.value),
                "stderr": number(e.stderr),
                "reason": e.reason,
                "start": number(e.start),
                "role": e.role,
            }

        return {
            "title": self.title,
            "outcome": self.outcome.word,
            "estimates": [row(e) for e in self.estimates],
            "derived": [row(e) for e in self.derived],
            "varied": list(self.varied),
            "correlation": [[number(x) for x in line] for line in self.correlation],
            "covariance": [[number(x) for x in line] for line in self.covariance],
            **{name: number(value) for name, value in self.statistics},
            "n_data": self.n_data,
            "n_varied": self.n_varied,
            "errors": "absolute" if self.absolute else "scaled",
            "dipole": self.dipole,
            "free_directions": list(self.free_directions),
            "starts": [
                {
                    "values": [number(x) for x in start.values],
                    "cost": number(start.cost),
                    "outcome": start.outcome.word,
                    "steps": start.steps,
                    "agrees": start.agrees,
                }
                for start in self.starts
            ],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def report(self, *, nuisance: bool = False, smallest_correlation: float = 0.1) -> str:
        """The result as text.

        Args:
            nuisance: Also list what belongs to single traces.
            smallest_correlation: Correlations below are not listed.
        """
        scaled = "given σ, absolute" if self.absolute else "no σ given, scaled by reduced χ²"
        lines = [
            f"[[{self.title}]]",
            f"    outcome             {self.outcome.word}: {self.outcome.advice}",
            "[[Fit statistics]]",
            f"    data                {self.n_data}",
            f"    varied              {self.n_varied} ({len(self.varied)} constants)",
            *(f"    {name.replace('_', ' '):19} {value:.8g}" for name, value in self.statistics),
            f"    errors              {scaled}",
        ]
        hidden = 0 if nuisance else sum(e.role == "nuisance" for e in self.estimates)
        shown = [e for e in self.estimates if nuisance or e.role != "nuisance"]
        lines += ["[[Constants]]", *_table(shown)]
        if hidden:
            lines.append(f"    ({hidden} more belong to single traces)")
        if self.derived:
            lines += ["[[Derived]]", *_table(list(self.derived))]
        pairs = self._pairs(smallest_correlation)
        if pairs:
            lines += [f"[[Correlations]] (below {smallest_correlation:g} not listed)", *pairs]
        if self.starts:
            agree = sum(start.agrees for start in self.starts)
            lines += ["[[Starts]]", f"    {agree} of {len(self.starts)} ended in the same minimum"]
        for title, texts in (
            ("Free directions", self.free_directions),
            ("Notes", self.notes),
            ("Warnings", self.warnings),
        ):
            if texts:
                lines += [f"[[{title}]]", *(f"    {text}" for text in texts)]
        return "\n".join(lines)

    def _pairs(self, smallest: float) -> list[str]:
        found = []
        for i, one in enumerate(self.varied):
            for j in range(i):
                value = self.correlation[i, j]
                if np.isfinite(value) and abs(value) >= smallest:
                    found.append((abs(value), f"    C({self.varied[j]}, {one}) = {value:+.4f}"))
        return [text for _, text in sorted(found, reverse=True)]

    def __str__(self) -> str:
        return self.report()

    def _repr_html_(self) -> str:
        """The report for notebooks."""
        cells = "".join(
            f"<tr><td>{html.escape(e.name)}</td><td>{e.value:.7g}</td><td>{_error(e)}</td>"
            f"<td>{'' if np.isnan(e.start) else f'{e.start:.5g}'}</td></tr>"
            for e in (*self.estimates, *self.derived)
            if e.role != "nuisance"
        )
        numbers = "".join(f"<tr><td>{k.replace('_', ' ')}</td><td>{v:.8g}</td></tr>" for k, v in self.statistics)
        texts = "".join(
            f"<li>{html.escape(text)}</li>" for text in (*self.free_directions, *self.notes, *self.warnings)
        )
        pairs = "".join(f"<li>{html.escape(text.strip())}</li>" for text in self._pairs(0.1))
        return (
            f"<h4>{html.escape(self.title)}</h4><p>{self.outcome.word}: {html.escape(self.outcome.advice)}</p>"
            f"<table><tr><th>name</th><th>value</th><th>error</th><th>start</th></tr>{cells}</table>"
            f"<table><tr><td>data</td><td>{self.n_data}</td></tr><tr><td>varied</td><td>{self.n_varied}</td></tr>"
            f"{numbers}</table><ul>{pairs}</ul><ul>{texts}</ul>"
        )


def _error(estimate: Estimate) -> str:
    if estimate.role == "fixed":
        return "fixed"
    if np.isfinite(estimate.stderr):
        return f"± {estimate.stderr:.4g} ({abs(100 * estimate.stderr / estimate.value):.2f}%)" if estimate.value else ""
    return html.escape(f"none: {estimate.reason or 'not asked for'}")


def _table(estimates: list[Estimate]) -> list[str]:
    width = max((len(e.name) for e in estimates), default=0)
    return [f"    {e.line(width)}" for e in estimates]

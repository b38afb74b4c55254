"""What a fit found, and how to read it.

Statistics are defined as lmfit defines them, so that either report can be
held against the other.

Symbols    χ² sum of squared weighted residuals   N data   k varied parameters
           AIC = N ln(χ²/N) + 2k   BIC = N ln(χ²/N) + k ln N
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.special

from jshell.calibration.estimate import Estimate, Start
from jshell.calibration.noise import Noise
from jshell.calibration.objective import Objective
from jshell.calibration.specification import Specification
from jshell.display import ended, number, readable, shown
from jshell.errors import BadName, BadValue, NotOk, Outcome
from jshell.oscillator.coefficients import Coefficients
from jshell.trace import Trace

if TYPE_CHECKING:
    from jshell.calibration.posterior import Posterior
    from jshell.calibration.profile import Profile
    from jshell.calibration.refits import Refits


class FitWarning(UserWarning):
    """A fit that ended, with something a reader must know."""


@dataclass(frozen=True, eq=False)
class FitResult:
    """What a fit found.

    Two results are equal where their records are, to the bit.

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
        noise: What was left of every channel of every trace, tested.
        traces: The traces that were fitted, inside their windows.
        table: The columns of frequencies that were fitted.
        specification: What was asked.
        versions: Of jshell and of what it stands on.
        objective: What was minimised, for profiles and the like; a result read from a file has none.
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
    noise: tuple[Noise, ...] = ()
    traces: tuple[Trace, ...] = ()
    table: Mapping[str, np.ndarray] = field(default_factory=dict)
    specification: Specification | None = None
    versions: tuple[tuple[str, str], ...] = ()
    objective: Objective | None = field(default=None, repr=False)
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

    @readable
    def __repr__(self) -> str:
        plain = [one for one in self.estimates if "[" not in one.name]
        values = [f"{one.name} {number(one.value)} ± {number(one.stderr)}" for one in plain]
        return shown(
            self, self.title, *values, f"reduced χ² {number(self.reduced_chi_square)}", f"{self.n_data} data",
            f"{len(self.warnings)} warnings" if self.warnings else "", ended(self.outcome),
        )  # fmt: skip

    def __getitem__(self, name: str) -> Estimate:
        known = {estimate.name: estimate for estimate in (*self.estimates, *self.derived)}
        if name not in known:
            raise BadName(
                f"parameter {name!r}", found="no such parameter", expected=", ".join(known), remedy="Choose one."
            )
        return known[name]

    def interval(self, name: str, level: float | int = 0.95) -> tuple[float, float]:
        """Value ± error times Student's factor; where noise remembers, for the samples of white noise it is worth.

        Args:
            name: Of an estimate.
            level: Of confidence.

        Returns:
            NaN, NaN where there is no error. Parabolic: for asymmetric intervals see `profile`.
        """
        factor = float(scipy.special.stdtrit(self.freedom, (1 + level) / 2))
        return self[name].value - factor * self[name].stderr, self[name].value + factor * self[name].stderr

    @property
    def freedom(self) -> float:
        """Degrees of freedom: data, or what they are worth in white noise, less parameters; at least 4."""
        worth = sum(one.effective for one in self.noise) if self.noise else self.n_data
        return float(max(4.0, worth - self.n_varied))

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

    def __eq__(self, other: object) -> bool:
        from jshell.calibration.stored import stored

        return isinstance(other, FitResult) and stored(self) == stored(other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def save(self, path: str | Path) -> Path:
        """Write the result, its data and what was asked as one JSON file; `jshell.load` reads it.

        Raises:
            BadFile: Nothing can be written there.
        """
        from jshell.calibration.stored import save

        return save(self, path)

    def to_netcdf(self, path: str | Path) -> Path:
        """Export the result as NetCDF groups, for xarray.

        Raises:
            MissingExtra: Without the extra `io`.
        """
        from jshell.calibration.stored import export

        return export(self, path)

    def profile(self, names: "tuple[str, ...] | list[str] | None" = None, *, level: float | int = 0.95) -> "Profile":
        """Asymmetric intervals by profile likelihood; see `jshell.calibration.profile`."""
        from jshell.calibration.profile import profile

        return profile(self, names, level=level)

    def bootstrap(self, count: int = 500, *, seed: int = 0, kind: str = "auto") -> "Refits":
        """Refits of data drawn again; see `jshell.calibration.refits.bootstrap`."""
        from jshell.calibration.refits import bootstrap

        return bootstrap(self, count, seed=seed, kind=kind)

    def posterior(self, draws: int = 1000, *, warmup: int = 500, chains: int = 2, seed: int = 0) -> "Posterior":
        """Draws from the posterior by NUTS; see `jshell.calibration.posterior`."""
        from jshell.calibration.posterior import posterior

        return posterior(self, draws, warmup=warmup, chains=chains, seed=seed)

    def to_lmfit(self):
        """The same problem for lmfit: a Minimizer whose parameters start at this minimum."""
        from jshell.calibration.bridges import to_lmfit

        return to_lmfit(self)

    def to_minuit(self):
        """The same problem for iminuit: a Minuit at this minimum, with gradient."""
        from jshell.calibration.bridges import to_minuit

        return to_minuit(self)

    def asked(self) -> Objective:
        """What was minimised.

        Raises:
            BadValue: The result was read from a file, which holds no program: fit again.
        """
        if self.objective is None:
            raise BadValue(
                "result",
                found="no objective: the result was read from a file",
                expected="a result of a fit in this process",
                remedy="Fit result.traces again with the options in result.specification.",
            )
        return self.objective

    def require_ok(self) -> "FitResult":
        """The same result, or `NotOk`."""
        if self.outcome != Outcome.OK:
            raise NotOk(self.title, self.outcome)
        return self

    def record(self) -> dict:
        """The result as a JSON object; missing numbers are null."""
        from jshell.calibration.pages import record

        return record(self)

    def report(self, *, nuisance: bool = False, smallest_correlation: float = 0.1) -> str:
        """The result as text.

        Args:
            nuisance: Also list what belongs to single traces.
            smallest_correlation: Correlations below are not listed.
        """
        from jshell.calibration.pages import text

        return text(self, nuisance=nuisance, smallest_correlation=smallest_correlation)

    def __str__(self) -> str:
        return self.report()

    def _repr_html_(self) -> str:
        """The report for notebooks."""
        from jshell.calibration.pages import page

        return page(self)

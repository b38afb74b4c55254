"""What a fit found, as plain data: numbers, words, the traces and what was minimised.

Statistics are defined as lmfit defines them, so that either report can be
held against the other.

Symbols    χ² sum of squared weighted residuals   N data   k varied parameters
           AIC = N ln(χ²/N) + 2k   BIC = N ln(χ²/N) + k ln N
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.special

from jshell.calibration.estimate import Estimate, ParameterTable, Start
from jshell.calibration.noise import Noise
from jshell.calibration.objective import Objective
from jshell.calibration.options import FitOptions
from jshell.calibration.uncertainty import information
from jshell.errors import Outcome
from jshell.oscillator.coefficients import Coefficients
from jshell.trace import Trace

_AT_REST = " at rest [1]"  # every channel of the first trace has one such estimate


class FitWarning(UserWarning):
    """A fit that ended, with something a reader must know."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What a fit found, as plain data.

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
        minimum: All parameters at the minimum as the model sees them, those that are undetermined among them; empty
            where every one is determined.
        minimised: What was minimised, once it is at hand; `objective` builds it anew where it is not.
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
    specification: FitOptions | None = None
    versions: tuple[tuple[str, str], ...] = ()
    minimum: tuple[float, ...] = ()
    minimised: Objective | None = field(default=None, repr=False)
    statistics: tuple[tuple[str, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        aic, bic = information(self.chi_square, self.n_data, self.n_varied)
        values = (
            ("chi_square", self.chi_square),
            ("reduced_chi_square", self.chi_square / max(1, self.n_data - self.n_varied)),
            ("aic", aic),
            ("bic", bic),
        )
        object.__setattr__(self, "statistics", values)

    def __getitem__(self, name: str) -> Estimate:
        return self.params[name]

    def interval(self, name: str, level: float | int = 0.95) -> tuple[float, float]:
        """Value ± error times Student's factor, that of the white noise which autocorrelated noise is worth.

        Args:
            name: Of an estimate.
            level: Of confidence.

        Returns:
            NaN, NaN where there is no error. Parabolic: for asymmetric intervals see `profile`.
        """
        factor = float(scipy.special.stdtrit(self.freedom, (1 + level) / 2))
        return self[name].value - factor * self[name].stderr, self[name].value + factor * self[name].stderr

    @property
    def params(self) -> ParameterTable:
        """All estimates and derived numbers by name, as a table: `fit[name]` is `fit.params[name]`."""
        return ParameterTable((*self.estimates, *self.derived))

    @property
    def advice(self) -> str:
        """What to do about the outcome."""
        return self.outcome.advice

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of a trace fit, in the order of its residual; none where a table was fitted."""
        return tuple(one.name.removesuffix(_AT_REST) for one in self.estimates if one.name.endswith(_AT_REST))

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

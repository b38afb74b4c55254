"""How the constants of a master curve scatter when its shells are drawn again: the bootstrap.

No error bars of the data are needed, and no symmetry of the scatter is assumed.

Source     Efron 1979
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jshell.calibration.frequency_model import NAMES
from jshell.calibration.frequency_table import prepare
from jshell.calibration.master_curve import fit_frequencies
from jshell.calibration.report import FitResult
from jshell.calibration.resampling import resample
from jshell.calibration.uncertainty import equal_tails


@dataclass(frozen=True)
class Bootstrap:
    """Constants of every resample.

    Attributes:
        values: (resamples, 3) alpha1, alpha2, k_vs; NaN where the resample determines none.
        outcome: (resamples,) integers of `Outcome`: ok, at_bound, not_converged, rank_deficient.
        whole: The fit of the table itself.
    """

    values: np.ndarray
    outcome: np.ndarray
    whole: FitResult

    def __getitem__(self, name: str) -> np.ndarray:
        """A constant's values over the resamples that gave one."""
        found = self.values[:, NAMES.index(name)]
        return found[np.isfinite(found)]

    def interval(self, name: str, level: float = 0.68) -> tuple[float, float]:
        """Quantiles that enclose `level` of the resamples."""
        return equal_tails(self[name], level)


def bootstrap_frequencies(
    table: Mapping[str, object],
    weighting: str = "V_e omega",
    *,
    resamples: int = 10_000,
    fix: Mapping[str, float] | None = None,
    seed: int = 0,
) -> Bootstrap:
    """Fit a master curve to many resamples of its shells.

    Args:
        table: As for `fit_frequencies`.
        weighting: As for `fit_frequencies`.
        resamples: How many.
        fix: Values of constants not to be fitted.
        seed: Of the draws.

    Returns:
        Constants of every resample; one that holds a single shell, or ends nowhere, is NaN with its outcome.

    Raises:
        BadValue: Fewer than two shells, or no resamples; what `fit_frequencies` refuses.

    Example:
        >>> import numpy as np
        >>> from jshell.calibration import bootstrap_frequencies
        >>> table = {"V_e": np.array([2.9, 3.1, 2.5, 3.3]), "P_e": np.array([1.5, 0.6, 2.4, 1.0]),
        ...          "omega_minus": np.array([0.99, 0.62, 1.29, 0.78]), "omega_plus": np.array([1.65, 1.4, 2.1, 1.39])}
        >>> scatter = bootstrap_frequencies(table, resamples=200)
        >>> low, high = scatter.interval("alpha1")
        >>> low < scatter.whole["alpha1"].value < high
        True
    """
    whole = fit_frequencies(table, weighting, fix=fix)
    values, outcome = resample(prepare(table).rows, whole, weighting, tuple(fix or ()), resamples, seed)
    return Bootstrap(values, outcome, whole)

"""The result of a fit with all that can be done with it: told, drawn up, kept, walked around."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jshell.calibration.objective import Objective
from jshell.calibration.result import Fit, FitWarning
from jshell.display import ended, number, readable, shown
from jshell.errors import NotOk, Outcome
from jshell.renamed import renamed_attribute

if TYPE_CHECKING:
    from jshell.calibration.posterior import Posterior
    from jshell.calibration.profile import Profile
    from jshell.calibration.refits import Refits

__all__ = ["FitResult", "FitWarning"]


@dataclass(frozen=True, eq=False)
class FitResult(Fit):
    """What a fit found.

    Two results are equal where their records are, to the bit.
    """

    @readable
    def __repr__(self) -> str:
        plain = [one for one in self.estimates if "[" not in one.name]
        values = [
            f"{one.name} undetermined" if one.undetermined else f"{one.name} {number(one.value)} ± {number(one.stderr)}"
            for one in plain
        ]
        return shown(
            self, self.title, *values, f"reduced χ² {number(self.reduced_chi_square)}", f"{self.n_data} data",
            f"{len(self.warnings)} warnings" if self.warnings else "", ended(self.outcome),
        )  # fmt: skip

    def __eq__(self, other: object) -> bool:
        from jshell.calibration.serialization import serialized

        return isinstance(other, FitResult) and serialized(self) == serialized(other)

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def save(self, path: str | Path) -> Path:
        """Write the result, its data and what was asked as one JSON file; `jshell.load` reads it.

        Raises:
            BadFile: Nothing can be written there.
        """
        from jshell.calibration.serialization import save

        return save(self, path)

    def to_netcdf(self, path: str | Path) -> Path:
        """Export the result as NetCDF groups, for xarray.

        Raises:
            MissingExtra: Without the extra `io`.
        """
        from jshell.calibration.serialization import export

        return export(self, path)

    def curves(self) -> "tuple[dict[str, np.ndarray], ...]":
        """Per trace, channel to the fitted curve (times,); NaN where a sample was left out.

        Raises:
            BadShape: A table was fitted.
        """
        from jshell.calibration.curves import fitted_curves

        return fitted_curves(self)

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
        from jshell.calibration.interop import to_lmfit

        return to_lmfit(self)

    def to_minuit(self):
        """The same problem for iminuit: a Minuit at this minimum, with gradient."""
        from jshell.calibration.interop import to_minuit

        return to_minuit(self)

    def record(self) -> dict:
        """The result as a JSON object; missing numbers are null."""
        from jshell.calibration.rendering import record

        return record(self)

    def report(self, *, nuisance: bool = False, smallest_correlation: float = 0.1) -> str:
        """The result as text.

        Args:
            nuisance: Also list what belongs to single traces.
            smallest_correlation: Correlations below are not listed.
        """
        from jshell.calibration.rendering import text

        return text(self, nuisance=nuisance, smallest_correlation=smallest_correlation)

    def __str__(self) -> str:
        return self.report()

    def _repr_html_(self) -> str:
        """The report for notebooks."""
        from jshell.calibration.rendering import page

        return page(self)

    def objective(self) -> Objective:
        """What was minimised; of a result that was read from a file built anew, of its data and its options.

        Raises:
            BadValue: A file without data or options, or with a tie that was a function.
        """
        from jshell.calibration.rebuilt import objective_of

        return objective_of(self)

    asked = renamed_attribute("asked", "objective")

    def require_ok(self) -> "FitResult":
        """The same result, or `NotOk`."""
        if self.outcome != Outcome.OK:
            raise NotOk(self.title, self.outcome)
        return self

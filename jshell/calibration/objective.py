"""What a fit minimised, kept so that others can walk around its minimum.

Profiles, bootstraps, posteriors and other minimisers need the same residual,
the same parameters and the same scale as the fit; they find them here.

Symbols    u unknowns as the solver sees them   r weighted residual, linear parameters eliminated
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration import problem as problems
from jshell.calibration.least_squares import SolverResult, from_many_starts, value_and_jacobian
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem


class Objective(eqx.Module):
    """A sum of squares and its minimum.

    Attributes:
        residual: Function of the unknowns and `args`, at module level; the last `priors` rows are of priors.
        args: Parameters and data.
        parameters: The parameters.
        values: (names,) at the minimum.
        absolute: Whether the weights are known errors.
        count: Number of data.
        linear: Number of linear parameters that the residual eliminates.
        priors: Number of rows that priors add.
        loss: The robust loss, or nothing.
        share: Per record, (channels, times) roots of how much that loss lets each sample count.
    """

    residual: Callable = eqx.field(static=True)
    args: Any
    parameters: Unknowns
    values: np.ndarray
    absolute: bool = eqx.field(static=True)
    count: int = eqx.field(static=True)
    linear: int = eqx.field(static=True, default=0)
    priors: int = eqx.field(static=True, default=0)
    loss: str = eqx.field(static=True, default="")
    share: tuple[np.ndarray, ...] | None = None

    @staticmethod
    def of_traces(
        problem: Problem,
        parameters: Unknowns,
        values: np.ndarray,
        absolute: bool,
        loss: str = "",
        share: tuple[np.ndarray, ...] | None = None,
    ) -> "Objective":
        """That of a trace fit."""
        records = problem.model.records
        count = int(sum(np.sum(np.asarray(one.weight) > 0) for one in records))
        strict = problem.model.loss == "strict"
        linear = sum(6 if strict else 5 * len(one.channels) for one in records)
        return Objective(
            problems.residual,
            (parameters, problem),
            parameters,
            values,
            absolute,
            count,
            linear,
            len(problem.prior_at),
            loss,
            share,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The free parameters as a report names them."""
        return self.parameters.free

    @property
    def best(self) -> np.ndarray:
        """(free,) the minimum, as the solver sees it."""
        return self.parameters.unconstrained(np.asarray(self.values)[None])[0]

    @property
    def freedom(self) -> int:
        """Data less parameters."""
        return max(1, self.count - len(self.parameters.free) - self.linear)

    @property
    def variance(self) -> float:
        """Of the weighted residual: 1 where errors are absolute, the reduced χ² where they are scaled."""
        if self.absolute:
            return 1.0
        r = np.asarray(evaluate(self.residual, self.args, jnp.asarray(self.best)))
        r = r[: r.size - self.priors]
        return float(r @ r) / self.freedom

    @property
    def linearised(self) -> tuple[np.ndarray, np.ndarray]:
        """Residual and Jacobian (residuals, free) at the minimum."""
        r, J = _linearised(self.residual, self.args, jnp.asarray(self.best))
        return np.asarray(r), np.asarray(J)

    def shown(self, u: np.ndarray) -> np.ndarray:
        """Free parameters as reported, from what the solver sees; (..., free)."""
        return self.parameters.shown(u)

    def minimise(
        self, starts: np.ndarray, low: np.ndarray | None = None, high: np.ndarray | None = None
    ) -> SolverResult:
        """Minimise again from other places or within other bounds; the same compiled program for all."""
        least = np.asarray(self.parameters.low if low is None else low)
        most = np.asarray(self.parameters.high if high is None else high)
        inside = jnp.asarray(np.clip(starts, least, most))
        return from_many_starts(self.residual, self.args, inside, jnp.asarray(least), jnp.asarray(most), max_steps=100)


@eqx.filter_jit
def evaluate(residual: Callable, args: Any, u: jax.Array) -> jax.Array:
    """The residual, compiled."""
    return residual(u, args)


@eqx.filter_jit
def _linearised(residual: Callable, args: Any, u: jax.Array) -> tuple[jax.Array, jax.Array]:
    return value_and_jacobian(lambda u: residual(u, args), u)

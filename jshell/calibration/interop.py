"""The same problem for lmfit and for iminuit.

lmfit gets the whole residual, initial states and amplitudes included, so that
its count of parameters, and with it every statistic, is ours; and the exact
Jacobian, since the forward differences that it takes else leave its standard
errors with four digits. Minuit gets χ²/s² of the constants alone, the rest at
its best, with its gradient.
"""

from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.linearization import linearized, whitened
from jshell.calibration.objective import Objective, evaluate
from jshell.calibration.problem import Problem
from jshell.calibration.rebuilt import objective_of
from jshell.calibration.result import Fit
from jshell.errors import require_extra


def to_lmfit(result: Fit) -> Any:
    """An `lmfit.Minimizer` whose parameters stand at the minimum found; names `beta1[2]` become `beta1_2`.

    Linear parameters follow as `linear_0`, `linear_1`, … in the order of the result's nuisance estimates.

    Raises:
        MissingExtra: lmfit is not installed.
        BadValue: A result read from a file that lacks data or options.

    Example:
        >>> minimizer = result.to_lmfit()  # doctest: +SKIP
        >>> lmfit.conf_interval(minimizer, minimizer.minimize())  # doctest: +SKIP
    """
    objective = objective_of(result)
    lmfit = require_extra("lmfit", "interop")
    table = lmfit.Parameters()
    parameters, shown = objective.parameters, objective.shown(objective.best)
    names = [name.replace("[", "_").replace("]", "") for name in objective.names]
    limits = [objective.shown(np.asarray(end)) for end in (np.array(parameters.low), np.array(parameters.high))]
    for i, (name, value) in enumerate(zip(names, shown, strict=True)):
        inner = parameters.free[i]
        low = float(limits[0][i]) if np.isfinite(parameters.low[i]) else -np.inf
        high = float(limits[1][i]) if np.isfinite(parameters.high[i]) else np.inf
        if inner in parameters.squared or inner in parameters.positive:
            low = low if low != 0 else -np.inf
        if inner in parameters.negative:
            low, high = (-np.inf if high == np.inf else high), (np.inf if low == -np.inf else low)
        table.add(name, float(value), min=low, max=high)
    if not isinstance(objective.args[1], Problem):
        function = lambda p: _table_residual(objective, np.array([p[name].value for name in names]))  # noqa: E731
        return lmfit.Minimizer(function, table, scale_covar=not objective.absolute)

    parameters, problem = objective.args
    linear = linearized(np.asarray(objective.values), problem, parameters).linear
    flat = np.concatenate(linear)
    more = [f"linear_{i}" for i in range(flat.size)]
    for name, value in zip(more, flat, strict=True):
        table.add(name, float(value))
    cuts = np.cumsum([c.size for c in linear])[:-1]

    def at(p) -> tuple[np.ndarray, np.ndarray]:
        """Residual and Jacobian, by the parameters as lmfit has them."""
        values = _values(objective, np.array([p[name].value for name in names]))
        parts = np.split(np.array([p[name].value for name in more]), cuts)
        r, J = whitened(problem, linearized(values, problem, parameters, parts))
        for j, inner in enumerate(parameters.free):
            J[:, j] *= 2 * p[names[j]].value if inner in parameters.squared else 1.0
        return r, J

    def jacobian(p) -> np.ndarray:
        return at(p)[1][:, [p[name].vary for name in (*names, *more)]]

    class Exact(lmfit.Minimizer):
        """With the exact Jacobian for both least-squares methods; gradients of other methods are not it."""

        def leastsq(self, params=None, max_nfev=None, **kws):
            return super().leastsq(params, max_nfev, **({"Dfun": jacobian} | kws))

        def least_squares(self, params=None, max_nfev=None, **kws):
            return super().least_squares(params, max_nfev, **({"jac": jacobian} | kws))

    return Exact(lambda p: at(p)[0], table, scale_covar=not objective.absolute)


def to_minuit(result: Fit) -> Any:
    """An `iminuit.Minuit` of χ²/s² at the minimum found, with gradient; errordef 1, so that MINOS reads 68%.

    Raises:
        MissingExtra: iminuit is not installed.
        BadValue: A result read from a file that lacks data or options.

    Example:
        >>> minuit = result.to_minuit()  # doctest: +SKIP
        >>> minuit.migrad().minos(cl=0.95)  # doctest: +SKIP
    """
    objective = objective_of(result)
    iminuit = require_extra("iminuit", "interop")
    variance = max(objective.variance, 1e-300)
    scaled = jax.jit(jax.value_and_grad(lambda u: jnp.sum(objective.residual(u, objective.args) ** 2) / variance))
    slope = lambda u: np.array(_slopes(objective, u))  # noqa: E731

    def cost(shown) -> float:
        return float(scaled(jnp.asarray(_unknowns(objective, np.asarray(shown, dtype=float))))[0])

    def gradient(shown) -> np.ndarray:
        u = _unknowns(objective, np.asarray(shown, dtype=float))
        return np.asarray(scaled(jnp.asarray(u))[1]) / slope(u)

    start: Any = objective.shown(objective.best)
    minuit = iminuit.Minuit(cast(Any, cost), start, grad=cast(Any, gradient), name=objective.names)
    minuit.errordef = 1.0
    minuit.errors = [max(result[name].stderr, 1e-8) if np.isfinite(result[name].stderr) else 0.1
                     for name in objective.names]  # fmt: skip
    for name, inner in zip(objective.names, objective.parameters.free, strict=True):
        if inner in objective.parameters.positive:
            minuit.limits[name] = (1e-9, None)
    return minuit


def _unknowns(objective: Objective, shown: np.ndarray) -> np.ndarray:
    return np.array(
        [
            objective.parameters.unconstrained_value(name, value)
            for name, value in zip(objective.names, shown, strict=True)
        ]
    )


def _slopes(objective: Objective, u: np.ndarray) -> list[float]:
    """How reported parameters follow what the solver sees."""
    found = []
    for i, name in enumerate(objective.parameters.free):
        if name in objective.parameters.positive:
            found.append(float(np.exp(u[i])))
        elif name in objective.parameters.squared:
            found.append((-0.5 if name in objective.parameters.negative else 0.5) / float(np.sqrt(max(u[i], 1e-300))))
        else:
            found.append(1.0)
    return found


def _values(objective: Objective, shown: np.ndarray) -> np.ndarray:
    return np.asarray(objective.parameters.constrained(jnp.asarray(_unknowns(objective, shown))))


def _table_residual(objective: Objective, shown: np.ndarray) -> np.ndarray:
    """Residual of the frequencies that were measured."""
    r = np.asarray(evaluate(objective.residual, objective.args, jnp.asarray(_unknowns(objective, shown))))
    return r[np.isfinite(np.asarray(objective.args[1].omega)).ravel()]

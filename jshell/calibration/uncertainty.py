"""How well data determine parameters: covariance, and directions they leave free.

The covariance is (JᵀJ)⁻¹, from the singular values of J with every column
scaled to length one, so that units do not decide what counts as singular.
Where a direction is free, the parameters in it get no error, with a reason.

Symbols    J = ∂r/∂p Jacobian of the weighted residual   χ² sum of squares
"""

from dataclasses import dataclass

import numpy as np

from jshell.errors import NotOk, Outcome

# Below this ratio of singular values a direction is free: exact Jacobians leave 1e-15 there.
SINGULAR = 1e-9
LOOSE = 0.5  # a direction known to no better than this part of the constants is free for every purpose
NO_SCATTER = "no more data than parameters, so no scatter to scale it by: give σ"
MOST_PERCENT = 999.5  # an error of more than this is no part of its value
SMALL_COUPLING = 0.05  # k_VS may be 0: its changes count relative to at least this


@dataclass(frozen=True)
class Uncertainty:
    """Errors of parameters.

    Attributes:
        stderr: Standard errors, NaN where there is none.
        covariance: Their covariance, scaled as `absolute` says.
        correlation: Correlations, NaN beside a missing error.
        reasons: Why an error is missing; empty where it is not.
        null: (directions, parameters) orthonormal changes that leave the fit as it is, relative to each parameter.
    """

    stderr: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    reasons: tuple[str, ...]
    null: np.ndarray


def uncertainty(
    jacobian: np.ndarray,
    residual: np.ndarray,
    values: np.ndarray,
    *,
    count: int | None = None,
    absolute: bool,
    prior: np.ndarray | None = None,
    variance: float | None = None,
) -> Uncertainty:
    """Errors of parameters at a minimum.

    Args:
        jacobian: (data, parameters) of the weighted residual.
        residual: (data,) weighted.
        values: (parameters,) at the minimum.
        count: Number of data; None counts the residual.
        absolute: The weights are known errors; else the covariance is scaled by the reduced χ².
        prior: (priors, parameters) further rows of the Jacobian, in standard errors that are known: never scaled.
        variance: Variance of the weighted residual where the reduced χ² is not it (robust fits).

    Raises:
        NotOk: A residual or a derivative that is not finite: there is no minimum.
    """
    J, p = np.asarray(jacobian), np.asarray(values, dtype=float)
    total = J.shape[0] if count is None else count
    chi_square = float(residual @ residual)
    reduced = chi_square / max(1, total - p.size)
    spread = 1.0 if absolute else reduced if variance is None else variance
    if prior is not None and len(prior):
        J = np.vstack([J, prior * np.sqrt(spread)])

    with np.errstate(all="ignore"):
        length = np.linalg.norm(J, axis=0)
        no_effect = ~(length > 0)
        scale = np.where(no_effect, 1.0, length)
        rows = np.vstack([J / scale, np.zeros((max(0, p.size - J.shape[0]), p.size))])
    if not (np.isfinite(chi_square) and np.all(np.isfinite(rows))):
        raise NotOk("fit", Outcome.NOT_FINITE)
    _, s, vt = np.linalg.svd(rows, full_matrices=False)
    free = s <= SINGULAR * s[0]
    inverse = np.where(free, 0.0, 1 / np.where(free, 1.0, s))

    half = (vt.T * inverse) / scale[:, None]
    covariance = half @ half.T * spread
    in_null = (vt[free] ** 2).sum(axis=0) > 1e-12
    exact = not absolute and total <= p.size - free.sum()
    stderr = np.where(in_null | exact, np.nan, np.sqrt(np.diag(covariance)))
    safe = np.where(stderr > 0, stderr, np.nan)
    correlation = covariance / np.outer(safe, safe)

    null = vt[free] / scale / np.where(p == 0, 1.0, np.abs(p))
    null = null / np.linalg.norm(null, axis=1, keepdims=True) if len(null) else null
    reasons = tuple(
        "the data do not depend on it"
        if dead
        else "the data leave a combination with it free"
        if lost
        else NO_SCATTER
        if exact
        else ""
        for dead, lost in zip(no_effect, in_null, strict=True)
    )
    return Uncertainty(stderr, covariance, correlation, reasons, null)


def loose_directions(covariance: np.ndarray, values: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Combinations of constants that data fix to no better than half their size, and to how much.

    Args:
        covariance: Of the constants.
        values: The constants.

    Returns:
        Relative changes (constants,) of length one, with their relative standard error, worst first.
    """
    size = np.maximum(np.abs(values), SMALL_COUPLING)
    relative = covariance / np.outer(size, size)
    if not values.size or not np.all(np.isfinite(relative)):
        return []
    power, vectors = np.linalg.eigh(relative)
    found = [(vectors[:, i], float(np.sqrt(max(power[i], 0.0)))) for i in np.argsort(-power)]
    return [(direction, error) for direction, error in found if error > LOOSE]


def in_words(direction: np.ndarray, names: tuple[str, ...]) -> str:
    """A free direction as relative changes, largest first."""
    d = direction * np.sign(direction[np.argmax(np.abs(direction))])
    order = [i for i in np.argsort(-np.abs(d)) if abs(d[i]) > 1e-3]
    return ", ".join(f"{names[i]} {100 * d[i] / abs(d[order[0]]):+.0f}%" for i in order)


def share_in_words(share: float) -> str:
    """A relative error in percent; a word where it is beyond them."""
    return f"±{100 * share:.0f}%" if 100 * share < MOST_PERCENT else "more than ±1000%"


def information(chi_square: float, count: int, varied: int) -> tuple[float, float]:
    """AIC = N ln(χ²/N) + 2k and BIC = N ln(χ²/N) + k ln N, as lmfit defines them.

    Args:
        chi_square: Weighted sum of squares; 0 counts as nearly that.
        count: N, data.
        varied: k, varied parameters.
    """
    logarithm = count * np.log(max(chi_square, 1e-250 * count) / count)
    return float(logarithm + 2 * varied), float(logarithm + np.log(count) * varied)


def equal_tails(draws: np.ndarray, level: float | int) -> tuple[float, float]:
    """Quantiles that enclose `level` of the draws and leave as many below as above; those that are NaN do not count."""
    low, high = np.nanquantile(draws, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def propagate(gradient: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Standard errors of functions with a (functions, parameters) gradient."""
    return np.sqrt(np.einsum("fi,ij,fj->f", gradient, covariance, gradient).clip(0))

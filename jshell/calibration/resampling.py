"""Tables whose shells are drawn again, fitted side by side.

Each resample counts every shell 0, 1, 2, … times and is fitted from the whole
table's constants; 512 resamples go side by side.

Symbols    c_s how often shell s is drawn   ω-, ω+ angular frequencies   V_e volume at rest [R0³]
Source     Efron 1979; Mokbel et al. 2021: eq:defw
"""

from collections.abc import Collection
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_shape import coupled, uncoupled
from jshell.calibration.frequency_model import NAMES
from jshell.calibration.frequency_table import FrequencyTable
from jshell.calibration.result import Fit
from jshell.errors import BadValue, Outcome
from jshell.signals.lane_search import CONVERGED, RUNNING, Evaluation, LMState, begin, descend
from jshell.signals.lanes import barrier, lanewise, total

TOGETHER = 512
ROUNDS = 12
LARGEST = 1e3  # of a mass factor, and of one over it: further out a resample determines nothing


class Resamples(NamedTuple):
    """Rows of the table against resamples; fields as `lane_search` reads them.

    Attributes:
        weight: (shells, 2, resamples) counts over squared errors, 0 where a frequency is missing.
        count, power: Of the data, per resample.
    """

    rows: FrequencyTable
    weight: Any
    count: Any
    power: Any


def evaluate(unknowns: Float[Array, "3 block"], data: Resamples, squared: bool) -> Evaluation:
    """Cost, gradient and normal matrix by (log α1, log α2, k_VS²)."""
    rows, always_true = data.rows, data.count[0] >= 0
    V, P, kappa, K_A = (jnp.asarray(x)[:, None] for x in (rows.volume, rows.pressure, rows.kappa, rows.area_modulus))
    measured = jnp.isfinite(rows.omega)[:, :, None]
    target = V[:, None] * jnp.where(measured, jnp.asarray(rows.omega)[:, :, None], 1.0)

    def slopes(u):
        """V²ω², slow and fast, and its derivatives (unknowns, shells, 2, block): eq:defw."""
        alpha1, alpha2 = jnp.exp(u[0])[None], jnp.exp(u[1])[None]
        a, b, by_k, _ = uncoupled(alpha1, alpha2, 1.0, kappa * P * V, K_A / (4 * jnp.pi))
        c = by_k * u[2][None]
        slow, fast, half, root = coupled(a, b, c)
        found = jnp.stack([slow, fast], axis=1)
        over = 0.5 / jnp.maximum(root, 1e-300)
        apart = [(-half * a - c) * over, (half * b - c) * over, (by_k + 0 * a) * over]
        mean = [-a / 2, -b / 2 + 0 * a, 0 * a]
        return found, jnp.stack([jnp.stack([m - d, m + d], axis=1) for m, d in zip(mean, apart, strict=True)])

    def residuals(found, J):
        if squared:
            return found - target**2, J
        floor = 0.01 * target**2  # below, the root is continued by its tangent, as `master_curve.weighted` does
        root = jnp.sqrt(jnp.maximum(found, floor))
        return root + jnp.minimum(found - floor, 0.0) / (2 * root) - target, J / (2 * root)

    def sums(r, J, weight):
        half = weight * J
        add = lambda x: total(x[s, m] for s in range(x.shape[0]) for m in range(2))  # noqa: E731
        normal = {f"{i}{j}": add(half[i] * J[j]) for i in range(3) for j in range(i, 3)}
        return add(weight * r * r), jnp.stack([-add(half[i] * r) for i in range(3)]), normal

    r, J = barrier(residuals, always_true, *barrier(slopes, always_true, unknowns))
    cost, gradient, normal = barrier(sums, always_true, r, J, data.weight)
    full = jnp.stack([jnp.stack([normal[f"{min(i, j)}{max(i, j)}"] for j in range(3)]) for i in range(3)])
    zero = jnp.zeros((1, cost.size))
    return Evaluation(cost, gradient, full, zero, zero)


@eqx.filter_jit
@lanewise
def _resampled(start, counts, rows: FrequencyTable, low, high, squared: bool) -> LMState:
    unit = jnp.asarray(rows.sigma)
    known = jnp.any(unit != 1.0)
    V, omega = jnp.asarray(rows.volume)[:, None], jnp.where(jnp.isfinite(rows.omega), rows.omega, 0.0)
    slope = jnp.where(known, 2 * V**2 * omega if squared else V, 1.0)
    weight = jnp.where(jnp.isfinite(rows.omega), 1 / jnp.square(unit * jnp.where(slope > 0, slope, 1.0)), 0.0)
    data = Resamples(rows, 0.0, 0.0, 0.0)._replace(weight=weight[:, :, None] * counts[:, None])
    target = (V * omega) ** (4 if squared else 2)
    power = jnp.sum(data.weight * target[:, :, None], axis=(0, 1))
    data = data._replace(power=power, count=jnp.sum(counts, axis=0))
    at = lambda u, d: evaluate(u, d, squared)  # noqa: E731
    return descend(begin(start, data, at), data, low, high, at)


def resample(
    rows: FrequencyTable, whole: Fit, weighting: str, fixed_names: Collection[str], resamples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Constants of tables whose shells are drawn again.

    Args:
        rows: The table.
        whole: Its own fit, from whose constants each begins.
        weighting: As for `fit_frequencies`.
        fixed_names: Constants that are not fitted.
        resamples: How many.
        seed: Of the draws.

    Returns:
        (resamples, 3) alpha1, alpha2, k_vs, NaN where there is none; (resamples,) integers of `Outcome`.

    Raises:
        BadValue: Fewer than two shells, or no resamples.
    """
    shells = np.shape(rows.volume)[0]
    if shells < 2 or resamples < 1:
        raise BadValue(
            "table, resamples",
            found=f"{shells} shells, {resamples} resamples",
            expected="at least 2 shells and 1 resample",
            remedy="Add shells.",
        )
    values = {estimate.name: estimate.value for estimate in whole.estimates}
    first = np.array([np.log(values["alpha1"]), np.log(values["alpha2"]), values["k_vs"] ** 2])
    fixed = np.array([name in fixed_names for name in NAMES])
    low = np.where(fixed, first, [-np.log(LARGEST), -np.log(LARGEST), 0.0])[:, None]
    high = np.where(fixed, first, [np.log(LARGEST), np.log(LARGEST), 1e3])[:, None]

    random = np.random.default_rng(seed)
    drawn = random.integers(0, shells, (resamples, shells))
    counts = np.zeros((resamples, shells))
    np.add.at(counts, (np.arange(resamples)[:, None], drawn), 1.0)

    found = np.repeat(first[:, None], resamples, axis=1)
    status = np.full(resamples, RUNNING)
    for _ in range(ROUNDS):
        left = np.flatnonzero(status == RUNNING)
        for at in range(0, left.size, TOGETHER):
            mine = left[at : at + TOGETHER]
            lanes = np.resize(mine, TOGETHER)
            ended = _resampled(found[:, lanes], counts[lanes].T, rows, low, high, weighting != "V_e omega")
            found[:, mine] = np.asarray(ended.unknowns)[:, : mine.size]
            status[mine] = np.asarray(ended.status)[: mine.size]
        if not left.size:
            break
    several = (counts > 0).sum(axis=1) > 1
    free = ~fixed[:, None]
    bound = np.any(free & ((found <= low) | (found >= high)), axis=0)
    lost = bound & np.any((free & ((found <= low) | (found >= high)))[:2], axis=0)
    outcome = np.where(status == CONVERGED, int(Outcome.OK), int(Outcome.NOT_CONVERGED))
    outcome = np.where(bound & (outcome == Outcome.OK), int(Outcome.AT_BOUND), outcome)
    outcome = np.where(~several | lost, int(Outcome.RANK_DEFICIENT), outcome)
    shown = np.stack([np.exp(found[0]), np.exp(found[1]), np.sqrt(np.maximum(found[2], 0.0))], axis=1)
    good = np.isin(outcome, (int(Outcome.OK), int(Outcome.AT_BOUND)))
    return np.where(good[:, None], shown, np.nan), outcome

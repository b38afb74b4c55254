"""Refits of data drawn again about a fit: the bootstrap.

The fitted curve stays; noise is drawn anew and the constants are fitted again,
from the minimum, many at a time. Autocorrelated noise stays so: what is
drawn is its fresh part. Where a table of frequencies was fitted, its shells are
drawn instead, see `bootstrap_frequencies`.

Symbols    e residual over its σ   φ memory of the noise   N data   k parameters
Source     Efron 1979; of autocorrelated noise: Freedman 1984
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.frequency_table import prepare
from jshell.calibration.least_squares import levenberg_marquardt
from jshell.calibration.objective import Objective, evaluate
from jshell.calibration.problem import Problem
from jshell.calibration.rebuilt import objective_of
from jshell.calibration.resampling import resample
from jshell.calibration.result import Fit
from jshell.calibration.robust import counts
from jshell.calibration.uncertainty import equal_tails
from jshell.errors import BadValue, Outcome, choose

KINDS = ("auto", "normal", "residuals")
TOGETHER = 32  # refits side by side
ROUNDS = 8  # of the weights of a robust loss; each leaves less than a third of the change


@dataclass(frozen=True)
class Refits:
    """Constants of every refit.

    Attributes:
        names: The varied parameters.
        values: (refits, names); NaN where a refit found no minimum.
        best: (names,) of the fit itself.
        outcome: (refits,) integers of `Outcome`.
        kind: `normal` noise of the fit's size, its own `residuals`, or `shells` of a table.
        seed: Of the draws.
    """

    names: tuple[str, ...]
    values: np.ndarray
    best: np.ndarray
    outcome: np.ndarray
    kind: str
    seed: int

    @property
    def lost(self) -> int:
        """Refits without a minimum."""
        return int(np.sum(~np.isfinite(self.values).all(axis=1)))

    @property
    def stderr(self) -> np.ndarray:
        """(names,) standard deviation of the refits."""
        return np.nanstd(self.values, axis=0, ddof=1)

    def interval(self, name: str, level: float | int = 0.95) -> tuple[float, float]:
        """Quantiles that leave equal tails.

        Raises:
            BadName: Not varied.
        """
        choose("parameter", name, self.names, noun="varied parameter")
        return equal_tails(self.values[:, self.names.index(name)], level)

    def report(self, level: float | int = 0.95) -> str:
        """The intervals as text."""
        lines = [f"[[Bootstrap, {len(self.values)} refits, {self.kind}, seed {self.seed}, {100 * level:g}%]]"]
        for name, best, stderr in zip(self.names, self.best, self.stderr, strict=True):
            low, high = self.interval(name, level)
            lines.append(f"    {name}: {best:.6g} ± {stderr:.4g}, {low:.6g} to {high:.6g}")
        if self.lost:
            lines.append(f"    {self.lost} refits found no minimum and are left out")
        return "\n".join(lines)

    def record(self, level: float | int = 0.95) -> dict:
        """The intervals as a JSON object."""
        rows = [
            {"name": name, "value": float(best), "stderr": float(stderr), "interval": list(self.interval(name, level))}
            for name, best, stderr in zip(self.names, self.best, self.stderr, strict=True)
        ]
        return {
            "kind": self.kind,
            "refits": len(self.values),
            "lost": self.lost,
            "seed": self.seed,
            "level": level,
            "parameters": rows,
        }


def bootstrap(result: Fit, count: int = 500, *, seed: int = 0, kind: str = "auto") -> Refits:
    """Fit again what might have been measured.

    Args:
        result: Of a fit, fresh or read from a file.
        count: Refits.
        seed: Of the draws.
        kind: `normal` noise of the size that errors assume, `residuals` of the fit drawn with replacement;
            `auto` takes normal where errors were given, residuals elsewhere.

    Raises:
        BadName: No such kind.
        BadValue: Fewer than 20 refits; normal noise for a robust fit; the table of a fit with bounds.
    """
    objective = objective_of(result)
    choose("kind", kind, KINDS)
    if count < 20:
        raise BadValue("count", found=f"{count}", expected="at least 20", remedy="Ask for 500.")
    if not isinstance(objective.args[1], Problem):
        return _shells(result, objective, count, seed)
    if kind == "auto":
        kind = "normal" if objective.absolute and not objective.loss else "residuals"
    if kind == "normal" and objective.loss:
        raise BadValue(
            "kind", found="normal noise for a robust fit", expected="residuals", remedy='Leave it, or kind="residuals".'
        )
    draw = _drawer(objective, kind, np.random.default_rng(seed))
    values, outcome = [], []
    for _ in range(-(-count // TOGETHER)):
        data = [draw() for _ in range(TOGETHER)]
        stacked = tuple(jnp.asarray(np.stack(rows)) for rows in zip(*data, strict=True))
        u, ended = _refitted(
            objective.residual, objective.args, objective.share, objective.loss, stacked, jnp.asarray(objective.best)
        )
        good = np.isin(np.asarray(ended), (int(Outcome.OK), int(Outcome.AT_BOUND)))[:, None]
        values.append(np.where(good, objective.shown(np.asarray(u)), np.nan))
        outcome.append(np.asarray(ended))
    best = objective.shown(objective.best)
    return Refits(objective.names, np.concatenate(values)[:count], best, np.concatenate(outcome)[:count], kind, seed)


def _left(objective: Objective) -> list[np.ndarray]:
    """Per record, (channels, times) residual over σ, its memory and the weights of a robust loss taken out."""
    r = np.asarray(evaluate(objective.residual, objective.args, jnp.asarray(objective.best)))
    found, at = [], 0
    for number, record in enumerate(objective.args[1].model.records):
        shape = np.shape(record.data)
        block = r[at : at + int(np.prod(shape))].reshape(shape)
        found.append(block if objective.share is None else block / np.asarray(objective.share[number]))
        at += block.size
    return found


def coloured(fresh: np.ndarray, memory: np.ndarray | None) -> np.ndarray:
    """Autocorrelated noise (channels, times), from its fresh part: the inverse of `noise.whiten`."""
    if memory is None:
        return fresh
    e = np.array(fresh)
    for k in range(1, e.shape[1]):
        phi = memory[:, k]
        e[:, k] = phi * e[:, k - 1] + np.sqrt(1 - phi**2) * fresh[:, k]
    return e


def _drawer(objective: Objective, kind: str, random: np.random.Generator) -> Callable[[], list[np.ndarray]]:
    """Draws data, (channels, times) per record, about the fitted curves."""
    problem: Problem = objective.args[1]
    left = _left(objective)
    memory = [None] * len(left) if problem.memory is None else [np.asarray(rows) for rows in problem.memory]
    wider = float(np.sqrt(objective.count / objective.freedom))  # a residual is smaller than its noise
    plain = []
    for number, record in enumerate(problem.model.records):
        weight = np.asarray(record.weight)
        share = np.ones_like(weight) if objective.share is None else np.asarray(objective.share[number])
        used = weight > 0
        plain.append((np.asarray(record.data), used, np.where(used, share / np.where(used, weight, 1.0), 0.0)))

    def draw() -> list[np.ndarray]:
        found = []
        for (data, used, sigma), fresh, phi in zip(plain, left, memory, strict=True):
            new = np.zeros_like(fresh)
            for channel, mask in enumerate(used):
                pool = fresh[channel, mask]
                if kind == "normal":
                    new[channel, mask] = np.sqrt(objective.variance) * random.standard_normal(pool.size)
                else:
                    new[channel, mask] = wider * random.choice(pool - pool.mean(), pool.size)
            found.append(data + sigma * (coloured(fresh, phi) + coloured(new, phi)))
        return found

    return draw


@eqx.filter_jit
def _refitted(
    residual: Callable, args: Any, share: Any, loss: str, data: tuple[jax.Array, ...], start: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Unknowns and outcome of every refit, from the minimum of the fit."""
    parameters, problem = args
    low, high = jnp.asarray(parameters.low), jnp.asarray(parameters.high)
    weights = [record.weight for record in problem.model.records]

    def minimum(model: Problem, u: jax.Array):
        return levenberg_marquardt(lambda x: residual(x, (parameters, model)), u, low, high, max_steps=50)

    def one(rows: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
        moved = eqx.tree_at(lambda j: [record.data for record in j.model.records], problem, list(rows))
        if not loss:
            solution = minimum(moved, start)
            return solution.unknowns, solution.outcome

        def again(state, _):
            u, shares, _ = state
            heavy = [w / s * c for w, s, c in zip(weights, share, shares, strict=True)]
            weighed = eqx.tree_at(lambda j: [record.weight for record in j.model.records], moved, heavy)
            solution = minimum(weighed, u)
            r, at, new = residual(solution.unknowns, (parameters, weighed)), 0, []
            for one_share in shares:
                e = r[at : at + one_share.size].reshape(one_share.shape) / one_share
                new.append(jnp.sqrt(counts(loss, e)))
                at += one_share.size
            return (solution.unknowns, new, solution.outcome), None

        begin = (start, [jnp.asarray(s) for s in share], jnp.asarray(int(Outcome.OK)))
        (u, _, outcome), _ = jax.lax.scan(again, begin, None, length=ROUNDS)
        return u, outcome

    return jax.vmap(one)(data)


def _shells(result: Fit, objective: Objective, count: int, seed: int) -> Refits:
    """The constants of a table whose shells are drawn again."""
    asked = result.specification
    if asked is None or asked.bounds or asked.weighting is None:
        raise BadValue(
            "bootstrap", found="the fit of a table with bounds", expected="one without",
            remedy="Leave the bounds out, or use profile.",
        )  # fmt: skip
    values, outcome = resample(prepare(result.table).rows, result, asked.weighting, tuple(asked.fix), count, seed)
    columns = [("alpha1", "alpha2", "k_vs").index(name) for name in objective.names]
    return Refits(objective.names, values[:, columns], objective.shown(objective.best), outcome, "shells", seed)

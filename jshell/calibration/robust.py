"""Robust losses: least squares with weights that follow the residual.

A sample e standard deviations away counts ψ(e)/e, and the fit is repeated until
that settles. Errors are those of an M-estimator.

Symbols    e residual over its channel's robust scale s = 1.48 median|r|   ψ influence
Source     Huber 1964; Holland & Welsch 1977 for the tuning constants (95% as good as least squares on normal noise)
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.least_squares import SolverResult, best_of
from jshell.calibration.linearization import best_linear_of, linearized
from jshell.calibration.long_records import minimise
from jshell.calibration.misfit import rows_of
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem
from jshell.errors import Outcome

TUNING = {"huber": 1.345, "cauchy": 2.385}
MOST_ROUNDS = 50
SETTLED = 1e-9  # relative change of the unknowns between rounds


@dataclass(frozen=True)
class Robust:
    """What a robust loss made of the data.

    Attributes:
        kind: Its name.
        variance: Of the residual over its scale, as the errors of an M-estimator take it.
        scale: (data,) robust scale of the weighted residual, one for each channel.
        weights: Per record, (channels, times) how much each sample counts.
        linear: Linear parameters, per block.
        problem: The problem with those weights.
    """

    kind: str
    variance: float
    scale: np.ndarray
    weights: list[np.ndarray]
    linear: list[np.ndarray]
    problem: Problem


def reweigh(kind: str, problem: Problem, parameters: Unknowns, solution: SolverResult) -> tuple[SolverResult, Robust]:
    """Weights that settle, from the minimum of least squares; every channel has a scale of its own."""
    best, _ = best_of(solution, 0.0)
    u, moving = np.asarray(solution.unknowns[best]), problem
    weights = [np.asarray(record.weight) for record in problem.model.records]
    used = np.concatenate([w.ravel() > 0 for w in weights])

    def evaluate(u: np.ndarray, moving: Problem) -> tuple[list[np.ndarray], np.ndarray]:
        """Linear parameters, and the residual with the data's own weights."""
        values = np.asarray(parameters.constrained(jnp.asarray(u)))
        linear = best_linear_of(values, moving)
        return linear, linearized(values, problem, parameters, linear).residual

    ended = jnp.asarray(int(Outcome.NOT_CONVERGED))
    for _ in range(MOST_ROUNDS):
        moving, _, weights = reweighed(kind, problem, evaluate(u, moving)[1])
        one = minimise(parameters, moving, u[None])
        new = np.asarray(one.unknowns[0])
        change = np.max(np.abs(new - u) / (0.1 + np.abs(u)))
        u = new
        if change < SETTLED:
            ended = one.outcome[0]
            break
    linear, r = evaluate(u, moving)
    scale = _scale(problem, r)
    # the best start is what the last weights made of it; the others are told as least squares left them
    solution = eqx.tree_at(
        lambda x: (x.unknowns, x.outcome),
        solution,
        (solution.unknowns.at[best].set(u), solution.outcome.at[best].set(ended)),
    )
    influence, slope = _influence(kind, (r / scale)[used])
    freedom = max(1, int(used.sum()) - len(parameters.free) - sum(c.size for c in linear))
    variance = used.sum() / freedom * float(np.mean(influence**2)) / float(np.mean(slope)) ** 2
    return solution, Robust(kind, float(variance), scale, weights, linear, moving)


def reweighed(kind: str, problem: Problem, r: np.ndarray) -> tuple[Problem, np.ndarray, list[np.ndarray]]:
    """The problem with the weights that a residual calls for.

    Args:
        kind: Of the loss.
        problem: The problem with the data's own weights.
        r: (data,) its residual.

    Returns:
        The problem; (data,) robust scale; per record, (channels, times) how much each sample counts.
    """
    plain, scale = [np.asarray(record.weight) for record in problem.model.records], _scale(problem, r)
    weights = _like(np.asarray(counts(kind, jnp.asarray(r / scale))), plain)
    heavy = [w * np.sqrt(c) / s for w, c, s in zip(plain, weights, _like(scale, plain), strict=True)]
    moved = eqx.tree_at(
        lambda j: [record.weight for record in j.model.records], problem, [jnp.asarray(w) for w in heavy]
    )
    return moved, scale, weights


def _scale(problem: Problem, r: np.ndarray) -> np.ndarray:
    """(data,) 1.48 times the median size of each channel's residual."""
    used = np.concatenate([np.asarray(record.weight).ravel() > 0 for record in problem.model.records])
    scale = np.ones(r.size)
    for _, _, at in rows_of(problem):
        scale[at] = max(1.4826 * float(np.median(np.abs(r[at][used[at]]))), 1e-300)
    return scale


def _like(flat: np.ndarray, shapes: list[np.ndarray]) -> list[np.ndarray]:
    """A flat array cut as others are."""
    cuts = np.cumsum([w.size for w in shapes])[:-1]
    return [part.reshape(w.shape) for part, w in zip(np.split(flat, cuts), shapes, strict=True)]


def counts(kind: str, e: jax.Array) -> jax.Array:
    """How much a sample counts: ψ(e)/e."""
    if kind == "huber":
        return jnp.minimum(1.0, TUNING[kind] / jnp.maximum(jnp.abs(e), 1e-300))
    return 1 / (1 + (e / TUNING[kind]) ** 2)


def _influence(kind: str, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """ψ and its slope."""
    tuning = TUNING[kind]
    if kind == "huber":
        return np.clip(e, -tuning, tuning), (np.abs(e) < tuning).astype(float)
    share = (e / tuning) ** 2
    return e / (1 + share), (1 - share) / (1 + share) ** 2

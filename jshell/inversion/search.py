"""The way to a minimum: Levenberg and Marquardt's steps on nodes that stay, then nodes that follow, until both rest.

The solver is that of the calibrations, taken step by step: what takes time is the simulator, a program of its own.

Symbols    u what the solver sees of the unknowns   r weighted residual   J = ∂r/∂u
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from jshell.calibration.least_squares import SolverResult, step_by_step
from jshell.errors import Outcome
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Projection
from jshell.inversion.response import Standing

LEGS = 4  # times the nodes follow the shape
AT_REST = 1e-4  # change of u, in standard errors, that new nodes may bring
FILLED = 8  # unknowns of the solver, or a multiple


@dataclass
class SearchResult:
    """Where a search ended.

    Attributes:
        u: The unknowns.
        near: The shells at rest, on their nodes.
        projections: What is left of every recording there.
        cost: Sum of squares, priors with it.
        outcome: How it ended.
        steps: Steps tried.
        begun: Where it began.
    """

    u: np.ndarray
    near: list[Standing]
    projections: list[Projection]
    cost: float
    outcome: Outcome
    steps: int = 0
    begun: np.ndarray = field(default_factory=lambda: np.empty(0))


def prior_rows(model: Model, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual (priors,) and Jacobian (priors, unknowns) of what is known beforehand."""
    values, logarithmic = model.parameters.to_values(u), model.parameters.logarithmic
    known = [(i, prior) for i, prior in enumerate(model.parameters.priors) if prior is not None]
    r, J = np.zeros(len(known)), np.zeros((len(known), u.size))
    for row, (i, prior) in enumerate(known):
        r[row] = (values[i] - prior.mean) / prior.sigma
        J[row, i] = (values[i] if logarithmic[i] else 1.0) / prior.sigma
    return r, J


def projections_at(model: Model, u: np.ndarray, near: Sequence[Standing], weighings: Sequence[Weighing]):
    """What is left of every recording, and the worst outcome."""
    found = [model.project(k, u, near[k], weighings[k]) for k in range(len(model.recordings))]
    return [one for one, _ in found], max(outcome for _, outcome in found)


Kept = dict[bytes, tuple[list[Projection], Outcome]]


def solve(
    model: Model,
    near: Sequence[Standing],
    weighings: Sequence[Weighing],
    u: np.ndarray,
    span: tuple[np.ndarray, np.ndarray],
    *,
    max_steps: int,
    tolerances: tuple[float, float] = (1e-7, 1e-9),
    kept: Kept | None = None,
) -> SolverResult:
    """The calibrations' solver on given nodes.

    Unknowns are filled up to one number with some that are held, so that what little is compiled serves every fit.

    Args:
        model, near, weighings: Of the search.
        u, span: Where it begins; lower and upper bounds, equal where an unknown is held.
        max_steps, tolerances: Most steps; of the unknowns and of the cost.
        kept: What has been computed already is looked up there, and put there.
    """
    known: Kept = {} if kept is None else kept
    size = u.size
    more = -size % FILLED

    def rows(at: np.ndarray) -> np.ndarray:
        v = at[:size]
        if v.tobytes() not in known:
            known[v.tobytes()] = projections_at(model, v, near, weighings)
        projections, ended = known[v.tobytes()]
        square = np.full((size + more + 1, size + more + 1), np.nan)
        if ended == Outcome.OK:
            r, J = prior_rows(model, v)
            both = [np.column_stack([one.jacobian, one.residual]) for one in projections]
            upper = np.asarray(np.linalg.qr(np.vstack([*both, np.column_stack([J, r])]), mode="r"))
            square[:] = 0.0
            square[: len(upper), :size], square[: len(upper), -1] = upper[:, :size], upper[:, -1]
        return square

    filled = lambda part: np.concatenate([part, np.zeros(more)])  # noqa: E731
    found = step_by_step(
        rows, filled(u), filled(span[0]), filled(span[1]), max_steps=max_steps, xtol=tolerances[0], ftol=tolerances[1]
    )
    return SolverResult(found.unknowns[:size], found.cost, found.outcome, found.steps)


def minimise(
    model: Model, u: np.ndarray, weighings: Sequence[Weighing], *, max_steps: int = 30, legs: int = LEGS
) -> SearchResult:
    """The minimum that a start leads to."""
    low, high = model.parameters.to_u(model.parameters.low), model.parameters.to_u(model.parameters.high)
    begun, steps, outcome = u, 0, Outcome.NOT_CONVERGED
    kept: Kept = {}
    near = model.standing(u)
    worst = Outcome(max(int(one.outcome) for one in near))
    if worst != Outcome.OK:
        return SearchResult(u, near, [], np.inf, worst, 0, begun)
    for _ in range(legs):
        kept.clear()
        found = solve(model, near, weighings, u, (low, high), max_steps=max_steps, kept=kept)
        new, steps, outcome = np.asarray(found.unknowns), steps + int(found.steps), Outcome(int(found.outcome))
        projections, _ = kept.get(new.tobytes()) or projections_at(model, new, near, weighings)
        if outcome == Outcome.NOT_FINITE:
            return SearchResult(new, near, [], np.inf, outcome, steps, begun)
        moved, u = new - u, new
        if outcome in (Outcome.NOT_CONVERGED, Outcome.STALLED) or _still(moved, projections):
            break
        follow = model.standing(u)
        if max(int(one.outcome) for one in follow) != Outcome.OK:
            outcome = Outcome.NOT_CONVERGED
            break
        near = follow
    cost = float(sum(one.residual @ one.residual for one in projections) + np.sum(prior_rows(model, u)[0] ** 2))
    return SearchResult(u, near, projections, cost, outcome, steps, begun)


def _still(moved: np.ndarray, projections: Sequence[Projection]) -> bool:
    """Whether a change of the unknowns is nothing beside their errors."""
    J = np.concatenate([one.jacobian for one in projections])
    return float(np.sum((J @ moved) ** 2)) < AT_REST


def information(solution: SearchResult) -> np.ndarray:
    """(unknowns, unknowns) what the recordings tell of the unknowns at a minimum."""
    J = np.concatenate([one.jacobian for one in solution.projections])
    return J.T @ J

"""What would tell: how well the unknowns would be known with one more recording.

A recording that was not made is taken to ring as strongly as the first, with its noise and its sampling, at numbers of
the shell of one's choice; what it would tell (Fisher's information) is added to what is known.

Symbols    J Jacobian of a recording, its amplitudes following   s² variance of the weighted residual
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jshell.errors import Outcome, choose
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Modal, project
from jshell.inversion.search import SearchResult


@dataclass(frozen=True)
class Prospect:
    """What one more recording would bring.

    Attributes:
        change: Numbers of the shell that it would be made at, and `samples` or `length` of the record.
        stderr: Name of an unknown to its relative standard error then (absolute of those sought as they are).
        outcome: ok, or why there is no such recording.
    """

    change: Mapping[str, float | int]
    stderr: Mapping[str, float]
    outcome: Outcome


def next_recording(
    model: Model,
    best: SearchResult,
    weighings: Sequence[Weighing],
    covariance: np.ndarray,
    candidates: Sequence[Mapping[str, float | int]],
) -> tuple[Prospect, ...]:
    """How well the unknowns would be known with each of several further recordings.

    Args:
        model, best, weighings: Of the inversion.
        covariance: (unknowns, unknowns) of what the solver sees.
        candidates: Each the numbers that are otherwise than in the first recording, such as `outer_pressure`; also
            `samples`, their number, and `length`, in lengths of the first.
    """
    known = np.linalg.pinv(covariance)
    return tuple(_prospect(model, best, weighings[0], known, one) for one in candidates)


def _prospect(
    model: Model, best: SearchResult, weighing: Weighing, known: np.ndarray, change: Mapping[str, float | int]
) -> Prospect:
    names, first = model.space.names, model.recordings[0]
    for name in change:
        choose("candidate", name, (*model.space.table, "samples", "length"), noun="number of a recording")
    numbers = {name: value for name, value in change.items() if name in model.space.table}
    for name in numbers:
        choose("candidate", name, model.space.known[0], noun="known number", remedy="What is unknown cannot be chosen.")
    whole = replace(model.space, known=(model.space.known[0] | numbers, *model.space.known[1:]))
    other = replace(model, space=whole)
    near = other.standing(best.u)[0]
    modal, slope, outcomes = other.modal(0, best.u, near)
    chosen = list(weighing.modes)
    outcome = Outcome(max(int(near.outcome), int(np.max(outcomes[chosen]))))
    if outcome != Outcome.OK:
        return Prospect(change, dict.fromkeys(names, float("nan")), outcome)
    span = (first.times[-1] - first.times[0]) * change.get("length", 1.0)
    elapsed = np.linspace(0.0, span, int(change.get("samples", first.times.size)))
    picked = Modal(modal.rates[chosen], modal.shapes[chosen], modal.rest)
    slopes = Modal(slope.rates[:, chosen], slope.shapes[:, chosen], slope.rest)
    # as large a swing as that of the first recording
    waves = picked.shapes[:, :, None] * np.exp(np.multiply.outer(picked.rates, elapsed))[:, None]
    moves = np.real(np.tensordot(best.projections[0].amplitudes, waves, 1))
    swing = np.abs(best.projections[0].curve - first.level[:, None]).max()
    moves *= swing / np.abs(moves).max()
    memory = np.full((len(first.channels), elapsed.size), np.median(weighing.memory))
    found = project(
        elapsed, picked.rest[:, None] + moves, 1 / weighing.sigma, memory, picked, slopes, weighing.free_rest
    )
    covariance = np.linalg.pinv(known + found.jacobian.T @ found.jacobian)
    return Prospect(change, dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)), outcome)

"""The answer's last steps: the exact liquid, and a mesh without end.

The search knows the liquid to second order of its layer, on a coarse mesh. At its minimum the exact liquid's modes are
laid beside its own; what they say over what it says is kept while the minimum is sought again, until both rest.
A held shell's modes approach those of a fine mesh with the first power of the element length, since the wall bends
sharply at the pad's edge: two meshes tell the limit, and a part of that step is its doubt.

Symbols    s rates   φ changes of the channels along the modes   N elements
Source     Richardson 1911 for the limit
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from jshell.errors import Outcome
from jshell.inversion.model import Model, Offset, Weighing
from jshell.inversion.projection import Modal
from jshell.inversion.search import Ending, information

CORRECTIONS = 3
FINE = 32  # elements of the finer mesh
DOUBT = 0.25  # of the step to the limit: by 20, 32 and 48 elements the limit of two of them is right to 0.15
SETTLED = 0.02  # standard errors that the last correction may move the answer

Again = Callable[[Model, Ending, list[Weighing]], Ending]


def corrected(
    model: Model, best: Ending, weighings: list[Weighing], again: Again
) -> tuple[Ending, list[Weighing], str]:
    """The minimum with the better simulator, its weighings, and what the correction moved in words.

    Args:
        model, best, weighings: Of the search.
        again: Seeks the minimum anew.
    """
    before = best
    scale = np.sqrt(np.abs(np.diag(np.linalg.pinv(information(best)))))
    for _ in range(CORRECTIONS):
        better = []
        for k, weighing in enumerate(weighings):
            offset = _offset(model, best, k, weighing.modes)
            if offset is None:
                return before, weighings, "the exact liquid's modes were not found: the answer is of the second order"
            better.append(replace(weighing, offset=offset))
        found = again(model, best, better)
        step, best, weighings = found.u - best.u, found, better
        if np.all(np.abs(step) < SETTLED * scale):
            break
    shift = np.abs(best.u - before.u) / np.where(scale > 0, scale, np.inf)
    worst = int(np.argmax(shift))
    return best, weighings, (
        f"liquid: exact; by the search's, second order on {model.elements} elements, {model.space.names[worst]} would "
        f"lie {shift[worst]:.2g} standard errors of the noise away"
    )  # fmt: skip


def _offset(model: Model, best: Ending, k: int, modes: tuple[int, ...]) -> Offset | None:
    """What the better simulator says over what the search's does at its minimum."""
    rough, _, _ = model.modal(k, best.u, best.near[k])
    sharp, _, outcome = model.modal(k, best.u, best.near[k], "exact")
    chosen = list(modes)
    if np.any(outcome[chosen] != Outcome.OK):
        return None
    sharp = sharp._replace(shapes=_alike(sharp.shapes, rough.shapes))
    doubt = None
    if model.seen(k, best.u)[0].numbers[6] > 0 and model.elements < FINE:
        near = model.standing(best.u, FINE)[k]
        fine, _, outcome = model.modal(k, best.u, near, "exact", FINE)
        if int(near.outcome) or np.any(outcome[chosen] != Outcome.OK):
            return None
        fine = fine._replace(shapes=_alike(fine.shapes, rough.shapes))
        reach = model.elements / (FINE - model.elements)
        step = [reach * (b - a) for a, b in zip(sharp, fine, strict=True)]
        sharp = Modal(*(b + s for b, s in zip(fine, step, strict=True)))
        doubt = (DOUBT * step[0], DOUBT * step[1], DOUBT * step[2])
    silent = np.abs(rough.shapes) < 1e-9 * np.abs(rough.shapes).max()
    ratio = np.where(silent, 1.0, sharp.shapes / np.where(silent, 1.0, rough.shapes))
    return Offset(sharp.rates / rough.rates, ratio, sharp.rest - rough.rest, doubt)


def _alike(shapes: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Shapes turned and scaled to be nearest to others: a mode's own size and phase mean nothing."""
    share = np.sum(shapes.conj() * like, axis=1) / np.sum(np.abs(shapes) ** 2, axis=1)
    return share[:, None] * shapes


def doubted(model: Model, best: Ending, weighings: list[Weighing]) -> np.ndarray:
    """(unknowns,) how far the answer would move with what may be wrong of the better simulator."""
    pull = np.zeros(best.u.size)
    for k, (weighing, one) in enumerate(zip(weighings, best.lefts, strict=True)):
        offset = weighing.offset
        if offset is None or offset.doubt is None:
            continue
        rough, _, _ = model.modal(k, best.u, best.near[k])
        s, phi, rest = offset.doubt
        moved = Offset(offset.rates + s / rough.rates, offset.shapes + phi / rough.shapes, offset.rest + rest)
        other, outcome = model.left(k, best.u, best.near[k], replace(weighing, offset=moved))
        if outcome == Outcome.OK:
            pull += one.jacobian.T @ (other.residual - one.residual)
    return np.linalg.pinv(information(best)) @ pull

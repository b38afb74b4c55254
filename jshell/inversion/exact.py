"""The answer's last steps: the exact liquid, and a pad's edge resolved to its limit.

The search knows the liquid to second order of its layer. At its minimum the exact liquid's modes are laid beside its
own; what they say over what it says is kept while the minimum is sought again, until both rest. A held shell's modes
approach their limit with the first power of the length of the element at the pad's edge, where the splines hold the
stretch beside the slope: two such lengths tell the limit, and a part of that step is its doubt.

Symbols    s rates   φ changes of the channels along the modes
Source     Richardson 1911 for the limit
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from jshell.errors import Outcome
from jshell.inversion.model import Model, Offset, Weighing
from jshell.inversion.projection import Modal
from jshell.inversion.response import BLUNT
from jshell.inversion.search import SearchResult, information

CORRECTIONS = 3
DOUBT = 0.15  # of the step to the limit: beside 32 elements and 6 more at the edge, frequencies are right to a tenth
SETTLED = 0.02  # standard errors that the last correction may move the answer

Again = Callable[[Model, SearchResult, list[Weighing]], SearchResult]


def corrected(
    model: Model, best: SearchResult, weighings: list[Weighing], again: Again
) -> tuple[SearchResult, list[Weighing], str]:
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
        f"liquid: exact; by the search's, of second order, {model.parameters.names[worst]} would lie "
        f"{shift[worst]:.2g} standard errors of the noise away"
    )  # fmt: skip


def _offset(model: Model, best: SearchResult, k: int, modes: tuple[int, ...]) -> Offset | None:
    """What the better simulator says over what the search's does at its minimum."""
    chosen, plain = list(modes), model.plain(k, best.u)
    rough, _, _ = model.modal(k, best.u, best.near[k])
    second, exact, outcome = model.liquids(k, best.u, plain)
    if int(plain.outcome) or np.any(outcome[chosen] != Outcome.OK):
        return None
    better, doubt = rough, None
    if (edge := model.edge(k, best.u)) is not None:
        near = model.sharpened(k, best.u, plain, BLUNT)
        blunt, _, outcome = model.modal(k, best.u, near)
        if np.any(outcome[chosen] != Outcome.OK):
            return None
        blunt = blunt._replace(shapes=_alike(blunt.shapes, rough.shapes))
        short, long = (float(nodes[edge] - nodes[edge - 1]) for nodes in (best.near[k].nodes, near.nodes))
        step = [short / (long - short) * (a - b) for a, b in zip(rough, blunt, strict=True)]
        better = Modal(*(a + s for a, s in zip(rough, step, strict=True)))
        doubt = (DOUBT * step[0], DOUBT * step[1], DOUBT * step[2])
    exact = exact._replace(shapes=_alike(exact.shapes, second.shapes))
    shapes = _over(exact.shapes, second.shapes) * _over(better.shapes, rough.shapes)
    return Offset(exact.rates / second.rates * better.rates / rough.rates, shapes, better.rest - rough.rest, doubt)


def _over(shapes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Their ratio; one where a channel stands still."""
    silent = np.abs(others) < 1e-9 * np.abs(others).max()
    return np.where(silent, 1.0, shapes / np.where(silent, 1.0, others))


def _alike(shapes: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Shapes turned and scaled to be nearest to others: a mode's own size and phase mean nothing."""
    share = np.sum(shapes.conj() * like, axis=1) / np.sum(np.abs(shapes) ** 2, axis=1)
    return share[:, None] * shapes


def doubted(model: Model, best: SearchResult, weighings: list[Weighing]) -> np.ndarray:
    """(unknowns,) how far the answer would move with what may be wrong of the better simulator."""
    pullback = np.zeros(best.u.size)
    for k, (weighing, one) in enumerate(zip(weighings, best.projections, strict=True)):
        offset = weighing.offset
        if offset is None or offset.doubt is None:
            continue
        rough, _, _ = model.modal(k, best.u, best.near[k])
        s, phi, rest = offset.doubt
        moved = Offset(offset.rates + s / rough.rates, offset.shapes + phi / rough.shapes, offset.rest + rest)
        other, outcome = model.project(k, best.u, best.near[k], replace(weighing, offset=moved))
        if outcome == Outcome.OK:
            pullback += one.jacobian.T @ (other.residual - one.residual)
    return np.linalg.pinv(information(best)) @ pullback

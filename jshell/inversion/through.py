"""The trace level: whole simulations fitted to records through the snap.

The modal level reads the ring-down and says where to begin; what it cannot see, the weak spot, is tried at a few
values. Then Levenberg and Marquardt's steps of the calibrations, noise and minimum in turn, and in the end the
correction to a finer mesh and shorter steps.

Symbols    u what the solver sees of the unknowns
Source     `jshell.inversion.search` for the minimum, `jshell.inversion.noise` for the noise
"""

import concurrent.futures
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jshell import engines
from jshell.calibration.noise import MISFIT, Noise
from jshell.calibration.versions import versions
from jshell.errors import Outcome, UnusableData, WorkerLost, choose
from jshell.inversion.kept import Kept
from jshell.inversion.model import Weighing
from jshell.inversion.motion import PLACES
from jshell.inversion.noise import SMALLEST, examined, first_weighing, reweighed
from jshell.inversion.recording import FEWEST, Recording, after_snap, channels_of, recording
from jshell.inversion.result import Inversion, Settled, drawn_up
from jshell.inversion.search import SearchResult, information, prior_rows, projections_at, solve
from jshell.inversion.snap import Snap, SnapModel, protocol
from jshell.inversion.unknowns import ParameterSet, Unknown, parameters, plain
from jshell.trace import Trace

SPOT = Unknown(low=0.01, high=0.5, nuisance=True)
SPOTS = (0.06, 0.15, 0.3)  # weak spots that a search may begin at; the middle one stands in the modal level
STEPS = 25
TOLERANCES = (1e-7, 1e-6)  # of the unknowns; of χ², where of a thousand data that is a thirtieth of a standard error
ROUNDS = 4  # of noise and minimum
FAR = 0.5  # standard errors of a step, after which the correction is made anew
CORRECTIONS = 3
DOUBT = 0.25  # of what the finer mesh changes, that may still be wrong
ATTEMPTS = 3  # of a search whose process died


@dataclass(frozen=True)
class Question:
    """What is asked of which records; fields as the arguments of `invert`, `known` per recording."""

    traces: Sequence[Trace]
    known: Sequence[Mapping[str, float]]
    asked: Mapping[str, Any]
    local: tuple[str, ...]
    channels: Sequence[str] | None
    window: tuple[float | None, float | None]
    begin: Mapping[str, float] | None
    free_rest: bool
    si: bool


@dataclass(frozen=True)
class SearchTask:
    """One search, for any engine."""

    model: SnapModel
    u: np.ndarray
    weighings: Sequence[Weighing]


Modal = Callable[[Question], Inversion]
Nuisances = Callable[[Sequence[Recording]], Mapping[str, Unknown]]


def through(question: Question, snap: Snap, modal: Modal, nuisances: Nuisances | None) -> Inversion:
    """What shell records through the snap are of.

    Args:
        question: What is asked.
        snap: How the records were made.
        modal: Answers at the modal level.
        nuisances: What no laboratory knows exactly, or None where that is not to be sought.
    """
    records, ringing = zip(*(_whole(one, k, question) for k, one in enumerate(question.traces, 1)), strict=True)
    asked, known_notes = dict(question.asked), {*question.asked, *question.known[0]}
    if asked and nuisances is not None:
        asked |= {n: w for n, w in nuisances(records).items() if n not in known_notes and n != "weak_spot"}
    question = replace(question, asked=asked, window=(max(ringing), question.window[1]))
    if asked and all(
        "weak_spot" not in {**one.known, **said} for one, said in zip(records, question.known, strict=True)
    ):
        asked = {"weak_spot": SPOT} | asked
    whole = parameters(
        [{**one.known, **said} for one, said in zip(records, question.known, strict=True)], asked, question.local,
        question.si,
    )  # fmt: skip
    protocols = tuple(protocol(one, snap, "outer_pressure" in asked) for one in records)
    model = SnapModel(
        records, whole, snap.elements, snap=snap, protocols=protocols, kept=_kept(records, whole, protocols, snap)
    )
    weighings = [first_weighing(one, (), question.free_rest) for one in records]

    begun, notes = _begun(model, question, modal)
    ranked = sorted((_ending(model, u, weighings) for u in begun), key=lambda one: one.cost)
    solutions = _searched(model, [one.u for one in ranked[: max(1, snap.starts)]], weighings)
    best = solutions[0]
    if best.outcome not in (Outcome.OK, Outcome.AT_BOUND):
        return drawn_up(model, Settled(best, weighings, []), solutions, (*notes, _counted(model)), ())
    best, weighings, noises = _settled(model, best, weighings)
    best, noises, doubt, note = _corrected(model, best, weighings, noises)
    known_notes = (*notes, note, _counted(model))
    settled = Settled(best, weighings, noises)
    return drawn_up(model, settled, solutions, known_notes, misfits(model, best, noises), doubt=doubt)


def _whole(trace: Trace, number: int, question: Question) -> tuple[Recording, float]:
    """A record as it is fitted: all of it, with what its ring-down shows of itself; and when that begins."""
    low, high = question.window
    listed, times, values, _ = channels_of(trace, number, question.channels, question.si)
    for name in listed:
        remedy = 'An echo is inverted from its ring-down, by level="modal".'
        choose(f"trace {number}", name, PLACES, noun="channel of a simulation", remedy=remedy)
    inside = (times >= (-np.inf if low is None else low)) & (times <= (np.inf if high is None else high))
    if inside.sum() < FEWEST:
        raise UnusableData(
            f"trace {number}",
            found=f"{inside.sum()} samples in the window, of {times.size} from {times[0]:.4g} to {times[-1]:.4g}",
            expected=f"at least {FEWEST}", remedy="Widen the window by start and stop, or record longer.",
        )  # fmt: skip
    times, values = times[inside], values[:, inside]
    begin = after_snap(Trace(times, dict(zip(listed, values, strict=True))), listed)
    found = recording(trace, number, listed, begin, high, question.si)
    return replace(found, times=times, values=values), float(found.times[0])


def _kept(records: Sequence[Recording], whole: ParameterSet, protocols: Sequence[Any], snap: Snap) -> Kept:
    """What is simulated of this problem, and of no other."""
    shells = [sorted(one.items()) for one in whole.known]
    made_of = [[one.channels, one.times] for one in records], shells, whole.names, whole.si
    lines = [[one.times, one.values] for one in protocols]
    return Kept(snap.checkpoint, (made_of, lines, snap.origin, snap.elements, snap.step, versions()))


def _begun(model: SnapModel, question: Question, modal: Modal) -> tuple[np.ndarray, tuple[str, ...]]:
    """(starts, unknowns) where searches may begin, and what led there in words."""
    names, to_u = model.parameters.names, model.parameters.to_u
    low, high = model.parameters.low, model.parameters.high
    spots = SPOTS if "weak_spot" in names else SPOTS[1:2]
    if question.begin is not None:
        spots = spots if "weak_spot" not in question.begin else (question.begin["weak_spot"],)
        guess, notes = dict(question.begin), ()
    elif set(map(plain, names)) == {"weak_spot"}:
        guess, notes = {}, ()
    else:
        guess, notes = _from_modes(model, question, modal)
    rows = [[guess.get(n, spot if plain(n) == "weak_spot" else np.nan) for n in names] for spot in spots]
    return to_u(np.clip(np.array(rows), low * (1 + 1e-9), high)), notes


def _from_modes(model: SnapModel, question: Question, modal: Modal) -> tuple[dict[str, float], tuple[str, ...]]:
    """What the ring-down says of the unknowns."""
    spot = {"weak_spot": SPOTS[1]} if "weak_spot" in map(plain, model.parameters.names) else {}
    said = [dict(one) | spot for one in question.known]
    asked = {n: w for n, w in question.asked.items() if n != "weak_spot"}
    found = modal(replace(question, known=said, asked=asked))
    if found.solution is None or found.model is None or not np.isfinite(found.solution.cost):
        raise UnusableData(
            "ring-down", found=f"{found.outcome.word}: it does not say where to begin",
            expected="values of the unknowns to begin at", remedy="Write begin={…}, or record longer.",
        )  # fmt: skip
    values = found.model.parameters.to_values(found.solution.u)
    words = ", ".join(f"{n} {v:.4g}" for n, v in zip(found.model.parameters.names, values, strict=True))
    return dict(zip(found.model.parameters.names, values.tolist(), strict=True)), (f"begun at the ring-down's {words}",)


def _ending(
    model: SnapModel, u: np.ndarray, weighings: Sequence[Weighing], begun: SearchResult | None = None
) -> SearchResult:
    """A place of the search with what is left there."""
    projections, outcome = projections_at(model, u, model.standing(u), weighings)
    priors = np.sum(prior_rows(model, u)[0] ** 2)
    cost = float(sum(one.residual @ one.residual for one in projections) + priors) if outcome == Outcome.OK else np.inf
    return SearchResult(u, model.standing(u), projections, cost, outcome, 0, u if begun is None else begun.begun)


def search(task: SearchTask) -> tuple[np.ndarray, int, int]:
    """Where a start leads, how the way ended, and its steps; a plain function for any engine."""
    model, whole = task.model, task.model.parameters
    low, high = whole.to_u(whole.low), whole.to_u(whole.high)
    found = solve(
        model, model.standing(task.u), task.weighings, np.clip(task.u, low, high), (low, high), max_steps=STEPS,
        tolerances=TOLERANCES,
    )  # fmt: skip
    return np.asarray(found.unknowns), int(found.outcome), int(found.steps)


def _searched(model: SnapModel, begun: Sequence[np.ndarray], weighings: Sequence[Weighing]) -> list[SearchResult]:
    """Where the starts end, the best first."""
    tasks = [SearchTask(model, u, weighings) for u in begun]
    engine = model.snap.engine
    if engine == "inline" or len(tasks) == 1:
        found = [search(one) for one in tasks]
    elif isinstance(engine, str):
        with engines.open(engine) as opened:
            found = _submitted(opened, tasks)
    else:
        found = _submitted(engine, tasks)
    solutions = []
    for one, (u, outcome, steps) in zip(tasks, found, strict=True):
        at = _ending(model, u, weighings)
        solutions.append(replace(at, outcome=Outcome(max(outcome, int(at.outcome))), steps=steps, begun=one.u))
    return sorted(solutions, key=lambda one: one.cost if one.outcome in (Outcome.OK, Outcome.AT_BOUND) else np.inf)


def _submitted(engine: Executor, tasks: Sequence[SearchTask]) -> list[tuple[np.ndarray, int, int]]:
    """All tasks on an engine; one whose process died is given out again."""
    sent = [replace(one, model=replace(one.model, snap=replace(one.model.snap, engine="inline", progress=None)))
            for one in tasks]  # fmt: skip
    found: dict[int, tuple[np.ndarray, int, int]] = {}
    for attempt in range(1, ATTEMPTS + 1):
        waiting = {engine.submit(search, sent[k]): k for k in range(len(sent)) if k not in found}
        for future in concurrent.futures.as_completed(waiting):
            try:
                found[waiting[future]] = future.result()
            except WorkerLost:
                if attempt == ATTEMPTS:
                    raise
    return [found[k] for k in range(len(sent))]


def _again(model: SnapModel, best: SearchResult, weighings: Sequence[Weighing]) -> SearchResult:
    """The minimum anew, from where it was; or the old one, where the new way led nowhere."""
    u, outcome, _ = search(SearchTask(model, best.u, weighings))
    found = _ending(model, u, weighings, best)
    if outcome in (Outcome.OK, Outcome.AT_BOUND):
        return replace(found, outcome=Outcome(outcome), steps=best.steps)
    return replace(_ending(model, best.u, weighings, best), outcome=best.outcome, steps=best.steps)


def _settled(model: SnapModel, best: SearchResult, weighings: list[Weighing]) -> Settled:
    """The minimum with the noise that it leaves."""
    noises = examined(model, best.projections, weighings)
    for _ in range(ROUNDS):
        weighings, steady = reweighed(model, best.projections, weighings, noises)
        best = _again(model, best, weighings)
        noises = examined(model, best.projections, weighings)
        if steady:
            break
    return Settled(best, weighings, noises)


def _corrected(
    model: SnapModel, best: SearchResult, weighings: list[Weighing], noises: list[list[Noise]]
) -> tuple[SearchResult, list[list[Noise]], np.ndarray, str]:
    """The minimum by a finer mesh, how far its own error may move it, and what the correction moved in words."""
    before, size = best, np.sqrt(np.abs(np.diag(np.linalg.pinv(information(best)))))
    for _ in range(CORRECTIONS):
        offsets = [model.finer(k, best.u) for k in range(len(model.recordings))]
        if any(one is None for one in offsets):
            return before, noises, np.zeros(size.size), "a finer mesh did not reach the end: not corrected"
        model.offsets = [one for one in offsets if one is not None]
        step = -best.u
        best = _again(model, best, weighings)
        step += best.u
        if np.all(np.abs(step) < FAR * size):
            break
    noises = examined(model, best.projections, weighings)
    pullback = np.zeros(size.size)
    for k, one in enumerate(best.projections):
        moved = replace(model, offsets=[(1 + DOUBT) * offset for offset in model.offsets])
        other, _ = moved.project(k, best.u, best.near[k], weighings[k])
        pullback += one.jacobian.T @ (other.residual - one.residual)
    doubt = np.linalg.pinv(information(best)) @ pullback
    shift = np.abs(best.u - before.u) / np.where(size > 0, size, np.inf)
    worst = int(np.argmax(shift))
    return best, noises, doubt, (
        f"corrected from {model.elements} elements to a finer mesh and shorter steps: "
        f"{model.parameters.names[worst]} moved by {shift[worst]:.2g} standard errors of the noise"
    )  # fmt: skip


def misfits(model: SnapModel, best: SearchResult, noises: Sequence[Sequence[Noise]]) -> list[str]:
    """Where the simulation leaves clearly more than noise, in words."""
    texts = []
    for one, projection, noise in zip(model.recordings, best.projections, noises, strict=True):
        rms = np.sqrt(np.mean((one.values - projection.curve) ** 2, axis=1))
        floor = np.maximum(one.noise if one.sigma is None else one.sigma, SMALLEST * one.values.std(axis=1))
        for c, name in enumerate(one.channels):
            if rms[c] > MISFIT * floor[c] or noise[c].coherent:
                texts.append(
                    f"misfit: the simulation leaves {100 * rms[c] / one.values[c].std():.2g}% of the scatter of {name} "
                    f"[{one.number}], {rms[c] / floor[c]:.2g} times its noise: something that is taken as known is not"
                )
    return texts


def _counted(model: SnapModel) -> str:
    """How much was simulated."""
    return f"{model.calls} simulations of {model.elements} elements"

"""The door: what shell a recording is of.

The simulator's small vibrations are fitted to ring-downs. While searching the liquid is taken to second order of its
layer; at the end its rates and shapes are corrected to those of the exact liquid, until the answer rests.

Symbols    s rates   φ changes of the channels along the modes   u what the solver sees of the unknowns
Valid for  the ring-down, small vibrations; axial symmetry
Source     variable projection: Golub & Pereyra 1973
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jshell.calibration import Prior
from jshell.errors import BadValue, NotOk, Outcome, choose
from jshell.inversion.exact import corrected
from jshell.inversion.model import ELEMENTS, Model, Weighing
from jshell.inversion.noise import described, examined, first_weighing, misfits, reweighed
from jshell.inversion.recording import Recording, recording, refuse_other_size
from jshell.inversion.response import MODES
from jshell.inversion.result import Inversion, Settled, drawn_up
from jshell.inversion.search import SearchResult, information, minimise
from jshell.inversion.snap import Snap
from jshell.inversion.starts import starts
from jshell.inversion.through import Question, through
from jshell.inversion.unknowns import SI, Unknown, parameters
from jshell.trace import Trace, traces_of

PAD, SPOT = 0.02, 0.1  # what is known of a pad [rad] and of a weak spot [-] that nothing is said of
FIRST_STEPS = 14  # of a start that is one of several
LAST_STEPS = 60  # of the best of them, where it did not come to rest
IDENTIFIED = 20.0  # of χ², that a further mode must take: two amplitudes fitted to noise take 2
ROUNDS = 5  # of noise and minimum
NEAR = 9.0  # of χ²: two minima nearer than this cannot be told apart
SAME = 0.04  # squared standard errors within which two ends are one minimum
APART = 5.0  # standard errors between them that make them two


def invert(
    traces: Trace | Sequence[Trace],
    known: Mapping[str, Any] | None = None,
    unknown: Iterable[str] | Mapping[str, Any] = (),
    *,
    local: Iterable[str] = (),
    channels: Sequence[str] | None = None,
    start: float | int | None = None,
    stop: float | int | None = None,
    begin: Mapping[str, float] | None = None,
    free_rest: bool = False,
    nuisance: bool | None = None,
    exact: bool = True,
    elements: int = ELEMENTS,
    level: Snap | str = "modal",
    throw: bool = False,
) -> Inversion:
    """What shell recordings are of: the simulator's small vibrations fitted to them.

    Args:
        traces: Ring-downs, one or several of one shell; with SI scales (or seconds and metres), or without units.
        known: Numbers of the shell by name, in SI or without units as the traces; of several recordings a sequence
            where they differ. What a trace's header says is known too, but for what is asked.
        unknown: What is asked: names, or names with None, bounds (low, high), a `Prior` or an `Unknown`. In SI:
            radius, thickness, youngs_modulus, gas_pressure, outer_pressure, density, viscosity; without units:
            thickness, gas_pressure, outer_pressure, viscosity; in both retardation (Kelvin-Voigt time of a wall that
            loses energy itself, 0 unless said), kappa, poisson_ratio, pad (half-angle of the holder, 0 is a free
            shell), weak_spot (relative loss of thickness at the buckling pole).
        local: Unknowns that every recording has for itself, such as outer_pressure.
        channels: Of H, W, V, S, x_front, x_back, and W_25, W_50, W_75, the outline's widths at these percents of its
            height; by default the first four that are recorded. Or p_scattered alone, the echo: its distance and
            calibration need not be known, and it has no rest value.
        start, stop: Window [s, or time unit]; by default from half a slow period after the dip of a snap.
        begin: Values to begin at before those that the recordings themselves suggest.
        free_rest: The values where channels rest are no data: of a camera whose scale or zero is not known.
        nuisance: What no laboratory knows exactly is sought too, from priors: a pad of the header to 0.02 rad, a weak
            spot of 0 ± 0.1, unless `known` or `unknown` say more. By default of records with SI units.
        exact: Correct the answer to the exact liquid.
        elements: Of the meridian.
        level: `modal` for ring-downs; `trace`, or a `Snap` that says how the pressure went, for records through the
            snap: the whole simulation is fitted, the weak spot sought beside what is asked unless it is known.
        throw: Raise `NotOk` unless the outcome is ok.

    Returns:
        Estimates with intervals. A fit that did not come to rest, and unknowns that the recordings do not determine,
        have no numbers; `free_directions` says what is determined.

    Raises:
        BadName: No such number or channel.
        BadValue: Nothing asked, or something neither known nor asked; no trace, but the path of a file.
        UnusableData: A record too short, or without an oscillation.

    Example:
        >>> import jshell as js
        >>> trace = js.io.read_trace(js.io.example("attached_R_HW.csv"))  # doctest: +SKIP
        >>> print(js.invert(trace, unknown=("youngs_modulus", "gas_pressure")))  # doctest: +SKIP
    """
    choose("level", level, ("modal", "trace")) if isinstance(level, str) else None
    listed = traces_of(traces)
    asked = unknown if isinstance(unknown, Mapping) else tuple([unknown] if isinstance(unknown, str) else unknown)
    given = _per_recording(known or {}, len(listed))
    si = _in_si(listed, {*asked, *given[0]})
    asked = dict(asked) if isinstance(asked, Mapping) else dict.fromkeys(asked)
    for name in asked:
        if any(name in one for one in given):
            raise BadValue(
                name, found="both known and asked", expected="one of the two",
                remedy="Leave one out; what is known of something asked is a prior.",
            )  # fmt: skip
    if level != "modal":
        snap = Snap() if isinstance(level, str) else level
        window = None if start is None else float(start), None if stop is None else float(stop)
        question = Question(listed, given, asked, tuple(local), channels, window, begin, free_rest, si)
        unsure = nuisances if (si if nuisance is None else nuisance) else None
        return _finished(through(question, snap, _ring_downs, unsure), throw)
    records = tuple(recording(one, k, channels, start, stop, si) for k, one in enumerate(listed, 1))
    if asked and (si if nuisance is None else nuisance):
        asked |= {n: w for n, w in nuisances(records).items() if n not in asked and n not in given[0]}
    numbers = [{**one.known, **said} for one, said in zip(records, given, strict=True)]
    whole = parameters(numbers, asked, tuple(local), si)
    for one, known_of_it in zip(records, numbers, strict=True):
        if not free_rest and "radius" not in asked:
            refuse_other_size(one, known_of_it.get("radius", 1.0))
    model = Model(records, whole, elements)
    weighings = [first_weighing(one, tuple(range(_shown(one))), free_rest) for one in records]

    begun, promising = starts(records, whole)
    if begin is not None:
        for name in begin:
            choose("begin", name, whole.names, noun="unknown")
        usual = whole.to_values(begun[0] if len(begun) else 0.5 * (whole.to_u(whole.low) + whole.to_u(whole.high)))
        at = [begin.get(name, value) for name, value in zip(whole.names, usual, strict=True)]
        begun = np.concatenate([whole.to_u(np.array([at])), begun])
        promising += 1
    solutions = _brought_to_rest(model, _from_starts(model, begun, promising, weighings), weighings)
    if solutions[0].outcome not in (Outcome.OK, Outcome.AT_BOUND):
        return _finished(drawn_up(model, Settled(solutions[0], weighings, []), solutions, (), ()), throw)
    first = weighings
    best, weighings, noises = _settled(model, solutions[0], first)
    untried = begun[len(solutions) :]
    if len(untried) and misfits(model, best.projections, noises):
        others, better = _others(model, untried, first, solutions)
        if better:
            best, weighings, noises = better
            solutions = [others.pop(), *solutions]  # the last that was tried
        solutions += others
    elif len(untried) and any(one.memory for row in noises for one in row):
        # autocorrelated noise may be a misfit in disguise: whether another minimum leaves less, under the same weights
        begun = np.concatenate([best.u[None], untried])
        anew = [minimise(model, u, weighings, max_steps=40, legs=3) for u in begun]
        anew = _brought_to_rest(model, sorted(anew, key=_rank), weighings)
        solutions += anew
        if anew[0].outcome in (Outcome.OK, Outcome.AT_BOUND) and not _same(best, anew[0]):
            best, weighings, noises = _settled(model, anew[0], weighings)
    notes = []
    if exact:
        best, weighings, note = corrected(model, best, weighings, _again)
        noises = examined(model, best.projections, weighings)
        notes.append(note)
    rivals = _rivals(model, best, solutions, weighings)
    warnings = misfits(model, best.projections, noises)
    return _finished(drawn_up(model, Settled(best, weighings, noises), solutions, notes, warnings, rivals), throw)


def _ring_downs(asked: Question) -> Inversion:
    """The modal level's answer to the same question."""
    known = {name: [one[name] for one in asked.known] for name in asked.known[0]}
    return invert(
        asked.traces, known, asked.asked, local=asked.local, channels=asked.channels, start=asked.window[0],
        stop=asked.window[1], free_rest=asked.free_rest, nuisance=False, exact=False,
    )  # fmt: skip


def nuisances(records: Sequence[Recording]) -> dict[str, Unknown]:
    """What is taken as known to its prior only."""
    pads = {one.known.get("pad", 0.0) for one in records}
    found = {"weak_spot": Unknown(prior=Prior(0.0, SPOT), nuisance=True)}
    if len(pads) == 1 and (pad := pads.pop()) > 0:
        found["pad"] = Unknown(0.5 * pad, 1.5 * pad, Prior(pad, PAD), nuisance=True)
    return found


def _finished(result: Inversion, throw: bool) -> Inversion:
    if throw and result.outcome != Outcome.OK:
        raise NotOk(result.title, result.outcome, result.advice)
    return result


def _per_recording(known: Mapping[str, Any], count: int) -> list[dict[str, float]]:
    """What is said to be known, of every recording."""
    for name, value in known.items():
        if np.ndim(value) and np.shape(value) != (count,):
            raise BadValue(
                f"known {name!r}", found=f"{np.size(value)} values", expected=f"one, or one for each of {count} traces",
                remedy="Give as many.",
            )  # fmt: skip
    pick = lambda value, k: float(np.broadcast_to(np.asarray(value, dtype=float), (count,))[k])  # noqa: E731
    return [{name: pick(value, k) for name, value in known.items()} for k in range(count)]


def _in_si(traces: Sequence[Trace], names: set[str]) -> bool:
    """Whether the numbers have units: the traces have scales, or what is said of the shell has."""
    if any(one.scales is not None for one in traces):
        return True
    return all(one.conditions is None for one in traces) and bool(names & (set(SI) - {"thickness"}) & _ONLY_SI)


_ONLY_SI = {"radius", "youngs_modulus", "density"}


def _shown(one: Recording) -> int:
    """How many modes a recording shows."""
    return {"one": 1, "two": 2}.get(one.verdict, 3)


def _from_starts(model: Model, begun: np.ndarray, promising: int, weighings: Sequence[Weighing]) -> list[SearchResult]:
    """Where the starts end, the best first; a start whose end describes the recordings is the last that is tried.

    Beyond the promising ones only until one leads to a shell at all.
    """
    solutions: list[SearchResult] = []
    for k, u in enumerate(begun):
        if k >= promising and any(np.isfinite(one.cost) for one in solutions):
            break
        solution = minimise(model, u, weighings, max_steps=FIRST_STEPS if promising > 1 else 40, legs=3)
        solutions.append(solution)
        if k > 0 and np.isfinite(solution.cost) and described(model, min(solutions, key=_rank).projections):
            break
    return sorted(solutions, key=_rank)


def _others(
    model: Model, begun: np.ndarray, weighings: list[Weighing], before: Sequence[SearchResult]
) -> tuple[list[SearchResult], Settled | None]:
    """Where less promising starts end, after the best minimum left a misfit; and the first that leaves none.

    All are followed to their ends: under the first weights, of fewer modes, a right one may cost twice a wrong one.
    """
    solutions: list[SearchResult] = []
    for u in begun:
        solution = _brought_to_rest(model, [minimise(model, u, weighings, max_steps=40, legs=3)], weighings)[0]
        known = any(_same(one, solution) for one in (before[0], *solutions))
        solutions.append(solution)
        if solution.outcome in (Outcome.OK, Outcome.AT_BOUND) and not known:
            settled = _settled(model, solution, weighings)
            if not misfits(model, settled.best.projections, settled.noises):
                return solutions, settled
    return solutions, None


def _same(one: SearchResult, other: SearchResult) -> bool:
    """Whether two starts ended in one minimum: nearer to each other than a fifth of their standard errors."""
    if not (np.isfinite(one.cost) and np.isfinite(other.cost)) or one.outcome != other.outcome:
        return False
    away = other.u - one.u
    return bool(away @ information(one) @ away < SAME)


def _brought_to_rest(model: Model, solutions: list[SearchResult], weighings: Sequence[Weighing]) -> list[SearchResult]:
    """The best of the ends, sought on where the steps of a start did not reach a valley's floor."""
    best = solutions[0]
    if best.outcome not in (Outcome.NOT_CONVERGED, Outcome.STALLED) or not np.isfinite(best.cost):
        return solutions
    on = minimise(model, best.u, weighings, max_steps=LAST_STEPS, legs=3)
    # its nodes are new ones, on which the same shell leaves a little more or less
    if not on.cost <= best.cost * (1 + 1e-3) + NEAR:
        return solutions
    return [replace(on, begun=best.begun, steps=best.steps + on.steps), *solutions[1:]]


def _rank(solution: SearchResult) -> float:
    return solution.cost if np.isfinite(solution.cost) else np.inf


def _settled(model: Model, best: SearchResult, weighings: list[Weighing]) -> Settled:
    """The minimum with the noise that it leaves, and as many modes as rise above that noise."""
    noises = examined(model, best.projections, weighings)
    for _ in range(ROUNDS):
        weighings, steady = reweighed(model, best.projections, weighings, noises)
        best = _again(model, best, weighings)
        best, weighings, grown = _more_modes(model, best, weighings)
        noises = examined(model, best.projections, weighings)
        if steady and not grown:
            break
    return Settled(best, weighings, noises)


def _again(model: Model, best: SearchResult, weighings: Sequence[Weighing]) -> SearchResult:
    """The minimum anew, from where it was; or the old one, where the new way led nowhere."""
    found = minimise(model, best.u, weighings, max_steps=20, legs=2)
    return replace(found, begun=best.begun) if found.outcome in (Outcome.OK, Outcome.AT_BOUND) else best


def _more_modes(
    model: Model, best: SearchResult, weighings: list[Weighing]
) -> tuple[SearchResult, list[Weighing], bool]:
    """Another mode of the simulator for each recording that shows it above its noise."""
    grown = False
    for k, one in enumerate(model.recordings):
        count = len(weighings[k].modes)
        if count == MODES:
            continue
        richer = replace(weighings[k], modes=tuple(range(count + 1)))
        with_it, outcome = model.project(k, best.u, best.near[k], richer)
        plain, now = model.project(k, best.u, best.near[k], weighings[k])
        if outcome != Outcome.OK or now != Outcome.OK:
            continue
        nyquist = np.pi / float(np.median(np.diff(one.times)))
        reachable = float(model.modal(k, best.u, best.near[k])[0].rates[count].imag) < 0.8 * nyquist
        if reachable and plain.residual @ plain.residual - with_it.residual @ with_it.residual > IDENTIFIED:
            weighings = [*weighings[:k], richer, *weighings[k + 1 :]]
            grown = True
    return (_again(model, best, weighings) if grown else best), weighings, grown


def _rivals(
    model: Model, best: SearchResult, solutions: Sequence[SearchResult], weighings: Sequence[Weighing]
) -> list[SearchResult]:
    """Other minima that describe the recordings as well."""
    found = []
    weight = information(best)
    for k, other in enumerate(solutions):
        away = other.u - best.u
        if not np.isfinite(other.cost) or away @ weight @ away < APART**2:
            continue
        if any(_same(one, other) for one in solutions[:k]):
            continue
        again = minimise(model, other.u, weighings, max_steps=20, legs=2)
        away = again.u - best.u
        if again.outcome == Outcome.OK and again.cost < best.cost + NEAR and away @ weight @ away > APART**2:
            found.append(again)
    return found

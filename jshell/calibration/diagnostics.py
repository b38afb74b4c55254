"""What a trace fit found: constants with errors, free directions and what would fix them, misfits, notes.

Symbols    J Jacobian of constants and linear parameters together   r weighted residual
Source     Mokbel et al. 2021: eq:defw, eq:taureal (its prefactor 2 is 1/2)
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.ar1 import examined, fit_ar1, power
from jshell.calibration.data import with_sigma
from jshell.calibration.estimate import Estimate, starts_of
from jshell.calibration.frequency_model import square_only
from jshell.calibration.least_squares import SolverResult, best_of, value_and_jacobian
from jshell.calibration.lengths import without_data
from jshell.calibration.linearization import Linearization, linearized, whitened
from jshell.calibration.losses import TraceModel, angular_frequencies, linear_names, targets
from jshell.calibration.misfit import IDENTIFIED, misfits, mode_powers, silent_directions, snaps
from jshell.calibration.noise import Noise, taken_as_white
from jshell.calibration.objective import Objective
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem
from jshell.calibration.report import FitResult
from jshell.calibration.robust import Robust
from jshell.calibration.sampling import sampling
from jshell.calibration.uncertainty import (
    NO_SCATTER,
    Uncertainty,
    in_words,
    loose_directions,
    propagate,
    share_in_words,
    uncertainty,
)
from jshell.calibration.undetermined import (
    NO_MINIMUM,
    RESTLESS,
    estimates_of,
    hidden,
    hide_derived,
    open_constants,
    without_open,
)
from jshell.errors import Outcome
from jshell.trace import Trace


def trace_result(
    problem: Problem,
    parameters: Unknowns,
    solution: SolverResult,
    constrained: np.ndarray,
    cut: list[Trace],
    *,
    noise: str = "auto",
    robust: Robust | None = None,
) -> FitResult:
    """The best ending, judged: errors, what they leave out, and whether the model describes the records.

    Args:
        problem: What was fitted.
        parameters: Its parameters.
        solution: Of the solver.
        constrained: (starts, names) where it began.
        cut: The traces inside the window.
        noise: `auto` tests the residual and takes noise as autocorrelated where it is; `white` takes it as white.
        robust: What a robust loss gave, where there was one.
    """
    model = problem.model
    absolute = with_sigma(cut, model.records[0].channels)
    size = float(sum(np.sum((np.asarray(block) - np.mean(block)) ** 2) for block in targets(model)))
    best, same = best_of(solution, size)
    values = np.array(parameters.constrained(np.asarray(solution.unknowns)[best]))
    found = linearized(values, problem, parameters, None if robust is None else robust.linear)
    noises = examined(problem, found)
    notes = [f"rest states: {', '.join(f'V = {float(one.state.volume):.5g}' for one in model.records)}"]
    outcome = Outcome(int(np.asarray(solution.outcome)[best]))
    if noise == "auto" and robust is None and any(one.memory > 0 for one in noises):
        # what a misfit leaves is motion, of which a memory only seems to tell: there the white minimum stays
        trusted = outcome == Outcome.OK and not misfits(problem, found.residual, cut, noises, robust=False)
        problem, moved = fit_ar1(problem, found, noises, parameters, free_to_move=trusted)
        notes.append(
            "the residual is not white: the noise is taken as autocorrelated, e_k = φ e_{k-1} + fresh"
            + (", and the constants are those of that noise" if moved is not found else "")
        )
        found = moved
    values, r = found.values, found.residual

    names = parameters.names
    free = [parameters.names.index(name) for name in parameters.free]
    varied = tuple(names[i] for i in free)
    shown, errors = _errors(problem, parameters, found, absolute, robust)
    chi_square = power(r)

    count = len(free)
    covariance = errors.covariance[:count, :count]
    directions = [free_direction(d[:count], varied, model) for d in errors.null if moves(d, varied)]
    level = (
        chi_square / max(1, used_samples(problem) - errors.stderr.size)
        if robust is None
        else robust.variance * float(np.max(robust.scale)) ** 2
    )
    quiet, loud = quiet_modes(problem, found, level, absolute and robust is None, noises)
    silent: list[np.ndarray] = []
    if not directions:
        for direction, error in loose_directions(covariance, shown[free]):
            directions.append(
                f"{in_words(direction, varied)} is known to {share_in_words(error)} only: {remedy(model, cut, quiet)}"
            )
        if not directions and quiet:
            silent = silent_directions(problem, values, parameters.slopes(values), loud)
            for direction in silent:
                directions.append(
                    f"{in_words(direction, varied)} changes little in these data: {remedy(model, cut, quiet)}"
                )
            if not directions:
                directions.append(remedy(model, cut, quiet))
    if directions and outcome in (Outcome.OK, Outcome.AT_BOUND):
        outcome = Outcome.RANK_DEFICIENT
    texts = [*snaps(cut), *misfits(problem, r, cut, noises, robust is not None)]
    if problem.memory is None:
        texts += [f"what is left of {one.words()}: errors that take it as white are too small" for one in noises
                  if one.memory > 0]  # fmt: skip
        noises = [taken_as_white(one) for one in noises]

    stretch = parameters.stretch(shown)
    stretch = np.where(stretch == 0, 1.0, stretch)  # at k_vs = 0, which has no error there
    slopes = parameters.slopes(values) * stretch[free]  # the covariance is of k_vs, the model's values of its square
    derived, gradient = _derived(problem, values, slopes, covariance)
    if outcome == Outcome.OK and not all(np.isfinite(e.value) for e in derived if e.name.startswith("omega")):
        outcome = Outcome.OUT_OF_RANGE  # the constants found have no slow oscillation at all
    undetermined = open_constants(varied, shown[free], errors, outcome, silent)
    null = np.array([*errors.null[:, :count], *silent]).reshape(-1, count)
    derived = hide_derived(derived, gradient, shown[free], null, outcome)

    estimates = estimates_of(names, varied, shown, parameters.reported(constrained[best]), errors, undetermined)
    for name, _ in parameters.tied:
        i = names.index(name)
        row = slopes[i] / stretch[i]
        one = Estimate(name, float(shown[i]), float(propagate(row[None], covariance)[0]), role="tied")
        lost = [other for other, slope in zip(varied, row, strict=True) if slope != 0 and other in undetermined]
        estimates[i] = hidden(one, f"it follows from {lost[0]}") if lost else one
    for j, (name, value) in enumerate(zip(linear_names(model), np.concatenate(found.linear), strict=True), count):
        one = Estimate(name, float(value), float(errors.stderr[j]), errors.reasons[j], role="nuisance")
        lost = NO_MINIMUM if outcome in RESTLESS else one.reason if one.reason != NO_SCATTER else ""
        estimates.append(hidden(one, lost) if lost else one)

    notes += method_notes(model, problem, absolute, robust)
    notes += sampling_notes(cut, absolute)
    notes += sign_of_coupling(model, parameters, estimates)
    notes += other_minima(solution, parameters, same)
    if problem.model.loss == "strict" or any(one.memory for one in noises):
        notes += [one.words() for one in noises if one.correlated]
    return FitResult(
        title=f"{model.loss.capitalize()} fit of {len(cut)} trace{'s' if len(cut) > 1 else ''}, "
        f"channels {', '.join(model.records[0].channels)}, solver {model.solver}",
        outcome=outcome,
        estimates=tuple(estimates),
        derived=derived,
        covariance=without_open(covariance, varied, undetermined),
        correlation=without_open(errors.correlation[:count, :count], varied, undetermined),
        varied=varied,
        residual=r,
        chi_square=chi_square,
        n_data=used_samples(problem),
        n_varied=errors.stderr.size,
        absolute=absolute,
        free_directions=tuple(directions),
        starts=starts_of(solution, constrained, same),
        notes=tuple(notes),
        warnings=tuple(texts),
        dipole=model.dipole,
        noise=tuple(noises),
        traces=tuple(cut),
        minimum=tuple(float(x) for x in values) if undetermined else (),
        minimised=Objective.of_traces(problem, parameters, values, absolute)
        if robust is None
        else Objective.of_traces(
            robust.problem,
            parameters,
            values,
            absolute,
            robust.kind,
            tuple(np.sqrt(weights) for weights in robust.weights),
        ),
    )


def _errors(
    problem: Problem, parameters: Unknowns, found: Linearization, absolute: bool, robust: Robust | None
) -> tuple[np.ndarray, Uncertainty]:
    """Constants as shown, errors of constants and linear parameters together."""
    r, J = whitened(problem, found)
    shown = parameters.reported(found.values)
    free = [parameters.names.index(name) for name in parameters.free]
    J = J * np.append(parameters.stretch(shown)[free], np.ones(J.shape[1] - len(free)))
    size = r.size - len(found.prior)
    if robust is not None:
        r[:size], J[:size] = r[:size] / robust.scale, J[:size] / robust.scale[:, None]
    values = np.concatenate([shown[free], np.concatenate(found.linear)])
    variance = None if robust is None else robust.variance
    absolute = absolute and robust is None  # a robust fit takes its scale from the residual
    return shown, uncertainty(
        J[:size], r[:size], values, count=used_samples(problem), absolute=absolute, prior=J[size:], variance=variance
    )


def used_samples(problem: Problem) -> int:
    """Samples that count."""
    return int(sum(np.sum(np.asarray(record.weight) > 0) for record in problem.model.records))


def _derived(
    problem: Problem, values: np.ndarray, slopes: np.ndarray, covariance: np.ndarray
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """ω-, ω+ and τ of every trace, with errors; and their gradient (numbers, free) by the constants as shown."""
    model = problem.model
    modal = model.loss == "modal"
    listed = []
    for one, places in zip(model.records, problem.places, strict=True):
        damped = modal or (model.tied and values[places[3]] > 0)
        listed.append(bool(damped and float(one.conditions.viscosity) > 0))
    bare = eqx.tree_at(lambda j: (j.model, j.memory), problem, (without_data(model), None), is_leaf=lambda x: x is None)
    value, gradient = _derived_jacobian(values, bare, tuple(listed))
    along = np.asarray(gradient) @ slopes
    stderr = propagate(along, covariance)
    names = []
    for i in range(len(model.records)):
        tail = f"[{i + 1}]" if len(model.records) > 1 else ""
        names += [f"omega_minus{tail}", f"omega_plus{tail}"]
        if listed[i]:
            names.append(f"beta1/alpha1{tail}" if modal else f"tau{tail}")
    found = tuple(
        Estimate(name, float(v), float(e), role="derived")
        for name, v, e in zip(names, np.asarray(value), stderr, strict=True)
    )
    return found, along


@eqx.filter_jit
def _derived_jacobian(
    values: np.ndarray | jax.Array, problem: Problem, listed: tuple[bool, ...]
) -> tuple[jax.Array, jax.Array]:
    """ω-, ω+ and, where `listed`, the damping of every trace; with derivatives."""
    modal = problem.model.loss == "modal"

    def numbers(p: jax.Array) -> jax.Array:
        found = []
        for (own, model), has_tau in zip(problem.terms(p), listed, strict=True):
            one = model.records[0]
            constants = own[:3] if modal else own[:3].at[2].set(own[2] ** 2)
            found += list(jnp.sqrt(angular_frequencies(constants, one)))
            if has_tau:
                eta = one.conditions.viscosity
                found.append(1 / (2 * own[3] * eta) if modal else own[0] / (2 * own[3] * eta))
        return jnp.stack(found)

    return value_and_jacobian(numbers, jnp.asarray(values))


def moves(direction: np.ndarray, varied: tuple[str, ...]) -> bool:
    """Whether a free direction moves a constant, not only amplitudes."""
    return bool(np.abs(direction[: len(varied)]).max() > 1e-6)


def free_direction(direction: np.ndarray, varied: tuple[str, ...], model: TraceModel) -> str:
    """A combination of constants that the data leave free, and what would fix it."""
    text = in_words(direction, varied)
    if model.loss == "modal":
        return (
            f"{text} changes neither ω-, ω+ nor τ of these traces: fix alpha2, or add a trace at a second "
            "pressure, or fit V and S by the strict loss"
        )
    return f"{text} changes nothing in these traces: fix one of them, or add a trace at a second pressure"


def remedy(model: TraceModel, cut: list[Trace], quiet: list[str]) -> str:
    """What data would fix a direction that is known badly."""
    texts = list(quiet)
    span = max(float(np.ptp(np.asarray(trace.times))) for trace in cut)
    slow = min(float(jnp.sqrt(9 * jnp.pi**2 / 8) / one.state.volume) for one in model.records)  # area alone, α2 = 1
    if span * slow < 2 * np.pi:
        texts.append(f"the longest record, {span:.3g} time units, holds about one period or less")
    texts.append("take a longer or cleaner record in which both modes ring, add a second pressure, or fix one of them")
    return "; ".join(texts)


def quiet_modes(
    problem: Problem, found: Linearization, reduced: float, absolute: bool, noises: list[Noise]
) -> tuple[list[str], int]:
    """Modes that no trace holds, in words, and the louder of the two."""
    total, at = np.zeros(2), 0
    for term in problem.terms(found.values):
        count = 1 if problem.model.loss == "strict" else len(term.model.records[0].channels)
        total += mode_powers(term, found.linear[at : at + count], found.design[at : at + count])
        at += count
    louder = max((1 + one.memory) / (1 - one.memory) for one in noises)
    level = (1.0 if absolute else max(reduced, 1e-300)) * louder
    texts = [
        f"the {which} mode does not rise above the noise (its χ² is {power / level:.0f}, {IDENTIFIED:g} are needed)"
        for which, power in zip(("slow", "fast"), total, strict=True)
        if power < IDENTIFIED * level
    ]
    return texts, int(np.argmax(total))


def sign_of_coupling(model: TraceModel, parameters: Unknowns, estimates: list[Estimate]) -> list[str]:
    """What is to be said of the sign of k_VS."""
    if model.loss == "modal":
        return [square_only(parameters)]
    return [
        f"the sign of {e.name} is open: {e.value:+.3g} is {abs(e.value / e.stderr):.1f} standard errors from 0"
        for e in estimates
        if e.name.startswith("k_vs") and e.role == "constant" and np.isfinite(e.stderr) and abs(e.value) < 2 * e.stderr
    ]


def other_minima(solution: SolverResult, parameters: Unknowns, same: np.ndarray) -> list[str]:
    """Minima above the best one in which starts ended."""
    cost, outcome = np.asarray(solution.cost), np.asarray(solution.outcome)
    ended = ((outcome == Outcome.OK) | (outcome == Outcome.AT_BOUND)) & ~same & np.isfinite(cost)
    lowest, texts = cost[same].min() if same.any() else np.nan, []
    while ended.any():
        first = int(np.argmin(np.where(ended, cost, np.inf)))
        alike = ended & (np.abs(cost - cost[first]) <= 1e-4 * cost[first])
        values = np.asarray(parameters.constrained(np.asarray(solution.unknowns)[first]))
        listed = ", ".join(
            f"{name} = {v:.4g}"
            for name, v in zip(parameters.names, parameters.reported(values), strict=True)
            if name in parameters.free
        )
        where = " at k_VS = 0" if "k_vs" in parameters.squared and "k_vs = 0," in listed + "," else ""
        times = f"{cost[first] / lowest:.4g} times" if lowest > 0 else f"{cost[first]:.3g} against 0, not"
        texts.append(f"{alike.sum()} starts ended in another minimum{where}, {times} the lowest χ²: {listed}")
        ended &= ~alike
    return texts


def method_notes(model: TraceModel, problem: Problem, absolute: bool, robust: Robust | None) -> list[str]:
    notes = []
    if model.loss == "strict" and model.tied:
        notes.append("beta2 is tied to beta1 so that both modes decay alike")
    if not absolute:
        notes.append("each channel is weighed by its own noise, estimated from sixth differences")
    if len(problem.prior_at):
        names = ", ".join(problem.names[i] for i in problem.prior_at)
        notes.append(f"priors are held for {names}; their rows are not scaled and not counted as data")
    if robust is not None:
        light = sum(int(np.sum(weights < 0.5)) for weights in robust.weights)
        notes.append(f"robust loss {robust.kind}: {light} samples count less than half; χ² counts all in full")
    return notes


def sampling_notes(cut: list[Trace], absolute: bool) -> list[str]:
    """How traces are sampled that are no even grid as they stand; alike ones once."""
    found: dict[str, list[str]] = {}
    for number, trace in enumerate(cut, 1):
        taken = sampling(np.asarray(trace.times, dtype=float))
        words = taken.words()
        if not (taken.even or absolute):
            words += "; sixth differences are divided ones, of samples without a gap between them"
        if words:
            found.setdefault(words, []).append(str(number))
    return [f"trace {', '.join(numbers)}: {words}" for words, numbers in found.items()]

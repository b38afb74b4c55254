"""What a trace fit found: constants with errors, free directions, misfits.

Symbols    J Jacobian of constants and linear parameters together   r weighted residual
Source     Mokbel et al. 2021: eq:defw, eq:taureal (its prefactor 2 is 1/2)
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.least_squares import Ending, best_of, value_and_jacobian
from jshell.calibration.losses import Problem, best_linear, full_residual, linear_names, pulsations, targets
from jshell.calibration.master_curve import SQUARE_ONLY
from jshell.calibration.parameters import Unknowns
from jshell.calibration.records import noise_of
from jshell.calibration.report import Estimate, FitResult, starts_of
from jshell.calibration.uncertainty import Uncertainty, in_words, propagate, uncertainty
from jshell.errors import Outcome
from jshell.trace import Trace

MISFIT = 1.5  # residual over noise: sampling scatter of either is below a tenth for a hundred samples


def trace_result(
    problem: Problem,
    space: Unknowns,
    ending: Ending,
    natural: np.ndarray,
    cut: list[Trace],
    absolute: bool,
    texts: list[str],
) -> FitResult:
    """The best ending, judged: errors, what they leave out, and whether the model describes the records."""
    size = float(sum(np.sum((np.asarray(block) - np.mean(block)) ** 2) for block in targets(problem)))
    best, same = best_of(ending, size)
    values = np.array(space.natural(ending.unknowns[best]))
    r, shown, errors, linear = _errors(problem, space, values, absolute)
    names = tuple(_shown(name) for name in space.names)
    free = [space.names.index(name) for name in space.free]
    varied = tuple(names[i] for i in free)

    outcome = Outcome(int(ending.outcome[best]))
    directions = tuple(_advice(direction, varied, problem) for direction in errors.null if _moves(direction, varied))
    if directions and outcome in (Outcome.OK, Outcome.AT_BOUND):
        outcome = Outcome.RANK_DEFICIENT
    texts = [*texts, *_misfits(problem, r, cut)]

    derived = _derived(problem, space, values, errors.covariance[: len(free), : len(free)])
    if outcome == Outcome.OK and not all(np.isfinite(e.value) for e in derived if e.name.startswith("omega")):
        outcome = Outcome.OUT_OF_RANGE  # the constants found have no slow oscillation at all

    begun = np.sqrt(np.maximum(natural[best, 2], 0)) if problem.loss == "modal" else natural[best, 2]
    estimates = []
    for i, name in enumerate(names):
        if i not in free:
            estimates.append(Estimate(name, float(shown[i]), role="fixed"))
            continue
        j = free.index(i)
        begin = begun if i == 2 else natural[best, i]
        estimates.append(Estimate(name, float(shown[i]), float(errors.stderr[j]), errors.reasons[j], float(begin)))
    for j, (name, value) in enumerate(zip(linear_names(problem), np.concatenate(linear), strict=True), len(free)):
        estimates.append(Estimate(name, float(value), float(errors.stderr[j]), errors.reasons[j], role="nuisance"))
    count = len(free)
    notes = [f"rest states: {', '.join(f'V = {float(one.state.volume):.5g}' for one in problem.records)}"]
    if problem.loss == "modal":
        notes.append(SQUARE_ONLY)
    elif problem.tied:
        notes.append("beta2 is tied to beta1 so that both modes decay alike")
    if not absolute:
        notes.append("each channel is weighed by its own noise, estimated from sixth differences")
    return FitResult(
        title=f"{problem.loss.capitalize()} fit of {len(cut)} trace{'s' if len(cut) > 1 else ''}, "
        f"channels {', '.join(problem.records[0].channels)}, solver {problem.solver}",
        outcome=outcome,
        estimates=tuple(estimates),
        derived=derived,
        covariance=errors.covariance[:count, :count],
        correlation=errors.correlation[:count, :count],
        varied=varied,
        residual=r,
        chi_square=float(r @ r),
        n_data=r.size,
        n_varied=errors.stderr.size,
        absolute=absolute,
        free_directions=directions,
        starts=starts_of(ending, natural, same),
        notes=tuple(notes),
        warnings=tuple(texts),
        dipole=problem.dipole,
    )


def _shown(name: str) -> str:
    return "k_vs" if name == "k_vs_squared" else name


def _errors(
    problem: Problem, space: Unknowns, values: np.ndarray, absolute: bool
) -> tuple[np.ndarray, np.ndarray, Uncertainty, list[np.ndarray]]:
    """Residual, constants as shown, errors of constants and linear parameters together, linear parameters."""
    linear, design = best_linear(jnp.asarray(values), problem)
    r, J = _full_jacobian(jnp.asarray(values), [jnp.asarray(c) for c in linear], problem)
    J, r = np.array(J), np.asarray(r)
    shown = values.copy()
    if problem.loss == "modal":
        shown[2] = np.sqrt(max(values[2], 0.0))
        J[:, 2] *= 2 * shown[2]
    free = [space.names.index(name) for name in space.free]
    whole = np.concatenate([J[:, free], design], axis=1)
    sizes = np.concatenate([shown[free], np.concatenate(linear)])
    return r, shown, uncertainty(whole, r, sizes, absolute=absolute), linear


@eqx.filter_jit
def _full_jacobian(values: jax.Array, linear: list[jax.Array], problem: Problem) -> tuple[jax.Array, jax.Array]:
    return value_and_jacobian(lambda p: full_residual(p, linear, problem), values)


def _moves(direction: np.ndarray, varied: tuple[str, ...]) -> bool:
    """Whether a free direction moves a constant, not only amplitudes."""
    return bool(np.abs(direction[: len(varied)]).max() > 1e-6)


def _advice(direction: np.ndarray, varied: tuple[str, ...], problem: Problem) -> str:
    text = in_words(direction[: len(varied)], varied)
    if problem.loss == "modal":
        return (
            f"{text} changes neither ω-, ω+ nor τ of these traces: fix alpha2, or add a trace at a second "
            "pressure, or fit V and S by the strict loss"
        )
    return f"{text} changes nothing in these traces: fix one of them, or add a trace at a second pressure"


def _misfits(problem: Problem, r: np.ndarray, cut: list[Trace]) -> list[str]:
    """Where the model leaves clearly more than the noise."""
    texts, at = [], 0
    hint = "; the modal loss asks less of it" if problem.loss == "strict" else ""
    for number, (one, trace) in enumerate(zip(problem.records, cut, strict=True), 1):
        for row, name in enumerate(one.channels):
            weight, values = np.asarray(one.weight[row]), np.asarray(one.data[row])
            left = r[at : at + weight.size] / weight
            at += weight.size
            rms, scatter = float(np.sqrt(np.mean(left**2))), float(values.std())
            if name in trace.sigma:
                noise = float(np.sqrt(np.mean(1 / weight**2)))
            elif one.uniform:
                noise = noise_of(values)
            else:
                continue
            if rms > MISFIT * noise and rms > 1e-5 * scatter:
                texts.append(
                    f"misfit: the {problem.loss} model leaves {100 * rms / scatter:.2g}% of the scatter of {name} "
                    f"[{number}], {rms / max(noise, 1e-300):.2g} times its noise: it does not describe this record, "
                    "and the errors are too small" + hint
                )
    return texts


def _derived(problem: Problem, space: Unknowns, values: np.ndarray, covariance: np.ndarray) -> tuple[Estimate, ...]:
    """ω-, ω+ and τ of every trace, with errors; what the data determine even where the constants are not."""
    modal = problem.loss == "modal"
    viscous = [float(one.conditions.viscosity) > 0 for one in problem.records]
    damped = modal or (problem.tied and values[3] > 0)

    told = tuple(damped and wet for wet in viscous)
    value, gradient = _derived_jacobian(jnp.asarray(values), problem, told)
    gradient = np.array(gradient)
    if modal:
        gradient[:, 2] *= 2 * np.sqrt(max(values[2], 0.0))  # the covariance is of k_vs, not of its square
    free = [space.names.index(name) for name in space.free]
    stderr = propagate(gradient[:, free], covariance)
    names = []
    for i in range(len(problem.records)):
        tail = f"[{i + 1}]" if len(problem.records) > 1 else ""
        names += [f"omega_minus{tail}", f"omega_plus{tail}"]
        if told[i]:
            names.append(f"beta1/alpha1{tail}" if modal else f"tau{tail}")
    return tuple(
        Estimate(name, float(v), float(e), role="derived")
        for name, v, e in zip(names, np.asarray(value), stderr, strict=True)
    )


@eqx.filter_jit
def _derived_jacobian(values: jax.Array, problem: Problem, told: tuple[bool, ...]) -> tuple[jax.Array, jax.Array]:
    """ω-, ω+ and, where `told`, the damping of every trace; with derivatives."""
    modal = problem.loss == "modal"

    def numbers(p: jax.Array) -> jax.Array:
        found = []
        constants = p[:3] if modal else p[:3].at[2].set(p[2] ** 2)
        for i, one in enumerate(problem.records):
            found += list(jnp.sqrt(pulsations(constants, one)))
            if told[i]:
                eta = one.conditions.viscosity
                found.append(1 / (2 * p[3 + i] * eta) if modal else p[0] / (2 * p[3] * eta))
        return jnp.stack(found)

    return value_and_jacobian(numbers, values)

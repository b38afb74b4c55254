"""The constants from traces: the door of the trace fits.

Symbols    α1, α2, k_VS, β1, β2 constants [-]   ω-, ω+ pulsations, τ decay time
Valid for  small oscillations about a buckled rest state; channels and losses as `losses` says
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw
"""

import dataclasses
import warnings
from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np

from jshell.calibration.frequency_table import Frequencies
from jshell.calibration.joint_fit import Asked, fit_jointly
from jshell.calibration.least_squares import from_many_starts
from jshell.calibration.lengths import lengthened
from jshell.calibration.long_records import fit_long, is_long
from jshell.calibration.losses import LOSSES, Problem, residual
from jshell.calibration.master_curve import start_from_data
from jshell.calibration.parameters import Prior, Tie, unknowns
from jshell.calibration.records import EQUILIBRIA, Record, chosen_channels, filled, record, rest_state, windowed
from jshell.calibration.report import FitResult, FitWarning
from jshell.calibration.specification import Specification, tie_in_words, versions
from jshell.calibration.starts import Modes, blind_start, find_modes, strict_start
from jshell.calibration.verdict import trace_result
from jshell.errors import BadName, BadValue
from jshell.oscillator.coefficients import dipole_dissipation, tied_beta2
from jshell.oscillator.simulate import SOLVERS
from jshell.trace import Trace

POSITIVE = frozenset({"alpha1", "alpha2", "beta1", "beta2"})
BETA2 = ("equal_decay", "free")
NOISES = ("auto", "white")


def fit_trajectories(
    traces: Trace | Sequence[Trace],
    loss: str | None = None,
    *,
    solver: str = "exact",
    equilibrium: str = "plateau",
    fix: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str | Tie] | None = None,
    local: Sequence[str] = (),
    uncertain: Mapping[str, float | None] | None = None,
    priors: Mapping[str, Prior] | None = None,
    robust: str | None = None,
    noise: str = "auto",
    channels: Sequence[str] | None = None,
    start: float | None = None,
    stop: float | None = None,
    drop: Sequence[tuple[float, float]] = (),
    missing: str = "refuse",
    beta2: str = "equal_decay",
    dipole: str = "corrected",
    starts: int = 3,
    seed: int = 0,
) -> FitResult:
    """Fit the short model to one or many traces with shared constants.

    Args:
        traces: With conditions; every trace keeps its own initial state or amplitudes.
        loss: `strict`: V and S follow the oscillator (alpha1, alpha2, k_vs of either sign, beta1);
            `modal`: only ω-, ω+ and τ of any channel count. None takes strict for V and S, modal otherwise.
        solver: `exact` propagator, or `diffrax` (strict only).
        equilibrium: Rest state from the `plateau` law, or from where each `trace` settles.
        fix: Values of constants not to be fitted.
        bounds: Lowest and highest value of constants.
        tie: Constants that follow from others: arithmetic such as "0.3*alpha1", or a function of a mapping.
        local: Constants that every trace has of its own, `name[1]`, `name[2]`, …; all others are shared.
        uncertain: Conditions that are parameters (`thickness`, `youngs_modulus`, `gas_pressure`,
            `outer_pressure`, `viscosity`), with their relative standard error, or None where nothing is known.
        priors: What is known of parameters beforehand.
        robust: `huber` or `cauchy` instead of least squares.
        noise: `auto` tests the residual and lets the noise remember its past where it does; `white` does not.
        channels: Those to read; None reads all that the traces share.
        start: First time read, in the traces' own time; by default a record that holds a snap is read from
            five units after its dip on, any other whole.
        stop: Last time read.
        drop: Spans of time whose samples are left out.
        missing: `refuse` or `drop` samples that are NaN.
        beta2: `equal_decay` ties it to beta1; `free` fits it (strict only).
        dipole: Convention of beta2, `corrected` or `printed`.
        starts: Random starts beside the one that a matrix pencil gives.
        seed: Of the random starts.

    Returns:
        Outcome ok; rank_deficient, with the free direction and what would fix
        it, where the traces do not determine the constants; not_converged,
        stalled or at_bound. Warnings name a model that does not describe the data.

    Raises:
        BadName: An option, channel or constant that does not exist here.
        BadValue: A trace without conditions, buckled state or, for beta1, viscosity.
    """
    for place, value, known in (
        ("loss", loss, (None, *LOSSES)),
        ("solver", solver, SOLVERS),
        ("equilibrium", equilibrium, EQUILIBRIA),
        ("beta2", beta2, BETA2),
        ("noise", noise, NOISES),
    ):
        if value not in known:
            raise BadName(
                f"{place} {value!r}",
                found="no such choice",
                expected=" or ".join(map(str, known)),
                remedy="Choose one.",
            )
    dipole_dissipation(dipole)
    asked = Asked(dict(tie or {}), tuple(local), dict(uncertain or {}), dict(priors or {}), robust)
    cut = windowed(traces, start, stop, drop=drop, missing=missing)
    loss, names = chosen_channels(cut, loss, channels)
    if loss == "modal" and (solver != "exact" or beta2 != "equal_decay"):
        raise BadName(
            "solver, beta2",
            found="a choice the modal loss does not have",
            expected="solver 'exact', beta2 'equal_decay'",
            remedy="The modal loss integrates nothing, and has one decay time per trace.",
        )
    ready, modes, texts = _prepare(cut, names, equilibrium)
    problem = Problem(tuple(ready), loss, solver, dipole, beta2 == "equal_decay")
    fixed = _fixed(fix, problem)
    positive = POSITIVE | {name for name in problem.names if name.startswith("tau")}
    limits = dict(bounds or {})
    natural = _starts(problem, modes, fixed, starts, seed)
    absolute = all(name in trace.sigma for trace in cut for name in names)
    if asked.general:
        result = fit_jointly(
            asked, problem, modes, natural, cut, texts, fix=fixed, bounds=limits, absolute=absolute,
            equilibrium=equilibrium, noise=noise,
        )  # fmt: skip
    else:
        space = unknowns(problem.names, positive, fixed, limits, squared=problem.squared)
        low, high, seen = (jnp.asarray(x, dtype=float) for x in (space.low, space.high, space.seen(natural)))
        if is_long(problem):
            ending = fit_long(space, problem, space.seen(natural))
        else:
            args = (space, lengthened(problem))
            ending = from_many_starts(residual, args, seen, low, high)
        result = trace_result(problem, space, ending, natural, cut, absolute, texts, noise=noise)
    given = Specification(
        "trajectories", loss, None, solver, equilibrium, dict(fix or {}), dict(bounds or {}), tie_in_words(tie),
        asked.local, asked.uncertain, asked.priors, robust, noise, names, start, stop, tuple(drop), missing, beta2,
        dipole, starts, seed,
    )  # fmt: skip
    result = dataclasses.replace(result, specification=given, versions=versions())
    for text in result.warnings:
        warnings.warn(text, FitWarning, stacklevel=2)
    return result


def prepare(
    traces: Trace | Sequence[Trace],
    loss: str | None = None,
    *,
    solver: str = "exact",
    equilibrium: str = "plateau",
    channels: Sequence[str] | None = None,
    adjoint: str = "forward",
) -> Problem:
    """The problem that `fit_trajectories` solves, for those who bring their own minimiser or want its gradients."""
    cut = windowed(traces, None, None)
    loss, names = chosen_channels(cut, loss, channels)
    ready, _, _ = _prepare(cut, names, equilibrium)
    return Problem(tuple(ready), loss, solver, adjoint=adjoint)


def _prepare(
    cut: list[Trace], names: tuple[str, ...], equilibrium: str
) -> tuple[list[Record], list[Modes | None], list[str]]:
    """Records with rest states, their modes, and warnings."""
    given = [name in trace.sigma for trace in cut for name in names]
    if any(given) and not all(given):
        raise BadValue("sigma", found="σ for some channels", expected="for all or none", remedy="Complete it.")
    ready, modes, texts = [], [], []
    for number, trace in enumerate(cut, 1):
        times = np.asarray(trace.times, dtype=float)
        data = [filled(times, np.asarray(trace[name], dtype=float)) for name in names]
        found = find_modes(times - times[0], np.stack(data))
        offset = None
        if "V" in names:
            index = names.index("V")
            offset = float(np.nanmean(trace["V"])) if found is None else float(found.offsets[index])
        state, more = rest_state(trace, offset, equilibrium, number)
        ready.append(record(trace, names, state))
        modes.append(found)
        texts += more
    return ready, modes, list(dict.fromkeys(texts))


def _fixed(fix: Mapping[str, float] | None, problem: Problem) -> dict[str, float]:
    """Fixed constants; beta1 needs a viscosity to be free."""
    fixed = dict(fix or {})
    viscous = any(float(one.conditions.viscosity) > 0 for one in problem.records)
    if problem.loss == "strict" and "beta1" not in fixed and not viscous:
        raise BadValue(
            "viscosity",
            found="0 in every trace",
            expected="a viscosity, which beta1 multiplies",
            remedy='Give the viscosity, or fix={"beta1": 0.0}.',
        )
    return fixed


def _starts(problem: Problem, modes: list[Modes | None], fixed: dict[str, float], count: int, seed: int) -> np.ndarray:
    """(starts, names): one from the modes, others scattered around it; blind draws where no modes are found."""
    random = np.random.default_rng(seed)
    records = list(problem.records)
    heard = [(one, found) for one, found in zip(records, modes, strict=True) if found is not None]
    if problem.loss == "strict":
        if not heard:
            rows = np.stack([blind_start(random, records) for _ in range(4 * (count + 1))])
        else:
            first = strict_start([one for one, _ in heard], [found for _, found in heard], fixed)
            noise = random.standard_normal((count, 4))
            moved = first * np.exp(np.array([0.2, 0.2, 0.0, 0.2]) * noise)
            moved[:, 2] += 0.1 * noise[:, 2]
            rows = np.vstack([first, moved])
        if not problem.tied:
            b2 = tied_beta2(rows[:, 0], rows[:, 1], rows[:, 3], problem.dipole)
            rows = np.column_stack([rows, b2])
        return rows

    tau = np.array([8.0 if found is None else found.tau for found in modes])
    if heard:
        table = Frequencies(
            np.array([float(one.state.volume) for one, _ in heard]),
            np.array([float(one.state.pressure) for one, _ in heard]),
            np.array([float(one.conditions.kappa) for one, _ in heard]),
            np.array([0.5 / (1 - float(one.conditions.poisson_ratio)) for one, _ in heard]),
            np.array([np.sqrt(found.squared) for _, found in heard]),
            np.ones((len(heard), 2)),
        )
        first = np.append(start_from_data(table, fixed), tau)
        spread = np.full(first.size, 0.1)
        return np.vstack([first, first * np.exp(spread * random.standard_normal((count, first.size)))])
    drawn = [blind_start(random, records)[:3] ** np.array([1, 1, 2]) for _ in range(4 * (count + 1))]
    return np.stack([np.append(one, tau) for one in drawn])

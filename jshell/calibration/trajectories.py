"""The constants from traces: the door of the trace fits.

Symbols    α1, α2, k_VS, β1, β2 constants [-]   ω-, ω+ angular frequencies, τ decay time
Valid for  small oscillations about a buckled rest state; channels and losses as `losses` says
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw
"""

import dataclasses
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from jshell.calibration.data import chosen_channels, windowed
from jshell.calibration.diagnostics import trace_result
from jshell.calibration.long_records import minimise
from jshell.calibration.losses import TraceModel
from jshell.calibration.options import OPTIONS, FitOptions, Prior, Tie, tie_in_words
from jshell.calibration.preparation import prepared, problem_of
from jshell.calibration.report import FitResult, FitWarning
from jshell.calibration.robust import reweigh
from jshell.calibration.starts import starts_of_fit
from jshell.calibration.versions import versions
from jshell.errors import BadName
from jshell.trace import Trace


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
    options: FitOptions | None = None,
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
        noise: `auto` tests the residual and takes the noise as autocorrelated where it is; `white` does not.
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
        options: All of these at once; what is said besides changes it.

    Returns:
        Outcome ok; rank_deficient, with the free direction and what would fix
        it, where the traces do not determine the constants; not_converged,
        stalled or at_bound. Warnings name a model that does not describe the data.

    Raises:
        BadName: An option, channel or constant that does not exist here.
        BadValue: A trace without conditions, buckled state or, for beta1, viscosity.
        NotOk: No start led to numbers that are finite.
    """
    options = _options(options, locals())
    cut = windowed(traces, options.start, options.stop, drop=options.drop, missing=options.missing)
    loss, names = chosen_channels(cut, options.loss, options.channels)
    asked = options.changed(loss=loss, channels=names)
    if loss == "modal" and (asked.solver != "exact" or asked.beta2 != "equal_decay"):
        raise BadName(
            "solver, beta2",
            found="a choice the modal loss does not have",
            expected="solver 'exact', beta2 'equal_decay'",
            remedy="The modal loss integrates nothing, and has one decay time per trace.",
        )
    problem, parameters, modes, texts = problem_of(cut, asked)
    begin = starts_of_fit(problem, modes, asked.fix, asked.starts, asked.seed)
    solution, found = minimise(parameters, problem, parameters.unconstrained(begin)), None
    if asked.robust is not None:
        solution, found = reweigh(asked.robust, problem, parameters, solution)
    result = trace_result(problem, parameters, solution, begin, cut, noise=asked.noise, robust=found)
    specification = asked.changed(tie=tie_in_words(asked.tie))
    result = dataclasses.replace(
        result, warnings=(*texts, *result.warnings), specification=specification, versions=versions()
    )
    for text in result.warnings:
        warnings.warn(text, FitWarning, stacklevel=2)
    return result


def _options(given: FitOptions | None, words: Mapping[str, Any]) -> FitOptions:
    """The options of a call: those given whole, changed by what is said besides."""
    said = FitOptions(**{name: words[name] for name in OPTIONS if words[name] is not None})
    return said if given is None else given.changed(**said.differing())


def prepare(
    traces: Trace | Sequence[Trace],
    loss: str | None = None,
    *,
    solver: str = "exact",
    equilibrium: str = "plateau",
    channels: Sequence[str] | None = None,
    adjoint: str = "forward",
) -> TraceModel:
    """The problem that `fit_trajectories` solves, for those who bring their own minimiser or want its gradients."""
    cut = windowed(traces, None, None)
    loss, names = chosen_channels(cut, loss, channels)
    records, _, _ = prepared(cut, names, equilibrium)
    return TraceModel(tuple(records), loss, solver, adjoint=adjoint)

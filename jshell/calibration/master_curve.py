"""The three constants from frequencies of many shells: the source's master curve.

Every shape gives two numbers, ω- and ω+, for three constants: one shape leaves
a direction of them free, two shapes or pressures do not. The start comes from
the data: the sum of the squared frequencies is linear in 1/α1 and 1/α2, their
product gives k_VS².

Symbols    ω-, ω+ angular frequencies [sqrt(E d/(ρ_f R0³))]   V_e volume [R0³], P_e pressure [E d/R0] at rest
Valid for  undamped frequencies, ω² = Ω² + 1/τ²
Source     Mokbel et al. 2021: eq:defw, fig:w
"""

import dataclasses
import warnings
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.estimate import starts_of
from jshell.calibration.frequency_model import (
    NAMES,
    model,
    parameters_of_table,
    square_only,
    start_from_data,
    table_residual,
    weighted,
)
from jshell.calibration.frequency_table import FrequencyTable, Prepared, prepare
from jshell.calibration.least_squares import SolverResult, best_of, from_many_starts, value_and_jacobian
from jshell.calibration.objective import Objective
from jshell.calibration.options import FitOptions, choices_of
from jshell.calibration.parameters import Unknowns
from jshell.calibration.report import FitResult, FitWarning
from jshell.calibration.table_misfit import misfits_of_table, weightings_apart
from jshell.calibration.uncertainty import in_words, uncertainty
from jshell.calibration.undetermined import estimates_of, open_constants, without_open
from jshell.calibration.versions import versions
from jshell.errors import BadValue, Outcome, RangeWarning

__all__ = ["WEIGHTINGS", "fit_frequencies", "model", "scatter", "start_from_data", "weighted"]
WEIGHTINGS = tuple(one for one in choices_of("weighting") if one is not None)
NEARER = 0.4  # of the usual scatter: around a minimum that one start alone has found
LEAST_AGREEING = 2  # starts in the best minimum, where several were made: one alone found it by chance
SECOND_SHAPE = "add a second pressure or shape, or fix alpha2"


def fit_frequencies(
    table: Mapping[str, object],
    weighting: str = "V_e omega",
    *,
    fix: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 10,
    seed: int = 0,
) -> FitResult:
    """Fit α1, α2 and k_VS to frequencies of one or many shells.

    Args:
        table: Columns by name, see `prepare`.
        weighting: What is fitted: `V_e omega` or `V_e^2 omega^2`, unweighted unless the table has errors.
        fix: Values of constants not to be fitted: `alpha1`, `alpha2`, `k_vs`.
        bounds: Lowest and highest value of constants.
        starts: Random starts around the one that the data give; all must end in the same minimum.
        seed: Of the random starts.

    Returns:
        Outcome ok; rank_deficient with the free direction when the rows do not
        determine the constants; stalled when starts disagree; at_bound. Warnings name a model that does not
        describe the table, and what the other weighting gives where that is another answer.

    Raises:
        BadName: No such weighting, column or constant.

    Source:
        eq:defw; the weighting decides the constants at the level of tens of percent.
    """
    given = FitOptions("frequencies", weighting=weighting, fix=fix or {}, bounds=bounds or {}, starts=starts, seed=seed)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RangeWarning)
        records = prepare(table)
    _again(caught)
    rows = records.rows
    parameters = parameters_of_table(fix, bounds)

    first = start_from_data(rows, fix)
    constrained = scatter(first, starts, seed)
    if not np.isfinite(rows.omega).any():
        raise BadValue("table", found="no usable frequency", expected="at least one", remedy="Check the columns.")
    solution = from_many_starts(
        table_residual,
        (parameters, rows, weighting),
        jnp.asarray(parameters.unconstrained(constrained)),
        *_limits(parameters),
    )
    best, same = best_of(solution, _square_size(rows, weighting))
    if starts and same.sum() < LEAST_AGREEING:
        # the others may all have ended where k_VS is 0: starts around the best tell whether it is found again
        nearer = scatter(np.asarray(parameters.constrained(solution.unknowns[best])), starts, seed + 1, NEARER)
        again = from_many_starts(
            table_residual,
            (parameters, rows, weighting),
            jnp.asarray(parameters.unconstrained(nearer)),
            *_limits(parameters),
        )
        if best_of(again, _square_size(rows, weighting))[1].sum() >= LEAST_AGREEING:
            solution, constrained = again, nearer
    found = _result(records, parameters, weighting, solution, constrained, [str(w.message) for w in caught])
    if found.outcome == Outcome.OK:
        other = next(name for name in WEIGHTINGS if name != weighting)
        solution = from_many_starts(
            table_residual,
            (parameters, rows, other),
            jnp.asarray(parameters.unconstrained(constrained)),
            *_limits(parameters),
        )
        second = _result(records, parameters, other, solution, constrained, [])
        if second.outcome == Outcome.OK:
            words = weightings_apart(found.estimates, second.estimates, other)
            found = dataclasses.replace(found, warnings=(*found.warnings, *words))
    for text in found.warnings[len({str(w.message) for w in caught}) :]:
        warnings.warn(text, FitWarning, stacklevel=2)
    return dataclasses.replace(found, specification=given, versions=versions())


def V_size(rows: FrequencyTable) -> float:
    """A typical V_e ω, the scale of the residual."""
    return float(np.sqrt(np.nansum((np.asarray(rows.volume)[:, None] * np.asarray(rows.omega)) ** 2)))


def _square_size(rows: FrequencyTable, weighting: str) -> float:
    """Sum of squares of the data as a weighting takes them, by its order of magnitude."""
    return V_size(rows) ** (2 if weighting == "V_e omega" else 4)


def scatter(first: np.ndarray, count: int, seed: int, share: float = 1.0) -> np.ndarray:
    """A start, and random ones around it: masses by factors of about 1.6, k² of about 2.5; or a share of that."""
    random = np.random.default_rng(seed)
    spread = share * np.array([0.5, 0.5, 0.9])
    return np.vstack([first, first * np.exp(spread * random.standard_normal((count, first.size)))])


def _limits(parameters: Unknowns) -> tuple[jax.Array, jax.Array]:
    return jnp.asarray(parameters.low), jnp.asarray(parameters.high)


def _again(caught: list) -> None:
    for text in {str(w.message) for w in caught}:
        warnings.warn(text, RangeWarning, stacklevel=3)


@eqx.filter_jit
def _weighted_and_slopes(values: jax.Array, rows: FrequencyTable, weighting: str) -> tuple[jax.Array, jax.Array]:
    return value_and_jacobian(lambda p: weighted(p, rows, weighting), values)


def _result(
    records: Prepared,
    parameters: Unknowns,
    weighting: str,
    solution: SolverResult,
    constrained: np.ndarray,
    caught: list[str],
) -> FitResult:
    rows = records.rows
    measured = int(np.isfinite(rows.omega).sum())
    best, same = best_of(solution, _square_size(rows, weighting))
    values = np.asarray(parameters.constrained(solution.unknowns[best]))
    shown, begin = parameters.reported(values), parameters.reported(constrained[best])

    r, J = _weighted_and_slopes(jnp.asarray(values), rows, weighting)
    J = np.asarray(J) * parameters.stretch(shown)
    free, names = [NAMES.index(name) for name in parameters.free], parameters.free
    errors = uncertainty(J[:, free], np.asarray(r), shown[free], count=measured, absolute=records.absolute)

    outcome = Outcome(int(solution.outcome[best]))
    # k_VS² = 0 holds a second minimum of its own, volume the slow motion where it should be the fast one
    uncoupled = ~same & (np.asarray(solution.outcome) == Outcome.AT_BOUND) & (outcome == Outcome.OK)
    texts = list(caught)
    directions = tuple(in_words(direction, names) for direction in errors.null)
    if directions and outcome in (Outcome.OK, Outcome.AT_BOUND) and shown[2] != 0:
        outcome = Outcome.RANK_DEFICIENT
        directions = tuple(f"{text} changes no frequency of the table: {SECOND_SHAPE}" for text in directions)
    elif not (same | uncoupled).all() or same.sum() < min(len(same), LEAST_AGREEING):
        outcome = Outcome.STALLED if outcome == Outcome.OK else outcome
        texts.append(f"only {same.sum()} of {len(same)} starts ended in the best minimum")
    notes = [*records.notes, square_only(parameters)]
    if uncoupled.any():
        notes.append(f"{uncoupled.sum()} starts ended higher, at k_VS = 0 with the roles of the two masses exchanged")
    if outcome == Outcome.AT_BOUND and shown[2] == 0 and "k_vs" in parameters.free:
        texts.append("k_VS² ended at 0: the frequencies would have it negative")

    undetermined = open_constants(names, shown[free], errors, outcome)
    if outcome == Outcome.OK:
        found = np.asarray(model(jnp.asarray(values), rows))
        texts += misfits_of_table(np.asarray(r), found, rows, len(names), records.absolute)

    return FitResult(
        title=f"Master curve of {rows.omega.shape[0]} shells, residual in {weighting}",
        outcome=outcome,
        estimates=tuple(estimates_of(NAMES, names, shown, begin, errors, undetermined)),
        derived=(),
        covariance=without_open(errors.covariance, names, undetermined),
        correlation=without_open(errors.correlation, names, undetermined),
        varied=names,
        residual=np.asarray(r),
        chi_square=float(r @ r),
        n_data=measured,
        n_varied=len(names),
        absolute=records.absolute,
        free_directions=directions,
        starts=starts_of(solution, constrained, same),
        notes=tuple(notes),
        warnings=tuple(texts),
        table=records.columns,
        minimum=tuple(float(x) for x in values) if undetermined else (),
        minimised=Objective(
            table_residual, (parameters, rows, weighting), parameters, values, records.absolute, measured
        ),
    )

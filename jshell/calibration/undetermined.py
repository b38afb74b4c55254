"""Which numbers of a fit its outcome says are undetermined: they are NaN, with the reason; what is determined stays.

A fit that did not come to rest determines nothing. One whose data leave a direction
free does not determine the constants that this direction moves, nor what
follows from them; everything that it leaves in place is as good as ever.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jshell.calibration.estimate import Estimate
from jshell.calibration.uncertainty import LOOSE, NO_SCATTER, SMALL_COUPLING, Uncertainty, share_in_words
from jshell.errors import Outcome

RESTLESS = frozenset({Outcome.STALLED, Outcome.NOT_CONVERGED, Outcome.NOT_FINITE, Outcome.UNUSABLE_DATA})
NO_MINIMUM = "the fit did not come to rest"
SILENT = "only a mode below the noise depends on it"
PART = 0.1  # of what a direction moves most, below which it hardly moves a constant
MOVED = 1e-4  # share of a derived number, per change of a constant by itself, below which it stays where it is


def open_constants(
    varied: Sequence[str], values: np.ndarray, errors: Uncertainty, outcome: Outcome, silent: Sequence[np.ndarray] = ()
) -> dict[str, str]:
    """Constants that are undetermined, and why.

    Args:
        varied: Names of the constants.
        values: (constants,) at the minimum.
        errors: Of constants, and of what follows them.
        outcome: Of the fit.
        silent: Relative changes (constants,) that leave the identified mode as it is.
    """
    if outcome in RESTLESS:
        return dict.fromkeys(varied, NO_MINIMUM)
    found = {}
    for j, name in enumerate(varied):
        if errors.reasons[j] and errors.reasons[j] != NO_SCATTER:
            found[name] = errors.reasons[j]
        elif any(abs(direction[j]) > PART * np.abs(direction).max() for direction in silent):
            found[name] = SILENT
        elif outcome == Outcome.RANK_DEFICIENT:
            share = errors.stderr[j] / max(abs(float(values[j])), SMALL_COUPLING)
            if share > LOOSE:
                found[name] = f"known to {share_in_words(share)} only"
    return found


def estimates_of(
    names: Sequence[str],
    varied: Sequence[str],
    shown: np.ndarray,
    begin: np.ndarray,
    errors: Uncertainty,
    undetermined: Mapping[str, str],
) -> list[Estimate]:
    """Every constant: fixed ones as they are, varied ones with their errors, or the reason why they have no value.

    Args:
        names: All constants, in the order of `shown`, their values, and `begin`, those of the best start.
        varied: Those that `errors` has, in its order.
        shown: (names,).
        begin: (names,).
        errors: Of the varied constants, and of what follows them.
        undetermined: From `open_constants`.
    """
    found = []
    for name, value, first in zip(names, shown, begin, strict=True):
        if name not in varied:
            found.append(Estimate(name, float(value), role="fixed"))
            continue
        j = varied.index(name)
        one = Estimate(name, float(value), float(errors.stderr[j]), errors.reasons[j], float(first))
        found.append(hidden(one, undetermined[name]) if name in undetermined else one)
    return found


def hide_derived(
    derived: Sequence[Estimate], gradient: np.ndarray, constants: np.ndarray, null: np.ndarray, outcome: Outcome
) -> tuple[Estimate, ...]:
    """Derived numbers without those that are undetermined.

    Args:
        derived: All of them.
        gradient: (numbers, constants).
        constants: (constants,) at the minimum.
        null: (directions, constants) relative changes that leave the fit, or what is identified of it, as it is.
        outcome: Of the fit.
    """
    slopes = gradient * np.where(constants == 0, 1.0, np.abs(constants))
    found = []
    for one, slope in zip(derived, slopes, strict=True):
        reason = NO_MINIMUM if outcome in RESTLESS else ""
        if outcome == Outcome.RANK_DEFICIENT:
            if np.max(np.abs(null @ slope), initial=0.0) > MOVED * abs(one.value):
                reason = "a direction that the data leave free moves it"
            elif one.stderr > LOOSE * abs(one.value):
                reason = f"known to {share_in_words(one.stderr / max(abs(one.value), 1e-300))} only"
        found.append(hidden(one, reason) if reason else one)
    return tuple(found)


def hidden(estimate: Estimate, reason: str) -> Estimate:
    """The estimate without the numbers that it does not have."""
    return replace(estimate, value=float("nan"), stderr=float("nan"), reason=reason)


def without_open(matrix: np.ndarray, varied: Sequence[str], found: Mapping[str, str]) -> np.ndarray:
    """A covariance or correlation of constants, NaN in the rows and columns of those that are undetermined."""
    lost = np.array([name in found for name in varied], dtype=bool)
    return np.where(lost[:, None] | lost[None, :], np.nan, matrix)

"""What recordings leave open, in physical words.

Symbols    n null direction: relative changes of the unknowns that leave every recording as it is
"""

from collections.abc import Sequence

import numpy as np

from jshell.calibration.uncertainty import in_words
from jshell.errors import Outcome

PART = 0.05  # of the largest change in a direction, below which an unknown stays
MEASURED = {
    "radius": "a measured radius",
    "thickness": "a measured thickness",
    "youngs_modulus": "a modulus from a test of the material",
    "density": "the liquid's density",
    "viscosity": "the liquid's viscosity",
    "retardation": "a test of the wall material's own loss",
    "gas_pressure": "the gas pressure of the stress-free shell",
    "outer_pressure": "a pressure gauge",
    "kappa": "the gas's exponent",
    "poisson_ratio": "Poisson's ratio",
    "pad": "a measured pad",
    "weak_spot": "a measured profile of the wall",
}


ADVICE = {
    Outcome.NOT_CONVERGED: "the search did not come to rest: ask for fewer unknowns, give one of them bounds or a "
    "prior, or begin elsewhere",
    Outcome.STALLED: "the search found no way down: give an unknown bounds or a prior, or begin elsewhere",
    Outcome.RANK_DEFICIENT: "the recordings leave unknowns open, see which: give one of them as known or with a "
    "prior, or add a recording at another pressure",
    Outcome.AT_BOUND: "an unknown ended on its bound: widen it, or question what is taken as known",
}


def open_direction(
    direction: np.ndarray, names: Sequence[str], logarithmic: Sequence[bool], error: float | None
) -> str:
    """One direction that is not determined: which combination is, and what would settle it.

    Args:
        direction: (unknowns,) relative changes.
        names: Of the unknowns.
        logarithmic: Which are sought by their logarithms.
        error: Relative error along it; None where nothing at all is known.
    """
    moving = [int(i) for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > PART * np.abs(direction).max()]
    settle = " or ".join(MEASURED[names[i].partition("[")[0]] for i in sorted(moving))
    how = "" if error is None else f" (along it to {100 * error:.0f}% only)"
    if len(moving) == 1:
        return f"{names[moving[0]]} is not determined{how}: {settle} would settle it"
    if len(moving) == 2 and all(logarithmic[i] for i in moving):
        a, b = sorted(moving)
        power = -direction[a] / direction[b]
        kept = f"{names[a]} × {names[b]}^{power:.3g}" if abs(power - 1) > 0.02 else f"{names[a]} × {names[b]}"
        if abs(power + 1) < 0.02:
            kept = f"{names[a]} / {names[b]}"
        return f"{names[a]} and {names[b]} only as {kept}{how}: {settle} would separate them"
    listed = ", ".join(names[i] for i in sorted(moving))
    return f"{listed} only together, {in_words(direction, tuple(names))}{how}: {settle} would separate them"

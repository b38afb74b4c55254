"""Whether the model describes a table of frequencies: what it leaves, against given errors and against its own scatter.

Symbols    r residual of V_e ω or its square   ω-, ω+ slow and fast column
Source     Student 1908 (a mean, a slope against scatter); Pearson 1900 (χ² against given errors)
"""

import numpy as np
import scipy.special

from jshell.calibration.estimate import Estimate
from jshell.calibration.frequency_table import FrequencyTable
from jshell.calibration.noise import MISFIT

CHANCE = 1e-3  # of a good table, by which a test may call it a misfit
ENOUGH = 5  # rows of one column, for a test of its scatter
ROUNDING = 1e-9  # relative: what is off by less is exact
COLUMNS = ("slow", "fast")


def misfits_of_table(r: np.ndarray, found: np.ndarray, rows: FrequencyTable, varied: int, absolute: bool) -> list[str]:
    """What speaks against the model, in words.

    Args:
        r: (data,) weighted residual.
        found: (shells, 2) V_e² ω² of the model.
        rows: The table.
        varied: Number of constants fitted.
        absolute: Whether the table gives standard errors.
    """
    measured = np.isfinite(np.asarray(rows.omega))
    freedom = int(measured.sum()) - varied
    texts = []
    if absolute and freedom > 0:
        power = float(r @ r)
        chance = float(scipy.special.chdtrc(freedom, power))
        if chance < CHANCE:
            texts.append(
                f"misfit: the model leaves {np.sqrt(power / freedom):.3g} times the errors of the table, as good "
                f"tables do {_once_in(chance)}"
            )
    with np.errstate(invalid="ignore"):
        y = np.asarray(rows.volume)[:, None] * np.asarray(rows.omega)
        off = np.sqrt(np.maximum(np.asarray(found), 0.0)) / y - 1  # an unstable mode is all off
    for c, which in enumerate(COLUMNS):
        here = measured[:, c]
        if here.sum() < ENOUGH:
            continue
        left, own = off[here, c], float(np.std(y[here, c]) / np.mean(y[here, c]))
        size = float(np.sqrt(np.mean(left**2)))
        if not absolute and size > max(MISFIT * own, ROUNDING):
            texts.append(
                f"misfit: the {which} frequencies are off by {100 * size:.2g}%, where V_e ω scatters by "
                f"{100 * own:.2g}% in all: one number would describe them better"
            )
            continue
        pressure = np.log(np.asarray(rows.pressure)[here])
        for words, along in (("beside the model", np.ones(left.size)), ("ever further off with pressure", pressure)):
            chance = _chance(left, along)
            if chance < CHANCE:
                texts.append(
                    f"misfit: the {which} frequencies lie {words}, by {100 * size:.2g}%: against their own scatter "
                    f"those of good tables do so {_once_in(chance)}"
                )
                break
    return texts


def _chance(left: np.ndarray, along: np.ndarray) -> float:
    """Chance that scatter alone gives so large a mean, or so steep a line, by Student's t."""
    along = along - along.mean() if np.ptp(along) > 0 else along
    left = left if np.ptp(along) == 0 else left - left.mean()
    power = float(along @ along)
    freedom = left.size - (1 if np.ptp(along) == 0 else 2)
    if power <= 0 or freedom < ENOUGH - 2:
        return 1.0
    slope = float(along @ left) / power
    rest = float(np.sum((left - slope * along) ** 2)) / freedom
    if slope**2 * power <= ROUNDING**2:
        return 1.0
    t = abs(slope) * np.sqrt(power / max(rest, 1e-300))
    return float(2 * scipy.special.stdtr(freedom, -t))


def _once_in(chance: float) -> str:
    return f"once in {1 / max(chance, 1e-99):.0e}"


def weightings_apart(one: tuple[Estimate, ...], other: tuple[Estimate, ...], name: str) -> list[str]:
    """Both weightings in words, where a constant of one differs from that of the other by more than their errors.

    Args:
        one: Estimates of the fit.
        other: Of the other weighting.
        name: Of that.
    """
    apart = [
        (a, b)
        for a, b in zip(one, other, strict=True)
        if a.role == "constant"
        and abs(a.value - b.value) > max(float(np.hypot(a.stderr, b.stderr)), ROUNDING * abs(a.value))
    ]
    if not apart:
        return []
    listed = ", ".join(
        f"{b.name} = {b.value:.4g} ± {b.stderr:.2g} (here {a.value:.4g} ± {a.stderr:.2g})"
        for a, b in zip(one, other, strict=True)
        if a.role == "constant"
    )
    return [
        f"misfit: by {name} {listed}; "
        f"{', '.join(a.name for a, _ in apart)} differ by more than their errors: the model "
        "does not describe the table, or a row of it is wrong"
    ]

"""Whether a record can be of the shell that its conditions describe: slips of unit, column and holder.

A fit finds constants for any record; of the wrong shell they mean nothing.
What a free, buckled shell at the given load cannot show is refused, and the
slip that would explain it is named. The bounds are wide: a measured shell rests
within a tenth of the plateau law, a record is refused at a quarter.

Symbols    V volume [R0³]   S area [R0²]   H height, W width [R0]   V_e rest volume of the plateau law
Valid for  records of absolute values; a channel that goes below 0, or lies near it, is an excursion without a level
Source     Mokbel et al. 2021: eq:equiplateau for V_e; area nearly uncompressed, convex envelopes for H and W
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float

from jshell.errors import BadValue, UnusableData
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.trace import Trace

REST_BOUND = 0.25  # relative distance of a rest volume from the plateau law's at which a record is refused
LEVELS = {"S": (0.75 * SPHERE_AREA, 1.25 * SPHERE_AREA), "H": (0.5, np.pi), "W": (1.4, np.pi)}  # π: half a meridian
HEIGHT_OVER_WIDTH = 1.02  # a dimple lowers the height and widens the shell; more is two columns exchanged
EXCURSION = 0.3  # a length or area with a level below this is an excursion [R0]
PERIODS = 0.5  # of the fastest motion a shell has: a shorter record shows none
_SLIPS_OF_VOLUME = ((1 / SPHERE_VOLUME, "V/V0"), (8.0, "units of the diameter cubed"), (1 / 8, "radius for diameter"))
_SLIPS_OF_LENGTH = ((0.5, "diameters"), (1e3, "a unit 1000 times smaller"), (1e-3, "a unit 1000 times larger"))


def refuse_disagreement(trace: Trace, number: int) -> None:
    """Refuse a trace, cut to its window, that cannot be of its shell.

    Args:
        trace: With conditions.
        number: Of the trace, for messages.

    Raises:
        UnusableData: Too short for any motion; area, height or width of no shell; height and width exchanged.
    """
    place, conditions = f"trace {number}", trace.conditions
    assert conditions is not None
    times = np.asarray(trace.times, dtype=float)
    fastest = 2 * np.pi / np.sqrt(3 * float(conditions.kappa) * float(conditions.outer_pressure) + 4.0)
    if times[-1] - times[0] < PERIODS * fastest:
        raise UnusableData(
            place,
            found=f"{times[-1] - times[0]:.3g} time units, while one period of the fastest motion is {fastest:.3g}",
            expected=f"at least {PERIODS * fastest:.3g}, better several periods of the slow mode",
            remedy="Check the unit of time, or give a longer record.",
        )
    levels = {name: level for name in LEVELS if name in trace.channels and (level := _level(trace[name])) is not None}
    if "H" in levels and "W" in levels and levels["H"] > HEIGHT_OVER_WIDTH * levels["W"]:
        raise UnusableData(
            f"{place}, channels 'H' and 'W'",
            found=f"a height of {levels['H']:.4g} above a width of {levels['W']:.4g}",
            expected="a height at most the width: a dimple lowers the shell along its axis",
            remedy="Are the two columns exchanged?",
        )
    refuse_sizes(levels, place)


def refuse_sizes(levels: Mapping[str, float], place: str) -> None:
    """Refuse areas, heights and widths that no shell has.

    Args:
        levels: Of channels by name, in units of R0 and its square; those without bounds pass.
        place: Of the record, for messages.

    Raises:
        UnusableData: One out of its bounds.
    """
    for name, (low, high) in LEVELS.items():
        level = levels.get(name, low)
        if not low <= level <= high:
            raise UnusableData(
                f"{place}, channel {name!r}",
                found=f"a level of {level:.4g}",
                expected=f"{low:.3g} to {high:.3g} for a shell, in units of R0",
                remedy=_slip(level, low, high, _SLIPS_OF_LENGTH) + "Check its unit and the radius of the conditions.",
            )


def refuse_rest(volume: float, plateau: float, values: Float[np.ndarray, " times"], number: int) -> None:
    """Refuse a record that settles far from where the shell of its conditions rests.

    Args:
        volume: Where the record settles [R0³].
        plateau: Rest volume of the plateau law [R0³].
        values: (times,) the record of V.
        number: Of the trace, for messages.

    Raises:
        UnusableData: More than a quarter off.
    """
    known = values[np.isfinite(values)]
    # where few samples tell where a record settles, they tell no more than where it is
    level = float(np.median(known))
    if known.min() < 0 < known.max() or not (rests_elsewhere(volume, plateau) and rests_elsewhere(level, plateau)):
        return
    low, high = (1 - REST_BOUND) * plateau, (1 + REST_BOUND) * plateau
    raise UnusableData(
        f"trace {number}, channel 'V'",
        found=f"a rest volume of {volume:.4g}, {100 * (volume / plateau - 1):+.0f}% from the shell's {plateau:.4g}",
        expected=f"{low:.3g} to {high:.3g} [R0³] at this load",
        remedy=_slip(volume, low, high, _SLIPS_OF_VOLUME)
        + "Check the unit of V, the radius, and that both pressures are absolute and in one unit.",
    )


def rests_elsewhere(volume: float | np.ndarray, plateau: float | np.ndarray) -> Bool[np.ndarray, "..."]:
    """Whether rest volumes are too far from the plateau law's for the record to be of that shell."""
    with np.errstate(all="ignore"):  # a load may leave nothing of a shell
        return np.asarray(np.abs(np.asarray(volume) / np.asarray(plateau) - 1) > REST_BOUND)


def holder(trace: Trace, number: int, *, inverted: bool) -> str | None:
    """What to say of a shell on a holder, fitted by the free shell's model; None for a free shell.

    Args:
        trace: Its settings tell of the pad.
        number: Of the trace, for messages.
        inverted: Whether the fit takes the model's constants for the shell's: conditions are asked of it, or V and S
            are to follow it.

    Raises:
        BadValue: It does.
    """
    angle = trace.attached
    if angle == 0:
        return None
    if inverted:
        raise BadValue(
            f"trace {number}",
            found=f"a shell held on a pad of half-angle {angle:g} rad",
            expected="a free shell: the short model was made for it, and a pad changes the frequencies by half",
            remedy="Compare with jshell.dynamics.modes(…, attached=…), or fit its frequencies alone: "
            'loss="modal" without uncertain conditions.',
        )
    return (
        f"trace {number} is of a shell held on a pad of half-angle {angle:g} rad: its frequencies and decay are right, "
        "but alpha1, alpha2 and k_vs are not comparable with those of free shells"
    )


def _level(values) -> float | None:
    """The median of absolute values; None of an excursion."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    level = float(np.median(known)) if known.size else 0.0
    return None if not known.size or known.min() < 0 or level < EXCURSION else level


def _slip(value: float, low: float, high: float, slips: tuple[tuple[float, str], ...]) -> str:
    """The slip that would explain a value, as a question; empty where none does."""
    likely = [words for factor, words in slips if low <= value / factor <= high]
    return f"Was it given in {likely[0]}? " if likely else ""

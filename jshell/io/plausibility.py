"""Slips between legal units, told by the shell itself: milliseconds under `t [s]`, mm³ under `[m^3]`.

A record is held against the shell's own scales. Its slowest and fastest
motions bound what a useful sampling and duration can be; a wall that hardly
stretches bounds area and lengths, the gas bounds the pressure. The bounds are
wide, since they shall only catch powers of ten; what lies outside is warned of, not refused.

Symbols    ω angular frequency [sqrt(E d/(ρ_f R0³))]   κ polytropic exponent   P̂ext outer pressure
Source     Mokbel et al. 2021: eq:wsphere; ω of attached shells, section "Experiments"
"""

import warnings
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from jaxtyping import Float

from jshell.errors import RangeWarning
from jshell.io.columns import SPHERE
from jshell.io.units import dimension_of, known_unit
from jshell.quantities import UNITS
from jshell.shell.parameters import Reduced, Scales

FEWEST = 8  # samples that make a record: fewer say nothing about its sampling
SLOWEST = 0.3  # angular frequency of the slowest shells seen, attached ones of R: 0.39
BREATHING = 4.0  # squared angular frequency 4 K_A/R0 that an incompressible wall adds to 3 κ P: eq:wsphere
# A wall of nearly uncompressed area: no length above half a meridian, π; no area far from 4π.
_RANGES = {"V": (0.02 * SPHERE, np.inf), "S": (0.6, 40.0), "H": (0.02, 4.0), "W": (0.1, 4.0)}
PRESSURES = 100.0  # factor between a pressure channel and the gas or outer pressure of the conditions

Place = Callable[[str], str]


def warn_of_slips(
    columns: Mapping[str, np.ndarray],
    written: Mapping[str, str | None],
    conditions: Reduced | None,
    scales: Scales | None,
    place: Place,
) -> None:
    """Warn of columns, dimensionless by now, that a slip of units would explain.

    Args:
        columns: The columns, `t` included.
        written: Unit of each as the file spells it; None where it has none.
        conditions: The problem; without it nothing is known, and nothing said.
        scales: SI values of the units, where known.
        place: Name of a column to where it stands.

    Warns:
        RangeWarning: A column out of any plausible range, and which unit would put it right.
    """
    if conditions is None:
        return
    for name, text, right in [*_times(columns["t"], conditions), *_sizes(columns, conditions)]:
        known = _better_unit(name, written[name], scales, right)
        hint = f"Were the numbers in {known}, they would fit: write `{name} [{known}]`." if known else "Check its unit."
        warnings.warn(f"{place(name)}: {text}. {hint}", RangeWarning, stacklevel=3)


Finding = tuple[str, str, Callable[[float], bool]]


def _times(times: Float[np.ndarray, " times"], conditions: Reduced) -> Iterator[Finding]:
    """A sampling too coarse for the slowest motion, a record too short for the fastest."""
    if times.size < FEWEST:
        return
    slow = 2 * np.pi / SLOWEST
    fast = 2 * np.pi / np.sqrt(3 * conditions.kappa * float(conditions.outer_pressure) + BREATHING)
    step, length = float(np.median(np.diff(times))), float(times[-1] - times[0])
    right = lambda factor: step * factor <= fast / 2 and length * factor >= fast / 2  # noqa: E731
    if step > slow / 2:
        text = (
            f"samples {step:.3g} units of time apart, while no motion of the shell is slower than {slow:.3g} a period"
        )
        yield "t", text, right
    elif length < fast / 2:
        text = f"a record of {length:.3g} units of time, while one period of the shell's fastest motion is {fast:.3g}"
        yield "t", text, right


def _sizes(columns: Mapping[str, np.ndarray], conditions: Reduced) -> Iterator[Finding]:
    """Volumes, areas, lengths and pressures by far too large or too small."""
    ranges = dict(_RANGES)
    gas, outer = float(conditions.gas_pressure), float(conditions.outer_pressure)
    ranges["P"] = (gas / PRESSURES, gas * PRESSURES)
    ranges["P_ext"] = (outer / PRESSURES, outer * PRESSURES)
    for name, (low, high) in ranges.items():
        if name not in columns:
            continue
        middle = float(np.median(columns[name]))
        right = lambda factor, low=low, high=high, middle=middle: low <= factor * middle <= high  # noqa: E731
        if middle > 0 and not right(1.0):
            yield name, f"a median of {middle:.3g}, while a shell's lies between {low:.3g} and {high:.3g}", right


def _better_unit(name: str, written: str | None, scales: Scales | None, right: Callable[[float], bool]) -> str | None:
    """The unit of the same dimension that would make the column plausible, the nearest power of ten first."""
    if scales is None:
        return None
    dimension = dimension_of(name)
    present = scales.of(dimension) if written is None else known_unit("", name, written)[1]
    factors = {unit: factor / present for unit, (kind, factor) in UNITS.items() if kind == dimension}
    fitting = [unit for unit, factor in factors.items() if right(factor)]
    return min(fitting, key=lambda unit: abs(np.log(factors[unit])), default=None)

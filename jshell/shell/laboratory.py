"""Slips of unit in the numbers of a laboratory: E in MPa, a pressure in bar, a radius in mm.

Every bound lies a power of ten and more outside what shells are made of, so
that only a slip of unit gets there; the unit that would put it right is named.

Symbols    R0 radius [m]   E Young's modulus [Pa]   P0, P_ext pressures [Pa], absolute   ρ_f density [kg/m³]
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jax.core import Tracer

from jshell.errors import BadValue


class _Span(NamedTuple):
    """Between which values a number of the laboratory lies, and units that it may have been written in by mistake."""

    low: float
    high: float
    unit: str
    others: Mapping[str, float]


_PRESSURES = {"kPa": 1e3, "bar": 1e5, "MPa": 1e6, "GPa": 1e9}
_LENGTHS = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9}
SPANS = {
    "radius [m]": _Span(1e-8, 5.0, "m", _LENGTHS),
    "youngs_modulus [Pa]": _Span(1e3, 1e13, "Pa", _PRESSURES),
    "gas pressure [Pa]": _Span(10.0, 1e9, "Pa", _PRESSURES),
    "outer pressure [Pa]": _Span(1e3, 1e9, "Pa", _PRESSURES),  # below, water boils
    "density [kg/m^3]": _Span(50.0, 3e4, "kg/m^3", {"g/cm^3": 1e3}),
}
# the same places by the names that numbers of a shell have elsewhere, such as gas_pressure
PLACES = {place.split(" [")[0].replace(" ", "_"): place for place in SPANS}


def refuse_slips(**numbers: Any) -> None:
    """Refuse numbers that no laboratory has.

    Args:
        **numbers: Concrete ones by the names of `SPANS`; traced ones pass.

    Raises:
        BadValue: A number out of its span, with the unit that it was probably written in.
    """
    for place, value in numbers.items():
        span = SPANS[place]
        if isinstance(value, Tracer) or np.all((np.asarray(value) >= span.low) & (np.asarray(value) <= span.high)):
            continue
        numbers_out = np.asarray(value, dtype=float).ravel()
        worst = float(numbers_out[(numbers_out < span.low) | (numbers_out > span.high)][0])
        meant = [unit for unit, factor in span.others.items() if span.low <= worst * factor <= span.high]
        hint = f"Was it in {' or '.join(meant)}? " if meant else ""
        absolute = "Pressures are absolute." if "pressure" in place else f"Give it in {span.unit}."
        raise BadValue(
            place,
            found=f"{worst:g} {span.unit}",
            expected=f"{span.low:g} to {span.high:g} {span.unit}",
            remedy=hint + absolute,
        )

"""Vibrations of several orders around the axis, m = 0 among them or not, as one result.

Symbols    m order around the axis   H, W height and width of the outline [R0]
Source     `jshell.dynamics.vibrations` (m = 0), `jshell.dynamics.azimuthal` (m >= 1)
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from jshell.contour import height, width
from jshell.display import FREQUENCY, ended, number, readable, shown
from jshell.dynamics.order_modes import OrderMode, OrderModes, seen_by
from jshell.dynamics.vibrations import Modes
from jshell.errors import BadValue
from jshell.membrane import RestShape
from jshell.membrane.stability import HIGHEST_ORDER


class AllModes(eqx.Module):
    """Vibrations of several orders around the axis.

    Attributes:
        axial: Those of m = 0, or None where they were not asked for.
        around: Those of m >= 1, or None.
    """

    axial: Modes | None
    around: OrderModes | None

    @readable
    def __repr__(self) -> str:
        lines = [] if self.axial is None else [f"m = 0: ω {number(self.axial.omega, FREQUENCY)}"]
        if self.around is not None:
            pairs = zip(self.around.orders, self.around.omega, strict=True)
            lines += [f"m = {int(m)}: ω {number(omega, FREQUENCY)}" for m, omega in pairs]
        return shown(self, *lines, ended(self.worst))

    @property
    def rest(self) -> RestShape:
        """The shape they are vibrations of."""
        return self._parts[0].rest

    @property
    def worst(self) -> Int[Array, ""]:
        """Integer of `Outcome`: ok where all of them are."""
        return jnp.max(jnp.stack([jnp.max(part.outcome) for part in self._parts]))

    @property
    def _parts(self) -> list[Modes | OrderModes]:
        return [part for part in (self.axial, self.around) if part is not None]

    def table(self) -> tuple[OrderMode, ...]:
        """All of them as rows of plain numbers, what grows first, then from the slowest on."""
        rows = [] if self.around is None else list(self.around.table())
        if self.axial is not None:
            heights, widths = (np.asarray(part) for part in _changes(self.axial))
            rows += [
                OrderMode(
                    0, row.mode, row.omega, row.Omega, row.tau, None, _finite(heights[k]), _finite(widths[k]),
                    row.outcome, seen_by(0), row.dV, row.dS,
                )
                for k, row in enumerate(self.axial.table())
            ]  # fmt: skip
        return tuple(sorted(rows, key=_pace))

    def between(self, low: float, high: float) -> tuple[OrderMode, ...]:
        """The rows whose ω lies between two frequencies."""
        return tuple(row for row in self.table() if row.omega is not None and low < row.omega < high)


def checked_azimuth(azimuth: int | Sequence[int]) -> tuple[int, ...]:
    """Orders from 0 on, each once and rising.

    Raises:
        BadValue: None, or one that is not a whole number from 0 to 40.
    """
    given = np.atleast_1d(np.asarray(azimuth))
    whole = given.ndim == 1 and given.size > 0 and np.issubdtype(given.dtype, np.integer)
    if not (whole and given.min() >= 0 and given.max() <= HIGHEST_ORDER):
        raise BadValue(
            "azimuth",
            found=repr(azimuth),
            expected=f"whole numbers from 0 to {HIGHEST_ORDER}",
            remedy="(0, 1, 2, 3) is usual.",
        )
    return tuple(sorted(set(given.tolist())))


@eqx.filter_jit
def _changes(found: Modes) -> tuple[Array, Array]:
    """Change of height and width along each axisymmetric mode [R0]."""
    shape, q = found.rest.meridian, found.rest.coordinates

    def along(measure, way):
        real, imag = (jax.jvp(lambda q: measure(shape, q), (q,), (part,))[1] for part in (way.real, way.imag))
        return jnp.hypot(real, imag)

    heights, widths = (jax.vmap(lambda way, m=measure: along(m, way))(found.shapes) for measure in (height, width))
    return heights, widths


def _pace(row: OrderMode) -> tuple[int, float]:
    if row.growth is not None:
        return 0, -row.growth
    return (2, 0.0) if row.omega is None else (1, row.omega)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

"""What a fit may change: free, fixed and bounded parameters.

Masses and damping are positive, so the solver sees their logarithms; the
coupling it sees as it is. Results and errors are always of the parameter itself.
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.errors import BadName, BadValue


class Unknowns(eqx.Module):
    """The parameters of a model, and which of them are free.

    Attributes:
        names: All parameters, in the model's order.
        free: Those the solver changes.
        positive: Those it changes through their logarithm.
        fixed: (names,) values of the fixed ones; ignored where free.
        low: (free,) lower bounds, as the solver sees them.
        high: (free,) upper bounds, as the solver sees them.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    free: tuple[str, ...] = eqx.field(static=True)
    positive: frozenset[str] = eqx.field(static=True)
    fixed: np.ndarray | jax.Array
    low: np.ndarray | jax.Array
    high: np.ndarray | jax.Array

    def natural(self, unknowns: Float[Array, " free"]) -> Float[Array, " names"]:
        """All parameters, from what the solver sees."""
        values = []
        for i, name in enumerate(self.names):
            if name not in self.free:
                values.append(jnp.asarray(self.fixed[i], dtype=float))
            else:
                u = unknowns[self.free.index(name)]
                values.append(jnp.exp(u) if name in self.positive else u)
        return jnp.stack(values)

    def seen(self, natural: np.ndarray) -> np.ndarray:
        """What the solver sees, (starts, free), of (starts, names) values; kept inside the bounds."""
        columns = []
        for name in self.free:
            values = natural[:, self.names.index(name)]
            columns.append(np.log(np.maximum(values, 1e-12)) if name in self.positive else values)
        return np.clip(np.stack(columns, axis=1), self.low, self.high)


def unknowns(
    names: tuple[str, ...],
    positive: frozenset[str],
    fix: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Unknowns:
    """The parameters of a model, some fixed, some bounded.

    Args:
        names: All parameters.
        positive: Those that cannot be negative.
        fix: Values of the fixed ones.
        bounds: Lowest and highest value of any.

    Raises:
        BadName: A parameter that the model does not have.
        BadValue: Nothing left free; a value or a bound that the parameter cannot take.
    """
    fix, bounds = dict(fix or {}), dict(bounds or {})
    for name in (*fix, *bounds):
        if name not in names:
            raise BadName(
                f"parameter {name!r}",
                found="no such parameter",
                expected="one of " + ", ".join(names),
                remedy="Check the spelling.",
            )
    free = tuple(name for name in names if name not in fix)
    if not free:
        raise BadValue("fix", found="every parameter fixed", expected="a free one", remedy="Free a parameter.")
    for name, value in fix.items():
        if not np.isfinite(value) or (name in positive and value < 0):
            raise BadValue(f"fix[{name!r}]", found=f"{value:g}", expected="a value it can take", remedy="Check it.")

    low, high = [], []
    for name in free:
        least, most = bounds.get(name, (-np.inf, np.inf))
        if not least < most or (name in positive and most <= 0):
            raise BadValue(
                f"bounds[{name!r}]",
                found=f"({least:g}, {most:g})",
                expected="lowest < highest, and room above 0 for a positive parameter",
                remedy="Check the order.",
            )
        if name in positive:
            least, most = (np.log(least) if least > 0 else -np.inf), np.log(most)
        low.append(least)
        high.append(most)
    fixed = np.array([float(fix.get(name, 1.0)) for name in names])
    return Unknowns(names, free, positive, fixed, np.array(low), np.array(high))

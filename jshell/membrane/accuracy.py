"""How far a rest shape is from the limit of many elements.

The shape is taken to a finer mesh and let settle there; what changes is the
coarse one's error, to the share that the finer one keeps of it. Splines of
degree 5 leave a hundredth and less of an error when elements are half as long.

Source     the usual a posteriori estimate by refinement
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import halved
from jshell.errors import Outcome
from jshell.membrane.energy import Area
from jshell.membrane.equilibrium import RestShape, reworked
from jshell.shell.parameters import Reduced


class ShapeError(NamedTuple):
    """Estimated errors of a rest shape, coarse less fine.

    volume_ratio, area_ratio: V/V0, S/S0 [-]. pressure, difference: P, ΔP [E d/R0]. elastic: energy [E d R0²].
    outcome: ok, or what the finer shape ended with; the numbers are an estimate only where it is ok.
    """

    volume_ratio: Float[Array, ""]
    area_ratio: Float[Array, ""]
    pressure: Float[Array, ""]
    difference: Float[Array, ""]
    elastic: Float[Array, ""]
    outcome: Int[Array, ""]


def estimate_error(
    shape: RestShape, conditions: Reduced, *, area: Area | str = "current", branch: str = "buckled", held: bool = False
) -> ShapeError:
    """Error of a rest shape from its elements, by settling it on every element's halves.

    Args:
        shape: From `rest` without a weak spot, not batched.
        conditions: Those it was found under.
        area, branch: Those it was found with.
        held: Whether its volume was given, not its outer pressure.

    Example:
        >>> import jshell as js
        >>> c = js.presets.R.conditions
        >>> coarse = js.membrane.rest(c, elements=16)
        >>> error = js.membrane.estimate_error(coarse, c)
        >>> bool(1e-8 < abs(error.volume_ratio) < 1e-5)
        True
    """
    base = halved(shape.meridian)
    ratio = shape.volume_ratio if held else None
    found = reworked(shape, base, base.nodes, conditions.as_arrays(), branch, area, ratio)
    outcome = jnp.where(shape.outcome == Outcome.OK, found.outcome, shape.outcome)
    return ShapeError(
        shape.volume_ratio - found.volume_ratio,
        shape.area_ratio - found.area_ratio,
        shape.pressure - found.pressure,
        shape.difference - found.difference,
        shape.elastic - found.elastic,
        outcome,
    )

"""The Maxwell point: at held volume, where dimple and compressed sphere store the same energy.

Deflated further, the dimpled shell is the one with less energy; before it, the
sphere. Between this point and the fold of the branch both are stable.

Symbols    V volume [R0³]   p = ΔP pressure difference [E d/R0]   ΔV_C deflation of the sphere at ΔP_b
Valid for  one axisymmetric dimple on a free shell
Source     Hutchinson and Thompson 2017 for the notion and its use
"""

from typing import Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.contour import Meridian
from jshell.errors import Outcome, choose
from jshell.membrane.branch import Branch, deflation_branch
from jshell.membrane.energy import Area, elastic_energy, wall
from jshell.membrane.newton import settle_at_volume
from jshell.membrane.threshold import sphere_elastic
from jshell.shell.elasticity import SPHERE_VOLUME, buckling_threshold
from jshell.shell.parameters import Reduced

CLOSENESS = 1e-9  # in V/V0
Sphere = Literal["exact", "linear"]
SPHERES = ("exact", "linear")


class Maxwell(NamedTuple):
    """Where dimple and sphere of one volume have one energy; NaN unless the outcome is ok.

    volume_ratio: V/V0 [-]. difference: ΔP of the dimpled shell [E d/R0]. elastic: the energy [E d R0²].
    deflation_over_classical: ΔV/ΔV_C with ΔV_C/V0 = 3 (1 - ν) ΔP_b/2 [-]. over_classical: ΔP/ΔP_b [-].
    outcome: ok, or not_converged where the branch does not come to such a point.
    """

    volume_ratio: float
    difference: float
    elastic: float
    deflation_over_classical: float
    over_classical: float
    outcome: Outcome


def maxwell_point(
    conditions: Reduced,
    *,
    area: Area | str = "current",
    elements: int = 32,
    branch: Branch | None = None,
    sphere: Sphere | str = "exact",
) -> Maxwell:
    """Maxwell point under volume control.

    Args:
        conditions: The problem without units; thickness and Poisson ratio alone count.
        area: Which elastic energy.
        elements: Elements of the meridian.
        branch: The deflation branch, where it has been followed already, in the same energy.
        sphere: The sphere's energy: `exact`, in the same energy as the dimple's, or `linear`, the ½ ΔP_b ΔV²/ΔV_C
            that printed values are measured against.

    Raises:
        BadName: Another sphere.
        NotOk: No branch to look on.
    """
    choose("sphere", sphere, SPHERES, remedy="exact is usual.")
    c = conditions.as_arrays()
    classical = float(buckling_threshold(c.thickness, c.poisson_ratio))
    deflation = 3 * (1 - float(c.poisson_ratio)) * classical / 2

    def of_sphere(ratio):
        if sphere == "linear":
            return classical * (1 - ratio) ** 2 / deflation / 2 * SPHERE_VOLUME
        return float(_sphere(base, ratio, c, area))

    followed = deflation_branch(c, elements=elements, area=area, lowest=0.65) if branch is None else branch
    base = followed.base

    ratios = followed.volume_ratio
    spheres = np.array([of_sphere(ratio) for ratio in ratios])
    excess = np.where(followed.held_stability > 0, followed.elastic - spheres, np.nan)
    crossing = np.flatnonzero((excess[:-1] > 0) & (excess[1:] < 0))
    if crossing.size == 0:
        return Maxwell(np.nan, np.nan, np.nan, np.nan, np.nan, Outcome.NOT_CONVERGED)
    k = int(crossing[0])
    shape, q = followed.shape(k)

    def at(ratio):
        p, elastic, converged = _held(shape, q, jnp.asarray(followed.difference[k]), jnp.asarray(ratio), c, area)
        return float(p), float(elastic), bool(converged)

    difference = lambda ratio: at(ratio)[1] - of_sphere(ratio)  # noqa: E731
    from scipy.optimize import brentq  # here: it is slow to load, and few need it

    ratio = float(np.asarray(brentq(difference, ratios[k], ratios[k + 1], xtol=CLOSENESS)))
    p, elastic, converged = at(ratio)
    outcome = Outcome.OK if converged else Outcome.NOT_CONVERGED
    return Maxwell(ratio, p, elastic, (1 - ratio) / deflation, p / classical, outcome)


@eqx.filter_jit
def _sphere(base: Meridian, ratio, conditions: Reduced, area: str) -> Float[Array, ""]:
    return sphere_elastic(base, jnp.cbrt(jnp.asarray(ratio)), conditions, area)


@eqx.filter_jit
def _held(shape: Meridian, q: Float[Array, "coordinates"], p, ratio, conditions: Reduced, area: str):
    """Pressure difference and energy at a volume near that of a shape, and whether they were found."""
    profile = jnp.ones_like(shape.angles)
    found = settle_at_volume(shape, conditions, profile, q, p, ratio * SPHERE_VOLUME, area)
    return found.difference, elastic_energy(shape, found.q, wall(shape, conditions, profile), area), found.converged

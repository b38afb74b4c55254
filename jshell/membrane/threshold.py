"""Where the compressed sphere loses its stability: its first axisymmetric eigenvalue.

The sphere of radius R needs a pressure difference that follows from its elastic
energy; the eigenvalue is the first one at which the Hessian has a zero.

Symbols    R radius [R0]   p = ΔP pressure difference [E d/R0]   ΔP_b classical threshold
Valid for  perfect, free shells; a weak spot or a pad lowers the eigenvalue
Source     Zoelly 1915 and Koiter 1969 for the thin limit, where the ratio to ΔP_b is 1
"""

import importlib

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import Meridian
from jshell.errors import Outcome
from jshell.membrane.energy import Area, check_area, elastic_energy, stiffness_at, wall
from jshell.membrane.equilibrium import cached_meridian
from jshell.membrane.newton import pinned
from jshell.shell.elasticity import Scalar, buckling_threshold
from jshell.shell.parameters import Reduced

FURTHEST = 2.5  # the search ends at this multiple of the classical compression
CLOSENESS = 1e-10


class Threshold(eqx.Module):
    """The load at which the compressed sphere buckles.

    Attributes:
        difference: Pressure difference [E d/R0].
        over_classical: The same over ΔP_b = 2 d̂/sqrt(3 (1 - ν²)) [-].
        volume_ratio: V/V0 of the sphere there [-].
        outcome: ok, or not_converged where no eigenvalue was found in the range.
    """

    difference: Float[Array, ""]
    over_classical: Float[Array, ""]
    volume_ratio: Float[Array, ""]
    outcome: Int[Array, ""]


def buckling_eigenvalue(
    thickness: Scalar, poisson_ratio: Scalar = 0.5, *, area: Area | str = "current", elements: int | None = None
) -> Threshold:
    """First axisymmetric eigenvalue of the compressed sphere.

    Args:
        thickness: d̂ [-].
        poisson_ratio: ν [-].
        area: Which elastic energy.
        elements: Even elements; by default 32, and more where short waves need them (below d̂ = 0.025).

    Example:
        >>> from jshell.membrane import buckling_eigenvalue
        >>> print(buckling_eigenvalue(0.22).over_classical.round(3))
        0.889
    """
    check_area(area)
    if elements is None:
        # wave number ~ 1.9/√d̂; four elements a wave keep six digits
        thinnest = float(jnp.min(jnp.asarray(thickness)))
        elements = max(32, 8 * round(5 / 8 / thinnest**0.5))
    c = Reduced(thickness, 1.0, 1.0, 0.0, 1.4, poisson_ratio).as_arrays()
    return _first_zero(cached_meridian(elements, 0.0), c, area)


def sphere_difference(shape: Meridian, radius: Scalar, conditions: Reduced, area: Area | str) -> Float[Array, ""]:
    """Pressure difference that holds a sphere of a radius, ΔP = -U'(R)/(4πR²) [E d/R0]."""
    return -jax.grad(lambda R: sphere_elastic(shape, R, conditions, area))(jnp.asarray(radius)) / (
        4 * jnp.pi * radius**2
    )


def sphere_elastic(shape: Meridian, radius: Scalar, conditions: Reduced, area: Area | str) -> Float[Array, ""]:
    """Elastic energy of a sphere of a radius, in any of the energies [E d R0²]."""
    plain = wall(shape, conditions, jnp.ones_like(shape.angles))
    return elastic_energy(shape, shape.sphere * radius, plain, area)


@eqx.filter_jit
def _first_zero(shape: Meridian, conditions: Reduced, area: str) -> Threshold:
    plain = wall(shape, conditions, jnp.ones_like(shape.angles))
    classical = jnp.asarray(buckling_threshold(conditions.thickness, conditions.poisson_ratio))

    def lowest(radius, _):
        p = sphere_difference(shape, radius, conditions, area)
        K = pinned(shape, stiffness_at(shape, shape.sphere * radius, plain, p, area))
        return jnp.linalg.eigvalsh(K)[0]

    compression = classical * (1 - conditions.poisson_ratio) / 2
    low = jnp.maximum(1 - FURTHEST * compression, 0.5)
    optx = importlib.import_module("optimistix")  # here: it is slow to load, and few need it
    solver = optx.Bisection(rtol=CLOSENESS, atol=CLOSENESS)
    limits = {"lower": low, "upper": jnp.asarray(1.0)}
    found = optx.root_find(lowest, solver, (low + 1) / 2, None, options=limits, throw=False, max_steps=64)
    ok = (found.result == optx.RESULTS.successful) & (lowest(low, None) < 0)
    p = sphere_difference(shape, found.value, conditions, area)
    outcome = jnp.where(ok, Outcome.OK, Outcome.NOT_CONVERGED)
    nan = lambda value: jnp.where(ok, value, jnp.nan)  # noqa: E731
    return Threshold(nan(p), nan(p / classical), nan(found.value**3), outcome)

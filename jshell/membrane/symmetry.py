"""Where a dimple first stops being round, as it deepens.

Along the deflation branch the lowest eigenvalue against motions out of round
falls; its first zero is the loss of symmetry.

Symbols    V volume [R0³]   m order of the motion that sets in
Valid for  free shells without a weak spot
Source     zeros of the eigenvalues of `stability`
"""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jshell.contour import Meridian
from jshell.errors import Outcome
from jshell.membrane.branch import Branch
from jshell.membrane.energy import Area, check_area
from jshell.membrane.equilibrium import RestShape, cached_meridian, measured, reworked
from jshell.membrane.newton import settle_at_volume
from jshell.membrane.stability import FINER, spectrum, spread, usual_orders
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced

APART = 0.02  # in V/V0: how far the shapes lie apart that are looked at
CLOSE = 1e-5  # in V/V0, of a loss
TRIES = 20


@dataclass(frozen=True)
class SymmetryLoss:
    """Where a branch first loses its axial symmetry, coming from the sphere.

    Attributes:
        volume_ratio, difference: V/V0 [-], ΔP [E d/R0]; None where it stays round to the end of the branch.
        order: m of the motion that sets in.
        checked: Smallest V/V0 looked at.
        outcome: ok; not_converged where a shape on the way was not found.
    """

    volume_ratio: float | None
    difference: float | None
    order: int | None
    checked: float
    outcome: Outcome


def symmetry_loss(branch: Branch, conditions: Reduced, *, area: Area | str = "current") -> SymmetryLoss:
    """First loss of symmetry along a branch, from the fold of the volume to its deflated end.

    Args:
        branch: From `deflation_branch`.
        conditions, area: Those it was followed with.
    """
    check_area(area)
    conditions = conditions.as_arrays()
    orders = jnp.asarray(usual_orders(float(conditions.thickness)))
    volumes = branch.volume_ratio
    deflating = np.arange(int(np.argmax(volumes)), volumes.size)
    last = None
    for k in deflating:
        if last is not None and k != deflating[-1] and abs(volumes[k] - last[0]) < APART:
            continue
        shape = _at(branch, int(k), conditions, area)
        if int(shape.outcome) != Outcome.OK:
            # where volumes turn, one does not tell a shape
            if last is None:
                continue
            return SymmetryLoss(None, None, None, last[0], Outcome.NOT_CONVERGED)
        here = float(volumes[k]), *_softest(shape, orders)
        if here[1] < 0:
            if last is None:
                return SymmetryLoss(here[0], float(shape.difference), here[2], here[0], Outcome.OK)
            return _between(shape, last, here, conditions, area, orders)
        last = here
    checked = 1.0 if last is None else last[0]
    return SymmetryLoss(None, None, None, checked, Outcome.OK)


def _softest(shape: RestShape, orders) -> tuple[float, int]:
    """Lowest eigenvalue and its order."""
    values = np.asarray(spectrum(shape, orders)[0])
    return float(values.min()), int(orders[int(values.argmin())])


def _between(shape: RestShape, above, below, conditions, area, orders) -> SymmetryLoss:
    """The zero of the lowest eigenvalue between two volumes by false position, never one end for long."""
    (high, rise, _), (low, fall, order) = above, below
    middle = low
    for count in range(TRIES):
        if high - low < CLOSE:
            break
        middle = low + (high - low) * (-fall) / (rise - fall) if count % 3 < 2 else (low + high) / 2
        shape = _moved(shape, middle, conditions, area)
        if int(shape.outcome) != Outcome.OK:
            return SymmetryLoss(None, None, None, high, Outcome.NOT_CONVERGED)
        value, m = _softest(shape, orders)
        if abs(value) < 1e-7:
            order = m
            break
        if value > 0:
            high, rise = middle, value
        else:
            low, fall, order = middle, value, m
    return SymmetryLoss(middle, float(shape.difference), order, low, Outcome.OK)


@eqx.filter_jit
def _settled(shape: Meridian, q, p, ratio, conditions: Reduced, area: str) -> RestShape:
    """A state of a branch as a rest shape."""
    plain = jnp.ones_like(shape.angles)
    found = settle_at_volume(shape, conditions, plain, q, p, ratio * SPHERE_VOLUME, area)
    return measured(found, shape, conditions, plain, "sphere", area, ratio)


def _at(branch: Branch, k: int, conditions: Reduced, area: str) -> RestShape:
    """A state of a branch as a rest shape on more elements."""
    shape, q = branch.shape(k)
    p, ratio = jnp.asarray(branch.difference[k]), jnp.asarray(branch.volume_ratio[k])
    found = _settled(shape, q, p, ratio, conditions, area)
    return _moved(found, float(ratio), conditions, area, int(np.ceil(FINER * shape.elements / 4) * 4))


def _moved(shape: RestShape, ratio: float, conditions, area: str, elements: int | None = None) -> RestShape:
    base = cached_meridian(shape.meridian.elements if elements is None else elements, 0.0)
    breaks = spread(shape, None, base.elements)
    return reworked(shape, base, breaks, conditions, "sphere", area, jnp.asarray(ratio))

"""Where a dimple first stops being round, as it deepens.

Along the deflation branch the lowest eigenvalue against motions out of round
falls; its first zero is the loss of symmetry. At a given volume it is the zero
over the thickness.

Symbols    V volume [R0³]   d̂ thickness [-]   m order of the motion that sets in
Valid for  free shells without a weak spot
Source     zeros of the eigenvalues of `stability`
"""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jshell.contour import NO_WEAK_SPOT, Meridian
from jshell.errors import BadValue, Outcome
from jshell.membrane.branch import Branch
from jshell.membrane.energy import Area, check_area
from jshell.membrane.equilibrium import RestShape, cached_meridian, find, measured, reworked
from jshell.membrane.newton import settle_at_volume
from jshell.membrane.round import thinnest_round
from jshell.membrane.stability import FINER, checked_orders, spectrum, spread, usual_orders
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced

APART = 0.02  # in V/V0: how far the shapes lie apart that are looked at
CLOSE = 1e-5  # in V/V0, of a loss
TRIES = 20
DEEPEST, SHALLOWEST = 0.3, 0.97  # V/V0 between which a critical thickness is sought: there the law is a start
BESIDE = 0.01  # relative distance of the second thickness from the first
EXACT = 1e-5  # relative, of a critical thickness
FAR = 0.2  # of the law's thickness or volume taken: no loss of symmetry is that far from it
THINNEST, THICKEST = 0.002, 0.042  # d̂ between which a critical volume is sought


@dataclass(frozen=True)
class SymmetryLoss:
    """Where a branch first loses its axial symmetry, coming from the sphere.

    Attributes:
        volume_ratio, difference: V/V0 [-], ΔP [E d/R0]; None where no loss was seen.
        order: m of the motion that sets in.
        checked: Smallest V/V0 looked at.
        outcome: ok; not_converged where a shape on the way was not found.
    """

    volume_ratio: float | None
    difference: float | None
    order: int | None
    checked: float
    outcome: Outcome

    @property
    def words(self) -> str:
        """What was seen, in a few words."""
        if self.volume_ratio is not None:
            return f"loss of symmetry, m = {self.order}"
        return "round to the end, at" if self.outcome == Outcome.OK else "round, not followed beyond"


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


@dataclass(frozen=True)
class CriticalThickness:
    """The thickest wall that is not round at a volume.

    Attributes:
        thickness: d̂ [-]; None where the outcome is not ok.
        order: m of the motion that sets in.
        outcome: ok; not_converged where a shape on the way was not found, or no loss lies near the law.
    """

    thickness: float | None
    order: int | None
    outcome: Outcome


def critical_thickness(
    volume_ratio: float,
    *,
    order: int | None = None,
    poisson_ratio: float = 0.5,
    area: Area | str = "current",
    elements: int = 64,
) -> CriticalThickness:
    """Thickness at which a free, even shell held at a volume loses its axial symmetry, from the eigenvalues.

    Args:
        volume_ratio: V/V0 [-], from 0.3 to 0.97.
        order: m of the motion that sets in; by default whichever does first.
        poisson_ratio, area: Of the wall.
        elements: Of the meridian, crowded at the rim.

    Raises:
        BadValue: V/V0 or order out of range.
    """
    check_area(area)
    if not DEEPEST <= volume_ratio <= SHALLOWEST:
        raise BadValue(
            "volume_ratio",
            found=repr(volume_ratio),
            expected=f"V/V0 from {DEEPEST} to {SHALLOWEST}",
            remedy="0.7 is usual.",
        )
    guess, ratio = float(thinnest_round(volume_ratio, poisson_ratio)), jnp.asarray(float(volume_ratio))
    orders = jnp.asarray(usual_orders(guess) if order is None else checked_orders(order))
    like = lambda d: Reduced(d, 1.0, 1.0, 0.0, 1.4, poisson_ratio).as_arrays()  # noqa: E731
    plain = jnp.asarray(NO_WEAK_SPOT.depth), jnp.asarray(NO_WEAK_SPOT.width)
    shape = find(cached_meridian(elements, 0.0), like(guess), plain, "buckled", str(area), ratio, True)

    found = _zero(shape, lambda near, d: _moved(near, volume_ratio, like(d), str(area)), guess, orders)
    if found is None:
        return CriticalThickness(None, None, Outcome.NOT_CONVERGED)
    return CriticalThickness(*found[:2], Outcome.OK)


def critical_volume(
    thickness: float, *, poisson_ratio: float = 0.5, area: Area | str = "current", elements: int = 64
) -> SymmetryLoss:
    """Volume at which a free, even shell loses its axial symmetry as it deflates, from the eigenvalues beside the law.

    What `symmetry_loss` finds along a branch, without the branch: of thin shells that is very long.

    Args:
        thickness: d̂ [-], from 0.002, below which there are no rest shapes, to 0.042.
        poisson_ratio, area: Of the wall.
        elements: Of the meridian, crowded at the rim.

    Raises:
        BadValue: A thickness out of range.
    """
    check_area(area)
    if not THINNEST <= thickness <= THICKEST:
        raise BadValue(
            "thickness",
            found=repr(thickness),
            expected=f"d_hat from {THINNEST} to {THICKEST}",
            remedy="Of thinner shells the law alone says something; thicker ones are round at any usual volume.",
        )
    share = (thickness / float(thinnest_round(0.0, poisson_ratio))) ** 2
    conditions = Reduced(thickness, 1.0, 1.0, 0.0, 1.4, poisson_ratio).as_arrays()
    orders = jnp.asarray(usual_orders(thickness))
    plain = jnp.asarray(NO_WEAK_SPOT.depth), jnp.asarray(NO_WEAK_SPOT.width)
    start = jnp.asarray(1 - share)
    shape = find(cached_meridian(elements, 0.0), conditions, plain, "buckled", str(area), start, True)

    found = _zero(shape, lambda near, taken: _moved(near, 1 - taken, conditions, str(area)), share, orders)
    if found is None:
        return SymmetryLoss(None, None, None, 1.0, Outcome.NOT_CONVERGED)
    taken, order, there = found
    return SymmetryLoss(1 - taken, float(there.difference), order, 1 - taken, Outcome.OK)


def _zero(
    shape: RestShape, move: Callable[[RestShape, float], RestShape], guess: float, orders
) -> tuple[float, int, RestShape] | None:
    """Where the lowest eigenvalue of a shape vanishes as it is moved, near a guess: its order, and the last shape.

    Eigenvalues of near shapes lie nearly on a line, so by secants; None where a shape is not found, or no zero is near.
    """

    def at(place: float) -> tuple[float, float, int] | None:
        nonlocal shape
        moved = move(shape, place)
        if int(moved.outcome) != Outcome.OK:
            return None
        shape = moved
        return place, *_softest(moved, orders)

    before, here = at(guess), at(guess * (1 + BESIDE))
    for _ in range(TRIES):
        if before is None or here is None or before[1] == here[1]:
            break
        step = -here[1] * (here[0] - before[0]) / (here[1] - before[1])
        if abs(step) < EXACT * here[0]:
            return here[0] + step, here[2], shape
        # of several orders the lowest has kinks
        step = float(np.clip(step, -FAR / 4 * guess, FAR / 4 * guess))
        if abs(here[0] + step - guess) > FAR * guess:
            break
        before, here = here, at(here[0] + step)
    return None


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

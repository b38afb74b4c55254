"""The rest shape: where elastic energy, gas and outer pressure balance.

The door: options, warnings, and what is tried when a thin shell is not found at
once.

Symbols    V volume [R0³]   P inner pressure, ΔP pressure difference [E d/R0]
Valid for  as the elastic energy; a wall that does not touch itself; axial symmetry: see `stability`
Source     Mokbel et al. 2021, numerical method
"""

import warnings
from typing import Literal, TypedDict

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.contour import NO_WEAK_SPOT, Meridian, WeakSpot, regrade, rim_breaks, thinned, transfer
from jshell.errors import BadValue, Outcome, RangeWarning, choose
from jshell.membrane.energy import Area, check_area
from jshell.membrane.equilibrium import RestShape, cached_meridian, find, raise_unless_ok, seed, settle, shape_like
from jshell.membrane.round import warn_where_not_round
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced
from jshell.undetermined import undetermined

Branch = Literal["buckled", "sphere"]
BRANCHES = ("buckled", "sphere")
Grading = Literal["rim", "uniform"]
GRADINGS = ("rim", "uniform")
THIN = 0.02  # a shell thinner than this that is not found at once is sought by continuation from here
SHRINK, NO_STEP = 0.8, 0.995  # ratio of thicknesses from step to step; where it gives up
UNRESOLVED = 1.5  # above this the rim is not there
COARSEST = 0.6  # element length at the rim over √d̂ that still gives V/V0 to 1e-4


ELEMENTS = 32


class RestOptions(TypedDict, total=False):
    """Keywords that whatever begins at a rest shape passes on to `rest`."""

    branch: Branch | str
    elements: int
    attached: float
    weak_spot: WeakSpot
    area: Area | str


def rest(
    conditions: Reduced,
    *,
    branch: Branch | str = "buckled",
    elements: int = ELEMENTS,
    attached: float = 0.0,
    weak_spot: WeakSpot = NO_WEAK_SPOT,
    area: Area | str = "current",
    volume_ratio: Scalar | None = None,
    grading: Grading | str = "rim",
    throw: bool = False,
) -> RestShape:
    """Rest shape of a shell on one branch; differentiable and vmappable in the conditions.

    Args:
        conditions: The problem without units.
        branch: `buckled`, or `sphere` (found whether stable or not).
        elements: Elements of the meridian; with a pad twelve more, which shrink towards its edge on both sides.
        attached: Half-angle of the pad that holds the shell [rad]; 0 is free.
        weak_spot: Thinner wall around the buckling pole; none by default.
        area: Which elastic energy, see `jshell.membrane.energy.density`.
        volume_ratio: Hold the shell at this V/V0 [-] instead: the outer pressure is then found, not given.
        grading: `rim` crowds the nodes where a dimple bends, `uniform` spaces them evenly. On the sphere both are even.
        throw: Raise `NotOk` unless the outcome is ok (outside `jit` only).

    Returns:
        The shape; where its `outcome` is not ok its numbers are NaN.

    Raises:
        BadName, BadValue: An option that does not exist, or a number outside its meaning.

    Example:
        >>> import jshell as js
        >>> shape = js.membrane.rest(js.presets.R.conditions)
        >>> print(shape.volume_ratio.round(4), shape.pressure.round(4))
        0.6992 1.4853
    """
    for name, value, known in (("branch", branch, BRANCHES), ("grading", grading, GRADINGS)):
        choose(name, value, known)
    check_area(area)
    _check_ratio(volume_ratio)
    ratio = None if volume_ratio is None else jnp.asarray(volume_ratio, dtype=float)
    spot = jnp.asarray(weak_spot.depth, dtype=float), jnp.asarray(weak_spot.width, dtype=float)
    graded = grading == "rim" and branch == "buckled"
    base = cached_meridian(elements, attached, attached != 0.0)
    found = find(base, conditions.as_arrays(), spot, branch, area, ratio, graded)
    if branch == "buckled":
        if graded and attached and _lost(found, conditions):
            # elements so small at the pad's edge may throw a mirrored cap off; the shape of even ones they bear
            even = find(cached_meridian(elements, attached), conditions.as_arrays(), spot, branch, area, ratio, graded)
            if int(even.outcome) == Outcome.OK:
                found = _moved(even, conditions.as_arrays(), spot, area, ratio, base)
        if volume_ratio is None and _lost(found, conditions, THIN):
            found = thinned_down(conditions.as_arrays(), found, spot, area)
        found = judged(found, conditions.thickness)
    if throw:
        raise_unless_ok("rest shape", found.outcome)
    return blanked(found)


def blanked(found: RestShape) -> RestShape:
    """The shape, its numbers NaN where the outcome is not ok; gap and clearance stay, where they are the reason."""
    failed = found.outcome != Outcome.OK
    overlapping = found.outcome == Outcome.CONTACT
    room = undetermined(failed & ~overlapping, (found.gap, found.clearance))
    given = lambda s: (s.meridian, s.conditions)  # noqa: E731
    numbers = undetermined(failed, eqx.tree_at(given, found, (None, None)))
    kept = lambda s: (s.meridian, s.conditions, s.gap, s.clearance)  # noqa: E731
    return eqx.tree_at(kept, numbers, (*given(found), *room), is_leaf=lambda x: x is None)


def judged(found: RestShape, thickness: Scalar) -> RestShape:
    """Warn of a shape that is not round and of too few elements at the rim (concrete shapes only).

    Where a rim lies within an element or two, the shape is out_of_range.
    """
    thickness, outcome = jax.lax.stop_gradient((thickness, found.outcome))
    if isinstance(thickness, Tracer) or isinstance(outcome, Tracer):
        return found
    warn_where_not_round(found, 4)
    ok = np.asarray(outcome) == Outcome.OK
    if not np.any(ok):
        return found
    spacing = np.asarray(rim_spacing(jax.lax.stop_gradient(found)))
    coarse = np.where(ok, spacing / np.sqrt(np.asarray(thickness)), 0.0)
    if np.max(coarse) > COARSEST:
        smallest = (np.max(np.where(ok, spacing, 0.0)) / COARSEST) ** 2
        warnings.warn(
            f"elements at the rim are {np.max(coarse):.2g} sqrt(d_hat) long: V/V0 may be off by more than 1e-4; the "
            f"smallest d_hat that they resolve is about {smallest:.2g}: take more elements, or grading='rim'",
            RangeWarning,
            stacklevel=3,
        )
    judgement = jnp.where(jnp.asarray(coarse > UNRESOLVED), int(Outcome.OUT_OF_RANGE), found.outcome)
    return eqx.tree_at(lambda shape: shape.outcome, found, judgement)


def _lost(found: RestShape, conditions: Reduced, below: float = np.inf) -> bool:
    """Whether a single shell thinner than that, whose numbers are known, did not converge."""
    # outside `jit` and `vmap` the numbers are known even while a derivative is taken
    thickness, outcome = jax.lax.stop_gradient((conditions.thickness, found.outcome))
    if isinstance(thickness, Tracer) or isinstance(outcome, Tracer) or np.ndim(thickness) or outcome.ndim:
        return False
    return float(thickness) < below and int(outcome) == Outcome.NOT_CONVERGED


def thinned_down(
    conditions: Reduced, lost: RestShape, spot: tuple[Float[Array, ""], Float[Array, ""]], area: str
) -> RestShape:
    """A thin shell's rest shape by continuation from a thicker one, at the volume its gas will have.

    Where a thickness is reached at which no step succeeds, the lost shape comes back as out_of_range, and a warning
    names that thickness.
    """
    base = jax.lax.stop_gradient(lost.meridian)
    # the way there is not differentiated: the last step, at the conditions themselves, carries the derivative
    known = jax.lax.stop_gradient(conditions)
    wanted, ratio = float(known.thickness), shape_like(known, None)
    with_thickness = lambda d: eqx.tree_at(lambda c: c.thickness, known, jnp.asarray(d))  # noqa: E731
    reached, shrink = THIN, SHRINK
    last = find(base, with_thickness(THIN), spot, "buckled", area, ratio, True)
    while int(last.outcome) == Outcome.OK and reached > wanted and shrink < NO_STEP:
        d = max(wanted, reached * shrink)
        trial = _moved(last, with_thickness(d), spot, area, ratio)
        if int(trial.outcome) == Outcome.OK:
            last, reached = trial, d
        else:
            shrink = shrink**0.5
    if reached == wanted and int(last.outcome) == Outcome.OK:
        found = _moved(last, conditions, spot, area, None)
        if int(found.outcome) != Outcome.NOT_CONVERGED:
            return found
    warnings.warn(
        f"no rest shape at d_hat = {wanted:g} on {base.elements} elements; the smallest reached is {reached:.3g}: "
        "take more elements",
        RangeWarning,
        stacklevel=4,
    )
    return eqx.tree_at(lambda s: s.outcome, lost, jnp.asarray(int(Outcome.OUT_OF_RANGE)))


@eqx.filter_jit
def _moved(
    before: RestShape,
    conditions: Reduced,
    spot: tuple[Float[Array, ""], Float[Array, ""]],
    area: str,
    volume_ratio: Float[Array, ""] | None,
    onto: Meridian | None = None,
) -> RestShape:
    """The rest shape near another one, on nodes that follow its rim, of its own mesh or of another."""
    base = before.meridian if onto is None else onto
    shape = regrade(base, rim_breaks(before.meridian, before.coordinates, onto=base))
    start = transfer(before.coordinates, before.meridian, shape)
    return settle(shape, conditions, thinned(shape, *spot), start, "buckled", area, volume_ratio)


@eqx.filter_jit
def rim_spacing(found: RestShape) -> Float[Array, "..."]:
    """Length of the element that bends most [rad]."""

    def spacing(shape, q):
        curve = shape.at_points(q)
        turning = jnp.abs(curve.x1 * curve.r2 - curve.r1 * curve.x2) / (curve.x1**2 + curve.r1**2)
        where = jnp.searchsorted(shape.nodes, shape.angles[jnp.argmax(turning)]) - 1
        return jnp.diff(shape.nodes)[where]

    batch = found.volume.ndim
    for _ in range(batch):
        spacing = eqx.filter_vmap(spacing)
    return spacing(found.meridian, found.coordinates)


@eqx.filter_jit
def rest_shape(
    shape: Meridian, conditions: Reduced, profile: Float[Array, "points"], branch: str, area: str
) -> RestShape:
    """Rest shape on a given discretisation and thickness profile."""
    return settle(shape, conditions, profile, seed(shape, conditions, branch, None), branch, area)


def _check_ratio(ratio: Scalar | None) -> None:
    if ratio is None or isinstance(ratio, Tracer):
        return
    numbers = np.asarray(ratio)
    if not np.all((numbers > 0.05) & (numbers < 1.2)):
        raise BadValue(
            "volume_ratio",
            found=f"{numbers}",
            expected="V/V0 from 0.05 to 1.2",
            remedy="0.7 is usual; 1 is the sphere.",
        )

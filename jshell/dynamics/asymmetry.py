"""Whether the dimple of a run is round: by the law, or by shapes at rest at volumes that the run went through.

A run is of axial symmetry. The deeper a dimple, the less round it is; so it is
looked at where it was deepest, and where it ended.

Symbols    V volume [R0³]   d̂ thickness [-]
Valid for  as `jshell.membrane.stability`; a motion slow against what grows
Source     `jshell.dynamics.roundness`, `jshell.membrane.round`
"""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jshell.contour import NO_WEAK_SPOT, WeakSpot
from jshell.dynamics.roundness import Roundness, roundness
from jshell.errors import Outcome, RangeWarning
from jshell.membrane import RestShape, rest, symmetry_by_law, thinnest_round
from jshell.membrane.round import words_of_law
from jshell.membrane.stability import refined
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

THIN = 0.05  # d̂: a dimple of V/V0 > 0 in a thicker wall is round
LAST = 5  # the end of a run is its last fifth
APART = 0.005  # in V/V0: an end as near to the deepest is not looked at for itself


def warn_of_asymmetry(trace: Trace, conditions: Reduced) -> tuple[tuple[str, str], ...]:
    """What the law says of the dimple of a thin shell at its deepest, as a setting of the trace; warns if not round."""
    found = _volumes(trace, conditions)
    if found is None:
        return ()
    thickness, nu, deepest = float(conditions.thickness), float(conditions.poisson_ratio), found[0]
    if thickness < thinnest_round(deepest, nu):
        warnings.warn(words_of_law(thickness, deepest, nu), RangeWarning, stacklevel=5)
    elif thickness >= THIN:
        return ()
    return (("symmetry", symmetry_by_law(thickness, deepest, nu)),)


def computed_symmetry(
    trace: Trace,
    conditions: Reduced,
    start: RestShape | None,
    elements: int,
    attached: float,
    spot: WeakSpot | None,
    area: str,
) -> tuple[tuple[str, str], ...]:
    """Whether the dimple of a run is round, from the shapes at rest at its deepest volume and at its last.

    Args:
        trace, conditions: Of the run.
        start: The rest shape that the run began at, or None.
        elements, attached, spot, area: Of the run.

    Returns:
        The verdicts, as settings of the trace. Warns where one of them is that it is not round.
    """
    volumes = _volumes(trace, conditions)
    if volumes is None:
        return ()
    deepest, end = volumes
    said: list[tuple[str, str]] = []
    looks = [("deepest", deepest)]
    for place, ratio in looks:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RangeWarning)  # what is said here says it
            shape = _at_rest(ratio, conditions, start, elements, attached, spot, area)
            found = roundness(shape) if int(shape.outcome) == Outcome.OK else None
        said.append((place, f"{_words(found, shape)} at V/V0 = {ratio:.3g} ({place})"))
        # a shallower dimple is rounder
        if place == "deepest" and abs(end - deepest) > APART and not (found and found.stability.is_round):
            looks.append(("end", end))
    words = "; ".join(text for _, text in said)
    if "not round" in words:
        warnings.warn(f"{words} (computed): axial symmetry is assumed here", RangeWarning, stacklevel=5)
    return (("symmetry", words),)


def _words(found: Roundness | None, shape: RestShape) -> str:
    if found is None:
        return f"unknown (rest shape: {Outcome(int(shape.outcome)).word})"
    return found.verdict


def _volumes(trace: Trace, conditions: Reduced) -> tuple[float, float] | None:
    """V/V0 where the dimple of a run was deepest, and at its end; None where there is none, or no numbers."""
    said = dict(trace.settings)
    given = trace["V"], conditions.thickness, conditions.poisson_ratio
    if any(isinstance(number, Tracer) for number in given) or ("ramp" in said and "buckled_at" not in said):
        return None  # a sphere that is compressed has no dimple
    ratios = np.asarray(trace["V"], dtype=float) / SPHERE_VOLUME
    return float(np.nanmin(ratios)), float(np.nanmean(ratios[-max(1, ratios.size // LAST) :]))


def _at_rest(ratio: float, conditions: Reduced, start, elements, attached, spot, area) -> RestShape:
    """The shape of a run's shell held at a volume."""
    if start is None:
        spot = NO_WEAK_SPOT if spot is None else spot
        return rest(conditions, elements=elements, attached=attached, weak_spot=spot, area=area, volume_ratio=ratio)
    frozen = jax.lax.stop_gradient(start)
    held = jnp.asarray(ratio * SPHERE_VOLUME), conditions.as_arrays()
    moved = eqx.tree_at(lambda s: (s.volume, s.conditions), frozen, held)
    return refined(moved, start.meridian.elements)

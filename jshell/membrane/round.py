"""What is said of a shape that may not be round: by a law, or by its stability where the law is near.

The zeros of `symmetry` lie at

    d̂ = 0.050 √(1 - V/V0) √((1 - ν²)/0.75)

so a thinner shell is not round at that volume.

Symbols    V volume [R0³]   d̂ thickness [-]
Valid for  free shells without a weak spot, ν = 1/2, energy current: V/V0 0.35 to 0.96 (d̂ 0.04 to 0.01), to 1 %;
           ν = 0.3 at d̂ 0.02 and 0.03, to 0.4 %
Source     zeros of `stability`; 1 - V/V0 ~ d̂², as Knoche and Kierfeld 2014 find
"""

import warnings

import jax
import numpy as np
from jax.core import Tracer

from jshell.errors import Outcome, RangeWarning
from jshell.membrane.equilibrium import RestShape
from jshell.membrane.stability import stability

LAW = 0.050  # of d̂ over √(1 - V/V0)
FITTED = (0.35, 0.96)  # V/V0
THICK = 0.055  # d̂ of a wall that is round at any volume and ν, by eigenvalues down to V/V0 = 0.35
EVEN = 1e-12  # relative change of the thickness along an even wall
NEAR = 1.25  # ratio of d̂ to the law, either way, within which the eigenvalues are computed


def thinnest_round(volume_ratio: float | np.ndarray, poisson_ratio: float | np.ndarray = 0.5) -> float | np.ndarray:
    """d̂ below which the law says that a dimple is not round at a volume [-].

    Example:
        >>> from jshell.membrane import thinnest_round
        >>> print(f"{thinnest_round(0.7):.4f}")
        0.0274
    """
    # what counts is the bending stiffness, d̂²/(1 - ν²)
    bending = np.sqrt((1 - np.asarray(poisson_ratio) ** 2) / 0.75)
    return LAW * bending * np.sqrt(np.maximum(1 - np.asarray(volume_ratio), 0.0))


def symmetry_in_doubt(found: RestShape) -> bool:
    """Whether one buckled rest shape, whose numbers are known, is so near the law that its eigenvalues must decide."""
    return int(found.outcome) == Outcome.OK and 1 / NEAR <= _share(found) <= NEAR


def symmetry_by_law(thickness: float, volume_ratio: float, poisson_ratio: float = 0.5) -> str:
    """What the law says of a free, even wall: `round by the law …` or `not round by the law …`."""
    is_round = thickness >= float(thinnest_round(volume_ratio, poisson_ratio))
    bending = "" if poisson_ratio == 0.5 else " sqrt((1 - nu^2)/0.75)"
    law = f"by the law d_hat {'>' if is_round else '<'} {LAW:.3f} sqrt(1 - V/V0){bending}"
    inside = FITTED[0] <= volume_ratio <= FITTED[1]
    beyond = "" if inside else f", beyond the V/V0 {FITTED[0]} to {FITTED[1]} it was fitted in"
    return f"{'round' if is_round else 'not round'} {law} at V/V0 = {volume_ratio:.3g}{beyond}"


def law_holds(thickness: float, volume_ratio: float) -> bool:
    """Whether the law was fitted at a volume, or the wall is so thick that a dimple is round at any."""
    return thickness >= THICK or FITTED[0] <= volume_ratio <= FITTED[1]


def law_of(found: RestShape) -> str:
    """What the law says of one rest shape whose numbers are known, and that it is none for its holder or weak spot."""
    c = found.conditions
    said = symmetry_by_law(float(c.thickness), float(found.volume_ratio), float(c.poisson_ratio))
    plain = not found.meridian.attached and bool(np.all(np.abs(np.asarray(found.profile) - 1) < EVEN))
    return said if plain else f"{said}, which is of free shells with even walls"


def symmetry_words(found: RestShape) -> str | None:
    """What to warn of about one buckled rest shape whose numbers are known; None where it is round."""
    if int(found.outcome) != Outcome.OK or _share(found) > NEAR:
        return None
    if symmetry_in_doubt(found):
        computed = stability(found)
        if int(computed.outcome) == Outcome.OK:
            words = f"not round: m = {int(computed.order)} (computed): axial symmetry is assumed here"
            return None if computed.is_round else f"{words}, jshell.dynamics.roundness says how fast it leaves it"
    c = found.conditions
    given = float(c.thickness), float(found.volume_ratio), float(c.poisson_ratio)
    return None if _share(found) > 1 else words_of_law(*given)


def words_of_law(thickness: float, volume_ratio: float, poisson_ratio: float = 0.5) -> str:
    """The warning that a shell is not round by the law."""
    said = symmetry_by_law(thickness, volume_ratio, poisson_ratio)
    assumed = "axial symmetry is assumed here, jshell.membrane.stability computes the eigenvalues"
    return f"{said}, d_hat = {thickness:.3g}: {assumed}"


def _share(found: RestShape) -> float:
    """d̂ over the law's."""
    c = found.conditions
    return float(c.thickness) / max(float(thinnest_round(float(found.volume_ratio), float(c.poisson_ratio))), 1e-9)


def warn_where_not_round(found: RestShape, level: int = 3) -> None:
    """Warn where buckled rest shapes are not round (concrete numbers only); a batch by the law alone."""
    thickness, ratio, outcome = jax.lax.stop_gradient((found.conditions.thickness, found.volume_ratio, found.outcome))
    if any(isinstance(number, Tracer) for number in (thickness, ratio, outcome)):
        return
    if np.ndim(ratio) == 0 and np.ndim(thickness) == 0:
        words = symmetry_words(jax.lax.stop_gradient(found))
    else:
        nu = jax.lax.stop_gradient(found.conditions.poisson_ratio)
        d, V, nu, ok = np.broadcast_arrays(thickness, ratio, nu, np.asarray(outcome) == Outcome.OK)
        share = np.where(ok, d / np.maximum(thinnest_round(V, nu), 1e-9), np.inf)
        worst = np.unravel_index(np.argmin(share), share.shape)
        words = words_of_law(float(d[worst]), float(V[worst]), float(nu[worst])) if share[worst] < 1 else None
    if words is not None:
        warnings.warn(words, RangeWarning, stacklevel=level)

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


def symmetry_words(found: RestShape) -> str | None:
    """What to say of one buckled rest shape whose numbers are known; None where the law says that it is round."""
    thickness, ratio = float(found.conditions.thickness), float(found.volume_ratio)
    share = thickness / max(float(thinnest_round(ratio, float(found.conditions.poisson_ratio))), 1e-9)
    if share > NEAR or int(found.outcome) != Outcome.OK:
        return None
    if share < 1 / NEAR:
        return words_of_law(thickness, ratio)
    computed = stability(found)
    if computed.is_round:
        return None
    if int(computed.outcome) != Outcome.OK:
        return words_of_law(thickness, ratio) if share < 1 else None
    return f"not round: m = {int(computed.order)} (computed): axial symmetry is assumed here"


def words_of_law(thickness: float, ratio: float) -> str:
    """That a shell is not round by the law."""
    return (
        f"not round by the law d_hat < {LAW:.3f} sqrt(1 - V/V0): d_hat = {thickness:.3g} at V/V0 = {ratio:.3g} "
        "(factor sqrt((1 - nu^2)/0.75) for other nu); axial symmetry is assumed here, "
        "jshell.membrane.stability computes the eigenvalues"
    )


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
        words = words_of_law(float(d[worst]), float(V[worst])) if share[worst] < 1 else None
    if words is not None:
        warnings.warn(words, RangeWarning, stacklevel=level)

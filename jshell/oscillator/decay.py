"""How fast a buckled shell rings down in its liquid: a law fitted to the simulator's modes.

The source's β1 is the viscous limit, where nothing oscillates any more; at the
viscosities where shells ring it makes them ring ten times too long. Here a
layer of thickness √(η̂/ω) on the wall takes the energy. It takes √η̂ of it, and
less than that once it is no longer thin,

    1/τ = a √η̂ / (1 + b √η̂),   a = a0 P^a1 exp(-a2 u⁸),   b = b0 exp(-b1 ln²((1 - u)/b2) + b3 (d̂/0.3)⁸)

with u = V/V0 and the pressure P inside by the plateau law. A shell that is
almost a sphere rings longer (a2); one thicker than 0.24 has a slow mode that
bends the dimple without changing the volume, and softens (b3).

Symbols    τ decay time of the slow mode [sqrt(ρ_f R0³/(E d))]   η̂ viscosity   u V/V0   d̂ thickness
Valid for  d̂ 0.02-0.3, P̂0 0.4-2.5, V/V0 0.48-0.98, η̂ 0.0006-0.13, ν = 1/2, κ = 1.4, free shells that oscillate:
           4.4 % off in the middle of 427 modes, within 12 % for nine tenths of them and 33 % for all; for η̂ up to
           0.013 within 22 %. The far ones hardly oscillate, or are thicker than 0.25. Elsewhere it answers and warns
Source     data/modes/fit_decay.py, least squares in ln τ on data/modes/decay_after_buckling.csv; the √η̂ of thin
           layers: jshell.flow
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jshell.errors import RangeWarning
from jshell.oscillator.coefficients import SOURCE, Coefficients, decay_time
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import plateau_pressure

Origin = Literal["law", "given tau", "given beta1", "source beta1", "reynolds", "none"]
THICKEST = 0.3
# where the law was fitted; names are those of files
RANGES = {"d_hat": (0.02, THICKEST), "P0_hat": (0.4, 2.5), "V/V0": (0.48, 0.98), "eta_hat": (0.0006, 0.13)}
USUAL = {"kappa": 1.4, "nu": 0.5}
MEDIAN_ERROR, LARGEST_ERROR = 0.044, 0.33  # relative, of τ, over the modes it was fitted to


class Constants(NamedTuple):
    """Constants of the law, named as in its formula [-]."""

    a0: Number
    a1: Number
    a2: Number
    b0: Number
    b1: Number
    b2: Number
    b3: Number


# what data/modes/fit_decay.py finds
FITTED = Constants(a0=2.596, a1=0.0958, a2=0.8596, b0=3.487, b1=0.6132, b2=0.2448, b3=0.7693)


@dataclass(frozen=True)
class Decay:
    """How fast a shell rings down, and who says so.

    Attributes:
        tau: Decay time of both modes; infinite where nothing is lost, NaN where there is no one number (a drag
            that depends on the speed, a shell that is not buckled).
        origin: `law` (fitted to the simulator's modes), `given tau`, `given beta1`, `source beta1` (the source's
            viscous limit), `reynolds`, or `none`.
        source_tau: What the source's constants would say, α1/(2 β1 η̂).
        outside: What of the shell lies outside the range the law was fitted in, in words.
    """

    tau: float
    origin: Origin
    source_tau: float = math.nan
    outside: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """The same as a JSON object, with the law's relative errors where it is the law."""
        law = self.origin == "law"
        error = {"median": MEDIAN_ERROR, "largest": LARGEST_ERROR} if law else None
        outside = list(self.outside)
        return {"tau": self.tau, "origin": self.origin, "error": error, "outside": outside, "words": self.words}

    @property
    def words(self) -> str:
        """The same as a sentence without its full stop."""
        if self.origin == "law" and not math.isfinite(self.tau):
            return "none: the shell is not buckled" if math.isnan(self.tau) else "none: the liquid has no viscosity"
        value = "τ = ∞" if math.isinf(self.tau) else f"τ = {self.tau:.3g}"
        limit = f"the source's β1 = {float(SOURCE.beta1):.3g} (τ = {self.source_tau:.3g})"
        said = {
            "law": f"{value} from a law fitted to the simulator's modes ({100 * MEDIAN_ERROR:.2g} % off typically, "
            f"{100 * LARGEST_ERROR:.2g} % at most), not {limit}",
            "given tau": f"{value}, as given",
            "given beta1": f"{value} by the given β1",
            "source beta1": f"{limit}: the law fitted to the simulator's modes has a Stokes layer in it already",
            "reynolds": "by the law of a settling sphere, at the speed of the pole",
            "none": "no drag of the liquid",
        }[self.origin]
        return said + ("" if not self.outside else f"; outside the law's range: {', '.join(self.outside)}")


def decay_rate(
    thickness: Any, volume_ratio: Any, pressure: Any, viscosity: Any, constants: Constants = FITTED
) -> jax.Array:
    """1/τ by the law, of any shape.

    Args:
        thickness: d̂ [-]; the softening of thick shells is held from 0.3 on.
        volume_ratio: V/V0 at rest, below 1.
        pressure: Inner pressure at rest [E d/R0].
        viscosity: η̂, above 0.
        constants: Of the law.
    """
    a0, a1, a2, b0, b1, b2, b3 = constants
    root = jnp.sqrt(viscosity)
    thin = a0 * jnp.exp(a1 * jnp.log(pressure) - a2 * volume_ratio**8)
    thick = jnp.minimum(jnp.asarray(thickness) / THICKEST, 1.0) ** 8
    saturation = b0 * jnp.exp(b3 * thick - b1 * jnp.log((1 - volume_ratio) / b2) ** 2)
    return jnp.asarray(thin * root / (1 + saturation * root))


def plateau_rest(conditions: Reduced) -> tuple[jax.Array, jax.Array]:
    """V/V0 and inner pressure by the plateau law, NaN for a sphere; of any shape.

    `buckled_state` without its warning: the error of the plateau law is in the constants fitted with it.

    Source:
        eq:equiplateau, eq:equivol.
    """
    c = conditions
    pressure = jnp.asarray(c.outer_pressure - plateau_pressure(c.thickness, c.poisson_ratio))
    buckled = pressure > c.gas_pressure  # the gas is compressed: V < V0
    safe = jnp.where(buckled, pressure, 2.0 * jnp.asarray(c.gas_pressure))
    ratio = (c.gas_pressure / safe) ** (1 / jnp.asarray(c.kappa))
    return jnp.where(buckled, ratio, jnp.nan), jnp.where(buckled, safe, jnp.nan)


def fitted_decay_time(conditions: Reduced) -> jax.Array:
    """Decay time of the slow mode by the law, of any shape; safe under jit, vmap and grad.

    Returns:
        τ; infinite without viscosity, NaN where the shell is not buckled. Warns outside the range of the law
        (concrete numbers only).

    Example:
        >>> import jshell as js
        >>> tau = js.oscillator.fitted_decay_time(js.presets.R.conditions)  # the simulator's mode: 7.18
        >>> print(f"{float(tau):.1f}")
        7.5
    """
    _warn_outside(conditions)
    return _time(conditions.as_arrays())


def ringing(conditions: Reduced, coefficients: Coefficients = SOURCE) -> Coefficients:
    """The same masses and coupling, with the damping that makes both modes ring down as the law says.

    The one line that rings a shell as fast as the simulator: `simulate(shell, ringing(shell), …)`.

    Args:
        conditions: The shell, its load and its liquid.
        coefficients: Constants whose masses, coupling and dipole are kept; their damping is not read.

    Returns:
        Constants with beta1 = α1/(2 τ η̂) and beta2 tied to it; no damping where nothing is lost or buckled.

    Example:
        >>> import jshell as js
        >>> from jshell.oscillator import SOURCE, ringing
        >>> print(f"{float(ringing(js.presets.R.conditions).beta1):.0f}, the source {float(SOURCE.beta1):.1f}")
        60, the source 5.3
    """
    c = coefficients
    tau, viscosity = fitted_decay_time(conditions), jnp.asarray(conditions.viscosity, dtype=float)
    lossy = jnp.isfinite(tau)
    beta1 = jnp.asarray(c.alpha1) / (2 * jnp.where(lossy, tau, 1.0) * jnp.where(lossy, viscosity, 1.0))
    return Coefficients(c.alpha1, c.alpha2, c.k_vs, jnp.where(lossy, beta1, 0.0), dipole=c.dipole)


def decay_by_law(conditions: Reduced) -> Decay:
    """The law's decay time of one shell, with its range: what `ringing` takes, to be told."""
    tau, limit = float(_time(conditions.as_arrays())), float(decay_time(SOURCE, conditions.viscosity))
    return Decay(tau, "law", limit, outside_range(conditions))


def outside_range(conditions: Reduced) -> tuple[str, ...]:
    """What of a shell, or of any of a batch, lies outside the range the law was fitted in, in words."""
    c = conditions
    ratio, _ = plateau_rest(c.as_arrays())
    found = {"d_hat": c.thickness, "P0_hat": c.gas_pressure, "V/V0": ratio, "eta_hat": c.viscosity}
    words = []
    for name, (low, high) in RANGES.items():
        values = np.asarray(found[name], dtype=float)
        # without viscosity nothing is lost, whatever the range; a sphere has no V/V0 to be outside with
        beyond = ((values < low) | (values > high)) & (values != 0)
        if beyond.any():
            words.append(f"{name} = {float(values[beyond].ravel()[0]):.3g} ({low:g} to {high:g})")
    for name, value in (("kappa", c.kappa), ("nu", c.poisson_ratio)):
        if np.any(np.asarray(value, dtype=float) != USUAL[name]):
            words.append(f"{name} = {float(np.ravel(value)[0]):.3g} ({USUAL[name]:g})")
    return tuple(words)


def _warn_outside(conditions: Reduced) -> None:
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(conditions)):
        return
    words = outside_range(conditions)
    if words:
        warnings.warn(
            f"the decay time is by a law outside the range it was fitted in: {', '.join(words)}",
            RangeWarning,
            stacklevel=3,
        )


@eqx.filter_jit
def _time(conditions: Reduced) -> jax.Array:
    ratio, pressure = plateau_rest(conditions)
    viscosity = jnp.asarray(conditions.viscosity)
    sound = jnp.isfinite(ratio) & (viscosity > 0)
    # numbers that no branch needs are replaced before they can spoil a gradient
    keep = lambda value, instead: jnp.where(sound, value, instead)  # noqa: E731
    rate = decay_rate(conditions.thickness, keep(ratio, 0.5), keep(pressure, 1.0), keep(viscosity, 1.0))
    return jnp.where(sound, 1 / rate, jnp.where(jnp.isfinite(ratio), jnp.inf, jnp.nan))

"""What a small change does: derivatives and elasticities of any number the short model gives.

Symbols    f observable   x input   elasticity ∂ ln f/∂ ln x: percent of f per percent of x
Valid for  one point; derivatives are exact (forward mode)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.errors import BadValue, Outcome, choose
from jshell.oscillator.coefficients import Coefficients, decay_time
from jshell.oscillator.simulate import Frequencies, frequencies
from jshell.shell.parameters import CONDITION_FIELDS, Reduced
from jshell.shell.sphere import sphere_frequency_at_load

Observable: TypeAlias = Callable[[Reduced, Coefficients], jax.Array]
CONDITIONS = tuple(CONDITION_FIELDS.values())
CONSTANTS = ("alpha1", "alpha2", "k_vs", "beta1")
INPUTS = CONDITIONS + CONSTANTS


def _number(pick: Callable[[Frequencies], jax.Array]) -> Observable:
    """A number of the buckled shell; NaN where there is none, or where its slow mode is unstable."""

    def number(conditions: Reduced, coefficients: Coefficients) -> jax.Array:
        found = frequencies(conditions, coefficients)
        return jnp.where(found.outcome == int(Outcome.OK), pick(found), jnp.nan)

    return number


OBSERVABLES: dict[str, Observable] = {
    "omega_minus": _number(lambda found: found.omega_minus),
    "omega_plus": _number(lambda found: found.omega_plus),
    "tau": lambda conditions, coefficients: decay_time(coefficients, conditions.viscosity),
    "volume": _number(lambda found: found.volume),
    "pressure": _number(lambda found: found.pressure),
    "stability_margin": _number(lambda found: found.stability_margin),
    "omega_sphere": lambda conditions, coefficients: sphere_frequency_at_load(conditions),
}


@dataclass(frozen=True)
class Elasticities:
    """How an observable answers each of its inputs at one point.

    Attributes:
        name: Of the observable.
        value: f.
        inputs: Their names.
        at: Their values.
        derivative: (inputs,) ∂f/∂x.
        elasticity: (inputs,) ∂ ln f/∂ ln x; 0 where x is 0.
    """

    name: str
    value: float
    inputs: tuple[str, ...]
    at: np.ndarray
    derivative: np.ndarray
    elasticity: np.ndarray

    def record(self) -> dict[str, object]:
        """The numbers as one JSON object."""
        rows = zip(self.inputs, self.at, self.derivative, self.elasticity, strict=True)
        return {
            "observable": self.name,
            "value": self.value,
            "inputs": {n: {"value": a, "derivative": d, "elasticity": e} for n, a, d, e in rows},
        }


def observable(which: str | Observable) -> tuple[str, Observable]:
    """An observable and its name, from a key of `OBSERVABLES` or a function of conditions and coefficients.

    Raises:
        BadName: No such key.
    """
    if callable(which):
        return getattr(which, "__name__", "observable"), which
    known = "one of " + ", ".join(OBSERVABLES) + ", or a function of conditions and coefficients"
    choose("observable", which, OBSERVABLES, expected=known, remedy="Check the spelling.")
    return which, OBSERVABLES[which]


def point(conditions: Reduced, coefficients: Coefficients) -> Float[Array, " inputs"]:
    """The inputs of a problem in the order of `INPUTS`."""
    values = [getattr(conditions, name) for name in CONDITIONS] + [getattr(coefficients, name) for name in CONSTANTS]
    return jnp.stack([jnp.asarray(value, dtype=float) for value in values])


def problem(x: Float[Array, " inputs"], like: Coefficients) -> tuple[Reduced, Coefficients]:
    """The problem of a list of inputs; the second damping factor as in `like`."""
    k = len(CONDITIONS)
    return Reduced(*x[:k]), Coefficients(x[k], x[k + 1], x[k + 2], x[k + 3], like.beta2, like.dipole)


@eqx.filter_jit
def _value_and_slopes(function: Observable, x: jax.Array, like: Coefficients) -> tuple[jax.Array, jax.Array]:
    whole = lambda x: jnp.asarray(function(*problem(x, like)))  # noqa: E731
    return whole(x), jax.jacfwd(whole)(x)


def elasticities(which: str | Observable, conditions: Reduced, coefficients: Coefficients) -> Elasticities:
    """Derivatives and elasticities of an observable by every condition and constant.

    Args:
        which: A key of `OBSERVABLES`, or a function of conditions and coefficients that gives one number.
        conditions: The shell and its load.
        coefficients: Constants of the short model.

    Raises:
        BadName: No such observable.
        BadValue: The observable is no number there, or a slope is none.

    Example:
        >>> from jshell import Reduced
        >>> from jshell.oscillator import SOURCE
        >>> from jshell.sensitivity import elasticities
        >>> found = elasticities("omega_plus", Reduced(0.08, 0.9, 1.2, 0.004), SOURCE)
        >>> print(f"{found.elasticity[found.inputs.index('alpha1')]:.2f}")
        -0.43
    """
    name, function = observable(which)
    x = point(conditions, coefficients)
    value, slopes = (np.asarray(part) for part in _value_and_slopes(function, x, coefficients))
    if value.shape != () or not np.isfinite(value) or not np.all(np.isfinite(slopes)):
        raise BadValue(
            name,
            found="no finite number with finite slopes at this point",
            expected="a shell where the observable exists (buckled, stable)",
            remedy="Raise the outer pressure, or choose another point.",
        )
    at = np.asarray(x)
    relative = slopes * at / value if value else np.full_like(slopes, np.nan)
    return Elasticities(name, float(value), INPUTS, at, slopes, relative)

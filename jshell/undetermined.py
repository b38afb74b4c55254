"""What an outcome leaves undetermined is NaN: the number, every lane of a batch, and the derivative.

Symbols    none
Valid for  any array of numbers, concrete or traced
Source     the promise of `Outcome`: anything but ok is not an answer
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


def undetermined(where: Bool[Array, "..."], numbers: Any) -> Any:
    """The numbers of any tree of arrays, NaN where they are undetermined.

    Args:
        where: Whether they are; its axes are the leading ones of every array.
        numbers: Arrays; integers and all that is not an array stay as they are.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.undetermined import undetermined
        >>> print(undetermined(jnp.array([False, True]), jnp.array([1.0, 2.0])))
        [ 1. nan]
    """

    def blank(array):
        if not eqx.is_inexact_array(array):
            return array
        # a product, not a choice: a choice has the derivative zero, which passes for an answer
        factor = jnp.where(where, jnp.nan, 1.0)
        return array * factor.reshape(factor.shape + (1,) * (array.ndim - factor.ndim))

    return jax.tree.map(blank, numbers)

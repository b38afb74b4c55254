"""The one place that asks optimistix for the root of a function of one number.

Newton's method from a start close by, differentiable by the implicit function
theorem. Optimistix takes long to load, and is loaded when it is first used.
"""

import importlib
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

TOLERANCE = 1e-13  # relative and absolute: rounding, for numbers around one
MOST_STEPS = 64


def root_of(excess: Callable[[jax.Array, Any], jax.Array], start: jax.Array, args: Any = None) -> jax.Array:
    """The root of `excess(x, args)` that Newton's method finds; NaN where it finds none."""
    with jax.ensure_compile_time_eval():  # what it makes while it loads is no part of the program at hand
        optimistix = importlib.import_module("optimistix")
    solver = optimistix.Newton(rtol=TOLERANCE, atol=TOLERANCE)
    found = optimistix.root_find(excess, solver, start, args, throw=False, max_steps=MOST_STEPS)
    return jnp.where(found.result == optimistix.RESULTS.successful, found.value, jnp.nan)

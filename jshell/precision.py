"""Double precision, asked for once.

JAX computes in float32 unless told otherwise, and a buckled shell does not
forgive that: its slow frequency is a small difference of large stiffnesses.
Importing jshell asks for float64, unless the user has decided through JAX's
own variable `JAX_ENABLE_X64`.
"""

import os

import jax


def ask_for_double() -> None:
    """Switch JAX to float64 unless `JAX_ENABLE_X64` is set."""
    if "JAX_ENABLE_X64" not in os.environ:
        jax.config.update("jax_enable_x64", True)

"""Double precision, asked for once.

JAX computes in float32 unless told otherwise, and a buckled shell does not
forgive that: its slow frequency is a small difference of large stiffnesses.
Importing jshell asks for float64, unless the user has decided through JAX's
own variable `JAX_ENABLE_X64`. Where JAX is not loaded yet that variable is
what asks, so that the first array is float64 whoever makes it, and importing
jshell need not load JAX.
"""

import os
import sys

VARIABLE = "JAX_ENABLE_X64"  # JAX reads it when it is imported


def ask_for_double() -> None:
    """Switch JAX to float64 unless `JAX_ENABLE_X64` is set."""
    if VARIABLE in os.environ:
        return
    if "jax" in sys.modules:
        sys.modules["jax"].config.update("jax_enable_x64", True)
    else:
        os.environ[VARIABLE] = "1"

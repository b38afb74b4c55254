"""XLA kept from warning of programs that this very machine has compiled.

It notes two wishes of its compiler (`prefer-no-gather`, `prefer-no-scatter`)
among the features of the processor, finds none that has them, and says of every
program out of a cache that it may crash here. Where the cache is ours alone, it
never does, and what else a log has to say is lost among these lines.

Source     XLA: cpu_aot_loader.cc; JAX: `jax_logging_level`
"""

import os

LOGGING = "jax_logging_level"
ENVIRONMENT = "TF_CPP_MIN_LOG_LEVEL"  # XLA's own way to be told; JAX sets 1 where nobody has
SILENT = "CRITICAL"


def quiet(chosen: str | None) -> str | None:
    """The level of JAX's log where programs come out of a cache of our own.

    Args:
        chosen: The user's, which stays.
    """
    undecided = chosen in (None, "", "NOTSET") and os.environ.get(ENVIRONMENT, "1") == "1"
    return SILENT if undecided else chosen

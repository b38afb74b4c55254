"""House rules of every test: float64, no silent rank promotion."""

import jax

import jshell  # noqa: F401  (asks for float64)

jax.config.update("jax_numpy_rank_promotion", "raise")

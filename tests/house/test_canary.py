"""A compiler that returns wrong numbers, silently, must not pass unseen.

jax 0.10.2 on CPU: jit of a batched product with a shared small matrix, then a
sum, is wrong above 16 384 rows (jax issue 39103).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

ROWS = 20_000


@pytest.mark.parametrize("width", [3, 5, 6, 7])
def test_compiled_product_with_a_shared_matrix_equals_the_eager_one(width):
    random = np.random.default_rng(width)
    batch = jnp.asarray(random.standard_normal((ROWS, width)))
    shared = jnp.asarray(random.standard_normal((width, width)))

    def total(batch, shared):
        return jnp.sum(jax.vmap(lambda row: shared @ row)(batch), axis=0)

    wanted = np.sum(np.asarray(batch) @ np.asarray(shared).T, axis=0)
    # rounding of a sum of 20 000 terms of size one, whose order is free: 1e-12
    np.testing.assert_allclose(jax.jit(total)(batch, shared), wanted, atol=1e-10)
    np.testing.assert_allclose(jax.jit(total)(batch, shared), total(batch, shared), atol=1e-10)

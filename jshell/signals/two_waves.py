"""Two damped waves of one rate, each with an amplitude and a phase of its own: what they explain of a record.

Amplitudes are eliminated; what is left to search are the turns and the rate. One channel of many records at once,
from its sums with the waves alone.

Symbols    b = (Re z-^t, Im z-^t, Re z+^t, Im z+^t, then t times these) basis of `wave_sums`   G its Gram matrix
           C amplitudes   Ω turn, σ rate, per sample
Source     Golub & Pereyra 1973; Kaufman 1975
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.signals.lanes import backward, barrier, cholesky, forward, listed, total


class Explained(NamedTuple):
    """What two waves explain of a channel, and how that follows log Ω-, log Ω+ and log σ.

    Attributes:
        power: (block,) of the data that they explain.
        gradient: (3, block) half of the gradient of `power`.
        normal: (3, 3, block) JᵀJ, amplitudes eliminated.
        amplitudes: (4, block) factors of the waves: cosine and sine of the slow one, then of the fast one.
    """

    power: Any
    gradient: Any
    normal: Any
    amplitudes: Any


def explained(
    turn: Float[Array, "2 block"], decay: Float[Array, " block"], d: jax.Array, G: jax.Array, always_true: jax.Array
) -> Explained:
    """What the waves explain.

    Args:
        turn, decay: Ω and σ, per sample.
        d: (8, block) of the data with the basis.
        G: (8, 8, block) of the basis with itself.
        always_true: True.
    """
    L = cholesky(listed(G[:4, :4]), always_true)
    half = forward(L, [d[i] for i in range(4)], always_true)
    C = backward(L, half, always_true)

    def tangents(C, turn, decay):
        zero = jnp.zeros_like(decay)
        slow, fast = [C[1] * turn[0], -C[0] * turn[0]], [C[3] * turn[1], -C[2] * turn[1]]
        return jnp.stack([*slow, zero, zero, zero, zero, *fast, *(-c * decay for c in C)]).reshape(3, 4, -1)

    X = barrier(tangents, always_true, C, turn, decay)

    def products(G, X):
        return total(X[:, j, None] * G[4 + j, 4:] for j in range(4)), total(
            X[:, j, None] * G[4 + j, :4] for j in range(4)
        )

    GX, mixed = barrier(products, always_true, G, X)
    U = forward(L, [mixed[:, j] for j in range(4)], always_true)

    def sums_of(X, GX, mixed, U, C):
        gradient = total(X[:, j] * d[4 + j] - mixed[:, j] * C[j] for j in range(4))
        straight = total(X[:, None, j] * GX[None, :, j] for j in range(4))
        return gradient, straight - total(U[j][:, None] * U[j][None, :] for j in range(4)), jnp.stack(C)

    gradient, normal, best = barrier(sums_of, always_true, X, GX, mixed, U, C)
    return Explained(total(x * x for x in half), gradient, normal, best)

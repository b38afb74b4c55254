"""Toroidal functions: what a ring whose strength varies as cos mφ makes of 1/distance.

    ∮ cos mφ / R dφ = 2 Q_{m-1/2}(χ) / √(r r'),   χ = 1 + t,  t = ρ₋²/(2 r r')

Near the ring t is tiny, so it is the argument. There the orders are climbed
from K and E; far from it the recurrence is stable downwards only, as a chain of
ratios.

Symbols    t = χ - 1 >= 0 [-]   Q_{m-1/2} Legendre function of the second kind
Accuracy   1e-13 relative up to m = 12, 1e-10 at m = 24, against 30-digit arithmetic
Source     DLMF 14.10.3, 14.10.5 and 14.19.2; Gil, Segura and Temme 2000 for the ratios
"""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.flow.elliptic import complete

UPWARDS = 0.045  # t up to which orders are climbed: errors grow as exp(2 m √(2 t))
CHAIN = 60  # ratios below the last order wanted; each gains exp(-0.6) and more where t > UPWARDS


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def toroidal(t: Float[Array, "..."], most: int) -> Float[Array, "orders ..."]:
    """Q_{m-1/2}(1 + t) for m = 0 … most.

    Args:
        t: χ - 1 > 0 [-].
        most: Highest order, at least 1.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.flow.toroidal import toroidal
        >>> print(toroidal(jnp.array(1.0), 2).round(6))
        [1.656638 0.224014 0.045159]
    """
    chi = 1 + t
    K, E = complete(t / (2 + t))
    k = jnp.sqrt(2 / (2 + t))
    zeroth = k * K

    # ratios q_m / q_{m-1} from far above, where they are near exp(-η), cosh η = χ
    ratio = 1 / (chi + jnp.sqrt(t * (2 + t)))
    start = most + CHAIN

    def down(k, ratio):
        m = start - k
        return (2 * m - 1) / (4 * m * chi - (2 * m + 1) * ratio)

    ratio = jax.lax.fori_loop(0, CHAIN, down, ratio)
    ratios = []
    for m in range(most, 0, -1):
        ratio = (2 * m - 1) / (4 * m * chi - (2 * m + 1) * ratio)
        ratios.append(ratio)
    far = [zeroth]
    for ratio in reversed(ratios):
        far.append(far[-1] * ratio)

    near = [zeroth, chi * zeroth - (2 + t) * k * E]
    for m in range(1, most):
        near.append((4 * m * chi * near[-1] - (2 * m - 1) * near[-2]) / (2 * m + 1))
    return jnp.where((t < UPWARDS)[None], jnp.stack(near), jnp.stack(far))


def downhill(t: Float[Array, "..."], values: Float[Array, "orders ..."]) -> Float[Array, "orders ..."]:
    """-t dQ_{m-1/2}/dt from the functions themselves; tends to 1/2 at the ring."""
    orders = jnp.arange(values.shape[0]).reshape(-1, *[1] * t.ndim)
    before = jnp.concatenate([values[1:2], values[:-1]])  # the order -1 is the order 1
    return -(orders - 0.5) * ((1 + t)[None] * values - before) / (2 + t)[None]


@toroidal.defjvp
def _derivatives(most, primals, tangents):
    (t,), (dt,) = primals, tangents
    values = toroidal(t, most)
    return values, -downhill(t, values) * (dt / t)[None]

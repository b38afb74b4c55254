"""Records side by side: small algebra written out for many of them at once, batch axis last.

A batched 4 × 4 solve by a library costs ten times the arithmetic it holds;
written out over a last axis of records it is vector instructions.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

BLOCK = 64  # records that go together: their data stay in the second-level cache
TOGETHER = 16  # blocks of one call
WIDE = 2**14  # on an accelerator, which wants thousands of records at once
WIDE_NUMBERS = 2**23  # and samples of one channel that go together there: a few GB with all that is made of them
VECTORS = {"xla_cpu_prefer_vector_width": 512}  # XLA takes half of what wide processors have unless it is told
SIXTH = 924.0  # variance of a sixth difference of white noise over the noise's own: (12 choose 6)


def lanes_for(records: int, length: int) -> int:
    """Records of a block: fewer where they are long; on an accelerator as many as its memory holds.

    Args:
        records: How many there are.
        length: Padded samples of each.
    """
    if jax.default_backend() == "cpu":
        return BLOCK if length <= 16384 else 8 if length <= 262144 else 1
    most = min(WIDE, max(1, WIDE_NUMBERS // length))
    return min(2 ** max(0, (records - 1).bit_length()), 2 ** (most.bit_length() - 1))


def blocks_for(lanes: int) -> int:
    """Blocks of one call: one where it holds a single long record, or all that an accelerator takes."""
    return TOGETHER if lanes > 1 and jax.default_backend() == "cpu" else 1


def side_by_side(values: Any, padded: int) -> Any:
    """(records, …, times) as (…, times, records), the times padded with zeros; turned over on an accelerator itself."""
    if jax.default_backend() != "cpu":
        turned = jnp.moveaxis(jnp.asarray(values), 0, -1)
        return jnp.pad(turned, [(0, 0)] * (turned.ndim - 2) + [(0, padded - turned.shape[-2]), (0, 0)])
    wide = np.empty((*values.shape[1:-1], padded, values.shape[0]))
    wide[..., : values.shape[-1], :] = np.moveaxis(values, 0, -1)
    wide[..., values.shape[-1] :, :] = 0.0
    return wide


def lanewise(compute: Callable) -> Callable:
    """Let arrays of lower rank stand for every row above the batch axis, which is last, while `compute` is traced."""

    @functools.wraps(compute)
    def allowed(*args):
        with jax.numpy_rank_promotion("allow"):
            return compute(*args)

    return allowed


def barrier(compute: Callable, always_true: Bool[Array, ""], *args) -> Any:
    """`compute(*args)`, its results written to memory before anybody reads them.

    Fused into its readers, a sine would be computed anew by each of them: an optimisation barrier does not keep
    XLA on CPUs from that, a branch does. `always_true` the compiler cannot know to be so. On an accelerator
    a branch would wait for the host, and the barrier does.
    """
    if jax.default_backend() != "cpu":
        return jax.lax.optimization_barrier(compute(*args))
    skip = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(compute, *args))
    return jax.lax.cond(always_true, compute, lambda *_: skip, *args)


def total(terms) -> Any:
    """Sum of a short list, written out: compiled into one pass."""
    terms = list(terms)
    result = terms[0]
    for term in terms[1:]:
        result = result + term
    return result


def centred(values: jax.Array, count: Float[Array, " block"]) -> tuple[jax.Array, jax.Array]:
    """Records without their means, 0 beyond their ends; and the means (channels, block).

    Args:
        values: (channels, times, block), anything beyond each record.
        count: Samples of each.
    """
    inside = jnp.arange(values.shape[1])[:, None] < count
    values = jnp.where(inside, values, 0.0)
    mean = jnp.sum(values, axis=1) / count
    return jnp.where(inside, values - mean[:, None], 0.0), mean


def spreads(y: jax.Array, count: Float[Array, " block"]) -> tuple[jax.Array, jax.Array]:
    """Mean square of records, and of their noise from sixth differences, which a smooth ring hardly has."""
    times = y.shape[1]
    sixth = total(c * y[:, k : times - 6 + k] for k, c in enumerate((1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0)))
    rough = jnp.where(jnp.arange(times - 6)[:, None] < count - 6, sixth * sixth, 0.0)
    share = SIXTH * jnp.maximum(count - 6, 1.0)
    return jnp.sum(y * y, axis=1) / count, jnp.sum(rough, axis=1) / share


def cholesky(A: list[list[jax.Array]], always_true: Bool[Array, ""]) -> list[list[jax.Array]]:
    """Lower factor, written out, its diagonal inverted; a pivot that is lost becomes tiny."""
    n = len(A)
    L = [[A[0][0]] * n for _ in range(n)]

    def column(j, A, L):
        lost = lambda i: total(L[i][k] * L[j][k] for k in range(j)) if j else 0.0  # noqa: E731
        # the diagonal is divided by here, once: forward and backward substitution then only multiply
        inverse = jax.lax.rsqrt(jnp.maximum(A[j][j] - lost(j), 1e-15 * A[j][j] + 1e-300))
        return [inverse, *((A[i][j] - lost(i)) * inverse for i in range(j + 1, n))]

    for j in range(n):
        found = barrier(lambda A, L, j=j: column(j, A, L), always_true, A, L)
        for i in range(j, n):
            L[i][j] = found[i - j]
    return L


def forward(L: list[list[jax.Array]], right: list[jax.Array], always_true: Bool[Array, ""]) -> list[jax.Array]:
    """L⁻¹ right."""

    def solve(L, right):
        found: list[jax.Array] = []
        for i in range(len(L)):
            found.append((right[i] - (total(L[i][k] * found[k] for k in range(i)) if i else 0.0)) * L[i][i])
        return found

    return barrier(solve, always_true, L, right)


def backward(L: list[list[jax.Array]], right: list[jax.Array], always_true: Bool[Array, ""]) -> list[jax.Array]:
    """L⁻ᵀ right."""
    n = len(L)

    def solve(L, right):
        found: list[jax.Array] = [right[0]] * n
        for i in reversed(range(n)):
            rest = right[i] - (total(L[k][i] * found[k] for k in range(i + 1, n)) if i < n - 1 else 0.0)
            found[i] = rest * L[i][i]
        return found

    return barrier(solve, always_true, L, right)


def listed(A: jax.Array) -> list[list[jax.Array]]:
    return [[A[i, j] for j in range(A.shape[1])] for i in range(A.shape[0])]

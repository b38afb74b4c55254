"""Many small motions at once: exact traces and their Jacobians, a batch in the last axis.

The exact step of the linear model is a 4 × 4 matrix per shell. Its entries
are arrays over the batch, so that a step of all shells is sixteen fused
multiplications; for one shell, powers by doubling.

Symbols    x = (ΔV, ΔS, ΔV̇, ΔṠ)   Φ = exp(A h) exact step
Valid for  as `linear`; evenly spaced samples
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.linear import matrices, uniform_propagator
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import RestState

TERMS = 14  # of the exponential's series at a norm of at most 1/2: 1e-17
HALVINGS = 4  # norms up to 8 before halving


class Moves(eqx.Module):
    """Motion of many shells about their rest: volume and area, samples first, shells last."""

    volume: Float[Array, "times shells"]
    area: Float[Array, "times shells"]


@eqx.filter_jit
def traces(
    conditions: Reduced,
    coefficients: Coefficients,
    state: RestState,
    initial: Float[Array, "4 shells"],
    step: Number,
    count: int,
) -> Moves:
    """Exact small motions of many shells.

    Args:
        conditions: Numbers of shape (shells,) or ().
        coefficients: The same.
        state: Rest states, the same.
        initial: (4, shells) ΔV, ΔS, ΔV̇, ΔṠ.
        step: Spacing of the samples; sqrt of the largest stiffness over mass times it must stay below 8.
        count: Number of samples, the first one the start.
    """
    system = _system(conditions, coefficients, state, initial.shape[1])
    factor = _exact_step(system, jnp.asarray(step, dtype=float))

    def advance(x: tuple[jax.Array, ...], _: None):
        new = tuple(sum(factor[i][j] * x[j] for j in range(4)) for i in range(4))
        return new, x[:2]

    first = tuple(initial)
    _, (volume, area) = jax.lax.scan(advance, first, None, length=count, unroll=4)
    return Moves(volume, area)


def _system(conditions: Reduced, coefficients: Coefficients, state: RestState, shells: int):
    """Rows of the first-order matrix, each entry an array over the shells, or 0."""
    fill = lambda leaf: jnp.broadcast_to(jnp.asarray(leaf, dtype=float), (shells,))  # noqa: E731
    given = jax.tree.map(fill, (conditions, coefficients, RestState(*state)))
    found = jax.vmap(lambda c, k, s: matrices(k, s, c), out_axes=-1)(*given)
    m = (found.mass[0, 0], found.mass[1, 1])
    zero, one = jnp.zeros(shells), jnp.ones(shells)
    rows = [[zero, zero, one, zero], [zero, zero, zero, one]]
    for i in range(2):
        rows.append([-found.stiffness[i, j] / m[i] for j in range(2)] + [-found.damping[i, j] / m[i] for j in range(2)])
    return rows


def _exact_step(system: list[list[jax.Array]], step: jax.Array) -> list[list[jax.Array]]:
    """exp(A h), entry by entry: series after halvings, then squarings."""
    A = jnp.stack([jnp.stack(row) for row in system]) * (step / 2**HALVINGS)
    product = lambda X, Y: jnp.sum(X[:, :, None] * Y[None], axis=1)  # noqa: E731
    unit = jnp.broadcast_to(jnp.eye(4)[:, :, None], A.shape)
    E = unit
    for k in range(TERMS, 0, -1):
        E = unit + product(A, E) / k
    for _ in range(HALVINGS):
        E = product(E, E)
    return [[E[i, j] for j in range(4)] for i in range(4)]


@eqx.filter_jit
def trace_jacobian(
    conditions: Reduced,
    coefficients: Coefficients,
    state: RestState,
    initial: Float[Array, "4"],
    step: Number,
    count: int,
) -> tuple[Float[Array, "times 2"], Float[Array, "times 2 8"]]:
    """One exact small motion, and its derivatives by α1, α2, k_VS, β1, ΔV, ΔS, ΔV̇, ΔṠ.

    The motion is linear in its start, so those four columns are the propagator itself.
    The second damping factor follows from the first unless it is given.
    """
    names = ("alpha1", "alpha2", "k_vs", "beta1")
    at = jnp.stack([jnp.asarray(getattr(coefficients, name), dtype=float) for name in names])

    def motion(u: Float[Array, "4"]) -> Float[Array, "times 2 4"]:
        c = Coefficients(u[0], u[1], u[2], u[3], coefficients.beta2, coefficients.dipole)
        return uniform_propagator(matrices(c, state, conditions), step, count)[:, :2]

    pushforward = lambda direction: jax.jvp(motion, (at,), (direction,))  # noqa: E731
    propagator, slopes = jax.vmap(pushforward, out_axes=(None, -1))(jnp.eye(4))
    by_constants = jnp.einsum("tijk,j->tik", slopes, initial)
    return propagator @ initial, jnp.concatenate([by_constants, propagator], axis=-1)

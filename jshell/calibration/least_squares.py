"""Nonlinear least squares: Levenberg–Marquardt with bounds, from many starts at once.

Made for few unknowns and exact Jacobians. A step that would leave the bounds
is cut at them; an unknown that rests on a bound and is pushed outwards waits.
Nothing is thrown: every start ends with an `Outcome`.

Symbols    u unknowns   r residual   J = ∂r/∂u   λ damping of the step
Source     Nielsen 1999, "Damping parameter in Marquardt's method", for λ
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jshell.errors import Outcome

RUNNING = -1


class Ending(eqx.Module):
    """Where starts ended: a leading axis per start.

    Attributes:
        unknowns: The last accepted unknowns.
        cost: Sum of squared residuals there.
        outcome: Integers of `Outcome`.
        steps: Steps tried.
    """

    unknowns: Float[Array, "*starts free"]
    cost: Float[Array, "*starts"]
    outcome: Int[Array, "*starts"]
    steps: Int[Array, "*starts"]


def value_and_jacobian(function: Callable, at: Float[Array, " free"]) -> tuple[jax.Array, jax.Array]:
    """A vector function and its Jacobian (values, free) in one forward sweep."""
    push = lambda direction: jax.jvp(function, (at,), (direction,))  # noqa: E731
    return jax.vmap(push, out_axes=(None, -1))(jnp.eye(at.size))


def levenberg_marquardt(
    residual: Callable[[jax.Array], jax.Array],
    start: Float[Array, " free"],
    low: Float[Array, " free"],
    high: Float[Array, " free"],
    *,
    max_steps: int = 100,
    xtol: float = 1e-10,
    ftol: float = 1e-14,
) -> Ending:
    """Minimise the sum of squared residuals from one start.

    Args:
        residual: Function of the unknowns.
        start: Where to begin, inside the bounds.
        low: Lower bounds, -inf where there is none.
        high: Upper bounds, inf where there is none.
        max_steps: Most steps tried.
        xtol: Converged when no unknown moves by more than this part of its size.
        ftol: Converged when a step promises less than this part of the cost.

    Returns:
        Outcome ok, at_bound, not_converged (out of steps) or stalled (no step helps).
    """

    def evaluate(u: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        r, J = value_and_jacobian(residual, u)
        cost = r @ r
        usable = jnp.isfinite(cost) & jnp.all(jnp.isfinite(J))
        return jnp.where(usable, cost, jnp.inf), J.T @ r, J.T @ J

    def step(state):
        u, cost, g, A, scale, damping, growth, count, _ = state
        scale = jnp.maximum(scale, jnp.diag(A))
        weight = jnp.where(scale > 0, scale, 1.0)
        held = ((u <= low) & (g > 0)) | ((u >= high) & (g < 0))

        H = jnp.where(held[:, None] | held[None, :], 0.0, A) + jnp.diag(jnp.where(held, 1.0, damping * weight))
        wanted = u - jnp.linalg.solve(H, jnp.where(held, 0.0, g))
        trial = jnp.clip(wanted, low, high)
        cut = jnp.any(trial != wanted)
        moved = trial - u
        promised = -(2 * g @ moved + moved @ A @ moved)

        new_cost, new_g, new_A = evaluate(trial)
        better = (new_cost < cost) & (promised > 0)
        gain = (cost - new_cost) / jnp.where(promised > 0, promised, jnp.inf)
        eased = damping * jnp.maximum(1 / 3, 1 - (2 * gain - 1) ** 3)

        # a step cut at a bound may promise nothing; shorter ones, nearer to the gradient, then do
        still = jnp.all(jnp.abs(moved) <= xtol * (0.1 + jnp.abs(u)))
        flat = promised <= ftol * cost
        status = jnp.where(
            (still | flat) & ~cut, int(Outcome.OK), jnp.where(damping > 1e16, int(Outcome.STALLED), RUNNING)
        )
        status = jnp.where(jnp.isfinite(cost), status, int(Outcome.STALLED))

        pick = lambda new, old: jnp.where(better, new, old)  # noqa: E731
        return (
            pick(trial, u),
            pick(new_cost, cost),
            pick(new_g, g),
            pick(new_A, A),
            scale,
            pick(jnp.maximum(eased, 1e-14), damping * growth),
            pick(2.0, 2 * growth),
            count + 1,
            status,
        )

    def running(state) -> jax.Array:
        return (state[-1] == RUNNING) & (state[-2] < max_steps)

    cost, g, A = evaluate(start)
    zero = jnp.asarray(0)
    first = (start, cost, g, A, jnp.zeros_like(start), jnp.asarray(1e-3), jnp.asarray(2.0), zero, zero + RUNNING)
    u, cost, *_, count, status = jax.lax.while_loop(running, step, first)

    status = jnp.where(status == RUNNING, int(Outcome.NOT_CONVERGED), status)
    on_bound = jnp.any((u <= low) | (u >= high))
    status = jnp.where((status == int(Outcome.OK)) & on_bound, int(Outcome.AT_BOUND), status)
    return Ending(u, cost, status, count)


@eqx.filter_jit
def from_many_starts(
    residual: Callable[[jax.Array, Any], jax.Array],
    args: Any,
    starts: Float[Array, "starts free"],
    low: Float[Array, " free"],
    high: Float[Array, " free"],
    *,
    max_steps: int = 100,
) -> Ending:
    """Minimise from every start; compiled once per shape.

    Args:
        residual: Module-level function of the unknowns and of `args`.
        args: Data, as a pytree.
        starts: One row per start.
        low: Lower bounds.
        high: Upper bounds.
        max_steps: Most steps tried from each start.
    """
    solve = lambda start: levenberg_marquardt(  # noqa: E731
        lambda u: residual(u, args), start, low, high, max_steps=max_steps
    )
    return jax.vmap(solve)(starts)


def best_of(ending: Ending, size: float) -> tuple[int, np.ndarray]:
    """The start that ended lowest, and which starts ended as low.

    Args:
        ending: From `from_many_starts`.
        size: Sum of squares of the data as the residual weighs them, to tell zero from rounding.
    """
    cost = np.asarray(ending.cost)
    outcome = np.asarray(ending.outcome)
    ended = (outcome == Outcome.OK) | (outcome == Outcome.AT_BOUND)
    ranked = np.where(np.isfinite(cost), cost, np.inf)
    best = int(np.argmin(np.where(ended, ranked, np.inf))) if ended.any() else int(np.argmin(ranked))
    same = ended & (ranked - ranked[best] <= 1e-7 * ranked[best] + 1e-16 * size)
    first = int(np.argmax(same)) if same.any() else best  # of equals the first, which comes from the data
    return first, same

"""Levenberg-Marquardt for many records side by side, batch axis last.

Seven steps for all, fewer where all have come to rest; the caller gathers what
still runs. Lanes do not see each other.

Source     Marquardt 1963; the projection of linear parameters is the caller's
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.signals.lanes import backward, cholesky, forward, listed, total

STEPS = 7  # for every trace; what is not done then is gathered and goes on together
FLAT = 1e-11  # the last step when it promises less than this part of the cost, 1e-4 standard errors,
EXACT = 1e-22  # or of the data, for records without noise

RUNNING, CONVERGED, STUCK = 0, 1, 2


class Evaluation(NamedTuple):
    """The problem at given unknowns.

    Attributes:
        cost: Weighted sum of squares.
        gradient: (unknowns, block) half of minus its gradient.
        normal: (unknowns, unknowns, block) JᵀJ, linear parameters eliminated.
        linear: (4, block) factors of the basis, in units of the mode shapes: cosine and sine of the slow mode,
            then of the fast one.
        sums: (8, block) of the basis over the record.
    """

    cost: Any
    gradient: Any
    normal: Any
    linear: Any
    sums: Any


class LMState(NamedTuple):
    """Where the search of every trace stands.

    Attributes:
        unknowns: (unknowns, block).
        evaluation: There.
        damping: Of the step.
        status: RUNNING, CONVERGED or STUCK.
        steps: Steps tried.
    """

    unknowns: Any
    evaluation: Evaluation
    damping: Any
    status: Any
    steps: Any


Evaluate = Callable[[jax.Array, Any], Evaluation]


def begin(unknowns: Float[Array, "unknowns block"], data, evaluate: Evaluate) -> LMState:
    """A search that has not moved yet."""
    first = evaluate(unknowns, data)
    zero = jnp.zeros(unknowns.shape[1], int)
    # where the model does not exist, as where two modes do not turn, there is no slope to go down
    status = jnp.where(jnp.isfinite(first.cost), RUNNING, STUCK)
    # starts are near, from the record's spectrum or an earlier fit: the first step is nearly that of Gauss and Newton
    return LMState(unknowns, first, jnp.full(unknowns.shape[1], 1e-4), status, zero)


def descend(
    search: LMState,
    data,
    low: Float[Array, "unknowns block"],
    high: Float[Array, "unknowns block"],
    evaluate: Evaluate,
) -> LMState:
    """`STEPS` further steps of every trace that still runs."""

    always_true = data.count[0] >= 0  # true, which the compiler cannot know, see `barrier`

    def step(_, search: LMState) -> LMState:
        u, at, damping = search.unknowns, search.evaluation, search.damping
        # an unknown at a bound that the gradient pushes outward waits, as does one that is fixed: its bounds are alike
        held = ((u <= low) & (at.gradient < 0)) | ((u >= high) & (at.gradient > 0))
        g = [jnp.where(held[i], 0.0, at.gradient[i]) for i in range(u.shape[0])]
        A = listed(at.normal)
        # what waits has a row and a column of the unit matrix and moves by nothing: all lanes solve one size of system
        H = [[jnp.where(held[i] | held[j], 0.0, A[i][j]) for j in range(u.shape[0])] for i in range(u.shape[0])]
        for i in range(u.shape[0]):
            # Marquardt's scaling: damping is a part of the diagonal, and the unknowns' units do not matter
            H[i][i] = jnp.where(held[i], 1.0, A[i][i] * (1 + damping) + 1e-300)
        L = cholesky(H, always_true)
        full = jnp.stack(backward(L, forward(L, g, always_true), always_true))
        # at most 0.7 in any unknown: most are logarithms, of which it is a factor of two, beyond any linear model
        shrink = jnp.minimum(1.0, 0.7 / jnp.maximum(jnp.max(jnp.abs(full), axis=0), 1e-300))
        wanted = u + shrink * full
        trial = jnp.clip(wanted, low, high)
        # a step that was cut is short for another reason than rest
        cut = jnp.any(trial != wanted, axis=0) | (shrink < 1)
        moved = [trial[i] - u[i] for i in range(u.shape[0])]
        # by how much the quadratic model without damping lowers the cost, over the step as it was cut
        promised = 2 * total(g_ * m for g_, m in zip(g, moved, strict=True)) - total(
            A[i][j] * moved[i] * moved[j] for i in range(u.shape[0]) for j in range(u.shape[0])
        )
        flat = promised <= FLAT * jnp.maximum(at.cost, 0.0) + EXACT * data.power
        new = evaluate(trial, data)
        slack = 1e-14 * data.power  # rounding of the cost
        better = (new.cost <= at.cost + slack) & jnp.isfinite(new.cost)
        gain = (at.cost - new.cost) / jnp.maximum(promised, 1e-300)
        running = search.status == RUNNING
        take = running & better
        pick = lambda new, old: jnp.where(take, new, old)  # noqa: E731
        # a step that keeps half its promise leaves a twentieth of the damping, any other that is taken leaves half;
        # one that is refused is tried again ten times as damped, with at least 1e-3: less would not change it
        damping = jnp.where(
            better, jnp.where(gain > 0.5, damping * 0.05, damping * 0.5), jnp.maximum(damping * 10, 1e-3)
        )
        # at rest where little is promised, unless even that, when more than rounding, is not kept: then with damping
        done = flat & ~cut
        status = jnp.where(done & (better | (promised <= slack)), CONVERGED, jnp.where(damping > 1e12, STUCK, RUNNING))
        # a lane at rest stays as it is to the bit, however long the others of its block go on
        return LMState(
            pick(trial, u),
            jax.tree.map(pick, new, at),
            jnp.where(running, jnp.clip(damping, 1e-12, 1e15), search.damping),
            jnp.where(running, status, search.status),
            search.steps + running,
        )

    def going(state) -> jax.Array:
        return (state[0] < STEPS) & jnp.any(state[1].status == RUNNING)

    return jax.lax.while_loop(going, lambda state: (state[0] + 1, step(*state)), (jnp.asarray(0), search))[1]

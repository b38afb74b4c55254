"""Fixed steps: the classical fourth-order rule over a whole batch at once.

The batch is the last axis of every array and each step is a handful of fused
loops over it; nothing waits for a slow lane. A lane whose motion ends (the
shell flattens, empties or unbuckles) stands still from then on.

Symbols    t time   h step
Valid for  steps that resolve the motion: ω₊ h of 0.1 leaves 1e-6 a period
Source     Kutta 1901
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jshell.errors import Outcome
from jshell.oscillator.motion import Driven, OscillatorState

# How a motion can end, in the order of `Driven.margins`.
ENDINGS = (Outcome.OUT_OF_RANGE, Outcome.CONTACT, Outcome.NO_BUCKLED_STATE, Outcome.NOT_CONVERGED)
DIVERGED = len(ENDINGS)  # index of a motion that left all numbers


class March(NamedTuple):
    """A run in fixed steps.

    Attributes:
        motion: Samples on a leading axis, the first one the start.
        ended: Time at which each lane ended, infinite where it did not.
        ending: Which margin it crossed, an index into `ENDINGS`; -1 where none.
    """

    motion: OscillatorState
    ended: jax.Array
    ending: jax.Array


def rk4(rate: Any, t: Any, y: Any, h: Any) -> Any:
    """One step of the classical rule for any tree of arrays."""
    moved = lambda k, part: jax.tree.map(lambda y, k: y + part * h * k, y, k)  # noqa: E731
    k1 = rate(t, y)
    k2 = rate(t + h / 2, moved(k1, 0.5))
    k3 = rate(t + h / 2, moved(k2, 0.5))
    k4 = rate(t + h, moved(k3, 1.0))
    return jax.tree.map(lambda y, a, b, c, d: y + h / 6 * (a + 2 * (b + c) + d), y, k1, k2, k3, k4)


def march(
    driven: Driven, start: OscillatorState, t0: Any, step: Any, samples: int, substeps: int, unbuckled: Any
) -> March:
    """Integrate in even steps, a sample every `substeps`.

    Args:
        driven: The equation; its numbers may carry a batch in their last axis.
        start: State at `t0`, every array of the batch's shape.
        t0: First time.
        step: Length of a step.
        samples: Number of samples after the first.
        substeps: Steps between samples.
        unbuckled: Volume at which the dimple is gone.
    """

    def advance(carry, k):
        y, ended, ending = carry
        t = t0 + step * k
        new = rk4(driven.rate, t, y, step)
        margins = jnp.stack(driven.margins(new, unbuckled))
        sound = jnp.all(jnp.stack([jnp.isfinite(leaf) for leaf in jax.tree.leaves(new)]), axis=0)
        crossed = ~sound | jnp.any(margins <= 0, axis=0)
        which = jnp.where(sound, jnp.argmax(margins <= 0, axis=0), DIVERGED)
        alive = ending < 0
        kept = alive & ~crossed
        y = jax.tree.map(lambda new, old: jnp.where(kept, new, old), new, y)
        ended = jnp.where(alive & crossed, t + step, ended)
        return (y, ended, jnp.where(alive & crossed, which, ending)), None

    def sample(carry, number):
        carry, _ = jax.lax.scan(advance, carry, number * substeps + jnp.arange(substeps))
        return carry, carry[0]

    like = jnp.zeros_like(start.V)
    first = (start, like + jnp.inf, jnp.zeros(like.shape, int) - 1)
    (_, ended, ending), rest = jax.lax.scan(sample, first, jnp.arange(samples))
    motion = jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), start, rest)
    return March(motion, ended, ending)

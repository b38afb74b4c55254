"""A simulated run and its change with every number of the shell, in pieces of one compiled length.

The run is that of `jshell.dynamics`, from the stress-free sphere under an outer pressure that is given step by step.
Its derivatives go forward with it: one primal step serves all directions, and runs of any length share one program.

Symbols    t̂ time [time unit]   D directions
Valid for  nodes that stay; axial symmetry
Source     `jshell.dynamics.run`; the derivative of a step in `jshell.dynamics.motion`
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.contour import thinned, with_pad
from jshell.dynamics import Losses
from jshell.dynamics.motion import Loads
from jshell.dynamics.run import CHANNELS, RADIUS, Pace, Schedule, Setup, begin, go_on
from jshell.errors import Outcome
from jshell.inversion.response import (
    PAD_FIELD,
    QUICKLY,
    RETARDATION_FIELD,
    SPOT_FIELD,
    SPOT_WIDTH,
    conditions_of,
    loss_of,
    mesh,
)

EVERY = 0.1  # [time unit] between samples: a cubic through them errs by 1e-4 of a swing at ω = 4
PIECE = 40  # samples that one call takes
SPARE = 8  # samples beyond the record's end: where a cubic ends it errs
DIRECTIONS = 4

Report = Callable[[float], None]


class RunSamples(NamedTuple):
    """Samples of a run at t̂ = 0, EVERY, …: channels (samples, channels), their changes (D, samples, channels)."""

    channels: np.ndarray
    changes: np.ndarray
    outcome: Outcome


class OuterPressure(NamedTuple):
    """The outer pressure of a run at any t̂, and its change along each direction (D, …)."""

    value: Callable[[np.ndarray], np.ndarray]
    change: Callable[[np.ndarray], np.ndarray]


def moments(count: int, inner: int) -> np.ndarray:
    """(count, inner, 3) when a step begins, where its stage lies, when it ends."""
    h = EVERY / inner
    begun = EVERY * np.arange(count)[:, None] + h * np.arange(inner)
    return np.stack([begun, begun + h / (1 + RADIUS), begun + h], axis=-1)


def steps_per_sample(step: float) -> int:
    """Steps between two samples, none longer than `step`."""
    return int(np.ceil(EVERY / step - 1e-9))


def run(
    numbers: np.ndarray, tangents: np.ndarray, load: OuterPressure, length: float, elements: int, inner: int,
    report: Report | None = None,
) -> RunSamples:  # fmt: skip
    """A run from the stress-free sphere, and its changes.

    Args:
        numbers: (fields,) the simulator's.
        tangents: (D, fields) directions.
        load: The outer pressure.
        length: Of the run [time unit]; it is run a little farther.
        elements, inner: Of the meridian; steps between two samples.
        report: Called with the share that is done, now and then.
    """
    count = PIECE * int(np.ceil((np.ceil(length / EVERY) + SPARE) / PIECE))
    first, advance = programs(elements, bool(numbers[PAD_FIELD] > 0), inner, bool(numbers[RETARDATION_FIELD] > 0))
    fields, directions = jnp.asarray(numbers), jnp.asarray(tangents)
    at_start = np.zeros(1)
    state, rest, sample = first(fields, directions, load.value(at_start)[0], load.change(at_start)[:, 0])
    values, changes = [np.asarray(sample[0])[None]], [np.asarray(sample[1])[:, None]]
    for done in range(0, count, PIECE):
        when = moments(count, inner)[done : done + PIECE]
        state, rest, sample = advance(
            fields, directions, state, rest, load.value(when), load.change(when), jnp.asarray(done)
        )
        values.append(np.asarray(sample[0]))
        changes.append(np.asarray(sample[1]))
        if report is not None:
            report((done + PIECE) / count)
        outcome = Outcome(int(rest.outcome))
        if outcome != Outcome.OK:
            break
    return RunSamples(np.concatenate(values), np.concatenate(changes, axis=1), outcome)


@lru_cache(maxsize=8)
def programs(elements: int, held: bool, inner: int, lossy: bool) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compiled: how a run begins, and a piece of it, each with its changes along directions."""
    base, pace = mesh(elements, held), Pace(EVERY, inner, False, False)

    def setup(numbers) -> Setup:
        shape = with_pad(base, numbers[PAD_FIELD]) if held else base
        profile = thinned(shape, numbers[SPOT_FIELD], jnp.asarray(SPOT_WIDTH))
        losses = Losses(wall=loss_of(numbers, lossy))
        return Setup(shape, profile, None, conditions_of(numbers), losses, jnp.asarray(0.0), "current")

    def start(numbers, pressure):
        made = setup(numbers)
        progress, sample = begin(made, made.shape.sphere, jnp.zeros_like(made.shape.sphere), pressure)
        moving, rest = eqx.partition(progress, eqx.is_inexact_array)
        return (moving, sample), rest

    def piece(numbers, moving, loads, rest, number):
        made = setup(numbers)
        after, yes = loads[:, -1, 2], jnp.ones(PIECE, bool)
        ahead = Schedule(Loads(loads[..., 0], loads[..., 1], loads[..., 2]), after, ~yes, yes)
        progress, samples = go_on(made, eqx.combine(moving, rest), ahead, number, pace)
        moving, rest = eqx.partition(progress, eqx.is_inexact_array)
        return (moving, samples.channels), rest

    def first(numbers, tangents, pressure, change):
        def pushforward(direction, dp):
            return jax.jvp(start, (numbers, pressure), (direction, dp), has_aux=True)

        (moving, sample), (dmoving, dsample), rest = jax.vmap(pushforward, out_axes=(None, 0, None))(tangents, change)
        return (moving, dmoving), rest, (sample, dsample)

    def advance(numbers, tangents, state, rest, loads, change, number):
        moving, dmoving = state
        at = lambda n, m, p: piece(n, m, p, rest, number)  # noqa: E731

        def pushforward(direction, dm, dp):
            return jax.jvp(at, (numbers, moving, loads), (direction, dm, dp), has_aux=True)

        (moving, sample), (dmoving, dsample), rest = jax.vmap(pushforward, out_axes=(None, 0, None))(
            tangents, dmoving, change
        )
        return (moving, dmoving), rest, (sample, dsample)

    return jax.jit(first, compiler_options=QUICKLY), jax.jit(advance, compiler_options=QUICKLY)


PLACES = {name: k for k, name in enumerate(CHANNELS)}

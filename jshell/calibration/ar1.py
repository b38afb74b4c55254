"""A fit with autocorrelated (AR(1)) noise: from the minimum of white noise to that of the noise it has.

Symbols    J Jacobian of constants and linear parameters together   r weighted residual   φ memory of the noise
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jshell.calibration.linearization import Linearization, linearized, whitened
from jshell.calibration.misfit import rows_of
from jshell.calibration.noise import Noise, ar1_memory, examine, steps_between
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem

MOST_STEPS = 30  # of Gauss and Newton, from the white minimum to that of autocorrelated noise


def examined(problem: Problem, found: Linearization) -> list[Noise]:
    """What is left of every channel of every trace."""
    noises = []
    for number, channel, rows in rows_of(problem):
        one = problem.model.records[number]
        name = f"{one.channels[channel]} [{number + 1}]"
        weight, times = np.asarray(one.weight[channel]), np.asarray(one.elapsed)
        noises.append(examine(name, found.residual[rows], found.jacobian[rows], times, weight))
    return noises


def with_memory(problem: Problem, noises: Sequence[Noise]) -> Problem:
    """The problem with the memory of its noise, of every channel of every trace."""
    rows = rows_of(problem)
    memory = []
    for (number, channel, _), noise in zip(rows, noises, strict=True):
        one = problem.model.records[number]
        steps = steps_between(np.asarray(one.elapsed), np.asarray(one.weight[channel]) > 0)
        memory.append(ar1_memory(noise.memory, steps) * (np.arange(steps.size) > 0))
    grouped = [
        np.stack([m for (number, *_), m in zip(rows, memory, strict=True) if number == i])
        for i in range(len(problem.model.records))
    ]
    return eqx.tree_at(lambda j: j.memory, problem, tuple(grouped), is_leaf=lambda x: x is None)


def fit_ar1(
    problem: Problem, found: Linearization, noises: list[Noise], parameters: Unknowns, *, free_to_move: bool
) -> tuple[Problem, Linearization]:
    """The problem with the memory of its noise, and its minimum by Gauss and Newton from the white one."""
    problem = with_memory(problem, noises)
    if not free_to_move:
        return problem, found

    free = [parameters.names.index(name) for name in parameters.free]
    now, lowest = found, power(whitened(problem, found)[0])
    for _ in range(MOST_STEPS):
        r, J = whitened(problem, now)
        if not (np.all(np.isfinite(r)) and np.all(np.isfinite(J))):
            return problem, found  # it ran away: the white minimum stays, with the errors of autocorrelated noise
        length = np.linalg.norm(J, axis=0)
        length = np.where(length > 0, length, 1.0)
        move = -np.linalg.lstsq(J / length, r, rcond=1e-9)[0] / length
        values = now.values.copy()
        values[free] += move[: len(free)]
        values = np.asarray(parameters.complete(jnp.asarray(values)))
        unconstrained = parameters.unconstrained(values[None])[0]
        inside = np.all((unconstrained > parameters.low) & (unconstrained < parameters.high))
        inside &= all(values[i] > 0 for i in free if parameters.names[i] in parameters.positive)
        if not (np.all(np.isfinite(values)) and inside):
            return problem, found
        sizes = np.cumsum([c.size for c in now.linear])[:-1]
        linear = [c + m for c, m in zip(now.linear, np.split(move[len(free) :], sizes), strict=True)]
        now = linearized(values, problem, parameters, linear)
        if np.linalg.norm(move * length) < 1e-9 * np.sqrt(max(lowest, 1e-300)):
            break
    better = power(whitened(problem, now)[0]) <= lowest  # False for NaN
    return problem, now if better else found


def power(r: np.ndarray) -> float:
    """Sum of squares."""
    return float(r @ r)

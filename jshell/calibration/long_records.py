"""Fits of records too long to be held with all their derivatives: rows are taken block by block.

A first pass sums the Gram matrix of the basis and so finds the linear
parameters; a second one carries a small triangle from block to block, the QR
factor of basis, Jacobian and residual together. Its last rows are those of the
Jacobian and the residual at right angles to the basis: all that a step needs.
Every row counts; memory does not grow with their number.

Symbols    Φ basis   c linear parameters   J = ∂Φ/∂p c   r = Φ c - data   T triangle
Source     Golub & Pereyra 1973, in Kaufman's 1975 form, whose gradient is exact; Demmel et al. 2012 for QR by blocks
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.least_squares import Ending, from_many_starts, value_and_jacobian
from jshell.calibration.losses import Problem, bases, gram_inverse, residual, targets
from jshell.calibration.parameters import Unknowns
from jshell.calibration.records import Record
from jshell.errors import Outcome

LONG = 50_000  # samples of one record from which it is taken by blocks
BLOCK = 4096
THINNED = 10_000  # samples with which the starts are sorted out beforehand
SAME = 1e-6  # starts that end as near as this have met


def is_long(problem: Problem) -> bool:
    """Whether a record is taken by blocks."""
    return problem.solver == "exact" and any(one.data.size >= LONG for one in problem.records)


def fit_long(space: Unknowns, problem: Problem, starts: np.ndarray) -> Ending:
    """Minimise from every start: first over evenly chosen samples, then from where that ends over all of them."""
    low, high = jnp.asarray(space.low), jnp.asarray(space.high)
    few = dataclasses.replace(problem, records=tuple(_thinned(one) for one in problem.records))
    first = from_many_starts(residual, (space, few), jnp.asarray(starts), low, high)
    ended = np.isin(np.asarray(first.outcome), (int(Outcome.OK), int(Outcome.AT_BOUND)))[:, None]
    begin = np.where(ended, np.asarray(first.unknowns), starts)
    alike = np.all(np.abs(begin[:, None] - begin[None]) <= SAME * (1 + np.abs(begin)), axis=2)
    leader = np.argmax(alike, axis=1)  # starts that met already go on as one
    kept = np.unique(leader)
    last = from_many_starts(condensed, (space, problem), jnp.asarray(begin[kept]), low, high, condensed=True)
    which = np.searchsorted(kept, leader)
    return Ending(
        last.unknowns[which],
        last.cost[which],
        last.outcome[which],
        first.steps + last.steps[which],
    )


def _thinned(record: Record) -> Record:
    every = max(1, record.elapsed.size // THINNED)
    elapsed, data, weight = record.elapsed[::every], record.data[:, ::every], record.weight[:, ::every]
    return dataclasses.replace(record, elapsed=elapsed, data=data, weight=weight)


def own_constants(natural: jax.Array, number: int, problem: Problem) -> jax.Array:
    """The constants of one record among all, in its model's order."""
    return natural if problem.loss == "strict" else natural[np.array([0, 1, 2, 3 + number])]


def condensed(u: Float[Array, " free"], args: tuple[Unknowns, Problem]) -> Float[Array, "rows free+1"]:
    """A few rows of Jacobian and residual with the same QR factor as those of all data."""
    space, problem = args
    found = []
    for number, record in enumerate(problem.records):
        one = dataclasses.replace(problem, records=(record,))
        constants, slopes = value_and_jacobian(lambda u, n=number: own_constants(space.natural(u), n, problem), u)
        for triangle in _triangles(constants, one):
            found.append(jnp.concatenate([triangle[:, :-1] @ slopes, triangle[:, -1:]], axis=1))
    return jnp.concatenate(found)


def _rows(record: Record) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Times, data and weights by blocks; the last is filled up with samples that do not count."""
    elapsed, count = jnp.asarray(record.elapsed), record.elapsed.size
    blocks = -(-count // BLOCK)
    spare = blocks * BLOCK - count
    step = elapsed[-1] / (count - 1)
    elapsed = jnp.concatenate([elapsed, elapsed[-1] + step * jnp.arange(1, spare + 1)])
    cut = lambda x: jnp.moveaxis(jnp.pad(x, ((0, 0), (0, spare))).reshape(-1, blocks, BLOCK), 1, 0)  # noqa: E731
    return elapsed.reshape(blocks, BLOCK), cut(jnp.asarray(record.data)), cut(jnp.asarray(record.weight))


def _block(rows: tuple[jax.Array, jax.Array, jax.Array], problem: Problem) -> Problem:
    """The problem of one block."""
    elapsed, data, weight = rows
    part = dataclasses.replace(problem.records[0], elapsed=elapsed, data=data, weight=weight)
    return dataclasses.replace(problem, records=(part,))


def best_of_blocks(constants: jax.Array, problem: Problem) -> list[jax.Array]:
    """The best linear parameters of a one-record problem, one array per channel or, of the strict loss, one."""

    def add(sums, rows):
        part = _block(rows, problem)
        new = []
        for (gram, moment), basis, data in zip(sums, bases(constants, part, late=True), targets(part), strict=True):
            new.append((gram + basis.T @ basis, moment + basis.T @ data))
        return new, None

    size, count = (6, 1) if problem.loss == "strict" else (5, len(problem.records[0].channels))
    nothing = [(jnp.zeros((size, size)), jnp.zeros(size))] * count
    sums, _ = jax.lax.scan(add, nothing, _rows(problem.records[0]))
    found = []
    for gram, moment in sums:
        length = jnp.sqrt(jnp.diag(gram))
        length = jnp.where(length > 0, length, 1.0)
        unit = gram / jnp.outer(length, length)
        inverse = gram_inverse(unit)
        c = inverse @ (moment / length)
        found.append((c + inverse @ (moment / length - unit @ c)) / length)
    return found


def _triangles(constants: jax.Array, problem: Problem) -> list[jax.Array]:
    """Per block of linear parameters, the triangle of Jacobian and residual at right angles to the basis."""
    linear = best_of_blocks(constants, problem)

    def add(triangles, rows):
        part = _block(rows, problem)
        plain, (fitted, slopes) = _look(constants, linear, part)
        new = []
        for T, basis, curve, slope, data in zip(triangles, plain, fitted, slopes, targets(part), strict=True):
            stacked = jnp.concatenate([basis, slope, (curve - data)[:, None]], axis=1)
            new.append(jnp.linalg.qr(jnp.concatenate([T, stacked]), mode="r"))
        return new, None

    sizes = [c.size for c in linear]
    nothing = [jnp.zeros((size + constants.size + 1,) * 2) for size in sizes]
    triangles, _ = jax.lax.scan(add, nothing, _rows(problem.records[0]))
    return [T[size:, size:] for T, size in zip(triangles, sizes, strict=True)]


def _look(constants: jax.Array, linear: list[jax.Array], part: Problem):
    """Bases of a block; the fitted curves and their derivatives by the constants."""
    plain = bases(constants, part, late=True)
    curves = lambda p: [basis @ c for basis, c in zip(bases(p, part, late=True), linear, strict=True)]  # noqa: E731
    return plain, value_and_jacobian(curves, constants)


@eqx.filter_jit
def look_at_all(constants: np.ndarray | jax.Array, problem: Problem, linear: list | None = None):
    """Linear parameters, the best unless given; residual, derivative by the constants, bases of a one-record problem.

    As `solved` wants them: all rows, in the order channel by channel, but worked out block by block.
    """
    p = jnp.asarray(constants)
    linear, record = best_of_blocks(p, problem) if linear is None else linear, problem.records[0]

    def one(rows):
        part = _block(rows, problem)
        plain, (curves, slopes) = _look(p, linear, part)
        left = [curve - data for curve, data in zip(curves, targets(part), strict=True)]
        return left, slopes, plain

    left, slopes, plain = jax.lax.map(one, _rows(record))
    channels = len(record.channels) if problem.loss == "strict" else 1

    def in_order(x: jax.Array) -> jax.Array:
        rows = jnp.moveaxis(x.reshape(x.shape[0], channels, BLOCK, *x.shape[2:]), 1, 0)
        rows = rows.reshape(channels, -1, *x.shape[2:])[:, : record.elapsed.size]
        return rows.reshape(-1, *x.shape[2:])

    return (
        linear,
        jnp.concatenate([in_order(x) for x in left]),
        jnp.concatenate([in_order(x) for x in slopes]),
        [in_order(x) for x in plain],
    )

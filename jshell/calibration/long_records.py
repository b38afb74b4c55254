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

from jshell.calibration.least_squares import SolverResult, from_many_starts, value_and_jacobian
from jshell.calibration.lengths import lengthened
from jshell.calibration.losses import TraceModel, bases, gram_inverse, targets
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem, Term, residual
from jshell.calibration.records import Record
from jshell.errors import Outcome

LONG = 50_000  # samples of one record from which it is taken by blocks
BLOCK = 4096
THINNED = 10_000  # samples with which the starts are sorted out beforehand
SAME = 1e-6  # starts that end as near as this have met


def is_long(model: TraceModel) -> bool:
    """Whether a record is taken by blocks."""
    return model.solver == "exact" and any(one.data.size >= LONG for one in model.records)


def minimise(parameters: Unknowns, problem: Problem, starts: np.ndarray) -> SolverResult:
    """Minimise from every start: by blocks where a record is long, else by a program that many lengths share."""
    if is_long(problem.model):
        return _fit_long(parameters, problem, starts)
    long = eqx.tree_at(lambda j: j.model, problem, lengthened(problem.model))
    ends = jnp.asarray(parameters.low, dtype=float), jnp.asarray(parameters.high, dtype=float)
    return from_many_starts(residual, (parameters, long), jnp.asarray(starts, dtype=float), *ends)


def _fit_long(parameters: Unknowns, problem: Problem, starts: np.ndarray) -> SolverResult:
    """First over evenly chosen samples, then from where that ends over all of them."""
    low, high = jnp.asarray(parameters.low), jnp.asarray(parameters.high)
    thin = tuple(_thinned(one) for one in problem.model.records)
    few = eqx.tree_at(lambda j: j.model.records, problem, thin)
    first = from_many_starts(residual, (parameters, few), jnp.asarray(starts), low, high)
    ended = np.isin(np.asarray(first.outcome), (int(Outcome.OK), int(Outcome.AT_BOUND)))[:, None]
    begin = np.where(ended, np.asarray(first.unknowns), starts)
    alike = np.all(np.abs(begin[:, None] - begin[None]) <= SAME * (1 + np.abs(begin)), axis=2)
    leader = np.argmax(alike, axis=1)  # starts that met already go on as one
    kept = np.unique(leader)
    last = from_many_starts(condensed, (parameters, problem), jnp.asarray(begin[kept]), low, high, condensed=True)
    which = np.searchsorted(kept, leader)
    return SolverResult(
        last.unknowns[which],
        last.cost[which],
        last.outcome[which],
        first.steps + last.steps[which],
    )


def _thinned(record: Record) -> Record:
    every = max(1, record.elapsed.size // THINNED)
    elapsed, data, weight = record.elapsed[::every], record.data[:, ::every], record.weight[:, ::every]
    return dataclasses.replace(record, elapsed=elapsed, data=data, weight=weight)


def condensed(u: Float[Array, " free"], args: tuple[Unknowns, Problem]) -> Float[Array, "rows free+1"]:
    """A few rows of Jacobian and residual with the same QR factor as those of all data, priors included."""
    parameters, problem = args
    found = []
    for number in range(len(problem.model.records)):
        own, slopes = value_and_jacobian(lambda u, at=problem.own(number): parameters.constrained(u)[at], u)
        for triangle in _triangles(own, problem.alone(number)):
            found.append(jnp.concatenate([triangle[:, :-1] @ slopes, triangle[:, -1:]], axis=1))
    if problem.prior_at:
        r, J = value_and_jacobian(lambda u: problem.prior_residual(parameters.constrained(u)), u)
        found.append(jnp.concatenate([J, r[:, None]], axis=1))
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


def _block(rows: tuple[jax.Array, jax.Array, jax.Array], own: jax.Array, lone: Problem) -> Term:
    """The problem of one block."""
    elapsed, data, weight = rows
    part = dataclasses.replace(lone.model.records[0], elapsed=elapsed, data=data, weight=weight)
    return eqx.tree_at(lambda j: j.model.records, lone, (part,)).terms(own)[0]


def best_of_blocks(own: jax.Array, lone: Problem) -> list[jax.Array]:
    """The best linear parameters of one trace, one array per channel or, of the strict loss, one."""

    def add(sums, rows):
        constants, part = _block(rows, own, lone)
        new = []
        for (gram, moment), basis, data in zip(sums, bases(constants, part, late=True), targets(part), strict=True):
            new.append((gram + basis.T @ basis, moment + basis.T @ data))
        return new, None

    record = lone.model.records[0]
    size, count = (6, 1) if lone.model.loss == "strict" else (5, len(record.channels))
    nothing = [(jnp.zeros((size, size)), jnp.zeros(size))] * count
    sums, _ = jax.lax.scan(add, nothing, _rows(record))
    found = []
    for gram, moment in sums:
        length = jnp.sqrt(jnp.diag(gram))
        length = jnp.where(length > 0, length, 1.0)
        unit = gram / jnp.outer(length, length)
        inverse = gram_inverse(unit)
        c = inverse @ (moment / length)
        found.append((c + inverse @ (moment / length - unit @ c)) / length)
    return found


def _triangles(own: jax.Array, lone: Problem) -> list[jax.Array]:
    """Per block of linear parameters, the triangle of Jacobian and residual at right angles to the basis."""
    linear = best_of_blocks(own, lone)

    def add(triangles, rows):
        plain, (fitted, slopes), target = _evaluate(own, linear, rows, lone)
        new = []
        for T, basis, curve, slope, data in zip(triangles, plain, fitted, slopes, target, strict=True):
            stacked = jnp.concatenate([basis, slope, (curve - data)[:, None]], axis=1)
            new.append(jnp.linalg.qr(jnp.concatenate([T, stacked]), mode="r"))
        return new, None

    sizes = [c.size for c in linear]
    nothing = [jnp.zeros((size + own.size + 1,) * 2) for size in sizes]
    triangles, _ = jax.lax.scan(add, nothing, _rows(lone.model.records[0]))
    return [T[size:, size:] for T, size in zip(triangles, sizes, strict=True)]


def _evaluate(own: jax.Array, linear: list[jax.Array], rows: tuple[jax.Array, jax.Array, jax.Array], lone: Problem):
    """Bases of a block; the fitted curves and their derivatives by the trace's parameters; the data."""

    def both(p: jax.Array) -> list[jax.Array]:
        constants, part = _block(rows, p, lone)
        return bases(constants, part, late=True)

    curves = lambda p: [basis @ c for basis, c in zip(both(p), linear, strict=True)]  # noqa: E731
    return both(own), value_and_jacobian(curves, own), targets(_block(rows, own, lone).model)


@eqx.filter_jit
def look_at_all(own: np.ndarray | jax.Array, lone: Problem, linear: list | None = None):
    """Linear parameters, the best unless given; residual, derivative by the parameters, bases of one trace.

    As `linearized` wants them: all rows, in the order channel by channel, but worked out block by block.

    Args:
        own: (parameters,) of the trace.
        lone: Its problem, of `Joint.alone`.
        linear: Linear parameters, per block that shares them.
    """
    p = jnp.asarray(own)
    linear, record = best_of_blocks(p, lone) if linear is None else linear, lone.model.records[0]

    def one(rows):
        plain, (curves, slopes), target = _evaluate(p, linear, rows, lone)
        left = [curve - data for curve, data in zip(curves, target, strict=True)]
        return left, slopes, plain

    left, slopes, plain = jax.lax.map(one, _rows(record))
    channels = len(record.channels) if lone.model.loss == "strict" else 1

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

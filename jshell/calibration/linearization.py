"""A trace fit at given parameters: residual and Jacobian of constants and linear parameters together.

Symbols    J Jacobian by all parameters   r weighted residual   φ memory of the noise
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.least_squares import value_and_jacobian
from jshell.calibration.lengths import lengthened, own_rows
from jshell.calibration.long_records import best_of_blocks, is_long, look_at_all
from jshell.calibration.losses import bases, best_linear, solve_linear, targets
from jshell.calibration.misfit import rows_of
from jshell.calibration.noise import whiten
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem


@dataclass(frozen=True)
class Linearization:
    """A fit at given parameters.

    Attributes:
        values: All parameters.
        linear: Linear parameters, per block; `design` their weighted bases.
        residual: Weighted.
        jacobian: (data, free parameters then linear ones), of the parameters themselves.
        prior: (priors, the same) of the priors; `prior_residual` their residual.
    """

    values: np.ndarray
    linear: list[np.ndarray]
    design: list[np.ndarray]
    residual: np.ndarray
    jacobian: np.ndarray
    prior: np.ndarray
    prior_residual: np.ndarray


def linearized(
    values: np.ndarray, problem: Problem, parameters: Unknowns, linear: list[np.ndarray] | None = None
) -> Linearization:
    """Residual and Jacobian at given parameters, with the best linear ones unless they are given."""
    if is_long(problem.model):
        linear, r, J, bases = _by_blocks(values, problem, linear)
    else:
        linear, r, J, bases = _of_common_length(values, problem, linear)
    linear, r, J, bases = [np.asarray(c) for c in linear], np.asarray(r), np.asarray(J), [np.asarray(b) for b in bases]
    design = np.zeros((r.size, sum(basis.shape[1] for basis in bases)))
    row = column = 0
    for basis in bases:
        design[row : row + basis.shape[0], column : column + basis.shape[1]] = basis
        row, column = row + basis.shape[0], column + basis.shape[1]
    slopes = parameters.slopes(values)
    prior, left = np.zeros((len(problem.prior_at), slopes.shape[1] + design.shape[1])), np.zeros(0)
    if len(prior):
        prior[:, : slopes.shape[1]] = slopes[list(problem.prior_at)] / np.asarray(problem.prior)[:, 1:]
        left = np.asarray(problem.prior_residual(jnp.asarray(values)))
    return Linearization(values, linear, bases, r, np.concatenate([J @ slopes, design], axis=1), prior, left)


def _by_blocks(values: np.ndarray, problem: Problem, given: list[np.ndarray] | None):
    """As `_jacobian`, of traces too long to be differentiated at one go."""
    linear, left, slopes, plain = [], [], [], []
    for number, record in enumerate(problem.model.records):
        count = 1 if problem.model.loss == "strict" else len(record.channels)
        own = None if given is None else given[len(linear) : len(linear) + count]
        at = problem.own(number)
        c, r, J, basis = look_at_all(values[at], problem.alone(number), own)
        whole = np.zeros((r.size, len(values)))
        whole[:, at] = J
        linear, left, slopes, plain = [*linear, *c], [*left, r], [*slopes, whole], [*plain, *basis]
    return linear, np.concatenate(left), np.concatenate(slopes), plain


def best_linear_of(values: np.ndarray, problem: Problem) -> list[np.ndarray]:
    """The best linear parameters of every block that shares them."""
    if not is_long(problem.model):
        return [c for term in problem.terms(jnp.asarray(values)) for c in best_linear(*term)]
    found = [
        _best_of_blocks(jnp.asarray(values[problem.own(number)]), problem.alone(number))
        for number in range(len(problem.model.records))
    ]
    return [np.asarray(c) for each in found for c in each]


_best_of_blocks = eqx.filter_jit(best_of_blocks)


def _of_common_length(values: np.ndarray, problem: Problem, given: list[np.ndarray] | None):
    """As `_jacobian`, by a program that records of other lengths share."""
    long = eqx.tree_at(
        lambda j: (j.model, j.memory), problem, (lengthened(problem.model), None), is_leaf=lambda x: x is None
    )
    linear, r, J, bases = _jacobian(np.asarray(values), given, long)
    if long.model is problem.model:
        return linear, r, J, bases
    marks = own_rows(problem.model)
    own = np.concatenate(marks)
    bases = [np.asarray(basis)[mark] for basis, mark in zip(bases, marks, strict=True)]
    return linear, np.asarray(r)[own], np.asarray(J)[own], bases


@eqx.filter_jit
def _jacobian(values: np.ndarray | jax.Array, linear: list | None, problem: Problem):
    """Linear parameters; residual there, its derivative by all other parameters, and the bases."""
    each = lambda p: [basis for term in problem.terms(p) for basis in bases(term.constants, term.model)]  # noqa: E731
    plain, slopes = value_and_jacobian(each, jnp.asarray(values))
    data = targets(problem.model)
    if linear is None:
        linear = [solve_linear(basis, rows) for basis, rows in zip(plain, data, strict=True)]
    r = jnp.concatenate([basis @ c - rows for basis, c, rows in zip(plain, linear, data, strict=True)])
    J = jnp.concatenate([jnp.einsum("dlp,l->dp", slope, c) for slope, c in zip(slopes, linear, strict=True)])
    return linear, r, J, plain


def whitened(problem: Problem, found: Linearization) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Jacobian with the memory of the noise taken out, priors below."""
    r, J = found.residual, found.jacobian
    if problem.memory is not None:
        flat = [np.asarray(row) for rows in problem.memory for row in rows]
        parts = [(whiten(r[rows], m), whiten(J[rows], m)) for (*_, rows), m in zip(rows_of(problem), flat, strict=True)]
        r, J = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    return np.concatenate([r, found.prior_residual]), np.vstack([J, found.prior])

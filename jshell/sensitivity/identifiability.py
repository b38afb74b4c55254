"""What data can tell: information, directions left free, and the experiment to do next.

The data are ω- and ω+ of shells, each known to a relative error. Constants
enter by their logarithms, so that errors are relative too.

Symbols    θ = (ln α1, ln α2, ln |k_VS|)   J = ∂ ln ω/∂θ   F = JᵀJ/σ² Fisher's information
Valid for  small errors around the constants given
Source     Fisher; D-optimal design: Atkinson, Donev & Tobias 2007, chapter 10
"""

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.errors import BadShape, BadValue, Outcome
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.simulate import frequencies
from jshell.shell.parameters import Reduced

PARAMETERS = ("alpha1", "alpha2", "k_vs")
NULL = 1e-8  # share of the largest eigenvalue below which a direction is free


@dataclass(frozen=True)
class Information:
    """What frequencies of some shells say of the constants.

    Attributes:
        matrix: (3, 3) Fisher information in θ.
        eigenvalues: (3,) rising.
        directions: (3, 3) unit vectors in θ, a column each.
        stderr: (3,) least relative standard errors; infinite where a direction is free.
        used: How many shells gave both frequencies.
        refused: How many did not.
    """

    matrix: np.ndarray
    eigenvalues: np.ndarray
    directions: np.ndarray
    stderr: np.ndarray
    used: int
    refused: int

    @property
    def free(self) -> np.ndarray:
        """(3, directions) what the data leave free, a column each; empty where they determine everything."""
        least = NULL * max(self.eigenvalues[-1], 1e-300)
        return self.directions[:, self.eigenvalues <= least]

    @property
    def words(self) -> tuple[str, ...]:
        """The free directions in words."""
        return tuple(
            "free: " + " ".join(f"{x:+.2f} ln {name}" for x, name in zip(column, PARAMETERS, strict=True))
            for column in self.free.T
        )


@dataclass(frozen=True)
class NextExperiment:
    """Candidates ranked by what they would add.

    Attributes:
        best: Index of the best candidate.
        conditions: Its problem.
        gain: (candidates,) rise of ln det F, NaN where a candidate has no frequencies.
        before, after: Relative standard errors of the constants, without it and with it.
    """

    best: int
    conditions: Reduced
    gain: np.ndarray
    before: np.ndarray
    after: np.ndarray


@eqx.filter_jit
def _slopes(conditions: Reduced, coefficients: Coefficients) -> jax.Array:
    """(shells, 2, 3) ∂ ln ω±/∂θ."""
    signs = jnp.sign(jnp.asarray(coefficients.k_vs))
    theta = jnp.log(jnp.abs(jnp.stack([jnp.asarray(getattr(coefficients, name), float) for name in PARAMETERS])))

    def logs(theta: jax.Array, one: Reduced) -> jax.Array:
        alpha1, alpha2, k = jnp.exp(theta)
        found = frequencies(one, Coefficients(alpha1, alpha2, signs * k))
        there = found.outcome == int(Outcome.OK)
        return jnp.where(there, jnp.log(jnp.stack([found.omega_minus, found.omega_plus])), jnp.nan)

    return jax.vmap(lambda one: jax.jacfwd(logs)(theta, one))(conditions)


def _batch(conditions: Reduced) -> Reduced:
    """The same problems with a leading axis."""
    shapes = {np.shape(leaf) for leaf in jax.tree.leaves(conditions)}
    shape = np.broadcast_shapes(*shapes)
    if len(shape) > 1:
        raise BadShape("conditions", found=f"shape {shape}", expected="(shells,)", remedy="Flatten it.")
    size = shape[0] if shape else 1
    return jax.tree.map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf, dtype=float), (size,)), conditions)


def information(conditions: Reduced, coefficients: Coefficients, sigma: Any = 0.01) -> Information:
    """What ω- and ω+ of some shells say of α1, α2 and k_VS.

    Args:
        conditions: The shells, numbers of shape (shells,) or ().
        coefficients: Where the constants are believed to be; k_VS not 0.
        sigma: Relative standard error of the frequencies, one for all or (shells,).

    Raises:
        BadValue: A σ that is not above 0, or k_VS = 0, whose logarithm there is none.
        BadShape: Conditions of more than one axis.
    """
    shells = _batch(conditions)
    count = int(np.shape(shells.thickness)[0])
    error = np.broadcast_to(np.asarray(sigma, dtype=float), (count,))
    if not np.all(error > 0) or float(np.asarray(coefficients.k_vs)) == 0:
        raise BadValue(
            "sigma, k_vs", found="0 or less", expected="σ above 0, k_vs other than 0", remedy="Check the numbers."
        )
    J = np.asarray(_slopes(shells, coefficients)) / error[:, None, None]
    sound = np.all(np.isfinite(J), axis=(1, 2))
    rows = J[sound].reshape(-1, len(PARAMETERS))
    return _described(rows.T @ rows, int(sound.sum()), int((~sound).sum()))


def _described(F: np.ndarray, used: int, refused: int) -> Information:
    eigenvalues, directions = np.linalg.eigh(F)
    eigenvalues = np.maximum(eigenvalues, 0.0)
    free = eigenvalues <= NULL * max(eigenvalues[-1], 1e-300)
    variance = (directions[:, ~free] ** 2 / eigenvalues[~free]).sum(axis=1)
    touched = (directions[:, free] ** 2).sum(axis=1) > 1e-8
    return Information(F, eigenvalues, directions, np.where(touched, np.inf, np.sqrt(variance)), used, refused)


def next_experiment(
    candidates: Reduced, coefficients: Coefficients, done: Reduced | None = None, sigma: float = 0.01
) -> NextExperiment:
    """Which of many shells or pressures would tell most of the constants.

    Args:
        candidates: Shells that could be measured next, numbers of shape (candidates,).
        coefficients: Where the constants are believed to be.
        done: Shells already measured; None is none, and the best first shell is sought.
        sigma: Relative standard error of a frequency.

    Raises:
        BadValue: No candidate has two frequencies.

    Source:
        The candidate with the largest det(F + F_c); while directions are free, those are determined first.
    """
    shells = _batch(candidates)
    if done is None:
        start = _described(np.zeros((3, 3)), 0, 0)
    else:
        start = information(done, coefficients, sigma)
    J = np.asarray(_slopes(shells, coefficients)) / sigma
    sound = np.all(np.isfinite(J), axis=(1, 2))
    if not sound.any():
        raise BadValue(
            "candidates", found="none with two frequencies", expected="a buckled, stable shell", remedy="Load more."
        )
    # a trace of prior information keeps the determinant above 0 where directions are free
    prior = 1e-6 * np.eye(3)
    each = np.einsum("sij,sik->sjk", np.where(np.isfinite(J), J, 0.0), np.where(np.isfinite(J), J, 0.0))
    total = np.linalg.slogdet(start.matrix + each + prior)[1]
    gain = np.where(sound, total - np.linalg.slogdet(start.matrix + prior)[1], np.nan)
    best = int(np.nanargmax(gain))
    after = _described(start.matrix + each[best], start.used + 1, start.refused)
    chosen = jax.tree.map(lambda leaf: float(leaf[best]), shells)
    return NextExperiment(best, chosen, gain, start.stderr, after.stderr)

"""The shell that rings as wished: thickness and gas pressure from two frequencies.

Symbols    d̂ thickness   P̂0 gas pressure   ω±  wanted angular frequencies [sqrt(E d/(ρ_f R0³))]
Valid for  a shell loaded at its own buckling threshold, or at `excess` times it
Source     Mokbel et al. 2021: eq:defw, eq:equiplateau, eq:equivol, section "Softening of buckled shells"
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.least_squares import levenberg_marquardt
from jshell.errors import BadValue, Outcome
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.simulate import frequencies
from jshell.shell.parameters import Reduced
from jshell.shell.sphere import buckling_load

LOW, HIGH = (0.005, 0.05), (0.4, 50.0)  # thickness and gas pressure that are searched
GRID = 24
STARTS = 12
MET = 1e-9


@dataclass(frozen=True)
class MatchingShells:
    """Shells that ring as wished.

    Attributes:
        outcome: ok; out_of_range where no shell of the search range does.
        shells: Every different shell found, nearest to the middle of the range first.
        omega_minus, omega_plus: What was wanted.
        gap: Relative distance of the nearest shell's frequencies from those wanted; what is left where none meets them.
        nearest: The shell that comes nearest; the first of `shells` where there is one.
    """

    outcome: Outcome
    shells: tuple[Reduced, ...]
    omega_minus: float
    omega_plus: float
    gap: float
    nearest: Reduced


def loaded(thickness, gas_pressure, *, excess=1.0, viscosity=0.0, kappa=1.4, poisson_ratio=0.5) -> Reduced:
    """A shell under `excess` times its buckling load."""
    free = Reduced(thickness, gas_pressure, gas_pressure, viscosity, kappa, poisson_ratio)
    return free.replace(outer_pressure=excess * buckling_load(free))


def design(
    omega_minus: float,
    omega_plus: float,
    coefficients: Coefficients,
    *,
    excess: float = 1.0,
    viscosity: float = 0.0,
    kappa: float = 1.4,
    poisson_ratio: float = 0.5,
) -> MatchingShells:
    """Thickness and gas pressure of the shells whose two frequencies are as wished.

    A grid over the range gives starts, Newton's method with exact derivatives
    the answers; different answers are all given.

    Args:
        omega_minus, omega_plus: Wanted angular frequencies [sqrt(E d/(ρ_f R0³))], slow below fast.
        coefficients: Constants of the short model.
        excess: Outer pressure over the buckling load.
        viscosity, kappa, poisson_ratio: Of the liquid, the gas and the wall.

    Raises:
        BadValue: Frequencies that are not rising and above 0.

    Example:
        >>> from jshell.oscillator import SOURCE
        >>> from jshell.sensitivity import design
        >>> found = design(0.8, 1.6, SOURCE)
        >>> print(found.outcome.word, len(found.shells))
        ok 2
    """
    if not 0 < omega_minus < omega_plus < np.inf:
        raise BadValue(
            "omega_minus, omega_plus",
            found=f"{omega_minus!r}, {omega_plus!r}",
            expected="two frequencies above 0, slow below fast",
            remedy="Check the order and the unit.",
        )
    wanted = jnp.log(jnp.array([omega_minus, omega_plus]))
    others = tuple(jnp.asarray(x, dtype=float) for x in (excess, viscosity, kappa, poisson_ratio))
    args = (wanted, coefficients.alpha1, coefficients.alpha2, coefficients.k_vs, others)
    args = jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), args)

    edges = np.log(np.array([LOW[:1] + HIGH[:1], LOW[1:] + HIGH[1:]]))
    middle = [lo + (hi - lo) * (np.arange(GRID) + 0.5) / GRID for lo, hi in edges]
    grid = np.stack(np.meshgrid(*middle, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.asarray(_distances(jnp.asarray(grid), args))
    starts = grid[_promising(np.where(np.isfinite(distance), distance, np.inf))]
    ends, gaps = (np.asarray(part) for part in _solve(jnp.asarray(starts), jnp.asarray(edges), args))
    inside = np.all((ends >= edges[:, 0]) & (ends <= edges[:, 1]), axis=1)
    gaps = np.where(np.isfinite(gaps) & inside, gaps, np.inf)

    met: list[np.ndarray] = []
    for end in ends[gaps < MET]:
        if all(np.max(np.abs(end - other)) > 1e-5 for other in met):
            met.append(end)
    met.sort(key=lambda end: float(np.sum((end - edges.mean(axis=1)) ** 2)))
    shells = tuple(_plain(_built(jnp.asarray(end), others)) for end in met)
    if shells:
        return MatchingShells(Outcome.OK, shells, omega_minus, omega_plus, float(gaps.min()), shells[0])
    best = ends[int(np.argmin(gaps))] if np.isfinite(gaps).any() else starts[0]
    gap = float(gaps.min()) if np.isfinite(gaps).any() else float(np.nanmin(distance))
    return MatchingShells(
        Outcome.OUT_OF_RANGE, (), omega_minus, omega_plus, gap, _plain(_built(jnp.asarray(best), others))
    )


def _promising(distance: np.ndarray) -> np.ndarray:
    """Indices of `STARTS` grid points: those nearer than all their neighbours first, then the nearest others.

    The nearest alone may all lie in one valley, and a second shell would be missed.
    """
    table = np.pad(distance.reshape(GRID, GRID), 1, constant_values=np.inf)
    around = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    lowest = np.min([table[i : i + GRID, j : j + GRID] for i, j in around], axis=0).ravel()
    return np.lexsort((distance, ~(distance <= lowest) | np.isinf(distance)))[:STARTS]


@jax.jit
def _built(end: jax.Array, others) -> Reduced:
    """The shell of ln d̂ and ln P̂0, loaded."""
    excess, viscosity, kappa, ratio = others
    return loaded(*jnp.exp(end), excess=excess, viscosity=viscosity, kappa=kappa, poisson_ratio=ratio)


def _plain(shell: Reduced) -> Reduced:
    return jax.tree.map(float, shell)


def _mismatch(u: jax.Array, args) -> jax.Array:
    """ln ω± less what is wanted, of ln d̂ and ln P̂0."""
    wanted, alpha1, alpha2, k_vs, (excess, viscosity, kappa, ratio) = args
    d, P0 = jnp.exp(u)
    shell = loaded(d, P0, excess=excess, viscosity=viscosity, kappa=kappa, poisson_ratio=ratio)
    found = frequencies(shell, Coefficients(alpha1, alpha2, k_vs))
    return jnp.log(jnp.stack([found.omega_minus, found.omega_plus])) - wanted


@jax.jit
def _distances(grid: jax.Array, args) -> jax.Array:
    return jax.vmap(lambda u: jnp.max(jnp.abs(_mismatch(u, args))))(grid)


@jax.jit
def _solve(starts: jax.Array, edges: jax.Array, args) -> tuple[jax.Array, jax.Array]:
    low, high = edges.T

    def one(start: jax.Array) -> tuple[jax.Array, jax.Array]:
        residual = lambda u: _mismatch(u, args)  # noqa: E731
        found = levenberg_marquardt(residual, start, low, high, max_steps=60, xtol=1e-13, ftol=0.0).unknowns
        return found, jnp.max(jnp.abs(_mismatch(found, args)))

    return jax.vmap(one)(starts)

"""Two frequencies of every shell from three constants: what a table of frequencies is compared with.

Symbols    ω-, ω+ angular frequencies [sqrt(E d/(ρ_f R0³))]   V_e volume [R0³], P_e pressure [E d/R0] at rest
Source     Mokbel et al. 2021: eq:defw
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_shape import uncoupled
from jshell.calibration.frequency_table import FrequencyTable
from jshell.calibration.parameters import Unknowns, unknowns
from jshell.oscillator.linear import frequencies_of_square, squares

NAMES = ("alpha1", "alpha2", "k_vs")
SQUARED = frozenset({"k_vs"})  # frequencies know its square
POSITIVE = frozenset({"alpha1", "alpha2"})


def model(constants: Float[Array, "3"], rows: FrequencyTable) -> Float[Array, "shells 2"]:
    """V_e² ω² of every row (eq:defw), slow first; negative where unstable."""

    def one(V, P, kappa, K_A):
        return V**2 * frequencies_of_square(
            V, P, constants[0], constants[1], constants[2], kappa=kappa, area_modulus=K_A
        )

    arrays = (jnp.asarray(x) for x in (rows.volume, rows.pressure, rows.kappa, rows.area_modulus))
    return jax.vmap(one)(*arrays)


def table_residual(u: jax.Array, args: tuple[Unknowns, FrequencyTable, str]) -> jax.Array:
    """Weighted residual of a table, of what the solver sees."""
    free, rows, weighting = args
    return weighted(free.constrained(u), rows, weighting)


def weighted(constants: jax.Array, rows: FrequencyTable, weighting: str) -> Float[Array, " data"]:
    """Residual of every frequency, 0 where it is missing.

    In V_e ω the square root is continued by its tangent below a hundredth of
    the datum, so that a start with an unstable slow mode finds its way back.
    """
    V = jnp.asarray(rows.volume)[:, None]
    measured = jnp.isfinite(rows.omega)
    omega = jnp.where(measured, rows.omega, 1.0)
    found = model(constants, rows)
    if weighting == "V_e omega":
        floor = 0.01 * (V * omega) ** 2
        root = jnp.sqrt(jnp.maximum(found, floor))
        r = (root + jnp.minimum(found - floor, 0.0) / (2 * jnp.sqrt(floor)) - V * omega) / (rows.sigma * _unit(V, rows))
    else:
        r = (found - (V * omega) ** 2) / (rows.sigma * _unit(2 * V**2 * omega, rows))
    return jnp.where(measured, r, 0.0).ravel()


def _unit(slope: jax.Array, rows: FrequencyTable) -> jax.Array:
    """How an error of ω becomes one of the residual; 1 where errors are unknown (σ = 1 everywhere)."""
    known = jnp.any(jnp.asarray(rows.sigma) != 1.0)
    return jnp.where(known, slope, jnp.ones_like(slope))


def start_from_data(rows: FrequencyTable, fix: Mapping[str, float] | None = None) -> np.ndarray:
    """Constants from sums and products of the squared frequencies: (alpha1, alpha2, k_vs²).

    Rows with both frequencies: V²(ω-² + ω+²) = A/α1 + B/α2 is a line in the
    inverse masses, and V⁴ω-²ω+² = (AB - C k²)/(α1 α2) then gives k². The
    share of the volume motion in the sum is scanned, and the best taken; where
    rows do not tell the masses apart, volume and area motion share the sum.
    """
    fix = fix or {}
    V, P, kappa, K_A = (np.asarray(x) for x in (rows.volume, rows.pressure, rows.kappa, rows.area_modulus))
    A, B, C, _ = uncoupled(1.0, 1.0, 1.0, kappa * P * V, K_A / (4 * np.pi))
    y = (V[:, None] * np.asarray(rows.omega)) ** 2
    both = np.isfinite(y).all(axis=1)
    if not both.any():  # one frequency per shell: let each motion alone explain it
        mean = np.nanmean(y)
        return np.array([fix.get("alpha1", A.mean() / mean), fix.get("alpha2", B.mean() / mean), 0.01])

    A, B, y = A[both], B[both], y[both]
    total, product = y.sum(axis=1), y.prod(axis=1)
    best, lowest = np.ones(3), np.inf
    for share in np.linspace(0.05, 0.95, 37):
        if "alpha1" in fix:
            x1 = 1 / fix["alpha1"]
        elif "alpha2" in fix:
            x1 = np.mean((total - B / fix["alpha2"]) / A)
        else:
            x1 = share * np.mean(total / A)
        x1 = max(x1, 0.02 * np.mean(total / A))
        x2 = 1 / fix["alpha2"] if "alpha2" in fix else max(np.mean((total - A * x1) / B), 0.02 * np.mean(total / B))
        k2 = max(np.mean((A * B - product / (x1 * x2)) / C), 1e-3)
        k2 = fix["k_vs"] ** 2 if "k_vs" in fix else k2
        slow, fast = squares(V[both], P[both], 1 / x1, 1 / x2, k2, kappa[both], K_A[both])
        gap = V[both, None] * np.sqrt(np.stack([np.maximum(slow, 0), fast], axis=1)) - np.sqrt(y)
        cost = np.sum(gap**2) / np.sum(y) + 1e-9 * (share - 0.6) ** 2  # ties, as with one shape, go near the middle
        if cost < lowest:
            best, lowest = np.array([1 / x1, 1 / x2, k2]), cost
    return best


def parameters_of_table(fix: Mapping[str, float] | None, bounds: Mapping[str, tuple[float, float]] | None) -> Unknowns:
    """The three constants, some fixed, some bounded."""
    return unknowns(NAMES, POSITIVE, fix, bounds, squared=SQUARED)


def square_only(parameters: Unknowns) -> str:
    """What is to be said of the sign of k_VS where frequencies alone are fitted."""
    sign = "negative, as it was given" if parameters.negative else "positive, its sign is not known"
    return f"frequencies determine k_VS² only: k_vs is reported {sign}"

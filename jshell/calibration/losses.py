"""How a trace is compared with the oscillator: two losses.

*Strict*: V and S follow the oscillator's own motion. *Modal*: any channel is
two decaying sinusoids whose amplitudes, phases and gain are its own, so that
only ω-, ω+ and τ speak of the shell. What enters linearly, initial state and
offsets or amplitudes, is eliminated: the residual is what the best linear
parameters leave (variable projection).

Symbols    p constants   c linear parameters   Φ(p) basis, data ≈ Φ(p) c
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw;
           Golub & Pereyra 1973 for the projection
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell import integrator
from jshell.calibration.records import Record
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.linear import (
    exponential,
    frequencies_of_square,
    matrices,
    propagator,
    state_matrix,
    uniform_propagator,
)
from jshell.renamed import renamed
from jshell.shell.elasticity import moduli

STRICT_NAMES = ("alpha1", "alpha2", "k_vs", "beta1", "beta2")
MODAL_NAMES = ("alpha1", "alpha2", "k_vs")  # of k_vs it sees the square
PASSES = 3  # values, first and second derivatives
LOST = 1e-14  # share of the largest squared length below which a direction of the basis is rounding


class TraceModel(eqx.Module):
    """Records, and how they are to be compared with the oscillator.

    Attributes:
        records: One per trace.
        loss: `strict` or `modal`.
        solver: `exact` or `diffrax`.
        dipole: Convention of beta2.
        tied: Whether beta2 follows from equal decay.
        adjoint: How the adaptive solver is differentiated, `forward` or `reverse`.
        rtol: Its relative tolerance.
        atol: Its absolute tolerance.
    """

    records: tuple[Record, ...]
    loss: str = eqx.field(static=True)
    solver: str = eqx.field(static=True, default="exact")
    dipole: str = eqx.field(static=True, default="corrected")
    tied: bool = eqx.field(static=True, default=True)
    adjoint: str = eqx.field(static=True, default="forward")
    rtol: float = eqx.field(static=True, default=1e-10)
    atol: float = eqx.field(static=True, default=1e-12)

    @property
    def squared(self) -> frozenset[str]:
        """Constants that the loss knows only through their square: frequencies do not tell the sign of k_vs."""
        return frozenset({"k_vs"} if self.loss == "modal" else ())

    @property
    def constants(self) -> tuple[str, ...]:
        """Those of one record, in order."""
        if self.loss == "strict":
            return STRICT_NAMES[:4] if self.tied else STRICT_NAMES
        return (*MODAL_NAMES, "tau")

    @property
    def names(self) -> tuple[str, ...]:
        """The constants of all records: they share all but the decay time."""
        if self.loss == "strict" or len(self.records) == 1:
            return self.constants
        return (*MODAL_NAMES, *(f"tau[{i}]" for i in range(1, len(self.records) + 1)))


def bases(
    constants: Float[Array, " names"], model: TraceModel, *, late: bool = False
) -> list[Float[Array, "data linear"]]:
    """Weighted bases of the blocks that share linear parameters: one per trace (strict) or per channel (modal).

    Args:
        constants: The constants.
        model: Records and how they are compared.
        late: Whether the records' times begin later than the state that is eliminated.
    """
    blocks = []
    for number, record in enumerate(model.records):
        if model.loss == "strict":
            blocks.append(_strict_basis(constants, record, model, late))
        else:
            plain = _modal_basis(constants[:3], constants[3 + number], record)
            blocks += [row[:, None] * plain for row in record.weight]
    return blocks


def targets(model: TraceModel) -> list[Float[Array | np.ndarray, " data"]]:
    """Weighted data (data,) of the same blocks."""
    found = []
    for record in model.records:
        rows = record.weight * record.data
        found += [rows.ravel()] if model.loss == "strict" else list(rows)
    return found


def projected(constants: Float[Array, " names"], model: TraceModel) -> Float[Array, " data"]:
    """Weighted residual with the best linear parameters."""
    return jnp.concatenate(
        [linear_residual(basis, data) for basis, data in zip(bases(constants, model), targets(model), strict=True)]
    )


def linear_residual(
    basis: Float[Array, "data linear"], data: Float[Array | np.ndarray, " data"]
) -> Float[Array, " data"]:
    """What the best linear parameters leave, basis @ c - data."""
    return basis @ solve_linear(basis, data) - data


def solve_linear(
    basis: Float[Array, "data linear"], data: Float[Array | np.ndarray, " data"]
) -> Float[Array, " linear"]:
    """The best linear parameters.

    The inverse of the Gram matrix counts as a constant: every pass of refinement with it gives one more
    order of derivatives its full digits, value first, and the values those that normal equations lose.
    """
    size = jax.lax.stop_gradient(jnp.linalg.norm(basis, axis=0))
    size = jnp.where(size > 0, size, 1.0)
    unit = basis / size[None, :]
    inverse = gram_inverse(jax.lax.stop_gradient(unit.T @ unit))
    c = jnp.zeros(basis.shape[1])
    for _ in range(PASSES):
        c = c - inverse @ (unit.T @ (unit @ c - data))
    return c / size


def gram_inverse(gram: Float[Array, "linear linear"]) -> Float[Array, "linear linear"]:
    """Inverse of a Gram matrix of columns of length one; directions lost to rounding are left out."""
    finite = jnp.all(jnp.isfinite(gram))
    power, vectors = jnp.linalg.eigh(jnp.where(finite, gram, jnp.eye(gram.shape[0])))
    known = power > LOST * power[-1]
    inverse = (vectors * jnp.where(known, 1 / jnp.where(known, power, 1.0), 0.0)[None, :]) @ vectors.T
    return jnp.where(finite, inverse, jnp.nan)


def trace_loss(constants: Float[Array, " names"], model: TraceModel) -> Float[Array, ""]:
    """Half the sum of squared weighted residuals, linear parameters eliminated; differentiable both ways."""
    r = projected(constants, model)
    return 0.5 * (r @ r)


def best_linear(constants: Float[Array | np.ndarray, " names"], model: TraceModel) -> list[np.ndarray]:
    """Linear parameters at given constants, one array per block."""
    return [np.asarray(c) for c in _best_linear(constants, model)]


@eqx.filter_jit
def _best_linear(constants: np.ndarray | jax.Array, model: TraceModel) -> list[jax.Array]:
    rows = zip(bases(jnp.asarray(constants), model), targets(model), strict=True)
    return [solve_linear(basis, data) for basis, data in rows]


def linear_names(model: TraceModel) -> list[str]:
    """Names of the linear parameters, in the order of `best_linear`."""
    names = []
    for number, record in enumerate(model.records, 1):
        if model.loss == "strict":
            parts = ["ΔV", "ΔS", "dV/dt", "dS/dt", "V at rest", "S at rest"]
        else:
            waves = ("at rest", "slow cos", "slow sin", "fast cos", "fast sin")
            parts = [f"{channel} {wave}" for channel in record.channels for wave in waves]
        names += [f"{part} [{number}]" for part in parts]
    return names


def strict_coefficients(constants: Float[Array, " names"], model: TraceModel) -> Coefficients:
    """The oscillator's constants of the strict loss."""
    beta2 = None if model.tied else constants[4]
    return Coefficients(constants[0], constants[1], constants[2], constants[3], beta2, model.dipole)


def _strict_basis(constants: jax.Array, record: Record, model: TraceModel, late: bool) -> Float[Array, "data 6"]:
    """Motion of V, then S, from each unit of the initial state; and a constant for each."""
    system = matrices(strict_coefficients(constants, model), record.state, record.conditions)
    elapsed, count = jnp.asarray(record.elapsed), record.elapsed.size
    if model.solver == "diffrax":
        options = integrator.Scheme(model.rtol, model.atol, adjoint=model.adjoint)
        found = integrator.integrate(_advance, jnp.eye(4), elapsed, options, args=state_matrix(system))
        motion = jnp.asarray(found.samples)
    elif record.uniform:
        motion = uniform_propagator(system, (elapsed[-1] - elapsed[0]) / (count - 1), count)
        if late:
            motion = motion @ exponential(state_matrix(system) * elapsed[0])
    else:
        motion = propagator(system, elapsed)
    constant = jnp.broadcast_to(jnp.eye(2)[:, None, :], (2, count, 2))
    both = jnp.concatenate([jnp.moveaxis(motion[:, :2, :], 1, 0), constant], axis=2)
    return (jnp.asarray(record.weight)[:, :, None] * both).reshape(2 * count, 6)


def _advance(t, y, A):
    return A @ y


def angular_frequencies(constants: Float[Array, "3"], record: Record) -> Float[Array, "2"]:
    """Squared ω-, ω+ of a record's shell; constants (alpha1, alpha2, k_vs²)."""
    V, P = record.state
    K_A = moduli(record.conditions.thickness, record.conditions.poisson_ratio).area
    return frequencies_of_square(
        V, P, constants[0], constants[1], constants[2], kappa=record.conditions.kappa, area_modulus=K_A
    )


def _modal_basis(constants: jax.Array, tau: jax.Array, record: Record) -> Float[Array, "times 5"]:
    """A constant and two decaying sinusoids; Ω² = ω² - 1/τ², kept above a ten-thousandth."""
    frequency = jnp.sqrt(jnp.maximum(angular_frequencies(constants, record) - 1 / tau**2, 1e-4))
    t = jnp.asarray(record.elapsed)
    decay = jnp.exp(-t / tau)
    slow, fast = frequency[0] * t, frequency[1] * t
    waves = [jnp.ones_like(t), decay * jnp.cos(slow), decay * jnp.sin(slow), decay * jnp.cos(fast)]
    return jnp.stack([*waves, decay * jnp.sin(fast)], axis=1)


__getattr__ = renamed(__name__, {"left_over": "linear_residual", "best": "solve_linear"})

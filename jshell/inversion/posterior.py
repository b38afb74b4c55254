"""The posterior of an inversion's unknowns, drawn by NUTS.

Within a few standard errors of the answer rates, shapes and rest values are smooth functions of the unknowns: they are
fitted by polynomials of third degree to what the simulator says there, with its exact derivatives, and the sampler
asks these. At some of the draws the simulator is asked itself; how far the two densities differ is told.

Likelihood: normal noise with the memory that the inversion found; amplitudes are integrated out under a flat prior in
what the channels move together, and the noise's variance under Jeffreys', unless errors were given. Prior: flat in the
logarithm of positive unknowns, their bounds, and the priors that the inversion was given.

Symbols    z unknowns in standard errors about the answer   s rates   φ changes of the channels along the modes
Source     Hoffman & Gelman 2014; as `jshell.calibration.posterior`
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.noise import whiten
from jshell.calibration.posterior import Posterior, SamplerSettings, drawn, summarised
from jshell.errors import NotOk, Outcome
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Modal
from jshell.inversion.search import SearchResult

if TYPE_CHECKING:
    from jshell.inversion.result import Inversion

DEGREE = 3
REACH = 2.5  # standard errors to which the simulator is asked for the polynomials
AROUND = 1.3  # further points, of this times the size that a draw has
CHECKED = 16  # draws at which it is asked itself
CLOSE = 0.25  # scatter of the difference of the two log densities, up to which draws are taken


@dataclass(frozen=True)
class SimulatorPosterior(Posterior):
    """Draws of an inversion.

    Attributes:
        departure: Scatter of the difference of the log densities, of the polynomials and of the simulator, over draws.
    """

    departure: float = np.nan

    @property
    def sound(self) -> bool:
        """Whether chains agree, none lost its way, and the simulator confirms the draws."""
        return super().sound and self.departure < CLOSE

    def report(self, level: float | int = 0.95) -> str:
        """The intervals as text."""
        words = (
            f"    the simulator's own density differs from that of the draws by {self.departure:.2g} of its logarithm"
        )
        return f"{super().report(level)}\n{words}"


class Part(NamedTuple):
    """One recording as the sampler sees it.

    Attributes:
        terms: (outputs, terms) of the polynomials; see `_flat` for the outputs.
        elapsed: (times,); values: (channels, times); weight: (channels,) one over σ; memory: (channels, times) φ.
        free: (1,) where rest values are no data, else (0,): of an array only the shape is known while compiling.
    """

    terms: jax.Array
    elapsed: jax.Array
    values: jax.Array
    weight: jax.Array
    memory: jax.Array
    free: jax.Array


class Data(NamedTuple):
    """All that the density depends on.

    Attributes:
        parts: Recordings.
        best, half: (unknowns,) the answer as the solver sees it; a root of its covariance.
        low, high, logarithmic: (unknowns,) bounds, and which unknowns are sought by their logarithms.
        mean, sigma: (unknowns,) of priors; infinite errors where there is none.
        variance: Of the weighted residual.
    """

    parts: tuple[Part, ...]
    best: jax.Array
    half: jax.Array
    low: jax.Array
    high: jax.Array
    logarithmic: jax.Array
    mean: jax.Array
    sigma: jax.Array
    variance: jax.Array


def posterior(found: "Inversion", sampling: SamplerSettings) -> SimulatorPosterior:
    """Draw from the posterior, starting at the answer.

    Args:
        found: An inversion that is ok.
        sampling: How much is drawn.

    Raises:
        NotOk: The simulator finds no shell near the answer.
        MissingExtra: NumPyro is not installed.
    """
    model, best = found.model, found.solution
    assert model is not None
    assert best is not None
    size = best.u.size
    data = _data(model, best, found.weighings, found.spread(), 1.0 if found.absolute else found.reduced_chi_square)
    whole = size + (not found.absolute)
    got = drawn(_energy, whole, sampling, data)
    z, variance = got.z[..., :size], float(data.variance)
    noise = np.ones(z.shape[:2]) if found.absolute else np.sqrt(variance) * np.exp(got.z[..., size])
    shown = model.parameters.to_values(best.u + z @ np.asarray(data.half).T)
    made = summarised(model.parameters.names, shown, noise, got.diverging, sampling.seed)
    some = z.reshape(-1, size)[np.linspace(0, z[..., 0].size - 1, CHECKED).astype(int)]
    return SimulatorPosterior(**vars(made), departure=_departure(model, best, found.weighings, data, some))


def _data(
    model: Model, best: SearchResult, weighings: Sequence[Weighing], covariance: np.ndarray, variance: float
) -> Data:  # fmt: skip
    """What the sampler is given."""
    values, vectors = np.linalg.eigh(covariance)
    half = vectors * np.sqrt(np.maximum(values, 0.0))
    size, generator = best.u.size, np.random.default_rng(0)
    around = generator.standard_normal((2 * size, size))
    around *= AROUND * np.sqrt(size) / np.linalg.norm(around, axis=1, keepdims=True)
    points = np.concatenate([np.zeros((1, size)), REACH * np.eye(size), -REACH * np.eye(size), around])
    parts = []
    for k, (one, weighing) in enumerate(zip(model.recordings, weighings, strict=True)):
        terms = _polynomials(model, best, k, weighing, half, points)
        free = jnp.zeros(int(weighing.free_rest))
        elapsed = jnp.asarray(one.times - one.times[0])
        values, weight, memory = (jnp.asarray(x) for x in (one.values, 1 / weighing.sigma, weighing.memory))
        parts.append(Part(jnp.asarray(terms), elapsed, values, weight, memory, free))
    priors = model.parameters.priors
    mean = np.array([0.0 if one is None else one.mean for one in priors])
    sigma = np.array([np.inf if one is None else one.sigma for one in priors])
    low, high = model.parameters.to_u(model.parameters.low), model.parameters.to_u(model.parameters.high)
    arrays = (best.u, half, low, high, model.parameters.logarithmic, mean, sigma, np.array(variance))
    return Data(tuple(parts), *(jnp.asarray(x) for x in arrays))


def _polynomials(model: Model, best: SearchResult, k: int, weighing: Weighing, half, points) -> np.ndarray:
    """(outputs, terms) fitted to what the simulator says of recording k at some z, and to its derivatives."""
    at_best, _, _ = model.picked(k, best.u, best.near[k], weighing)
    rows, targets = [], []
    for z in points:
        modal, slopes, outcome = model.picked(k, best.u + half @ z, best.near[k], weighing)
        if outcome != Outcome.OK:
            continue
        y, dy = _flat(modal, slopes, at_best, weighing)
        rows.append(np.concatenate([_terms(z)[None], _slopes(z)]))
        targets.append(np.concatenate([y[None], half.T @ dy]))
    if len(rows) < points.shape[1] + 1 + points.shape[1] // 2:
        raise NotOk("posterior", Outcome.OUT_OF_RANGE)
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=None)[0].T


def _flat(modal: Modal, slopes: Modal, at_best: Modal, weighing: Weighing) -> tuple[np.ndarray, np.ndarray]:
    """Outputs (outputs,) and their derivatives (unknowns, outputs): s, φ and rest values, real and imaginary parts.

    A mode's size and phase mean nothing: its part along that of the answer is one.
    """
    weigh = at_best.shapes.conj() / weighing.sigma**2
    weigh = weigh / np.sum(weigh * at_best.shapes, axis=1, keepdims=True)
    part = np.sum(weigh * modal.shapes, axis=1, keepdims=True)
    moved = np.sum(weigh * slopes.shapes, axis=2, keepdims=True)
    shapes = modal.shapes / part
    turned = (slopes.shapes - shapes * moved) / part
    count, parts = len(slopes.rates), (np.real, np.imag)
    y = [*(of(modal.rates) for of in parts), *(of(shapes).ravel() for of in parts), modal.rest]
    dy = [*(of(slopes.rates) for of in parts), *(of(turned).reshape(count, -1) for of in parts)]
    return np.concatenate(y), np.concatenate([*dy, slopes.rest], axis=1)


@lru_cache(maxsize=8)
def _powers(size: int) -> np.ndarray:
    """(terms, size) exponents of all monomials."""
    found = [p for degree in range(DEGREE + 1) for p in combinations_with_replacement(range(size), degree)]
    return np.array([[p.count(i) for i in range(size)] for p in found])


def _terms(z: Any) -> Any:
    """(terms,) the monomials; of JAX where z is."""
    powers = _powers(z.shape[-1])
    ladder = [z * 0 + 1, z, z * z, z * z * z]
    xp = jnp if isinstance(z, jax.Array) else np
    return xp.prod(xp.stack(ladder)[powers, np.arange(z.shape[-1])], axis=-1)


def _slopes(z: np.ndarray) -> np.ndarray:
    """(unknowns, terms) their derivatives."""
    powers, rows = _powers(z.size), []
    for i in range(z.size):
        lower = powers.copy()
        lower[:, i] = np.maximum(lower[:, i] - 1, 0)
        rows.append(powers[:, i] * np.prod(z**lower, axis=1))
    return np.array(rows)


def _energy(z: jax.Array, data: Data) -> jax.Array:
    """Minus the logarithm of the posterior, of z and, where it is drawn, of the logarithm of the noise."""
    size = data.best.size
    return _density([part.terms @ _terms(z[:size]) for part in data.parts], z, data)


def _density(outputs: Sequence[jax.Array], z: jax.Array, data: Data) -> jax.Array:
    """The same from what the simulator or its polynomials say."""
    size = data.best.size
    u = data.best + data.half @ z[:size]
    values = jnp.where(data.logarithmic, jnp.exp(jnp.where(data.logarithmic, u, 0.0)), u)
    energy, degrees = 0.5 * jnp.sum(((values - data.mean) / data.sigma) ** 2), 0
    log_noise = z[size] if z.size > size else jnp.zeros(())
    variance = jnp.where(z.size > size, data.variance, 1.0) * jnp.exp(2 * log_noise)
    for part, y in zip(data.parts, outputs, strict=True):
        chi_square, log_volume, linear = _left(part, y)
        energy += 0.5 * chi_square / variance + log_volume
        degrees += part.values.size - linear
    energy += degrees * log_noise
    inside = jnp.all((u >= data.low) & (u <= data.high))
    return jnp.where(inside & jnp.isfinite(energy), energy, jnp.inf)


def _left(part: Part, y: jax.Array) -> tuple[jax.Array, jax.Array, int]:
    """χ² with the amplitudes eliminated, logarithm of the volume of their basis, and their number."""
    channels = part.values.shape[0]
    modes = (y.size - channels) // (2 + 2 * channels)
    ends = np.cumsum([modes, modes, modes * channels, modes * channels])
    real, imaginary, along, across, rest = jnp.split(y, ends)
    shapes = (along + 1j * across).reshape(modes, channels)
    wave = jnp.exp((real + 1j * imaginary)[:, None] * part.elapsed[None])
    waves = shapes[:, :, None] * wave[:, None]
    columns = jnp.concatenate([jnp.real(waves), -jnp.imag(waves)])
    level = rest
    if part.free.size:
        still = jnp.broadcast_to(jnp.eye(channels)[:, :, None], (channels, *part.values.shape))
        columns, level = jnp.concatenate([columns, still]), jnp.zeros(channels)
    everything = jnp.concatenate([columns, (part.values - level[:, None])[None]]) * part.weight[None, :, None]
    fresh = [whiten(everything[:, c].T, part.memory[c]) for c in range(channels)]
    upper = jnp.linalg.qr(jnp.concatenate(fresh), mode="r")
    return upper[-1, -1] ** 2, jnp.sum(jnp.log(jnp.abs(jnp.diag(upper)[:-1]))), columns.shape[0]


def _departure(model: Model, best: SearchResult, weighings: Sequence[Weighing], data: Data, some: np.ndarray) -> float:
    """Scatter of the difference of the two log densities over draws (draws, unknowns)."""
    away = []
    for z in some:
        u, outputs = best.u + np.asarray(data.half) @ z, []
        for k, weighing in enumerate(weighings):
            at_best, _, _ = model.picked(k, best.u, best.near[k], weighing)
            modal, slopes, outcome = model.picked(k, u, best.near[k], weighing)
            if outcome != Outcome.OK:
                return np.inf
            outputs.append(jnp.asarray(_flat(modal, slopes, at_best, weighing)[0]))
        whole = jnp.asarray(np.append(z, np.zeros(0)))
        away.append(float(_apart(outputs, whole, data)))
    return float(np.std(away))


@eqx.filter_jit
def _apart(outputs: Sequence[jax.Array], z: jax.Array, data: Data) -> jax.Array:
    """Difference of the two log densities."""
    return _density(outputs, z, data) - _energy(z, data)

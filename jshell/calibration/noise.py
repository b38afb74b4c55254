"""What a fit leaves: white noise, autocorrelated noise, or motion that the model lacks.

Errors of a fit assume that what is left is noise whose samples know nothing of
each other. Here that is tested, and where it fails autocorrelated (AR(1)) noise,
e_k = φ e_{k-1} + fresh, is estimated by restricted likelihood, which does
not mistake the directions that the fit has already used up for a short memory.

Symbols    e standardised residual   φ memory from sample to sample   J = ∂r/∂p
Valid for  samples in time order; over a gap of m steps φ is φ^m
Source     Wald & Wolfowitz 1940 (runs); Fisher 1929 (the largest peak of a periodogram); Mann & Whitney 1947;
           Patterson & Thompson 1971 (restricted likelihood)
"""

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.fft
import scipy.special

CORRELATED = 4.0  # standard errors by which lag-1 or runs must leave white noise: 6 in 100 000 by chance
STRONGEST = 0.998  # memory beyond which a record is all drift
COHERENT = 1e-6  # chance of so large a peak, or of so uneven an envelope, in noise
MISFIT = 1.5  # residual over noise beyond which a model does not describe a record: of a hundred samples the scatter
# of either is below a tenth


def is_correlated(lag1_z: Any, runs_z: Any) -> Any:
    """Whether a residual fails the tests of white noise."""
    return (lag1_z > CORRELATED) | (runs_z < -CORRELATED)


def is_coherent(peak: Any, envelope: Any) -> Any:
    """Whether what is left moves as no noise does."""
    return np.minimum(peak, envelope) < COHERENT


def rough_share(memory: Any) -> Any:
    """Share of the variance of autocorrelated noise that six differences leave, over that of white noise."""
    binomial = np.array([1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0])
    overlap = np.correlate(binomial, binomial, "full")
    return np.asarray(memory)[..., None] ** np.abs(np.arange(-6, 7)) @ overlap / 924


@dataclass(frozen=True)
class Noise:
    """What is left of one channel of one trace.

    Attributes:
        channel: Its name, with the trace's number.
        samples: How many are used.
        lag1: Autocorrelation at one step; `lag1_z` the same in standard errors of white noise.
        runs_z: Runs of one sign, in standard errors from what white noise has; negative is too few.
        memory: φ of the noise model; 0 where the channel passes as white.
        effective: Samples of white noise that would say as much of a constant, (1-φ)/(1+φ) of them.
        peak: Chance that noise alone has so large a peak in its spectrum.
        envelope: Chance that noise alone is so much stronger in one half of the record.
    """

    channel: str
    samples: int
    lag1: float
    lag1_z: float
    runs_z: float
    memory: float
    effective: float
    peak: float
    envelope: float

    @property
    def correlated(self) -> bool:
        """Whether it fails the tests of white noise."""
        return bool(is_correlated(self.lag1_z, self.runs_z))

    @property
    def coherent(self) -> bool:
        """Whether, after its memory is taken out, it still moves as no such noise does."""
        return bool(is_coherent(self.peak, self.envelope))

    def words(self) -> str:
        """One line of a report."""
        kind = "taken as white" if self.correlated else "white"
        if self.memory:
            few = "worth less than one sample" if self.effective < 1 else "one sample's worth"
            worth = few if self.effective < 1.5 else f"{self.effective:.0f} samples' worth"
            kind = f"autocorrelated, φ = {self.memory:.3f}: {worth}"
        return f"{self.channel}: lag-1 {self.lag1:+.3f} ({self.lag1_z:+.1f} σ), runs {self.runs_z:+.1f} σ; {kind}"


def taken_as_white(one: Noise) -> Noise:
    """The same tests, with every sample counted in full."""
    return replace(one, memory=0.0, effective=float(one.samples))


def lag_one(left: np.ndarray) -> tuple[Any, Any]:
    """Autocorrelation at one step along the last axis, and in standard errors of white noise."""
    e = left - left.mean(axis=-1, keepdims=True)
    power = np.einsum("...t,...t->...", e, e)
    value = np.einsum("...t,...t->...", e[..., 1:], e[..., :-1]) / np.where(power > 0, power, np.inf)
    return value[()], (value * np.sqrt(e.shape[-1]))[()]


def runs(left: np.ndarray) -> Any:
    """Number of runs on one side of the mean along the last axis, in standard errors from that of white noise."""
    sign = left > left.mean(axis=-1, keepdims=True)
    return runs_from(sign.sum(axis=-1), np.sum(sign[..., 1:] != sign[..., :-1], axis=-1), left.shape[-1])


def runs_from(above: Any, changes: Any, total: Any) -> Any:
    """The same from the number of samples above the mean, of changes of side, and of all."""
    below = total - above
    mean = 1 + 2 * above * below / total
    variance = (mean - 1) * (mean - 2) / (total - 1)
    return np.where(np.minimum(above, below) < 2, 0.0, (1 + changes - mean) / np.sqrt(np.maximum(variance, 1e-12)))[()]


def peak_chance(left: np.ndarray, axis: int = -1) -> Any:
    """Chance of the largest share that one frequency takes of the power (Fisher's g), along an axis."""
    length = left.shape[axis]
    waves: Any = scipy.fft.rfft(left, axis=axis)
    waves = np.moveaxis(waves, axis, 0)[1 : (length + 1) // 2]  # without the mean
    power = waves.real**2
    power += waves.imag**2
    count, total = power.shape[0], power.sum(axis=0)
    if count < 4:
        return np.ones(total.shape)[()]
    share = power.max(axis=0) / np.where(total > 0, total, np.inf)
    return np.where(total > 0, np.minimum(1.0, count * np.maximum(0.0, 1 - share) ** (count - 1)), 1.0)[()]


def envelope_chance(left: np.ndarray) -> float:
    """Chance of so uneven sizes in the two halves, by ranks, so that an outlier counts as one."""
    half, rest = left.size // 2, left.size - left.size // 2
    size = np.abs(left)
    order = np.argsort(size)
    place = np.cumsum(np.append(0, np.diff(size[order]) > 0))  # equal sizes share a place
    ties = np.bincount(place)
    rank = np.cumsum(ties) - (ties - 1) / 2
    beyond = abs(float(np.sum(rank[place[order < half]])) - half * (left.size + 1) / 2) - 0.5
    spread = half * rest / 12 * (left.size + 1 - float(np.sum(ties**3 - ties)) / (left.size * (left.size - 1)))
    return float(2 * scipy.special.ndtr(-max(beyond, 0.0) / np.sqrt(spread))) if spread > 0 else 1.0


def whiten(rows: np.ndarray | jax.Array, memory: np.ndarray | jax.Array | float) -> Any:
    """Rows (samples, ...) with the memory taken out; noise keeps its variance, the first sample stays.

    Of JAX where that is given, else of NumPy.

    Args:
        rows: A residual, or the columns of a Jacobian.
        memory: (samples,) φ over the step that leads to each sample; the first is not used.
    """
    numbers: Any = jnp if isinstance(rows, jax.Array) else np
    phi = numbers.broadcast_to(numbers.asarray(memory, dtype=float), rows.shape[:1])[1:]
    phi = phi.reshape(-1, *(1,) * (rows.ndim - 1))
    return numbers.concatenate([rows[:1], (rows[1:] - phi * rows[:-1]) / numbers.sqrt(1 - phi**2)])


def steps_between(times: np.ndarray, used: np.ndarray | None = None) -> np.ndarray:
    """Length of the step that leads to each sample, in typical steps; infinite from an unused sample."""
    gaps = np.diff(np.asarray(times, dtype=float))
    steps = np.append(1.0, gaps / np.median(gaps))
    if used is not None:
        before = np.append(True, used[:-1])
        steps = np.where(before & used, steps, np.inf)
    return steps


def ar1_memory(phi: float, steps: np.ndarray) -> np.ndarray:
    """φ over steps of other lengths than one."""
    with np.errstate(divide="ignore"):
        return np.exp(np.log(max(phi, 1e-300)) * steps) if phi > 0 else np.zeros(steps.size)


def estimate_memory(left: np.ndarray, jacobian: np.ndarray, steps: np.ndarray) -> float:
    """φ of greatest restricted likelihood.

    The residual of a fit is less autocorrelated than its noise, since the fit follows
    the slow part; the restricted likelihood allows for it.

    Args:
        left: (samples,) residual.
        jacobian: (samples, parameters) of the residual.
        steps: From `steps_between`.
    """
    length = np.linalg.norm(jacobian, axis=0)
    u, s, _ = np.linalg.svd(jacobian[:, length > 0] / length[length > 0], full_matrices=False)
    basis = u[:, s > 1e-9 * s[0]] if s.size else u[:, :0]
    count = left.size - basis.shape[1]
    if count < 8:
        return 0.0

    def cost(phi: float) -> float:
        memory = ar1_memory(phi, steps)
        r, B = whiten(left, memory), whiten(basis, memory)
        q, upper = np.linalg.qr(B)
        rest = r - q @ (q.T @ r)
        log_fresh = float(np.sum(np.log(1 - memory[1:] ** 2)))
        log_used = 2 * float(np.sum(np.log(np.abs(np.diag(upper)) + 1e-300)))
        return 0.5 * (log_fresh + log_used + count * np.log(max(float(rest @ rest), 1e-300)))

    from scipy.optimize import minimize_scalar  # here: it is slow to load, and few need it

    found = minimize_scalar(cost, bounds=(0.0, STRONGEST), method="bounded", options={"xatol": 1e-4})
    return float(found.x)


def examine(name: str, left: np.ndarray, jacobian: np.ndarray, times: np.ndarray, weight: np.ndarray) -> Noise:
    """The tests, and the memory where they fail.

    Args:
        name: Of the channel.
        left: (samples,) weighted residual.
        jacobian: (samples, parameters) of it.
        times: (samples,).
        weight: (samples,); 0 where a sample is not used.
    """
    used = weight > 0
    kept = left[used]
    lag1, lag1_z = lag_one(kept)
    runs_z = runs(kept)
    plain = Noise(name, kept.size, float(lag1), float(lag1_z), float(runs_z), 0.0, float(kept.size), 1.0, 1.0)
    memory, steps = 0.0, steps_between(times, used)
    if plain.correlated:
        memory = estimate_memory(left, jacobian, steps)
    fresh = whiten(left, ar1_memory(memory, steps))[used]
    effective = kept.size * (1 - memory) / (1 + memory)
    peak, envelope = float(peak_chance(fresh)), envelope_chance(fresh)
    return Noise(name, kept.size, plain.lag1, plain.lag1_z, plain.runs_z, memory, effective, peak, envelope)

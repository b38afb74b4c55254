"""Sums of damped sinusoids that share one decay time, fitted by variable projection.

    x_c(t) = offset_c + e^(-t/τ) Σ_m [C_mc cos(Ω_m t) + S_mc sin(Ω_m t)]

Offsets and amplitudes enter linearly: for given Ω and τ they follow from linear
least squares, so that the search runs over log Ω_1, …, log Ω_M, log τ only.
Logarithms of the damped Ω rather than of ω = sqrt(Ω² + 1/τ²), because every
value of theirs is a motion.

Symbols    Ω damped angular frequency   ω undamped   τ decay time   c channel   m mode
Source     variable projection: Golub & Pereyra 1973, with Kaufman's Jacobian (1975)
           equal decay of the modes: Mokbel et al. 2021, the fit of ΔV(t)
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jshell.signals.waves import SignalFit, SignalModel, search
from jshell.signals.waves_from_data import sound

STEPS = 80
RIDGE = 1e-13  # on columns of length 1: lets nearly equal modes pass without a division by zero
TOLERANCE = 1e-11  # relative change of the cost, and step in log Ω and log τ


@dataclass(frozen=True)
class DampedModes:
    """The best fit of damped sinusoids to a record, as plain numbers.

    Attributes:
        Omega: (modes,) damped angular frequencies, ascending.
        omega: (modes,) undamped, sqrt(Ω² + 1/τ²).
        tau: Decay time.
        errors: Standard errors of each ω and of τ, from the residual as white noise.
        offset: (channels,) rest values.
        residual: rms of what is left over rms of the signal about its offset, each channel by its own rms.
        converged: Whether a start came to rest at modes that are apart, turn, and lie in the record's reach.
    """

    Omega: np.ndarray
    omega: np.ndarray
    tau: float
    errors: np.ndarray
    offset: np.ndarray
    residual: float
    converged: bool


class DampedSinusoids(eqx.Module):
    """Damped sinusoids about an offset; amplitudes hold at the record's first time.

    Attributes:
        damped: Ω, ascending.
        tau: Decay time, shared.
        offset: Rest value of each channel.
        cosine: C of each mode and channel.
        sine: S of each mode and channel.
        residual: rms of what is left over rms of the signal about its offset.
        power: Sum of squares of what is left.
        covariance: Of log Ω and log τ, for independent errors of the size of what is left.
        converged: Whether the search came to rest.
    """

    damped: Float[Array, "modes"]
    tau: Float[Array, ""]
    offset: Float[Array, "channels"]
    cosine: Float[Array, "modes channels"]
    sine: Float[Array, "modes channels"]
    residual: Float[Array, ""]
    power: Float[Array, ""]
    covariance: Float[Array, "parameters parameters"]
    converged: Bool[Array, ""]

    @property
    def omega(self) -> Float[Array, "modes"]:
        """Undamped frequencies: ω = sqrt(Ω² + 1/τ²), exact for equal decay."""
        return jnp.sqrt(self.damped**2 + 1 / self.tau**2)

    @property
    def amplitude(self) -> Float[Array, "modes channels"]:
        """A >= 0 in A cos(Ωt + φ)."""
        return jnp.hypot(self.cosine, self.sine)

    @property
    def phase(self) -> Float[Array, "modes channels"]:
        """φ in A cos(Ωt + φ) [rad]."""
        return jnp.arctan2(-self.sine, self.cosine)


def fit(
    times: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    starts: Float[np.ndarray, "starts parameters"],
) -> DampedModes:
    """The best of several starts.

    Channels count by their own rms, so that a large one does not drown a small one.

    Args:
        times: Increasing times.
        values: Channels that share Ω and τ.
        starts: Ω of each mode, then the decay rate 1/τ.
    """
    elapsed, even, mean, scale = comparable(times, values)
    endings = [search(SignalModel(starts.shape[1] - 1), elapsed, even, np.log(start)) for start in starts]
    best = min(endings, key=lambda one: (not sound(one, elapsed), one.power))
    return damped_modes(best, elapsed, even, mean, scale)


def comparable(
    times: np.ndarray, values: np.ndarray, *, centred: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times from 0, channels centred and of unit scatter; what was taken off, and their scatters."""
    mean, scale = values.mean(axis=1) * centred, values.std(axis=1)
    return times - times[0], (values - mean[:, None]) / scale[:, None], mean, scale


def damped_modes(
    ending: SignalFit, elapsed: np.ndarray, values: np.ndarray, mean: np.ndarray, scale: np.ndarray
) -> DampedModes:
    """An ending as plain numbers, channels in their own units again."""
    Omega, sigma, M = ending.Omega, ending.sigma, ending.model.modes
    omega = np.sqrt(Omega**2 + sigma**2)
    # by log Ω of each mode, and by log σ, which all share
    slope = np.zeros((M + 1, ending.unknowns.size))
    slope[range(M), range(M)] = Omega**2 / omega
    slope[:M, M] = sigma**2 / omega
    slope[M, M] = 1 / sigma[0]
    errors = np.sqrt(np.maximum(np.einsum("ap,pq,aq->a", slope, ending.covariance, slope), 0))
    signal = values - ending.background(elapsed)
    offset = ending.background(elapsed[-1:])[:, 0] if ending.model.background else np.zeros(scale.size)
    return DampedModes(
        Omega=Omega,
        omega=omega,
        tau=float(1 / sigma[0]),
        errors=errors,
        offset=mean + scale * offset,
        residual=float(np.sqrt(ending.power / max(float(np.sum(signal**2)), 1e-300))),
        converged=sound(ending, elapsed),
    )


def project(
    logs: Float[Array, "parameters"],
    times: Float[Array, "times"],
    values: Float[Array, "times channels"],
    weights: Float[Array, "times"],
) -> tuple[Float[Array, "columns channels"], Float[Array, "times channels"], Float[Array, "times parameters channels"]]:
    """Best linear part for given log Ω and log τ.

    Returns:
        Linear coefficients (offset, then C and S of each mode), weighted residual,
        and its derivative by `logs` after Kaufman.
    """
    root = jnp.sqrt(weights)[:, None]
    target = root * values

    def basis(logs: Float[Array, "parameters"]) -> Float[Array, "times columns"]:
        decay = jnp.exp(-times * jnp.exp(-logs[-1]))[:, None]
        turn = times[:, None] * jnp.exp(logs[:-1])[None, :]
        waves = jnp.stack([decay * jnp.cos(turn), decay * jnp.sin(turn)], axis=-1)
        return root * jnp.concatenate([jnp.ones_like(decay), waves.reshape(times.shape[0], -1)], axis=1)

    B = basis(logs)
    size = jnp.sqrt(jnp.sum(B**2, axis=0) + 1e-300)
    unit = B / size[None, :]
    gram = unit.T @ unit + RIDGE * jnp.eye(B.shape[1])
    factor = jax.scipy.linalg.cho_factor(gram)
    solve = lambda right: jax.scipy.linalg.cho_solve(factor, right)  # noqa: E731

    coefficients = solve(unit.T @ target)
    rest = target - unit @ coefficients
    again = solve(unit.T @ rest)  # one refinement wins back the digits that normal equations lose
    coefficients, rest = (coefficients + again) / size[:, None], rest - unit @ again

    slope = jax.jacfwd(lambda logs: basis(logs) @ coefficients)(logs)  # (times, channels, p)
    flat = jnp.moveaxis(slope, -1, 1).reshape(times.shape[0], -1)
    flat = flat - unit @ solve(unit.T @ flat)
    return coefficients, rest, -flat.reshape(times.shape[0], logs.shape[0], values.shape[1])


def minimum(
    times: Float[Array, "times"],
    values: Float[Array, "times channels"],
    weights: Float[Array, "times"],
    damped: Float[Array, "modes"],
    tau: Float[Array, ""],
) -> DampedSinusoids:
    """Levenberg-Marquardt from one start; wrap in `vmap` for many.

    Differentiable in `values`: the derivative is that of the minimum, by the
    implicit function theorem.

    Args:
        times: Times, counted from where amplitudes are wanted.
        values: Channels side by side; they share Ω and τ.
        weights: 1 for a sample, 0 for padding, 1/σ² for a sample of its own error.
        damped: First guess of Ω.
        tau: First guess of τ.
    """
    start = jnp.log(jnp.append(damped, tau))
    span = jnp.max(jnp.where(weights > 0, times, 0.0))
    data = jax.lax.stop_gradient((times, values, weights))
    logs, converged = _descend(start, *data, span)
    logs = _implicit(jax.lax.stop_gradient(logs), times, values, weights)

    order = jnp.append(jnp.argsort(logs[:-1]), logs.shape[0] - 1)
    return _read(logs[order], times, values, weights, converged)


def _descend(start, times, values, weights, span):
    """Marquardt's search for log Ω, log τ, and whether it came to rest."""
    low = jnp.log(jnp.append(jnp.full(start.shape[0] - 1, 0.1 / span), 1e-3 * span))
    high = jnp.log(jnp.append(jnp.full(start.shape[0] - 1, 1e6 / span), 1e3 * span))

    def look(logs):
        _, rest, slope = project(logs, times, values, weights)
        gradient = jnp.einsum("tpc,tc->p", slope, rest)
        normal = jnp.einsum("tpc,tqc->pq", slope, slope)
        return jnp.sum(rest**2), gradient, normal

    floor = 1e-26 * jnp.sum(weights[:, None] * values**2)

    def going(state):
        _, _, _, steps, done = state
        return (steps < STEPS) & ~done

    def step(state):
        logs, (cost, gradient, normal), damping, steps, _ = state
        # Marquardt's own scaling, kept off zero for a mode without amplitude
        scale = jnp.diag(normal) + 1e-12 * jnp.max(jnp.diag(normal)) + 1e-300
        move = -jnp.linalg.solve(normal + jnp.diag(damping * scale), gradient)
        move = jnp.clip(jnp.where(jnp.isfinite(move), move, 0.0), -0.3, 0.3)
        trial = jnp.clip(logs + move, low, high)
        seen = look(trial)
        better = seen[0] < cost
        small = jnp.max(jnp.abs(trial - logs)) < TOLERANCE
        done = small | (better & (cost - seen[0] <= TOLERANCE * cost)) | (seen[0] <= floor) | (damping > 1e12)
        pick = lambda new, old: jnp.where(better, new, old)  # noqa: E731
        damping = jnp.where(better, jnp.maximum(damping / 5, 1e-12), damping * 4)
        return pick(trial, logs), jax.tree.map(pick, seen, (cost, gradient, normal)), damping, steps + 1, done

    state = (start, look(start), jnp.asarray(1e-2), jnp.asarray(0), jnp.asarray(False))
    logs, _, _, _, done = jax.lax.while_loop(going, step, state)
    return logs, done


@jax.custom_jvp
def _implicit(logs, times, values, weights):
    """The minimum as a function of the data: the identity, with the derivative of the condition `gradient = 0`."""
    return logs


@_implicit.defjvp
def _implicit_jvp(primals, tangents):
    logs, times, values, weights = primals

    def condition(logs, times, values, weights):
        _, rest, slope = project(logs, times, values, weights)
        return jnp.einsum("tpc,tc->p", slope, rest)

    _, change = jax.jvp(lambda *data: condition(logs, *data), (times, values, weights), tangents[1:])
    curvature = jax.jacfwd(condition)(logs, times, values, weights)
    return logs, -jnp.linalg.solve(curvature, change)


def _read(logs, times, values, weights, converged) -> DampedSinusoids:
    """All the numbers that belong to given log Ω, log τ."""
    coefficients, rest, slope = project(logs, times, values, weights)
    offset = coefficients[0]
    signal = jnp.sqrt(weights)[:, None] * (values - offset[None, :])
    power = jnp.sum(rest**2)
    count = jnp.sum(weights > 0) * values.shape[1] - coefficients.size - logs.shape[0]
    normal = jnp.einsum("tpc,tqc->pq", slope, slope)
    scale = jnp.sqrt(jnp.diag(normal)) + 1e-300
    curled = normal / (scale[:, None] * scale[None, :]) + RIDGE * jnp.eye(logs.shape[0])
    covariance = jnp.linalg.inv(curled) / (scale[:, None] * scale[None, :])
    return DampedSinusoids(
        damped=jnp.exp(logs[:-1]),
        tau=jnp.exp(logs[-1]),
        offset=offset,
        cosine=coefficients[1::2],
        sine=coefficients[2::2],
        residual=jnp.sqrt(power / jnp.maximum(jnp.sum(signal**2), 1e-300)),
        power=power,
        covariance=covariance * power / jnp.maximum(count, 1),
        converged=converged & jnp.all(jnp.isfinite(logs)) & jnp.isfinite(power),
    )

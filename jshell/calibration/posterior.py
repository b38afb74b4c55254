"""The posterior of a fit's constants, drawn by NUTS.

Likelihood: normal noise about the model; what enters linearly is integrated
out under a flat prior, which for a normal likelihood is the projection and the
determinant of the basis; where errors are scaled, the noise's variance is
drawn too, under Jeffreys' prior. Prior: flat in the logarithm of positive
constants and in k_VS (in k_VS², where only that is known), the fit's bounds,
and the priors the fit was given.

Source     Hoffman & Gelman 2014; sampler: NumPyro. Groups as ArviZ reads them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.objective import Objective
from jshell.calibration.problem import Problem, blocks
from jshell.calibration.rebuilt import objective_of
from jshell.calibration.result import Fit
from jshell.calibration.uncertainty import equal_tails
from jshell.errors import BadValue, require_extra
from jshell.io.records import write_groups


@dataclass(frozen=True)
class Posterior:
    """Draws.

    Attributes:
        names: The varied parameters.
        draws: (chains, draws, names).
        noise: (chains, draws) of the noise, in units of the weights' σ; ones where errors were given.
        diverging: (chains, draws) whether the sampler lost its way.
        r_hat: (names,) agreement of the chains, 1 at best.
        effective: (names,) draws that are worth an independent one.
        seed: Of the draws.
    """

    names: tuple[str, ...]
    draws: np.ndarray
    noise: np.ndarray
    diverging: np.ndarray
    r_hat: np.ndarray
    effective: np.ndarray
    seed: int

    @property
    def sound(self) -> bool:
        """Whether chains agree and none lost its way."""
        return bool(np.all(self.r_hat < 1.05) and not self.diverging.any())

    def interval(self, name: str, level: float | int = 0.95) -> tuple[float, float]:
        """Equal tails."""
        return equal_tails(self.draws[:, :, self.names.index(name)], level)

    def report(self, level: float | int = 0.95) -> str:
        """The intervals as text."""
        chains, draws = self.draws.shape[:2]
        lines = [f"[[Posterior, {chains} chains of {draws} draws, seed {self.seed}, {100 * level:g}%]]"]
        for i, name in enumerate(self.names):
            low, high = self.interval(name, level)
            lines.append(
                f"    {name}: {self.draws[:, :, i].mean():.6g} ± {self.draws[:, :, i].std():.4g}, "
                f"{low:.6g} to {high:.6g}, R̂ {self.r_hat[i]:.3f}, worth {self.effective[i]:.0f} draws"
            )
        if not self.sound:
            lines.append(f"    not to be trusted: {self.diverging.sum()} divergences, R̂ up to {self.r_hat.max():.3f}")
        return "\n".join(lines)

    def to_netcdf(self, path: str | Path) -> Path:
        """Write the groups `posterior` and `sample_stats`; `arviz.from_netcdf` reads them.

        Raises:
            MissingExtra: Without the extra `io`.
        """
        shape = ("chain", "draw")
        steps = {"chain": (("chain",), np.arange(self.draws.shape[0])),
                 "draw": (("draw",), np.arange(self.draws.shape[1]))}  # fmt: skip
        values = {name: (shape, self.draws[:, :, i]) for i, name in enumerate(self.names)}
        groups = {
            "posterior": steps | values | {"noise": (shape, self.noise)},
            "sample_stats": steps | {"diverging": (shape, self.diverging)},
        }
        return write_groups(path, groups, created_by="jshell")


def posterior(result: Fit, draws: int = 1000, *, warmup: int = 500, chains: int = 2, seed: int = 0) -> Posterior:
    """Draw from the posterior, starting at the fit.

    Args:
        result: Of a fit in this process.
        draws: Of each chain.
        warmup: Of each chain, before its draws.
        chains: One after the other.
        seed: Of the draws.

    Raises:
        MissingExtra: NumPyro is not installed.
        BadValue: A robust fit; fewer than 50 draws.
    """
    objective = objective_of(result)
    if objective.loss:
        raise BadValue("posterior", found="a robust fit", expected="least squares", remedy="Use bootstrap instead.")
    # unknowns in standard errors about the minimum, so that the sampler's first steps fit
    best = jnp.asarray(objective.best)
    half = _half(objective)
    size = best.size
    variance = objective.variance
    whole, sampling = size + (not objective.absolute), SamplerSettings(draws, warmup, chains, seed)
    found = drawn(_energy, whole, sampling, (objective, best, half, jnp.asarray(variance)))
    u = np.asarray(best) + found.z[..., :size] @ np.asarray(half).T
    noise = np.ones(found.z.shape[:2]) if objective.absolute else np.sqrt(variance) * np.exp(found.z[..., size])
    return summarised(objective.names, objective.shown(u), noise, found.diverging, seed)


@dataclass(frozen=True)
class SamplerSettings:
    """How much is drawn.

    Attributes:
        draws: Of each chain.
        warmup: Of each chain, before its draws.
        chains: One after the other.
        seed: Of the draws.

    Raises:
        BadValue: Fewer than 50 draws.
    """

    draws: int
    warmup: int
    chains: int
    seed: int

    def __post_init__(self) -> None:
        if self.draws < 50 or self.warmup < 50 or self.chains < 1:
            raise BadValue(
                "draws", found=f"{self.draws}, {self.warmup}, {self.chains}", expected="50, 50 and 1 at least",
                remedy="Ask more.",
            )  # fmt: skip


class Draws(NamedTuple):
    """What a sampler drew: z (chains, draws, size) about 0, and whether it lost its way (chains, draws)."""

    z: np.ndarray
    diverging: np.ndarray


def drawn(energy: Callable[[jax.Array, Any], jax.Array], size: int, sampling: SamplerSettings, data: Any) -> Draws:
    """What NUTS draws of numbers whose scale is about one, its chains begun near 0.

    Args:
        energy: At module level, so that one program serves all data of one form: z (size,) and data to minus the
            logarithm of the density; infinite where there is none.
        size: How many numbers.
        sampling: How much is drawn.
        data: Of the density.

    Raises:
        MissingExtra: NumPyro is not installed.
    """
    require_extra("numpyro", "bayes")
    keys = jax.random.split(jax.random.PRNGKey(sampling.seed), sampling.chains)
    first = jax.random.normal(jax.random.PRNGKey(sampling.seed + 1), (sampling.chains, size)) * 0.3
    chains = [_chain(energy, sampling.warmup, sampling.draws, key, z, data) for key, z in zip(keys, first, strict=True)]
    return Draws(*(np.stack([np.asarray(chain[k]) for chain in chains]) for k in range(2)))


@eqx.filter_jit
def _chain(energy: Callable, warmup: int, draws: int, key: jax.Array, first: jax.Array, data: Any) -> Any:
    """One chain's draws and where they lost their way: NumPyro's kernel in loops of our own, traced once.

    NumPyro's `MCMC` traces its model anew for every run on other data, and keeps what it traced.
    """
    from numpyro.infer.hmc import hmc

    begin, step = hmc(potential_fn_gen=lambda data: partial(energy, data=data), algo="NUTS")
    state = begin(first, warmup, model_args=(data,), rng_key=key)

    def again(state: Any, _: Any) -> tuple[Any, Any]:
        state = step(state, (data,))
        return state, (state.z, state.diverging)

    state, _ = jax.lax.scan(lambda state, _: (again(state, _)[0], None), state, length=warmup)
    return jax.lax.scan(again, state, length=draws)[1]


def summarised(
    names: tuple[str, ...], shown: np.ndarray, noise: np.ndarray, diverging: np.ndarray, seed: int
) -> Posterior:
    """Draws (chains, draws, names) with how far their chains agree."""
    from numpyro.diagnostics import effective_sample_size, gelman_rubin, split_gelman_rubin

    agreement = gelman_rubin if shown.shape[0] > 1 else split_gelman_rubin
    return Posterior(
        names, shown, noise, diverging,
        np.array([float(agreement(shown[..., i])) for i in range(len(names))]),
        np.array([float(effective_sample_size(shown[..., i])) for i in range(len(names))]), seed,
    )  # fmt: skip


def _half(objective: Objective) -> jax.Array:
    """A root of the covariance of the unknowns."""
    J = objective.linearised[1] / np.sqrt(max(objective.variance, 1e-300))
    values, vectors = np.linalg.eigh(J.T @ J)
    return jnp.asarray(vectors / np.sqrt(np.maximum(values, 1e-12 * values.max())))


def _energy(z: jax.Array, data: tuple[Objective, jax.Array, jax.Array, jax.Array]) -> jax.Array:
    """Minus the logarithm of the posterior, of z and, where it is drawn, of the logarithm of the noise.

    Infinite outside the bounds.
    """
    objective, best, half, variance = data
    u, log_noise = best + half @ z[: best.size], z[best.size :]
    r = objective.residual(u, objective.args)
    split = r.size - objective.priors
    chi_square, known = jnp.sum(r[:split] ** 2), jnp.sum(r[split:] ** 2)
    energy = 0.5 * known
    if log_noise.size:
        scale = jnp.exp(log_noise[0])
        energy += 0.5 * chi_square / (variance * scale**2)
        energy += (objective.count - objective.linear) * log_noise[0]
    else:
        energy += 0.5 * chi_square
    args = objective.args
    if isinstance(args[1], Problem):
        for basis, _ in blocks(args[0].constrained(u), args[1]):
            energy += 0.5 * jnp.linalg.slogdet(basis.T @ basis)[1]
    inside = jnp.all((u >= objective.parameters.low) & (u <= objective.parameters.high))
    return jnp.where(inside & jnp.isfinite(energy), energy, jnp.inf)

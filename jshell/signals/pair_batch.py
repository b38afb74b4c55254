"""Two damped sinusoids in each of many records at once.

    x(t) = offset + e^(-t/τ) Σ_m [C_m cos(Ω_m t) + S_m sin(Ω_m t)]

as `damped_pair` fits them one by one: starts from a matrix pencil, offsets and
amplitudes eliminated, a search over log Ω-, log Ω+, log τ. Here 64 records go
side by side and a step reads each record once.

Symbols    Ω damped angular frequency   ω undamped, ω² = Ω² + 1/τ²   τ decay time   m slow, fast
Valid for  even sampling; more than half a turn of the slow mode, fewer than half a turn of the fast one a sample
Source     Golub & Pereyra 1973; Kaufman 1975; Hua & Sarkar 1990
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.errors import BadShape, BadValue, Outcome
from jshell.signals.lane_search import CONVERGED, RUNNING, Evaluation, begin, descend
from jshell.signals.lanes import BLOCK, barrier, centred, lanewise, spreads, total
from jshell.signals.pencil import rates
from jshell.signals.pencil_batch import CELLS, poles
from jshell.signals.two_waves import explained
from jshell.signals.wave_sums import data_sums, gram, padded

TOGETHER = 16
ROUNDS = 12
FEWEST = 32
CLOSEST = 0.5  # modes nearer than this over τ are one mode
MAX_RETRIES = 256  # at most so many records that end badly are tried again one by one
MISFIT = 2.25  # what is left over the noise, squared, from which a record is tried again, and not described


@dataclass(frozen=True)
class Pairs:
    """Two damped sinusoids of every record.

    Attributes:
        omega: (rows, 2) undamped ω-, ω+; NaN unless the outcome is ok.
        tau: (rows,) decay times.
        stderr: (rows, 3) standard errors of ω-, ω+ and τ, from the residual as white noise.
        amplitude: (rows, 2) at the first sample.
        phase: (rows, 2) of A cos(Ωt + φ) [rad].
        offset: (rows,) rest values.
        residual: (rows,) rms of what is left over rms of the signal about its offset.
        outcome: (rows,) integers of `Outcome`: ok, not_converged or unusable_data.
        noise_ratio: (rows,) rms of what is left over the noise that sixth differences show.
    """

    omega: np.ndarray
    tau: np.ndarray
    stderr: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    offset: np.ndarray
    residual: np.ndarray
    outcome: np.ndarray
    noise_ratio: np.ndarray

    @property
    def described(self) -> np.ndarray:
        """(rows,) whether two modes are found and leave no more than half again the noise.

        Others hold more modes, a drift, decays of their own, or autocorrelated noise: `extract` says which.
        """
        return (self.outcome == Outcome.OK) & (self.noise_ratio**2 < MISFIT)


class Records(NamedTuple):
    """Records less their means, side by side; fields as `lane_search` reads them."""

    values: Float[Array, "1 times block"]
    count: Float[Array, " block"]
    power: Float[Array, " block"]


def evaluate(logs: Float[Array, "3 block"], data: Records) -> Evaluation:
    """Cost, gradient and normal matrix by log Ω-, log Ω+, log 1/τ, per sample."""
    always_true = data.count[0] >= 0

    def roots(logs):
        turn, decay = jnp.exp(logs[:2]), jnp.exp(logs[2])
        size = jnp.exp(-decay)
        return turn, decay, size * jnp.cos(turn), size * jnp.sin(turn)

    turn, decay, real, imag = barrier(roots, always_true, logs)
    d = data_sums(data.values, real, imag, always_true)[0]
    G, sums = gram(decay, turn, data.count, always_true)
    found = explained(turn, decay, d, G, always_true)
    cost = data.power - found.power
    sound = jnp.isfinite(cost) & (turn[1] < jnp.pi) & (decay < 3.0)
    return Evaluation(jnp.where(sound, cost, jnp.inf), found.gradient, found.normal, found.amplitudes, sums)


class BlockFit(NamedTuple):
    """How the search of a block ended: unknowns, look, status; offset, noise² from sixth differences, scatter²."""

    logs: Any
    cost: Any
    normal: Any
    linear: Any
    status: Any
    offset: Any
    noise: Any
    square: Any


def solve(values: Float[Array, "1 times block"], count: Float[Array, " block"], start, cell: int) -> BlockFit:
    """Fit a block; NaN starts come from the pencil."""
    always_true = count[0] >= 0
    y, mean = barrier(centred, always_true, values, count)
    square, noise = barrier(spreads, always_true, y, count)
    growth, turn = poles(y, count, jax.lax.rsqrt(jnp.maximum(square, 1e-300)), cell, always_true)
    decay = jnp.clip(-(growth[0] + growth[1]) / 2, 0.05 / count, 0.5)
    first_guess = jnp.log(jnp.maximum(jnp.stack([turn[0], turn[1], decay]), 1e-12))
    first = jnp.where(jnp.isnan(start), first_guess, start)
    data = Records(y, count, square[0] * count)
    low = jnp.log(jnp.stack([0.1 / count, 0.1 / count, 1e-3 / count]))
    high = jnp.log(jnp.stack([3.1 + 0 * count, 3.1 + 0 * count, 2.0 + 0 * count]))
    search = descend(begin(jnp.clip(first, low, high), data, evaluate), data, low, high, evaluate)
    at = search.evaluation
    offset = mean[0] - total(at.linear[i] * at.sums[i] for i in range(4)) / count
    return BlockFit(search.unknowns, at.cost, at.normal, at.linear, search.status, offset, noise[0], square[0])


@eqx.filter_jit
@lanewise
def _solve_blocks(values, count, start, cell: int, used) -> BlockFit:
    one = lambda given: solve(*given, cell)  # noqa: E731  # pyright: ignore[reportCallIssue]
    shapes = jax.eval_shape(one, (values[0], count[0], start[0]))
    nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
    body = lambda given: jax.lax.cond(given[0] < used, one, lambda _: nothing, given[1:])  # noqa: E731
    return jax.lax.map(body, (jnp.arange(start.shape[0]), values, count, start))


def extract_batch(
    step: float | int | np.ndarray,
    values: np.ndarray,
    counts: np.ndarray | None = None,
) -> Pairs:
    """Two damped sinusoids of every record, from a start that its own spectrum gives.

    Args:
        step: Time between samples, one for all or one per record.
        values: (rows, times) evenly sampled records, padded with anything to one length.
        counts: (rows,) samples of each; None reads all.

    Returns:
        One row per record. A record that is not finite, constant or shorter than 32 samples is `unusable_data`.

    Raises:
        BadShape: Not two axes.
        BadValue: A step that is not positive.

    Example:
        >>> import numpy as np
        >>> from jshell.signals import extract_batch
        >>> t = 0.1 * np.arange(400)
        >>> ring = np.exp(-t / 8) * (np.cos(t) + 0.4 * np.cos(1.7 * t + 1))
        >>> pairs = extract_batch(0.1, np.stack([3 + ring, 5 - 2 * ring]))
        >>> print(pairs.omega.round(4), pairs.tau.round(3))
        [[1.0078 1.7046]
         [1.0078 1.7046]] [8. 8.]
    """
    data = np.asarray(values, dtype=float)
    if data.ndim != 2:
        raise BadShape("values", found=f"shape {data.shape}", expected="(rows, times)", remedy="Stack the records.")
    rows, length = data.shape
    steps = np.broadcast_to(np.asarray(step, dtype=float), (rows,))
    if not np.all(steps > 0):
        raise BadValue("step", found=f"{steps.min():g}", expected="a number above 0", remedy="Check the times.")
    n = np.full(rows, length) if counts is None else np.asarray(counts, dtype=int)
    beyond = np.arange(length) >= n[:, None] if counts is not None else np.zeros((1, length), bool)
    with np.errstate(all="ignore"):
        clean = np.isfinite(np.where(beyond, 0.0, data).sum(axis=1))
    usable = clean & (n >= FEWEST) & np.any((data != data[:, :1]) & ~beyond, axis=1)

    found = _rounds(data, n, np.arange(rows), np.full((3, rows), np.nan), ~usable)
    with np.errstate(all="ignore"):
        left = _left(found, n)
    again = usable & ((found.status != CONVERGED) | ~(left < MISFIT))
    if 0 < again.sum() <= MAX_RETRIES:
        _with_care(found, data, n, np.flatnonzero(again))
    with np.errstate(all="ignore"):  # rows that failed hold anything; they are hidden below
        return _read(found, n, steps, usable)


def _left(found: BlockFit, n: np.ndarray) -> np.ndarray:
    """(rows,) what is left over the noise, squared."""
    return found.cost / np.maximum(n - 8, 1) / np.maximum(found.noise, 1e-8 * found.square)


def _rounds(data, n, chosen, starts, hopeless) -> BlockFit:
    """Fit chosen records from (3, chosen) starts until all rest."""
    found = _once(data, n, chosen, starts)
    for _ in range(ROUNDS - 1):
        left = np.flatnonzero((found.status == RUNNING) & ~hopeless[chosen])
        if not left.size:
            break
        for whole, part in zip(found, _once(data, n, chosen[left], found.logs[:, left]), strict=True):
            whole[..., left] = part
    return found


def _once(data, n, chosen, starts) -> BlockFit:
    length = data.shape[1]
    cell = max(1, 2 ** int(np.log2(max(1, length // CELLS))))
    together = TOGETHER if length <= 16384 else 1
    parts = []
    for at in range(0, chosen.size, BLOCK * together):
        mine = chosen[at : at + BLOCK * together]
        lanes = np.resize(mine, BLOCK * together).reshape(together, BLOCK)
        used = -(-mine.size // BLOCK)
        values = np.zeros((together, 1, padded(length), BLOCK))
        for block in range(used):
            values[block, 0, :length] = data[lanes[block]].T
        first = np.resize(starts[:, at : at + mine.size].T, (together * BLOCK, 3)).reshape(together, BLOCK, 3)
        found = _solve_blocks(values, n[lanes].astype(float), np.swapaxes(first, 1, 2), cell, np.asarray(used))
        flat = lambda x, k=mine.size: np.moveaxis(np.asarray(x), 0, -2).reshape(*x.shape[1:-1], -1)[..., :k]  # noqa: E731
        parts.append([flat(part) for part in found])
    return BlockFit(*(np.array(np.concatenate(part, axis=-1)) for part in zip(*parts, strict=True)))


def _with_care(found: BlockFit, data, n, rows) -> None:
    """Records that ended badly, from the rates of several truncation orders; the best ending is kept."""
    places, starts = [], []
    for row in rows:
        y, t = data[row, : n[row]], np.arange(float(n[row]))
        for pair in rates(t, (y / y.std())[None])[:6]:
            s: Any = pair[:2] if pair.size > 1 else np.append(pair, pair[0].real + 1.7j * pair[0].imag)
            turn, decay = np.sort(s.imag), max(-np.mean(s.real), 0.05 / n[row])
            places.append(row)
            starts.append(np.log([*turn, decay]))
    if not places:
        return
    chosen = np.array(places)
    more = _rounds(data, n, chosen, np.array(starts).T, np.zeros(len(data), bool))
    for row in rows:
        mine = np.flatnonzero(chosen == row)
        costs = np.where((more.status[mine] == CONVERGED) & np.isfinite(more.cost[mine]), more.cost[mine], np.inf)
        now = found.cost[row] if found.status[row] == CONVERGED else np.inf
        if mine.size and costs.min() < now * (1 - 1e-9):
            best = mine[int(np.argmin(costs))]
            for whole, part in zip(found, more, strict=True):
                whole[..., row] = part[..., best]


def _read(found: BlockFit, n: np.ndarray, steps: np.ndarray, usable: np.ndarray) -> Pairs:
    order = np.argsort(found.logs[:2], axis=0)
    turn = np.take_along_axis(np.exp(found.logs[:2]), order, axis=0)
    decay = np.exp(found.logs[2])
    apart = (turn[1] - turn[0] > CLOSEST * decay) & (turn[0] > decay) & (turn[0] * n > np.pi) & (turn[1] < 0.95 * np.pi)
    good = usable & (found.status == CONVERGED) & apart & np.isfinite(found.cost)
    outcome = np.where(good, int(Outcome.OK), int(Outcome.NOT_CONVERGED))
    outcome = np.where(usable, outcome, int(Outcome.UNUSABLE_DATA))

    omega = np.sqrt(turn**2 + decay**2) / steps
    safe = np.where(good, np.moveaxis(found.normal, -1, 0).T, np.eye(3)[:, :, None]).T
    covariance = np.linalg.inv(safe) * (found.cost / np.maximum(n - 8, 1))[:, None, None]
    slope = np.zeros((n.size, 3, 3))  # (ω-, ω+, τ) by the logarithms
    for m in range(2):
        slope[np.arange(n.size), m, order[m]] = turn[m] ** 2 / (omega[m] * steps) / steps
        slope[:, m, 2] = decay**2 / (omega[m] * steps) / steps
    slope[:, 2, 2] = -steps / decay
    with np.errstate(all="ignore"):
        stderr = np.sqrt(np.einsum("rij,rjk,rik->ri", slope, covariance, slope))
        amplitude = np.hypot(found.linear[0::2], found.linear[1::2])
        phase = np.arctan2(-found.linear[1::2], found.linear[0::2])
        residual = np.sqrt(found.cost / n / np.maximum(found.square, 1e-300))
        left = np.sqrt(_left(found, n))
    hide = lambda x: np.where(good.reshape(-1, *[1] * (x.ndim - 1)), x, np.nan)  # noqa: E731
    sort = lambda x: np.take_along_axis(x, order, axis=0).T  # noqa: E731
    return Pairs(
        hide(omega.T), hide(steps / decay), hide(stderr), hide(sort(amplitude)), hide(sort(phase)), hide(found.offset),
        hide(residual), outcome, hide(left),
    )  # fmt: skip

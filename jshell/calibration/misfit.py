"""Whether the model describes the records, and which of its modes they hold.

A misfit is motion that the model lacks: more is left than noise explains, or
what is left turns at one frequency or fades as a motion does. Noise that is merely
autocorrelated is told apart: its φ explains all of it.

Symbols    r weighted residual   φ memory of the noise
"""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from jshell.calibration.lengths import without_data
from jshell.calibration.losses import strict_coefficients
from jshell.calibration.noise import MISFIT, Noise, rough_share
from jshell.calibration.problem import Problem, Term
from jshell.calibration.records import Record
from jshell.calibration.sampling import noise_of
from jshell.oscillator.linear import matrices, squares, state_matrix
from jshell.signals import ring_down_start
from jshell.trace import Trace

EXPLAINED = 2.0  # within this factor a memory φ must predict what six differences leave of its noise
DRIFTS = 0.5  # share of what is left that a cubic in time takes, from which it is called a drift
IDENTIFIED = 50.0  # of one mode, in χ²: a mode fitted to noise alone takes about 20, and 30 once in a thousand


def rows_of(problem: Problem) -> list[tuple[int, int, slice]]:
    """Record, channel and rows of the residual, in its order."""
    found, at = [], 0
    for number, record in enumerate(problem.model.records):
        for channel in range(len(record.channels)):
            size = record.elapsed.size
            found.append((number, channel, slice(at, at + size)))
            at += size
    return found


def misfits(problem: Problem, r: np.ndarray, cut: list[Trace], noises: list[Noise], robust: bool) -> list[str]:
    """Where the model leaves clearly more than the noise, in words."""
    loss = problem.model.loss
    hint = "; the modal loss asks less of it" if loss == "strict" else ""
    texts = []
    for (number, channel, rows), noise in zip(rows_of(problem), noises, strict=True):
        one, trace = problem.model.records[number], cut[number]
        name = one.channels[channel]
        weight, values = np.asarray(one.weight[channel]), np.asarray(one.data[channel])
        used = weight > 0
        left = r[rows][used] / weight[used]
        rms, scatter = _size(left, robust), float(values[used].std())
        level = noise_of_channel(one, trace, channel)
        if rms <= 1e-5 * scatter:
            continue
        slow = _drift_in_words(np.asarray(one.elapsed)[used], left)
        more = level is not None and rms > MISFIT * level
        if more and noise.memory > 0 and name not in trace.sigma and _explained(rms, level, noise):
            continue
        if more:
            texts.append(
                f"misfit: the {loss} model leaves {100 * rms / scatter:.2g}% of the scatter of {name} "
                f"[{number + 1}], {rms / max(level or 0.0, 1e-300):.2g} times its noise: it does not describe this "
                "record, and the errors are too small" + slow + hint
            )
        elif noise.coherent:
            what = "turns at one frequency" if noise.peak < noise.envelope else "fades as a motion does"
            texts.append(
                f"misfit: what the {loss} model leaves of {name} [{number + 1}], {100 * rms / scatter:.2g}% of its "
                f"scatter, {what}, as noise does once in {1 / max(min(noise.peak, noise.envelope), 1e-99):.0e} "
                "records: it does not describe this record" + slow + hint
            )
    return texts


def drift_share(times: np.ndarray, left: np.ndarray) -> float:
    """Share of a residual's power that a slow drift takes: a cubic in time."""
    t = 2 * (times - times[0]) / (times[-1] - times[0]) - 1
    basis = np.linalg.qr(np.polynomial.legendre.legvander(t, 3))[0]
    power = float(left @ left)
    return float(np.sum((basis.T @ left) ** 2)) / power if power > 0 else 0.0


def _drift_in_words(times: np.ndarray, left: np.ndarray) -> str:
    """What is said where most of a residual is a drift; else nothing."""
    share = drift_share(times, left)
    if share < DRIFTS:
        return ""
    return (
        f"; {100 * share:.0f}% of that is a slow drift, which no shell has: take it off the record "
        "(jshell analyse --drift line finds it)"
    )


def _size(left: np.ndarray, robust: bool) -> float:
    """rms, or what it would be without outliers."""
    if robust:
        return float(1.4826 * np.median(np.abs(left)))
    return float(np.sqrt(np.mean(left**2)))


def noise_of_channel(one: Record, trace: Trace, channel: int) -> float | None:
    """Noise of a channel: given, or from its sixth differences; None where they hold none."""
    name = one.channels[channel]
    if name in trace.sigma:
        weight = np.asarray(one.weight[channel])
        return float(np.sqrt(np.mean(1 / weight[weight > 0] ** 2)))
    return noise_of(np.asarray(trace[name], dtype=float), np.asarray(trace.times, dtype=float)) or None


def _explained(rms: float, level: float | None, noise: Noise) -> bool:
    """Whether noise of this memory leaves what six differences of the record leave."""
    return not noise.coherent and bool(is_explained(rms, level or 0.0, noise.memory))


def is_explained(rms: Any, level: Any, memory: Any) -> Any:
    """The same of many: whether rms and the level from six differences fit together."""
    ratio = level**2 / (rms**2 * rough_share(memory))
    return (ratio > 1 / EXPLAINED**2) & (ratio < EXPLAINED**2)


def snaps(cut: list[Trace]) -> list[str]:
    """Windows that begin before the end of a snap."""
    texts = []
    for number, trace in enumerate(cut, 1):
        if np.any(~np.isfinite(np.asarray(next(iter(trace.channels.values()))))):
            continue
        begin = ring_down_start(trace)
        if begin is not None:
            texts.append(
                f"misfit: the window of trace {number} begins at t = {float(np.asarray(trace.times)[0]):.4g}, before "
                f"its ring-down at {begin:.4g}: the motion of a snap is not small; start there, or leave `start` out"
            )
    return texts


def mode_powers(term: Term, linear: list[np.ndarray], design: list[np.ndarray]) -> np.ndarray:
    """χ² that slow and fast mode take of one trace beyond what the other could take.

    The other may have another amplitude in each channel, another frequency and another decay.

    Args:
        term: The trace.
        linear: Linear parameters of its blocks.
        design: Weighted bases of its blocks.
    """
    powers, one = np.zeros(2), term.model.records[0]
    times = np.asarray(one.elapsed)
    if term.model.loss == "modal":
        for basis, c in zip(design, linear, strict=True):
            powers += _apart([basis[:, 1:3], basis[:, 3:5]], [c[1:3], c[3:5]], basis[:, :1], times)
        return powers
    values, vectors = np.linalg.eig(np.asarray(_motion(term._replace(model=without_data(term.model)))))
    oscillating = np.flatnonzero(np.imag(values) > 0)
    if oscillating.size < 2:
        return np.full(2, np.inf)  # overdamped: no mode to speak of
    start, basis, columns, amplitudes = linear[0][:4], design[0], [], []
    inverse = np.linalg.inv(vectors)
    for k in oscillating[np.argsort(np.abs(values[oscillating]))]:
        part, amplitude = vectors[:, k], 2 * (inverse[k] @ start)
        columns.append(basis[:, :4] @ np.stack([np.real(part), -np.imag(part)], axis=1))
        amplitudes.append(np.array([np.real(amplitude), np.imag(amplitude)]))
    for rows in (slice(times.size), slice(times.size, None)):
        powers += _apart([c[rows] for c in columns], amplitudes, basis[rows, 4:], times)
    return powers


@eqx.filter_jit
def _motion(term: Term) -> jax.Array:
    """The first-order matrix of a trace's oscillator."""
    one = term.model.records[0]
    return state_matrix(matrices(strict_coefficients(term.constants, term.model), one.state, one.conditions))


def _apart(
    columns: list[np.ndarray], amplitudes: list[np.ndarray], offsets: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Power of each mode's curve at right angles to the offsets, and to all curves of the other and its neighbours."""
    powers = []
    for k in range(2):
        curve = columns[k] @ amplitudes[k]
        near = times[:, None] * columns[1 - k]  # what another frequency or decay adds to the other mode
        other = np.concatenate([columns[1 - k], near, offsets], axis=1)
        left = curve - other @ np.linalg.lstsq(other, curve, rcond=None)[0]
        powers.append(float(left @ left))
    return np.array(powers)


def silent_directions(problem: Problem, values: np.ndarray, slopes: np.ndarray, which: int) -> list[np.ndarray]:
    """Relative changes of the free constants that leave the identified mode as it is.

    A mode shows its frequency, its decay and, where V and S are fitted, how much
    area goes with how much volume.

    Args:
        problem: The problem.
        values: (names,) all parameters.
        slopes: (names, free) how they follow the free ones.
        which: 0 where the slow mode is identified, 1 where the fast one is.
    """

    def shown(p: np.ndarray) -> np.ndarray:
        found = []
        for places, one in zip(problem.places, problem.model.records, strict=True):
            own = p[list(places)]
            V, P = (float(x) for x in one.state)
            kappa, nu = float(one.conditions.kappa), float(one.conditions.poisson_ratio)
            k2 = own[2] if problem.model.loss == "modal" else own[2] ** 2
            w2 = squares(V, P, own[0], own[1], k2, kappa, 0.5 / (1 - nu))[which]
            found += [w2, own[3] if problem.model.loss == "modal" else own[3] / own[0]]
            if problem.model.loss == "strict":
                found.append((w2 * own[0] / (4 * np.pi) * V - kappa * P) / own[2])  # S over V, from the equation of V
        return np.array(found)

    at = shown(values)
    columns = []
    for j in range(slopes.shape[1]):
        size = float(np.linalg.norm(slopes[:, j] * values)) or 1.0
        step = 1e-6 * size * slopes[:, j] / max(float(np.linalg.norm(slopes[:, j])), 1e-300)
        columns.append((shown(values + step) - shown(values - step)) / (2e-6 * np.maximum(np.abs(at), 1e-300)))
    J = np.stack(columns, axis=1)
    if not np.all(np.isfinite(J)):
        return []
    _, s, vt = np.linalg.svd(J, full_matrices=True)
    padded = np.append(s, np.zeros(max(0, J.shape[1] - s.size)))
    return [row for row, size in zip(vt, padded, strict=True) if size < 1e-6 * padded[0]]

"""Decaying waves about a background, fitted by variable projection on one orthogonal factor.

    x_c(t) = background_c(t) + Σ_m e^(-σ_m t) [C_mc cos(Ω_m t) + S_mc sin(Ω_m t)]

Background, C and S enter linearly. One QR factor of the basis, of its derivatives
and of the data together holds all that a step of the search needs: cost, gradient
and normal matrix follow from a triangle of a dozen rows, without the digits that
normal equations lose, and a record of any length passes through it block by block.

Symbols    Ω damped angular frequency   σ decay rate, 1/τ where all modes share it   ρ rate of a fading drift
Source     variable projection: Golub & Pereyra 1973, with Kaufman's Jacobian (1975)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

DRIFTS = ("none", "constant", "line", "exponential")
STEPS = 60
FLAT = 1e-13  # the last step when it promises less than this part of the cost
TOLERANCE = 1e-11  # or when it is shorter than this
LEAP = 0.5  # of an unknown in one step
BLOCK = 32768  # samples that are factored together: their columns stay in the cache
OWN = 5.0  # decay rates of one's own are counted in this over the span, so that a step of 0.3 is a cautious one
LONGEST, SHORTEST = 1e3, 1e-3  # of a decay time over the span


@dataclass(frozen=True)
class SignalModel:
    """What a record is taken to be made of.

    Attributes:
        modes: Number of waves.
        drift: Background: `none` (at zero), `constant`, `line`, or `exponential`, a constant and a fading term.
        own_decay: Whether every wave has a decay rate of its own, which may be growth; else they share one.
        kick: When the waves are excited anew, counted from the first sample.
    """

    modes: int
    drift: str = "constant"
    own_decay: bool = False
    kick: float | None = None

    @property
    def unknowns(self) -> int:
        """Numbers that enter nonlinearly."""
        return self.modes + (self.modes if self.own_decay else 1) + (self.drift == "exponential")

    @property
    def background(self) -> int:
        """Columns of the background."""
        return {"none": 0, "constant": 1, "line": 2, "exponential": 2}[self.drift]

    @property
    def columns(self) -> int:
        return self.background + 2 * self.modes * (1 if self.kick is None else 2)


@dataclass(frozen=True)
class SignalFit:
    """Where a search ended.

    Attributes:
        model: What was fitted.
        unknowns: log Ω of each mode, then log σ (or σ span/OWN of each mode), then log ρ.
        span: Length of the record.
        power: Sum of squares of what is left.
        linear: (columns, channels) background, then C and S of each mode.
        covariance: Of the unknowns, for independent errors of the size of what is left.
        at_rest: Whether the search came to rest.
    """

    model: SignalModel
    unknowns: np.ndarray
    span: float
    power: float
    linear: np.ndarray
    covariance: np.ndarray
    at_rest: bool

    @property
    def Omega(self) -> np.ndarray:
        return np.exp(self.unknowns[: self.model.modes])

    @property
    def sigma(self) -> np.ndarray:
        """(modes,) decay rates."""
        return _rates(self.model, self.unknowns, self.span)

    @property
    def amplitude(self) -> np.ndarray:
        """(modes, channels) at the first sample, before any second kick."""
        first = self.model.background
        waves = self.linear[first : first + 2 * self.model.modes]
        return np.hypot(waves[0::2], waves[1::2])

    def curve(self, elapsed: np.ndarray) -> np.ndarray:
        """(channels, times) of what was fitted."""
        return np.concatenate(
            [(_basis(self.model, self.unknowns, part, self.span)[0] @ self.linear).T for part in _parts(elapsed)],
            axis=1,
        )

    def background(self, elapsed: np.ndarray) -> np.ndarray:
        """(channels, times) of its background."""
        rate = np.exp(self.unknowns[-1]) if self.model.drift == "exponential" else 0.0
        columns = _background(self.model.drift, elapsed, self.span, rate)
        return (columns @ self.linear[: self.model.background]).T


def search(
    model: SignalModel,
    elapsed: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    start: np.ndarray,
    steps: int = STEPS,
) -> SignalFit:
    """Levenberg-Marquardt from one start.

    Args:
        model: What to fit.
        elapsed: Increasing times from 0.
        values: Channels that share their waves, of comparable size.
        start: Unknowns, as `SignalFit` has them.
        steps: At most so many.
    """
    span = float(elapsed[-1])
    low, high = _bounds(model, span, float(np.median(np.diff(elapsed))))
    unknowns = np.clip(start, low, high)
    cost, slope, rest, linear = evaluate(model, unknowns, elapsed, values, span)
    floor, damping, done = 1e-26 * float(np.sum(values**2)), 1e-3, False
    for _ in range(steps):
        gradient, normal = slope.T @ rest, slope.T @ slope
        free = ~((unknowns <= low) & (gradient > 0) | (unknowns >= high) & (gradient < 0))
        # Marquardt's own scaling, kept off zero for a mode without amplitude
        scale = np.diag(normal) + 1e-12 * np.max(np.diag(normal)) + 1e-300
        held = np.where(np.outer(free, free), normal, 0.0) + np.diag(np.where(free, damping * scale, 1.0))
        full = -np.linalg.solve(held, np.where(free, gradient, 0.0))
        full = np.where(np.isfinite(full), full, 0.0)
        trial = np.clip(unknowns + np.clip(full, -LEAP, LEAP), low, high)
        move = trial - unknowns
        promised = -float(2 * gradient @ move + move @ normal @ move)
        seen = evaluate(model, trial, elapsed, values, span)
        better = bool(seen[0] < cost)
        flat = promised <= FLAT * cost + floor and bool(np.all(np.abs(full) <= LEAP))
        done = flat or damping > 1e12 or bool(np.max(np.abs(move)) < TOLERANCE)
        if better:
            gained = (cost - seen[0]) / max(promised, 1e-300)
            unknowns, (cost, slope, rest, linear) = trial, seen
            damping = max(damping * (0.05 if gained > 0.5 else 0.5), 1e-12)
        else:
            damping = max(damping * 10, 1e-3)
        if done:
            break
    return _ended(model, unknowns, span, (cost, slope, linear), elapsed.size * values.shape[0], done)


def measured(solution: SignalFit, elapsed: np.ndarray, values: np.ndarray) -> SignalFit:
    """The same waves on other samples of the record, their linear part found anew."""
    span = float(elapsed[-1])
    unknowns = solution.unknowns.copy()
    if solution.model.own_decay:
        unknowns[solution.model.modes : 2 * solution.model.modes] *= span / solution.span
    cost, slope, _, linear = evaluate(solution.model, unknowns, elapsed, values, span)
    return _ended(solution.model, unknowns, span, (cost, slope, linear), values.size, solution.at_rest)


def _ended(model: SignalModel, unknowns: np.ndarray, span: float, found, count: int, done: bool) -> SignalFit:
    cost, slope, linear = found
    size = np.linalg.norm(slope, axis=0) + 1e-300
    inverse = np.linalg.pinv(slope / size, rcond=1e-13)
    freedom = max(count - linear.size - unknowns.size, 1)
    covariance = (inverse @ inverse.T) / np.outer(size, size) * cost / freedom
    # slow mode first
    order = np.argsort(unknowns[: model.modes])
    tail = np.arange(model.modes, unknowns.size)
    if model.own_decay:
        tail[: model.modes] = model.modes + order
    place = np.concatenate([order, tail])
    pairs = [model.background + 2 * m + k for m in order for k in (0, 1)]
    if model.kick is not None:
        pairs += [place + 2 * model.modes for place in pairs]
    rows = np.concatenate([np.arange(model.background), np.array(pairs, dtype=int)])
    good = done and bool(np.all(np.isfinite(unknowns)) and np.isfinite(cost))
    return SignalFit(model, unknowns[place], span, float(cost), linear[rows], covariance[np.ix_(place, place)], good)


def evaluate(model: SignalModel, unknowns: np.ndarray, elapsed: np.ndarray, values: np.ndarray, span: float):
    """Cost; Jacobian after Kaufman and residual, both on an orthonormal basis of what the background and waves leave;
    and the linear part."""
    lead, parts = model.columns, []
    for part, data in _parts(elapsed, values):
        B, T = _basis(model, unknowns, part, span)
        parts.append(np.linalg.qr(np.concatenate([B, T, data.T], axis=1), mode="r"))
    triangle: Any = parts[0] if len(parts) == 1 else np.linalg.qr(np.concatenate(parts), mode="r")
    channels = values.shape[0]
    tangents = triangle.shape[1] - lead - channels
    size = np.linalg.norm(triangle[:lead, :lead], axis=0) + 1e-300
    linear = np.linalg.lstsq(triangle[:lead, :lead] / size, triangle[:lead, -channels:], rcond=1e-13)[0] / size[:, None]
    rest = triangle[lead:, -channels:]
    weights = _tangent_weights(model, unknowns, span, linear)  # (tangents, unknowns, channels)
    slope = -np.einsum("kt,tpc->kcp", triangle[lead:, lead : lead + tangents], weights)
    flat = slope.reshape(-1, unknowns.size), rest.reshape(-1)
    return float(np.sum(rest**2)), *flat, linear


def linear_part(solution: SignalFit, elapsed: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(columns, channels) of other channels of the same record, at the waves of an ending."""
    return evaluate(solution.model, solution.unknowns, elapsed, values, solution.span)[3]


def _parts(elapsed: np.ndarray, values: np.ndarray | None = None) -> Iterator:
    for at in range(0, elapsed.size, BLOCK):
        part = elapsed[at : at + BLOCK]
        yield part if values is None else (part, values[:, at : at + BLOCK])


def _rates(model: SignalModel, unknowns: np.ndarray, span: float) -> np.ndarray:
    M = model.modes
    return unknowns[M : 2 * M] * OWN / span if model.own_decay else np.full(M, np.exp(unknowns[M]))


def _background(drift: str, elapsed: np.ndarray, span: float, rate: float) -> np.ndarray:
    columns = [] if drift == "none" else [np.ones(elapsed.size)]
    if drift == "line":
        columns.append(elapsed / span - 0.5)
    if drift == "exponential":
        columns.append(np.exp(-rate * elapsed))
    return np.stack(columns, axis=1) if columns else np.zeros((elapsed.size, 0))


def _basis(model: SignalModel, unknowns: np.ndarray, elapsed: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns of background and waves; and t times each wave and fading term, of which all derivatives are made."""
    M, Omega, sigma = model.modes, np.exp(unknowns[: model.modes]), _rates(model, unknowns, span)
    rate = np.exp(unknowns[-1]) if model.drift == "exponential" else 0.0
    B = [_background(model.drift, elapsed, span, rate)]
    T = []
    for since in (0.0,) if model.kick is None else (0.0, model.kick):
        t = (elapsed - since)[:, None]
        size, angle = np.exp(np.minimum(-t * sigma, 50.0)), t * Omega
        if since:
            size = np.where(t >= 0, size, 0.0)
        both = np.empty((elapsed.size, 2 * M))
        both[:, 0::2], both[:, 1::2] = size * np.cos(angle), size * np.sin(angle)
        B.append(both)
        T.append(t * both)
    if model.drift == "exponential":
        T.append((elapsed * np.exp(-rate * elapsed))[:, None])
    return np.concatenate(B, axis=1), np.concatenate(T, axis=1)


def _tangent_weights(model: SignalModel, unknowns: np.ndarray, span: float, linear: np.ndarray) -> np.ndarray:
    """What of each tangent column makes the derivative of the curve by each unknown, (tangents, unknowns, channels)."""
    M, first = model.modes, model.background
    Omega, sigma = np.exp(unknowns[:M]), _rates(model, unknowns, span)
    times = 1 if model.kick is None else 2
    fading = model.drift == "exponential"
    found = np.zeros((2 * M * times + fading, unknowns.size, linear.shape[1]))
    for k in range(times):
        for m in range(M):
            at = 2 * (M * k + m)
            C, S = linear[first + at], linear[first + at + 1]
            found[at, m], found[at + 1, m] = Omega[m] * S, -Omega[m] * C
            column = M + m if model.own_decay else M
            factor = OWN / span if model.own_decay else sigma[m]
            found[at, column], found[at + 1, column] = -factor * C, -factor * S
    if fading:
        found[-1, -1] = -np.exp(unknowns[-1]) * linear[1]
    return found


def _bounds(model: SignalModel, span: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    M = model.modes
    # a wave of more than half a turn a sample is one of fewer
    low, high = [np.log(0.1 / span)] * M, [np.log(0.97 * np.pi / step)] * M
    if model.own_decay:
        low, high = low + [-10 / OWN] * M, high + [1e3 / OWN] * M
    else:
        low, high = [*low, np.log(1 / (LONGEST * span))], [*high, np.log(1 / (SHORTEST * span))]
    if model.drift == "exponential":
        low, high = [*low, np.log(0.3 / span)], [*high, np.log(50 / span)]
    return np.array(low), np.array(high)

"""The best waves of a record without a first guess: enough starts to find the minimum.

Starts are the rates of a matrix pencil at several orders, peaks of the spectrum of
what fewer waves leave, and, for modes too near for either, one peak split in two.
The most promising of them are followed; others that end as well are kept, so that
two minima as good as each other can be told.

Symbols    s = -σ + iΩ rate of the pencil
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Float

from jshell.signals.pencil import rates
from jshell.signals.waves import OWN, SignalFit, SignalModel, evaluate, search

FOLLOWED = 4  # starts that are followed to their end, beside a split peak
HURRIED, MAX_FOLLOWED = 12, 2  # steps after which so many are followed on
PEAKS = 3
COARSE = 4096  # samples that a search needs at most; more are averaged in cells first
FINE = 8  # samples that a period keeps in cells
CLOSEST = 0.5  # modes nearer than this over τ must be told apart by their errors
APART = 4.0  # standard errors that they must lie apart then


def model_orders(
    elapsed: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    drift: str = "constant",
    *,
    most: int = 3,
) -> list[list[SignalFit]]:
    """Fits with one, two and three waves: for each number the endings, best first.

    Args:
        elapsed: Increasing times from 0.
        values: Channels, centred and of comparable size.
        drift: Background, as `SignalModel` has it.
        most: Waves of the last.

    Returns:
        A list for each number; the first holds at least one ending where the record oscillates, else all are empty.
    """
    identified = rates(elapsed, values)
    found: list[list[SignalFit]] = []
    for modes in range(1, most + 1):
        model = SignalModel(modes, drift)
        starts = _starts(model, identified, found, elapsed, values)
        if not starts:
            return [[]] * most
        found.append(followed(model, elapsed, values, starts))
    return [sorted(solutions, key=lambda one: (not sound(one, elapsed), one.power)) for solutions in found]


def followed(
    model: SignalModel, elapsed: np.ndarray, values: np.ndarray, starts: Sequence[np.ndarray]
) -> list[SignalFit]:
    """Endings of the most promising starts, best first, each minimum once."""
    span = float(elapsed[-1])
    costs = [evaluate(model, start, elapsed, values, span)[0] for start in starts]
    order = np.argsort(costs)[:FOLLOWED]
    solutions = distinct([search(model, elapsed, values, starts[k], HURRIED) for k in order])[:MAX_FOLLOWED]
    return distinct([one if one.at_rest else search(model, elapsed, values, one.unknowns) for one in solutions])


def distinct(solutions: Sequence[SignalFit]) -> list[SignalFit]:
    """Each minimum once, best first."""
    kept: list[SignalFit] = []
    for one in sorted(solutions, key=lambda one: one.power):
        if all(np.max(np.abs(one.unknowns - other.unknowns)) > 1e-4 for other in kept):
            kept.append(one)
    return kept


def sound(one: SignalFit, elapsed: np.ndarray) -> bool:
    """Whether the waves are apart, turn, and lie in the record's reach."""
    span, step = float(elapsed[-1]), float(np.median(np.diff(elapsed)))
    Omega, sigma = one.Omega, one.sigma
    good = one.at_rest and bool(np.all(Omega > np.abs(sigma)))
    good &= bool(Omega[0] * span > np.pi and Omega[-1] * step < 0.95 * np.pi)
    for m in range(1, Omega.size):
        gap, C = Omega[m] - Omega[m - 1], one.covariance
        slope = np.zeros(one.unknowns.size)
        slope[m], slope[m - 1] = Omega[m], -Omega[m - 1]
        error = np.sqrt(max(float(slope @ C @ slope), 0.0))
        good &= bool(gap > CLOSEST * abs(sigma[m]) or gap > APART * error)
    return good


def in_cells(elapsed: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A long record as averages of a few samples: an average of an exponential is the same exponential.

    Cells are never longer than an eighth of the shortest period that rises above the noise.
    """
    size = elapsed.size // COARSE
    if size < 2:
        return elapsed, values
    power = np.sum(np.abs(np.fft.rfft(values, axis=1)) ** 2, axis=0)[1:]
    # loud against the middle of the spectrum, and not its foot: a peak's own width counts with it
    loud = np.flatnonzero(power > max(60 * float(np.median(power)), 1e-9 * float(power.max())))
    highest = (loud[-1] + 1 if loud.size else 1) / elapsed.size  # periods per sample
    size = min(size, max(1, int(1 / (FINE * highest))))
    if size < 2:
        return elapsed, values
    whole = elapsed.size // size * size
    means = values[:, :whole].reshape(values.shape[0], -1, size).mean(axis=2)
    times = elapsed[:whole].reshape(-1, size).mean(axis=1)
    return times - times[0], means


def _starts(
    model: SignalModel,
    identified: list[np.ndarray],
    found: list[list[SignalFit]],
    elapsed: np.ndarray,
    values: np.ndarray,
) -> list[np.ndarray]:
    """Unknowns to start from."""
    modes, span = model.modes, float(elapsed[-1])
    rows: list[np.ndarray] = []

    def add(turns: Sequence[float], decay: float) -> None:
        rows.append(unknowns_of(model, turns, decay, span))

    if not found:
        for turn in peaks(elapsed, values):
            for decay in (1 / span, 4 / span):
                add([turn], decay)
    else:
        for base in found[-1][:2]:
            left = values - base.curve(elapsed)
            for turn in peaks(elapsed, left):
                add([*base.Omega, turn], base.sigma[0])
            if modes == 2:
                turn, decay = base.Omega[0], base.sigma[0]
                for apart in (0.2, 0.5, 1.2):  # widths of the peak
                    reach = apart * max(decay, 0.5 / span)
                    add([turn - reach / 2, turn + reach / 2], decay / 1.3)
    return [*starts_of(model, identified, span), *rows]


def starts_of(model: SignalModel, identified: list[np.ndarray], span: float) -> list[np.ndarray]:
    """Unknowns from the strongest rates of every order of a pencil."""
    return [
        unknowns_of(model, [s.imag for s in chosen], -float(np.mean([s.real for s in chosen])), span)
        for order in identified
        for chosen in combinations(order[: model.modes + 2], model.modes)
    ]


def unknowns_of(model: SignalModel, turns: Sequence[float], decay: float, span: float) -> np.ndarray:
    """Unknowns of waves that share a decay rate."""
    tail = [np.log(2 / span)] if model.drift == "exponential" else []
    return np.array(
        [*np.log(np.maximum(np.sort(turns), 0.5 / span)), np.log(np.clip(decay, 0.05 / span, 10 / span)), *tail]
    )


def peaks(elapsed: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Angular frequencies of the highest peaks of the spectrum, the highest first; at least one."""
    even = np.linspace(elapsed[0], elapsed[-1], elapsed.size)
    window = np.hanning(2 * elapsed.size)[elapsed.size :]  # a ring-down is loudest at its start
    power = np.zeros(2 * elapsed.size + 1)
    for channel in values:
        resampled = np.interp(even, elapsed, channel)
        power += np.abs(np.fft.rfft((resampled - resampled.mean()) * window, 4 * elapsed.size)) ** 2
    inner = power[1:-1]
    tops = np.flatnonzero((inner > power[:-2]) & (inner >= power[2:])) + 1
    tops = tops[tops >= 3]  # below three quarters of a turn nothing is told from a drift
    if not tops.size:
        tops = np.array([4])
    best = tops[np.argsort(-power[tops])][:PEAKS]
    return 2 * np.pi * best / (4 * float(elapsed[-1]) * elapsed.size / max(elapsed.size - 1, 1))


def start_with(base: SignalFit, model: SignalModel) -> np.ndarray:
    """Unknowns of another model that starts where one ended: of as many modes, with what else it asks for."""
    span, M = base.span, model.modes
    decay = base.sigma * span / OWN if model.own_decay else [np.log(max(float(np.mean(base.sigma)), 0.05 / span))]
    tail = [np.log(2 / span)] if model.drift == "exponential" else []
    return np.concatenate([base.unknowns[:M], decay, tail])


def refitted(base: SignalFit, elapsed: np.ndarray, values: np.ndarray, **changed) -> SignalFit:
    """The same waves with another background, decay rates of their own, or a second kick, from where they ended."""
    model = replace(base.model, **changed)
    return search(model, elapsed, values, start_with(base, model))

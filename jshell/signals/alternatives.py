"""What else a record may hold where damped waves of one decay do not describe it, each tried and weighed.

A drift, decays of the modes' own, a growing mode, a second kick, a further mode:
each adds a few numbers to the fit, and is worth its place where it takes away more
than noise could.

Symbols    χ² of what is left, weighed by the noise's law
Source     Schwarz 1978: a number more must gain the logarithm of the samples in χ²
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jshell.signals.pencil import rates
from jshell.signals.residual import Residual, examine
from jshell.signals.waves import STEPS, SignalFit, SignalModel, evaluate, search
from jshell.signals.waves_from_data import followed, model_orders, refitted, start_with, starts_of

TERM = 25.0  # of χ², for a term with one or two numbers: five standard errors
IDENTIFIED = 25.0  # of χ², for a mode; beside twice the logarithm of the samples, for the frequencies it could have had
KICKS = 48  # times at which a second kick is looked for
LONG = 0.6  # memory beyond which noise is not taken for granted
DRIFTING = ("line", "exponential")


@dataclass(frozen=True)
class Alternative:
    """Another description of a record.

    Attributes:
        kind: `line`, `exponential`, `own decay`, `kick` or `mode`.
        solution: The fit.
        gain: χ² that it takes away, or twice the log likelihood that it gains.
        needed: Gain that noise does not reach.
        noise: Of each channel, under it.
    """

    kind: str
    solution: SignalFit
    gain: float
    needed: float
    noise: tuple[Residual, ...]

    @property
    def describes(self) -> bool:
        """Whether it leaves noise only."""
        return not any(one.moves for one in self.noise)

    @property
    def significant(self) -> bool:
        return bool(self.gain > self.needed)


def of_mode(samples: int, channels: int) -> float:
    """Gain in χ² that a mode fitted to noise does not reach."""
    return IDENTIFIED + 2 * np.log(samples) + 3 * (channels - 1)


def chi_square(noise: Sequence[Residual], values: np.ndarray, solution: SignalFit, elapsed: np.ndarray) -> float:
    """χ² of what a fit leaves of all channels."""
    left = values - solution.curve(elapsed)
    return sum(one.chi_square(row) for one, row in zip(noise, left, strict=True))


def residuals(values: np.ndarray, solution: SignalFit, elapsed: np.ndarray) -> tuple[Residual, ...]:
    """The noise of every channel under a fit."""
    left = values - solution.curve(elapsed)
    return tuple(examine(row, solution.linear.shape[0] + solution.unknowns.size) for row in left)


def tried(
    base: SignalFit,
    noise: Sequence[Residual],
    elapsed: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    further: SignalFit | None,
    *,
    moves: bool,
) -> list[Alternative]:
    """The alternatives to a fit, the most telling first.

    Args:
        base: The fit.
        noise: Of each channel, under it.
        elapsed: Times from 0.
        values: Channels of comparable size.
        further: The fit with one mode more, where there is one.
        moves: Whether motion is left under it.
    """
    before = chi_square(noise, values, base, elapsed)
    found = []

    # what is left of a jump looks like noise of a long memory; where there is such, each fit has the noise it leaves
    long = any(one.memory > LONG for one in noise)

    def weigh(kind: str, solution: SignalFit, needed: float) -> None:
        own = residuals(values, solution, elapsed)
        gain = before - chi_square(noise, values, solution, elapsed)
        if long:
            gain = sum(one.cost for one in noise) - sum(one.cost for one in own)
        found.append(Alternative(kind, solution, gain, needed, own))

    if base.model.drift == "constant":
        for drift in DRIFTING:
            weigh(drift, refitted(base, elapsed, values, drift=drift), TERM)
    weigh("own decay", refitted(base, elapsed, values, own_decay=True), TERM)
    if further is not None:
        weigh("mode", further, of_mode(elapsed.size, values.shape[0]))
    # the two that take longest, where nothing simpler describes a record that is not described
    if (moves or long) and not any(one.describes and one.significant for one in found):
        if base.model.drift == "constant":
            for drift in DRIFTING:
                solutions = model_orders(elapsed, values, drift, most=base.model.modes)[-1]
                if solutions:
                    weigh(drift, solutions[0], TERM)
        if not any(one.describes and one.significant for one in found):
            weigh("kick", kicked(base, elapsed, values), 2 * of_mode(elapsed.size, values.shape[0]))
    # what takes most away comes first; a number more must pay for itself, and so must the time of a kick
    each = np.log(values.size)
    numbers = lambda one: one.solution.unknowns.size + one.solution.linear.size + (one.kind == "kick")  # noqa: E731
    return sorted(found, key=lambda one: each * numbers(one) - one.gain)


def kicked(base: SignalFit, elapsed: np.ndarray, values: np.ndarray) -> SignalFit:
    """The best fit in which the waves are excited anew at some time: coarse times first, then finer ones."""
    span = base.span
    short = max(1, elapsed.size // 512)  # where to look needs no more samples
    t, y = elapsed[::short], values[:, ::short]
    best: SignalFit | None = None
    # before a second kick the waves are those of a single one: frequencies from a part of the record
    for first, last in ((0, 0.12), (0, 0.2), (0, 0.4), (0.5, 1), (0, 1)):
        part = (t >= first * span) & (t <= last * span)
        if part.sum() < 40:
            continue
        plain = SignalModel(base.model.modes, base.model.drift)
        since, seen = t[part] - t[part][0], y[:, part]
        starts = [start_with(base, plain), *starts_of(plain, rates(since, seen), float(since[-1]))]
        alone = followed(plain, since, seen, starts)[0].unknowns
        trials = [(_cost_at(base, alone, at, t, y), at) for at in np.linspace(0.06, 0.94, KICKS) * span]
        at, reach = min(trials)[1], span / KICKS
        solution = _kicked_at(base, alone, at, t, y)
        if best is not None and solution.power > 4 * best.power:
            continue
        for _ in range(4):
            places = np.linspace(at - reach, at + reach, 9)
            places = places[(places > 0.03 * span) & (places < 0.97 * span)]
            at = min((_cost_at(base, solution.unknowns, place, t, y), place) for place in places)[1]
            solution = _kicked_at(base, solution.unknowns, at, t, y)
            reach /= 4
        if best is None or solution.power < best.power:
            best = solution
    assert best is not None
    assert best.model.kick is not None
    return _kicked_at(base, best.unknowns, best.model.kick, elapsed, values, STEPS)


def _kicked_at(
    base: SignalFit, unknowns: np.ndarray, at: float, t: np.ndarray, y: np.ndarray, steps: int = 8
) -> SignalFit:
    return search(SignalModel(base.model.modes, base.model.drift, kick=float(at)), t, y, unknowns, steps)


def _cost_at(base: SignalFit, unknowns: np.ndarray, at: float, t: np.ndarray, y: np.ndarray) -> float:
    return evaluate(SignalModel(base.model.modes, base.model.drift, kick=float(at)), unknowns, t, y, base.span)[0]

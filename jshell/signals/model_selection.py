"""How many modes a record needs, and whether they describe it.

What a fit leaves is compared with the noise that it shows itself (`residual`). A
second mode counts where it takes away more than a mode fitted to noise could. The
modes describe the record where they leave noise, autocorrelated or not, and where
neither a drift nor decays of their own, a second kick or a third mode would take
away more than noise allows.

Symbols    χ² of what is left, weighed by the noise's law   Ω damped frequency   σ decay rate
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jshell.signals.alternatives import DRIFTING, Alternative, chi_square, of_mode, residuals, tried
from jshell.signals.residual import Residual
from jshell.signals.sample_faults import LEVELS, SampleFaults
from jshell.signals.waves import LONGEST, SignalFit
from jshell.signals.waves_from_data import sound

VERDICTS = ("one", "two", "more than two", "misfit")
FINEST = 1e-6  # of a channel's scatter: what numbers of a file, or of a simulation, are not expected to be better than
TAKEN_AWAY = 0.3  # share of what two modes leave that a third must take where no description is complete
ROUNDED = 0.35  # of a digitised channel's step: rms up to which what is left may be its rounding
EQUAL = 4.0  # of χ²: two minima nearer than this are as good as each other
UNRESOLVED = 12.8  # of χ² of three numbers, one in two hundred by chance: for a mode so near the first that it beats
BEATS = 1.5  # times with it at most: there are hardly other frequencies that it could have had
BLURRED = 0.1  # error of ω+ - ω- over itself up to which χ² is a parabola about two such modes, and errors are errors
SURE = 1e-3  # relative error of ω+/ω- below which twice the slow frequency is no coincidence


@dataclass(frozen=True)
class Judgement:
    """What a record holds.

    Attributes:
        word: One of `VERDICTS`; None where nothing rises above the noise.
        solution: The waves it is read with: one where one is needed, else two.
        noise: Of each channel, under these.
        warnings: Why the numbers are not to be trusted.
        notes: What a reader may want to know besides.
    """

    word: str | None
    solution: SignalFit
    noise: tuple[Residual, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def judge(
    fits: list[list[SignalFit]],
    elapsed: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    names: Sequence[str],
    marks: Sequence[SampleFaults],
    begin: float,
    *,
    steps: np.ndarray,
) -> Judgement:
    """The verdict on a record.

    Args:
        fits: Endings with one, two and three modes, best first.
        elapsed: Times from the window's start.
        values: Channels of comparable size.
        names: Theirs.
        marks: Faults of their samples.
        begin: The window's start.
        steps: (channels,) steps of digitised channels, in units of `values`.
    """
    one, two, three = (solutions[0] for solutions in fits)
    law = residuals(values, min((one, two, three), key=lambda solution: solution.power), elapsed)
    chi = [chi_square(law, values, solution, elapsed) for solution in (one, two)]
    still = sum(part.chi_square(row) for part, row in zip(law, values, strict=True))
    needed = of_mode(elapsed.size, len(names))
    if still - chi[0] <= needed and still - chi[1] <= needed:
        return Judgement(None, one, law, (), ())
    base, word, further = (two, "two", three) if chi[0] - chi[1] > needed else (one, "one", None)
    if further is not None and not sound(further, elapsed):
        further = None
    noise = residuals(values, base, elapsed)
    left = np.sqrt(np.mean((values - base.curve(elapsed)) ** 2, axis=1))
    # rounding is no noise: of a digitised channel as much may be left as its steps make
    fine = (left <= FINEST) | (left <= ROUNDED * steps)
    moves = [part.moves and not small for part, small in zip(noise, fine, strict=True)]
    warnings, notes = _of_the_modes(base, elapsed), []
    blemished, channel_notes = _of_the_channels(marks, names)
    if not np.all(fine):
        others = tried(base, noise, elapsed, values, further, moves=any(moves))
        word, said = _weighed(word, base, noise, moves, values - base.curve(elapsed), others, names, begin)
        warnings = [*said, *warnings]
    if word == "one":
        likelier = [pair for pair in fits[1] if chi[0] - chi_square(law, values, pair, elapsed) > UNRESOLVED]
        warnings += _near_by(likelier, elapsed)
    if word in ("one", "two"):
        notes += _of_the_noise(noise, names)
    if word == "two":
        warnings += _other_minima(fits[1], noise, elapsed, values) + _blurred(two, elapsed)
        sure, text = _overtone(two)
        (warnings if sure else notes).extend(text)
    return Judgement(word, base, noise, tuple(warnings + blemished), tuple(notes + channel_notes))


def _weighed(
    word: str,
    base: SignalFit,
    noise: Sequence[Residual],
    moves: list[bool],
    left: np.ndarray,
    others: list[Alternative],
    names: Sequence[str],
    begin: float,
) -> tuple[str, list[str]]:
    """The verdict once the alternatives are known, and why."""
    telling = [other for other in others if other.significant]
    if not telling and not any(moves):
        return word, []
    cause = telling[0] if telling else None
    # where nothing tried describes the record, a third mode that takes a good part away is the plainest word
    mode = next((other for other in telling if other.kind == "mode"), None)
    if mode and cause and not cause.describes and mode.solution.power < (1 - TAKEN_AWAY) ** 2 * base.power:
        cause = mode
    level = np.array([part.level for part in (cause.noise if cause and cause.describes else noise)])
    rms = np.sqrt(np.mean(left**2, axis=1))
    worst = int(np.argmax(rms / level))
    count = "one mode leaves" if base.model.modes == 1 else "two modes leave"
    share, over = 100 * rms[worst], rms[worst] / level[worst]
    text = f"{count} {share:.2g}% of the scatter of {names[worst]}, {over:.3g} times its noise"
    if cause is None:
        return "misfit", [text + ", and nothing else that was tried describes it"]
    whole = "would describe it" if cause.describes else "would take away most, not all"
    if cause.kind == "mode":
        return "more than two", [f"{text}; a third mode at Ω = {_third(cause.solution, base):.4g} {whole}"]
    return "misfit", [f"{text}; {_in_words(cause, begin)} {whole}"]


def _in_words(cause: Alternative, begin: float) -> str:
    solution = cause.solution
    if cause.kind in DRIFTING:
        shape = "a straight drift" if cause.kind == "line" else "a drift that fades"
        if cause.kind == "exponential":
            shape += f" in {1 / np.exp(solution.unknowns[-1]):.4g}"
        return f'{shape} (drift="{cause.kind}")'
    if cause.kind == "kick":
        assert solution.model.kick is not None
        return f"a second kick at t = {begin + solution.model.kick:.4g} (end the window there)"
    if np.any(solution.sigma < 0):
        return "a mode that grows"
    return "decays of their own, τ = " + " and ".join(f"{1 / sigma:.4g}" for sigma in solution.sigma) + ","


def _third(more: SignalFit, base: SignalFit) -> float:
    """Frequency of the mode that the others are farthest from."""
    return float(max(more.Omega, key=lambda turn: np.min(np.abs(np.log(turn / base.Omega)))))


def _of_the_modes(base: SignalFit, elapsed: np.ndarray) -> list[str]:
    """What is wrong with the modes themselves."""
    texts, span, M = [], float(elapsed[-1]), base.model.modes
    turns = base.Omega[0] * span / (2 * np.pi)
    if turns < 1 and sound(base, elapsed):
        texts.append(f"the window holds less than a period: {turns:.2g} turns of the slow mode in the window")
    tau, error = 1 / base.sigma[0], np.sqrt(max(base.covariance[M, M], 0.0))
    if tau > 0.99 * LONGEST * span:
        texts.append("nothing decays: the decay time is at its bound")
    elif error > 0.5:
        texts.append(f"the decay time is not determined: τ = {tau:.3g} with a relative error of {error:.2g}")
    return texts


def _of_the_noise(noise: Sequence[Residual], names: Sequence[str]) -> list[str]:
    return [
        f"noise of {name} is autocorrelated, φ = {one.memory:.2f}: errors allow for it"
        for one, name in zip(noise, names, strict=True)
        if one.memory > 0
    ]


def _of_the_channels(marks: Sequence[SampleFaults], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Warnings and notes on the instrument."""
    warnings, notes = [], []
    for mark, name in zip(marks, names, strict=True):
        for value, count in mark.clipped:
            warnings.append(f"{name} is clipped at {value:.6g}: {count} samples")
        if mark.step and mark.levels < LEVELS:
            warnings.append(f"{name} is digitised in steps of {mark.step:.3g}, {mark.levels} levels only")
        elif mark.step:
            notes.append(f"{name} is digitised in steps of {mark.step:.3g}")
    return warnings, notes


def _near_by(pairs: Sequence[SignalFit], elapsed: np.ndarray) -> list[str]:
    """A second mode so near that the record is too short to tell, and so near that the first is moved by it."""
    for pair in pairs:
        beats = (pair.Omega[1] - pair.Omega[0]) * float(elapsed[-1]) / (2 * np.pi)
        if pair.at_rest and beats <= BEATS:
            first, second = np.hypot(pair.Omega, pair.sigma)
            both = f"ω = {first:.4g} and {second:.4g}"
            return [f"two modes close together are likelier than one, {both}, but not told apart"]
    return []


def _blurred(two: SignalFit, elapsed: np.ndarray) -> list[str]:
    """Two modes so close together that their errors are no measure of what is left open."""
    apart, C = two.Omega[1] - two.Omega[0], two.covariance
    slope = np.array([-two.Omega[0], two.Omega[1]])  # of the difference, by log Ω
    error = float(np.sqrt(max(slope @ C[:2, :2] @ slope, 0.0)))
    if apart * float(elapsed[-1]) > 2 * np.pi * BEATS or error <= BLURRED * apart:
        return []
    text = f"ω+ - ω- = {apart:.2g} ± {error:.1g}: two modes hardly told apart, whose errors may be much larger"
    return [f"{text}; a longer or quieter record tells"]


def _other_minima(solutions: Sequence[SignalFit], noise, elapsed, values) -> list[str]:
    """Another pair that describes the record as well."""
    best = solutions[0]
    chi = chi_square(noise, values, best, elapsed)
    for other in solutions[1:]:
        if not sound(other, elapsed):
            continue
        error = np.sqrt(np.maximum(np.diag(best.covariance), 1e-300))
        apart = np.max(np.abs(other.unknowns - best.unknowns) / error) > 3
        if apart and chi_square(noise, values, other, elapsed) - chi < EQUAL:
            first, second = np.hypot(other.Omega, other.sigma)
            return [f"another pair describes the record as well: ω− = {first:.5g}, ω+ = {second:.5g}"]
    return []


def _overtone(two: SignalFit) -> tuple[bool, list[str]]:
    """Whether the fast mode is the slow one's overtone, and whether that is sure."""
    C, ratio = two.covariance, two.Omega[1] / two.Omega[0]
    error = np.sqrt(max(C[0, 0] + C[1, 1] - 2 * C[0, 1], 0.0))  # of log Ω+/Ω-
    if abs(np.log(ratio / 2)) > 3 * error:
        return False, []
    text = f"ω+ is twice ω− within its error, ratio {ratio:.4f} ± {ratio * error:.4f}: "
    text += "an overtone of a large motion, no mode of its own"
    return bool(error < SURE), [text]


def by_share(residuals: Sequence[float], noise: float) -> str:
    """The former rule: modes are enough where they leave less than a twentieth of the signal or 1.3 times the noise, or
    where no further mode takes away 30 % of what they leave."""
    for count, so_far in enumerate(residuals):
        worth = so_far > 0.05 and so_far > 1.3 * noise
        further = min(residuals[count + 1 :], default=so_far)
        if not (worth and further < (1 - TAKEN_AWAY) * so_far):
            return VERDICTS[count]
    return "more than two"

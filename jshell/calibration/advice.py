"""What is said of a trace fit: what its data leave open, what would fix that, how it was done."""

import jax.numpy as jnp
import numpy as np

from jshell.calibration.estimate import Estimate
from jshell.calibration.frequency_model import square_only
from jshell.calibration.joint import Joint
from jshell.calibration.least_squares import SolverResult
from jshell.calibration.linearization import Linearization
from jshell.calibration.losses import Problem
from jshell.calibration.misfit import HEARD, mode_powers
from jshell.calibration.noise import Noise
from jshell.calibration.parameters import Unknowns
from jshell.calibration.robust import Robust
from jshell.calibration.sampling import sampling
from jshell.calibration.uncertainty import in_words
from jshell.errors import Outcome
from jshell.trace import Trace


def moves(direction: np.ndarray, varied: tuple[str, ...]) -> bool:
    """Whether a free direction moves a constant, not only amplitudes."""
    return bool(np.abs(direction[: len(varied)]).max() > 1e-6)


def advice(direction: np.ndarray, varied: tuple[str, ...], problem: Problem) -> str:
    text = in_words(direction, varied)
    if problem.loss == "modal":
        return (
            f"{text} changes neither ω-, ω+ nor τ of these traces: fix alpha2, or add a trace at a second "
            "pressure, or fit V and S by the strict loss"
        )
    return f"{text} changes nothing in these traces: fix one of them, or add a trace at a second pressure"


def remedy(problem: Problem, cut: list[Trace], quiet: list[str]) -> str:
    """What data would fix a direction that is known badly."""
    texts = list(quiet)
    span = max(float(np.ptp(np.asarray(trace.times))) for trace in cut)
    slow = min(float(jnp.sqrt(9 * jnp.pi**2 / 8) / one.state.volume) for one in problem.records)  # area alone, α2 = 1
    if span * slow < 2 * np.pi:
        texts.append(f"the longest record, {span:.3g} time units, holds about one period or less")
    texts.append("take a longer or cleaner record in which both modes ring, add a second pressure, or fix one of them")
    return "; ".join(texts)


def quiet_modes(
    joint: Joint, found: Linearization, reduced: float, absolute: bool, noises: list[Noise]
) -> tuple[list[str], int]:
    """Modes that no trace holds, in words, and the louder of the two."""
    total, at = np.zeros(2), 0
    for piece in joint.pieces(found.values):
        count = 1 if joint.problem.loss == "strict" else len(piece.problem.records[0].channels)
        total += mode_powers(piece, found.linear[at : at + count], found.design[at : at + count])
        at += count
    louder = max((1 + one.memory) / (1 - one.memory) for one in noises)
    level = (1.0 if absolute else max(reduced, 1e-300)) * louder
    texts = [
        f"the {which} mode is not heard above the noise (its χ² is {power / level:.0f}, {HEARD:g} are needed)"
        for which, power in zip(("slow", "fast"), total, strict=True)
        if power < HEARD * level
    ]
    return texts, int(np.argmax(total))


def sign_of_coupling(problem: Problem, space: Unknowns, estimates: list[Estimate]) -> list[str]:
    """What is to be said of the sign of k_VS."""
    if problem.loss == "modal":
        return [square_only(space)]
    return [
        f"the sign of {e.name} is open: {e.value:+.3g} is {abs(e.value / e.stderr):.1f} standard errors from 0"
        for e in estimates
        if e.name.startswith("k_vs") and e.role == "constant" and np.isfinite(e.stderr) and abs(e.value) < 2 * e.stderr
    ]


def other_minima(ending: SolverResult, space: Unknowns, same: np.ndarray) -> list[str]:
    """Minima above the best one in which starts ended."""
    cost, outcome = np.asarray(ending.cost), np.asarray(ending.outcome)
    ended = ((outcome == Outcome.OK) | (outcome == Outcome.AT_BOUND)) & ~same & np.isfinite(cost)
    lowest, texts = cost[same].min() if same.any() else np.nan, []
    while ended.any():
        first = int(np.argmin(np.where(ended, cost, np.inf)))
        alike = ended & (np.abs(cost - cost[first]) <= 1e-4 * cost[first])
        values = np.asarray(space.natural(np.asarray(ending.unknowns)[first]))
        told = ", ".join(
            f"{name} = {v:.4g}"
            for name, v in zip(space.names, space.reported(values), strict=True)
            if name in space.free
        )
        where = " at k_VS = 0" if "k_vs" in space.squared and "k_vs = 0," in told + "," else ""
        times = f"{cost[first] / lowest:.4g} times" if lowest > 0 else f"{cost[first]:.3g} against 0, not"
        texts.append(f"{alike.sum()} starts ended in another minimum{where}, {times} the lowest χ²: {told}")
        ended &= ~alike
    return texts


def method_notes(problem: Problem, joint: Joint, absolute: bool, robust: Robust | None) -> list[str]:
    notes = []
    if problem.loss == "strict" and problem.tied:
        notes.append("beta2 is tied to beta1 so that both modes decay alike")
    if not absolute:
        notes.append("each channel is weighed by its own noise, estimated from sixth differences")
    if len(joint.prior_at):
        names = ", ".join(joint.names[i] for i in joint.prior_at)
        notes.append(f"priors are held for {names}; their rows are not scaled and not counted as data")
    if robust is not None:
        light = sum(int(np.sum(weights < 0.5)) for weights in robust.weights)
        notes.append(f"robust loss {robust.kind}: {light} samples count less than half; χ² counts all in full")
    return notes


def sampling_notes(cut: list[Trace], absolute: bool) -> list[str]:
    """How traces are sampled that are no even grid as they stand; alike ones once."""
    found: dict[str, list[str]] = {}
    for number, trace in enumerate(cut, 1):
        taken = sampling(np.asarray(trace.times, dtype=float))
        words = taken.words()
        if not (taken.even or absolute):
            words += "; sixth differences are divided ones, of samples without a gap between them"
        if words:
            found.setdefault(words, []).append(str(number))
    return [f"trace {', '.join(numbers)}: {words}" for words, numbers in found.items()]

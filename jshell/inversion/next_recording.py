"""What would tell: how well the unknowns would be known with one more recording.

A recording that was not made is taken to ring as strongly as the first, with its noise and its sampling, at numbers of
the shell of one's choice; what it would tell (Fisher's information) is added to what is known. In a channel that the
first has not, the noise is as large beside what the channel moves as it is there.

Symbols    J Jacobian of a recording, its amplitudes following   s² variance of the weighted residual
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jshell.errors import Outcome, choose
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Modal, project
from jshell.inversion.recording import together
from jshell.inversion.response import ACROSS, CHANNELS, ECHO
from jshell.inversion.search import SearchResult

RECORD = ("channels", "samples", "length")  # of a candidate, beside numbers of the shell
STILL = 1e-9  # of the largest move
PRESSURES = (0.95, 1.05, 1.2)  # of the first recording's, among the usual candidates


@dataclass(frozen=True)
class Prospect:
    """What one more recording would bring.

    Attributes:
        change: Numbers of the shell that it would be made at, and `channels`, `samples` or `length` of the record.
        stderr: Name of an unknown to its relative standard error then (absolute of those sought as they are).
        outcome: ok, or why there is no such recording.
    """

    change: Mapping[str, Any]
    stderr: Mapping[str, float]
    outcome: Outcome

    def words(self) -> str:
        """What is otherwise than in the first recording."""
        parts = []
        for name, value in self.change.items():
            listed = "+".join([value] if isinstance(value, str) else value) if name == "channels" else f"{value:.4g}"
            parts.append(listed if name == "channels" else f"{name} {listed}")
        return ", ".join(parts) or "the same again"


class Prospects(tuple[Prospect, ...]):
    """What each of several recordings would bring, and what is known without.

    Attributes:
        now: Name of an unknown to its standard error as it is, as `Prospect.stderr`.
    """

    now: Mapping[str, float]

    def __new__(cls, found: Iterable[Prospect], now: Mapping[str, float]) -> "Prospects":
        made = super().__new__(cls, found)
        made.now = now
        return made

    def report(self) -> str:
        """A table; what would tell most of the first unknown stands first."""
        names = list(self.now)
        ranked = sorted(self, key=lambda one: np.nan_to_num(one.stderr[names[0]], nan=np.inf))
        rows = [("as it is", self.now, Outcome.OK), *((one.words(), one.stderr, one.outcome) for one in ranked)]
        width = max(len(words) for words, _, _ in rows)
        lines = [
            "[[Standard errors with one more recording]] relative; absolute of kappa, poisson_ratio, pad, weak_spot",
            f"    {'':{width}}  " + "  ".join(f"{name:14}" for name in names).rstrip(),
        ]
        for words, stderr, outcome in rows:
            numbers = "  ".join(f"{stderr[name]:<{max(14, len(name))}.3g}" for name in names).rstrip()
            lines.append(f"    {words:{width}}  {numbers if outcome == Outcome.OK else outcome.word}")
        return "\n".join(lines)

    def record(self) -> dict[str, Any]:
        """The table as a JSON object; missing numbers are null."""
        finite = lambda row: {name: float(x) if np.isfinite(x) else None for name, x in row.items()}  # noqa: E731
        rows = [{"change": dict(p.change), "stderr": finite(p.stderr), "outcome": p.outcome.word} for p in self]
        return {"now": finite(self.now), "prospects": rows}


def next_recording(
    model: Model,
    best: SearchResult,
    weighings: Sequence[Weighing],
    covariance: np.ndarray,
    candidates: Sequence[Mapping[str, Any]] | None,
) -> Prospects:
    """How well the unknowns would be known with each of several further recordings.

    Args:
        model, best, weighings: Of the inversion.
        covariance: (unknowns, unknowns) of what the solver sees.
        candidates: Each the numbers that are otherwise than in the first recording, such as `outer_pressure`; also
            `channels`, a name or several, `samples`, their number, and `length`, in lengths of the first. None takes
            the usual ones: channels alone, three outer pressures, twice the rate, twice the length.
    """
    known, names = np.linalg.pinv(covariance), model.parameters.names
    listed = usual(model, best.u) if candidates is None else candidates
    now = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    return Prospects((_prospect(model, best, weighings[0], known, one) for one in listed), now)


def usual(model: Model, u: np.ndarray) -> list[dict[str, Any]]:
    """What a laboratory would think of."""
    first = model.recordings[0]
    count, pressure = first.times.size, model.parameters.known[0].get("outer_pressure")
    found: list[dict[str, Any]] = [{}, {"samples": 2 * count}, {"samples": 2 * count, "length": 2.0}]
    held = model.seen(0, u)[0].held  # where nothing holds a shell its poles have no origin
    found += [{"channels": name} for name in ("H", "W", tuple(ACROSS), "V", "S", *(["x_front"] if held else []), ECHO)]
    return found + ([] if pressure is None else [{"outer_pressure": share * pressure} for share in PRESSURES])


def _prospect(
    model: Model, best: SearchResult, weighing: Weighing, known: np.ndarray, change: Mapping[str, Any]
) -> Prospect:
    names, first = model.parameters.names, model.recordings[0]
    for name in change:
        choose("candidate", name, (*model.parameters.table, *RECORD), noun="number of a recording")
    numbers = {name: value for name, value in change.items() if name in model.parameters.table}
    for name in numbers:
        choose(
            "candidate",
            name,
            model.parameters.known[0],
            noun="known number",
            remedy="What is unknown cannot be chosen.",
        )
    wanted = change.get("channels", first.channels)
    wanted = (wanted,) if isinstance(wanted, str) else tuple(wanted)
    for name in wanted:
        choose("candidate, channels", name, CHANNELS, noun="channel")
    together("candidate, channels", wanted)
    more = (*first.channels, *(name for name in wanted if name not in first.channels))
    whole = replace(model.parameters, known=(model.parameters.known[0] | numbers, *model.parameters.known[1:]))
    other = replace(model, parameters=whole, recordings=(replace(first, channels=more), *model.recordings[1:]))
    near = other.standing(best.u)[0]
    modal, slope, outcomes = other.modal(0, best.u, near)
    chosen = list(weighing.modes)
    outcome = Outcome(max(int(near.outcome), int(np.max(outcomes[chosen]))))
    if outcome != Outcome.OK:
        return Prospect(change, dict.fromkeys(names, float("nan")), outcome)
    span = (first.times[-1] - first.times[0]) * change.get("length", 1.0)
    elapsed = np.linspace(0.0, span, int(change.get("samples", first.times.size)))
    # as large a swing as that of the first recording
    waves = modal.shapes[chosen][:, :, None] * np.exp(np.multiply.outer(modal.rates[chosen], elapsed))[:, None]
    moves = np.real(np.tensordot(best.projections[0].amplitudes, waves, 1))
    seen, swing = len(first.channels), np.abs(best.projections[0].curve - first.level[:, None]).max(axis=1)
    moves *= swing.max() / np.abs(moves[:seen]).max()
    share = float(np.median(weighing.sigma / swing))
    sigma = np.concatenate([weighing.sigma, share * np.abs(moves[seen:]).max(axis=1)])
    pick = [more.index(name) for name in wanted]
    size = np.abs(moves[pick]).max(axis=1)
    still = size < STILL * np.abs(moves[:seen]).max()  # a pole that a pad holds
    picked = Modal(modal.rates[chosen], modal.shapes[chosen][:, pick], modal.rest[pick])
    slopes = Modal(slope.rates[:, chosen], slope.shapes[:, chosen][:, :, pick], slope.rest[:, pick])
    memory = np.full((len(pick), elapsed.size), np.median(weighing.memory))
    weight = np.where(still, 0.0, 1 / np.where(still, 1.0, sigma[pick]))
    free = weighing.free_rest or ECHO in wanted
    found = project(elapsed, picked.rest[:, None] + moves[pick], weight, memory, picked, slopes, free)
    covariance = np.linalg.pinv(known + found.jacobian.T @ found.jacobian)
    return Prospect(change, dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)), outcome)

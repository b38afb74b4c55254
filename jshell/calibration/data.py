"""Traces as a fit takes them in: window, channels, σ and weights, and what is refused of them."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jshell.calibration.agreement import refuse_disagreement
from jshell.calibration.sampling import noise_of
from jshell.errors import BadName, BadShape, BadValue, Outcome
from jshell.shell.parameters import Reduced
from jshell.signals import MEASURED, ring_down_start
from jshell.trace import Trace, traces_of

SMALLEST_NOISE = 1e-3  # of a channel's scatter: cleaner records are all weighed alike


def conditions_of(trace: Trace, number: int) -> Reduced:
    """The conditions of a trace.

    Raises:
        BadValue: It has none.
    """
    if trace.conditions is None:
        raise BadValue(
            f"trace {number}",
            found="no conditions",
            expected="thickness, pressures and viscosity of the shell",
            remedy="Build the trace with conditions=Reduced(…).",
        )
    return trace.conditions


def with_sigma(traces: Sequence[Trace], names: Sequence[str]) -> bool:
    """Whether the errors of the data are known.

    Raises:
        BadValue: They are for some channels and not for others.
    """
    given = [name in trace.sigma for trace in traces for name in names]
    if any(given) and not all(given):
        raise BadValue("sigma", found="σ for some channels", expected="for all or none", remedy="Complete it.")
    return all(given)


def windowed(
    traces: Trace | Sequence[Trace],
    start: float | None,
    stop: float | None,
    *,
    drop: Sequence[tuple[float, float]] = (),
    missing: str = "refuse",
) -> list[Trace]:
    """The traces inside the window, each with its conditions; samples left out are NaN.

    Args:
        traces: One or several.
        start, stop: The window.
        drop: Spans of time whose samples are left out.
        missing: What becomes of samples that are NaN: `refuse` or `drop`.

    Raises:
        BadValue: No conditions, or fewer than 16 samples, or numbers that are not finite.
        UnusableData: A record that cannot be of its shell.
    """
    found = []
    for number, trace in enumerate(traces_of(traces), 1):
        conditions_of(trace, number)
        # a record that holds a snap is read from its ring-down on: the motion before it is not small
        cut = trace.between(ring_down_start(trace) if start is None else start, stop)
        times = np.asarray(cut.times)
        if times.size < 16 or not np.all(np.diff(times) > 0):
            raise BadShape(
                f"trace {number}",
                found=f"{times.size} samples in the window",
                expected="at least 16, at increasing times",
                remedy="Widen the window.",
            )
        refuse_disagreement(cut, number)
        found.append(_without(cut, number, drop, missing))
    return found


def refuse_missing(
    trace: Trace,
    number: int,
    channels: Iterable[str],
    *,
    missing: str = "refuse",
    remedy: str = 'Leave such samples out with missing="drop".',
) -> None:
    """Refuse a trace with samples that are no numbers.

    Args:
        trace: Inside its window.
        number: Of the trace, for messages.
        channels: Those to look at.
        missing: `drop` refuses a channel that a failed run left without any number, and no other.
        remedy: What to try.

    Raises:
        BadValue: Naming the channel and its first such sample.
    """
    for name in channels:
        values = np.asarray(trace[name], dtype=float)
        wrong = ~np.isfinite(values)
        if wrong.all() and trace.outcome != Outcome.OK:
            ended = Outcome(int(trace.outcome))
            raise BadValue(
                f"trace {number}, channel {name!r}",
                found=f"no numbers: the run that made it ended with outcome {ended.word}",
                expected="numbers",
                remedy=f"{ended.advice.capitalize()}.",
            )
        if wrong.any() and missing == "refuse":
            raise BadValue(
                f"trace {number}, channel {name!r}, sample {int(np.argmax(wrong)) + 1} of the window",
                found=f"{float(values[np.argmax(wrong)])}",
                expected="numbers",
                remedy=remedy,
            )


def _without(trace: Trace, number: int, drop: Sequence[tuple[float, float]], missing: str) -> Trace:
    """The trace with NaN in the spans to drop; refused where it holds NaN of its own."""
    refuse_missing(trace, number, trace.channels, missing=missing)
    if not drop and missing == "refuse":
        return trace
    times = np.asarray(trace.times, dtype=float)
    lost = np.zeros(times.size, dtype=bool)
    for first, last in drop:
        lost |= (times >= first) & (times <= last)
    channels = {}
    for name, values in trace.channels.items():
        numbers = np.asarray(values, dtype=float)
        channels[name] = np.where(lost | ~np.isfinite(numbers), np.nan, numbers)
        if np.isfinite(channels[name]).sum() < 16:
            raise BadValue(
                f"trace {number}, channel {name!r}",
                found=f"{np.isfinite(channels[name]).sum()} samples left",
                expected="at least 16",
                remedy="Drop less.",
            )
    return Trace(trace.times, channels, trace.conditions, trace.sigma, trace.outcome, trace.settings, trace.scales)


def filled(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The values with straight lines over the samples that were left out; for first guesses only."""
    known = np.isfinite(values)
    return values if known.all() else np.interp(times, times[known], values[known])


def usual_channels(
    traces: Sequence[Any], loss: str | None = None, channels: Sequence[str] | None = None
) -> tuple[str, tuple[str, ...]]:
    """The loss and the channels that a fit takes where it is not told: the one rule for library, terminal and service.

    Without channels: V and S for the strict loss; else those of V, S, H and W that the traces share, or all that they
    share. Without a loss: strict where every trace is V and S and nothing else, modal otherwise. Recordings of a batch
    may stand for traces: only the names of the channels are read.

    A trace of V, S, H and W is therefore fitted by the modal loss, over all four. Such records are of whole shapes,
    a simulator's or a camera's; their V and S follow the two-coordinate oscillator badly (of simulated snaps the
    strict loss leaves half the scatter of V), while the two frequencies and the decay are the same in every measure,
    and are known the better the more of them are read.
    """
    if channels:
        names = tuple(channels)
    else:
        shared = tuple(name for name in traces[0].channels if all(name in one.channels for one in traces))
        # pressures, velocities and energies that a simulator wrote beside the shape are not fitted
        names = tuple(name for name in shared if name in MEASURED) or shared
        if loss == "strict" and {"V", "S"} <= set(names):
            names = ("V", "S")
    if loss is None:
        loss = "strict" if set(names) == {"V", "S"} else "modal"
    return loss, ("V", "S") if loss == "strict" and set(names) == {"V", "S"} else names


def chosen_channels(
    traces: Sequence[Any], loss: str | None, channels: Sequence[str] | None, *, moving: bool = True
) -> tuple[str, tuple[str, ...]]:
    """The loss and the channels it reads, by `usual_channels`, once they are found to be there and, `moving`, to move.

    Raises:
        BadName: A channel that is missing, or that the strict loss does not know.
    """
    loss, names = usual_channels(traces, loss, channels)
    for name in names:
        for number, trace in enumerate(traces if moving else [], 1):
            _refuse_still(np.asarray(trace[name], dtype=float), name, number)
    if not names:
        raise BadName("channels", found="none in common", expected="a channel in every trace", remedy="Name some.")
    if loss == "strict" and set(names) != {"V", "S"}:
        raise BadName(
            "channels",
            found=", ".join(names),
            expected="V and S, the oscillator's own coordinates, for the strict loss",
            remedy='Choose channels=("V", "S"), or loss="modal", which takes any channel.',
        )
    return loss, names


def _refuse_still(values: np.ndarray, name: str, number: int) -> None:
    """A channel that does not move says nothing of any constant."""
    if np.nanstd(values) <= 1e-9 * np.nanmax(np.abs(values)):
        raise BadValue(
            f"trace {number}, channel {name!r}",
            found=f"the constant {np.nanmean(values):g} in the window",
            expected="a motion",
            remedy="Choose another channel, or a window in which the shell rings.",
        )


def noise_level(values: np.ndarray, times: np.ndarray) -> float:
    """σ of a channel from itself, kept above a thousandth of its scatter: cleaner records are all weighed alike."""
    floor = SMALLEST_NOISE * float(values[np.isfinite(values)].std())
    return max(noise_of(values, times), floor, 1e-300)


def weighted(trace: Trace, channels: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Data and weights of a trace, (channels, times) each.

    Weights are 1/σ where it is given, else one over each channel's own noise; 0 where a sample is left out, and so is
    its datum.
    """
    times = np.asarray(trace.times, dtype=float)
    data = np.stack([np.asarray(trace[name], dtype=float) for name in channels])
    known = np.isfinite(data)
    weight = []
    for name, values, used in zip(channels, data, known, strict=True):
        if name in trace.sigma:
            sigma = np.broadcast_to(np.asarray(trace.sigma[name], dtype=float), values.shape)
            if not np.all(sigma > 0):
                raise BadValue(f"sigma[{name!r}]", found="a value not above 0", expected="σ > 0", remedy="Check it.")
        else:
            sigma = np.full(values.shape, noise_level(values, times))
        weight.append(np.where(used, 1 / sigma, 0.0))
    return np.where(known, data, 0.0), np.stack(weight)

"""Traces made ready for a fit: window, channels, rest state, weights.

Symbols    V_e volume [R0³], P_e pressure [E d/R0] at rest   σ standard error per sample
"""

import warnings
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.errors import BadName, BadShape, BadValue, RangeWarning
from jshell.oscillator.simulate import is_buckled, is_uniform
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state, gas_pressure
from jshell.signals import MEASURED, ring_down_start
from jshell.trace import Trace

EQUILIBRIA = ("plateau", "trace")
SMALLEST_NOISE = 1e-3  # of a channel's scatter: cleaner records are all weighed alike
REST_TOLERANCE = 0.01


class Record(eqx.Module):
    """One trace, as the solver sees it.

    Attributes:
        elapsed: (times,) since the window's first sample.
        data: (channels, times).
        weight: (channels, times), one over σ.
        conditions: The problem.
        state: Rest state.
        channels: Their names.
        uniform: Whether the times are an even grid.
    """

    elapsed: jax.Array
    data: jax.Array
    weight: jax.Array
    conditions: Reduced
    state: RestState
    channels: tuple[str, ...] = eqx.field(static=True)
    uniform: bool = eqx.field(static=True)


def windowed(traces: Trace | Sequence[Trace], start: float | None, stop: float | None) -> list[Trace]:
    """The traces inside the window, each with its conditions.

    Raises:
        BadValue: No conditions, or fewer than 16 samples, or numbers that are not finite.
    """
    listed = [traces] if isinstance(traces, Trace) else list(traces)
    if not listed:
        raise BadValue("traces", found="none", expected="at least one trace", remedy="Give a trace.")
    found = []
    for number, trace in enumerate(listed, 1):
        if trace.conditions is None:
            raise BadValue(
                f"trace {number}",
                found="no conditions",
                expected="thickness, pressures and viscosity of the shell",
                remedy="Build the trace with conditions=Reduced(…).",
            )
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
        found.append(cut)
    return found


def chosen_channels(
    traces: list[Trace], loss: str | None, channels: Sequence[str] | None
) -> tuple[str, tuple[str, ...]]:
    """The loss and the channels it reads.

    Without channels: those of V, S, H and W that the traces share, or else all that they share.
    Without a loss: strict where every trace is V and S and nothing else, modal otherwise.

    Raises:
        BadName: A channel that is missing, or that the strict loss does not know.
    """
    if channels is None:
        shared = tuple(name for name in traces[0].channels if all(name in t.channels for t in traces))
        # pressures, velocities and energies that a simulator wrote beside the shape are not listened to
        names = tuple(name for name in shared if name in MEASURED) or shared
    else:
        names = tuple(channels)
    for name in names:
        for trace in traces:
            trace[name]
    if loss is None:
        loss = "strict" if set(names) == {"V", "S"} else "modal"
    for name in names:
        for number, trace in enumerate(traces, 1):
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
    return loss, ("V", "S") if loss == "strict" else names


def _refuse_still(values: np.ndarray, name: str, number: int) -> None:
    """A channel that does not move says nothing of any constant."""
    if np.std(values) <= 1e-9 * np.max(np.abs(values)):
        raise BadValue(
            f"trace {number}, channel {name!r}",
            found=f"the constant {values[0]:g} in the window",
            expected="a motion",
            remedy="Choose another channel, or a window in which the shell rings.",
        )


def noise_of(values: np.ndarray) -> float:
    """Scatter of white noise on a smooth, evenly sampled record, from its sixth differences.

    The motion hardly survives six differences where it is sampled ten times a
    period or more; coarser, this is an upper bound.
    """
    return float(np.sqrt(np.mean(np.diff(values, 6) ** 2) / 924.0))  # 924 = (12 choose 6)


def rest_state(trace: Trace, offset: float | None, equilibrium: str, number: int) -> tuple[RestState, tuple[str, ...]]:
    """The rest state of a trace, and warnings.

    Args:
        trace: With conditions.
        offset: Volume the trace settles to, where it has one.
        equilibrium: `plateau` or `trace`.
        number: Of the trace, for messages.
    """
    conditions = trace.conditions
    assert conditions is not None
    texts = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RangeWarning)
        plateau = buckled_state(conditions)
    if equilibrium == "plateau":
        texts += [str(w.message) for w in caught]
    standing = bool(is_buckled(plateau))
    if equilibrium == "plateau" and not standing:
        raise BadValue(
            f"trace {number}",
            found="no buckled rest state by the plateau law at this load",
            expected="an outer pressure above the plateau",
            remedy='Check the conditions, or take equilibrium="trace".',
        )
    if equilibrium == "trace" and offset is None:
        raise BadName(
            f"trace {number}",
            found="no channel V to read a rest volume from",
            expected="V among the channels",
            remedy='Use equilibrium="plateau".',
        )
    if offset is not None and standing:
        gap = offset / float(plateau.volume) - 1
        if abs(gap) > REST_TOLERANCE:
            texts.append(
                f"trace {number} rests at V = {offset:.5g}, {100 * gap:+.1f}% from the plateau law's "
                f"{float(plateau.volume):.5g}; the fit uses the {equilibrium}'s"
            )
    if equilibrium == "plateau":
        return plateau, tuple(texts)
    volume = jnp.asarray(offset)
    return RestState(volume, jnp.asarray(gas_pressure(volume, conditions))), tuple(texts)


def record(trace: Trace, channels: tuple[str, ...], state: RestState) -> Record:
    """A trace with weights: 1/σ where given, else one over each channel's own noise."""
    times = np.asarray(trace.times, dtype=float)
    uniform = is_uniform(times)
    data = np.stack([np.asarray(trace[name], dtype=float) for name in channels])
    if not np.all(np.isfinite(data)):
        raise BadValue("trace", found="a sample that is not finite", expected="numbers", remedy="Cut it out.")
    weight = []
    for name, values in zip(channels, data, strict=True):
        if name in trace.sigma:
            sigma = np.broadcast_to(np.asarray(trace.sigma[name], dtype=float), values.shape)
            if not np.all(sigma > 0):
                raise BadValue(f"sigma[{name!r}]", found="a value not above 0", expected="σ > 0", remedy="Check it.")
        else:
            floor = SMALLEST_NOISE * values.std()
            sigma = np.full(values.shape, max(noise_of(values) if uniform else 0.0, floor, 1e-300))
        weight.append(1 / sigma)
    number = lambda x: jnp.asarray(x, dtype=float)  # noqa: E731
    c = trace.conditions
    assert c is not None
    conditions = Reduced(
        number(c.thickness),
        number(c.gas_pressure),
        number(c.outer_pressure),
        number(c.viscosity),
        number(c.kappa),
        number(c.poisson_ratio),
    )
    state = RestState(number(state.volume), number(state.pressure))
    elapsed = number(times - times[0])
    return Record(elapsed, number(data), number(np.stack(weight)), conditions, state, channels, uniform)

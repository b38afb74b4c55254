"""What a fit would begin from: the modes identified in the traces, and the constants that they imply.

Nothing is fitted here. The curve drawn over the data is the two decaying modes
of a matrix pencil, from which the library's first start is made.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jshell.calibration.data import chosen_channels, filled, windowed
from jshell.calibration.parameters import check_value
from jshell.calibration.problem import POSITIVE
from jshell.calibration.records import Record, record, rest_state
from jshell.calibration.starts import ModePair, find_modes, first_start
from jshell.errors import JshellError
from jshell.trace import Trace


@dataclass(frozen=True)
class Preview:
    """What a fit would read, and where it would begin.

    Attributes:
        loss: `strict` or `modal`.
        channels: Those read.
        traces: Inside the window.
        curves: Per trace, channel to the modes identified; empty where there are not two.
        start: Constant to the value that the search begins from; empty where no modes are.
        modes: Per trace ω-, ω+ and τ identified; None where they are not.
        notes: What the reader should know.
    """

    loss: str
    channels: tuple[str, ...]
    traces: tuple[Trace, ...]
    curves: tuple[Mapping[str, np.ndarray], ...]
    start: Mapping[str, float]
    modes: tuple[tuple[float, float, float] | None, ...]
    notes: tuple[str, ...]


def preview(
    traces: Sequence[Trace],
    loss: str | None = None,
    channels: Sequence[str] | None = None,
    *,
    equilibrium: str = "plateau",
    start: float | None = None,
    stop: float | None = None,
    fix: Mapping[str, float] | None = None,
) -> Preview:
    """What a fit with these options would begin from.

    Raises:
        JshellError: What the fit itself would refuse of the traces.
    """
    for name, value in (fix or {}).items():
        check_value(f"fix[{name!r}]", name, value, positive=name.partition("[")[0] in POSITIVE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cut = windowed(traces, start, stop)
        loss, names = chosen_channels(cut, loss, channels)
        notes: list[str] = []
        curves, identified, ready = [], [], []
        for number, trace in enumerate(cut, 1):
            found = _modes(trace, names)
            curves.append({} if found is None else _curve(trace, names, found))
            identified.append(found)
            if found is None:
                notes.append(f"no two modes are found in trace {number}: the search begins from random constants")
            try:
                offset = None if found is None or "V" not in names else float(found.offsets[names.index("V")])
                state, texts = rest_state(trace, offset, equilibrium, number)
                ready.append(record(trace, names, state))
                notes += texts
            except JshellError as error:
                notes.append(f"{error.place}: {error.found}. {error.remedy}")
        begin: dict[str, float] = {}
        if len(ready) == len(cut) and all(one is not None for one in identified):
            begin = _start(loss, ready, [one for one in identified if one is not None], dict(fix or {}))
    modes = tuple(None if one is None else (*np.sqrt(one.squared).tolist(), one.tau) for one in identified)
    return Preview(loss, names, tuple(cut), tuple(curves), begin, modes, tuple(dict.fromkeys(notes)))


def _modes(trace: Trace, names: Sequence[str]) -> ModePair | None:
    times = np.asarray(trace.times, dtype=float)
    data = np.stack([filled(times, np.asarray(trace[name], dtype=float)) for name in names])
    return find_modes(times - times[0], data)


def _curve(trace: Trace, names: Sequence[str], found: ModePair) -> dict[str, np.ndarray]:
    times = np.asarray(trace.times, dtype=float)
    waves = np.exp(np.outer(found.poles, times - times[0]))
    rows = found.offsets[:, None] + np.real(found.amplitudes @ waves)
    return dict(zip(names, rows, strict=True))


def _start(loss: str, ready: list[Record], identified: list[ModePair], fix: dict[str, float]) -> dict[str, float]:
    """The first start of the library, by name."""
    known = {name: value for name, value in fix.items() if "[" not in name}
    first = first_start(loss, ready, identified, known).tolist()
    if loss == "strict":
        return dict(zip(("alpha1", "alpha2", "k_vs", "beta1"), first, strict=True))
    found = {"alpha1": first[0], "alpha2": first[1], "k_vs": float(np.sqrt(max(first[2], 0.0)))}
    return found | {f"tau[{i}]" if len(identified) > 1 else "tau": one.tau for i, one in enumerate(identified, 1)}

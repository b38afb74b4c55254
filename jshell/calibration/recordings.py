"""Many records as arrays: what a batch fit reads.

Records go together in blocks of one padded length; few lengths serve all, so
that few programs are compiled.

Symbols    V volume [R0³]   S area [R0²]   times [sqrt(ρ_f R0³/(E d))]
"""

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from jshell.calibration.agreement import holder
from jshell.calibration.data import chosen_channels, conditions_of, with_sigma
from jshell.calibration.sampling import noise_of, sampling
from jshell.errors import BadName, BadShape, BadValue, RangeWarning, choose
from jshell.oscillator.simulate import is_buckled
from jshell.shell.parameters import CONDITION_FIELDS, Reduced
from jshell.shell.rest import buckled_state
from jshell.signals.lanes import lanes_for
from jshell.signals.wave_sums import INNER
from jshell.trace import Trace, traces_of

FEWEST = 32  # samples of a record
_buckled_state = jax.jit(buckled_state)


class Recordings(eqx.Module):
    """Records side by side.

    Args:
        times: (times,) shared by all, or (rows, times); increasing.
        values: (rows, channels, times). NaN marks a missing sample.
        conditions: Numbers, or (rows,) arrays of numbers.
        sigma: (rows, channels) standard error per sample of each channel, where known.
        counts: (rows,) samples of each record; what follows them is not read. None reads all.
        channels: Their names; V, then S, unless they are said.

    Raises:
        BadShape: Arrays that do not fit together.
        BadValue: An array of something that is no number.
    """

    times: np.ndarray | jax.Array
    values: np.ndarray | jax.Array
    conditions: Reduced
    sigma: np.ndarray | jax.Array | None = None
    counts: np.ndarray | jax.Array | None = None
    channels: tuple[str, ...] = eqx.field(static=True, default=("V", "S"))

    def __check_init__(self) -> None:
        shape, times = np.shape(self.values), np.shape(self.times)
        fits = len(shape) == 3 and shape[1] == len(self.channels) and times in ((shape[2],), (shape[0], shape[2]))
        fits = fits and (self.sigma is None or np.shape(self.sigma) == shape[:2])
        fits = fits and (self.counts is None or np.shape(self.counts) == shape[:1]) and 0 not in shape
        conditions = {name: getattr(self.conditions, name) for name in CONDITION_FIELDS.values()}
        ill = "".join(
            f", {name} {np.shape(one)}"
            for name, one in conditions.items()
            if np.shape(one) not in ((), (1,), shape[:1])
        )
        if ill or not fits:
            raise BadShape(
                "recordings",
                found=f"times {times}, values {shape}{ill}",
                expected=f"times (times,) or (rows, times), values (rows, {len(self.channels)}, times), "
                f"sigma (rows, {len(self.channels)}), counts (rows,), of each condition a row or one for all",
                remedy=f"Give {', '.join(self.channels)} of every record, padded to one length; `counts` says how long "
                "each is.",
            )
        given = {"times": self.times, "values": self.values, "sigma": self.sigma, "counts": self.counts} | conditions
        for name, array in given.items():
            # of what is no number the fits would fail one by one, in their middle
            if array is not None and (kind := getattr(array, "dtype", np.dtype(float))).kind not in "iuf":
                raise BadValue(
                    f"recordings, {name}", found=f"an array of {kind}", expected="numbers", remedy="Give it as floats."
                )

    def of(self, names: tuple[str, ...]) -> "Recordings":
        """The same with some channels only, in this order.

        Raises:
            BadName: One that is not there.
        """
        if names == self.channels:
            return self
        remedy = "Say which channels the recordings have: Recordings(…, channels=…)."
        names = tuple(choose("channel", name, self.channels, remedy=remedy) for name in names)
        at = [self.channels.index(name) for name in names]
        sigma = None if self.sigma is None else self.sigma[:, at]
        return Recordings(self.times, self.values[:, at], self.conditions, sigma, self.counts, names)


class Bucket(NamedTuple):
    """Records of one padded length.

    Attributes:
        rows: Where each stands among all.
        values: (rows, channels, times) padded.
        counts: (rows,).
        steps: (rows,) time between samples; the mean one where they are uneven.
        elapsed: (rows, times) from each first sample, for uneven records; None for even ones.
        even: (rows, channels, times) uneven records brought to an even grid; None for even ones.
        noise: (rows, channels) of uneven records; None for even ones, whose own is found with their fits.
    """

    rows: np.ndarray
    values: np.ndarray
    counts: np.ndarray
    steps: np.ndarray
    elapsed: np.ndarray | None = None
    even: np.ndarray | None = None
    noise: np.ndarray | None = None

    @property
    def lanes(self) -> int:
        """Records of a block."""
        return lanes_for(self.rows.size, self.values.shape[2])


def padded_length(count: int) -> int:
    """A multiple of INNER, at most an eighth above the count: few lengths serve all."""
    groups = -(-count // INNER)
    unit = 2 ** max(0, groups.bit_length() - 4)
    return INNER * unit * -(-groups // unit)


def records_of(
    traces: Sequence[Trace] | Recordings, loss: str | None, channels: Sequence[str] | None
) -> tuple[str, Recordings]:
    """The loss of a batch, and its records with the channels that this reads.

    Raises:
        BadName: A channel that is missing, or that the strict loss does not know.
        BadValue: No record, or something that is none.
    """
    traces = traces if isinstance(traces, Recordings) else traces_of(traces)
    given = [traces] if isinstance(traces, Recordings) else traces
    if loss is None and not channels and all({"V", "S"} <= set(one.channels) for one in given):
        # a batch is strict beside H and W too, where a single fit reads all four by the modal loss
        loss = "strict"
    loss, names = chosen_channels(given, loss, channels, moving=False)
    return loss, traces.of(names) if isinstance(traces, Recordings) else stacked(traces, names, loss)


def stacked(traces: Sequence[Trace], names: tuple[str, ...] = ("V", "S"), loss: str = "strict") -> Recordings:
    """Traces as arrays.

    Args:
        traces: With conditions.
        names: Channels to read.
        loss: How they will be compared.

    Raises:
        BadValue: A trace without conditions; σ that changes along a record, or is given for some only.
    """
    traces = traces_of(traces)
    longest = max(np.shape(trace.times)[0] for trace in traces)
    times = np.zeros((len(traces), longest))
    values = np.full((len(traces), len(names), longest), np.nan)
    counts = np.zeros(len(traces), int)
    sigma = np.full((len(traces), len(names)), np.nan)
    for i, trace in enumerate(traces):
        conditions_of(trace, i + 1)
        holder(trace, i + 1, inverted=loss == "strict")
        counts[i] = count = np.shape(trace.times)[0]
        times[i, :count] = np.asarray(trace.times)
        for c, name in enumerate(names):
            values[i, c, :count] = np.asarray(trace[name])
            if name in trace.sigma:
                known = np.unique(np.asarray(trace.sigma[name], dtype=float))
                if known.size > 1:
                    raise BadValue(
                        f"trace {i + 1}, sigma[{name!r}]",
                        found="a standard error that changes along the record",
                        expected="one number per channel",
                        remedy="Use fit_trajectories for this trace.",
                    )
                sigma[i, c] = known[0]
    absolute = with_sigma(traces, names)
    numbers = [
        np.array([float(getattr(trace.conditions, name)) for trace in traces]) for name in CONDITION_FIELDS.values()
    ]
    same = bool(np.all(times == times[0])) and bool(np.all(counts == longest))
    return Recordings(
        times[0] if same else times, values, Reduced(*numbers), sigma if absolute else None, counts, names
    )


def bucketed(records: Recordings) -> tuple[list[Bucket], np.ndarray]:
    """Buckets of records that can be fitted, even ones apart from uneven ones; and a mark on those that cannot.

    A sample that is missing in one channel is left out of both. Unusable are
    records of fewer than 32 samples, without motion, or whose times do not increase.
    """
    values = np.asarray(records.values, dtype=float)
    rows, _, length = values.shape
    times = np.asarray(records.times, dtype=float)
    shared = times.ndim == 1
    counts = np.full(rows, length) if records.counts is None else np.asarray(records.counts, dtype=int)
    unusable = np.zeros(rows, bool)
    if shared:
        even_all = np.full(rows, sampling(times).even)
    else:
        even_all = np.array([sampling(t[:n]).even for t, n in zip(times, counts, strict=True)])
    with np.errstate(all="ignore"):
        full = counts == length
        whole = np.isfinite(values.sum(axis=(1, 2))) & full
    for i in np.flatnonzero(~whole):
        whole[i] = np.isfinite(values[i, :, : counts[i]]).all()

    plain = np.flatnonzero(even_all & whole & (counts >= FEWEST))

    def step_of(i):
        t = sampling((times if shared else times[i])[: counts[i]]).times
        return float(t[-1] - t[0]) / (counts[i] - 1)

    buckets = []
    there, which = np.unique(counts[plain], return_inverse=True)
    lengths = np.array([padded_length(int(n)) for n in there], int)[which]
    for size in np.unique(lengths):
        chosen = plain[lengths == size]
        kept = values[..., : min(size, length)]
        kept = kept if chosen.size == rows else kept[chosen]  # as they lie: a copy takes as long as a step of the fits
        steps = (
            np.full(chosen.size, step_of(chosen[0]))
            if shared and np.all(counts[chosen] == counts[chosen[0]])
            else (np.array([step_of(i) for i in chosen]))
        )
        buckets.append(Bucket(chosen, kept, counts[chosen], steps))

    cut: dict[int, list] = {}
    for i in np.setdiff1d(np.arange(rows), plain):
        t = (times if shared else times[i])[: counts[i]]
        here = np.isfinite(values[i, :, : counts[i]]).all(axis=0) & np.isfinite(t)
        t, y = t[here], values[i, :, : counts[i]][:, here]
        if t.size < FEWEST or not np.all(np.diff(t) > 0):
            unusable[i] = True
            continue
        t = sampling(t).times
        cut.setdefault(padded_length(t.size), []).append((i, t - t[0], y))
    for size, found in sorted(cut.items()):
        elapsed, kept, even = np.zeros((len(found), size)), np.zeros((len(found), values.shape[1], size)), []
        for j, (_, t, y) in enumerate(found):
            elapsed[j, : t.size], kept[j, :, : t.size] = t, y
            grid = np.linspace(0, t[-1], t.size)
            even.append(np.pad([np.interp(grid, t, row) for row in y], ((0, 0), (0, size - t.size))))
        n = np.array([t.size for _, t, _ in found])
        steps = np.array([t[-1] / (t.size - 1) for _, t, _ in found])
        noise = np.array([[noise_of(row, t) for row in y] for _, t, y in found])
        buckets.append(Bucket(np.array([i for i, *_ in found]), kept, n, steps, elapsed, np.array(even), noise))
    for bucket in buckets:
        # most differ at once; the others are looked at as a whole
        still = np.flatnonzero(~np.all(bucket.values[:, :, 1] != bucket.values[:, :, 0], axis=1))
        beyond = np.arange(bucket.values.shape[2]) >= bucket.counts[still, None, None]
        moves = np.any((bucket.values[still] != bucket.values[still, :, :1]) & ~beyond, axis=2).all(axis=1)
        unusable[bucket.rows[still[~moves]]] = True
    return buckets, unusable


def mean_volumes(records: Recordings) -> np.ndarray:
    """(rows,) mean of V over the samples that are there; NaN where there are none, or no V."""
    if "V" not in records.channels:
        return np.full(np.shape(records.values)[0], np.nan)
    volumes = np.asarray(records.values)[:, records.channels.index("V")]
    if records.counts is None:
        whole = volumes.mean(axis=1)
        if np.isfinite(whole).all():
            return whole
    there = np.isfinite(volumes)
    if records.counts is not None:
        there = there & (np.arange(volumes.shape[1]) < np.asarray(records.counts)[:, None])
    with np.errstate(invalid="ignore"):
        return np.sum(volumes, axis=1, where=there) / np.sum(there, axis=1)


def rest_states(records: Recordings, equilibrium: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """V_e, P_e of every record, NaN where the record itself is to tell; and whether the shell is buckled."""
    rows = np.shape(records.values)[0]
    if equilibrium == "trace":
        if "V" not in records.channels:
            raise BadName(
                "equilibrium 'trace'",
                found="no channel V to read a rest volume from",
                expected="V among the channels",
                remedy='Use equilibrium="plateau".',
            )
        blank = np.full(rows, np.nan)
        return blank, blank, np.ones(rows, bool)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)
        state = _buckled_state(records.conditions.as_arrays())
    buckled = np.broadcast_to(np.asarray(is_buckled(state)), (rows,))
    spread = lambda x: np.broadcast_to(np.asarray(x, dtype=float), (rows,))  # noqa: E731
    return spread(state.volume), spread(state.pressure), buckled

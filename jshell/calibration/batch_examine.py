"""What the fits of a batch leave, record by record: whether it is noise, which, and the fits again where it remembers.

Symbols    φ memory from sample to sample   r weighted residual
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jshell.calibration.batch_bounds import Box
from jshell.calibration.batch_kernel import LaneResult
from jshell.calibration.batch_noise import Again, again, columns, memory_of
from jshell.calibration.batch_residual import Given, ResidualSums, residual
from jshell.calibration.misfit import is_explained
from jshell.calibration.noise import (
    COHERENT,
    MISFIT,
    ar1_memory,
    envelope_chance,
    estimate_memory,
    is_coherent,
    is_correlated,
    peak_chance,
    runs_from,
    steps_between,
)
from jshell.calibration.recordings import Bucket
from jshell.signals.lane_search import CONVERGED
from jshell.signals.lanes import side_by_side
from jshell.signals.wave_sums import padded

TOGETHER = 16  # blocks of records that are looked at together
UNEVEN_SIZES = 2.5  # standard errors between the sizes in both halves, below which no test of ranks fails by COHERENT


class Studied(NamedTuple):
    """What was learnt of every record, (rows, …).

    Attributes:
        memory: (rows, channels) φ; 0 where the residual passes as white.
        whitened: (rows,) sum of squares of the whitened residual where the noise is autocorrelated, else NaN.
        misfit: (rows,) whether the model leaves clearly more than noise explains.
    """

    memory: np.ndarray
    whitened: np.ndarray
    misfit: np.ndarray


def nothing_studied(rows: int, channels: int) -> Studied:
    """Before any record was looked at."""
    return Studied(np.zeros((rows, channels)), np.full(rows, np.nan), np.zeros(rows, bool))


@dataclass
class BatchState:
    """A batch under way: its records, and the best of what was found for each so far; arrays change in place.

    Attributes:
        channels: What is read.
        modal: Whether channels have amplitudes of their own.
        absolute: Whether σ is given.
        box: Bounds of the unknowns.
        buckets: The records, side by side.
        unusable, buckled: (rows,) whether a record cannot be fitted, and whether its shell is buckled.
        kappa, area_modulus, viscosity: (rows,) of the conditions.
        counts: (rows,) samples read.
        found: Fields of `LaneResult`, (…, rows).
        studied: What was learnt of what is left.
        tried, agreeing: (rows,) starts, and those of them that ended in the best minimum.
    """

    channels: tuple[str, ...]
    modal: bool
    absolute: bool
    box: Box
    buckets: list[Bucket]
    unusable: np.ndarray
    buckled: np.ndarray
    kappa: np.ndarray
    area_modulus: np.ndarray
    viscosity: np.ndarray
    counts: np.ndarray
    found: LaneResult
    studied: Studied
    tried: np.ndarray
    agreeing: np.ndarray

    @property
    def usable(self) -> np.ndarray:
        """(rows,) records that can be fitted."""
        return ~self.unusable & self.buckled

    @property
    def finite(self) -> np.ndarray:
        """(rows,) those of them whose search ended at numbers."""
        return self.usable & np.isfinite(self.found.cost) & np.all(np.isfinite(self.found.unknowns), axis=0)


def study(run: BatchState, which: np.ndarray, *, white: bool) -> None:
    """Test what is left of some records.

    Args:
        run: The batch; its `studied` is changed.
        which: (rows,) records to look at, of those whose search ended at numbers.
        white: Take all noise as white.
    """
    which = which & run.finite
    for bucket in run.buckets:
        everyone = np.flatnonzero(which[bucket.rows])
        for at in range(0, everyone.size, TOGETHER * bucket.lanes):
            _study(run, bucket, everyone[at : at + TOGETHER * bucket.lanes], white=white)


def _study(run: BatchState, bucket: Bucket, chosen: np.ndarray, *, white: bool) -> None:
    """The same of some records of a bucket, so few that what is made of them stays in the cache."""
    rows = bucket.rows[chosen]
    left = _leftover(run, bucket, chosen)
    memory = _memories(run, bucket, chosen, left)
    coherent = _coherent(bucket, chosen, left, memory)
    if not white:
        run.studied.memory[rows] = memory
    rms = np.sqrt(left.sums.power / bucket.counts[chosen, None])
    more = rms > MISFIT
    if not run.absolute:
        more &= ~((memory > 0) & ~coherent & is_explained(np.maximum(rms, 1e-300), 1.0, memory))
    misfit = more | coherent
    flagged = np.flatnonzero(misfit.any(axis=1))
    scatter = np.sqrt(run.found.weight[:, rows[flagged]].T) * _scatters(bucket, chosen[flagged])
    misfit[flagged] &= rms[flagged] > 1e-5 * scatter  # of exact data rounding is left
    run.studied.misfit[rows] = misfit.any(axis=1)


def fit_autocorrelated(run: BatchState) -> None:
    """Fit those records again whose noise is autocorrelated.

    Args:
        run: The batch; its `found` and `studied` are changed.
    """
    for bucket in run.buckets:
        memory = run.studied.memory[bucket.rows]
        chosen = np.flatnonzero(memory.max(axis=1) > 0)
        if chosen.size:
            _fit_again(run, bucket, chosen, memory[chosen])


def _scatters(bucket: Bucket, chosen: np.ndarray) -> np.ndarray:
    """(chosen, channels) standard deviations."""
    found = np.empty((chosen.size, bucket.values.shape[1]))
    for count, mine in _alike(bucket.counts[chosen]):
        found[mine] = bucket.values[chosen[mine]][..., :count].std(axis=-1)
    return found


def _alike(counts: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Lengths that there are, and who has them."""
    if counts.size and (counts == counts[0]).all():  # as most batches are: sorting them would cost more than a step
        yield int(counts[0]), np.arange(counts.size)
        return
    for count in np.unique(counts):
        yield int(count), np.flatnonzero(counts == count)


def _blocks(run: BatchState, bucket: Bucket, chosen: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, Given]]:
    """Blocks of records: places among the chosen, the rows of the lanes (a short block repeats its own), and they."""
    size, found = bucket.lanes, run.found
    for at in range(0, chosen.size, size):
        mine = np.arange(at, min(at + size, chosen.size))
        lanes = np.resize(chosen[mine], size)
        rows = bucket.rows[lanes]
        row = lanes[0] if lanes[-1] - lanes[0] == size - 1 and np.all(np.diff(lanes) == 1) else None
        there = lanes if row is None else slice(row, row + size)  # neighbours are read where they lie
        wide = lambda x, there=there: side_by_side(x[there], padded(x.shape[-1]))  # noqa: E731
        volume, pressure = found.rest[:, rows]
        yield (
            mine,
            rows,
            Given(
                wide(bucket.values),
                bucket.counts[lanes].astype(float),
                bucket.steps[lanes],
                run.kappa[rows] * pressure / volume,
                run.area_modulus[rows] / (4 * np.pi),
                volume,
                found.weight[:, rows],
                None if bucket.elapsed is None else wide(bucket.elapsed),
                run.modal,
            ),
        )


class Leftover(NamedTuple):
    """What is left of chosen records.

    Attributes:
        blocks: Residuals as they were computed, (channels, times, lanes) each: turned over only for records that ask.
        sums: As `ResidualSums`, (chosen, channels) each and the halves (chosen, 2, channels); without the residuals.
        peak: (chosen, channels) chance of the largest peak, to single precision, no memory taken out.
    """

    blocks: list[np.ndarray]
    sums: ResidualSums
    peak: np.ndarray

    def records(self, which: np.ndarray) -> np.ndarray:
        """(which, channels, times) residuals of some of the records."""
        lanes = self.blocks[0].shape[-1]
        found = np.empty((which.size, *self.blocks[0].shape[:-1]))
        for number in np.unique(which // lanes):
            mine = which // lanes == number
            found[mine] = np.moveaxis(self.blocks[number], -1, 0)[which[mine] % lanes]
        return found


def _leftover(run: BatchState, bucket: Bucket, chosen: np.ndarray) -> Leftover:
    """What is left of chosen records of a bucket."""
    blocks, parts, channels = [], [], bucket.values.shape[1]
    peak = np.empty((chosen.size, channels))
    for mine, rows, given in _blocks(run, bucket, chosen):
        state = run.found.state[:, rows]
        left = residual(run.found.unknowns[:, rows], state[:-channels], state[-channels:], given)
        blocks.append(np.asarray(left.residual))
        parts.append([np.asarray(x)[..., : mine.size] for x in left[1:]])
        for count, lanes in _alike(bucket.counts[chosen[mine]]):
            alike = blocks[-1][:, :count] if lanes.size == rows.size else blocks[-1][:, :count, lanes]
            peak[mine[lanes]] = peak_chance(alike.astype(np.float32), axis=1).T
    sums = (np.moveaxis(np.concatenate(part, axis=-1), -1, 0) for part in zip(*parts, strict=True))
    return Leftover(blocks, ResidualSums(None, *sums), peak)


def _memories(run: BatchState, bucket: Bucket, chosen: np.ndarray, left: Leftover) -> np.ndarray:
    """(chosen, channels) φ where the tests of white noise fail, else 0."""
    count, sums = bucket.counts[chosen, None], left.sums
    with np.errstate(all="ignore"):
        lag1 = sums.neighbours / (sums.power - count * sums.mean**2)
        correlated = is_correlated(lag1 * np.sqrt(count), runs_from(sums.above, sums.changes, count))
    memory, some = np.zeros(correlated.shape), np.flatnonzero(correlated.any(axis=1))
    # of a channel, alpha1, alpha2 and k_vs move the two frequencies; what else they do its own amplitudes do as well
    fitted = run.box.free.astype(float)
    fitted[0] *= not run.box.free[:3].all()
    for mine, rows, given in _blocks(run, bucket, chosen[some]):
        at = run.found.unknowns[:, rows], run.found.state[: -bucket.values.shape[1], rows], fitted
        mine_left = left.records(some[mine])
        if bucket.elapsed is None:
            r = side_by_side(np.resize(mine_left, (rows.size, *mine_left.shape[1:])), given.values.shape[1])
            found = np.asarray(memory_of(*at, r, given)).T[: mine.size]
        else:
            found = _uneven_memories(np.asarray(columns(*at, given)), mine_left, bucket, chosen[some[mine]])
        memory[some[mine]] = np.where(correlated[some[mine]], found, 0.0)
    return np.where(np.isfinite(memory), memory, 0.0)


def _uneven_memories(parts: np.ndarray, left: np.ndarray, bucket: Bucket, chosen: np.ndarray) -> np.ndarray:
    """The same of uneven records, one by one."""
    assert bucket.elapsed is not None
    channels = left.shape[1]
    found = np.zeros((chosen.size, channels))
    for k, j in enumerate(chosen):
        count = int(bucket.counts[j])
        steps = steps_between(bucket.elapsed[j, :count])
        for c in range(channels):
            found[k, c] = estimate_memory(left[k, c, :count], parts[c, :, :count, k].T, steps)
    return found


def _over_steps(bucket: Bucket, chosen: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """(chosen, channels, times) memory over the step to each uneven sample, 0 at the first and beyond the record."""
    assert bucket.elapsed is not None
    over = np.zeros((*memory.shape, bucket.values.shape[2]))
    for k, j in enumerate(chosen):
        count = int(bucket.counts[j])
        steps = steps_between(bucket.elapsed[j, :count])
        for c in np.flatnonzero(memory[k]):
            over[k, c, 1:count] = ar1_memory(memory[k, c], steps)[1:]
    return over


def _coherent(bucket: Bucket, chosen: np.ndarray, left: Leftover, memory: np.ndarray) -> np.ndarray:
    """(chosen, channels) whether what is left moves as no noise does, once its memory is taken out."""
    counts, peak, envelope = bucket.counts[chosen], left.peak.copy(), np.ones(memory.shape)
    early, whole, size = left.sums.halves[:, 0].copy(), left.sums.halves[:, 1].copy(), left.sums.size.copy()

    def fresh(some: np.ndarray, count: int) -> np.ndarray:
        return _whitened(bucket, chosen[some], left.records(some)[..., :count], memory[some])

    ar1_rows = np.flatnonzero(memory.any(axis=1))
    for count, mine in _alike(counts[ar1_rows]):
        some = ar1_rows[mine]
        noise = fresh(some, count)
        root = np.sqrt(np.abs(noise))
        early[some], whole[some] = root[..., : count // 2].sum(axis=-1), root.sum(axis=-1)
        size[some] = np.einsum("...t,...t->...", root, root)
        peak[some] = peak_chance(noise.astype(np.float32))
    with np.errstate(all="ignore"):
        # ranks cost a sort: they are asked where the mean sizes of the halves differ at all; roots bear outliers
        spread = np.sqrt(np.maximum(size / counts[:, None] - (whole / counts[:, None]) ** 2, 0.0))
        differ = np.abs(2 * early - whole) > UNEVEN_SIZES * spread * np.sqrt(counts[:, None])
    near = peak < 100 * COHERENT  # single precision errs by 1e-4 of the chance
    asked = np.flatnonzero((near | differ).any(axis=1))
    for count, mine in _alike(counts[asked]):
        some = asked[mine]
        noise = fresh(some, count)
        peak[some] = np.where(near[some], peak_chance(noise), np.inf)
        for k, c in zip(*np.nonzero(differ[some]), strict=True):
            envelope[some[k], c] = envelope_chance(noise[k, c])
    return is_coherent(np.where(near, peak, np.inf), envelope)


def _whitened(bucket: Bucket, chosen: np.ndarray, left: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """(chosen, channels, count) with the memory taken out, as `noise.whiten`."""
    even = bucket.elapsed is None
    phi = memory[..., None] if even else _over_steps(bucket, chosen, memory)[..., 1 : left.shape[-1]]
    return np.concatenate([left[..., :1], (left[..., 1:] - phi * left[..., :-1]) / np.sqrt(1 - phi**2)], axis=-1)


def _fit_again(run: BatchState, bucket: Bucket, chosen: np.ndarray, memory: np.ndarray) -> None:
    """The constants and errors of autocorrelated noise, from the minimum of white noise."""
    found, over = run.found, None if bucket.elapsed is None else _over_steps(bucket, chosen, memory)
    for mine, rows, given in _blocks(run, bucket, chosen):
        lanes = np.resize(mine, rows.size)
        start, rested = found.unknowns[:, rows], (found.status[rows] == CONVERGED) & ~run.studied.misfit[rows]
        steps = None if over is None else side_by_side(over[lanes], given.values.shape[1])
        ended = again(start, rested, memory[lanes].T, steps, run.box.lanes(rows.size), given)
        ended, rows = Again(*(np.asarray(part)[..., : mine.size] for part in ended)), rows[: mine.size]
        found.normal[..., rows] = ended.normal
        run.studied.whitened[rows] = ended.cost
        # as in `diagnostics`: what a misfit leaves is motion, and the white minimum stays, but for its errors
        moved = ~run.studied.misfit[rows]
        for name in ("unknowns", "state", "omega", "slope"):
            getattr(found, name)[..., rows[moved]] = getattr(ended, name)[..., moved]
        found.cost[rows[moved]] = ended.power[moved]

"""Thousands of traces at once: each its own constants.

Every record is fitted by itself, 64 side by side: a start from its spectrum,
variable projection, Levenberg-Marquardt. Seven steps for all; what has not
come to rest then is gathered and goes on together. Records that end badly, or
leave more than their noise, are tried again from other starts. A record that
fails changes no other by a bit.

Symbols    α1, α2, k_VS, β1 constants [-]   τ decay time [sqrt(ρ_f R0³/(E d))]   ω-, ω+ angular frequencies
Valid for  small oscillations about a buckled rest state, equal decay of both modes; V and S for the strict loss
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw, eq:taureal
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration import batch_diffrax
from jshell.calibration.agreement import rests_elsewhere
from jshell.calibration.batch_bounds import NAMES, Box, box_of
from jshell.calibration.batch_examine import BatchState, fit_autocorrelated, nothing_studied, study
from jshell.calibration.batch_kernel import BlockInput, LaneResult, nothing_found, solve_blocks
from jshell.calibration.batch_result import BatchResult, read
from jshell.calibration.options import choices_of
from jshell.calibration.recordings import Bucket, Recordings, bucketed, mean_volumes, records_of, rest_states
from jshell.calibration.records import EQUILIBRIA, Record
from jshell.calibration.starts import find_modes, first_start
from jshell.errors import BadName, BadValue, choose
from jshell.oscillator.simulate import SOLVERS
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState
from jshell.signals.lane_search import CONVERGED, RUNNING
from jshell.signals.lanes import VECTORS, blocks_for, side_by_side
from jshell.signals.pencil_batch import CELLS
from jshell.signals.wave_sums import padded
from jshell.trace import Trace

ROUNDS = 12  # of seven steps
HOPELESS = 256  # more records than this in one call get no single care
_solve = jax.jit(solve_blocks, static_argnames="cell", compiler_options=VECTORS)

Progress = Callable[[int, int], None]


def fit_batch(
    traces: Sequence[Trace] | Recordings,
    loss: str | None = None,
    *,
    channels: Sequence[str] | None = None,
    solver: str = "exact",
    equilibrium: str = "plateau",
    fix: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 0,
    seed: int = 0,
    noise: str = "auto",
    progress: Progress | None = None,
) -> BatchResult:
    """Fit the short model to each of many traces by itself.

    Args:
        traces: Traces with conditions, or arrays; lengths and conditions may differ, NaN marks a missing sample.
        loss: `strict`: V and S follow the oscillator; `modal`: only ω-, ω+ and τ of any channels, as in
            `fit_trajectories`. None takes strict where there are V and S, modal otherwise.
        channels: Those to read, of the modal loss; None takes those of V, S, H and W that all traces have.
        solver: `exact` motion, or `diffrax` (strict loss, evenly sampled records without gaps).
        equilibrium: Rest state from the `plateau` law, or from where each `trace` settles.
        fix: Values of constants not to be fitted: `alpha1`, `alpha2`, `k_vs`, `tau`.
        bounds: Lowest and highest value of constants.
        starts: Random starts of every record beside the one from its spectrum; `tried` and `agreeing` of the result
            say where they ended.
        seed: Of the random starts.
        noise: `auto` tests what is left of every record and takes its noise as autocorrelated where it is, as
            `fit_trajectories` does; `white` does not.
        progress: Called with records done and records in all.

    Returns:
        One row per record, in their order, each with its outcome: ok; at_bound; rank_deficient with the free
        direction, as every row of a modal fit without one of alpha1, alpha2, k_vs fixed, whose ω-, ω+ and τ are
        determined; stalled; not_converged; not_finite; unusable_data; no_buckled_state.

    Raises:
        BadName: An option or constant that does not exist here.
        BadValue: No record, a record without conditions, an impossible bound.

    Example:
        >>> import jshell as js
        >>> from jshell.oscillator import random_shell, random_trace
        >>> found = js.calibration.fit_batch([random_trace(random_shell(seed), seed) for seed in range(3)])
        >>> [outcome.word for outcome in found.outcomes]
        ['ok', 'ok', 'ok']
    """
    for place, value, known in (
        ("solver", solver, SOLVERS),
        ("equilibrium", equilibrium, EQUILIBRIA),
        ("noise", noise, tuple(choices_of("noise"))),
        ("loss", loss, tuple(choices_of("loss"))),
    ):
        choose(place, value, known, expected=" or ".join(x for x in known if x))
    loss, records = records_of(traces, loss, channels)
    if loss == "modal" and solver != "exact":
        raise BadName(
            "solver",
            found=repr(solver),
            expected="'exact', the one that the modal loss has",
            remedy="The modal loss integrates nothing.",
        )
    box = box_of(loss, fix or {}, bounds or {})
    run = _Batch(records, loss, equilibrium, box, solver, progress)
    run.fit_all()
    study(run, run.usable, white=noise == "white")
    study(run, run.try_again(starts, np.random.default_rng(seed)), white=noise == "white")
    fit_autocorrelated(run)
    with np.errstate(all="ignore"):  # rows that failed hold anything; they are hidden there
        return read(run)


class _Batch(BatchState):
    """A batch and how it is fitted.

    Attributes:
        ends: Costs of all starts of the records tried again, inf where a start did not come to rest.
        done: Records told to `progress`.
    """

    def __init__(
        self,
        records: Recordings,
        loss: str,
        equilibrium: str,
        box: Box,
        solver: str,
        progress: Progress | None,
    ):
        channels, rows = records.channels, np.shape(records.values)[0]
        buckets, unusable = bucketed(records)
        if solver == "diffrax" and any(bucket.elapsed is not None for bucket in buckets):
            raise BadValue(
                "traces", found="uneven or missing samples", expected="even ones for diffrax", remedy="Use exact."
            )
        self.volume, self.pressure, buckled = rest_states(records, equilibrium)
        if equilibrium == "plateau":
            # a record that rests where its shell cannot is of another shell
            unusable = unusable | (buckled & rests_elsewhere(mean_volumes(records), self.volume))
        of = lambda name: np.broadcast_to(np.asarray(getattr(records.conditions, name), float), (rows,))  # noqa: E731
        self.gas_pressure, absolute = of("gas_pressure"), records.sigma is not None
        self.sigma = np.asarray(records.sigma, float) if absolute else np.full((rows, len(channels)), np.nan)
        self.solve = _solve if solver == "exact" else batch_diffrax.solve
        self.progress, self.done = progress, 0
        self.ends: dict[int, list[float]] = {}
        tried = np.full(rows, int(bool(buckets)))  # 0 where no record can be fitted
        super().__init__(
            channels, loss == "modal", absolute, box, buckets, unusable, buckled, of("kappa"),
            0.5 / (1 - of("poisson_ratio")), of("viscosity"), np.zeros(rows, int),
            nothing_found(rows, len(channels), modal=loss == "modal"), nothing_studied(rows, len(channels)),
            tried, tried.copy(),
        )  # fmt: skip

    def fit_all(self) -> None:
        """Every record from its own spectrum."""
        for bucket in self.buckets:
            self.counts[bucket.rows] = bucket.counts
            blank = np.full((4, bucket.rows.size), np.nan)
            found = self.lanes(bucket, np.arange(bucket.rows.size), blank, tell=True)
            for whole, part in zip(self.found, found, strict=True):
                whole[..., bucket.rows] = part

    def lanes(self, bucket: Bucket, chosen: np.ndarray, starts: np.ndarray, *, tell: bool = False) -> LaneResult:
        """Fit chosen records of a bucket, (4, chosen) starts, until all rest or rounds are out."""
        found = LaneResult(*(np.array(part) for part in self._round(bucket, chosen, starts, tell)))
        for _ in range(ROUNDS - 1):
            left = np.flatnonzero((found.status == RUNNING) & self.usable[bucket.rows[chosen]])
            if not left.size:
                break
            more = self._round(bucket, chosen[left], found.unknowns[:, left], False)
            steps = found.steps[left]
            for field, whole, part in zip(LaneResult._fields, found, more, strict=True):
                if field not in ("start", "identified"):
                    whole[..., left] = part
            found.steps[left] += steps
        return found

    def _round(self, bucket: Bucket, chosen: np.ndarray, starts: np.ndarray, tell: bool) -> LaneResult:
        """Seven steps of chosen records, block by block."""
        size, length = bucket.lanes, bucket.values.shape[2]
        cell = max(1, 2 ** int(np.log2(max(1, length // CELLS))))
        uneven = bucket.elapsed is not None
        together = blocks_for(size)
        parts = []
        for at in range(0, chosen.size, size * together):
            mine = chosen[at : at + size * together]
            lanes = np.resize(mine, size * together).reshape(together, size)  # a short block repeats its records
            rows = bucket.rows[lanes]
            used = -(-mine.size // size)

            def blocks(values, lanes=lanes, used=used):
                if together == 1:
                    return side_by_side(values[lanes[0]], padded(length))[None]
                whole = np.empty((together, *values.shape[1:-1], padded(length), size))
                whole[..., length:, :], whole[used:] = 0.0, 0.0
                for block in range(used):
                    whole[block, ..., :length, :] = np.moveaxis(values[lanes[block]], 0, -1)
                return whole

            inputs = BlockInput(
                blocks(bucket.even if uneven else bucket.values),
                bucket.counts[lanes].astype(float),
                bucket.steps[lanes],
                np.swapaxes(self.sigma[rows], 1, 2),
                self.volume[rows],
                self.pressure[rows],
                self.gas_pressure[rows],
                self.kappa[rows],
                self.area_modulus[rows],
                elapsed=blocks(bucket.elapsed) if uneven else None,
                uneven=blocks(bucket.values) if uneven else None,
                noise=None if bucket.noise is None else np.swapaxes(bucket.noise[lanes], 1, 2),
                modal=self.modal,
                volume_at=self.channels.index("V") if "V" in self.channels else 0,
            )
            first = np.swapaxes(
                np.resize(starts[:, at : at + mine.size].T, (together * size, 4)).reshape(together, size, 4), 1, 2
            )
            found = self.solve(inputs, first, *self.box.lanes(size), cell, np.asarray(used))
            flat = lambda x, n=mine.size: np.moveaxis(np.asarray(x), 0, -2).reshape(*x.shape[1:-1], -1)[..., :n]  # noqa: E731
            parts.append(LaneResult(*(flat(part) for part in found)))
            if tell and self.progress is not None:
                self.done += mine.size
                self.progress(self.done, self.unusable.size)
        return LaneResult(*(np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)))

    def try_again(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Random starts where asked for; several for records that ended badly or leave more than their noise.

        Returns:
            (rows,) those that were tried.
        """
        usable = self.usable
        tried = np.zeros(usable.size, bool)
        for care in (False, True):
            bad = usable & ((self.found.status != CONVERGED) | self.studied.misfit)
            if care and not 0 < bad.sum() <= HOPELESS:
                break
            for bucket in self.buckets:
                places, starts = [], []
                for j in np.flatnonzero(usable[bucket.rows] & (bad[bucket.rows] | (count > 0 and not care))):
                    row = bucket.rows[j]
                    rows = self._starts(bucket, j, row, (0 if care else count) + (6 if bad[row] else 0), random, care)
                    places += [j] * len(rows)
                    starts += rows
                if places:
                    tried[bucket.rows[np.unique(places)]] = True
                    self._keep_best(bucket, np.array(places), self.lanes(bucket, np.array(places), np.array(starts).T))

        return tried

    def _starts(
        self, bucket: Bucket, j: Any, row: Any, count: int, random: np.random.Generator, care: bool
    ) -> list[np.ndarray]:
        """Starts of one record: with care those of several truncation orders, then random ones."""
        rows, here, low, high = [], self.found.start[:, row], self.box.low, self.box.high
        if care:
            values = (bucket.values if bucket.even is None else bucket.even)[j][:, : bucket.counts[j]]
            modes = find_modes(bucket.steps[j] * np.arange(int(bucket.counts[j])), values)
            if modes is not None:
                rest = self.found.rest[:, row]
                record = _as_record(rest, self.kappa[row], self.area_modulus[row])
                held = low == high
                fix = dict(zip(NAMES[:2], np.exp(low[:2]), strict=True)) | {"k_vs": np.sqrt(abs(low[2]))}
                fix = {name: float(x) for (name, x), one in zip(fix.items(), held[:3], strict=True) if one}
                first = first_start("modal" if self.modal else "strict", [record], [modes], fix if self.modal else {})
                here = np.array([np.log(first[0]), np.log(first[1]), first[2], -np.log(modes.tau)])
                rows.append(here)
        for k in range(count):
            moved = here + np.array([0.3, 0.3, 0.1, 0.4]) * random.standard_normal(4)
            rows.append(moved * np.array([1, 1, -1 if k % 2 else 1, 1]))
        return [np.clip(one, low, high) for one in rows]

    def _keep_best(self, bucket: Bucket, places: np.ndarray, more: LaneResult) -> None:
        for j in np.unique(places):
            row, mine = bucket.rows[j], np.flatnonzero(places == j)
            rested = np.append(self.found.status[row], more.status[mine]) == CONVERGED
            costs = np.append(self.found.cost[row], more.cost[mine])
            ranked = np.where(rested & np.isfinite(costs), costs, np.inf)
            best = int(np.argmin(ranked))
            every = self.ends[int(row)] = [*self.ends.get(int(row), ranked[:1]), *ranked[1:]]
            if best and ranked[best] < ranked[0] * (1 - 1e-9):
                for whole, part in zip(self.found, more, strict=True):
                    whole[..., row] = part[..., mine[best - 1]]
            self.tried[row] = len(every)
            self.agreeing[row] = sum(c <= min(every) * (1 + 1e-7) for c in every) if np.isfinite(min(every)) else 0


def _as_record(rest: np.ndarray, kappa: Any, area_modulus: Any) -> Record:
    """What `strict_start` reads of a record."""
    conditions = Reduced(0.1, 1.0, 1.0, 1.0, kappa, 1 - 0.5 / area_modulus)
    blank = jnp.zeros(0)
    return Record(blank, blank, blank, conditions, RestState(*rest), ("V", "S"), True)

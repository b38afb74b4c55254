"""What a batch fit found: a table, one row per record.

Symbols    α1, α2, k_VS, β1 constants [-]   τ decay time   ω-, ω+ angular frequencies
           χ² sum of squared weighted residuals
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.special

from jshell.calibration.batch_examine import BatchState
from jshell.calibration.uncertainty import in_words
from jshell.calibration.undetermined import PART
from jshell.display import ended, number, readable, shown
from jshell.errors import Outcome, require_extra
from jshell.signals.lane_search import CONVERGED, RUNNING

if TYPE_CHECKING:
    import xarray

PARAMETERS = ("alpha1", "alpha2", "k_vs", "tau", "beta1")
STATE = ("delta_V", "delta_S", "V_rate", "S_rate", "V_rest", "S_rest")
WAVES = ("slow_cos", "slow_sin", "fast_cos", "fast_sin")
OPEN = "alpha1, alpha2, k_vs change together and move neither omega_minus, omega_plus nor tau: fix one of them"
SINGULAR = 1e-12  # of the scaled normal matrix's eigenvalues: a free direction leaves rounding, 1e-15, there


@dataclass(frozen=True)
class BatchResult:
    """One row per record.

    Attributes:
        values: (rows, 5) alpha1, alpha2, k_vs, tau, beta1; NaN where there is no answer (beta1 also without viscosity).
        stderr: (rows, 5) standard errors; NaN where there is none, 0 where fixed.
        covariance: (rows, 5, 5).
        omega: (rows, 2) undamped angular frequencies ω-, ω+.
        state: (rows, 6) ΔV, ΔS, dV/dt, dS/dt at the first sample; V and S at rest. Of the modal loss (rows, 5
            channels): cosine and sine of the slow and of the fast mode of every channel, then every channel at rest.
        rest: (rows, 2) V_e and P_e that the model was given.
        outcome: (rows,) integers of `Outcome`.
        chi_square: (rows,) weighted sum of squares.
        n_data: (rows,) numbers read.
        misfit: (rows,) whether the model leaves clearly more than the noise.
        start: (rows, 4) alpha1, alpha2, k_vs, tau where the search began.
        steps: (rows,) steps of the search.
        tried: (rows,) starts.
        agreeing: (rows,) those of them that ended in the best minimum.
        free_directions: (row, words) for every rank-deficient row.
        absolute: Errors come from given σ; else they are scaled by the reduced χ².
        memory: (rows, channels) φ of the noise from sample to sample; 0 where it passes as white.
        omega_stderr: (rows, 2) standard errors of `omega`.
        loss: `strict` or `modal`.
        channels: What was read.
    """

    values: np.ndarray
    stderr: np.ndarray
    covariance: np.ndarray
    omega: np.ndarray
    state: np.ndarray
    rest: np.ndarray
    outcome: np.ndarray
    chi_square: np.ndarray
    n_data: np.ndarray
    misfit: np.ndarray
    start: np.ndarray
    steps: np.ndarray
    tried: np.ndarray
    agreeing: np.ndarray
    free_directions: tuple[tuple[int, str], ...]
    absolute: bool
    memory: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    omega_stderr: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    loss: str = "strict"
    channels: tuple[str, ...] = ("V", "S")

    def __post_init__(self) -> None:
        for name, blank in (("memory", 0.0), ("omega_stderr", np.nan)):
            if len(getattr(self, name)) != len(self.outcome):  # of a file that does not say
                object.__setattr__(self, name, np.full((len(self.outcome), 2), blank))

    @readable
    def __repr__(self) -> str:
        sound = self.values[self.ok]
        medians = [f"median {name} {number(np.median(sound[:, i]))}" for i, name in enumerate(PARAMETERS) if len(sound)]
        misfits = int(np.sum(self.misfit))
        return shown(self, f"{len(self)} rows", *medians, f"{misfits} misfits" if misfits else "", ended(self.outcome))

    def __len__(self) -> int:
        return self.outcome.size

    @property
    def outcomes(self) -> list[Outcome]:
        """How each row ended."""
        return [Outcome(int(x)) for x in self.outcome]

    @property
    def ok(self) -> np.ndarray:
        """(rows,) converged, and the model describes the record."""
        return (self.outcome == Outcome.OK) & ~self.misfit

    def __getitem__(self, name: str) -> np.ndarray:
        """A parameter's (rows,) values."""
        return self.values[:, PARAMETERS.index(name)]

    def error_of(self, name: str) -> np.ndarray:
        """A parameter's (rows,) standard errors."""
        return self.stderr[:, PARAMETERS.index(name)]

    def interval(self, name: str, level: float | int = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """A parameter's (rows,) intervals, as `FitResult.interval` gives them: value ± error times Student's factor."""
        free = np.sum(self.stderr[:, :4] != 0, axis=1)
        worth = np.sum(self.n_data[:, None] / len(self.channels) * (1 - self.memory) / (1 + self.memory), axis=1)
        factor = scipy.special.stdtrit(np.maximum(worth - self.state.shape[1] - free, 4.0), (1 + level) / 2)
        return self[name] - factor * self.error_of(name), self[name] + factor * self.error_of(name)

    def columns(self) -> dict[str, np.ndarray]:
        """Every number by name, (rows,) each; for CSV and data frames."""
        found: dict[str, np.ndarray] = {"outcome": np.array([o.word for o in self.outcomes])}
        for i, name in enumerate(PARAMETERS):
            found[name], found[f"{name}_stderr"] = self.values[:, i], self.stderr[:, i]
        found |= {"omega_minus": self.omega[:, 0], "omega_plus": self.omega[:, 1]}
        if self.loss == "modal":
            found |= {"omega_minus_stderr": self.omega_stderr[:, 0], "omega_plus_stderr": self.omega_stderr[:, 1]}
        found |= {name: self.state[:, i] for i, name in enumerate(self.state_names)}
        found |= {"V_e": self.rest[:, 0], "P_e": self.rest[:, 1], "chi_square": self.chi_square}
        return found | {
            "n_data": self.n_data,
            "misfit": self.misfit,
            "steps": self.steps,
            "tried": self.tried,
            "agreeing": self.agreeing,
        }

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the columns of `state`."""
        if self.loss == "strict":
            return STATE
        waves = tuple(f"{channel}_{wave}" for channel in self.channels for wave in WAVES)
        return waves + tuple(f"{channel}_rest" for channel in self.channels)

    def rows(self) -> list[dict[str, object]]:
        """The same, one dictionary per record."""
        columns = self.columns()
        return [{name: values[i].item() for name, values in columns.items()} for i in range(len(self))]

    def to_xarray(self) -> "xarray.Dataset":
        """The table as a dataset over `row`; covariance over `row`, `parameter`, `parameter2`.

        Raises:
            MissingExtra: xarray is not installed.
        """
        xarray = require_extra("xarray", "io", "to_xarray")
        variables: dict[str, Any] = {name: ("row", values) for name, values in self.columns().items()}
        variables["covariance"] = (("row", "parameter", "parameter2"), self.covariance)
        names = {"parameter": list(PARAMETERS), "parameter2": list(PARAMETERS)}
        return xarray.Dataset(variables, coords={"row": np.arange(len(self)), **names})

    def __str__(self) -> str:
        lines = [f"[[Batch of {len(self)} records]]"]
        for outcome in sorted(set(self.outcomes)):
            lines.append(f"    {outcome.word:17} {int(np.sum(self.outcome == outcome)):6}: {outcome.advice}")
        if self.misfit.any():
            lines.append(f"    misfit            {int(self.misfit.sum()):6}: the model leaves more than the noise")
        again = self.tried > 1
        if again.any():
            agree = int(np.sum(self.agreeing[again] == self.tried[again]))
            lines.append(f"    tried again       {int(again.sum()):6}: every start agrees for {agree}")
        correlated = int(np.sum(self.memory.max(axis=1, initial=0.0) > 0))
        if correlated:
            lines.append(f"    autocorrelated    {correlated:6}: noise with a memory, allowed for")
        for name in PARAMETERS:
            good = self[name][self.ok & np.isfinite(self[name])]
            if good.size:
                low, middle, high = np.quantile(good, [0.16, 0.5, 0.84])
                lines.append(f"    {name:17} median {middle:.6g}, 68% in {low:.6g} … {high:.6g}")
        lines += [f"    row {row}: {words}" for row, words in self.free_directions[:10]]
        return "\n".join(lines)


def read(run: BatchState) -> BatchResult:
    """The table of a batch that has ended."""
    found, rows, box, channels = run.found, run.unusable.size, run.box, len(run.channels)
    u, finite = found.unknowns, run.finite
    ended = {CONVERGED: Outcome.OK, RUNNING: Outcome.NOT_CONVERGED}
    outcome = np.full(rows, int(Outcome.STALLED))
    for status, word in ended.items():
        outcome[found.status == status] = int(word)
    free = box.free
    at_bound = np.any(((u <= box.low[:, None]) | (u >= box.high[:, None])) & free[:, None], axis=0)
    outcome = np.where((outcome == Outcome.OK) & at_bound, int(Outcome.AT_BOUND), outcome)
    outcome = np.where(finite, outcome, int(Outcome.NOT_FINITE))
    outcome = np.where(run.buckled, outcome, int(Outcome.NO_BUCKLED_STATE))
    outcome = np.where(run.unusable, int(Outcome.UNUSABLE_DATA), outcome)

    values = np.full((rows, 5), np.nan)
    with np.errstate(all="ignore"):
        tau = np.exp(-u[3])
        wet = run.viscosity > 0
        beta1 = np.where(wet, np.exp(u[0]) / (2 * tau * np.where(wet, run.viscosity, 1.0)), np.nan)
        values[finite] = np.stack([np.exp(u[0]), np.exp(u[1]), _coupling(u[2], run), tau, beta1], axis=1)[finite]
    normal = np.moveaxis(found.normal, -1, 0)[:, free][:, :, free]
    inverse, deficient = _inverse(np.where(finite[:, None, None], normal, np.eye(int(free.sum()))))
    # autocorrelated noise scales errors by what its whitened residual leaves
    whitened = np.where(np.isnan(run.studied.whitened), found.cost, run.studied.whitened)
    linear = len(found.state)
    spread = whitened / np.maximum(channels * run.counts - linear - np.sum(~box.fixed), 1)
    scale = np.ones(rows) if run.absolute else np.where(finite, spread, np.nan)

    # (natural parameters, unknowns): d(alpha1, alpha2, k, tau, beta1)/d(log alpha1, log alpha2, k, log rate)
    slope = np.zeros((rows, 5, 4))
    for i, j, factor in ((0, 0, 0), (1, 1, 1), (3, 3, 3), (4, 0, 4), (4, 3, 4)):
        slope[:, i, j] = values[:, factor] * (-1 if i == 3 else 1)
    with np.errstate(all="ignore"):
        # at k_VS = 0, its bound, the square has no slope
        slope[:, 2, 2] = np.where(values[:, 2] == 0, 1.0, 0.5 / values[:, 2]) if run.modal else 1.0
        slope = slope[:, :, free]
        of_unknowns = inverse * scale[:, None, None]
        covariance = slope @ of_unknowns @ np.swapaxes(slope, 1, 2)
        stderr = np.sqrt(np.einsum("rii->ri", covariance))
        by_unknowns = np.transpose(found.slope, (2, 1, 0))[:, :, free]
        omega_stderr = np.sqrt(np.einsum("rij,rjk,rik->ri", by_unknowns, of_unknowns, by_unknowns))

    directions = []
    names = tuple(
        name for name, is_free in zip(("alpha1", "alpha2", "k_vs", "decay rate"), free, strict=True) if is_free
    )
    for row in np.flatnonzero(
        deficient & np.isin(outcome, (int(Outcome.OK), int(Outcome.AT_BOUND), int(Outcome.STALLED)))
    ):
        outcome[row] = int(Outcome.RANK_DEFICIENT)
        omega_stderr[row] = np.nan
        size = np.sqrt(np.maximum(np.diag(normal[row]), 1e-300))
        direction = np.linalg.eigh(normal[row] / np.outer(size, size))[1][:, 0] / size
        if 2 in np.flatnonzero(free):
            where = int(np.searchsorted(np.flatnonzero(free), 2))
            direction[where] /= max(abs(values[row, 2]), 1e-12)
        words = in_words(direction / np.linalg.norm(direction), names)
        directions.append((int(row), f"{words} changes nothing in this record: fix one of them"))
        stderr[row], covariance[row] = np.nan, np.nan
        # what the direction moves is undetermined, and what follows from it; the rest stays
        moved = np.flatnonzero(free)[np.abs(direction) > PART * np.abs(direction).max()]
        values[row, moved] = np.nan
        if {0, 3} & set(moved.tolist()):
            values[row, 4] = np.nan
    if box.held:
        ended_well = np.isin(outcome, (int(Outcome.OK), int(Outcome.AT_BOUND)))
        outcome[ended_well] = int(Outcome.RANK_DEFICIENT)
        directions += [(int(row), OPEN) for row in np.flatnonzero(ended_well)]
        moved = [0, 1, 2, 4]
        values[:, moved], stderr[:, moved] = np.nan, np.nan
        covariance[:, moved, :], covariance[:, :, moved] = np.nan, np.nan
    misfit = finite & run.studied.misfit
    ended_well = np.isin(outcome, [int(one) for one in (Outcome.OK, Outcome.AT_BOUND, Outcome.RANK_DEFICIENT)])
    lost = ~(finite & ended_well)  # a search that did not come to rest determines nothing
    values[lost] = np.nan
    hide = lambda x: np.where(lost.reshape(-1, *[1] * (x.ndim - 1)), np.nan, x)  # noqa: E731
    begun = found.start
    start = np.stack([np.exp(begun[0]), np.exp(begun[1]), _coupling(begun[2], run), np.exp(-begun[3])], axis=1)
    return BatchResult(
        values, hide(stderr), hide(covariance), hide(found.omega.T), hide(found.state.T), hide(found.rest.T), outcome,
        hide(found.cost), channels * run.counts, misfit, hide(start), found.steps, run.tried, run.agreeing,
        tuple(directions), run.absolute, run.studied.memory, hide(omega_stderr), "modal" if run.modal else "strict",
        run.channels,
    )  # fmt: skip


def _coupling(unknown: np.ndarray, run: BatchState) -> np.ndarray:
    """k_VS of what the search sees."""
    if not run.modal:
        return unknown
    size = np.sqrt(np.maximum(unknown, 0.0))
    return -size if run.box.negative else size


def _inverse(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses of (rows, n, n) normal matrices, and which of them have a free direction."""
    size = np.sqrt(np.maximum(np.einsum("rii->ri", normal), 1e-300))
    unit = normal / (size[:, :, None] * size[:, None, :])
    n = normal.shape[1]
    with np.errstate(all="ignore"):
        determinant = np.linalg.det(unit)
    doubtful = ~(determinant > 1e-9)
    deficient = np.zeros(len(normal), bool)
    for row in np.flatnonzero(doubtful):
        if not np.all(np.isfinite(unit[row])):
            deficient[row] = True
            continue
        deficient[row] = np.linalg.eigvalsh(unit[row])[0] <= SINGULAR * n
    safe = np.where(deficient[:, None, None], np.eye(n), unit)
    return np.linalg.inv(safe) / (size[:, :, None] * size[:, None, :]), deficient

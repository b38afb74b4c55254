"""What an inversion found: the report of the calibrations, with curves and profiles of the simulator.

Symbols    J = ∂r/∂u at the minimum, amplitudes following   s² reduced χ²
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.special

from jshell.calibration.estimate import Estimate, Start
from jshell.calibration.noise import Noise
from jshell.calibration.rendering import page, record, text
from jshell.calibration.result import Fit
from jshell.calibration.uncertainty import LOOSE, Uncertainty, loose_directions, uncertainty
from jshell.calibration.undetermined import hidden, open_constants, without_open
from jshell.calibration.versions import versions
from jshell.display import ended, number, readable, shown
from jshell.errors import NotOk, Outcome
from jshell.inversion.exact import doubted
from jshell.inversion.model import Model, Weighing
from jshell.inversion.noise import described
from jshell.inversion.recording import Recording
from jshell.inversion.search import SearchResult, prior_rows
from jshell.inversion.unknowns import plain
from jshell.inversion.words import ADVICE, open_direction

if TYPE_CHECKING:
    from jshell.inversion.next_recording import Prospects
    from jshell.inversion.posterior import SimulatorPosterior
    from jshell.inversion.profile import Profile

SAME = 1.0  # of χ²: starts that ended nearer than this ended in one minimum


@dataclass(frozen=True, eq=False)
class Inversion(Fit):
    """What shell recordings are of.

    Attributes:
        units: SI unit of every estimate, or that without units.
        levels: Standard errors of what the solver sees, for intervals that are symmetric in logarithms.
        logarithmic: Which estimates have such intervals.
    """

    units: tuple[str, ...] = ()
    levels: tuple[float, ...] = ()
    logarithmic: tuple[bool, ...] = ()
    model: Model | None = field(default=None, repr=False)
    solution: SearchResult | None = field(default=None, repr=False)
    weighings: tuple[Weighing, ...] = field(default=(), repr=False)

    @readable
    def __repr__(self) -> str:
        values = [
            f"{one.name} undetermined"
            if one.undetermined
            else f"{one.name} {number(one.value)} ± {number(one.stderr)} {u}"
            for one, u in zip(self.estimates, self.units, strict=False)
            if one.role == "constant"
        ]
        return shown(
            self, self.title, *values, f"reduced χ² {number(self.reduced_chi_square)}", f"{self.n_data} data",
            f"{len(self.warnings)} warnings" if self.warnings else "", ended(self.outcome),
        )  # fmt: skip

    def __str__(self) -> str:
        return self.report()

    def _repr_html_(self) -> str:
        """The report for notebooks."""
        return page(self)

    def report(self, *, smallest_correlation: float = 0.1) -> str:
        """The result as text."""
        return text(self, smallest_correlation=smallest_correlation)

    def record(self) -> dict:
        """The result as a JSON object; missing numbers are null."""
        finite = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        rows = record(self)
        rows["units"] = {one.name: unit for one, unit in zip(self.estimates, self.units, strict=True)}
        rows["intervals"] = {name: [finite(x) for x in self.interval(name)] for name in self.varied}
        rows["noise"] = [one.words() for one in self.noise]
        rows["advice"] = self.advice
        return rows

    def interval(self, name: str, level: float | int = 0.95) -> tuple[float, float]:
        """Interval from the covariance, by Student's factor; of positive unknowns symmetric in the logarithm.

        Args:
            name: Of an estimate.
            level: Of confidence.
        """
        if name not in self.varied:
            return super().interval(name, level)
        k = self.varied.index(name)
        factor = float(scipy.special.stdtrit(self.freedom, (1 + level) / 2)) * self.levels[k]
        value = self[name].value
        if self.logarithmic[k]:
            return value * float(np.exp(-factor)), value * float(np.exp(factor))
        return value - factor, value + factor

    def curves(self) -> tuple[dict[str, np.ndarray], ...]:
        """Per recording, channel to the fitted curve at `times` [SI, or without units].

        Raises:
            NotOk: The search ended nowhere, and there is no curve.
        """
        if self.solution is None or not self.solution.projections:
            raise NotOk(self.title, self.outcome)
        pairs = zip(self.recordings, self.solution.projections, strict=True)
        return tuple(dict(zip(one.channels, projection.curve, strict=True)) for one, projection in pairs)

    def times(self) -> tuple[np.ndarray, ...]:
        """Per recording, the times that were fitted [s, or time unit]."""
        return tuple(one.times for one in self.recordings)

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """What was fitted, as it was read."""
        return () if self.model is None else self.model.recordings

    def profile(self, names: Sequence[str] | None = None, *, level: float = 0.95) -> "Profile":
        """Asymmetric intervals by profile likelihood; see `jshell.inversion.profile`.

        Args:
            names: Of unknowns; by default all.
            level: Of confidence.

        Raises:
            NotOk: The inversion is not ok.
        """
        from jshell.inversion.profile import profile

        self.require_ok()
        assert self.model is not None
        assert self.solution is not None
        scale = 1.0 if self.absolute else self.reduced_chi_square
        return profile(
            self.model, self.solution, self.weighings, names or self.varied, level=level, freedom=self.freedom,
            scale=scale, stderr=np.array(self.levels),
        )  # fmt: skip

    def posterior(
        self, draws: int = 1000, *, warmup: int = 500, chains: int = 2, seed: int = 0
    ) -> "SimulatorPosterior":
        """Draws from the posterior by NUTS; see `jshell.inversion.posterior`.

        Args:
            draws, warmup: Of each chain.
            chains: One after the other.
            seed: Of the draws.

        Raises:
            NotOk: The inversion is not ok.
            MissingExtra: NumPyro is not installed.
        """
        from jshell.calibration.posterior import SamplerSettings
        from jshell.inversion.posterior import posterior

        self.require_ok()
        return posterior(self, SamplerSettings(draws, warmup, chains, seed))

    def spread(self) -> np.ndarray:
        """(unknowns, unknowns) covariance of what the solver sees: logarithms of positive unknowns."""
        factors = [self[n].value if log else 1.0 for n, log in zip(self.varied, self.logarithmic, strict=True)]
        return self.covariance / np.outer(factors, factors)

    def next_recording(self, candidates: Sequence[Mapping[str, Any]] | None = None) -> "Prospects":
        """How well the unknowns would be known with one more recording, of each of several kinds.

        Args:
            candidates: Each the numbers that are otherwise than in the first recording, such as `outer_pressure`;
                also `channels`, a name or several, `samples`, their number, and `length`, in lengths of the first.
                None takes the usual ones: channels alone, three outer pressures, twice the rate, twice the length.

        Raises:
            NotOk: The inversion is not ok.
            BadName: No such number or channel, or a number that is unknown.
            BadValue: An echo beside what is seen.
        """
        from jshell.inversion.next_recording import next_recording

        self.require_ok()
        assert self.model is not None
        assert self.solution is not None
        return next_recording(self.model, self.solution, self.weighings, self.spread(), candidates)

    @property
    def advice(self) -> str:
        """What to do about the outcome."""
        return ADVICE.get(self.outcome, self.outcome.advice)

    def require_ok(self) -> "Inversion":
        """The same result, or `NotOk`."""
        if self.outcome != Outcome.OK:
            raise NotOk(self.title, self.outcome, self.advice)
        return self


class Settled(NamedTuple):
    """A minimum, how its recordings were weighed, and the noise that it leaves of them; none where none was sought."""

    best: SearchResult
    weighings: list[Weighing]
    noises: list[list[Noise]]


def drawn_up(
    model: Model,
    settled: Settled,
    solutions: Sequence[SearchResult],
    notes: Sequence[str],
    warnings: Sequence[str],
    rivals: Sequence[SearchResult] = (),
    *,
    doubt: np.ndarray | None = None,
) -> Inversion:
    """The result of a minimum; `doubt` (unknowns,) is how far the simulator's own error moves it, where known."""
    best, weighings, noises = settled
    names, parameters = model.parameters.names, model.parameters
    values, logarithmic = parameters.to_values(best.u), parameters.logarithmic
    flat = tuple(one for part in noises for one in part)
    known_notes = tuple(model.known_notes(k, one) for k, one in enumerate(weighings))
    if not best.projections or not np.isfinite(best.cost):
        return _nothing(model, best, solutions, (*known_notes, *notes), warnings)
    residual = np.concatenate([one.residual for one in best.projections])
    errors, linear = _errors(model, best, residual)
    doubt = doubted(model, best, list(weighings)) if doubt is None else doubt
    errors = _widened(errors, doubt)
    outcome, open_ones, directions = _judged(model, best, errors)
    extra = list(warnings)
    if rivals and outcome == Outcome.OK:
        outcome = Outcome.RANK_DEFICIENT
        open_ones = dict.fromkeys(names, "two shells describe the recordings equally well")
        for rival in rivals:
            other = ", ".join(f"{n} {v:.4g}" for n, v in zip(names, parameters.to_values(rival.u), strict=True))
            here = ", ".join(f"{n} {v:.4g}" for n, v in zip(names, values, strict=True))
            directions.append(f"as well as {here} the recordings allow {other}: know one of them, or record more modes")
    scale = np.where(logarithmic, values, 1.0)
    estimates = [
        Estimate(n, float(v), float(e * s), reason, float(b))
        for n, v, e, s, reason, b in zip(
            names, values, errors.stderr, scale, errors.reasons, parameters.to_values(best.begun), strict=True
        )
    ]
    estimates = [hidden(e, open_ones[e.name]) if e.name in open_ones else e for e in estimates]
    covariance = errors.covariance * np.outer(scale, scale)
    return Inversion(
        title=model.title,
        outcome=outcome,
        estimates=tuple(estimates),
        derived=_derived(model, best, errors, open_ones),
        covariance=without_open(covariance, names, open_ones),
        correlation=without_open(errors.correlation, names, open_ones),
        varied=names,
        residual=residual,
        chi_square=float(residual @ residual),
        n_data=residual.size,
        n_varied=len(names) + linear,
        absolute=all(one.sigma is not None for one in model.recordings),
        free_directions=tuple(directions),
        starts=_starts(model, solutions),
        notes=(*known_notes, *notes, *(one.words() for one in flat)),
        warnings=tuple(extra),
        noise=flat,
        traces=tuple(one.trace for one in model.recordings),
        versions=versions(),
        units=tuple(parameters.table[plain(n)].unit for n in names),
        levels=tuple(errors.stderr),
        logarithmic=tuple(bool(x) for x in logarithmic),
        model=model,
        solution=best,
        weighings=tuple(weighings),
    )


def _nothing(
    model: Model, best: SearchResult, solutions: Sequence[SearchResult], notes: tuple[str, ...], warnings: Sequence[str]
) -> Inversion:
    """The result of a search that ended nowhere."""
    names = model.parameters.names
    outcome = best.outcome if best.outcome != Outcome.OK else Outcome.NOT_CONVERGED
    size = len(names)
    return Inversion(
        model.title, outcome,
        tuple(Estimate(n, np.nan, reason="no start led to a shell that describes the recordings") for n in names), (),
        np.full((size, size), np.nan), np.full((size, size), np.nan), names, np.array([np.nan]), float("nan"),
        sum(one.values.size for one in model.recordings), size, False, starts=_starts(model, solutions), notes=notes,
        warnings=tuple(warnings), traces=tuple(one.trace for one in model.recordings), versions=versions(),
        units=tuple(model.parameters.table[plain(n)].unit for n in names), levels=(np.nan,) * size,
        logarithmic=tuple(bool(x) for x in model.parameters.logarithmic), model=model, solution=best,
    )  # fmt: skip


def _errors(model: Model, best: SearchResult, residual: np.ndarray) -> tuple[Uncertainty, int]:
    """Errors of u, with the amplitudes projected out."""
    J = []
    for one in best.projections:
        q = np.linalg.svd(one.basis / np.linalg.norm(one.basis, axis=0), full_matrices=False)[0]
        J.append(one.held - q @ (q.T @ one.held))
    linear = sum(one.basis.shape[1] for one in best.projections)
    size = np.where(model.parameters.logarithmic, 1.0, best.u)
    return uncertainty(
        np.concatenate(J),
        residual,
        np.where(size == 0, 1.0, size),
        count=residual.size - linear,
        absolute=all(one.sigma is not None for one in model.recordings),
        prior=prior_rows(model, best.u)[1],
    ), linear


def _widened(errors: Uncertainty, doubt: np.ndarray) -> Uncertainty:
    """Errors with what is not noise: what may be wrong of the mesh's limit."""
    if not doubt.any():
        return errors
    covariance = errors.covariance + np.outer(doubt, doubt)
    stderr = np.where(np.isfinite(errors.stderr), np.sqrt(np.diag(covariance)), errors.stderr)
    safe = np.where(stderr > 0, stderr, np.nan)
    return replace(errors, covariance=covariance, stderr=stderr, correlation=covariance / np.outer(safe, safe))


def _judged(model: Model, best: SearchResult, errors: Uncertainty) -> tuple[Outcome, dict[str, str], list[str]]:
    """Outcome, unknowns that are not determined with the reason, and what is left open in words."""
    names, logarithmic = model.parameters.names, model.parameters.logarithmic
    size = np.where(logarithmic, 1.0, best.u)
    # a gradient may leave two unknowns free that stand in it only together; the covariance then is that of the rest
    open_now = [(row, None) for row in errors.null]
    open_now += loose_directions(errors.covariance, size)
    outcome = best.outcome
    if outcome == Outcome.AT_BOUND and not np.any(
        _on_bound(model, best.u) & ~np.array(model.parameters.nuisance, bool)
    ):
        outcome = Outcome.OK  # of a number that nobody asked for: there is no less than no weak spot
    # in a valley without a floor the search finds no rest: that is why
    settled = outcome in (Outcome.OK, Outcome.AT_BOUND) or len(errors.null) or described(model, best.projections)
    if open_now and settled:
        outcome = Outcome.RANK_DEFICIENT
    found = open_constants(names, size, errors, outcome)
    for row, error in open_now:
        for i in np.flatnonzero(np.abs(row) > LOOSE * np.abs(row).max()):
            reason = "the recordings leave a combination with it free"
            found.setdefault(names[i], reason if error is None else f"known to {100 * error:.0f}% only")
    return outcome, found, [open_direction(row, names, logarithmic.tolist(), error) for row, error in open_now]


def _on_bound(model: Model, u: np.ndarray) -> np.ndarray:
    """Which unknowns rest on a bound."""
    low, high = model.parameters.to_u(model.parameters.low), model.parameters.to_u(model.parameters.high)
    return (u <= low) | (u >= high)


def _derived(model: Model, best: SearchResult, errors: Uncertainty, open_ones: dict[str, str]) -> tuple[Estimate, ...]:
    """The numbers without units, and the unit of time, of the first recording."""
    if not model.parameters.si or open_ones:
        return ()
    seen, mine = model.seen(0, best.u)
    gradient = np.zeros((5, best.u.size))
    for i in mine:
        change, time, _ = seen.slope(plain(model.parameters.names[i]))
        gradient[:4, i], gradient[4, i] = change[:4], seen.time * time
    stderr = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", gradient, errors.covariance, gradient), 0.0))
    values = (*seen.numbers[:4], seen.time)
    keys = ("d_hat", "P0_hat", "Pext_hat", "eta_hat", "time unit [s]")
    return tuple(Estimate(k, float(v), float(e), role="derived") for k, v, e in zip(keys, values, stderr, strict=True))


def _starts(model: Model, solutions: Sequence[SearchResult]) -> tuple[Start, ...]:
    lowest = min((one.cost for one in solutions if np.isfinite(one.cost)), default=np.inf)
    return tuple(
        Start(
            tuple(float(x) for x in model.parameters.to_values(one.begun)), float(one.cost), one.outcome, one.steps,
            bool(one.cost < lowest * (1 + 1e-3) + SAME),
        )
        for one in solutions
    )  # fmt: skip

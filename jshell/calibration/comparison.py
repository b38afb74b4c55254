"""Models of one record side by side: how many motions does it hold, and does the oscillator explain them?

Every model sees the same samples with the same weights, so that χ², AIC and BIC
compare. `one`, `two`, `three modes` are sums of damped sinusoids with one decay;
`modal` is the oscillator through its two frequencies; `strict` is the oscillator itself.

Symbols    χ² misfit   k varied parameters   AIC = N ln(χ²/N) + 2k   BIC = N ln(χ²/N) + k ln N
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jshell.calibration.data import chosen_channels, windowed
from jshell.calibration.misfit import noise_of_channel
from jshell.calibration.noise import MISFIT, Noise, envelope_chance, lag_one, peak_chance, runs
from jshell.calibration.records import record, rest_state
from jshell.calibration.report import FitResult, FitWarning
from jshell.calibration.trajectories import fit_trajectories
from jshell.calibration.uncertainty import information
from jshell.errors import BadShape, BadValue, JshellError, Outcome, RangeWarning, choose
from jshell.signals.waves_from_data import model_orders
from jshell.trace import Trace

MODELS = ("one mode", "two modes", "three modes", "modal", "strict")
CLEAR = 10.0  # difference of BIC that counts as very strong (Kass & Raftery 1995)


@dataclass(frozen=True)
class Row:
    """One model.

    Attributes:
        name: One of `MODELS`.
        chi_square, count: Weighted misfit, varied parameters.
        aic, bic: Smaller is better.
        left: rms of what is left over rms of the motion, all channels together.
        over_noise: The same over the noise.
        white: Whether what is left passes the tests of white noise.
        outcome: How the fit ended.
    """

    name: str
    chi_square: float
    count: int
    aic: float
    bic: float
    left: float
    over_noise: float
    white: bool
    outcome: Outcome


@dataclass(frozen=True)
class ModelComparison:
    """Models of one record, best BIC first, with what follows in words."""

    rows: tuple[Row, ...]
    channels: tuple[str, ...]
    samples: int
    verdict: str

    def __getitem__(self, name: str) -> Row:
        known = {row.name: row for row in self.rows}
        return known[choose("model", name, known)]

    def report(self) -> str:
        """The table as text."""
        lines = [f"[[Models of {', '.join(self.channels)}, {self.samples} samples]]"]
        lines.append(
            f"    {'model':12} {'k':>3} {'χ²':>11} {'AIC':>10} {'BIC':>10} {'left':>7} {'/noise':>7}  residual"
        )
        for row in self.rows:
            noise = f"{row.over_noise:.2f}"
            tail = ("white" if row.white else "not white") + (
                "" if row.outcome == Outcome.OK else f", {row.outcome.word}"
            )
            lines.append(
                f"    {row.name:12} {row.count:3d} {row.chi_square:11.5g} {row.aic:10.4g} {row.bic:10.4g} "
                f"{100 * row.left:6.2f}% {noise:>7}  {tail}"
            )
        return "\n".join([*lines, f"    {self.verdict}"])

    def record(self) -> dict:
        """The table as a JSON object."""
        rows = [
            {
                "model": row.name,
                "chi_square": row.chi_square,
                "n_varied": row.count,
                "aic": row.aic,
                "bic": row.bic,
                "left": row.left,
                "over_noise": row.over_noise,
                "white": row.white,
                "outcome": row.outcome.word,
            }
            for row in self.rows
        ]
        return {"channels": list(self.channels), "samples": self.samples, "models": rows, "verdict": self.verdict}


def compare(
    trace: Trace,
    *,
    channels: Sequence[str] | None = None,
    equilibrium: str = "plateau",
    start: float | int | None = None,
    stop: float | int | None = None,
) -> ModelComparison:
    """Which models describe one record.

    Args:
        trace: With conditions.
        channels: Those to read; the strict oscillator joins in where they are V and S.
        equilibrium: Rest state of the oscillator, `plateau` or `trace`.
        start, stop: Window, as in `fit_trajectories`.

    Raises:
        BadName: A channel that the trace does not have.
        BadValue: A trace that cannot be fitted; errors that change within a channel.
    """
    cut = windowed(trace, start, stop)
    loss, names = chosen_channels(cut, None, channels)
    one = cut[0]
    for name in names:
        if name in one.sigma and np.ptp(np.asarray(one.sigma[name])) > 1e-9 * np.max(np.asarray(one.sigma[name])):
            raise BadValue(
                f"sigma[{name!r}]",
                found="errors that change from sample to sample",
                expected="one σ for each channel, by which sums of damped sinusoids are weighed",
                remedy="Give the channel's mean σ, or leave it out.",
            )
    times = np.asarray(one.times, dtype=float)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)
        offset = float(np.mean(np.asarray(one["V"]))) if "V" in names else None
        state, _ = rest_state(one, offset, equilibrium, 1)
    prepared = record(one, names, state)
    weight, data = np.asarray(prepared.weight), np.asarray(prepared.data)
    noise = np.array([noise_of_channel(prepared, one, i) or 0.0 for i in range(len(names))])
    rows: list[Row | None] = [*_modes(times, data, weight, noise)]
    for model in ("modal", *(("strict",) if loss == "strict" else ())):
        rows.append(_oscillator(model, one, names, equilibrium, data, weight, noise))
    found = [row for row in rows if row is not None]
    if not found:
        raise BadShape("trace", found="no model that fits it", expected="a ring-down", remedy="Choose another window.")
    found.sort(key=lambda row: row.bic)
    return ModelComparison(tuple(found), names, data.size, _conclusion(found))


def _row(
    name: str, r: np.ndarray, count: int, data: np.ndarray, weight: np.ndarray, noise: np.ndarray, end: Outcome
) -> Row:
    left = r.reshape(data.shape) / weight
    chi_square, size = float(r @ r), r.size
    aic, bic = information(chi_square, size, count)
    scatter = data.std(axis=1)
    over = float(np.sqrt(np.mean(left**2 / np.maximum(noise, 1e-300)[:, None] ** 2)))
    tests = [_tested(rows) for rows in left]
    return Row(
        name,
        chi_square,
        count,
        aic,
        bic,
        float(np.sqrt(np.mean(left**2 / scatter[:, None] ** 2))),
        over,
        not any(one.correlated or one.coherent for one in tests),
        end,
    )


def _tested(left: np.ndarray) -> Noise:
    lag1, z = lag_one(left)
    chances = float(peak_chance(left)), envelope_chance(left)
    return Noise("", left.size, float(lag1), float(z), float(runs(left)), 0.0, float(left.size), *chances)


def _oscillator(loss: str, trace: Trace, names: tuple[str, ...], equilibrium: str, data, weight, noise) -> Row | None:
    """The oscillator, whichever loss; None where it cannot be asked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)
        warnings.simplefilter("ignore", RangeWarning)
        try:
            found: FitResult = fit_trajectories(
                trace,
                loss,
                channels=names,
                equilibrium=equilibrium,
                start=float(np.asarray(trace.times)[0]),
                noise="white",
            )
        except JshellError:
            return None  # no rest state, or no viscosity for beta1: the sums of sinusoids stand alone
    # one shape's two frequencies are two numbers, however many constants share them
    count = found.n_varied - (1 if loss == "modal" else 0)
    return _row(loss, np.asarray(found.residual), count, data, weight, noise, found.outcome)


def _modes(times: np.ndarray, data: np.ndarray, weight: np.ndarray, noise) -> list[Row]:
    """Sums of one, two and three damped sinusoids that share a decay; none where no start comes to rest."""
    scaled = (data - data.mean(axis=1, keepdims=True)) * weight
    elapsed = times - times[0]
    rows = []
    for solutions in model_orders(elapsed, scaled):
        if not solutions or not solutions[0].at_rest:
            continue
        best = solutions[0]
        varied = best.unknowns.size + best.linear.size
        left = (best.curve(elapsed) - scaled).ravel()
        rows.append(_row(MODELS[best.model.modes - 1], left, varied, data, weight, noise, Outcome.OK))
    return rows


def _conclusion(rows: list[Row]) -> str:
    """The comparison in plain words."""
    known = {row.name: row for row in rows}
    waves = [known[name] for name in MODELS[:3] if name in known]
    parts = []
    if waves:
        fewest = waves[0]
        for row in waves[1:]:
            if row.bic < fewest.bic - CLEAR:
                fewest = row
        parts.append(f"The record holds {fewest.name.replace(' modes', '').replace(' mode', '')} "
                     f"mode{'' if fewest.name.startswith('one') else 's'} by BIC")  # fmt: skip
        if not fewest.white:
            parts[-1] += ", and even so what is left is not white noise"
    if "modal" in known and "two modes" in known:
        if known["modal"].bic <= known["two modes"].bic + CLEAR:
            parts.append("two frequencies and one decay are all that the modal fit asks, and the record has them")
        else:
            parts.append(
                "the oscillator cannot have the two frequencies of the record: conditions or rest state are off"
            )
    if "strict" in known:
        rivals = [row for row in rows if row.name != "strict"]
        strict, best = known["strict"], min(rivals, key=lambda row: row.bic, default=None)
        gap = 0.0 if best is None else strict.bic - best.bic
        if gap < CLEAR and (strict.white or strict.over_noise < MISFIT):
            parts.append("the strict oscillator describes V and S")
        else:
            parts.append(
                f"the strict oscillator does not describe V and S: it leaves {100 * strict.left:.2g}% of the motion "
                f"(BIC {gap:+.4g} against {best.name if best else 'nothing'}); do not quote its constants"
            )
    return "; ".join(parts) + "."

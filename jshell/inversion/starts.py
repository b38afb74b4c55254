"""Where a search begins: shells of a stored table that ring and rest as the recordings do.

The table is interpolated in the logarithms of thickness and gas pressure, in the volume by the plateau law, the root
of the viscosity and the pad. Many values of the unknowns are drawn inside their bounds, the best are drawn around
again, and a few that lie apart are where the simulator begins. No published constant and no header says where.

Symbols    Ω damped frequency   τ decay time   v V/V0 by the plateau law   û unknowns over their spans
Valid for  κ 1.4 and ν 1/2, nearly: starts only
Source     data/modes/make_ringing.py
"""

from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.stats import qmc

from jshell.inversion.recording import POWER, Recording
from jshell.inversion.unknowns import LENGTH, POWERS, TIME, ParameterSet, plain
from jshell.shell.rest import plateau_pressure

TABLE = "ringing.csv"
PLACED = ("thickness", "gas_pressure", "outer_pressure", "viscosity")  # the table's columns before the pad
DRAWS = 4096
ROUNDS, AROUND, MAX_STARTS = 6, 1024, 24
SPREADS = {"frequency": 0.04, "decay": 0.35, "rest": 0.02}  # of the interpolation, relative
STARTS, IN_ALL = 4, 8  # tried in any case; with those that are tried where they leave a misfit
APART = 0.05  # of the bounds' span: starts nearer than this are one
ELSEWHERE = 0.15  # of the span too, between starts that are tried where the best leave a misfit
WORSE = 60.0  # of χ² above the best that a start may lie which is tried in any case
OUTSIDE = 1e4
PREFERRED = 1.0  # of χ², for each mode passed over
OVERTONE, MISSED = 2.0, 30.0  # of χ², for a frequency that is an octave, and for one that is nothing
OVERDAMPED = 0.15  # 1/(τ Ω) by the wall alone, up to which a mode is found in any case
TINY = 1e-300  # a time that adds nothing to any decay
OCTAVE = 0.15  # how far from twice the other the frequency of a large, decaying motion may be


class Table:
    """The stored shells, free or held, interpolated."""

    def __init__(self, rows: np.ndarray, held: bool) -> None:
        self.held = held
        x = self.place(*rows[:, :5].T)
        rates = rows[:, 5:11].reshape(-1, 3, 2)
        y = np.concatenate([np.log(rates[..., 1]), np.log(-rates[..., 0]), rows[:, 11:15]], axis=1)
        self.low, self.high = x.min(axis=0), x.max(axis=0)
        self.low[3] = 0.0  # an ideal liquid is not far from the least viscous
        self._interpolate = RBFInterpolator(x, y, kernel="cubic", smoothing=1e-6, neighbors=None)

    def place(self, d, gas, outer, viscosity, pad) -> np.ndarray:
        """(points, coordinates) where conditions lie in the table."""
        excess = np.maximum(outer - np.asarray(plateau_pressure(d)), 1e-9)
        ratio = (gas / excess) ** (1 / 1.4)
        columns = [np.log(d) / 2.6, np.log(gas) / 4.4, ratio / 0.5, np.sqrt(viscosity) / 0.22]
        return np.stack([*columns, pad / 0.48] if self.held else columns, axis=-1)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """log Ω, log 1/τ (points, 3), rest values of H, W, V, S (points, 4), and how far outside the table."""
        inside = np.clip(x, self.low, self.high)
        found = self._interpolate(inside)
        return found[:, :3], found[:, 3:6], found[:, 6:], np.abs(x - inside).sum(axis=1)


@lru_cache(maxsize=2)
def table(held: bool) -> Table:
    """The stored shells."""
    checkout = Path(__file__).resolve().parents[2] / "data" / "modes" / TABLE
    path = checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / TABLE))
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = np.loadtxt(lines[1:], delimiter=",")
    return Table(rows[(rows[:, 4] > 0) == held], held)


def starts(recordings: tuple[Recording, ...], parameters: ParameterSet) -> tuple[np.ndarray, int]:
    """(starts, unknowns) as the solver sees them, the most promising first; and how many are nearly as promising."""
    low, high = parameters.to_u(parameters.low), parameters.to_u(parameters.high)
    cost = lambda draws: promise(recordings, parameters, low + draws * (high - low))  # noqa: E731
    draws = qmc.Sobol(low.size, seed=0).random(DRAWS)  # pyright: ignore[reportCallIssue]
    centres = [
        _about(prior, lo, hi, log)
        for prior, lo, hi, log in zip(parameters.priors, low, high, parameters.logarithmic.tolist(), strict=True)
    ]
    for i, centre in enumerate(centres):
        if centre is not None:  # what is known beforehand is drawn from that
            draws[:, i] = np.clip(centre[0] + centre[1] * (4 * draws[:, i] - 2), 0, 1)
    chi = cost(draws)
    swept, of_swept = draws, chi
    generator = np.random.default_rng(0)
    spread = 0.5 * DRAWS ** (-1 / low.size)
    for _ in range(ROUNDS):
        best = np.argsort(chi)[:MAX_STARTS]
        around = draws[best][generator.integers(0, best.size, AROUND)]
        around = np.clip(around + spread * generator.standard_normal(around.shape), 0.0, 1.0)
        draws, chi = np.concatenate([draws[best], around]), np.concatenate([chi[best], cost(around)])
        spread *= 0.6
    chosen: list[np.ndarray] = []
    promising = chi <= chi.min() + WORSE
    _choose(chosen, draws[promising], chi[promising], STARTS, APART)
    found = len(chosen)
    _choose(chosen, swept, of_swept, IN_ALL, ELSEWHERE)  # the rounds have drawn together about the best
    return low + np.reshape(chosen, (-1, low.size)) * (high - low), found


def _choose(chosen: list[np.ndarray], draws: np.ndarray, chi: np.ndarray, count: int, apart: float) -> None:
    """Add the best draws that lie apart from those that are chosen, until there are enough."""
    for k in np.argsort(chi):
        if len(chosen) == count or not np.isfinite(chi[k]):
            return
        if all(np.max(np.abs(draws[k] - other)) > apart for other in chosen):
            chosen.append(draws[k])


def _about(prior, low: float, high: float, logarithmic: bool) -> tuple[float, float] | None:
    if prior is None:
        return None
    mean = np.log(prior.mean) if logarithmic else prior.mean
    sigma = prior.sigma / prior.mean if logarithmic else prior.sigma
    return (mean - low) / (high - low), sigma / (high - low)


def promise(recordings: tuple[Recording, ...], parameters: ParameterSet, u: np.ndarray) -> np.ndarray:
    """(draws,) χ² of what the recordings show of themselves under the table, prior knowledge with it."""
    values = parameters.to_values(u)
    total = np.zeros(len(u))
    for prior, column in zip(parameters.priors, values.T, strict=True):
        if prior is not None:
            total += ((column - prior.mean) / prior.sigma) ** 2
    for k, one in enumerate(recordings):
        known = parameters.known[k]
        numbers = {name: np.full(len(u), value) for name, value in known.items()}
        for name, column in zip(parameters.names, values.T, strict=True):
            if "[" not in name or name.endswith(f"[{k + 1}]"):
                numbers[plain(name)] = column
        seen = {field: _product(numbers, POWERS[field]) if parameters.si else numbers[field] for field in POWERS}
        one_each = (np.ones(len(u)), np.ones(len(u)))
        time, length = (_product(numbers, TIME), _product(numbers, LENGTH)) if parameters.si else one_each
        held = bool(np.any(numbers["pad"] > 0))
        there = table(held)
        d, gas, outer, viscosity = (seen[name] for name in PLACED)
        log_omega, log_rate, rest, outside = there(there.place(d, gas, outer, viscosity, numbers["pad"]))
        # the table's walls lose nothing: a Kelvin-Voigt wall adds about half its time times Ω² to a mode's decay
        log_rate = np.logaddexp(log_rate, 2 * log_omega + np.log(0.5 * seen["retardation"] + TINY)[:, None])
        # and a mode that it damps beyond this share of its frequency would not be found
        beyond = np.log(0.5 * numbers["retardation"] * one.Omega.max() / OVERDAMPED + TINY)
        total += (np.maximum(beyond, 0.0) / SPREADS["decay"]) ** 2
        total += OUTSIDE * outside**2
        total += _frequencies(one, log_omega - np.log(time)[:, None], log_rate - np.log(time)[:, None])
        for channel, level in zip(one.channels, one.level, strict=True):
            if channel in ("H", "W", "V", "S"):
                there_rests = rest[:, "HWVS".index(channel)] * length ** POWER[channel]
                total += ((level / there_rests - 1) / (SPREADS["rest"] * POWER[channel])) ** 2
    return np.where(np.isfinite(total), total, np.inf)


def _product(numbers: Mapping[str, np.ndarray], powers: Mapping[str, float]) -> np.ndarray:
    return np.prod([numbers[name] ** power for name, power in powers.items()], axis=0)


def _frequencies(one: Recording, log_omega: np.ndarray, log_rate: np.ndarray) -> np.ndarray:
    """The best way to see the recording's frequencies among the three lowest modes, or as what is none of them."""
    shown = np.log(one.Omega)
    best = np.full(len(log_omega), np.inf)
    for identified, modes, price in _ways(one.Omega):
        off = (log_omega[:, modes] - shown[identified]) / SPREADS["frequency"]
        slow = (log_rate[:, modes[0]] + np.log(one.tau)) / SPREADS["decay"]
        best = np.minimum(best, np.sum(off**2, axis=1) + slow**2 + price)
    return best


def _ways(shown: np.ndarray) -> list[tuple[list[int], list[int], float]]:
    """Which of the frequencies are which modes, and what it costs to think so."""
    found = []
    for count in range(1, len(shown) + 1):
        for identified in combinations(range(len(shown)), count):
            passed = [k for k in range(len(shown)) if k not in identified]
            price = sum(OVERTONE if _is_overtone(k, identified, shown) else MISSED for k in passed)
            for modes in combinations(range(3), count):
                # a mode that is not seen among faster ones may be still, but that is not likely
                found.append((list(identified), list(modes), price + PREFERRED * (modes[-1] + 1 - count)))
    return found


def _is_overtone(k: int, identified: tuple[int, ...], shown: np.ndarray) -> bool:
    """Whether a frequency is about twice another one: that of a large motion."""
    return any(abs(shown[k] / (2 * shown[j]) - 1) < OCTAVE for j in identified)

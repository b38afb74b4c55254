"""Where a trace fit begins: modes by matrix pencil, constants by linear algebra.

The modes found in a record, with their amplitudes in V and S, obey the
oscillator's own equations, which are linear in its constants. So a start costs
no iteration and brings the sign of k_VS with it.

Symbols    s = -1/τ + iΩ pole   ω² = Ω² + 1/τ²   A complex amplitude
Source     Hua & Sarkar 1990 (matrix pencil); Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jshell.calibration.frequency_model import start_from_data
from jshell.calibration.frequency_table import FrequencyTable
from jshell.calibration.losses import TraceModel
from jshell.calibration.problem import Problem, nominal_values
from jshell.calibration.records import Record
from jshell.oscillator.coefficients import tied_beta2
from jshell.signals import rates
from jshell.signals.waves_from_data import in_cells, model_orders, sound

CLEARLY = 0.9  # of what the pencil's modes leave, below which others are taken instead


class ModePair(NamedTuple):
    """Two decaying modes of a record, slow first.

    Attributes:
        poles: (2,) s with positive frequency.
        amplitudes: (channels, 2) complex: the record is offset + Re Σ A exp(s t).
        offsets: (channels,).
        rms: Relative to each channel's scatter, what the two modes leave.
    """

    poles: np.ndarray
    amplitudes: np.ndarray
    offsets: np.ndarray
    rms: float

    @property
    def tau(self) -> float:
        """Common decay time, by energy."""
        scale = np.abs(self.amplitudes) / (np.linalg.norm(self.amplitudes, axis=1, keepdims=True) + 1e-300)
        energy = (scale**2).sum(axis=0)
        rate = float(np.sum(energy * -np.real(self.poles)) / np.sum(energy))
        return 1 / min(max(rate, 1e-3), 2.0)

    @property
    def squared(self) -> np.ndarray:
        """Squared undamped frequencies ω²."""
        return np.imag(self.poles) ** 2 + 1 / self.tau**2


def find_modes(elapsed: np.ndarray, data: np.ndarray) -> ModePair | None:
    """Two modes of a record over all its channels; None where there are not two.

    By matrix pencil; by least squares from many starts where these leave clearly less, as of a mode a thousand times
    quieter than the other.

    Args:
        elapsed: (times,) from 0, evenly spaced or not.
        data: (channels, times).
    """
    spread = data.std(axis=1, keepdims=True)
    if not np.all(spread > 0):
        return None
    best: ModePair | None = None
    even = (data - data.mean(axis=1, keepdims=True)) / spread

    def offer(best: ModePair | None, s: np.ndarray, better: float = 1.0) -> ModePair | None:
        s = -np.maximum(-np.real(s), 1e-3) + 1j * np.imag(s)
        s = s[np.argsort(np.abs(s))]
        amplitudes, offsets, left = _amplitudes(elapsed, data, s)
        rms = float(np.sqrt(np.mean(left.var(axis=1) / data.var(axis=1))))
        return ModePair(s, amplitudes, offsets, rms) if best is None or rms < better * best.rms else best

    for identified in rates(elapsed, data / spread):
        if identified.size > 1:
            best = offer(best, identified[:2])
    cells = in_cells(elapsed, even)
    pairs = model_orders(*cells, most=2)[1]
    if pairs and sound(pairs[0], cells[0]):
        best = offer(best, -pairs[0].sigma + 1j * pairs[0].Omega, CLEARLY)
    return best


def _amplitudes(times: np.ndarray, data: np.ndarray, poles: np.ndarray):
    """Complex amplitudes, offsets and what is left, by linear least squares."""
    waves = np.exp(np.outer(times, poles))
    basis = np.concatenate([np.real(waves), -np.imag(waves), np.ones((times.size, 1))], axis=1)
    found = np.linalg.lstsq(basis, data.T, rcond=None)[0]
    k = poles.size
    return (found[:k] + 1j * found[k : 2 * k]).T, found[-1], (data.T - basis @ found).T


def strict_start(records: list[Record], modes: list[ModePair], fix: dict[str, float]) -> np.ndarray:
    """(alpha1, alpha2, k_vs, beta1) from the modes of V and S.

    With equal decay s² + 2s/τ = -ω², so each mode says
    α1 ω²/(4π) V - (k/V_e) S = (κ P_e/V_e) V   and
    α2 2 V_e² ω²/(9π³) S - (k/V_e) V = (K_A/4π) S,   linear in the constants.
    """
    lines, right = [], []
    for one, found in zip(records, modes, strict=True):
        V_e, P_e = (float(x) for x in one.state)
        c = one.conditions
        gas, wall = float(c.kappa) * P_e / V_e, 1 / (8 * np.pi * (1 - float(c.poisson_ratio)))
        w2 = found.squared
        for j in range(2):
            V, S = found.amplitudes[0, j], found.amplitudes[1, j]
            size = np.abs(found.amplitudes).max(axis=1)
            first = np.array([w2[j] / (4 * np.pi) * V, 0.0, -S / V_e, gas * V]) / (gas * size[0])
            second = np.array([0.0, 2 * V_e**2 * w2[j] / (9 * np.pi**3) * S, -V / V_e, wall * S]) / (wall * size[1])
            for line in (first, second):
                for part in (line.real, line.imag):
                    lines.append(part[:3])
                    right.append(part[3])
    M, y = np.array(lines), np.array(right)
    names = ("alpha1", "alpha2", "k_vs")
    values = np.array([fix.get(name, np.nan) for name in names])
    free = np.isnan(values)
    if free.any():
        y = y - M[:, ~free] @ values[~free]
        values[free] = np.linalg.lstsq(M[:, free], y, rcond=None)[0]
    values[:2] = np.clip(values[:2], 0.05, 50.0)
    eta = [max(float(one.conditions.viscosity), 1e-300) for one in records]
    rate = np.mean([1 / (found.tau * x) for found, x in zip(modes, eta, strict=True)])
    beta1 = fix["beta1"] if "beta1" in fix else float(values[0] * rate / 2)
    return np.append(values, beta1)


def blind_start(random: np.random.Generator, records: list[Record]) -> np.ndarray:
    """(alpha1, alpha2, k_vs, beta1) drawn at random, for records in which no two modes are found."""
    eta = np.mean([max(float(one.conditions.viscosity), 1e-300) for one in records])
    alpha1, alpha2 = np.exp(random.uniform(np.log(1.0), np.log(8.0))), np.exp(random.uniform(np.log(0.3), np.log(3.0)))
    return np.array([alpha1, alpha2, random.uniform(-0.4, 0.4), alpha1 / (2 * eta * random.uniform(4.0, 40.0))])


def first_start(loss: str, records: list[Record], modes: list[ModePair], fix: Mapping[str, float]) -> np.ndarray:
    """The constants that the modes of records imply: as `strict_start`, or alpha1, alpha2, k_vs² of a modal fit."""
    if loss == "strict":
        return strict_start(records, modes, dict(fix))
    table = FrequencyTable(
        np.array([float(one.state.volume) for one in records]),
        np.array([float(one.state.pressure) for one in records]),
        np.array([float(one.conditions.kappa) for one in records]),
        np.array([0.5 / (1 - float(one.conditions.poisson_ratio)) for one in records]),
        np.array([np.sqrt(found.squared) for found in modes]),
        np.ones((len(records), 2)),
    )
    return start_from_data(table, fix)


def starts_of_constants(
    model: TraceModel, modes: Sequence[ModePair | None], fix: Mapping[str, float], count: int, seed: int
) -> np.ndarray:
    """(starts, names): one from the modes, others scattered around it; blind draws where no modes are found."""
    random = np.random.default_rng(seed)
    records = list(model.records)
    pairs = [(one, found) for one, found in zip(records, modes, strict=True) if found is not None]
    first = first_start(model.loss, [one for one, _ in pairs], [found for _, found in pairs], fix) if pairs else None
    if model.loss == "strict":
        if first is None:
            rows = np.stack([blind_start(random, records) for _ in range(4 * (count + 1))])
        else:
            noise = random.standard_normal((count, 4))
            moved = first * np.exp(np.array([0.2, 0.2, 0.0, 0.2]) * noise)
            moved[:, 2] += 0.1 * noise[:, 2]
            rows = np.vstack([first, moved])
        if not model.tied:
            b2 = tied_beta2(rows[:, 0], rows[:, 1], rows[:, 3], model.dipole)
            rows = np.column_stack([rows, b2])
        return rows

    tau = np.array([8.0 if found is None else found.tau for found in modes])
    if first is not None:
        first = np.append(first, tau)
        spread = np.full(first.size, 0.1)
        return np.vstack([first, first * np.exp(spread * random.standard_normal((count, first.size)))])
    drawn = [blind_start(random, records)[:3] ** np.array([1, 1, 2]) for _ in range(4 * (count + 1))]
    return np.stack([np.append(one, tau) for one in drawn])


def starts_of_fit(
    problem: Problem, modes: Sequence[ModePair | None], fix: Mapping[str, float], count: int, seed: int
) -> np.ndarray:
    """(starts, parameters): shared constants from all traces, local ones from the trace's own modes.

    Args:
        problem: The traces and their parameters.
        modes: Found in each trace, or None.
        fix: Values of constants not to be fitted.
        count: Random starts beside the one from the modes.
        seed: Of the random ones.
    """
    model, nominal = problem.model, nominal_values(problem)
    shared = starts_of_constants(model, modes, fix, count, seed)
    plain, rows = model.names, np.ones((len(shared), len(problem.names)))
    names = model.constants
    for number, (record, places) in enumerate(zip(model.records, problem.places, strict=True)):
        found = modes[number]
        local = [
            problem.names[place].endswith("]") and name != "tau" for name, place in zip(names, places, strict=True)
        ]
        identified = None
        if model.loss == "strict" and found is not None and any(local):
            identified = strict_start([record], [found], dict(fix))
        for k, (name, place) in enumerate(zip(names, places, strict=True)):
            base = f"tau[{number + 1}]" if name == "tau" and "tau" not in plain else name
            values = shared[:, plain.index(base)]
            if local[k] and identified is not None and k < 4:
                first = shared[0, plain.index(base)]
                values = values / first * identified[k] if first != 0 else values + identified[k]
            rows[:, place] = values
    for name, value in nominal.items():
        rows[:, problem.names.index(name)] = value
    return rows

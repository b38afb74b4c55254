"""Where a trace fit begins: modes by matrix pencil, constants by linear algebra.

The modes found in a record, with their amplitudes in V and S, obey the
oscillator's own equations, which are linear in its constants. So a start costs
no iteration and brings the sign of k_VS with it.

Symbols    s = -1/τ + iΩ pole   ω² = Ω² + 1/τ²   A complex amplitude
Source     Hua & Sarkar 1990 (matrix pencil); Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS
"""

from typing import NamedTuple

import numpy as np

from jshell.calibration.records import Record
from jshell.signals import rates


class Modes(NamedTuple):
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


def find_modes(elapsed: np.ndarray, data: np.ndarray) -> Modes | None:
    """Two modes of a record by matrix pencil over all its channels; None where there are not two.

    Args:
        elapsed: (times,) from 0, evenly spaced or not.
        data: (channels, times).
    """
    spread = data.std(axis=1, keepdims=True)
    if not np.all(spread > 0):
        return None
    best: Modes | None = None
    for heard in rates(elapsed, data / spread):
        if heard.size < 2:
            continue
        s = heard[:2]
        s = -np.maximum(-np.real(s), 1e-3) + 1j * np.imag(s)
        s = s[np.argsort(np.abs(s))]
        amplitudes, offsets, left = _amplitudes(elapsed, data, s)
        rms = float(np.sqrt(np.mean(left.var(axis=1) / data.var(axis=1))))
        if best is None or rms < best.rms:
            best = Modes(s, amplitudes, offsets, rms)
    return best


def _amplitudes(times: np.ndarray, data: np.ndarray, poles: np.ndarray):
    """Complex amplitudes, offsets and what is left, by linear least squares."""
    waves = np.exp(np.outer(times, poles))
    basis = np.concatenate([np.real(waves), -np.imag(waves), np.ones((times.size, 1))], axis=1)
    found = np.linalg.lstsq(basis, data.T, rcond=None)[0]
    k = poles.size
    return (found[:k] + 1j * found[k : 2 * k]).T, found[-1], (data.T - basis @ found).T


def strict_start(records: list[Record], modes: list[Modes], fix: dict[str, float]) -> np.ndarray:
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

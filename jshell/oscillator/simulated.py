"""The simulator's own vibrations of just-buckled shells, from stored tables.

The short model and the simulator never see each other; this is where one can
be laid beside the other. Where a third mode takes a good part of the volume's
motion, two variables are no longer enough.

Symbols    ω angular frequency [sqrt(E d/(ρ_f R0³))]   τ decay time [sqrt(ρ_f R0³/(E d))]   P̂ext outer pressure [E d/R0]
Valid for  ν = 1/2, κ = 1.4, a free shell; ω of `SimulatedModes` in an inviscid liquid, τ in the exact viscous one
Source     data/modes/make_modes.py, which runs jshell.dynamics.modes
"""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Float

TABLE, DECAY_TABLE = "modes_after_buckling.csv", "decay_after_buckling.csv"
MODES = 4


@dataclass(frozen=True)
class SimulatedModes:
    """Modes of shells at and beyond their buckling load, a row each.

    Attributes:
        thickness, gas_pressure, outer_pressure: (shells,) d̂, P̂0, P̂ext.
        load_ratio: (shells,) outer pressure over the classical buckling load.
        volume_ratio: (shells,) V/V0 at rest.
        omega: (shells, 4) undamped angular frequencies, slow ones first.
        share: (shells, 4) dV²/Σ dV² over the four: what each takes of a sudden pressure.
        tau: (shells, 4) decay times in a liquid of η̂ = 0.004; NaN where a mode does not oscillate there.
    """

    thickness: Float[np.ndarray, " shells"]
    gas_pressure: Float[np.ndarray, " shells"]
    outer_pressure: Float[np.ndarray, " shells"]
    load_ratio: Float[np.ndarray, " shells"]
    volume_ratio: Float[np.ndarray, " shells"]
    omega: Float[np.ndarray, "shells 4"]
    share: Float[np.ndarray, "shells 4"]
    tau: Float[np.ndarray, "shells 4"]

    def __len__(self) -> int:
        return self.thickness.size

    def of(self, thickness: float, gas_pressure: float) -> "SimulatedModes":
        """The rows of one shell, by rising pressure; none where it is not in the table."""
        return self._where(np.isclose(self.thickness, thickness) & np.isclose(self.gas_pressure, gas_pressure))

    def just_buckled(self) -> "SimulatedModes":
        """The rows at the buckling load itself."""
        return self._where(np.isclose(self.load_ratio, 1.0))

    def _where(self, rows: np.ndarray) -> "SimulatedModes":
        return SimulatedModes(**{name: part[rows] for name, part in vars(self).items()})


@dataclass(frozen=True)
class SimulatedDecay:
    """The two slowest modes of shells in viscous liquids, a row for each shell and viscosity.

    Attributes:
        thickness, gas_pressure, outer_pressure: (rows,) d̂, P̂0, P̂ext.
        load_ratio: (rows,) outer pressure over the classical buckling load.
        viscosity: (rows,) η̂.
        omega: (rows, 2) |s| in that liquid; NaN where a mode does not oscillate.
        tau: (rows, 2) decay times; NaN where a mode does not oscillate.
    """

    thickness: Float[np.ndarray, " rows"]
    gas_pressure: Float[np.ndarray, " rows"]
    outer_pressure: Float[np.ndarray, " rows"]
    load_ratio: Float[np.ndarray, " rows"]
    viscosity: Float[np.ndarray, " rows"]
    omega: Float[np.ndarray, "rows 2"]
    tau: Float[np.ndarray, "rows 2"]

    def __len__(self) -> int:
        return self.thickness.size


def simulated_modes() -> SimulatedModes:
    """The stored table of modes.

    Example:
        >>> from jshell.oscillator import simulated_modes
        >>> found = simulated_modes().of(0.02, 0.4)
        >>> print(found.omega[0, :2].round(3))
        [0.595 1.666]
    """
    rows = _rows(TABLE)
    thickness, gas, outer, ratio, volume = rows[:, :5].T
    omega, share, tau = (rows[:, 5 + k * MODES : 5 + (k + 1) * MODES] for k in range(3))
    return SimulatedModes(thickness, gas, outer, ratio, volume, omega, share, tau)


def simulated_decay() -> SimulatedDecay:
    """The stored table of decay times, to which `fitted_decay_time` was fitted.

    Example:
        >>> from jshell.oscillator import simulated_decay
        >>> found = simulated_decay()
        >>> print(len(found), found.tau[1].round(2))
        445 [12.76  5.44]
    """
    rows = _rows(DECAY_TABLE)
    thickness, gas, outer, ratio, viscosity = rows[:, :5].T
    return SimulatedDecay(thickness, gas, outer, ratio, viscosity, rows[:, 5:7], rows[:, 7:])


def _rows(table: str) -> np.ndarray:
    """The numbers of a stored table: of a checkout, or of the installed package."""
    checkout = Path(__file__).resolve().parents[2] / "data" / "modes" / table
    path = checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / table))
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return np.loadtxt(lines[1:], delimiter=",", ndmin=2)

"""The simulator's own vibrations of just-buckled shells, from a stored table.

The short model and the simulator never see each other; this is where one can
be laid beside the other. Where a third mode takes a good part of the volume's
motion, two variables are no longer enough.

Symbols    ω pulsation [sqrt(E d/(ρ_f R0³))]   P̂ext outer pressure [E d/R0]
Valid for  ν = 1/2, κ = 1.4, a free shell in an inviscid liquid
Source     data/modes/make_modes.py, which runs jshell.dynamics.modes
"""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Float

TABLE = "modes_after_buckling.csv"
MODES = 4


@dataclass(frozen=True)
class SimulatedModes:
    """Undamped modes of shells at and beyond their buckling load, a row each.

    Attributes:
        thickness, gas_pressure, outer_pressure: (shells,) d̂, P̂0, P̂ext.
        load_ratio: (shells,) outer pressure over the classical buckling load.
        volume_ratio: (shells,) V/V0 at rest.
        omega: (shells, 4) pulsations, slow ones first.
        share: (shells, 4) dV²/Σ dV² over the four: what each takes of a sudden pressure.
    """

    thickness: Float[np.ndarray, " shells"]
    gas_pressure: Float[np.ndarray, " shells"]
    outer_pressure: Float[np.ndarray, " shells"]
    load_ratio: Float[np.ndarray, " shells"]
    volume_ratio: Float[np.ndarray, " shells"]
    omega: Float[np.ndarray, "shells 4"]
    share: Float[np.ndarray, "shells 4"]

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


def simulated_modes() -> SimulatedModes:
    """The stored table.

    Example:
        >>> from jshell.oscillator import simulated_modes
        >>> found = simulated_modes().of(0.02, 0.4)
        >>> print(found.omega[0, :2].round(3))
        [0.595 1.666]
    """
    lines = [line for line in _path().read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = np.loadtxt(lines[1:], delimiter=",", ndmin=2)
    thickness, gas, outer, ratio, volume = rows[:, :5].T
    return SimulatedModes(thickness, gas, outer, ratio, volume, rows[:, 5 : 5 + MODES], rows[:, 5 + MODES :])


def _path() -> Path:
    """The table of a checkout, or of the installed package."""
    checkout = Path(__file__).resolve().parents[2] / "data" / "modes" / TABLE
    return checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / TABLE))

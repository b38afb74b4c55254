"""Every physical quantity once: key, symbol, words, units.

Plots, CSV headers, terminal tables and reports read this registry, so that a
quantity is spelled the same wherever a user meets it.
"""

from dataclasses import dataclass

from jshell.errors import choose


@dataclass(frozen=True)
class Quantity:
    """One physical quantity.

    Attributes:
        key: Name in files and JSON.
        symbol: Symbol in print.
        words: Name in words.
        scale: Its unit inside jshell, as a formula of the scales.
        dimension: `length`, `area`, `volume`, `time`, `pressure`, `energy`, `frequency`, `speed`, `volume rate`,
            `viscosity` or `none`.
    """

    key: str
    symbol: str
    words: str
    scale: str
    dimension: str

    def label(self, unit: str | None = None) -> str:
        """Axis label: words, symbol, and the unit where there is one."""
        shown = unit if unit is not None else self.scale
        tail = f" [{shown}]" if shown not in ("", "-") else ""
        return f"{self.words} {self.symbol}{tail}"


_TIME = "√(ρ R₀³/E d)"
_ROWS = (
    Quantity("t", "t", "time", _TIME, "time"),
    Quantity("V", "V", "volume", "R₀³", "volume"),
    Quantity("S", "S", "area", "R₀²", "area"),
    Quantity("H", "H", "height along the axis", "R₀", "length"),
    Quantity("W", "W", "width across the axis", "R₀", "length"),
    Quantity("W_25", "W₂₅", "width at a quarter of the height, from the end that does not buckle", "R₀", "length"),
    Quantity("W_50", "W₅₀", "width at half the height", "R₀", "length"),
    Quantity("W_75", "W₇₅", "width at three quarters of the height", "R₀", "length"),
    Quantity("x_front", "x₁", "buckling pole", "R₀", "length"),
    Quantity("x_back", "x₂", "opposite pole", "R₀", "length"),
    Quantity("v_front", "ẋ₁", "velocity of the buckling pole", "√(E d/ρ R₀)", "speed"),
    Quantity("v_back", "ẋ₂", "velocity of the opposite pole", "√(E d/ρ R₀)", "speed"),
    Quantity("V_rate", "dV/dt", "rate of the volume", "√(E d R₀³/ρ)", "volume rate"),
    Quantity("R_eq", "R", "radius of equal volume", "R₀", "length"),
    Quantity("P", "P", "inner pressure", "E d/R₀", "pressure"),
    Quantity("P_ext", "Pₑₓₜ", "outer pressure", "E d/R₀", "pressure"),
    Quantity("kinetic", "T", "kinetic energy", "E d R₀²", "energy"),
    Quantity("elastic", "Uₛ", "elastic energy", "E d R₀²", "energy"),
    Quantity("gas", "U_g", "gas energy", "E d R₀²", "energy"),
    Quantity("work", "A", "work of the outer pressure so far", "E d R₀²", "energy"),
    Quantity("loss_layer", "Q_δ", "energy lost in the Stokes layer's first order so far", "E d R₀²", "energy"),
    Quantity("lent_layer", "E_δ", "energy the Stokes layer holds and gives back", "E d R₀²", "energy"),
    Quantity(
        "loss_bulk",
        "Q_f",
        "energy lost in the liquid beside it so far: second order, or a slipping wall's flow",
        "E d R₀²",
        "energy",
    ),
    Quantity("loss_wall", "Q_s", "energy lost in the wall so far", "E d R₀²", "energy"),
    Quantity("loss_drag", "Q_d", "energy lost to the drag law so far", "E d R₀²", "energy"),
    Quantity("work_drag", "W_d", "work of drag", "E d R₀²", "energy"),
    Quantity("work_pressure", "W_p", "work of the added pressure", "E d R₀²", "energy"),
    Quantity("p_scattered", "p_s", "scattered pressure at R₀", "E d/R₀", "pressure"),
    Quantity("d_hat", "d̂", "thickness", "R₀", "length"),
    Quantity("P0_hat", "P̂₀", "gas pressure of the stress-free sphere", "E d/R₀", "pressure"),
    Quantity("Pext_hat", "P̂ₑₓₜ", "outer pressure", "E d/R₀", "pressure"),
    Quantity("eta_hat", "η̂", "viscosity", "√(E d ρ R₀)", "viscosity"),
    Quantity("kappa", "κ", "polytropic exponent", "-", "none"),
    Quantity("nu", "ν", "Poisson ratio", "-", "none"),
    Quantity("omega_minus", "ω₋", "slow frequency", "√(E d/ρ R₀³)", "frequency"),
    Quantity("omega_plus", "ω₊", "fast frequency", "√(E d/ρ R₀³)", "frequency"),
    Quantity("tau", "τ", "decay time", _TIME, "time"),
    Quantity("alpha1", "α₁", "added-mass factor of the volume", "-", "none"),
    Quantity("alpha2", "α₂", "added-mass factor of the area", "-", "none"),
    Quantity("kVS", "k_VS", "volume-area coupling", "-", "none"),
    Quantity("beta1", "β₁", "damping factor of the volume", "-", "none"),
    Quantity("beta2", "β₂", "damping factor of the area", "-", "none"),
)
QUANTITIES: dict[str, Quantity] = {row.key: row for row in _ROWS}

# Units a file may name in brackets: dimension and factor to SI.
UNITS: dict[str, tuple[str, float]] = {
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "µs": ("time", 1e-6),
    "ns": ("time", 1e-9),
    "m": ("length", 1.0),
    "cm": ("length", 1e-2),
    "mm": ("length", 1e-3),
    "um": ("length", 1e-6),
    "µm": ("length", 1e-6),
    "nm": ("length", 1e-9),
    "m^2": ("area", 1.0),
    "mm^2": ("area", 1e-6),
    "um^2": ("area", 1e-12),
    "µm^2": ("area", 1e-12),
    "m^3": ("volume", 1.0),
    "mm^3": ("volume", 1e-9),
    "mL": ("volume", 1e-6),
    "um^3": ("volume", 1e-18),
    "µm^3": ("volume", 1e-18),
    "m/s": ("speed", 1.0),
    "mm/s": ("speed", 1e-3),
    "m^3/s": ("volume rate", 1.0),
    "mL/s": ("volume rate", 1e-6),
    "mm^3/s": ("volume rate", 1e-9),
    "um^3/s": ("volume rate", 1e-18),
    "µm^3/s": ("volume rate", 1e-18),
    "Pa": ("pressure", 1.0),
    "kPa": ("pressure", 1e3),
    "MPa": ("pressure", 1e6),
    "bar": ("pressure", 1e5),
    "J": ("energy", 1.0),
    "mJ": ("energy", 1e-3),
    "µJ": ("energy", 1e-6),
    "nJ": ("energy", 1e-9),
    "pJ": ("energy", 1e-12),
}
# Units a laboratory reads, largest first.
LABORATORY = {
    "time": ("s", "ms", "µs"),
    "length": ("mm", "µm"),
    "area": ("mm^2", "µm^2"),
    "volume": ("mL", "mm^3", "µm^3"),
    "speed": ("m/s", "mm/s"),
    "volume rate": ("mL/s", "mm^3/s", "µm^3/s"),
    "pressure": ("MPa", "kPa", "Pa"),
    "energy": ("J", "mJ", "µJ", "nJ", "pJ"),
}
POWERS = str.maketrans({"2": "²", "3": "³", "^": None})  # of a unit in print
SI_UNIT = {
    "time": "s",
    "length": "m",
    "area": "m^2",
    "volume": "m^3",
    "speed": "m/s",
    "volume rate": "m^3/s",
    "pressure": "Pa",
    "energy": "J",
}


def quantity(key: str) -> Quantity:
    """The registry's row for a key.

    Raises:
        BadName: The key is not in the registry.
    """
    return QUANTITIES[choose("quantity", key, QUANTITIES, remedy="Check the spelling.")]


def laboratory_unit(dimension: str, size: float) -> str:
    """The largest unit that a laboratory reads a dimension in, in which a number of this size [SI] reaches 1."""
    units = LABORATORY[dimension]
    return next((unit for unit in units if abs(size) >= UNITS[unit][1]), units[-1])

"""What is known of a shell and what is asked: numbers in SI, or without units, and how the simulator sees them.

Every number of the simulator is a product of powers of those of the laboratory, so positive unknowns are sought by
their logarithms, where the way from one to the other is a constant matrix.

Symbols    u what the solver sees: the logarithm of a positive number, else the number itself
           T = sqrt(ρ_f R0³/(E d)) unit of time [s]   L = R0 unit of length [m]
Source     Mokbel et al. 2021, section "Description of relevant parameters"
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jshell.calibration import Prior
from jshell.errors import BadName, BadValue, choose
from jshell.inversion.response import FIELDS, PAD_FIELD, RETARDATION_FIELD
from jshell.shell.laboratory import PLACES, refuse_slips


@dataclass(frozen=True)
class Number:
    """One number of the laboratory.

    Attributes:
        unit: Its SI unit.
        low, high: Where it is looked for unless bounds are given.
        positive: Sought by its logarithm.
        usual: Value where nothing is said of it, or None.
    """

    unit: str
    low: float
    high: float
    positive: bool = True
    usual: float | None = None


_SHAPE = {
    "kappa": Number("-", 1.0, 1.67, False, 1.4),
    "poisson_ratio": Number("-", 0.2, 0.5, False, 0.5),
    "pad": Number("rad", 0.12, 0.6, False, 0.0),
    "weak_spot": Number("-", 0.0, 0.5, False, 0.0),
}
SI = {
    "radius": Number("m", 1e-7, 1.0),
    "thickness": Number("m", 1e-9, 0.3),
    "youngs_modulus": Number("Pa", 1e4, 1e10),
    "gas_pressure": Number("Pa", 1e3, 1e7),
    "outer_pressure": Number("Pa", 1e3, 1e7),
    "density": Number("kg/m^3", 500.0, 2000.0, usual=1000.0),
    "viscosity": Number("Pa s", 1e-5, 20.0),
    "retardation": Number("s", 1e-9, 1.0, usual=0.0),
    **_SHAPE,
}
PLAIN = {
    "thickness": Number("R0", 0.03, 0.4),
    "gas_pressure": Number("E d/R0", 0.1, 8.0),
    "outer_pressure": Number("E d/R0", 0.2, 12.0),
    "viscosity": Number("sqrt(E d rho_f R0)", 1e-5, 0.05),
    "retardation": Number("sqrt(rho_f R0^3/(E d))", 1e-5, 1.0, usual=0.0),
    **_SHAPE,
}
TIME = {"density": 0.5, "radius": 1.5, "youngs_modulus": -0.5, "thickness": -0.5}
LENGTH = {"radius": 1.0}
# powers of the laboratory's numbers in each of the simulator's; the four of the shape are the same in both
POWERS = {
    "thickness": {"thickness": 1.0, "radius": -1.0},
    "gas_pressure": {"gas_pressure": 1.0, "radius": 1.0, "youngs_modulus": -1.0, "thickness": -1.0},
    "outer_pressure": {"outer_pressure": 1.0, "radius": 1.0, "youngs_modulus": -1.0, "thickness": -1.0},
    "viscosity": {"viscosity": 1.0, "youngs_modulus": -0.5, "thickness": -0.5, "density": -0.5, "radius": -0.5},
    "retardation": {"retardation": 1.0} | {name: -power for name, power in TIME.items()},
}
SYMBOLS = {  # what else they are called
    "E": "youngs_modulus", "d": "thickness", "d_hat": "thickness", "R": "radius", "R0": "radius", "P0": "gas_pressure",
    "P0_hat": "gas_pressure", "Pext": "outer_pressure", "P_ext": "outer_pressure", "Pext_hat": "outer_pressure",
    "rho": "density", "eta": "viscosity", "eta_hat": "viscosity", "nu": "poisson_ratio", "attached": "pad",
}  # fmt: skip
THICKEST = 0.5  # of the radius: beyond, the wall is no shell
NEVER_ZERO = ("radius", "thickness", "youngs_modulus", "gas_pressure", "outer_pressure", "density")
POSSIBLE = {"kappa": (1.0, 2.0), "poisson_ratio": (-1.0, 0.5), "pad": (0.0, 1.5), "weak_spot": (0.0, 0.9)}


@dataclass(frozen=True)
class Unknown:
    """One number that is asked for.

    Args:
        low, high: Bounds; None are the usual ones.
        prior: What is known of it beforehand: a mean and a standard error.
        local: Every recording has its own.
        nuisance: Nobody asked: it is sought so that the others' errors are honest, and may rest on its bound.
    """

    low: float | None = None
    high: float | None = None
    prior: Prior | None = None
    local: bool = False
    nuisance: bool = False


class Seen:
    """The numbers of one recording as the simulator sees them.

    Args:
        values: Every number of the laboratory by name.
        si: In SI; else without units.
    """

    def __init__(self, values: Mapping[str, float], si: bool) -> None:
        self.names, self.values = tuple(SI if si else PLAIN), values
        logs = {name: np.log(values[name]) for name in self.names if name not in _SHAPE and values[name] > 0}
        still = {name for name in self.names if name not in _SHAPE and values[name] <= 0}  # no viscosity, no loss

        def product(powers: Mapping[str, float]) -> float:
            if still & set(powers):
                return 0.0
            return float(np.exp(sum(power * logs[name] for name, power in powers.items())))

        plain = {field: {field: 1.0} for field in POWERS}
        self.powers = POWERS if si else plain
        self.numbers = np.array([product(self.powers[f]) if f in self.powers else values[f] for f in FIELDS])
        self.time, self.length = (product(TIME), product(LENGTH)) if si else (1.0, 1.0)
        self.si = si

    @property
    def held(self) -> bool:
        """Whether a pad holds the shell."""
        return bool(self.numbers[PAD_FIELD] > 0)

    @property
    def lossy(self) -> bool:
        """Whether the wall loses energy itself."""
        return bool(self.numbers[RETARDATION_FIELD] > 0)

    def slope(self, name: str) -> tuple[np.ndarray, float, float]:
        """Change of the simulator's numbers, of log T and of log L with u of one number."""
        change = np.zeros(len(FIELDS))
        if name in _SHAPE:
            change[FIELDS.index(name)] = 1.0
            return change, 0.0, 0.0
        for field, powers in self.powers.items():
            k = FIELDS.index(field)
            change[k] = powers.get(name, 0.0) * self.numbers[k]
        return change, TIME.get(name, 0.0) * self.si, LENGTH.get(name, 0.0) * self.si


@dataclass(frozen=True)
class ParameterSet:
    """All unknowns of a fit, those of single recordings among them.

    Attributes:
        names: `outer_pressure`, or `outer_pressure[2]` for that of the second recording.
        low, high: Bounds.
        priors: What is known beforehand, or None.
        si: In SI; else without units.
        known: Per recording, every other number.
        nuisance: Which nobody asked for.
    """

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    priors: tuple[Prior | None, ...]
    si: bool
    known: tuple[dict[str, float], ...]
    nuisance: tuple[bool, ...] = ()

    @property
    def table(self) -> Mapping[str, Number]:
        return SI if self.si else PLAIN

    @property
    def logarithmic(self) -> np.ndarray:
        return np.array([self.table[plain(name)].positive for name in self.names])

    def to_u(self, values: np.ndarray) -> np.ndarray:
        """What the solver sees of values (…, unknowns)."""
        safe = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(safe), values)

    def to_values(self, u: np.ndarray) -> np.ndarray:
        """The values behind what the solver sees."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, u, 0.0)), u)

    def of(self, k: int, values: np.ndarray) -> tuple[dict[str, float], list[int]]:
        """All numbers of recording k, and which unknowns are among them."""
        numbers = dict(self.known[k])
        mine = [i for i, name in enumerate(self.names) if "[" not in name or name.endswith(f"[{k + 1}]")]
        for i in mine:
            numbers[plain(self.names[i])] = float(values[i])
        return numbers, mine


def plain(name: str) -> str:
    """A name without the number of its recording."""
    return name.partition("[")[0]


def parameters(
    known: Sequence[Mapping[str, float]],
    unknown: Iterable[str] | Mapping[str, Any],
    local: Iterable[str],
    si: bool,
) -> ParameterSet:
    """The unknowns of a fit, checked.

    Args:
        known: Per recording, what is known.
        unknown: Names; or names with None, bounds (low, high), a `Prior` or an `Unknown`.
        local: Names that every recording has for itself.
        si: In SI; else without units.

    Raises:
        BadName: No such number.
        BadValue: Nothing asked; a number that is neither known nor asked; bounds without order.
    """
    table = SI if si else PLAIN
    asked = {
        n: as_unknown(n, w) for n, w in (unknown if isinstance(unknown, Mapping) else dict.fromkeys(unknown)).items()
    }
    for name in (*asked, *local, *(n for one in known for n in one)):
        hint = f"Write {SYMBOLS[name]}." if SYMBOLS.get(name) in table else "Choose one."
        choose(
            "unknown", name, table, noun="number of a shell " + ("with units" if si else "without units"), remedy=hint
        )
    if not asked:
        raise BadValue(
            "unknown",
            found="nothing",
            expected="a number to find",
            remedy='Write unknown=("youngs_modulus",), in the terminal --unknown youngs_modulus.',
        )
    for name in set(local) - set(asked):
        raise BadName(
            f"local {name!r}", found="a known number", expected="one of " + ", ".join(asked), remedy="Ask for it."
        )
    rows = []
    for name, one in asked.items():
        own = (one.local or name in local) and len(known) > 1
        rows += [(f"{name}[{k + 1}]", one) for k in range(len(known))] if own else [(name, one)]
    whole = []
    for one in known:
        numbers = {n: number.usual for n, number in table.items() if number.usual is not None} | dict(one)
        for name in table:
            if name not in asked and name not in numbers:
                raise BadValue(
                    name, found="nothing", expected=f"its value [{table[name].unit}], or its name among the unknowns",
                    remedy=f"Write known={{'{name}': …}}, in the terminal --known {name}=…, or ask for it.",
                )  # fmt: skip
        whole.append({n: float(v) for n, v in numbers.items() if n not in asked})
        _check(whole[-1], table)
        if si:
            refuse_slips(**{place: whole[-1][name] for name, place in PLACES.items() if name in whole[-1]})
    low = np.array([table[plain(n)].low if one.low is None else one.low for n, one in rows])
    high = np.array([table[plain(n)].high if one.high is None else one.high for n, one in rows])
    for (name, one), a, b in zip(rows, low, high, strict=True):
        if not a < b or (table[plain(name)].positive and a <= 0):
            raise BadValue(
                name, found=f"bounds {a:g}, {b:g}", expected="a lower one below a higher one", remedy="Check them."
            )
        mean = one.prior.mean if one.prior else a
        if not a <= mean <= b:
            raise BadValue(name, found=f"prior {mean:g}", expected=f"{a:g} to {b:g}", remedy="Widen the bounds.")
    priors, extra = (tuple(getattr(one, field) for _, one in rows) for field in ("prior", "nuisance"))
    return ParameterSet(tuple(n for n, _ in rows), low, high, priors, si, tuple(whole), extra)


def _check(known: Mapping[str, float], table: Mapping[str, Number]) -> None:
    """Refuse what no shell can have.

    Raises:
        BadValue: A number outside its meaning, such as one in another unit.
    """
    for name, value in known.items():
        low, high = POSSIBLE.get(name, (0.0, np.inf))
        if not (low <= value <= high and np.isfinite(value)) or (value == 0 and name in NEVER_ZERO):
            between = "a number above 0" if name in NEVER_ZERO else f"a number from {low:g} to {high:g}"
            raise BadValue(name, found=f"{value:g}", expected=f"{between} [{table[name].unit}]", remedy="Correct it.")
    ratio = known.get("thickness", 0.0) / known.get("radius", 1.0 if "radius" not in table else np.inf)
    if ratio > THICKEST:
        words = f"thickness {known['thickness']:g}" + (
            f" m at radius {known['radius']:g} m" if "radius" in known else ""
        )
        raise BadValue(
            "thickness", found=words, expected=f"at most {THICKEST:g} of the radius",
            remedy="Write lengths in m." if "radius" in table else "Write thickness over radius.",
        )  # fmt: skip


def as_unknown(name: str, written: Any) -> Unknown:
    """What was written for an unknown."""
    if written is None:
        return Unknown()
    if isinstance(written, Unknown):
        return written
    if isinstance(written, Prior):
        return Unknown(prior=written)
    if isinstance(written, tuple | list) and len(written) == 2:
        return Unknown(float(written[0]), float(written[1]))
    raise BadValue(
        name, found=repr(written), expected="None, (low, high), a Prior or an Unknown", remedy="Write (1e5, 1e6)."
    )

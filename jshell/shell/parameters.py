"""A shell, its gas, its liquid and its load: in SI, and as pure numbers.

`Shell`, `Gas`, `Liquid` and `Load` carry SI. Everything inside jshell runs on
`Reduced`, the same problem without units: lengths in R0, pressures in E d/R0,
densities in rho_f, times in sqrt(rho_f R0³/(E d)). `Scales` leads back.

Symbols    d̂ thickness   P̂0 gas pressure   P̂ext outer pressure   η̂ viscosity
Source     Mokbel et al. 2021, section "Description of relevant parameters"
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jshell.display import PRESSURE, number, readable, shown
from jshell.errors import BadValue
from jshell.shell.laboratory import refuse_slips

Number = float | jax.Array | np.ndarray
CONDITION_FIELDS = {
    "d_hat": "thickness",
    "P0_hat": "gas_pressure",
    "Pext_hat": "outer_pressure",
    "eta_hat": "viscosity",
    "kappa": "kappa",
    "nu": "poisson_ratio",
}  # keys of files to fields of `Reduced`, in its order


def check(
    place: str,
    value: Any,
    expected: str,
    good: Callable[[np.ndarray], np.ndarray],
    *,
    optional: bool = False,
) -> None:
    """Refuse what is no number, or a concrete one outside its meaning; traced values pass, and None where optional."""
    if isinstance(value, Tracer) or (value is None and optional):
        return  # under jit the caller has checked
    kind = getattr(value, "dtype", np.dtype(float)).kind  # of texts, dates and complex numbers float() would take some
    if isinstance(value, str | bytes | list | tuple | dict | complex | None) or kind not in "iufb":
        shown = repr(value) if len(repr(value)) <= 40 else repr(value)[:37] + "..."
        raise BadValue(
            place,
            found=f"{shown}, a {type(value).__name__}" if value is not None else "None",
            expected=expected,
            remedy="Give a number, or an array of numbers, without its unit.",
        )
    if not isinstance(value, int | float | np.ndarray | np.generic | jax.Array):
        return  # one of JAX's internal placeholders
    numbers = np.asarray(value, dtype=float)
    ok = np.isfinite(numbers) & good(numbers)
    if not np.all(ok):
        worst = float(numbers[~ok].ravel()[0])
        raise BadValue(place, found=f"{worst:g}", expected=expected, remedy="Check the value and its unit.")


def _positive(place: str, value: Number) -> None:
    check(place, value, "a finite number above 0", lambda x: x > 0)


def _check_ratio(value: Number) -> None:
    check("poisson_ratio", value, "-1 < nu <= 0.5", lambda x: (x > -1) & (x <= 0.5))


@dataclass(frozen=True)
class Shell:
    """A stress-free spherical shell.

    Args:
        radius: Midplane radius R0 [m].
        thickness: Wall thickness d [m].
        youngs_modulus: Young's modulus E [Pa].
        poisson_ratio: Poisson ratio ν [-], -1 < ν <= 1/2.
    """

    radius: Number
    thickness: Number
    youngs_modulus: Number
    poisson_ratio: Number = 0.5

    def __post_init__(self) -> None:
        _positive("radius [m]", self.radius)
        _positive("thickness [m]", self.thickness)
        _positive("youngs_modulus [Pa]", self.youngs_modulus)
        _check_ratio(self.poisson_ratio)


@dataclass(frozen=True)
class Gas:
    """The gas inside the stress-free shell: pressure P0 [Pa] and polytropic exponent κ [-]."""

    pressure: Number
    kappa: Number = 1.4

    def __post_init__(self) -> None:
        _positive("gas pressure [Pa]", self.pressure)
        check("kappa", self.kappa, "a number of at least 1", lambda x: x >= 1)


@dataclass(frozen=True)
class Liquid:
    """The liquid outside: density ρ_f [kg/m³] and dynamic viscosity η_f [Pa s]."""

    density: Number = 1000.0
    viscosity: Number = 1e-3

    def __post_init__(self) -> None:
        _positive("density [kg/m^3]", self.density)
        check("viscosity [Pa s]", self.viscosity, "a finite number of at least 0", lambda x: x >= 0)


@dataclass(frozen=True)
class Load:
    """The pressure far away in the liquid, P_ext [Pa]."""

    pressure: Number

    def __post_init__(self) -> None:
        _positive("outer pressure [Pa]", self.pressure)


@dataclass(frozen=True)
class Scales:
    """SI value of each unit used inside jshell.

    Attributes:
        length: R0 [m].
        pressure: E d/R0 [Pa].
        density: ρ_f [kg/m³].

    Raises:
        BadValue: One that is not a finite number above 0.
    """

    length: Any  # numbers; traced ones while a derivative in SI is taken
    pressure: Any
    density: Any

    def __post_init__(self) -> None:
        _positive("length [m]", self.length)
        _positive("pressure [Pa]", self.pressure)
        _positive("density [kg/m^3]", self.density)

    @property
    def time(self) -> Any:
        """sqrt(ρ_f R0³/(E d)) [s]."""
        ratio: Any = self.density / self.pressure
        root: Any = jnp.sqrt(ratio) if isinstance(ratio, jax.Array) else float(np.sqrt(ratio))
        return self.length * root

    @property
    def frequency(self) -> Any:
        """What ω̂ = 1 is in cycles per second [Hz]."""
        return 1 / (2 * np.pi * self.time)

    def of(self, dimension: str) -> Any:
        """SI value of one internal unit of a dimension (`length`, `volume`, …)."""
        length, time, pressure = self.length, self.time, self.pressure
        return {
            "none": 1.0,
            "length": length,
            "area": length**2,
            "volume": length**3,
            "time": time,
            "speed": length / time,
            "volume rate": length**3 / time,
            "pressure": pressure,
            "energy": pressure * length**3,
            "frequency": 1 / time,
            "viscosity": pressure * time,
        }[dimension]


class Reduced(eqx.Module):
    """One problem without units: four numbers and two exponents.

    Args:
        thickness: d̂ = d/R0 [-].
        gas_pressure: P̂0, gas pressure of the stress-free sphere [E d/R0].
        outer_pressure: P̂ext [E d/R0].
        viscosity: η̂ = η_f/sqrt(E d ρ_f R0) [-].
        kappa: Polytropic exponent of the gas [-].
        poisson_ratio: ν [-], -1 < ν <= 1/2.

    Raises:
        BadValue: A number outside its meaning (checked on concrete numbers, not under `jit`).

    Example:
        >>> import jshell as js
        >>> js.Reduced(0.22, 0.9, 1.6, 0.004).kappa
        1.4
        >>> js.Reduced(0.22, 0.9, 1.6)  # doctest: +NORMALIZE_WHITESPACE
        Reduced(thickness=0.22 [R0], gas_pressure=0.9 [E d/R0], outer_pressure=1.6 [E d/R0],
                viscosity=0 [sqrt(E d rho_f R0)], kappa=1.4, poisson_ratio=0.5)
    """

    thickness: Number
    gas_pressure: Number
    outer_pressure: Number
    viscosity: Number = 0.0
    kappa: Number = 1.4
    poisson_ratio: Number = 0.5

    def __check_init__(self) -> None:
        check("thickness (d_hat)", self.thickness, "0 < d_hat < 1", lambda x: (x > 0) & (x < 1))
        _positive("gas_pressure (P0_hat)", self.gas_pressure)
        _positive("outer_pressure (Pext_hat)", self.outer_pressure)
        check("viscosity (eta_hat)", self.viscosity, "a finite number of at least 0", lambda x: x >= 0)
        check("kappa", self.kappa, "a number of at least 1", lambda x: x >= 1)
        _check_ratio(self.poisson_ratio)

    @readable
    def __repr__(self) -> str:
        return shown(
            self,
            f"thickness={number(self.thickness, 'R0')}",
            f"gas_pressure={number(self.gas_pressure, PRESSURE)}",
            f"outer_pressure={number(self.outer_pressure, PRESSURE)}",
            f"viscosity={number(self.viscosity, 'sqrt(E d rho_f R0)')}",
            f"kappa={number(self.kappa)}",
            f"poisson_ratio={number(self.poisson_ratio)}",
        )

    def as_arrays(self) -> "Reduced":
        """The same numbers as JAX arrays, so that a compiled program serves every value."""
        return jax.tree.map(lambda number: jnp.asarray(number, dtype=float), self)

    def replace(self, **changes: Number) -> "Reduced":
        """The same problem but for some numbers.

        Args:
            **changes: Fields and their new values, such as `outer_pressure=1.7`.

        Example:
            >>> import jshell as js
            >>> js.presets.R.conditions.replace(outer_pressure=1.7).outer_pressure
            1.7
        """
        return dataclasses.replace(self, **changes)

    def as_dict(self) -> dict[str, Number]:
        """The numbers under the keys that files have for them: `d_hat`, `P0_hat`, `Pext_hat`, `eta_hat`, `kappa`, `nu`.

        Example:
            >>> import jshell as js
            >>> js.presets.R.conditions.as_dict()["Pext_hat"]
            1.6
        """
        return {key: getattr(self, field) for key, field in CONDITION_FIELDS.items()}

    @staticmethod
    def from_dict(numbers: Mapping[str, Number]) -> "Reduced":
        """The problem of numbers under the keys of files; `eta_hat`, `kappa` and `nu` may be left out."""
        return Reduced(**{CONDITION_FIELDS[key]: value for key, value in numbers.items()})

    @staticmethod
    def from_si(shell: Shell, gas: Gas, liquid: Liquid, load: Load) -> "Reduced":
        """The same problem without units, differentiable in every number; `scales` gives the way back.

        Raises:
            BadValue: A number that no laboratory has, with the unit that it was probably written in.
        """
        refuse_slips(
            **{
                "radius [m]": shell.radius,
                "youngs_modulus [Pa]": shell.youngs_modulus,
                "gas pressure [Pa]": gas.pressure,
                "outer pressure [Pa]": load.pressure,
                "density [kg/m^3]": liquid.density,
            }
        )
        unit = scales(shell, liquid)
        return Reduced(
            thickness=shell.thickness / shell.radius,
            gas_pressure=gas.pressure / unit.pressure,
            outer_pressure=load.pressure / unit.pressure,
            viscosity=liquid.viscosity / unit.of("viscosity"),
            kappa=gas.kappa,
            poisson_ratio=shell.poisson_ratio,
        )

    def to_si(self, unit: Scales) -> tuple[Shell, Gas, Liquid, Load]:
        """The SI problem that these numbers describe at given scales."""
        thickness = float(self.thickness) * unit.length
        shell = Shell(unit.length, thickness, unit.pressure * unit.length / thickness, float(self.poisson_ratio))
        gas = Gas(float(self.gas_pressure) * unit.pressure, float(self.kappa))
        liquid = Liquid(unit.density, float(self.viscosity) * unit.of("viscosity"))
        return shell, gas, liquid, Load(float(self.outer_pressure) * unit.pressure)


def scales(shell: Shell, liquid: Liquid) -> Scales:
    """The units of length, pressure and density that remove a problem's dimensions."""
    return Scales(shell.radius, shell.youngs_modulus * shell.thickness / shell.radius, liquid.density)

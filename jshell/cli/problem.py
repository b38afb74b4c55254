"""The conditions that every verb takes: a preset, pure numbers, or SI.

One place declares these options; `with_conditions` adds them to a verb and
hands it a `Case`; `with_options` does so for any group of options.
"""

import functools
import inspect
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import typer

import jshell
from jshell.cli.amounts import amount
from jshell.cli.output import table
from jshell.errors import BadValue
from jshell.quantities import POWERS, SI_UNIT, UNITS, laboratory_unit


@dataclass(frozen=True)
class Case:
    """The shell and load that a command line describes, and their scales where they came in SI."""

    conditions: "jshell.Reduced"
    scales: "jshell.Scales | None"
    has_viscosity: bool

    def needs_viscosity(self) -> None:
        """Refuse a request that depends on a viscosity nobody gave."""
        if not self.has_viscosity:
            raise BadValue(
                "--eta-hat",
                found="no viscosity",
                expected="a number of at least 0",
                remedy="Give --eta-hat (0 is an inviscid liquid), or --preset R.",
            )

    def record(self) -> dict[str, float]:
        """The conditions as JSON."""
        return named(self.conditions)

    def si(self, numbers: Mapping[str, Any], dimensions: Mapping[str, str]) -> dict[str, dict[str, float | None]]:
        """What JSON says of numbers in SI, under `si`: each with its unit in its name; nothing without units."""
        if self.scales is None:
            return {}
        units = SI_UNIT | {"angular frequency": "Hz"}
        rows = [(key, kind) for key, kind in dimensions.items() if key in numbers]
        return {"si": {f"{key} [{units[kind]}]": self._in_si(numbers[key], kind) for key, kind in rows}}

    def in_units(self, number: Any, dimension: str | None) -> str:
        """A number in a unit of the laboratory's, as a cell of a table; angular frequencies as cycles a second."""
        found = None if dimension is None else self._in_si(number, dimension)
        if found is None or dimension is None:
            return "–"
        if dimension == "angular frequency":
            unit, size = next((row for row in (("MHz", 1e6), ("kHz", 1e3)) if abs(found) >= row[1]), ("Hz", 1.0))
        else:
            unit = laboratory_unit(dimension, found)
            size = UNITS[unit][1]
        return f"{found / size:.5g} {unit.translate(POWERS)}"

    def _in_si(self, number: Any, dimension: str) -> float | None:
        if self.scales is None or number is None or not math.isfinite(float(number)):
            return None
        if dimension == "angular frequency":
            return float(number) * float(self.scales.frequency)
        return float(number) * float(self.scales.of(dimension))

    def table(self, rows: Sequence[tuple[str, Any, str | None]], header: tuple[str, str]) -> str:
        """Names, numbers and, where the problem has units, the numbers in SI."""
        if self.scales is None:
            return table([row[:2] for row in rows], header)
        return table([(name, number, self.in_units(number, kind)) for name, number, kind in rows], (*header, "SI"))


def named(conditions: "jshell.Reduced") -> dict[str, float]:
    """Conditions under the names files use."""
    c = conditions
    return {
        "d_hat": float(c.thickness),
        "P0_hat": float(c.gas_pressure),
        "Pext_hat": float(c.outer_pressure),
        "eta_hat": float(c.viscosity),
        "kappa": float(c.kappa),
        "nu": float(c.poisson_ratio),
    }


PURE = ("d_hat", "p0_hat", "pext_hat", "eta_hat")
SI = ("r0", "d", "e", "p0", "pext", "rho", "eta")
_REDUCED = "Conditions without units"
_SI = "Conditions with units"


def _amount(flag: str, dimension: str, words: str) -> Any:
    return typer.Option(flag, parser=amount(dimension), metavar="<number>", help=words, rich_help_panel=_SI)


Preset = Annotated[
    str | None, typer.Option("--preset", help="Named shell: R, R-macro, R-micro; other options override it.")
]
DHat = Annotated[float | None, typer.Option("--d-hat", help="Thickness d/R0.", rich_help_panel=_REDUCED)]
P0Hat = Annotated[float | None, typer.Option("--p0-hat", help="Gas pressure / (E d/R0).", rich_help_panel=_REDUCED)]
PextHat = Annotated[
    float | None, typer.Option("--pext-hat", help="Outer pressure / (E d/R0).", rich_help_panel=_REDUCED)
]
EtaHat = Annotated[
    float | None, typer.Option("--eta-hat", help="Viscosity / sqrt(E d rho R0).", rich_help_panel=_REDUCED)
]
Kappa = Annotated[float | None, typer.Option("--kappa", help="Polytropic exponent of the gas; 1.4 by default.")]
Nu = Annotated[float | None, typer.Option("--nu", help="Poisson ratio; 0.5 by default.")]
R0 = Annotated[float | None, _amount("--r0", "length", "Radius [m], or as 22.5mm.")]
D = Annotated[float | None, _amount("--d", "length", "Thickness [m], or as 126nm.")]
E = Annotated[float | None, _amount("--e", "pressure", "Young's modulus [Pa], or as 0.5MPa.")]
P0 = Annotated[float | None, _amount("--p0", "pressure", "Gas pressure [Pa], or as 100kPa.")]
Pext = Annotated[float | None, _amount("--pext", "pressure", "Outer pressure [Pa], or as 176kPa.")]
Rho = Annotated[float | None, typer.Option("--rho", help="Density of the liquid [kg/m^3].", rich_help_panel=_SI)]
Eta = Annotated[float | None, typer.Option("--eta", help="Viscosity of the liquid [Pa s].", rich_help_panel=_SI)]


@dataclass(frozen=True)
class ConditionOptions:
    """A shell and its load as a command line gives them."""

    preset: Preset = None
    d_hat: DHat = None
    p0_hat: P0Hat = None
    pext_hat: PextHat = None
    eta_hat: EtaHat = None
    kappa: Kappa = None
    nu: Nu = None
    r0: R0 = None
    d: D = None
    e: E = None
    p0: P0 = None
    pext: Pext = None
    rho: Rho = None
    eta: Eta = None


def conditions(given: ConditionOptions) -> Case:
    """The problem that the options describe.

    Raises:
        BadValue: Options that are missing, mixed, or outside their meaning.
    """
    said = lambda names: {name: value for name in names if (value := getattr(given, name)) is not None}  # noqa: E731
    given_pure, given_si = said(PURE), said(SI)
    if given_pure and given_si:
        raise BadValue(
            "conditions",
            found="options with and without units: " + ", ".join(_flags((*given_pure, *given_si))),
            expected="one kind",
            remedy="Give all pressures and lengths in SI, or all as pure numbers.",
        )
    base = None if given.preset is None else jshell.presets.preset(given.preset)
    if base is None and not given_pure and not given_si:
        raise BadValue("conditions", found="none", expected="--preset, pure numbers or SI", remedy="Try --preset R.")
    if given_si:
        return _from_si(base, given_si, given.kappa, given.nu)
    return _from_pure(base, given_pure, given.kappa, given.nu)


def _from_pure(
    base: "jshell.presets.Preset | None", given: dict[str, float], kappa: float | None, nu: float | None
) -> Case:
    if base is None:
        _require(given, ("d_hat", "p0_hat", "pext_hat"))
        start = {"eta_hat": 0.0, "kappa": 1.4, "nu": 0.5}
    else:
        c = named(base.conditions)
        start = {"d_hat": c["d_hat"], "p0_hat": c["P0_hat"], "pext_hat": c["Pext_hat"], "eta_hat": c["eta_hat"]}
        start |= {"kappa": c["kappa"], "nu": c["nu"]}
    full = start | given
    reduced = jshell.Reduced(
        full["d_hat"],
        full["p0_hat"],
        full["pext_hat"],
        full["eta_hat"],
        full["kappa"] if kappa is None else kappa,
        full["nu"] if nu is None else nu,
    )
    unit = None if base is None or given else base.unit
    return Case(reduced, unit, base is not None or "eta_hat" in given)


def _from_si(
    base: "jshell.presets.Preset | None", given: dict[str, float], kappa: float | None, nu: float | None
) -> Case:
    if base is not None:
        if base.unit is None:
            raise BadValue(
                "conditions",
                found=f"SI options with preset {base.name}, which has no units",
                expected="pure numbers with it, or a laboratory preset",
                remedy="Use --preset R-macro or R-micro, or --d-hat and its kin.",
            )
        shell, gas, liquid, load = base.conditions.to_si(base.unit)
        full = {
            "r0": shell.radius,
            "d": shell.thickness,
            "e": shell.youngs_modulus,
            "p0": gas.pressure,
            "pext": load.pressure,
            "rho": liquid.density,
            "eta": liquid.viscosity,
        } | given
        kappa = float(gas.kappa) if kappa is None else kappa
        nu = float(shell.poisson_ratio) if nu is None else nu
    else:
        _require(given, ("r0", "d", "e", "p0", "pext", "rho"))
        full = {"eta": 0.0} | given
    shell = jshell.Shell(full["r0"], full["d"], full["e"], 0.5 if nu is None else nu)
    gas = jshell.Gas(full["p0"], 1.4 if kappa is None else kappa)
    liquid, load = jshell.Liquid(full["rho"], full["eta"]), jshell.Load(full["pext"])
    reduced = jshell.Reduced.from_si(shell, gas, liquid, load)
    return Case(reduced, jshell.shell.scales(shell, liquid), base is not None or "eta" in given)


def _require(given: dict[str, float], needed: tuple[str, ...]) -> None:
    missing = [name for name in needed if name not in given]
    if missing:
        raise BadValue(
            "conditions",
            found="no " + ", ".join(_flags(missing)),
            expected="all of " + ", ".join(_flags(needed)),
            remedy="Add them, or start from --preset R.",
        )


def _flags(names) -> list[str]:
    return ["--" + name.replace("_", "-") for name in names]


def with_options(
    build: Callable[..., Any], name: str, then: Callable[[Any], Any] = lambda built: built
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A decorator that gives a verb a group of options as one argument.

    Args:
        build: A function, or a class of fields, whose parameters are the options.
        name: The verb's argument, which is what `build` makes of them.
        then: What that argument is made into.
    """
    options = inspect.signature(build).parameters

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        own = [[p] if p.name != name else [*options.values()] for p in inspect.signature(verb).parameters.values()]

        @functools.wraps(verb)
        def wrapped(**given) -> None:
            built = build(**{option: given.pop(option) for option in options})
            verb(**{name: then(built)}, **given)

        shown = sorted(itertools.chain(*own), key=lambda p: p.default is not inspect.Parameter.empty)
        shown = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in shown]
        wrapped.__signature__ = inspect.Signature(shown)  # pyright: ignore[reportAttributeAccessIssue]
        wrapped.__annotations__ = {p.name: p.annotation for p in shown}
        return wrapped

    return decorate


with_conditions = with_options(ConditionOptions, "problem", conditions)

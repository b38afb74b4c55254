"""Which runs a campaign holds: families, each spread by a rule over some of the parameters.

Symbols    as in `Run`; besides P̂ext, `excess` = P̂ext - P̂0 and `load` = P̂ext over the classical buckling load
Source     Mokbel et al. 2021, fig:resul: one parameter at a time; scipy.stats.qmc for Latin hypercubes
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import jax
import numpy as np

from jshell.campaigns.planned import FIELDS, KINDS, Run
from jshell.errors import BadName, BadValue, choose
from jshell.shell import Reduced
from jshell.shell.sphere import buckling_load

RULES = ("one", "grid", "latin")
LOADS = ("Pext_hat", "excess", "load")  # three ways to say the outer pressure
DIGITS = 6  # of a computed outer pressure, so that its last bits do not rename the run
Setting = float | int | bool | str


@dataclass(frozen=True)
class Family:
    """Runs of one kind, spread over some parameters.

    Attributes:
        name: One word, by which the catalogue finds them.
        kind: Of all its runs, see `jshell.campaigns.KINDS`.
        base: Parameter to the value all share; fields of `Run`, or `excess` or `load` instead of `Pext_hat`.
        vary: Parameter to its values; for `latin` to its lowest and highest value.
        rule: `one`: each parameter in turn, the others at their base value; `grid`: all combinations; `latin`: a
            Latin hypercube.
        samples, seed: Of `latin`.
        log: Parameters that `latin` spreads in their logarithm.
        note: What it is for.

    Raises:
        BadName, BadValue: A rule, kind or parameter that does not exist; settings that do not fit together.
    """

    name: str
    kind: str
    base: Mapping[str, Setting] = field(default_factory=dict)
    vary: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)
    rule: str = "one"
    samples: int = 0
    seed: int = 0
    log: tuple[str, ...] = ()
    note: str = ""

    def __post_init__(self) -> None:
        place = f"family {self.name!r}"
        if not self.name.replace("-", "").replace("_", "").isalnum():
            raise BadName(place, found="no single word", expected="letters, digits, - and _", remedy="Rename it.")
        for what, found, known in (("kind", self.kind, KINDS), ("rule", self.rule, RULES)):
            choose(f"{place}, {what}", found, known)
        known = {*FIELDS, *LOADS} - {"kind"}
        for name in (*self.base, *self.vary, *self.log):
            choose(f"{place}, parameter", name, sorted(known))
        for name, values in self.vary.items():
            if len(values) == 0 or (self.rule == "latin" and not (len(values) == 2 and _rises(*values))):
                expected = "its lowest and highest value" if self.rule == "latin" else "at least one value"
                raise BadValue(f"{place}, {name}", found=repr(list(values)), expected=expected, remedy="Correct it.")
        if self.rule == "latin" and (self.samples < 1 or not self.vary):
            raise BadValue(
                f"{place}, samples", found=str(self.samples), expected="at least 1, and a range", remedy="Give both."
            )

    def runs(self) -> list[Run]:
        """The runs in order, each once.

        Raises:
            BadValue: A run without a parameter it needs, or with a value outside its meaning.
        """
        return list(dict.fromkeys(self._run(chosen) for chosen in self._points()))

    def _points(self) -> Iterator[dict[str, Setting]]:
        base = dict(self.base)
        if self.rule == "one":
            if not self.vary:
                yield base
            for name, values in self.vary.items():
                for value in values:
                    yield base | {name: value}
        elif self.rule == "grid":
            for values in itertools.product(*self.vary.values()):
                yield base | dict(zip(self.vary, values, strict=True))
        else:
            from scipy.stats import qmc  # here: it is slow to load, and few need it

            unit = qmc.LatinHypercube(len(self.vary), rng=np.random.default_rng(self.seed)).random(self.samples)
            low, high = (np.array([float(values[k]) for values in self.vary.values()]) for k in (0, 1))
            logs = np.array([name in self.log for name in self.vary])
            if np.any(low[logs] <= 0):
                raise BadValue(
                    f"family {self.name!r}, log",
                    found="a range that reaches 0",
                    expected="numbers above 0",
                    remedy="Raise the lowest value.",
                )
            straight = low + (high - low) * unit
            curved = np.exp(np.log(np.where(logs, low, 1)) * (1 - unit) + np.log(np.where(logs, high, 1)) * unit)
            for row in np.where(logs, curved, straight):
                # five digits say where a sample is, and no platform's last bit changes its name
                yield base | {name: float(f"{value:.5g}") for name, value in zip(self.vary, row, strict=True)}

    def _run(self, chosen: dict[str, Setting]) -> Run:
        place = f"family {self.name!r}"
        # a parameter that is varied replaces whichever way the base said the outer pressure
        varied = [name for name in LOADS if name in self.vary]
        said = [name for name in LOADS if name in chosen and (name in varied or not varied)]
        if len(said) != 1:
            raise BadValue(
                f"{place}, outer pressure",
                found=", ".join(said) or "none",
                expected="one of Pext_hat, excess, load",
                remedy="Give exactly one.",
            )
        facts = {name: value for name, value in chosen.items() if name not in LOADS}
        missing = [name for name in ("d_hat", "P0_hat") if name not in facts]
        if missing:
            raise BadValue(place, found=f"no {missing[0]}", expected="a value", remedy="Add it to the base.")
        value = chosen[said[0]]
        if said[0] == "excess":
            value = round(float(facts["P0_hat"]) + float(value), DIGITS)
        elif said[0] == "load":
            shell = (facts["d_hat"], facts["P0_hat"], facts.get("kappa", 1.4), facts.get("nu", 0.5))
            value = round(float(value) * _classical_load(*(float(fact) for fact in shell)), DIGITS)
        return Run(kind=self.kind, Pext_hat=value, **facts)  # type: ignore[arg-type]


def _rises(low: Setting, high: Setting) -> bool:
    """Whether a range is one of numbers that rise."""
    return not isinstance(low, str) and not isinstance(high, str) and low < high


@lru_cache(maxsize=4096)
def _classical_load(thickness: float, gas_pressure: float, kappa: float, poisson_ratio: float) -> float:
    """Outer pressure at which the compressed sphere buckles [E d/R0]; compiled once, found once for each shell."""
    sphere = Reduced(thickness, gas_pressure, gas_pressure, 0.0, kappa, poisson_ratio)
    return float(_compiled_load(sphere.as_arrays()))


_compiled_load = jax.jit(buckling_load)


@dataclass(frozen=True)
class Design:
    """A campaign before it is run.

    Attributes:
        name: What it is.
        families: Its families, names all different.

    Raises:
        BadName, BadValue: Two families of one name, or none.

    Example:
        >>> from jshell.campaigns import Design, Family
        >>> thin = Family("thin", "modes", {"P0_hat": 0.9, "load": 1.05}, {"d_hat": (0.1, 0.2)})
        >>> [run.d_hat for run in Design("two shells", (thin,)).runs()]
        [0.1, 0.2]
    """

    name: str
    families: tuple[Family, ...]

    def __post_init__(self) -> None:
        names = [family.name for family in self.families]
        if not names or len(set(names)) != len(names):
            raise BadName(
                "design",
                found=", ".join(names) or "no family",
                expected="families of different names",
                remedy="Rename.",
            )

    def runs(self) -> dict[Run, tuple[str, ...]]:
        """Every run once, in the order of the design, and the families it belongs to."""
        found: dict[Run, tuple[str, ...]] = {}
        for family in self.families:
            for run in family.runs():
                found[run] = (*found.get(run, ()), family.name)
        return found

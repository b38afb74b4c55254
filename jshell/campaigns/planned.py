"""One planned run: what it starts from, its conditions, and how finely it is computed.

Everything a run depends on is a field here, so that the digest of the fields
names it: the same run in two families, two designs or two places is the same.

Symbols    d̂, P̂0, P̂ext, η̂ as in files   δP offset of both pressures [E d/R0]
Source     Mokbel et al. 2021, numerical method and calibration on spherical oscillations
"""

import dataclasses
import hashlib
from dataclasses import dataclass
from typing import Any

from jshell.contour import WeakSpot
from jshell.dynamics.roots import check_liquid
from jshell.errors import BadValue, choose
from jshell.shell.parameters import CONDITION_FIELDS, Reduced

KINDS = {
    "modes": "small vibrations about the buckled rest shape, nothing in time",
    "snap": "from the stress-free sphere, ramped to the outer pressure, then held",
    "kick": "from the buckled rest shape, both pressures offset, kicked along its first two modes",
    "step": "the sphere at the gas pressure, outer pressure raised at once; no weak spot",
    "swell": "the compressed sphere, set breathing by a small velocity; no weak spot",
}
SWITCHES, COUNTS = ("follow", "symmetry"), ("elements", "azimuth")  # fields that are true or false, whole numbers
LATER = ("symmetry", "azimuth")  # fields that came after the first campaigns
MOST_AROUND = 4


@dataclass(frozen=True)
class Run:
    """One run, without units.

    Attributes:
        kind: `modes`, `snap`, `kick`, `step` or `swell`, see `KINDS`.
        d_hat, P0_hat, Pext_hat, eta_hat, kappa, nu: The problem.
        attached: Half-angle of the pad that holds the shell [rad]; 0 is free.
        offset: δP added to inner and outer pressure at the rest shape, which keeps the shape [E d/R0]; `kick`, `modes`.
        amplitude: Relative change of volume of a `kick` or `swell` [-].
        weak_depth, weak_width: Of the weak spot; not used by `step` and `swell`.
        ramp: Time the outer pressure takes [time unit]; `snap` alone.
        duration, every: Length and spacing of the record [time unit]; the time step is at most `every`, nor over 1/60.
        elements, follow: Mesh; whether the nodes follow the rim.
        liquid: Of the modes, as in `jshell.dynamics.modes`: `second` is right to 0.6 % in τ at η̂ = 0.004 and a tenth
            of the work; `exact` at any viscosity. In time the liquid is of second order, and spheres slip freely.
        symmetry: Whether it is computed if the buckled rest shape is round, and how fast it leaves that if not.
        azimuth: Highest order m around the axis whose slowest vibration is computed, 0 to 4, the liquid `second` at
            most; not used by `step` and `swell`, as `symmetry`.

    Raises:
        BadName, BadValue: No such kind; a number outside its meaning.
    """

    kind: str
    d_hat: float | int
    P0_hat: float | int
    Pext_hat: float | int
    eta_hat: float | int = 0.004
    kappa: float | int = 1.4
    nu: float | int = 0.5
    attached: float | int = 0.0
    offset: float | int = 0.0
    amplitude: float | int = 0.005
    weak_depth: float | int = 0.15
    weak_width: float | int = 0.35
    ramp: float | int = 25.0
    duration: float | int = 70.0
    every: float | int = 0.05
    elements: int = 24
    follow: bool = False
    liquid: str = "second"
    symmetry: bool = False
    azimuth: int = 0

    def __post_init__(self) -> None:
        choose("kind", self.kind, KINDS)
        check_liquid(self.liquid)
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("kind", "liquid"):
                continue
            kind = bool if field.name in SWITCHES else int if field.name in COUNTS else float
            if kind is float and not isinstance(value, bool) and isinstance(value, int | float):
                object.__setattr__(self, field.name, float(value))  # 1 and 1.0 are one run
            elif type(value) is not kind:
                expected = {float: "a number", int: "a whole number", bool: "true or false"}[kind]
                raise BadValue(field.name, found=repr(value), expected=expected, remedy="Check it.")
        if not 0 <= self.azimuth <= MOST_AROUND:
            expected = f"0 to {MOST_AROUND}"
            raise BadValue("azimuth", found=repr(self.azimuth), expected=expected, remedy="4 is m = 1, 2, 3, 4.")
        self.weak_spot  # noqa: B018  (a number outside its meaning is refused now)
        self.conditions  # noqa: B018

    @property
    def conditions(self) -> Reduced:
        """The problem, before any offset."""
        return Reduced.from_dict({key: getattr(self, key) for key in CONDITION_FIELDS})

    @property
    def weak_spot(self) -> WeakSpot:
        return WeakSpot(0.0 if self.kind in ("step", "swell") else self.weak_depth, self.weak_width)

    @property
    def key(self) -> str:
        """Twelve letters that no other run has."""
        facts = repr(sorted(self.facts().items()))
        return hashlib.sha256(facts.encode()).hexdigest()[:12]

    def facts(self) -> dict[str, Any]:
        """Field to value, as names and files are made of: what runs learned later is left out where it is not asked."""
        return told_when_asked(self, LATER)


def told_when_asked(row: Any, later: tuple[str, ...]) -> dict[str, Any]:
    """The fields of a dataclass, but for later ones that hold their default: files of before stay as they are."""
    defaults = {field.name: field.default for field in dataclasses.fields(row)}
    return {
        name: value
        for name, value in dataclasses.asdict(row).items()
        if not (name in later and value == defaults[name])
    }


FIELDS = {field.name: field for field in dataclasses.fields(Run)}

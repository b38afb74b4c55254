"""Shells that have names.

`R` is the source's reference configuration as pure numbers. `R-macro` and
`R-micro` are the two laboratory problems the source gives for it; their own
numbers differ from R by 1 to 6 percent. `RANGES` is Table 1.
"""

from dataclasses import dataclass

from jshell.errors import choose
from jshell.shell.parameters import Gas, Liquid, Load, Reduced, Scales, Shell, scales


@dataclass(frozen=True)
class Preset:
    """A named problem; `unit` is None where only pure numbers are published."""

    name: str
    words: str
    conditions: Reduced
    unit: Scales | None = None


@dataclass(frozen=True)
class ParameterRanges:
    """A row of Table 1: lowest and highest value of each number. SI, and reduced."""

    words: str
    radius: tuple[float, float] | None  # [m]
    thickness: tuple[float, float] | None  # [m] for contrast agents, [R0] for macroshells and experiments
    youngs_modulus: tuple[float, float] | None  # [Pa]
    d_hat: tuple[float, float]
    P0_hat: tuple[float, float]
    eta_hat: tuple[float, float]


def _laboratory(name: str, words: str, shell: Shell, gas: Gas, liquid: Liquid, load: Load) -> Preset:
    return Preset(name, words, Reduced.from_si(shell, gas, liquid, load), scales(shell, liquid))


R = Preset("R", "the source's reference configuration", Reduced(0.22, 0.9, 1.6, 0.004))
R_MACRO = _laboratory(
    "R-macro",
    "an elastomer shell of 22.5 mm in glycerol",
    Shell(22.5e-3, 5e-3, 0.5e6),
    Gas(1e5),
    Liquid(1260.0, 1.0),
    Load(1.77e5),
)
R_MICRO = _laboratory(
    "R-micro",
    "a shell of 22.5 µm in water",
    Shell(22.5e-6, 5e-6, 0.5e6),
    Gas(1e5),
    Liquid(1000.0, 1e-3),
    Load(1.77e5),
)
PRESETS = {preset.name: preset for preset in (R, R_MACRO, R_MICRO)}

RANGES = {
    "contrast-agent": ParameterRanges(
        "ultrasound contrast agents",
        (1e-6, 5e-6),
        (2e-9, 5e-9),
        (1e6, 1e8),
        (4e-4, 5e-3),
        (0.2, 250.0),
        (0.02, 0.7),
    ),
    "macroshell": ParameterRanges(
        "polymeric macroscopic shells",
        (1e-3, 0.1),
        (0.01, 0.5),
        (1e4, 1e6),
        (0.01, 0.5),
        (0.2, 1e5),
        (4e-6, 3.0),
    ),
    "experiments": ParameterRanges(
        "the source's experiments",
        (6.75e-3, 67.5e-3),
        (0.08, 0.3),
        (0.5e6, 0.5e6),
        (0.08, 0.3),
        (0.7, 2.5),
        (1.3e-3, 13e-3),
    ),
    "simulations": ParameterRanges("the source's simulations", None, None, None, (0.04, 0.3), (0.2, 5.0), (6e-4, 1.3)),
}


def preset(name: str) -> Preset:
    """The preset of a name.

    Raises:
        BadName: No such preset.
    """
    hint = f" {name!r} is a range of Table 1, not one shell: choose numbers inside it." if name in RANGES else ""
    remedy = f"Check the spelling, or give --d-hat --p0-hat --pext-hat --eta-hat.{hint}"
    return PRESETS[choose("preset", name, PRESETS, remedy=remedy)]

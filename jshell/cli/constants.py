"""The constants of the short model as options: one place declares them."""

from dataclasses import dataclass
from typing import Annotated

import typer

import jshell
from jshell.cli.problem import with_options

Alpha1 = Annotated[float, typer.Option("--alpha1", help="Added-mass factor of the volume.")]
Alpha2 = Annotated[float, typer.Option("--alpha2", help="Added-mass factor of the area.")]
KVS = Annotated[float, typer.Option("--k-vs", "--kvs", help="Volume-area coupling.")]
Beta1 = Annotated[
    float | None,
    typer.Option(
        "--beta1",
        help="Damping factor of the volume; a run without it rings down as the simulator does.",
        show_default="fitted to the simulator",
    ),
]
ALPHA1, ALPHA2, K_VS, BETA1 = 3.6, 1.1, 0.23, 3.6 / 0.68  # `oscillator.SOURCE`, which help need not wait for


@dataclass(frozen=True)
class Damped:
    """Constants from options.

    Attributes:
        constants: All of them; the source's damping where none was given.
        given: Whether the damping was.
    """

    constants: "jshell.oscillator.Coefficients"
    given: bool


def masses(alpha1: Alpha1 = ALPHA1, alpha2: Alpha2 = ALPHA2, k_vs: KVS = K_VS) -> "jshell.oscillator.Coefficients":
    """The constants that frequencies depend on."""
    return jshell.oscillator.Coefficients(alpha1, alpha2, k_vs)


def damped(alpha1: Alpha1 = ALPHA1, alpha2: Alpha2 = ALPHA2, k_vs: KVS = K_VS, beta1: Beta1 = None) -> Damped:
    """The constants that a damped run depends on."""
    constants = jshell.oscillator.Coefficients(alpha1, alpha2, k_vs, BETA1 if beta1 is None else beta1)
    return Damped(constants, beta1 is not None)


with_masses = with_options(masses, "constants")
with_damping = with_options(damped, "damped")

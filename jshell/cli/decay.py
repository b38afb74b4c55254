"""What takes the energy of a run of the short model, from options: what was asked for, else the simulator's decay."""

from typing import Annotated

import typer

import jshell
from jshell.cli.constants import Damped
from jshell.cli.problem import Case
from jshell.errors import BadValue

Tau = Annotated[float | None, typer.Option("--tau", help="Decay time of both modes.")]
CHOOSE = "--beta1 or --tau choose"


def decay(
    problem: Case, damped: Damped, tau: float | None, drag: str | None = None, layer: bool = False
) -> "tuple[jshell.oscillator.Coefficients, str, jshell.oscillator.Decay]":
    """Constants, the law of drag, and how fast they let a shell ring down.

    Args:
        problem: The shell.
        damped: Its constants, with or without a damping of their own.
        tau: A decay time asked for.
        drag: A law asked for: viscous, equal_decay, reynolds or none.
        layer: Whether a Stokes layer stands beside it.

    Raises:
        BadValue: Two decays at once, or none where the viscosity that decides is missing.
    """
    chosen = drag or ("viscous" if tau is None else "equal_decay")
    if tau is not None and (damped.given or chosen != "equal_decay"):
        other = "--beta1" if damped.given else f"--drag {chosen}"
        raise BadValue(
            "--tau", found=f"{tau:g} beside {other}", expected="one of them", remedy="Leave one out: each is a decay."
        )
    if chosen in ("viscous", "reynolds") or layer:
        problem.needs_viscosity()
    short = jshell.oscillator
    conditions, constants = problem.conditions, damped.constants
    limit = float(short.decay_time(short.SOURCE, conditions.viscosity))
    own = float(short.decay_time(constants, conditions.viscosity))
    if chosen == "equal_decay":
        # without a τ the law of drag says itself what it lacks
        return constants, chosen, short.Decay(float("nan") if tau is None else tau, "given tau", limit)
    if chosen == "reynolds":
        return constants, chosen, short.Decay(float("nan"), "reynolds", limit)
    if chosen != "viscous":
        return constants, chosen, short.Decay(float("inf"), "none", limit)
    if damped.given:
        return constants, chosen, short.Decay(own, "given beta1", limit)
    if layer:
        return constants, chosen, short.Decay(own, "source beta1", own)
    return short.ringing(conditions, constants), chosen, short.decay_by_law(conditions)


def line(found: "jshell.oscillator.Decay") -> str:
    """The decay as a line of a table's foot."""
    return f"decay: {found.words}" + (f"; {CHOOSE}" if found.origin in ("law", "source beta1") else "")


def written(found: "jshell.oscillator.Decay") -> tuple[tuple[str, str], ...]:
    """The decay as settings of a trace."""
    return ("decay", found.origin), ("tau", f"{found.tau:.6g}")

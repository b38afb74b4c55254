"""`jshell design`: the shell that rings as wished."""

from typing import Annotated

import typer

import jshell
from jshell.cli.constants import with_masses
from jshell.cli.output import Json, finish, print_json, speaking, table
from jshell.cli.problem import named


@speaking
@with_masses
def design(
    constants: "jshell.oscillator.Coefficients",
    omega_minus: Annotated[float, typer.Option("--omega-minus", help="Wanted slow angular frequency.")],
    omega_plus: Annotated[float, typer.Option("--omega-plus", help="Wanted fast angular frequency.")],
    excess: Annotated[float, typer.Option(help="Outer pressure over the buckling load.")] = 1.0,
    kappa: Annotated[float, typer.Option(help="Polytropic exponent of the gas.")] = 1.4,
    nu: Annotated[float, typer.Option(help="Poisson ratio.")] = 0.5,
    as_json: Json = False,
) -> None:
    """Thickness and gas pressure of the shells that have two wanted frequencies."""
    found = jshell.sensitivity.design(omega_minus, omega_plus, constants, excess=excess, kappa=kappa, poisson_ratio=nu)
    shells = [named(shell) for shell in found.shells]
    if as_json:
        print_json({"outcome": found.outcome, "shells": shells, "gap": found.gap, "nearest": named(found.nearest)})
    else:
        listed = found.shells or (found.nearest,)
        rows = [(_word(found, i), s.thickness, s.gas_pressure, s.outer_pressure) for i, s in enumerate(listed)]
        typer.echo(table(rows, ("shell", "d̂", "P̂0", "P̂ext")))
    finish(found.outcome)


def _word(found: "jshell.sensitivity.MatchingShells", index: int) -> str:
    return str(index + 1) if found.shells else f"nearest, {100 * found.gap:.2g} % off"

"""`jshell export`: the buckled shell's law for programs that know one radius."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import jshell
from jshell.cli import decay as decays
from jshell.cli.constants import Damped, with_damping
from jshell.cli.destinations import writable
from jshell.cli.output import Json, finish, log, print_json, speaking, table
from jshell.cli.problem import Case, with_conditions
from jshell.errors import BadValue, Outcome

ENDINGS = (".csv", ".py", ".apecss")


@speaking
@with_conditions
@with_damping
def export(
    problem: Case,
    damped: Damped,
    path: Annotated[Path, typer.Argument(help="File of the law: .csv a table, .py for jbubble, .apecss for APECSS.")],
    along: Annotated[
        str, typer.Option(help="How area goes with volume: mode, as in the slow mode, for sound; rest, for slow loads.")
    ] = "mode",
    tau: decays.Tau = None,
    as_json: Json = False,
) -> None:
    """Export the law of a buckled shell for bubble codes: pressure, effective mass and damping by volume."""
    writable(path, "PATH", ENDINGS)
    if problem.scales is None:
        raise BadValue(
            "conditions", found="no units", expected="SI conditions", remedy="Give --r0 and kin, or --preset R-micro."
        )
    time = problem.scales.time
    constants, _, _ = decays.decay(problem, damped, None)
    if tau is not None:
        viscosity = problem.conditions.viscosity
        problem.needs_viscosity()
        plain = (constants.alpha1, constants.alpha2, constants.k_vs)
        constants = jshell.Coefficients.with_decay_time(*plain, tau, viscosity)
    law = jshell.export.radial_law(problem.conditions, constants, problem.scales, along=along)
    writers = {".py": jshell.export.write_jbubble, ".apecss": jshell.export.write_apecss}
    writers.get(path.suffix.lower(), jshell.export.write_law)(path, law)
    log(f"wrote {path}" + (f" and {path.with_suffix('.h')}" if path.suffix.lower() == ".apecss" else ""))
    omega, decay = law.slow_mode()
    numbers = {
        "rest_volume_m3": law.rest_volume,
        "rest_pressure_Pa": law.rest_pressure,
        "unbuckling_volume_m3": law.unbuckling_volume,
        "buckling_volume_m3": law.buckling_volume,
        "f_Hz": omega / (2 * np.pi),
        "tau_s": decay if np.isfinite(decay) else None,
        "stiffening": law.stiffening,
    }
    if as_json:
        print_json({"outcome": Outcome.OK, **numbers, "along": along, "out": str(path), "pulsation": omega * time})
    else:
        typer.echo(table(list(numbers.items()), ("law of the buckled shell", "value")))
    finish(Outcome.OK)

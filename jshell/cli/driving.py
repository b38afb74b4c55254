"""What drives a run and what takes its energy, from options: outer pressure, tone, burst, losses."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import jshell
from jshell.cli.problem import Case
from jshell.errors import BadFile, BadUnits, BadValue, choose
from jshell.files import NamedBytes

if TYPE_CHECKING:
    import jshell.pressure

_PRESSURE = "Outer pressure"
_LOSSES = "Losses"

PressureFile = Annotated[
    Path | None,
    typer.Option(
        "--pressure-file",
        help="Table with columns t and P_ext, the outer pressure itself instead of ramp and hold; "
        "without units, or in SI where the conditions are.",
        rich_help_panel=_PRESSURE,
    ),
]
ToneOption = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--tone", metavar="AMPLITUDE OMEGA", help="A sine added to the outer pressure.", rich_help_panel=_PRESSURE
    ),
]
Burst = Annotated[
    tuple[float, float, int] | None,
    typer.Option(
        "--burst",
        metavar="AMPLITUDE OMEGA CYCLES",
        help="A burst added to it, in a Hann window, named by its peak negative pressure.",
        rich_help_panel=_PRESSURE,
    ),
]
BurstStart = Annotated[float, typer.Option("--burst-start", help="When the burst begins.", rich_help_panel=_PRESSURE)]
Stokes = Annotated[
    str | None,
    typer.Option(
        "--stokes",
        help="Stokes layer: memory (its half-order derivative), frequency (at --stokes-frequency), none.",
        rich_help_panel=_LOSSES,
        show_default="memory",
    ),
]
StokesFrequency = Annotated[
    float | None,
    typer.Option(
        "--stokes-frequency",
        help="Keep the Stokes layer at this one frequency instead of with its memory: cheaper, exact there alone.",
        rich_help_panel=_LOSSES,
    ),
]
Bulk = Annotated[
    bool,
    typer.Option(
        "--bulk",
        help="Viscous loss of the potential flow, for a wall that slips: --stokes none.",
        rich_help_panel=_LOSSES,
    ),
]
Order = Annotated[
    int,
    typer.Option(
        "--order",
        help="Order of the liquid's losses in √η̂: 2, or 1 for the Stokes layer alone.",
        rich_help_panel=_LOSSES,
    ),
]
WallDilatation = Annotated[
    float | None,
    typer.Option("--wall-dilatation", help="Dilatational viscosity of the wall / (E d time).", rich_help_panel=_LOSSES),
]
Retardation = Annotated[
    float | None, typer.Option("--retardation", help="Kelvin-Voigt time of the wall.", rich_help_panel=_LOSSES)
]
ReynoldsLaw = Annotated[
    bool,
    typer.Option(
        "--reynolds", help="The source's drag law of a settling sphere, beside the rest.", rich_help_panel=_LOSSES
    ),
]


def outer_pressure(path: Path | None, problem: Case, reading: dict[str, Any] | None = None) -> tuple | None:
    """Times and outer pressure of a table, without units; None without a file.

    `reading` is what the table leaves open, as the verbs that read traces take it.

    A table in SI needs no header where the command line's conditions are in SI; if it has one, the two must agree.

    Raises:
        BadFile: No column `P_ext`.
        BadUnits: A table in SI beside conditions without units.
    """
    if path is None:
        return None
    meta = None
    if problem.scales is not None:
        from jshell.io.headers import si_pairs  # help need not wait for it

        given = {key: float(value) for key, value in si_pairs(problem.conditions, problem.scales)}
        meta = NamedBytes("conditions.json", json.dumps(given).encode())
    trace = jshell.io.read_trace(path, meta=meta, **(reading or {}))
    if problem.scales is None and trace.conditions is None and trace.scales is not None:  # it was read in SI
        raise BadUnits(
            str(path),
            found="units, beside conditions without units",
            expected="both in SI, or both without units",
            remedy="Give the conditions in SI, or the table as pure numbers.",
        )
    if "P_ext" not in trace.channels:
        raise BadFile(
            str(path),
            found="the columns t, " + ", ".join(trace.channels),
            expected="the columns t and P_ext",
            remedy="Name the outer pressure P_ext, or say `--pressure-columns t=1,P_ext=2`.",
        )
    return trace.times, trace["P_ext"]


def forcing(
    tone: tuple[float, float] | None, burst: tuple[float, float, int] | None, burst_start: float
) -> "jshell.pressure.Pressure | None":
    """What is added to the outer pressure; None where nothing is."""
    parts: list[jshell.pressure.Pressure] = []
    if tone is not None:
        parts.append(jshell.oscillator.Tone(*tone))
    if burst is not None:
        parts.append(jshell.oscillator.Pulse(*burst, start=burst_start))
    if not parts:
        return None
    return parts[0] if len(parts) == 1 else jshell.oscillator.Sum(tuple(parts))


def wall_loss(
    wall_dilatation: WallDilatation = None, retardation: Retardation = None
) -> "jshell.membrane.WallLoss | None":
    """The wall's own loss as the options describe it; None without them."""
    if wall_dilatation is None and retardation is None:
        return None
    return jshell.membrane.WallLoss(dilatation=wall_dilatation or 0.0, retardation=retardation or 0.0)


def losses(
    stokes: Stokes = None,
    stokes_frequency: StokesFrequency = None,
    bulk: Bulk = False,
    wall_dilatation: WallDilatation = None,
    retardation: Retardation = None,
    reynolds: ReynoldsLaw = False,
    order: Order = 2,
) -> "jshell.dynamics.Losses":
    """The losses that the options describe.

    Raises:
        BadName: No such Stokes layer.
        BadValue: A frequency without its layer, the layer without its frequency, no such order, or bulk loss beside
            a layer.
    """
    from jshell.dynamics.losses import STOKES  # help need not wait for it

    frequency = stokes_frequency
    chosen = stokes if stokes is not None else ("memory" if frequency is None else "frequency")
    choose("--stokes", chosen, STOKES, remedy="memory is usual.")
    if (chosen == "frequency") != (frequency is not None):
        raise BadValue(
            "--stokes-frequency",
            found="none" if frequency is None else f"{frequency:g} with --stokes {chosen}",
            expected="a frequency with --stokes frequency, and only there",
            remedy="1.2 is near the first modes of R.",
        )
    loss = wall_loss(wall_dilatation, retardation)
    drag = jshell.oscillator.Reynolds() if reynolds else None
    return jshell.dynamics.Losses(chosen, frequency=frequency, order=order, bulk=bulk, wall=loss, drag=drag)

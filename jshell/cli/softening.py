"""`jshell softening`: how much slower a shell rings once it has buckled."""

import importlib
from typing import Annotated

import numpy as np
import typer

import jshell
from jshell.cli.constants import with_masses
from jshell.cli.destinations import Picture, drawable
from jshell.cli.output import Json, finish, print_json, speaking, table
from jshell.errors import BadValue, Outcome

COLUMNS, ROWS = 48, 40  # of the map


@speaking
@with_masses
def softening(
    constants: "jshell.oscillator.Coefficients",
    d_hat: Annotated[float, typer.Option("--d-hat", help="Thickness d/R0.")] = 0.02,
    p0_hat: Annotated[float, typer.Option("--p0-hat", help="Gas pressure / (E d/R0).")] = 0.4,
    highest: Annotated[
        float | None, typer.Option(help="Largest outer pressure / (E d/R0); by default 1.4 times the buckling load.")
    ] = None,
    points: Annotated[int, typer.Option(help="Outer pressures looked at.")] = 200,
    whole_map: Annotated[
        bool, typer.Option("--map", help="Draw the fall of ω− over thickness and gas pressure instead.")
    ] = False,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Fall of the angular frequencies through buckling, with the simulator's own modes beside them where stored."""
    drawable(plot)
    if not (d_hat > 0 and p0_hat > 0 and points > 1):
        raise BadValue(
            "--d-hat, --p0-hat, --points",
            found=f"{d_hat:g}, {p0_hat:g}, {points}",
            expected="numbers above 0, and 2 points or more",
            remedy="Check them.",
        )
    short = jshell.oscillator
    fall = short.softening(d_hat, p0_hat, constants)
    load = float(fall.load)
    buckles = np.isfinite(load)
    if buckles and highest is not None and not highest > p0_hat:
        raise BadValue("--highest", found=f"{highest:g}", expected=f"above P̂0 = {p0_hat:g}", remedy="Raise it.")
    simulated = short.simulated_modes().of(d_hat, p0_hat)
    if plot is not None and buckles:
        room, drawing = (importlib.import_module(f"jshell.plot{part}") for part in ("", ".response"))
        if whole_map:
            d, P0 = np.geomspace(0.005, 0.1, COLUMNS), np.geomspace(0.3, 10.0, ROWS)
            axes = drawing.softening_map(d, P0, np.asarray(short.softening(d[None], P0[:, None], constants).slow))
        else:
            top = 1.4 * load if highest is None else highest
            curve = short.crossing(d_hat, p0_hat, constants, np.linspace(p0_hat, top, points))
            axes = drawing.softening_curve(curve, simulated=simulated)
        room.save(axes.figure, plot)
    numbers = {"load": load, "slow": fall.slow, "fast": fall.fast, "marmottant": fall.marmottant}
    stored = [
        {"Pext_hat": P, "V_over_V0": V, "omega": w, "share": s}
        for P, V, w, s in zip(
            simulated.outer_pressure, simulated.volume_ratio, simulated.omega, simulated.share, strict=True
        )
    ]
    if as_json:
        print_json({**numbers, "simulated": stored, "d_hat": d_hat, "P0_hat": p0_hat,
                    "plot": None if plot is None or not buckles else str(plot)})  # fmt: skip
    else:
        words = ("buckling load P̂ext", "sphere before / ω− after", "sphere before / ω+ after", "sphere / Marmottant")
        typer.echo(table(list(zip(words, map(float, numbers.values()), strict=True)), ("softening", "value")))
        if stored:
            typer.echo("")
            rows = [(row["Pext_hat"], row["V_over_V0"], *row["omega"]) for row in stored]
            typer.echo(table(rows, ("simulated at P̂ext", "V/V0", "ω1", "ω2", "ω3", "ω4")))
    finish(Outcome.OK if buckles else Outcome.NO_BUCKLED_STATE)

"""`jshell fit`: constants of the short model from traces, or from a table of frequencies."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from jshell import calibration, io
from jshell.cli.output import Json, finish, log, say, speaking, writable
from jshell.errors import BadName, BadValue

TABLE_NEEDS = ("d_hat", "P0_hat", "Pext_hat", "omega_minus", "omega_plus")
TABLE_MAY = ("V_e", "P_e", "sigma_minus", "sigma_plus", "kappa", "nu")
SPELLING = {"kvs": "k_vs", "k_vs": "k_vs"}
SHOWN = {"k_vs": "kVS"}


@speaking
def fit(
    files: Annotated[list[Path] | None, typer.Argument(help="Traces (CSV) that share their constants.")] = None,
    table: Annotated[Path | None, typer.Option(help="Table of frequencies (CSV) instead of traces.")] = None,
    weighting: Annotated[str, typer.Option(help='Of a table: "V_e omega" or "V_e^2 omega^2".')] = "V_e omega",
    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for files without them.")] = None,
    loss: Annotated[str | None, typer.Option(help="strict (V and S), or modal (any channel).")] = None,
    channel: Annotated[list[str] | None, typer.Option(help="Channel to read; may be repeated.")] = None,
    solver: Annotated[str, typer.Option(help="exact or diffrax.")] = "exact",
    equilibrium: Annotated[str, typer.Option(help="plateau or trace.")] = "plateau",
    beta2: Annotated[str, typer.Option(help="equal_decay or free (strict).")] = "equal_decay",
    dipole: Annotated[str, typer.Option(help="corrected or printed dissipation of the dipole.")] = "corrected",
    fix: Annotated[list[str] | None, typer.Option(help="NAME=VALUE of a constant; may be repeated.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Window's start; 5 after the dip by default.")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="Window's end.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Picture of data, fit and residuals.")] = None,
    as_json: Json = False,
) -> None:
    """Fit the short model's constants."""
    if (table is None) == (not files):
        raise BadValue(
            "fit",
            found="no traces and no table, or both",
            expected="one of them",
            remedy="jshell fit T.csv, or --table T.csv",
        )
    fixed = fixed_values(fix or [])
    if plot is not None:
        writable(plot, "--plot")
    if table is not None:
        rows = io.read_table(table, required=TABLE_NEEDS, optional=TABLE_MAY)
        found = calibration.fit_frequencies(rows, weighting, fix=fixed)
        traces = []
    else:
        traces = [io.read_trace(file, meta=meta) for file in files or []]
        if loss is None and not channel and all({"V", "S"} <= set(trace.channels) for trace in traces):
            loss, channel = "strict", ["V", "S"]
        found = calibration.fit_trajectories(
            traces,
            loss,
            solver=solver,
            equilibrium=equilibrium,
            fix=fixed,
            channels=channel or None,
            start=start,
            stop=stop,
            beta2=beta2,
            dipole=dipole,
        )
    if plot is not None:
        from jshell import plot as pictures

        axes = pictures.trace_fit(found, traces) if traces else pictures.master_curve(rows, found)
        pictures.save(np.ravel(np.asarray(axes))[0].figure, plot)
        log(f"wrote {plot}")
    if as_json:
        say(fit_record(found))
    else:
        typer.echo(found.report())
    finish(found.outcome, sound=not any(text.startswith("misfit") for text in found.warnings))


def fit_record(found: calibration.FitResult) -> dict:
    """A fit as JSON: the constants and their errors on top, the whole record below."""
    constants = [e for e in found.estimates if e.name in ("alpha1", "alpha2", "k_vs", "beta1", "beta2")]
    name = lambda e: SHOWN.get(e.name, e.name)  # noqa: E731
    return {
        "params": {name(e): e.value for e in constants},
        "stderr": {name(e): e.stderr for e in constants},
        "warnings": list(found.warnings),
        "outcome": found.outcome,
        "record": found.record(),
    }


def fixed_values(texts: list[str]) -> dict[str, float]:
    """Constants given as NAME=VALUE.

    Raises:
        BadName, BadValue: An unknown constant, or not a number.
    """
    known = ("alpha1", "alpha2", "kVS", "beta1", "beta2")
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        key = SPELLING.get(name.strip().lower(), name.strip())
        if key not in ("alpha1", "alpha2", "k_vs", "beta1", "beta2"):
            raise BadName(
                "--fix", found=repr(text), expected="one of " + ", ".join(known), remedy="Write --fix alpha2=1.1"
            )
        try:
            found[key] = float(value)
        except ValueError:
            raise BadValue("--fix", found=repr(text), expected="NAME=NUMBER", remedy="Write --fix alpha2=1.1") from None
    return found

"""`jshell fit` and `jshell show`: constants of the short model from traces or frequencies; a saved fit again."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.destinations import drawable, writable
from jshell.cli.output import Json, finish, log, say, speaking
from jshell.errors import BadName, BadValue

TABLE_NEEDS = ("d_hat", "P0_hat", "Pext_hat", "omega_minus", "omega_plus")
TABLE_MAY = ("V_e", "P_e", "sigma_minus", "sigma_plus", "kappa", "nu")
SPELLING = {"kvs": "k_vs", "k_vs": "k_vs"}
SHOWN = {"k_vs": "kVS"}


@speaking
def fit(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Traces (.csv, .tsv, .json, .nc, .mat, .npz) that share their constants."),
    ] = None,
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
    bounds: Annotated[list[str] | None, typer.Option(help="NAME=LOW:HIGH; either end may be empty.")] = None,
    tie: Annotated[list[str] | None, typer.Option(help='NAME=ARITHMETIC of others, e.g. "alpha2=0.3*alpha1".')] = None,
    local: Annotated[list[str] | None, typer.Option(help="Constant that each trace has of its own.")] = None,
    uncertain: Annotated[
        list[str] | None,
        typer.Option(help="CONDITION=RELATIVE ERROR, or CONDITION alone to fit it: gas_pressure=0.02."),
    ] = None,
    robust: Annotated[str | None, typer.Option(help="huber or cauchy instead of least squares.")] = None,
    noise: Annotated[str, typer.Option(help="auto lets noise remember where it does; white does not.")] = "auto",
    window: Annotated[str | None, typer.Option(help="FROM:TO, both windows' ends in one.")] = None,
    drop: Annotated[list[str] | None, typer.Option(help="FROM:TO of samples to leave out.")] = None,
    profile: Annotated[bool, typer.Option(help="Asymmetric 95% intervals by profile likelihood.")] = False,
    bootstrap: Annotated[int, typer.Option(help="Refits of resampled data; 0 for none.")] = 0,
    compare: Annotated[bool, typer.Option(help="One, two, three modes and the oscillator side by side.")] = False,
    seed: Annotated[int, typer.Option(help="Of starts and refits.")] = 0,
    save: Annotated[Path | None, typer.Option(help="Record (JSON) for `jshell show`.")] = None,
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
    limits = {named(text, "--bounds")[0]: span(named(text, "--bounds")[1], "--bounds") for text in bounds or []}
    ties = dict(named(text, "--tie") for text in tie or [])
    spans = tuple(span(text, "--drop") for text in drop or [])
    drawable(plot)
    writable(save, "--save")
    if window is not None:
        low, high = span(window, "--window")
        start, stop = (low if np.isfinite(low) else start), (high if np.isfinite(high) else stop)
    traces = []
    if table is not None:
        rows = jshell.io.read_table(table, required=TABLE_NEEDS, optional=TABLE_MAY)
        given = {"--tie": ties, "--local": local, "--uncertain": uncertain, "--robust": robust, "--drop": spans}
        given |= {"--compare": compare, "--window": window}
        for option, value in given.items():
            if value:
                raise BadValue(option, found="a table", expected="traces", remedy="Leave it out with --table.")
        found = jshell.calibration.fit_frequencies(rows, weighting, fix=fixed, bounds=limits, seed=seed)
    else:
        traces = [jshell.io.read_trace(file, meta=meta) for file in files or []]
        if loss is None and not channel and all({"V", "S"} <= set(trace.channels) for trace in traces):
            loss, channel = "strict", ["V", "S"]
        found = jshell.calibration.fit_trajectories(
            traces,
            loss,
            solver=solver,
            equilibrium=equilibrium,
            fix=fixed,
            bounds=limits,
            tie=ties,
            local=tuple(spelled(name) for name in local or []),
            uncertain=dict(relative(text) for text in uncertain or []),
            robust=robust,
            noise=noise,
            channels=channel or None,
            start=start,
            stop=stop,
            drop=spans,
            beta2=beta2,
            dipole=dipole,
            seed=seed,
        )
    if save is not None:
        log(f"wrote {found.save(save)}")
    more: dict[str, Any] = {}
    if profile:
        more["profile"] = found.profile()
    if bootstrap:
        more["bootstrap"] = found.bootstrap(bootstrap, seed=seed)
    if compare:
        channels = None if found.specification is None else found.specification.channels
        more["models"] = [
            jshell.calibration.compare(trace, channels=channels, equilibrium=equilibrium, start=start, stop=stop)
            for trace in traces
        ]
    tell(found, more, plot, as_json)


@speaking
def show(
    record: Annotated[Path, typer.Argument(help="Record (JSON) that `jshell fit --save` wrote.")],
    plot: Annotated[Path | None, typer.Option(help="Picture of data, fit and residuals.")] = None,
    netcdf: Annotated[Path | None, typer.Option(help="The same as NetCDF groups.")] = None,
    as_json: Json = False,
) -> None:
    """Show a saved fit: its report and its picture, without fitting again."""
    drawable(plot)
    writable(netcdf, "--netcdf")
    found = jshell.calibration.load(record)
    if netcdf is not None:
        log(f"wrote {found.to_netcdf(netcdf)}")
    tell(found, {}, plot, as_json)


def tell(found: "jshell.FitResult", more: dict[str, Any], plot: Path | None, as_json: bool) -> None:
    """Draw, print and end as a fit ends."""
    if plot is not None:
        pictures = jshell.plot
        axes = pictures.trace_fit(found) if found.traces else pictures.master_curve(found.table, found)
        pictures.save(np.ravel(np.asarray(axes))[0].figure, plot)
        log(f"wrote {plot}")
    if as_json:
        rows = {
            name: [one.record() for one in each] if isinstance(each, list) else each.record()
            for name, each in more.items()
        }
        say(fit_record(found) | rows)
    else:
        typer.echo(found.report())
        for each in more.values():
            for one in each if isinstance(each, list) else [each]:
                typer.echo(one.report())
    finish(found.outcome, sound=not any(text.startswith("misfit") for text in found.warnings))


def fit_record(found: "jshell.FitResult") -> dict:
    """A fit as JSON: the constants and their errors on top, the whole record below."""
    from jshell.calibration.joint import CONDITIONS  # help need not wait for it

    plain = ("alpha1", "alpha2", "k_vs", "beta1", "beta2", *CONDITIONS)
    constants = [e for e in found.estimates if e.name.split("[")[0] in plain]
    name = lambda e: e.name.replace("k_vs", SHOWN["k_vs"])  # noqa: E731
    return {
        "params": {name(e): e.value for e in constants},
        "stderr": {name(e): e.stderr for e in constants},
        "warnings": list(found.warnings),
        "outcome": found.outcome,
        "record": found.record(),
    }


def named(text: str, option: str) -> tuple[str, str]:
    """NAME=SOMETHING.

    Raises:
        BadValue: No name, or nothing.
    """
    name, _, value = text.partition("=")
    if not name.strip() or not value.strip():
        raise BadValue(option, found=repr(text), expected="NAME=…", remedy="See jshell fit --help.")
    return spelled(name), value.strip()


def spelled(name: str) -> str:
    """A constant's name as Python has it."""
    base, bracket, number = name.strip().partition("[")
    return SPELLING.get(base.lower(), base) + bracket + number


def span(text: str, option: str) -> tuple[float, float]:
    """LOW:HIGH, either of which may be empty.

    Raises:
        BadValue: Not two numbers.
    """
    low, colon, high = text.partition(":")
    try:
        found = (float(low) if low.strip() else -np.inf, float(high) if high.strip() else np.inf)
    except ValueError:
        found = None
    if found is None or not colon:
        raise BadValue(option, found=repr(text), expected="LOW:HIGH", remedy=f"Write {option} …2.5:3.1") from None
    return found


def relative(text: str) -> tuple[str, float | None]:
    """CONDITION=ERROR, or CONDITION alone.

    Raises:
        BadValue: An error that is not a number.
    """
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value) if equals else None
    except ValueError:
        raise BadValue(
            "--uncertain", found=repr(text), expected="CONDITION=NUMBER", remedy="Write --uncertain gas_pressure=0.02"
        ) from None


def fixed_values(texts: list[str]) -> dict[str, float]:
    """Constants given as NAME=VALUE.

    Raises:
        BadName, BadValue: An unknown constant, or not a number.
    """
    known = ("alpha1", "alpha2", "kVS", "beta1", "beta2")
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        key = spelled(name)
        if key.split("[")[0] not in ("alpha1", "alpha2", "k_vs", "beta1", "beta2"):
            raise BadName(
                "--fix", found=repr(text), expected="one of " + ", ".join(known), remedy="Write --fix alpha2=1.1"
            )
        try:
            found[key] = float(value)
        except ValueError:
            raise BadValue("--fix", found=repr(text), expected="NAME=NUMBER", remedy="Write --fix alpha2=1.1") from None
    return found

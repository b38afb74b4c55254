"""`jshell fit` and `jshell show`: constants of the short model from traces or frequencies; a saved fit again."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.calibration.options import default_of, words_of
from jshell.cli.destinations import drawable, writable
from jshell.cli.options import flag, takes_fit_options
from jshell.cli.output import Json, finish, log, print_json, speaking
from jshell.cli.reading import takes_reading
from jshell.errors import BadValue

TABLE_NEEDS = ("d_hat", "P0_hat", "Pext_hat", "omega_minus", "omega_plus")
TABLE_MAY = ("V_e", "P_e", "sigma_minus", "sigma_plus", "kappa", "nu")
SHOWN = {"k_vs": "kVS"}


@speaking
@takes_reading
@takes_fit_options
def fit(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Traces (text, .xlsx, .json, .nc, .mat, .npz, .tdms) that share their constants."),
    ] = None,
    reading: Any = None,
    table: Annotated[Path | None, typer.Option(help="Table of frequencies (CSV) instead of traces.")] = None,
    weighting: Annotated[str, typer.Option(help=f"W{words_of('weighting')[1:]}.")] = "V_e omega",
    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for files without them.")] = None,
    options: Any = None,
    profile: Annotated[bool, typer.Option(help="Asymmetric 95% intervals by profile likelihood.")] = False,
    bootstrap: Annotated[int, typer.Option(help="Refits of resampled data; 0 for none.")] = 0,
    compare: Annotated[bool, typer.Option(help="One, two, three modes and the oscillator side by side.")] = False,
    save: Annotated[Path | None, typer.Option(help="Record (JSON) for `jshell show`.")] = None,
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
    drawable(plot)
    writable(save, "--save")
    traces = []
    if table is not None:
        found = _of_table(table, weighting, options, compare, reading)
    else:
        traces = [jshell.io.read_trace(file, meta=meta, **reading) for file in files or []]
        found = jshell.calibration.fit_trajectories(traces, options=options)
        for number, (whole, read) in enumerate(zip(traces, found.traces, strict=True), 1):
            first, last = (float(np.asarray(read.times)[k]) for k in (0, -1))
            share = f"{len(read.times)} of {len(whole.times)} samples"
            log(f"trace {number}: read from t = {first:.5g} to {last:.5g}, {share}")
    if save is not None:
        log(f"wrote {found.save(save)}")
    more: dict[str, Any] = {}
    if profile:
        more["profile"] = found.profile()
    if bootstrap:
        more["bootstrap"] = found.bootstrap(bootstrap, seed=options.seed)
    if compare:
        channels = None if found.specification is None else found.specification.channels
        chosen = {"equilibrium": options.equilibrium, "start": options.start, "stop": options.stop}
        more["models"] = [jshell.calibration.compare(trace, channels=channels, **chosen) for trace in traces]
    report(found, more, plot, as_json)


def _of_table(path: Path, weighting: str, options: Any, compare: bool, reading: Any) -> "jshell.FitResult":
    """A fit of frequencies, which has but a few of the options."""
    rows = jshell.io.read_table(path, required=TABLE_NEEDS, optional=TABLE_MAY, **reading)
    given = options.differing()
    for name in ("fix", "bounds", "starts", "seed"):
        given.pop(name, None)
    for option in [flag(name) for name in given] + ["--compare"] * compare:
        raise BadValue(option, found="a table", expected="traces", remedy="Leave it out with --table.")
    usual = {} if options.starts == default_of("starts") else {"starts": options.starts}
    return jshell.calibration.fit_frequencies(
        rows, weighting, fix=options.fix, bounds=options.bounds, seed=options.seed, **usual
    )


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
    report(found, {}, plot, as_json)


def report(found: "jshell.FitResult", more: dict[str, Any], plot: Path | None, as_json: bool) -> None:
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
        print_json(fit_record(found) | rows)
    else:
        typer.echo(found.report())
        for each in more.values():
            for one in each if isinstance(each, list) else [each]:
                typer.echo(one.report())
    finish(found.outcome, sound=not any(text.startswith("misfit") for text in found.warnings))


def fit_record(found: "jshell.FitResult") -> dict:
    """A fit as JSON: the constants and their errors on top, the whole record below."""
    from jshell.calibration.options import CONDITIONS

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

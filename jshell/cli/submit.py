"""`jshell submit`: a fit handed to a running service."""

import importlib
import warnings
from pathlib import Path
from typing import Annotated

import typer

from jshell.cli.destinations import writable
from jshell.cli.fits import fixed_values, named, relative, span, spelled, tell
from jshell.cli.output import Json, log, say, speaking

LOCAL = "http://127.0.0.1:8765"


@speaking
def submit(
    files: Annotated[
        list[Path], typer.Argument(help="Traces (.csv, .tsv, .json, .nc, .mat, .npz) that share their constants.")
    ],
    url: Annotated[str, typer.Option(help="Where `jshell serve` runs.")] = LOCAL,
    loss: Annotated[str | None, typer.Option(help="strict (V and S), or modal (any channel).")] = None,
    channel: Annotated[list[str] | None, typer.Option(help="Channel to read; may be repeated.")] = None,
    equilibrium: Annotated[str, typer.Option(help="plateau or trace.")] = "plateau",
    fix: Annotated[list[str] | None, typer.Option(help="NAME=VALUE of a constant; may be repeated.")] = None,
    bounds: Annotated[list[str] | None, typer.Option(help="NAME=LOW:HIGH; either end may be empty.")] = None,
    tie: Annotated[list[str] | None, typer.Option(help='NAME=ARITHMETIC of others, e.g. "alpha2=0.3*alpha1".')] = None,
    local: Annotated[list[str] | None, typer.Option(help="Constant that each trace has of its own.")] = None,
    uncertain: Annotated[list[str] | None, typer.Option(help="CONDITION=RELATIVE ERROR, or CONDITION alone.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Window's start; 5 after the dip by default.")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="Window's end.")] = None,
    profile: Annotated[bool, typer.Option(help="Asymmetric 95% intervals by profile likelihood.")] = False,
    seed: Annotated[int, typer.Option(help="Of starts.")] = 0,
    key: Annotated[str | None, typer.Option(help="Your own name of this request; sent again, the same job.")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the result, or print the job's id.")] = True,
    seconds: Annotated[float, typer.Option(help="Longest time to wait.")] = 600.0,
    save: Annotated[Path | None, typer.Option(help="Record (JSON) for `jshell show`.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Picture of data, fit and residuals.")] = None,
    as_json: Json = False,
) -> None:
    """Fit traces on a service; the report is that of `jshell fit`. A token is read from JSHELL_TOKEN."""
    for path, option in ((plot, "--plot"), (save, "--save")):
        if path is not None:
            writable(path, option)
    client = importlib.import_module("jshell.service.client").Client(url)
    options = {
        "loss": loss,
        "channels": channel or None,
        "equilibrium": equilibrium,
        "fix": fixed_values(fix or []),
        "bounds": {named(text, "--bounds")[0]: span(named(text, "--bounds")[1], "--bounds") for text in bounds or []},
        "tie": dict(named(text, "--tie") for text in tie or []),
        "local": [spelled(name) for name in local or []],
        "uncertain": dict(relative(text) for text in uncertain or []),
        "start": start,
        "stop": stop,
        "seed": seed,
        "profile": profile,
    }
    with client, warnings.catch_warnings():
        job = client.submit(list(files), key=key, **options)
        if not wait:
            say({"id": job.id, "state": job.state, "url": f"{client.url}/fits/{job.id}"})
            return
        log(f"{client.url}/fits/{job.id}")
        found = job.result(seconds)
        intervals = client.profile(job) if profile else None
    if save is not None:
        log(f"wrote {found.save(save)}")
    tell(found, {} if intervals is None else {"profile": _Told(intervals)}, plot, as_json)


class _Told:
    """Profile intervals as the service tells them."""

    def __init__(self, record: dict) -> None:
        self._record = record

    def record(self) -> dict:
        """As JSON."""
        return self._record

    def report(self) -> str:
        """As text."""
        shown = lambda x: "open" if x is None else f"{x:.6g}"  # noqa: E731
        rows = [
            f"    {name}: {one['value']:.6g} in {shown(one['low'])} … {shown(one['high'])}"
            + (f" ({one['reason']})" if one["reason"] else "")
            for name, one in self._record["intervals"].items()
        ]
        return "\n".join(
            [f"[[Profile likelihood, {100 * self._record['level']:g}%]] {self._record['criterion']}", *rows]
        )

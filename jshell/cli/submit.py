"""`jshell submit`: a fit handed to a running service."""

import importlib
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from jshell.cli.destinations import writable
from jshell.cli.fits import report
from jshell.cli.options import takes_fit_options
from jshell.cli.output import Json, log, print_json, speaking
from jshell.cli.reading import takes_reading

LOCAL = "http://127.0.0.1:8765"


@speaking
@takes_reading
@takes_fit_options
def submit(
    files: Annotated[
        list[Path], typer.Argument(help="Traces (text, .xlsx, .json, .nc, .mat, .npz, .tdms) that share constants.")
    ],
    reading: Any = None,
    url: Annotated[str, typer.Option(help="Where `jshell serve` runs.")] = LOCAL,
    options: Any = None,
    profile: Annotated[bool, typer.Option(help="Asymmetric 95% intervals by profile likelihood.")] = False,
    key: Annotated[str | None, typer.Option(help="Your own name of this request; sent again, the same job.")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the result, or print the job's id.")] = True,
    seconds: Annotated[float, typer.Option(help="Longest time to wait.")] = 600.0,
    save: Annotated[Path | None, typer.Option(help="Record (JSON) for `jshell show`.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Picture of data, fit and residuals.")] = None,
    as_json: Json = False,
) -> None:
    """Fit traces on a service; the report is that of `jshell fit`. A token is read from JSHELL_TOKEN."""
    from jshell.calibration.profile import Profile  # help need not wait for it

    for path, option in ((plot, "--plot"), (save, "--save")):
        if path is not None:
            writable(path, option)
    client = importlib.import_module("jshell.service.client").Client(url)
    with client, warnings.catch_warnings():
        sent = [client.upload(file, **reading) for file in files] if reading else list(files)
        job = client.submit(sent, key=key, profile=profile, **options.differing())
        if not wait:
            print_json({"id": job.id, "state": job.state, "url": f"{client.url}/fits/{job.id}"})
            return
        log(f"{client.url}/fits/{job.id}")
        found = job.result(seconds)
        intervals = client.profile(job) if profile else None
    if save is not None:
        log(f"wrote {found.save(save)}")
    report(found, {} if intervals is None else {"profile": Profile.from_record(intervals)}, plot, as_json)

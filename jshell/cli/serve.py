"""`jshell serve`: fits as a service, for this machine or a group."""

import importlib
import os
import sys
from dataclasses import dataclass
from typing import Annotated

import typer

from jshell.cli.output import log, speaking
from jshell.cli.problem import with_options

TOKEN = "JSHELL_TOKEN"


@dataclass(frozen=True)
class AddressOptions:
    """Where the service is reached."""

    host: Annotated[str, typer.Option(help="Address to listen at; any but this machine's own needs a token.")] = (
        "127.0.0.1"
    )
    port: Annotated[int, typer.Option(help="Port; 0 picks one.")] = 8765
    allow_host: Annotated[
        list[str] | None, typer.Option("--allow-host", help="Name by which browsers call it; may be repeated.")
    ] = None
    root_path: Annotated[str, typer.Option(help="Where a proxy in front shows it, e.g. /fits.")] = ""
    proxy: Annotated[
        str | None, typer.Option(help="Address or network of that proxy, believed on who asks and whether by TLS.")
    ] = None


@dataclass(frozen=True)
class WorkOptions:
    """What works, and how much it may take."""

    engine: Annotated[str, typer.Option(help="processes, inline, or tcp://HOST:PORT of a Dask scheduler.")] = (
        "processes"
    )
    workers: Annotated[int, typer.Option(help="Jobs that run at the same time.")] = 1
    queue: Annotated[int, typer.Option(help="Jobs that may wait; more are told to come back.")] = 1000
    seconds: Annotated[float, typer.Option(help="Longest time of one job.")] = 600.0
    memory: Annotated[float, typer.Option(help="Largest memory of one job [GiB].")] = 4.0
    nice: Annotated[int, typer.Option(help="How far jobs stand back behind the server, 0 to 19.")] = 10
    upload: Annotated[float, typer.Option(help="Largest upload [MiB].")] = 256.0


@speaking
@with_options(AddressOptions, "address")
@with_options(WorkOptions, "work")
def serve(
    address: AddressOptions,
    work: WorkOptions,
    db: Annotated[
        str, typer.Option(help="sqlite:///FILE, or postgresql+psycopg://USER@HOST/NAME.")
    ] = "sqlite:///jshell.db",
    cache: Annotated[str | None, typer.Option(help="Folder of compiled programs, kept between runs.")] = None,
    warm: Annotated[bool, typer.Option("--warm/--cold", help="Compile the usual fit before the first job.")] = True,
) -> None:
    """Serve fits over HTTP: a page for people, an API for programs.

    For other machines set the environment's JSHELL_TOKEN to a long random text, and name the host: --allow-host.
    """
    settings = importlib.import_module("jshell.service.settings")
    server = importlib.import_module("jshell.service.server")
    token = os.environ.get(TOKEN) or None
    own = () if address.host in ("0.0.0.0", "::") else (address.host,)
    names = tuple(dict.fromkeys((*settings.LOCAL, *own, *(address.allow_host or ()))))
    chosen = settings.Settings(
        db=db, engine=work.engine, workers=work.workers, queue=work.queue, seconds=work.seconds,
        memory=int(work.memory * 2**30), nice=work.nice, upload=int(work.upload * 2**20), cache=cache, warm=warm,
        host=address.host, port=address.port, token=token, allowed_hosts=names, root_path=address.root_path,
        proxy=address.proxy,
    )  # fmt: skip
    server.serve(chosen, lambda url: log(f"jshell serves at {url} (Ctrl+C stops it)"))
    sys.stdout.flush()
    os._exit(0)  # told to stop, and stopped; a thread that still compiles would abort a process that says goodbye

"""`jshell backup` and `jshell restore`: the jobs of a service, copied while it runs."""

import importlib
from pathlib import Path
from typing import Annotated

import typer

from jshell.cli.output import Json, log, print_json, speaking

DB = "sqlite:///jshell.db"


@speaking
def backup(
    copy: Annotated[Path, typer.Argument(help="File of the copy; it must not be there yet.")],
    db: Annotated[str, typer.Option(help="sqlite:///FILE, as the service has it.")] = DB,
    as_json: Json = False,
) -> None:
    """Copy a service's jobs while it runs, all as of one moment, and look at the copy. (PostgreSQL: pg_dump.)"""
    _report(importlib.import_module("jshell.service.copies").backup(db, copy), f"wrote {copy}", as_json)


@speaking
def restore(
    copy: Annotated[Path, typer.Argument(help="A file that `jshell backup` wrote.")],
    db: Annotated[str, typer.Option(help="sqlite:///FILE, which must not be there yet.")] = DB,
    check: Annotated[bool, typer.Option("--check", help="Look at the copy only.")] = False,
    as_json: Json = False,
) -> None:
    """Look at a copy, every page and every upload, and put it where a service can start from it."""
    copies = importlib.import_module("jshell.service.copies")
    _report(copies.check(copy) if check else copies.restore(copy, db), "sound" if check else f"wrote {db}", as_json)


def _report(found: dict[str, int], words: str, as_json: bool) -> None:
    if as_json:
        print_json(found)
    else:
        log(f"{words}: " + ", ".join(f"{count} {name}" for name, count in found.items()))

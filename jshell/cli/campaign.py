"""`jshell campaign`: many simulations from one design; run, resumed, listed, exported, checked."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import jshell
from jshell.cli.destinations import writable
from jshell.cli.output import NOT_OK, Json, Verbs, log, print_json, speaking, table
from jshell.errors import BadFile

app = typer.Typer(
    cls=Verbs, help="Many simulations: designed, run, catalogued.", no_args_is_help=True, add_completion=False
)
Folder = Annotated[Path | None, typer.Argument(help="A campaign's folder; the one that comes with jshell if none.")]
Engine = Annotated[str, typer.Option(help="Where runs are done: inline, processes, processes:N, tcp://host:port.")]
OUT = Path("out/campaign")
SHOWN = 12  # moves listed one by one
TABLES = (".csv", ".nc")


@app.command("run")
@speaking
def run(
    design: Annotated[Path | None, typer.Argument(help="Design, a TOML file; the shipped one if none.")] = None,
    engine: Engine = "inline",
    out: Annotated[Path, typer.Option(help="Folder; a campaign begun there goes on.")] = OUT,
    as_json: Json = False,
) -> None:
    """Do the runs of a design that are not finished yet; may be killed and repeated at any time."""
    source = jshell.campaigns.shipped() / "design.toml" if design is None else design
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, *times, console=Console(stderr=True)) as bar:
        task = bar.add_task("campaign")

        def show(now: "jshell.campaigns.Progress") -> None:
            bar.update(task, completed=now.done, total=now.total)
            # a log has no bar: a line for each run there, for the bad ones alone beside a bar
            if now.last is not None and (now.outcome != "ok" or not bar.console.is_terminal):
                bar.console.print(f"{now.done}/{now.total} {now.outcome}: {named(now.last)}", highlight=False)

        found = jshell.campaigns.run(source, out, engine=engine, progress=show)
    report(found, out, as_json)
    if found.missing:
        raise typer.Exit(NOT_OK)


@app.command("status")
@speaking
def status(folder: Folder = None, as_json: Json = False) -> None:
    """What has run, how it ended, and what is missing."""
    where = jshell.campaigns.shipped() if folder is None else folder
    report(jshell.campaigns.catalog(where), where, as_json)


@app.command("export")
@speaking
def export(
    target: Annotated[Path, typer.Argument(help="File to write: .csv, or .nc with the records.")],
    folder: Folder = None,
    family: Annotated[str | None, typer.Option(help="Only the runs of this family.")] = None,
    as_json: Json = False,
) -> None:
    """Write the catalogue as a table (.csv), or with the records of all runs (.nc)."""
    writable(target, "TARGET")
    if target.suffix not in TABLES:
        raise BadFile(str(target), found=f"ending {target.suffix!r}", expected=".csv or .nc", remedy="Rename it.")
    found = jshell.campaigns.catalog(folder).where(family=family)
    if target.suffix == ".csv":
        target.write_text(found.to_csv(), encoding="utf-8")
    else:
        found.to_xarray(records=True).to_netcdf(target, engine="h5netcdf")
    if as_json:
        print_json({"file": str(target), "runs": len(found)})
    else:
        typer.echo(f"{len(found)} runs: {target}")


@app.command("check")
@speaking
def check(
    folder: Annotated[Path, typer.Argument(help="A campaign run again, e.g. out/campaign.")] = OUT,
    against: Annotated[
        Path | None, typer.Option(help="The campaign to compare it with; the shipped one if none.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Say whether a campaign run again is the same to the last bit, and if not, what moved and how far."""
    found = jshell.campaigns.compare(jshell.campaigns.catalog(against), jshell.campaigns.catalog(folder))
    worst = found.worst()
    if as_json:
        moved = [vars(move) for move in worst]
        print_json({"identical": found.identical, "same": found.same, "moved": moved, "versions": found.versions,
                    "only_before": found.only_before, "only_after": found.only_after})  # fmt: skip
    else:
        typer.echo(f"{found.same} runs are the same to the last bit.")
        for title, keys in (("only in the first", found.only_before), ("only in the second", found.only_after)):
            if keys:
                typer.echo(f"{len(keys)} {title}: {' '.join(keys[:SHOWN])}{' …' if len(keys) > SHOWN else ''}")
        for change in found.versions:
            typer.echo(f"made with another version: {change}")
        if worst:
            keys = {move.key for move in found.moved}
            typer.echo(f"{len(keys)} runs moved; the largest move of each column:")
            rows = [(m.column, m.family, m.key, m.before, m.after, m.relative) for m in worst[:SHOWN]]
            typer.echo(table(rows, ("column", "family", "run", "before", "after", "relative")))
    if not found.identical:
        raise typer.Exit(NOT_OK)


def report(found: "jshell.campaigns.Catalog", where: Path, as_json: bool) -> None:
    """Print what a catalogue holds."""
    families = list(dict.fromkeys(name for names in found.families for name in names))
    rows = []
    for family in families:
        part = found.where(family=family)
        kinds = " ".join(dict.fromkeys(result.run.kind for result in part))
        ended = ", ".join(f"{count} {word}" for word, count in part.outcomes().items())
        rows.append((family, kinds, str(len(part)), ended))
    bad = jshell.campaigns.failures(found)
    if as_json:
        print_json({
            "folder": str(where), "name": found.name, "finished": len(found), "missing": len(found.missing),
            "outcomes": found.outcomes(), "strangers": found.orphan_files,
            "families": [dict(zip(("family", "kind", "runs", "outcomes"), row, strict=True)) for row in rows],
            "failed": [{"run": r.run.key, "outcome": r.findings.outcome, "reason": r.findings.reason} for r in bad],
            "versions": sorted({f"{k} {v}" for r in found for k, v in vars(r.versions).items()}),
        })  # fmt: skip
        return
    typer.echo(f"{found.name}: {len(found)} runs finished, {len(found.missing)} missing, in {where}")
    if rows:
        typer.echo(table(rows, ("family", "kind", "runs", "outcomes")))
    for result in bad:
        typer.echo(f"{result.findings.outcome}: {named(result.run)}: {result.findings.reason}")
    lost = sum(word.startswith("not round") for word in found["symmetry"]) if len(found) else 0
    if lost:
        log(f"{lost} dimples are not round (column symmetry); modes and records assume that they are.")
    if found.orphan_files:
        log(f"{found.orphan_files} files there belong to no run of this design.")


def named(run: "jshell.campaigns.Run") -> str:
    """A run in a line."""
    held = f", pad {run.attached:g}" if run.attached else ""
    kept = f", offset {run.offset:g}" if run.offset else ""
    pressures = f"P̂0 {run.P0_hat:g}, P̂ext {run.Pext_hat:g}"
    return f"{run.kind} {run.key}, d̂ {run.d_hat:g}, {pressures}, η̂ {run.eta_hat:g}{held}{kept}"

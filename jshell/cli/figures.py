"""`jshell figures`: the figures of the source, drawn from a campaign."""

import importlib
import time
from pathlib import Path
from typing import Annotated

import typer

import jshell
from jshell.cli.output import Json, log, print_json, speaking, table
from jshell.errors import BadFile, choose

FORMATS = ("png", "pdf", "svg")


@speaking
def figures(
    names: Annotated[list[str] | None, typer.Argument(help="Names, or the source's labels; see the list.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="All of them.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("out/figures"),
    kind: Annotated[str, typer.Option("--format", help="png, pdf or svg.")] = "png",
    campaign: Annotated[
        Path | None, typer.Option(help="Folder of a campaign; by default the one that comes with jshell.")
    ] = None,
    elements: Annotated[int, typer.Option(help="Spline elements of what is computed for a figure.")] = 24,
    as_json: Json = False,
) -> None:
    """Draw the source's figures from our own simulations, its published numbers marked; without a name, list them."""
    paper = importlib.import_module("jshell.paper.figures")
    room = importlib.import_module("jshell.plot")
    choose("--format", kind, FORMATS)
    asked = paper.FIGURES if everything else tuple(dict.fromkeys(paper.figure(name) for name in names or ()))
    if not asked:
        rows = [(one.name, one.label, one.words) for one in paper.FIGURES]
        if as_json:
            print_json({"figures": [{"name": name, "label": label, "words": words} for name, label, words in rows]})
        else:
            typer.echo(table(rows, ("name", "source", "what it shows")))
            typer.echo("\njshell figures NAME …, or --all")
        return
    if out.exists() and not out.is_dir():
        raise BadFile("--out", found=f"the file {out}", expected="a folder", remedy="Choose another name.")
    out.mkdir(parents=True, exist_ok=True)
    material = paper.Material(lambda: jshell.campaigns.catalog(campaign), elements=elements)
    began, drawn = time.perf_counter(), []
    for one in asked:
        start = time.perf_counter()
        path = room.save(one.draw(material), out / f"{one.name}.{kind}")
        log(f"  {path}  ({one.label}, {time.perf_counter() - start:.1f} s)")
        drawn.append({"name": one.name, "label": one.label, "path": str(path)})
    seconds = time.perf_counter() - began
    if as_json:
        print_json({"figures": drawn, "seconds": seconds})
    else:
        typer.echo(f"{len(drawn)} figures in {out}, {seconds:.0f} s")

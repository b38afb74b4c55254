"""What a file leaves open, as options of the verbs that read one; and `jshell read`, which shows what is understood."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.destinations import Picture, drawable
from jshell.cli.output import Json, log, print_json, speaking, table
from jshell.errors import JshellError

_PANEL = "What a file leaves open"
_SHOWN = 24  # columns and lines that are shown
GAP = 1.5  # steps between two rows that make a gap


_OPTIONS: dict[str, tuple[Any, str]] = {
    "columns": (list[str] | None, "t=Time,H=3: columns by name or place; may be repeated."),
    "units": (list[str] | None, "t=ms,H=mm: units of columns, `-` for none; may be repeated."),
    "rate": (float | None, "Samples per second; per unit of time without units."),
    "time_from": (str | None, "What --rate counts: rows, or a column of frames."),
    "rows": (str | None, "FIRST:LAST row of numbers, as a spreadsheet counts lines."),
    "missing": (str | None, "Rows with gaps: refuse, or drop."),
}


def _option(name: str, prefix: str) -> tuple[Any, Any]:
    """Type and declaration of an option."""
    kind, words = _OPTIONS[name]
    if prefix:
        words = words.replace("H=", "P_ext=").replace("P_ext=mm", "P_ext=kPa").replace("--rate", "--pressure-rate")
    shown = "--" + (prefix + name).replace("_", "-")
    panel = f"{_PANEL} (--pressure-file)" if prefix else _PANEL
    return kind, typer.Option(shown, help=words, rich_help_panel=panel)


def takes_reading(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the options of `jshell.io.Reading`; they reach it as its argument `reading`.

    Where the options of a fit have a choice of `missing` already, it is that one.
    """
    return _taking(verb, "")


def takes_reading_of_pressure(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the same options for its table of outer pressure: `--pressure-columns` and its like."""
    return _taking(verb, "pressure_")


def _taking(verb: Callable[..., None], prefix: str) -> Callable[..., None]:
    """A verb with the options, their names behind a prefix."""
    own = inspect.signature(verb)
    names = [name for name in _OPTIONS if prefix or name not in own.parameters]
    added = [
        inspect.Parameter(
            prefix + name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[_option(name, prefix)]
        )
        for name in names
    ]
    kept = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own.parameters.values()]
    at = [one.name for one in kept].index("reading")
    together = [*kept[:at], *added, *kept[at + 1 :]]

    @functools.wraps(verb)
    def wrapped(**given: Any) -> None:
        said = {name: given.pop(prefix + name) for name in names}
        if not prefix:
            said = {name: given.get(name) for name in _OPTIONS if name in own.parameters} | said
        verb(**given, reading=reading_of(said))

    wrapped.__signature__ = own.replace(parameters=together)  # pyright: ignore[reportAttributeAccessIssue]
    wrapped.__annotations__ = {one.name: one.annotation for one in together} | {"return": None}
    return wrapped


def reading_of(said: dict[str, Any]) -> dict[str, Any]:
    """What a command line says of its files, as `jshell.io.Reading.of` takes it; empty where it says nothing.

    Raises:
        BadName, BadValue: As `jshell.io.Reading.of`.
    """
    given = {name: value for name, value in said.items() if value not in (None, [], "refuse")}
    for name in ("columns", "units"):
        if name in given:
            given[name] = ",".join(given[name])
    jshell.io.Reading.of(**given)
    return given


@speaking
@takes_reading
def read(
    file: Annotated[Path, typer.Argument(help="Any file of columns: text, .xlsx, JSON, .nc, .mat, .npz, .tdms.")],
    reading: Any = None,
    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for a file without them.")] = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Show what a file holds: columns, units, steps, gaps, what was taken for what, what was passed over."""
    from jshell.io.formats import read_sheet
    from jshell.io.tables import understood

    drawable(plot)
    choices = jshell.io.Reading.of(**reading)
    sheet = read_sheet(file, choices, ("t",))
    refusal, found = None, None
    try:
        found = understood(sheet, meta, choices)
    except JshellError as error:
        refusal = error
    record = _record(file, sheet, found)
    if as_json and refusal is None:
        print_json(record)
    elif not as_json:
        typer.echo(_described(record))
    if refusal is not None:
        raise refusal
    if plot is not None and found is not None:
        _draw(found.trace, plot)
        log(f"wrote {plot}")


def _record(file: Path, sheet: Any, found: Any) -> dict[str, Any]:
    """What was understood, as a JSON object."""
    record: dict[str, Any] = {"file": str(file), "rows": int(sheet.columns[0].size) if sheet.columns else 0}
    places = sheet.places or tuple(range(1, len(sheet.names) + 1))
    record["columns"] = [
        {"place": place, "name": name, "unit": unit, **_span(values)}
        for place, name, unit, values in zip(places, sheet.names, sheet.units, sheet.columns, strict=True)
    ]
    record["lines"], record["passed"] = list(sheet.lines), list(sheet.passed)
    if found is None:
        return record
    trace = found.trace
    record["read"] = [
        {"name": name, "unit": unit} for name, unit in zip(found.sheet.names, found.sheet.units, strict=True)
    ]
    record["taken"], record["passed"] = list(found.taken), list(found.sheet.passed)
    steps = np.diff(found.sheet.columns[found.sheet.names.index("t")])
    middle = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * middle) if middle > 0 else np.zeros(0, int)
    record["steps"] = {"smallest": float(steps.min()), "median": middle, "largest": float(steps.max())}
    record["gaps"] = [found.sheet.row_of(int(k) + 1) for k in gaps[:_SHOWN]]
    record["gap_count"] = int(gaps.size)
    record["conditions"] = None if trace.conditions is None else repr(trace.conditions)
    return record


def _span(values: np.ndarray) -> dict[str, Any]:
    """Smallest and largest number of a column, and how many are missing."""
    good = values[np.isfinite(values)]
    ends = (float(good.min()), float(good.max())) if good.size else (None, None)
    return {"smallest": ends[0], "largest": ends[1], "missing": int(values.size - good.size)}


def _described(record: dict[str, Any]) -> str:
    """The same for a person."""
    own = record.get("read", [])
    rows: list[tuple] = [
        (str(one["place"]), one["name"] or "(no name)", one["unit"] or "–", one["smallest"], one["largest"])
        for one in record["columns"][:_SHOWN]
    ]
    text = [table(rows, ("place", "column", "unit", "smallest", "largest"))]
    if own:
        text.append("read as: " + ", ".join(f"{one['name']} [{one['unit'] or 'no unit'}]" for one in own))
        unit = next((one["unit"] for one in own if one["name"] == "t"), None) or "of the file's time"
        steps = record["steps"]
        shown = "{smallest:.6g} to {largest:.6g}, median {median:.6g}".format(**steps)
        text.append(f"{record['rows']} rows, steps {shown} {unit}")
        where = ", ".join(record["gaps"]) + (" …" if record["gap_count"] > len(record["gaps"]) else "")
        text.append(f"gaps: {record['gap_count']}, before {where}" if record["gap_count"] else "no gaps")
        text.append("conditions: " + (record["conditions"] or "none; enough to analyse, a fit needs them"))
    text += [f"taken: {one}" for one in record.get("taken", ()) if not one.startswith("passed over")]
    text += [f"passed over: {one}" for one in record["passed"]]
    text += [f"beside the table: {one}" for one in record["lines"]]
    return "\n".join(text)


def _draw(trace: "jshell.Trace", path: Path) -> None:
    """The channels above each other."""
    pictures = jshell.plot
    names = list(trace.channels)[:8]
    figure = pictures.new_figure((6.0, 2.2 * len(names)))
    for k, name in enumerate(names):
        ax = figure.add_subplot(len(names), 1, k + 1)
        pictures.channel(trace, name, ax, relative=False, mark_dip=False, laboratory=trace.scales is not None)
    pictures.save(figure, path)

"""One column of a sheet by what a reader calls it: its name, its name with its unit, or its place."""

from collections.abc import Sequence
from dataclasses import replace

from jshell.errors import BadName
from jshell.io.files import brief
from jshell.io.sheets import Sheet


def find(sheet: Sheet, name: str, wanted: str) -> int:
    """The column that a choice means: by its name, or by its place from 1."""
    titled = list(zip(sheet.names, sheet.units, strict=True))
    spellings = (sheet.names, [f"{one} [{unit}]" for one, unit in titled], [f"{one} ({unit})" for one, unit in titled])
    tries = [(spelling, wanted) for spelling in spellings]
    tries.append(([one.lower() for one in sheet.names], wanted.lower()))
    for spelling, sought in tries:
        hits = [k for k, one in enumerate(spelling) if one == sought]
        if len(hits) == 1:
            return hits[0]
        if len(hits) > 1:
            places = " or ".join(f"`{name}={number(sheet, k)}`" for k in hits)
            raise BadName(
                f"columns, {name}={wanted}",
                found=f"{len(hits)} columns of this name",
                expected="one",
                remedy=f"Name it by its place: {places}.",
            )
    for k in range(len(sheet.names)):
        if str(number(sheet, k)) == wanted.lstrip("0"):
            return k
    raise BadName(
        f"columns, {name}={brief(wanted)}",
        found=f"no such column of numbers in {sheet.file}",
        expected="one of " + ", ".join(f"{number(sheet, k)} `{brief(one)}`" for k, one in enumerate(sheet.names[:12])),
        remedy="Take a name or a place from this list; `jshell read FILE` shows it, too.",
    )


def number(sheet: Sheet, k: int) -> int:
    return sheet.places[k] if sheet.places else k + 1


def called(sheet: Sheet, k: int) -> str:
    return f"column `{brief(sheet.names[k])}`" if sheet.names[k] else f"column {number(sheet, k)}"


def picked(sheet: Sheet, keep: Sequence[int], names: Sequence[str]) -> Sheet:
    pick = lambda values: tuple(values[k] for k in keep) if values else ()  # noqa: E731
    return replace(
        sheet, names=tuple(names), units=pick(sheet.units), columns=pick(sheet.columns), places=pick(sheet.places)
    )

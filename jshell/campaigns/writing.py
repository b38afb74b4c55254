"""Designs as TOML files.

    name = "three gases"

    [[family]]
    name = "gas"
    kind = "snap"
    rule = "one"
    base = { d_hat = 0.22, load = 1.02, eta_hat = 0.004 }
    vary = { P0_hat = [0.6, 0.9, 1.8] }

Source     TOML 1.0
"""

import json
import tomllib
from dataclasses import fields
from pathlib import Path

from jshell.campaigns.design import Design, Family
from jshell.campaigns.planned import FIELDS
from jshell.errors import BadFile, JshellError

KNOWN = tuple(field.name for field in fields(Family))


def read_design(path: str | Path) -> Design:
    """A design from its file.

    Raises:
        BadFile: No such file, no TOML, or no design; the message says where.
        BadName, BadValue: A family that makes no sense.
    """
    path = Path(path)
    try:
        whole = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadFile(str(path), found=error.strerror or "an error", expected="a file", remedy="Check it.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadFile(str(path), found=f"no TOML ({error})", expected="a design", remedy="Correct it.") from None
    listed = whole.get("family", [])
    if not isinstance(listed, list) or not listed or set(whole) - {"name", "family"}:
        raise BadFile(
            str(path),
            found=", ".join(whole) or "nothing",
            expected="name, and [[family]] once or more",
            remedy="See the example in jshell.campaigns.writing.",
        )
    return Design(str(whole.get("name", path.stem)), tuple(_family(path, k, row) for k, row in enumerate(listed)))


def _family(path: Path, number: int, row: dict) -> Family:
    place = f"{path}, family {row.get('name', number + 1)!r}"
    unknown = [name for name in row if name not in KNOWN]
    if unknown or "name" not in row or "kind" not in row:
        found = f"the unknown key {unknown[0]!r}" if unknown else "no name or no kind"
        raise BadFile(place, found=found, expected="name, kind, and any of " + ", ".join(KNOWN), remedy="Correct it.")
    shapes = {"base": dict, "vary": dict, "log": list, "samples": int, "seed": int}
    wrong = [name for name, kind in shapes.items() if name in row and not isinstance(row[name], kind)]
    wrong += [name for name, values in dict(row.get("vary", {})).items() if not isinstance(values, list)]
    if wrong:
        raise BadFile(
            f"{place}, {wrong[0]}", found="something else", expected="a table, list or number", remedy="Correct it."
        )
    for name, values in (*row.get("base", {}).items(), *row.get("vary", {}).items()):
        for value in values if isinstance(values, list) else [values]:
            word = name in FIELDS and isinstance(FIELDS[name].default, str)
            if not isinstance(value, str if word else float | int):
                expected, remedy = ("a word", 'Write "exact".') if word else ("a number", "Write 0.22.")
                raise BadFile(f"{place}, {name}", found=repr(value), expected=expected, remedy=remedy)
    vary = {name: tuple(values) for name, values in row.get("vary", {}).items()}
    try:
        return Family(**{**row, "vary": vary, "log": tuple(row.get("log", ()))})
    except JshellError as error:
        error.args = (f"{path}: {error}",)
        raise


def write_design(path: str | Path, design: Design) -> Path:
    """Write a design as a file that `read_design` reads back to the same runs.

    Raises:
        BadFile: Nothing can be written there.
    """
    path = Path(path)
    try:
        path.write_text(design_text(design), encoding="utf-8")
    except OSError as error:
        raise BadFile(
            str(path), found=error.strerror or "an error", expected="a file in a folder that exists", remedy="Check it."
        ) from None
    return path


def design_text(design: Design) -> str:
    """A design as TOML; numbers, texts and lists of them are written in TOML as in JSON."""

    def plain(value: object) -> str:
        listed = list(value) if isinstance(value, tuple) else value
        return json.dumps(listed, ensure_ascii=False).replace("\x7f", "\\u007f")

    table = lambda rows: "{ " + ", ".join(f"{name} = {plain(value)}" for name, value in rows.items()) + " }"  # noqa: E731
    lines = [f"name = {plain(design.name)}"]
    for family in design.families:
        lines += ["", "[[family]]", f"name = {plain(family.name)}", f"kind = {plain(family.kind)}"]
        lines += [f"rule = {plain(family.rule)}"]
        if family.note:
            lines.append(f"note = {plain(family.note)}")
        if family.rule == "latin":
            lines += [f"samples = {family.samples}", f"seed = {family.seed}", f"log = {plain(family.log)}"]
        for name, rows in (("base", family.base), ("vary", family.vary)):
            if rows:
                lines.append(f"{name} = {table(rows)}")
    return "\n".join(lines) + "\n"

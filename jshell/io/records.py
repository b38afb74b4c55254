"""Records: one JSON file for one result, which says of what schema it is.

Numbers are written so that they read back to the bit; NaN is null, infinity a
word. What a record means is known to the room that writes it; here are the file,
its schema, and the traces that a record carries.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jshell.errors import BadFile, require_extra
from jshell.files import NamedBytes, Source
from jshell.shell.parameters import CONDITION_FIELDS, Reduced, Scales
from jshell.trace import Trace

SCHEMA = 1
CONDITIONS = tuple(CONDITION_FIELDS.values())
FORMAT = "jshell record"


def write_record(path: str | Path, kind: str, content: Mapping[str, Any]) -> Path:
    """Write a record.

    Args:
        path: File to write; its folder must exist.
        kind: What the record is, e.g. `fit`.
        content: Numbers, texts, lists, arrays and mappings of them.

    Raises:
        BadFile: Nothing can be written there.
    """
    path = Path(path)
    whole = encode_record(kind, content)
    try:
        path.write_bytes(whole)
    except OSError as error:
        raise BadFile(
            str(path), found=error.strerror or "an error", expected="a file in a folder that exists", remedy="Check it."
        ) from error
    return path


def encode_record(kind: str, content: Mapping[str, Any]) -> bytes:
    """A record as the file that `write_record` would write, without writing it."""
    whole = {"format": FORMAT, "schema": SCHEMA, "kind": kind, **plain(dict(content))}
    return (json.dumps(whole, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()


def read_record(source: Source, kind: str) -> dict[str, Any]:
    """Read a record of a kind, from a file or from a name with bytes.

    Raises:
        BadFile: No such file, not JSON, not a record, another kind, or a schema of a later jshell.
    """
    place = str(source)
    try:
        content = source.content if isinstance(source, NamedBytes) else Path(source).read_bytes()
        whole = json.loads(bytes(content).decode())
    except OSError as error:
        raise BadFile(place, found=error.strerror or "an error", expected="a file", remedy="Check it.") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise BadFile(
            place, found=f"no JSON ({error})", expected="a record", remedy="Save the result again."
        ) from error
    if not isinstance(whole, dict) or whole.get("format") != FORMAT:
        raise BadFile(
            place, found="JSON of another make", expected=f"format {FORMAT!r}", remedy="Write it with result.save."
        )
    if whole.get("schema") != SCHEMA:
        raise BadFile(
            place,
            found=f"schema {whole.get('schema')!r}",
            expected=f"schema {SCHEMA}",
            remedy="Read it with the jshell that wrote it, or a later one.",
        )
    if whole.get("kind") != kind:
        raise BadFile(place, found=f"a record of kind {whole.get('kind')!r}", expected=kind, remedy="Check it.")
    return whole


def plain(value: Any) -> Any:
    """A value as JSON knows it, without losing a bit."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | np.integer):
        return int(value)
    numbers = np.asarray(value)
    if numbers.ndim:
        return [plain(item) for item in numbers.tolist()]
    number = numbers.item()
    if isinstance(number, bool | int):
        return number
    if np.isnan(number):
        return None
    return number if np.isfinite(number) else ("inf" if number > 0 else "-inf")


def number(value: Any) -> float:
    """A number written by `plain`."""
    return float("nan") if value is None else float(value)


def numbers(value: Any) -> np.ndarray:
    """An array written by `plain`."""
    if not isinstance(value, list):
        return np.asarray(number(value))
    return np.array([numbers(item) for item in value], dtype=float) if value else np.zeros(0)


def text(value: Any) -> str:
    """A text.

    Raises:
        TypeError: It is none: what it would read as is nothing that anybody wrote.
    """
    if not isinstance(value, str):
        raise TypeError(f"{value!r:.80} where a text stands")
    return value


def texts(value: Any) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        TypeError: It is none.
    """
    if not isinstance(value, list):
        raise TypeError(f"{value!r:.80} where a list stands")
    return tuple(map(text, value))


def trace_record(trace: Trace) -> dict[str, Any]:
    """A trace as a JSON object."""
    c, scales = trace.conditions, trace.scales
    return {
        "times": plain(trace.times),
        "channels": plain(trace.channels),
        "sigma": plain(trace.sigma),
        "conditions": None if c is None else {name: plain(np.asarray(getattr(c, name), float)) for name in CONDITIONS},
        "scales": None if scales is None else {name: getattr(scales, name) for name in SCALES},
        "outcome": int(np.asarray(trace.outcome)),
        "settings": [list(pair) for pair in trace.settings],
    }


SCALES = ("length", "pressure", "density")


def trace_of(found: Mapping[str, Any]) -> Trace:
    """A trace from its JSON object."""
    c, scales = found["conditions"], found["scales"]
    return Trace(
        numbers(found["times"]),
        {name: numbers(values) for name, values in found["channels"].items()},
        None if c is None else Reduced(*(float(c[name]) for name in CONDITIONS)),
        {name: numbers(values) for name, values in found["sigma"].items()},
        int(found["outcome"]),
        tuple((str(key), str(value)) for key, value in found["settings"]),
        None if scales is None else Scales(*(float(scales[name]) for name in SCALES)),
    )


def write_groups(
    path: str | Path, groups: Mapping[str, Mapping[str, tuple[tuple[str, ...], Any]]], **facts: str
) -> Path:
    """Write arrays in named groups as NetCDF: what xarray's DataTree and ArviZ read.

    Args:
        path: File to write.
        groups: Group to name to dimensions and values; coordinates are variables named as their dimension. What NetCDF
            takes for a path is written in words.
        facts: Texts that belong to the file.

    Raises:
        MissingExtra: xarray or h5netcdf is not installed.
    """
    require_extra("h5netcdf", "io", "NetCDF")
    xarray = require_extra("xarray", "io", "NetCDF")
    tree = {
        f"/{group}": xarray.Dataset({_no_path(name): values for name, values in rows.items()})
        for group, rows in groups.items()
    }
    tree["/"] = xarray.Dataset(attrs=facts)
    xarray.DataTree.from_dict(tree).to_netcdf(Path(path), engine="h5netcdf")
    return Path(path)


def _no_path(name: str) -> str:
    return name.replace("/", "_per_") if name.strip(".") else name.replace(".", "dot")

"""Tables in memory, of pandas and xarray, read by the rules of files: names, units, times, refusals, warnings."""

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from jshell.errors import BadShape, GuessWarning
from jshell.io.choices import Reading
from jshell.io.headers import CONDITION_KEYS, reduced_pairs, si_pairs
from jshell.io.netcdf import PURE as ONE
from jshell.io.sheets import Entry, Sheet, entry
from jshell.io.tables import understood
from jshell.io.titles import parted
from jshell.io.units import PURE
from jshell.shell.parameters import Reduced, Scales
from jshell.trace import Trace

Column = tuple[str, str | None, np.ndarray]


def from_pandas(frame: Any, conditions: Reduced | None, scales: Scales | None, said: Mapping[str, Any]) -> Trace:
    """The trace that a DataFrame holds; see `Trace.from_pandas`."""
    found: list[Column] = []
    passed: list[str] = []
    index = frame.index
    if index.name is not None or index.dtype.kind in "mM" or index.dtype.kind == "f":
        _add(found, passed, str(index.name or "time"), None, np.asarray(index))
    known = dict(frame.attrs.get("units", {}))
    for k, name in enumerate(frame.columns):
        label = " ".join(map(str, name)) if isinstance(name, tuple) else str(name)
        _add(found, passed, label, known.get(name), frame.iloc[:, k].to_numpy())
    return _trace("DataFrame", found, passed, _entries(conditions, scales), said)


def from_xarray(data: Any, conditions: Reduced | None, scales: Scales | None, said: Mapping[str, Any]) -> Trace:
    """The trace that a Dataset holds; see `Trace.from_xarray`."""
    found: list[Column] = []
    passed: list[str] = []
    for name in (*data.coords, *data.data_vars):
        values = data[name]
        if values.ndim > 1:
            raise BadShape(
                f"variable {name!r}",
                found=f"dimensions {values.dims}",
                expected="one dimension, the time",
                remedy="Select one case or channel first.",
            )
        if values.ndim == 1:
            _add(found, passed, str(name), values.attrs.get("units"), np.asarray(values))
    if all(unit in (None, PURE) for _, unit, _ in found):
        found = [(name, None, values) for name, _, values in found]
    own = _entries(conditions, scales)
    if not own:
        keys = (*CONDITION_KEYS, "outcome")
        own = [Entry(key, str(data.attrs[key]), f"attribute `{key}`") for key in keys if key in data.attrs]
        lines = str(data.attrs.get("settings", "")).split("\n")
        own += [pair for line in lines if (pair := entry(f"# {line}", "attribute `settings`")) is not None]
    axis = [str(name) for name in data.dims if name in data.coords]
    return _trace("Dataset", found, passed, own, said, axis[0] if len(axis) == 1 else "")


def _add(found: list[Column], passed: list[str], label: str, unit: str | None, values: np.ndarray) -> None:
    """Take a column of numbers or times; columns of words are passed over."""
    name, written = parted(label)
    unit = unit if unit is not None else written
    if values.dtype.kind in "mM":
        zero = values[0] if values.dtype.kind == "M" else np.timedelta64(0, "s")
        found.append((name, "s", (values - zero) / np.timedelta64(1, "s")))
    elif values.dtype.kind in "fiu":
        found.append((name, PURE if unit == ONE else unit, values.astype(np.float64)))
    else:
        passed.append(f"column `{name}` of words")


def _entries(conditions: Reduced | None, scales: Scales | None) -> list[Entry]:
    if conditions is None:
        return []
    pairs = reduced_pairs(conditions) if scales is None else si_pairs(conditions, scales)
    return [Entry(key, value, "conditions") for key, value in pairs]


def _trace(
    file: str,
    found: list[Column],
    passed: list[str],
    entries: Iterable[Entry],
    said: Mapping[str, Any],
    axis: str = "",
) -> Trace:
    names, units, columns = zip(*found, strict=True) if found else ((), (), ())
    sheet = Sheet(file, tuple(entries), names, units, columns, passed=tuple(passed), axis=axis)
    read = understood(sheet, None, Reading.from_record(said))
    if read.taken:
        warnings.warn(f"{file}: " + "; ".join(read.taken) + ".", GuessWarning, stacklevel=4)
    return read.trace

"""Inversions as jobs: what shell recordings are of, by the simulator's small vibrations."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jshell import io
from jshell.calibration import Prior
from jshell.calibration.options import check_names
from jshell.files import NamedBytes
from jshell.inversion import Inversion, Snap, Unknown
from jshell.inversion import invert as invert_traces
from jshell.io.zip_files import Content
from jshell.service.encoding import as_csv, as_json

HOW = ("channels", "start", "stop", "free_rest", "nuisance", "exact", "elements")  # as `jshell.invert` calls them
SNAP = ("ramp", "origin", "elements")  # as `jshell.inversion.Snap` does
OPTIONS = ("known", "unknown", "bounds", "priors", "local", "level", *HOW, *SNAP)
HEAD = ("name", "value", "stderr", "low", "high", "unit", "role", "reason")


def invert(specification: Mapping[str, Any], files: Sequence[tuple[str, Content]]) -> dict[str, bytes]:
    """What shell traces are of.

    Returns:
        `inversion.json`, as `jshell.inversion.Inversion.record` says it; `table.csv` of what was found, with 95 %
        intervals; `report.txt`; and, where the search ended somewhere, `curves.json`: per trace its name, whether it is
        in SI, times, and per channel data and curve.

    Raises:
        JshellError: As `jshell.invert` and `jshell.io.read_trace`.
    """
    check_names(specification, OPTIONS)
    given = [NamedBytes(*file) for file in files]
    picked = lambda names: {name: specification[name] for name in names if specification.get(name) is not None}  # noqa: E731
    how = picked(HOW)
    if specification.get("level") == "trace":
        how["level"] = Snap(**picked(SNAP))
    found = invert_traces(
        [io.read_trace(file) for file in given], specification.get("known"), unknowns(specification),
        local=tuple(specification.get("local") or ()), **how,
    )  # fmt: skip
    made = {
        "inversion.json": as_json(found.record()),
        "report.txt": found.report().encode(),
        "table.csv": _table(found),
    }
    if found.solution is not None and found.solution.projections:
        made["curves.json"] = as_json(_curves(found, [file.name for file in given]))
    return made


def unknowns(specification: Mapping[str, Any]) -> dict[str, Unknown]:
    """What is asked, with what is known of it: every name among `unknown`, `priors` or `bounds`, as in the terminal."""
    priors, bounds = specification.get("priors") or {}, specification.get("bounds") or {}
    names = dict.fromkeys([*specification.get("unknown", ()), *priors, *bounds])
    found = {}
    for name in names:
        low, high = bounds.get(name, (None, None))
        found[name] = Unknown(low, high, Prior(**priors[name]) if name in priors else None)
    return found


def _table(found: Inversion) -> bytes:
    units = dict(zip((one.name for one in found.estimates), found.units, strict=False))
    rows: list[Sequence[Any]] = [HEAD]
    for one in (*found.estimates, *found.derived):
        low, high = found.interval(one.name)
        numbers = ["" if not np.isfinite(x) else float(x) for x in (one.value, one.stderr, low, high)]
        rows.append((one.name, *numbers, units.get(one.name, ""), one.role, one.reason or ""))
    return as_csv(rows)


def _curves(found: Inversion, names: Sequence[str]) -> list[dict[str, Any]]:
    """Data and curve of every recording, as it was read."""
    return [
        {
            "name": name,
            "si": one.si,
            "t": one.times,
            "channels": {
                channel: {"data": one.values[k], "curve": curves[channel]} for k, channel in enumerate(one.channels)
            },
        }
        for name, one, curves in zip(names, found.recordings, found.curves(), strict=True)
    ]

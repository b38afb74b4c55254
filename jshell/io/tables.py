"""Traces and tables in files: what may be read, and what is refused.

A file is text (CSV and its cousins), JSON, NetCDF, `.mat` or `.npz`: its suffix
says which. In text, lines `# key: value` stand above the columns: the conditions
(`d_hat`, `P0_hat`, … or `R0_m`, `d_m`, …), the outcome, and settings in the
user's own words. Then come a row of names and the numbers. A name alone is
dimensionless; `V [mm^3]` has a unit, and needs SI conditions to lose it.
`sigma_V` is the standard error of `V`. A record without conditions stays in SI.
What a file leaves open is settled by `Reading`, or taken for what it most
likely is, with a warning that says so. What would make a wrong answer later is
refused here, with its place.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jshell.errors import BadFile, BadName, BadShape, BadUnits, BadValue, GuessWarning, Outcome, choose
from jshell.files import NamedBytes, Source
from jshell.io import headers, roles
from jshell.io.choices import Reading
from jshell.io.columns import (
    SECONDS,
    Columns,
    check_finite,
    check_roles,
    check_times,
    check_values,
    dimensionless,
    increasing,
)
from jshell.io.formats import encode_sheet, read_sheet, write_sheet
from jshell.io.plausibility import warn_of_slips
from jshell.io.sheets import HALVES, Entry, Sheet, entry
from jshell.io.units import LOGARITHMS, SIGMA, dimension_of, si_unit
from jshell.shell.parameters import CONDITION_FIELDS, Reduced, Scales
from jshell.trace import Trace, Values

UNITS_KEY = "channel_units"  # the setting that keeps units of another kind, `CH1: V; CH2: dBm`


@dataclass(frozen=True)
class Understood:
    """A record, and what was made of its file.

    Attributes:
        trace: The record.
        sheet: Its columns under the names and units that they were read with.
        taken: What was taken for what, in words.
    """

    trace: Trace
    sheet: Sheet
    taken: tuple[str, ...]


def read_trace(path: Source, meta: Source | None = None, *, reading: Reading | None = None, **said: Any) -> Trace:
    """A trace from a file of columns.

    Args:
        path: The file, or its name with its bytes: times, at least one channel, at least two rows. The suffix tells
            the format: `.json`, `.nc`, `.mat`, `.npz`, `.xlsx`, `.tdms`; every other is text, of any instrument.
        meta: A JSON file with the keys of a header, for files without conditions. Where both have
            conditions they must agree.
        reading: What the file leaves open.
        said: The same by its fields: `columns={"t": "Time (s)", "H": 3}`, `units={"H": "mm"}`, `rate=1000`,
            `time_from="frame"`, `rows="12:400"`, `missing="drop"`.

    Returns:
        The trace, dimensionless. `scales` is set where the conditions are SI, `conditions` is None where neither file
        has any. Columns with units but without conditions are given in SI, with `scales` of one metre, pascal and
        kg/m³, so that its unit of time is the second. Columns in units of another kind, such as V, keep their numbers;
        the setting `channel_units` says which.

    Raises:
        BadFile: Not a file of columns, or part of the conditions is missing.
        BadName: No time, no channel, a `sigma_` without its channel, an unknown outcome.
        BadUnits: Units that are unknown, mixed, in contradiction to the name, or without SI conditions.
        BadValue: A number outside its meaning: time that stands still, a volume above the sphere's.
        MissingExtra: A format whose library is not installed.

    Warns:
        GuessWarning: What the file leaves open, and what it was taken for.
        RangeWarning: A volume or area slightly beyond the sphere's; columns that a slip of units would explain.
    """
    reading = reading or Reading.from_record(said)
    found = understood(read_sheet(path, reading, ("t",)), meta, reading)
    if found.taken:
        warnings.warn(f"{path}: " + "; ".join(found.taken) + ".", GuessWarning, stacklevel=2)
    return found.trace


def understood(sheet: Sheet, meta: Source | None = None, reading: Reading | None = None) -> Understood:
    """The trace that a file's columns stand for; as `read_trace`, for who needs to know what was made of them."""
    reading = reading or Reading()
    headers.refuse_equals_signs(sheet.comments)
    extra = () if meta is None else headers.read_entries(meta)
    problem, unit = _agreed(sheet, extra, meta)
    sheet = roles.record(sheet, reading, dimensional=problem is None)

    columns, own = dimensionless(sheet, unit, known=problem is not None)
    si = problem is None and "t" not in sheet.pure and any(one is not None for one in sheet.units)
    unit = SECONDS if si else unit
    check_finite(columns, sheet.place)
    times = columns.pop("t")
    channels: dict[str, Values] = {name: x for name, x in columns.items() if not name.startswith(SIGMA)}
    sigma: dict[str, Values] = {name.removeprefix(SIGMA): x for name, x in columns.items() if name.startswith(SIGMA)}
    check_roles(list(channels), list(sigma), sheet.place)
    if times.size == 1:
        raise BadFile(
            sheet.file, found="a single row of numbers", expected="at least two", remedy="Use a longer record."
        )
    times, rounded = increasing(times, sheet.place)
    check_values(columns, sheet.place, si=si)
    written = dict(zip(sheet.names, sheet.units, strict=True))
    warn_of_slips({"t": times, **columns}, written, problem, unit, sheet.place)

    lines = {line.key for line in sheet.entries}
    entries = (*sheet.entries, *(line for line in extra if line.key not in lines))
    settings = headers.settings(entries)
    if own:
        settings = (*settings, (UNITS_KEY, "; ".join(f"{name}: {one}" for name, one in own.items())))
    taken = [*sheet.taken, *([rounded] if rounded else [])]
    taken += [
        f"`{name}` is in {one}, a logarithm: convert it before it is analysed"
        for name, one in own.items()
        if one in LOGARITHMS
    ]
    taken += [f"passed over: {', '.join(sheet.passed)}"] if sheet.passed else []
    trace = Trace(times, channels, problem, sigma, headers.outcome(entries), settings, unit)
    return Understood(trace, sheet, tuple(taken))


def read_table(
    path: Source,
    required: Sequence[str] = (),
    optional: Sequence[str] | None = None,
    *,
    reading: Reading | None = None,
    **said: Any,
) -> dict[str, np.ndarray]:
    """The columns of a file that need not be a record in time.

    Args:
        path: The file, or its name with its bytes.
        required: Columns it must have.
        optional: Columns it may have beside them; None allows any.
        reading: What the file leaves open.
        said: The same by its fields, as of `read_trace`.

    Returns:
        Name to (rows,) values, dimensionless, in the order of the file.

    Raises:
        BadFile, BadUnits, BadValue: As for `read_trace`.
        BadName: A required column is missing, or a column is neither required nor optional.
    """
    reading = reading or Reading.from_record(said)
    sheet = roles.table(read_sheet(path, reading, required), reading, required)
    headers.refuse_equals_signs(sheet.comments)
    headers.condition_entries(sheet.entries)
    if sheet.taken:
        warnings.warn(f"{path}: " + "; ".join(sheet.taken) + ".", GuessWarning, stacklevel=2)
    if optional is not None:
        known = (*required, *optional)
        for name in sheet.names:
            if name not in known:
                raise BadName(
                    sheet.place(name),
                    found="a column of this name",
                    expected="one of " + ", ".join(known),
                    remedy="Correct the name or remove the column.",
                )
    # A table may vary what a header would fix, so its conditions matter only where there are units.
    with_units = any(unit is not None for unit in sheet.units)
    unit = headers.conditions(sheet.entries, sheet.file)[1] if with_units else None
    columns, _ = dimensionless(sheet, unit, known=True)
    check_values(columns, sheet.place)
    return columns


def write_trace(path: str | Path, trace: Trace, units: str = "reduced") -> None:
    """Write a trace so that `read_trace` reads it back.

    JSON, NetCDF, `.mat` and `.npz` keep every bit of reduced numbers; text keeps all digits of conditions and
    times, and twelve of channels. In SI all are kept to 1e-15 of their value.

    Args:
        path: The file; an old one is replaced. Its suffix tells the format: `.csv`, `.txt`, `.dat` or none,
            `.tsv`, `.tab`, `.json`, `.nc`, `.mat`, `.npz`.
        trace: One trace, not a batch; it must pass the reader's checks.
        units: `reduced` for dimensionless columns and conditions, which leaves the scales out;
            `si` for both in SI.

    Raises:
        BadFile: The file cannot be written.
        BadName: Another word for `units`, a suffix of no format, or a name that the format cannot hold.
        BadShape: A batch of traces.
        BadUnits: SI asked of a trace without scales or conditions.
        BadValue: Values that the reader would refuse.
    """
    write_sheet(_sheet_of_trace(str(path), trace, units))


def encode_trace(name: str, trace: Trace, units: str = "reduced") -> NamedBytes:
    """A trace as the file that `write_trace` would write, without writing it.

    Args:
        name: Of the file; its suffix tells the format.
        trace: As for `write_trace`.
        units: As for `write_trace`.

    Raises:
        BadName, BadShape, BadUnits, BadValue: As `write_trace`.
    """
    return encode_sheet(_sheet_of_trace(name, trace, units))


def _sheet_of_trace(file: str, trace: Trace, units: str) -> Sheet:
    choose("units", units, ("reduced", "si"), expected="reduced or si")
    columns = _checked(trace)
    spelled: tuple[str | None, ...] = tuple(None for _ in columns)
    own = dict(pair.split(": ", 1) for pair in dict(trace.settings).get(UNITS_KEY, "").split("; ") if ": " in pair)
    if trace.conditions is None and trace.scales == SECONDS:  # in SI as it is: the unit of time would be lost
        header = []
        spelled = tuple(own.get(name) or si_unit(name) for name in columns)
    elif units == "reduced":
        header = [] if trace.conditions is None else headers.reduced_pairs(trace.conditions)
    else:
        if trace.scales is None or trace.conditions is None:
            missing = "scales" if trace.scales is None else "conditions"
            raise BadUnits(
                "trace",
                found=f"no {missing}",
                expected="scales and conditions, to write SI",
                remedy='Write it with units="reduced", or set them.',
            )
        header = headers.si_pairs(trace.conditions, trace.scales)
        spelled = tuple(own.get(name) or si_unit(name) for name in columns)
        with np.errstate(over="ignore", under="ignore"):
            columns = {name: values * trace.scales.of(dimension_of(name)) for name, values in columns.items()}
        check_finite(columns, _sample)
    settings = [(key, value) for key, value in trace.settings if key != UNITS_KEY or spelled[0] is None]
    for key, value in settings:
        _check_setting(key, value)
    header = [*header, ("outcome", Outcome(int(trace.outcome)).word), *settings]
    entries = tuple(Entry(key, value, "trace") for key, value in header)
    return Sheet(file, entries, tuple(columns), spelled, tuple(columns.values()))


def _agreed(sheet: Sheet, extra: Sequence[Entry], meta: Source | None) -> tuple[Reduced | None, Scales | None]:
    """Conditions of the file, or else of `meta`; where both have them they must agree."""
    problem, unit = headers.conditions(sheet.entries, sheet.file)
    other, other_unit = headers.conditions(extra, str(meta))
    if problem is None or other is None:
        return (other, other_unit) if problem is None else (problem, unit)
    for name in CONDITION_FIELDS.values():
        ours, theirs = getattr(problem, name), getattr(other, name)
        if not np.isclose(ours, theirs, rtol=1e-9, atol=0):
            raise BadValue(
                f"{sheet.file} and {meta}",
                found=f"{name} {ours:.10g} in one and {theirs:.10g} in the other",
                expected="the same conditions",
                remedy="Remove the conditions from one of the two files.",
            )
    return problem, unit if unit is not None else other_unit


def _checked(trace: Trace) -> Columns:
    """The trace's columns, which the reader would accept."""
    times = np.asarray(trace.times, dtype=float)
    numbers = [trace.outcome, *jax.tree.leaves(trace.conditions)]
    if times.ndim != 1 or any(np.ndim(number) != 0 for number in numbers):
        raise BadShape(
            "trace",
            found=f"times of shape {times.shape}, outcome and conditions of shapes {[np.shape(x) for x in numbers]}",
            expected="one trace: times of shape (times,) and scalars",
            remedy="Write a batch one by one.",
        )
    if int(trace.outcome) not in list(Outcome):
        raise BadValue(
            "trace, outcome",
            found=str(trace.outcome),
            expected=f"an integer from 0 to {max(Outcome)}",
            remedy="Take it from `Outcome`.",
        )
    channels = {name: np.asarray(values, dtype=float) for name, values in trace.channels.items()}
    sigma = {name: np.asarray(values, dtype=float) for name, values in trace.sigma.items()}
    check_roles(list(channels), list(sigma), lambda name: f"trace, channel `{name}`")
    for name in channels:
        spoiled = name == "t" or name.startswith(SIGMA) or set(name) & set(",;\t[]\n\r\0") or HALVES.search(name)
        if not name or spoiled or name != name.strip():
            raise BadName(
                f"trace, channel {name!r}",
                found="a name that a column row cannot hold",
                expected="a word other than `t`, not starting with `sigma_`, without separators or brackets",
                remedy="Rename the channel.",
            )
    columns = {"t": times, **channels, **{SIGMA + name: values for name, values in sigma.items()}}
    for name, values in columns.items():
        if values.shape != times.shape:
            raise BadShape(
                f"trace, channel `{name}`",
                found=f"shape {values.shape}",
                expected=f"shape {times.shape}, one value per time",
                remedy="Cut or resample the channel.",
            )
    if times.size < 2:
        raise BadValue("trace", found=f"{times.size} samples", expected="at least two", remedy="Use a longer record.")

    check_values(columns, _sample, si=trace.conditions is None and trace.scales == SECONDS)
    check_times(times, _sample)
    return columns


def _sample(name: str, sample: int) -> str:
    return f"trace, channel `{name}`, sample {sample}"


def _check_setting(key: str, value: str) -> None:
    """Refuse a setting that a header line would not bring back."""
    line = f"# {key}: {value}"
    back = entry(line, "")
    taken = key.lower() in {word.lower() for word in (*headers.CONDITION_KEYS, "outcome")}
    if (
        taken
        or HALVES.search(line)
        or "\r" in line
        or "\0" in line
        or back is None
        or (back.key, back.value) != (key, value)
    ):
        raise BadName(
            f"trace, setting {key!r}",
            found=repr(value),
            expected="a key of one word that is no condition, and a value of one line",
            remedy="Rename the key, or put the value in one line.",
        )

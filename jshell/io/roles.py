"""Which column of a file is the time, and which are channels; what was taken for what is said.

A channel is called as the file calls it: nothing but `V` is the volume. Only the
time is looked for under the names that instruments give it, and every such
choice is told. `Reading` settles whatever the file leaves open.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jshell.errors import BadFile, BadName, BadValue
from jshell.io.choices import Reading
from jshell.io.clock import FRAME_NAMES, TIME_NAMES, counts, timed
from jshell.io.files import brief
from jshell.io.picks import called, find, picked
from jshell.io.sheets import Sheet, listed, titles
from jshell.io.units import PURE, SIGMA, dimension_of, known_factor
from jshell.quantities import QUANTITIES


def table(sheet: Sheet, reading: Reading, required: Sequence[str] = ()) -> Sheet:
    """The columns of a table under the names that the reader gave them.

    Raises:
        BadFile: A name twice, or a column without one.
        BadName: A required column is missing; a choice of a column that is not there.
    """
    return _gapless(_cut(_united(_named(sheet, reading, required), reading), reading), reading)


def record(sheet: Sheet, reading: Reading, *, dimensional: bool) -> Sheet:
    """The columns of a record in time: `t` first of all, and its channels.

    Args:
        sheet: As the file has it.
        reading: What the reader said.
        dimensional: Whether times that nobody gives a unit are seconds: so it is where there are no conditions.

    Raises:
        BadFile, BadName: As `table`; no time; several columns that could be it.
        BadUnits: Another unit of time than seconds beside a rate.
        BadValue: Frames that do not count up, or that skip, where rows are counted.
    """
    sheet = timed(_cut(_named(sheet, reading, ()), reading), reading, dimensional)
    return _gapless(_united(sheet, reading), reading)


def _named(sheet: Sheet, reading: Reading, required: Sequence[str]) -> Sheet:
    """The sheet with the names that the reader gave; columns that are neither named nor asked for are set aside."""
    where = {name: find(sheet, name, one) for name, one in reading.columns.items()}
    known = list(sheet.names)
    for name, k in where.items():
        known[k] = name
    chosen = {name for name in where if name != "t" and not name.startswith(SIGMA)}
    keep = [k for k in range(len(known)) if not chosen or k in where.values() or known[k] == "t"]
    said, passed = [], list(sheet.passed)
    if chosen and "t" not in where:  # the time may have another name
        keep = sorted(
            {*keep, *(k for k, name in enumerate(known) if TIME_NAMES.fullmatch(name) or FRAME_NAMES.fullmatch(name))}
        )
    counted = [k for k in keep if not known[k] and k == 0 and counts(sheet.columns[k])]
    if counted and len(keep) > 1:
        keep.remove(0)
        passed.append("column 1, which has no name and counts the rows")
    place = ", ".join(part for part in (sheet.file, sheet.head) if part)
    names = [known[k] for k in keep]
    if not any(names) and sheet.names and not where:
        missing = required or ("t",)
        raise BadName(
            place,
            found=f"{len(names)} columns without names",
            expected=" and ".join(f"a column `{name}`" for name in missing),
            remedy=f"Add a row of names such as `{','.join(required or ('t', 'V'))}` above the numbers, or name them "
            "by place: `--columns t=1,V=2`.",
        )
    for k in keep:
        if not known[k]:
            raise BadFile(
                f"{place}, column {sheet.places[k] if sheet.places else k + 1}",
                found="an empty column name",
                expected="a name for every column",
                remedy="Name the column, or say which are read: `--columns t=1,V=2`.",
            )
    own = [k for k in keep if known[k] == sheet.names[k]]
    titles(place, [known[k] for k in own if "[" not in known[k] and "]" not in known[k]])  # names twice
    for name in where:
        if names.count(name) > 1:
            raise BadName(
                f"columns, {name}",
                found="another column of this name",
                expected="every name once",
                remedy="Choose another name.",
            )
    for name, k in where.items():
        if sheet.names[k] != name:
            said.append(f"{called(sheet, k)} read as `{name}`, as asked")
    found = picked(sheet, keep, names)
    _require(place, found.names, required)
    aside = [called(sheet, k) for k in range(len(known)) if k not in keep and not (k == 0 and counted)]
    return replace(found, passed=(*passed, *aside), taken=(*sheet.taken, *said))


def _require(place: str, names: Sequence[str], required: Sequence[str]) -> None:
    missing = [name for name in required if name not in names]
    if not missing:
        return
    near = [name for name in names if name.lower() in {word.lower() for word in missing}]
    remedy = f"Add a row of names such as `{','.join(required)}` above the numbers, or rename a column."
    if near:
        remedy = f"Rename `{near[0]}`; capitals count. Or say `--columns {near[0].lower()}={near[0]}`."
    raise BadName(
        place,
        found=listed(names),
        expected=" and ".join(f"a column `{name}`" for name in missing),
        remedy=remedy,
    )


def _united(sheet: Sheet, reading: Reading) -> Sheet:
    """The sheet with the units that the reader gave, and with those that registered names carry behind them."""
    units, said = list(sheet.units), []
    names = list(sheet.names)
    for name, unit in reading.units.items():
        if name not in names:
            raise BadName(
                f"units, {brief(name)}",
                found="a unit of no column that is read",
                expected="one of " + ", ".join(brief(one) for one in names[:12]),
                remedy="Correct the name; a column that was renamed has its new one.",
            )
        k = names.index(name)
        if units[k] is not None and units[k] != unit:
            said.append(f"`{name}` in {unit}, as asked, where the file says {units[k]}")
        units[k] = None if unit == PURE else unit
    for k, name in enumerate(names):
        key, mark, unit = name.rpartition("_")
        carries = mark and units[k] is None and key in QUANTITIES and len(unit) < 8 and name not in QUANTITIES
        found = known_factor(unit) if carries else None
        if found is not None and found[0] == dimension_of(key) and key not in names:
            names[k], units[k] = key, unit
            said.append(f"column `{name}` taken for `{key}` in {unit}, by its name")
    pure = tuple(name for name, unit in reading.units.items() if unit == PURE)
    return replace(sheet, names=tuple(names), units=tuple(units), taken=(*sheet.taken, *said), pure=pure)


def _cut(sheet: Sheet, reading: Reading) -> Sheet:
    """The rows that the reader wants, of formats that do not count lines."""
    low, high = reading.rows
    if sheet.places or (low is None and high is None) or not sheet.columns:
        return sheet
    part = slice((low or 1) - 1, high)
    row_of = sheet.row_of
    columns = tuple(values[part] for values in sheet.columns)
    if not columns[0].size:
        raise BadValue("rows", found="none that the file has", expected="rows of it", remedy="Check `--rows`.")
    return replace(sheet, columns=columns, row_of=lambda sample: row_of(sample + part.start))


def _gapless(sheet: Sheet, reading: Reading) -> Sheet:
    """The sheet without the rows that have a gap in a column that is read."""
    if reading.missing != "drop" or not sheet.columns:
        return sheet
    whole = np.all([np.isfinite(values) for values in sheet.columns], axis=0)
    lost = int(np.sum(~whole))
    if lost == 0:
        return sheet
    if lost == whole.size:
        raise BadValue(
            sheet.file, found="a gap in every row", expected="rows of numbers", remedy="Say which columns are read."
        )
    kept, row_of = np.flatnonzero(whole), sheet.row_of
    return replace(
        sheet,
        columns=tuple(values[whole] for values in sheet.columns),
        row_of=lambda sample: row_of(int(kept[sample])),
        taken=(*sheet.taken, f"{lost} of {whole.size} rows have gaps and are left out"),
    )

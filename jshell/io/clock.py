"""The times of a record: a column, a rate, what an instrument tells of its samples, or stamps that were rounded.

Every choice that the file did not spell out is told in `Sheet.taken`.
"""

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from jshell.errors import BadName, BadUnits, BadValue
from jshell.io.choices import ROWS, Reading
from jshell.io.picks import called, find, number, picked
from jshell.io.sheets import Sheet, listed
from jshell.io.units import PURE

TIME_NAMES = re.compile(
    r"(?:time|times|t|zeit|uhrzeit|zeitpunkt|temps|heure|tempo|ora|hora"
    r"|tiempo|tijd|elapsed time|relative time|time elapsed|x_value|x-axis|x axis"
    r"|timestamp|time ?stamp|date ?/?-?_?time|clock)(?:[ _]?(?P<unit>s|ms|us|µs|ns|min))?",
    re.IGNORECASE,
)
FRAME_NAMES = re.compile(r"(?:frame|frames|slice|image|frame ?(?:no|nr|number)\.?|sequence|index|step)", re.IGNORECASE)
COARSE = 1.5  # steps that rounded stamps lie apart at least
_NICE = (1, 2, 3, 4, 5)  # digits that a step is first tried with


def timed(sheet: Sheet, reading: Reading, dimensional: bool) -> Sheet:
    """The sheet with a column `t`."""
    given = [one for name, one in reading.units.items() if name != "t"]
    unit = "s" if dimensional or any(one not in (None, PURE) for one in (*sheet.units, *given)) else None
    if reading.rate is not None:
        return _at_rate(sheet, reading, reading.rate, unit)
    if reading.time_from is not None and reading.time_from != ROWS:
        k = find(sheet, "t", reading.time_from)
        names = ["t" if j == k else name for j, name in enumerate(sheet.names)]
        return replace(sheet, names=tuple(names), taken=(*sheet.taken, f"{called(sheet, k)} taken for `t`, as asked"))
    if "t" in sheet.names:
        return sheet
    named = [(k, found) for k, name in enumerate(sheet.names) if name != "T" and (found := TIME_NAMES.fullmatch(name))]
    if len(named) > 1:
        raise BadName(
            ", ".join(part for part in (sheet.file, sheet.head) if part),
            found=" and ".join(f"`{sheet.names[k]}`" for k, _ in named) + ", which could all be the time",
            expected="a column `t`",
            remedy=f"Say which it is: `--columns t={number(sheet, named[0][0])}`.",
        )
    if named:
        k, match = named[0]
        units = list(sheet.units)
        words = f"{called(sheet, k)} taken for `t`"
        if units[k] is None and match["unit"]:
            units[k] = match["unit"]
            words += f" in {units[k]}, by its name"
        names = ["t" if j == k else name for j, name in enumerate(sheet.names)]
        return replace(sheet, names=tuple(names), units=tuple(units), taken=(*sheet.taken, words))
    if sheet.axis in sheet.names:
        names = ["t" if name == sheet.axis else name for name in sheet.names]
        said = f"column `{sheet.axis}`, which the others lie along, taken for `t`"
        return replace(sheet, names=tuple(names), taken=(*sheet.taken, said))
    if sheet.even is not None and sheet.columns:
        times = sheet.even.start + sheet.even.step * np.arange(sheet.columns[0].size)
        sheet = _without_frames(sheet, None)
        said = f"times from {sheet.even.words}" if sheet.even is not None else ""
        return _with_times(replace(sheet, taken=(*sheet.taken, said)), times, "s")
    raise _no_time(sheet)


def _no_time(sheet: Sheet) -> BadName:
    frames = [name for name in sheet.names if FRAME_NAMES.fullmatch(name)]
    capital = [name for name in sheet.names if name == "T"]
    remedy = "Say which it is: `--columns t=NAME`; or, of even samples, how many a second: `--rate 1000`."
    if frames:
        remedy = f"Say the frames per second: `--rate 1000 --time-from {frames[0]}`, with the camera's rate."
    if capital:
        remedy = "Rename `T`, or say `--columns t=T`; capitals count."
    return BadName(
        ", ".join(part for part in (sheet.file, sheet.head) if part),
        found=listed(sheet.names),
        expected="a column `t`",
        remedy=remedy,
    )


def _at_rate(sheet: Sheet, reading: Reading, rate: float | int, unit: str | None) -> Sheet:
    """Even times from a rate, by rows or by a column that counts frames."""
    given = reading.units.get("t")
    if given not in (None, "s", PURE):
        raise BadUnits(
            "units, t",
            found=f"{given} beside a rate",
            expected="s: a rate counts by the second",
            remedy="Leave it out.",
        )
    unit = unit if given is None else None if given == PURE else "s"
    count = np.arange(sheet.columns[0].size, dtype=float) if sheet.columns else np.zeros(0)
    words = "rows"
    counted = [
        k for k, name in enumerate(sheet.names) if FRAME_NAMES.fullmatch(name) and counts(sheet.columns[k], skip=True)
    ]
    k: int | None = None
    if reading.time_from not in (None, ROWS):
        k = find(sheet, "t", str(reading.time_from))
        if not counts(sheet.columns[k], skip=True):
            raise BadValue(
                f"{sheet.file}, {called(sheet, k)}",
                found="numbers that do not count up by whole ones",
                expected="frames, to be counted by --rate",
                remedy=f"Name another column, or `--time-from {ROWS}`.",
            )
    elif reading.time_from is None and counted:
        k = counted[0]
        if not counts(sheet.columns[k]):
            raise BadValue(
                f"{sheet.file}, {called(sheet, k)}",
                found="frames that skip",
                expected="to be told whether frames or rows are counted",
                remedy=f"Say `--time-from {sheet.names[k]}` or `--time-from {ROWS}`.",
            )
    _refuse_second_record(sheet)
    if k is not None:
        count, words = sheet.columns[k] - sheet.columns[k][0], f"the frames of {called(sheet, k)}"
    sheet = _without_frames(sheet, k)
    said = f"times from {words} at {rate:g} a {'second' if unit else 'unit of time'}"
    return _with_times(replace(sheet, taken=(*sheet.taken, said)), count / rate, unit)


def _refuse_second_record(sheet: Sheet) -> None:
    """Refuse rows whose own time begins again: a rate would join two records into one."""
    for name, values in zip(sheet.names, sheet.columns, strict=True):
        if name == "t" or TIME_NAMES.fullmatch(name):
            again = np.flatnonzero((values[1:] == values[0]) & (values[1:] < values[:-1]))
            if again.size:
                at = int(again[0]) + 1
                row, last = sheet.row_of(at).removeprefix("row "), sheet.row_of(at - 1).removeprefix("row ")
                raise BadValue(
                    sheet.place(name, at),
                    found=f"{name} = {values[at]:.10g} again, where a second record begins",
                    expected="one record",
                    remedy=f"Read one: `--rows :{last}` or `--rows {row}:`.",
                )


def _without_frames(sheet: Sheet, k: int | None) -> Sheet:
    """The sheet without columns that times were made from, and without a time of its own."""
    gone = [
        j
        for j, name in enumerate(sheet.names)
        if j == k
        or name == "t"
        or TIME_NAMES.fullmatch(name)
        or (FRAME_NAMES.fullmatch(name) and counts(sheet.columns[j]))
    ]
    if len(gone) == len(sheet.names):
        gone = [j for j in gone if j == k]
    keep = [j for j in range(len(sheet.names)) if j not in gone]
    aside = tuple(called(sheet, j) for j in gone)
    return replace(picked(sheet, keep, [sheet.names[j] for j in keep]), passed=(*sheet.passed, *aside))


def _with_times(sheet: Sheet, times: np.ndarray, unit: str | None) -> Sheet:
    places = (0, *sheet.places) if sheet.places else ()
    return replace(
        sheet, names=("t", *sheet.names), units=(unit, *sheet.units), columns=(times, *sheet.columns), places=places
    )


def counts(values: np.ndarray, *, skip: bool = False) -> bool:
    """Whether numbers count up by one, or by whole numbers."""
    steps = np.diff(values)
    return bool(np.all(steps >= 1) and np.all(steps == np.round(steps))) if skip else bool(np.all(steps == 1))


def even_stamps(times: Float[np.ndarray, " times"]) -> Float[np.ndarray, " times"] | None:
    """The even times that stamps are roundings of; None where they are not.

    Stamps that repeat, but agree with even steps within half the step between the stamps, were rounded; where so few
    repeat that rows may as well stand twice, that is not said. What the early, finer stamps tell of the step is taken
    first, then the line through all.
    """
    steps = np.diff(times)
    if times.size < 8 or np.any(steps < 0) or not np.any(steps > 0):
        return None
    count = np.arange(times.size)
    quantum = float(steps.max())
    tries = []
    still = int(np.argmax(steps == 0))
    if still >= 8:
        tries.append((times[still] - times[0]) / still)
    slope = float(np.polyfit(count, times - times[0], 1)[0])
    doubt = 2 * quantum / times.size  # how well rounded stamps know their step
    for digits in _NICE:
        for near in (float(f"{slope:.{digits}g}"), 1 / float(f"{1 / slope:.{digits}g}")):
            if abs(near - slope) <= doubt:
                tries.append(near)
    tries.append(slope)
    for step in tries:
        off = times - times[0] - step * count
        shift = (off.max() + off.min()) / 2 if times[0] != 0 else 0.0
        if np.max(np.abs(off - shift)) <= 0.51 * quantum + 1e-9 * abs(times[-1]) and quantum > COARSE * step:
            return times[0] + shift + step * count
    return None

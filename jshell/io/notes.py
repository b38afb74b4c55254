"""What stands above a table and is no name: conditions, settings, comments, what an instrument tells of its times."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from jshell.errors import BadFile
from jshell.io.files import brief
from jshell.io.headers import CONDITION_KEYS
from jshell.io.layout import BLANKS, Layout, is_comment, split
from jshell.io.sheets import NUMBER, Entry, Even, entry
from jshell.io.titles import Titles
from jshell.io.units import known_factor

SHOWN = 8  # lines that were passed over and are told
# How instruments call the step, the rate and the first time of their samples.
STEPS = ("sample interval", "sampling interval", "xincrement", "x increment", "xinc", "delta_x", "tinc", "increment")
STEPS += ("horizontal interval", "horiz_interval", "resolution", "hresolution", "sampling period", "dt")
RATES = (
    "sample rate",
    "sampling rate",
    "samplerate",
    "sample frequency",
    "sampling frequency",
    "fs",
    "frame rate",
    "fps",
)
FIRSTS = ("xorigin", "x origin", "xorg", "xstart", "x0", "t0", "start")
_FACT = re.compile(r"([^:=]{1,40}?)\s*[:=]\s*(.*)")
_VALUE = re.compile(rf"({NUMBER.pattern})\s*([A-Za-zµμ]{{0,8}})", re.ASCII)
_CONDITION = re.compile(rf"\W*({'|'.join(CONDITION_KEYS)})\s*[:=,;\t ]\s*(.*)")


@dataclass(frozen=True)
class Notes:
    """The lines above a table.

    Attributes:
        entries: `# key: value`.
        comments: Other comments.
        passed: What was passed over, in words.
        even: Times that the lines tell, where they do.
    """

    entries: tuple[Entry, ...]
    comments: tuple[Entry, ...]
    passed: tuple[str, ...]
    even: Even | None


def header_notes(file: str, layout: Layout, titles: Titles) -> Notes:
    """The lines above a table, sorted.

    Raises:
        BadFile: A condition in a line that is no comment, which would be lost.
    """
    entries, comments, others = [], [], []
    header: dict[str, tuple[str, str]] = {}
    marked = [line for _, line in layout.above if is_comment(line, layout.mark)]
    all_padded = bool(marked) and all(_padded(line, layout.mark) != line.strip() for line in marked)
    for number, line in layout.above:
        place = f"{file}, row {number}"
        if is_comment(line, layout.mark):
            bare = _unquoted(line, layout.mark)
            short = _padded(bare, layout.mark)
            found = entry("#" + short.lstrip("#%;/! \t"), place)
            if found is not None and not all_padded and found.key not in (*CONDITION_KEYS, "outcome"):
                found = entry("#" + bare.lstrip("#%;/! \t"), place)
            if found is not None:
                entries.append(found)
            else:
                comments.append(Entry("", short.lstrip("#%;/! \t"), place))
            header |= _entries([short.lstrip("#%;/! \t")], f"row {number}")
        elif titles.line is None or titles.first is None or not titles.first <= number <= layout.start:
            lost = _CONDITION.match(line)
            if lost is not None:
                raise BadFile(
                    place,
                    found=f"`{brief(line.strip(), 40)}`",
                    expected=f"`# {lost[1]}: value`",
                    remedy=f"Begin the line with `#`: `# {lost[1]}: {brief(lost[2].strip(layout.mark), 20)}`.",
                )
            others.append((number, line))
            header |= _entries(split(line, layout.mark), f"row {number}")
    return Notes(tuple(entries), tuple(comments), _shown(others), even_of(header))


def even_of(header: dict[str, tuple[str, str]]) -> Even | None:
    """Even times from what is told of them, None where no step is."""
    start = next((number for key in FIRSTS if (number := _seconds(header, key)) is not None), 0.0)
    for key in (*STEPS, *RATES):
        number = _seconds(header, key, inverse=key in RATES)
        if number is not None and number > 0:
            value, place = header[key]
            return Even(start, number, f"`{key}` {value} at {place}")
    return None


def _seconds(header: dict[str, tuple[str, str]], key: str, *, inverse: bool = False) -> float | None:
    """A time that is told, in seconds; of a rate, one over it."""
    text = header[key][0] if key in header else ""
    if text.count(",") == 1 and "." not in text:  # a step is never in thousands
        text = text.replace(",", ".")
    found = _VALUE.fullmatch(text)
    if found is None:
        return None
    number, unit = float(found[1]), found[len(found.groups())]
    if inverse:
        factor = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "fps": 1.0}.get(unit.lower())
        return None if factor is None or number <= 0 else 1 / (number * factor)
    dimension, factor = ("time", 1.0) if unit == "" else known_factor(unit) or ("", 0.0)
    return number * factor if dimension == "time" else None


def _entries(cells: Sequence[str], place: str) -> dict[str, tuple[str, str]]:
    """A key with its value from the cells of a line, or from `key: value`."""
    filled = [cell.strip('" ') for cell in cells if cell.strip('" ')]
    if len(filled) == 1:
        found = _FACT.fullmatch(filled[0]) if len(filled[0]) < 200 else None
        filled = [] if found is None else [found[1], found[2]]
    if len(filled) < 2:
        return {}
    key, value = filled[0].rstrip(": ").lower(), filled[1]
    unit = re.fullmatch(r"(.*?)\s*[\[(](.*)[\])]", key)
    if unit is not None:
        key, value = unit[1], value + unit[2]
    return {key: (value, place)}


def _unquoted(line: str, mark: str) -> str:
    return split(line, "," if mark == BLANKS else mark)[0] if line.lstrip().startswith('"') else line.strip()


def _padded(line: str, mark: str) -> str:
    """A comment without the separators that a spreadsheet puts behind it."""
    return line.strip().rstrip(mark + " \t") if mark != BLANKS else line.strip()


def _shown(lines: Sequence[tuple[int, str]]) -> tuple[str, ...]:
    found = [f"row {number}: {brief(line.strip(), 60)}" for number, line in lines[:SHOWN]]
    return (*found, *([f"{len(lines) - SHOWN} more lines above the table"] if len(lines) > SHOWN else []))

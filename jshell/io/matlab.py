"""Columns in MATLAB's `.mat`, version 5 to 7.

Every column is a variable, or a field of a structure: `ScopeData.time` is the
column `time`, and of a matrix in a structure every column is one. MATLAB's names hold no brackets: units stand in a
text `units` of lines `V: mm^3`, settings in a text `settings`. SciPy writes;
reading is done here, because SciPy 1.17 ends the whole process on some spoiled
files, and because every length must be checked before memory is asked for.

Source     MAT-File Format, The MathWorks, chapter 1 (level 5)
"""

import io as streams
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jshell.errors import BadFile
from jshell.files import NamedBytes
from jshell.io.arrays import SETTINGS, UNITS, check_array, refuse_names, settings_text, sheet_of
from jshell.io.choices import Reading
from jshell.io.files import LIMIT, SPOILED, check_size, spoiled
from jshell.io.headers import CONDITION_KEYS
from jshell.io.sheets import Sheet

WORDS = "MATLAB file of version 5 to 7"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")
HEADER = 128  # bytes
MATRIX, COMPRESSED, UTF8 = 14, 15, 16
CHAR, STRUCTURE = 4, 2
DEEPEST, MOST_FIELDS = 4, 64  # structures in structures; fields of one, columns of a matrix
COMPLEX, LOGICAL = 0x800, 0x200  # bits of a matrix's flags
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_LETTERS = {1: "latin-1", 2: "latin-1", 4: "utf-16", UTF8: "utf-8", 17: "utf-16", 18: "utf-32"}
_CLASSES = {1: "O", STRUCTURE: "O", 3: "O", CHAR: "U", 5: "O", 6: "f", 7: "f"}
_CLASSES |= {number: "iu"[number % 2] for number in range(8, 16)}


@dataclass(frozen=True)
class _Element:
    kind: int
    data: memoryview


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of a `.mat` file.

    Raises:
        BadFile: No such file, of version 7.3, cells, one array with several columns, or too large.
    """
    raw = memoryview(file.content)
    if bytes(raw[:10]) != b"MATLAB 5.0":
        raise BadFile(
            file.name,
            found="another file, or MATLAB's version 7.3 or 4",
            expected=f"a {WORDS}",
            remedy="In MATLAB, save it with `save('trace.mat', 't', 'V', '-v7')`.",
        )
    found: dict[str, np.ndarray] = {}
    for name, values in _shortened(list(_variables(file.name, raw))):
        if name in found:
            raise BadFile(
                f"{file.name}, variable `{name}`",
                found="the name twice",
                expected="every name once",
                remedy="Save it again.",
            )
        found[name] = values
    return sheet_of(file.name, found.items(), choices, required)


def encode(sheet: Sheet) -> bytes:
    """Columns, conditions and settings as variables, numbers bit for bit.

    Raises:
        BadName: A name that is no MATLAB variable, or that a condition has.
    """
    taken = (*CONDITION_KEYS, "outcome", SETTINGS, UNITS)
    bad = [name for name in sheet.names if name in taken or not NAME.fullmatch(name)]
    refuse_names(sheet, bad, "letters, digits and underscores, 31 at most, and no condition's name")
    variables: dict[str, Any] = {item.key: float(item.value) for item in sheet.entries if item.key in CONDITION_KEYS}
    variables |= {item.key: item.value for item in sheet.entries if item.key == "outcome"}
    rest = [item for item in sheet.entries if item.key not in variables]
    if rest:
        variables[SETTINGS] = settings_text(rest)
    if any(unit is not None for unit in sheet.units):
        variables[UNITS] = "\n".join(f"{name}: {unit}" for name, unit in zip(sheet.names, sheet.units, strict=True))
    variables |= dict(zip(sheet.names, sheet.columns, strict=True))
    from scipy.io import savemat  # here: it is slow to load, and few need it

    made = streams.BytesIO()
    savemat(made, variables, oned_as="column")
    return made.getvalue()


def _variables(source: str, raw: memoryview) -> Iterator[tuple[str, np.ndarray]]:
    order = {b"IM": "<", b"MI": ">"}.get(bytes(raw[126:HEADER]))
    if order is None:
        raise spoiled(source, WORDS, "no mark of the byte order in its header")
    total = 0
    try:
        for element in _elements(raw[HEADER:], order):
            if element.kind == COMPRESSED:
                packed = zlib.decompressobj()
                data = packed.decompress(element.data, LIMIT - total + 1)
                total += len(data)
                check_size(source, total)
                element = _next(_elements(memoryview(data), order))
            if element.kind != MATRIX:
                raise ValueError(f"an element of type {element.kind} where a variable should stand")
            yield from _found(source, element.data, order, "", 0)
    except BadFile:
        raise
    except SPOILED as error:
        raise spoiled(source, WORDS, error) from None


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """The elements that follow each other in a stretch of bytes."""
    at = 0
    while at < len(data):
        first, size = (int(number) for number in np.frombuffer(data[at : at + 8], order + "u4", 2))
        if first >> 16:  # four bytes at most, beside their tag
            kind, size, start, end = first & 0xFFFF, first >> 16, at + 4, at + 8
        else:
            kind, start = first, at + 8
            end = start + size + (-size % 8 if kind != COMPRESSED else 0)
        if start + size > min(len(data), end):
            raise ValueError(f"{size} bytes claimed where {max(min(len(data), end) - start, 0)} are left")
        yield _Element(kind, data[start : start + size])
        at = end


def _next(parts: Iterator[_Element]) -> _Element:
    """What follows; `next` would end the generator around it, which Python calls a fault of the program."""
    for part in parts:
        return part
    raise ValueError("nothing where an element should stand")


def _found(source: str, data: memoryview, order: str, prefix: str, depth: int) -> Iterator[tuple[str, np.ndarray]]:
    """The columns and words of one variable, or of the fields of a structure."""
    parts = _elements(data, order)
    flags = int(np.frombuffer(_next(parts).data, order + "u4", 2)[0])
    shape = [int(size) for size in np.frombuffer(_next(parts).data, order + "i4")]
    name = prefix or bytes(_next(parts).data).decode("ascii")
    if not name:  # MATLAB keeps what belongs to functions under no name
        return
    if prefix:
        _next(parts)  # a field's own name is empty
    if min(shape, default=-1) < 0:
        raise ValueError(f"the shape {tuple(shape)}")
    kind = _CLASSES.get(flags & 0xFF, "O")
    kind = "b" if flags & LOGICAL else "c" if flags & COMPLEX else kind
    if flags & 0xFF == STRUCTURE and shape == [1, 1] and depth < DEEPEST:
        width = int(np.frombuffer(_next(parts).data, order + "i4", 1)[0])
        names = bytes(_next(parts).data)
        if width < 1 or len(names) > width * MOST_FIELDS:
            raise ValueError(f"names of {width} letters in the structure `{name}`")
        for at in range(0, len(names), width):
            field = names[at : at + width].partition(b"\0")[0].decode("ascii")
            inside = _next(parts)
            if inside.data:
                yield from _found(source, inside.data, order, f"{name}.{field}", depth + 1)
        return
    wide = len(shape) == 2 and min(shape) > 1 and shape[1] <= MOST_FIELDS and kind in "fiu" and depth > 0
    if depth > 0 and (kind not in "fiuU" or (sum(size != 1 for size in shape) > 1 and not wide)):
        return  # a structure may hold anything beside its columns
    check_array(
        f"{source}, variable `{name}`", [1] if kind == "U" else [shape[0] * shape[1]] if wide else shape, kind, 8
    )
    part = next(parts, _Element(9, memoryview(b"")))
    if kind == "U":
        yield name, np.asarray(_letters(part, shape, order))
        return
    values = np.frombuffer(part.data, order + _NUMBERS[part.kind])
    if values.size != int(np.prod(shape, dtype=object)):
        raise ValueError(f"variable `{name}` has {values.size} numbers for a shape {tuple(shape)}")
    if wide:
        for k, column in enumerate(values.reshape(shape[::-1]), 1):  # MATLAB counts down the columns
            yield f"{name}.{k}", column
    else:
        yield name, values.reshape(shape)


def _shortened(found: list[tuple[str, np.ndarray]]) -> list[tuple[str, np.ndarray]]:
    """Fields without the name of their structure, where no two then have the same."""
    bare = [name.partition(".")[2] or name for name, _ in found]
    if len(set(bare)) < len(bare):
        return found
    return [(name, values) for name, (_, values) in zip(bare, found, strict=True)]


def _letters(part: _Element, shape: Sequence[int], order: str) -> str:
    """A text; one line per row of the letters."""
    codec = _LETTERS[part.kind]
    if codec not in ("latin-1", "utf-8"):
        codec += "-le" if order == "<" else "-be"
    text = bytes(part.data).decode(codec)
    rows = shape[0] if shape else 1
    if rows > 1 and len(text) == rows * shape[1]:
        return "\n".join(text[row::rows].rstrip() for row in range(rows))
    return text

"""The formats of columns by the suffix of a file's name.

What has no suffix of the list is read as text: laboratories call CSV by many
names. What is not text says so itself, and says what it looks like.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath

from jshell.errors import BadName
from jshell.files import NamedBytes, Source
from jshell.io import archives, matlab, netcdf, objects, text
from jshell.io.files import read_bytes, write_bytes
from jshell.io.sheets import Sheet


@dataclass(frozen=True)
class Format:
    """How files of one suffix are read and written."""

    read: Callable[[NamedBytes, Sequence[str]], Sheet]
    encode: Callable[[Sheet], bytes]


_COMMAS = Format(text.read, text.encode)
_TABS = Format(text.read, partial(text.encode, mark="\t"))
_NETCDF = Format(netcdf.read, netcdf.encode)
FORMATS = {
    ".csv": _COMMAS,
    ".txt": _COMMAS,
    ".dat": _COMMAS,
    "": _COMMAS,
    ".tsv": _TABS,
    ".tab": _TABS,
    ".json": Format(objects.read, objects.encode),
    ".nc": _NETCDF,
    ".nc4": _NETCDF,
    ".mat": Format(matlab.read, matlab.encode),
    ".npz": Format(archives.read, archives.encode),
}


def read_sheet(source: Source, required: Sequence[str] = ()) -> Sheet:
    """A file of columns as it stands, with at least the columns required.

    Raises:
        BadFile: Not a file of columns of its format.
        BadName: A required column is missing.
        BadValue: A number that is NaN or infinite.
    """
    file = read_bytes(source)
    return FORMATS.get(file.suffix, _COMMAS).read(file, required)


def check_suffix(path: str | Path, place: str = "") -> None:
    """Refuse a file's name whose suffix stands for no format.

    Raises:
        BadName: A suffix of no format.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise BadName(
            place or str(path),
            found=f"the suffix {suffix}",
            expected="one of " + ", ".join(known for known in FORMATS if known),
            remedy="Give the file a name that ends in one of them.",
        )


def encode_sheet(sheet: Sheet) -> NamedBytes:
    """The file that a sheet describes, in the format of its name's suffix.

    Raises:
        BadName: A suffix of no format, or a name that the format cannot hold.
    """
    check_suffix(sheet.file)
    return NamedBytes(sheet.file, FORMATS[PurePath(sheet.file).suffix.lower()].encode(sheet))


def write_sheet(sheet: Sheet) -> None:
    """Write columns into the file that the sheet names.

    Raises:
        BadFile: The file cannot be written.
        BadName: As `encode_sheet`.
    """
    write_bytes(sheet.file, bytes(encode_sheet(sheet).content))

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
from jshell.io import archives, matlab, netcdf, objects, spreadsheets, tdms, text
from jshell.io.choices import Reading
from jshell.io.files import read_bytes, write_bytes
from jshell.io.sheets import Sheet


@dataclass(frozen=True)
class Format:
    """How files of one suffix are read and written."""

    read: Callable[[NamedBytes, Reading, Sequence[str]], Sheet]
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
READ_ONLY = {
    ".xlsx": Format(spreadsheets.read, spreadsheets.encode),
    ".xlsm": Format(spreadsheets.read, spreadsheets.encode),
    ".tdms": Format(tdms.read, tdms.encode),
}


def read_sheet(source: Source, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """A file of columns as it stands; a column that is required is one even with a single row.

    Raises:
        BadFile: Not a file of columns of its format.
        BadValue: A number that is NaN or infinite, where such rows are not to be dropped.
    """
    file = read_bytes(source)
    return (FORMATS | READ_ONLY).get(file.suffix, _COMMAS).read(file, choices, required)


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

"""The formats of columns by the suffix of a file's name.

What has no suffix of the list is read as text: laboratories call CSV by many
names. What is not text says so itself, and says what it looks like.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from jshell.errors import BadName
from jshell.io import archives, matlab, netcdf, objects, text
from jshell.io.files import check_file
from jshell.io.sheets import Sheet


@dataclass(frozen=True)
class Format:
    """How files of one suffix are read and written."""

    read: Callable[[Path, Sequence[str]], Sheet]
    write: Callable[[Path, Sheet], None]


_COMMAS = Format(text.read, text.write)
_TABS = Format(text.read, partial(text.write, mark="\t"))
_NETCDF = Format(netcdf.read, netcdf.write)
FORMATS = {
    ".csv": _COMMAS,
    ".txt": _COMMAS,
    ".dat": _COMMAS,
    "": _COMMAS,
    ".tsv": _TABS,
    ".tab": _TABS,
    ".json": Format(objects.read, objects.write),
    ".nc": _NETCDF,
    ".nc4": _NETCDF,
    ".mat": Format(matlab.read, matlab.write),
    ".npz": Format(archives.read, archives.write),
}


def read_sheet(path: str | Path, required: Sequence[str] = ()) -> Sheet:
    """A file of columns as it stands, with at least the columns required.

    Raises:
        BadFile: Not a file of columns of its format.
        BadName: A required column is missing.
        BadValue: A number that is NaN or infinite.
    """
    path = Path(path)
    check_file(path)
    return FORMATS.get(path.suffix.lower(), _COMMAS).read(path, required)


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


def write_sheet(sheet: Sheet) -> None:
    """Write columns into the file that the sheet names, in the format of its suffix.

    Raises:
        BadFile: The file cannot be written.
        BadName: A suffix of no format, or a name that the format cannot hold.
    """
    check_suffix(sheet.path)
    FORMATS[sheet.path.suffix.lower()].write(sheet.path, sheet)

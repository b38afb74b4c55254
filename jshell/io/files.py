"""A file before anyone looks inside: is it there, may it be read, is it of a size one can hold.

Only ordinary files are opened: a pipe may never end, a device certainly does
not. Sizes are checked before anything is allocated, those that a compressed or
binary file merely claims included.
"""

import difflib
import stat
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path

from jshell.errors import BadFile

LIMIT = 2**29  # bytes: of a file, and of the numbers that it claims to hold
# What the libraries that know a binary format raise on spoiled bytes: no word of theirs says where or why.
SPOILED = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NotImplementedError,  # zipfile, of a compression it does not know
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def check_file(path: Path) -> None:
    """Refuse what is no ordinary file of bearable size.

    Raises:
        BadFile: Missing, a directory, a pipe or device, not permitted, empty, or too large.
    """
    try:
        found = path.stat()
        kind = found.st_mode
        if stat.S_ISREG(kind):
            with path.open("rb"):
                pass
    except FileNotFoundError:
        raise BadFile(str(path), found="no such file", expected="a file", remedy=_nearby(path)) from None
    except (OSError, ValueError) as error:
        raise BadFile(
            repr(str(path)), found=str(error), expected="a readable file", remedy="Check name and permissions."
        ) from None
    if stat.S_ISDIR(kind):
        raise BadFile(str(path), found="a directory", expected="a file", remedy="Name a file inside it.")
    if not stat.S_ISREG(kind):
        raise BadFile(
            str(path), found="a pipe or a device", expected="an ordinary file", remedy="Save what it gives to a file."
        )
    if found.st_size == 0:
        raise BadFile(str(path), found="an empty file", expected="text", remedy="Check how the file was written.")
    check_size(str(path), found.st_size)


def check_size(place: str, size: float | int) -> None:
    """Refuse more bytes than one can hold."""
    if size > LIMIT:
        raise BadFile(
            place,
            found=f"{size / 2**30:.3g} GiB",
            expected=f"at most {LIMIT / 2**30:.3g} GiB",
            remedy="Keep every tenth row, or cut the record; if it should be small, the file is damaged.",
        )


def read_text(path: str | Path) -> str:
    """The text of a file, whatever its line ends and with or without a byte order mark.

    Raises:
        BadFile: Missing, a directory, unreadable, empty, too large, or not UTF-8 text.
    """
    path = Path(path)
    check_file(path)
    raw = path.read_bytes()
    if not raw.strip():
        raise BadFile(str(path), found="an empty file", expected="text", remedy="Check how the file was written.")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _not_text(path, raw, error.start) from None
    if "\0" in text:
        raise _not_text(path, raw, raw.index(b"\0"))
    return text.replace("\r\n", "\n").replace("\r", "\n")


def spoiled(path: Path, words: str, error: BaseException | str) -> BadFile:
    """The refusal of a file that the library of its format cannot read."""
    reason = str(error).strip() or type(error).__name__
    return BadFile(
        str(path),
        found=f"bytes that are no {words}: {short(reason, 160)}",
        expected=f"a {words}",
        remedy="Copy or write the file again; if its name has the wrong suffix, rename it.",
    )


def short(text: str, length: int = 40) -> str:
    """A piece of a file, quoted, on one line of bearable length."""
    return repr(brief(text, length))


def brief(text: str, length: int = 60) -> str:
    """A text cut to a bearable length."""
    return text if len(text) <= length else text[: length - 3] + "..."


def cannot_write(path: str | Path, error: OSError) -> BadFile:
    """The refusal of a file that cannot be written."""
    return BadFile(
        str(path), found=str(error), expected="a file that can be written", remedy="Check folder and permissions."
    )


# First bytes of files that are not text, in words, and what to do with them.
_SIGNATURES = (
    (b"PK\x03\x04", "a zip archive", "rename it `.npz` if NumPy wrote it; export a spreadsheet as CSV in UTF-8"),
    (b"\x89HDF", "an HDF5 file", "rename it `.nc` if it is NetCDF; save MATLAB files with `-v7`"),
    (b"MATLAB 5.0", "a MATLAB file", "rename it `.mat`"),
    (b"\x93NUMPY", "a single NumPy array", "save named arrays with `numpy.savez`, or write CSV"),
    (b"CDF", "a classic NetCDF file", "convert it with `nccopy -k nc4`, and name it `.nc`"),
    (b"\xff\xfe", "text in UTF-16", "save it as CSV in UTF-8"),
    (b"\xfe\xff", "text in UTF-16", "save it as CSV in UTF-8"),
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
)


def looks_like(raw: bytes) -> tuple[str, str] | None:
    """What a file is by its first bytes, and what to do with it; None where they say nothing."""
    return next(((words, remedy) for start, words, remedy in _SIGNATURES if raw.startswith(start)), None)


def first_bytes(path: Path) -> bytes:
    """The first sixteen bytes of a file."""
    with path.open("rb") as file:
        return file.read(16)


def _not_text(path: Path, raw: bytes, start: int) -> BadFile:
    line = raw.count(b"\n", 0, start) + 1
    known = looks_like(raw)
    found = f"byte 0x{raw[start]:02x}, which is not text"
    remedy = "Save the file as CSV in UTF-8; spreadsheets and NumPy files must be exported first."
    if known is not None:
        found, remedy = f"{found}: {known[0]}", f"To read it, {known[1]}."
    return BadFile(f"{path}, row {line}", found=found, expected="UTF-8 text", remedy=remedy)


def _nearby(path: Path) -> str:
    """What to try when a file is missing."""
    if not path.parent.is_dir():
        return f"There is no folder {path.parent} either; check the path."
    try:
        names = [found.name for found in path.parent.iterdir()]
    except OSError:  # a folder that may be entered but not listed
        names = []
    near = difflib.get_close_matches(path.name, names)
    return f"Did you mean {', '.join(near)}?" if near else "Check the path."

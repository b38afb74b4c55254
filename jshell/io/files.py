"""A file before anyone looks inside: is it there, may it be read, is it of a size one can hold.

Only ordinary files are opened: a pipe may never end, a device certainly does
not. Sizes are checked before anything is allocated, those that a compressed or
binary file merely claims included. Beyond this page a file is a name with
bytes, wherever it came from.
"""

import difflib
import stat
import struct
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

from jshell.errors import BadFile
from jshell.files import NamedBytes, Source

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
    _check_bytes(str(path), found.st_size)


def _check_bytes(name: str, size: int) -> None:
    if size == 0:
        raise BadFile(name, found="an empty file", expected="text", remedy="Check how the file was written.")
    check_size(name, size)


def check_size(place: str, size: float | int) -> None:
    """Refuse more bytes than one can hold."""
    if size > LIMIT:
        raise BadFile(
            place,
            found=f"{size / 2**30:.3g} GiB",
            expected=f"at most {LIMIT / 2**30:.3g} GiB",
            remedy="Keep every tenth row, or cut the record; if it should be small, the file is damaged.",
        )


def read_bytes(source: Source) -> NamedBytes:
    """A file with its bytes, from the disk unless they are here; its name is the path as it was given.

    Raises:
        BadFile: Missing, a directory, unreadable, empty, or too large.
    """
    if isinstance(source, NamedBytes):
        _check_bytes(source.name, len(source.content))
        return source
    path = Path(source)
    check_file(path)
    return NamedBytes(str(path), path.read_bytes())


def read_text(source: Source) -> str:
    """The text of a file, whatever its line ends and with or without a byte order mark.

    Raises:
        BadFile: Missing, a directory, unreadable, empty, too large, or not UTF-8 text.
    """
    file = read_bytes(source)
    raw = bytes(file.content)
    if not raw.strip():
        raise BadFile(file.name, found="an empty file", expected="text", remedy="Check how the file was written.")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _not_text(file.name, raw, error.start) from None
    if "\0" in text:
        raise _not_text(file.name, raw, raw.index(b"\0"))
    return text.replace("\r\n", "\n").replace("\r", "\n")


MOST_FOREIGN = 0.2  # of a text's bytes beyond ASCII: more are no instrument's µ and °
_PROBE = 4096  # bytes that tell UTF-16 without a mark


def in_utf8(file: NamedBytes) -> tuple[NamedBytes, str | None]:
    """A text in UTF-8, whatever Windows' programs have written, and what it was taken for; None where it is UTF-8.

    UTF-16 is told by its mark, or by zeros at every other byte. What is no UTF-8 but plain text beside a few letters
    is Windows-1252, of which Latin-1 is a part. Anything else stays as it is, for the reader to place its refusal.

    Source     Unicode Standard 3.10 (byte order marks); WHATWG Encoding, windows-1252
    """
    raw = bytes(file.content)
    if raw.isascii() and b"\0" not in raw[:_PROBE]:
        return file, None
    codec = _utf16(raw)
    if codec is None:
        try:
            raw.decode("utf-8")
            return file, None
        except UnicodeDecodeError:
            plain = raw.translate(None, bytes(range(0x80, 0x100)))
            control = plain.translate(None, bytes(range(0x20, 0x80)) + b"\t\n\r\f")
            if control or len(plain) < (1 - MOST_FOREIGN) * len(raw):
                return file, None
            codec = "cp1252"
    try:
        text = raw.decode(codec)
    except UnicodeDecodeError:
        return file, None
    words = "UTF-16" if codec != "cp1252" else "Windows-1252 (Latin-1)"
    return NamedBytes(file.name, text.lstrip("\ufeff").encode()), f"the text is {words}"


def _utf16(raw: bytes) -> str | None:
    """The codec of a text in UTF-16; None where it is none."""
    if raw.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):  # UTF-32
        return None
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    head = raw[: min(_PROBE, len(raw) // 2 * 2)]
    first, second = head[::2], head[1::2]
    zeros = first.count(0), second.count(0)
    if 2 * max(zeros) <= len(first) or min(zeros):
        return None
    return "utf-16-le" if zeros[1] else "utf-16-be"


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a file.

    Raises:
        BadFile: Nothing can be written there.
    """
    try:
        Path(path).write_bytes(content)
    except OSError as error:
        raise BadFile(
            str(path), found=str(error), expected="a file that can be written", remedy="Check folder and permissions."
        ) from None


def bytes_written(name: str, write: Callable[[Path], object]) -> bytes:
    """What `write` writes into a file of this name: for libraries that know no other place than a disk."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def spoiled(name: str, words: str, error: BaseException | str) -> BadFile:
    """The refusal of a file that the library of its format cannot read."""
    reason = str(error).strip() or type(error).__name__
    return BadFile(
        name,
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


# First bytes of files that are not text, in words, and what to do with them.
_SIGNATURES = (
    (
        b"PK\x03\x04",
        "a zip archive",
        "rename it `.npz` if NumPy wrote it, `.xlsx` if a spreadsheet did; or export it as CSV in UTF-8",
    ),
    (b"\x89HDF", "an HDF5 file", "rename it `.nc` if it is NetCDF; save MATLAB files with `-v7`"),
    (b"MATLAB 5.0", "a MATLAB file", "rename it `.mat`"),
    (b"\x93NUMPY", "a single NumPy array", "save named arrays with `numpy.savez`, or write CSV"),
    (b"TDSm", "an NI file", "rename it `.tdms`"),
    (b"CDF", "a classic NetCDF file", "convert it with `nccopy -k nc4`, and name it `.nc`"),
    (b"\xff\xfe", "a text in UTF-16 or UTF-32 that breaks off", "save it as CSV in UTF-8"),
    (b"\xfe\xff", "a text in UTF-16 that breaks off", "save it as CSV in UTF-8"),
    (b"\x1f\x8b", "a gzip archive", "unpack it first"),
)


def looks_like(raw: bytes) -> tuple[str, str] | None:
    """What a file is by its first bytes, and what to do with it; None where they say nothing."""
    return next(((words, remedy) for start, words, remedy in _SIGNATURES if raw.startswith(start)), None)


def _not_text(name: str, raw: bytes, start: int) -> BadFile:
    line = raw.count(b"\n", 0, start) + 1
    known = looks_like(raw)
    found = f"byte 0x{raw[start]:02x}, which is not text"
    remedy = "Save the file as CSV in UTF-8; spreadsheets and NumPy files must be exported first."
    if known is not None:
        found, remedy = f"{found}: {known[0]}", f"To read it, {known[1]}."
    return BadFile(f"{name}, row {line}", found=found, expected="UTF-8 text", remedy=remedy)


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

"""Arrays and files in one archive: written with one copy, read by zipfile and NumPy.

`np.savez` copies every array three times. The bytes are the same.

Source     Python `zipfile`; NumPy `numpy.lib.format`, the NPY format
"""

import contextlib
import io as streams
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.lib import format as npy

from jshell.errors import BadFile
from jshell.io.files import SPOILED, check_size

Content = bytes | memoryview  # what a file holds, or where that lies
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


class _Looked(streams.RawIOBase):
    """A file that is looked at where it lies: `BytesIO` would copy what is not bytes."""

    def __init__(self, content: Content) -> None:
        self._bytes, self._at = memoryview(content), 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = 0) -> int:
        at = offset + (0, self._at, len(self._bytes))[whence]
        if at < 0:
            raise OSError("before the begin of the file")
        self._at = at
        return at

    def readinto(self, buffer: Any) -> int:
        found = self._bytes[self._at : self._at + len(buffer)]
        buffer[: len(found)] = found
        self._at += len(found)
        return len(found)


class _Pieces:
    """A file kept as what was written to it, uncopied; a piece is written again only where it began."""

    def __init__(self) -> None:
        self.all: dict[int, bytes | memoryview] = {}
        self.at = 0

    def tell(self) -> int:
        return self.at

    def seek(self, at: int) -> None:
        self.at = at

    def write(self, piece: bytes | memoryview) -> int:
        self.all[self.at] = piece
        self.at += len(piece)
        return len(piece)

    def flush(self) -> None: ...


def pack(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Arrays as `np.savez` writes them, each copied once."""
    pieces = _Pieces()
    with zipfile.ZipFile(pieces, "w") as archive:  # pyright: ignore # it asks for no more of a file
        for name, array in arrays.items():
            whole = np.ascontiguousarray(array).reshape(array.shape)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                head = streams.BytesIO()
                npy.write_array_header_1_0(head, npy.header_data_from_array_1_0(whole))
                member.write(head.getvalue())
                member.write(whole.reshape(-1).view(np.uint8).data)
    return b"".join(pieces.all.values())


def unpack(content: Content, name: str, *, heads: Collection[str] = ()) -> dict[str, np.ndarray]:
    """Arrays of an archive.

    Of `heads` only the shapes are read: they are zeros, which take no memory.

    Raises:
        BadFile: No archive of plain arrays, a damaged one, or too large.
    """
    blank = tuple(f"{one}.npy" for one in heads)
    with opened(content, name) as archive:
        return {
            one.filename.removesuffix(".npy"): (_blank if one.filename in blank else array)(archive, one)
            for one in archive.infolist()
            if one.filename.endswith(".npy")
        }


@contextlib.contextmanager
def opened(content: Content, name: str) -> Iterator[zipfile.ZipFile]:
    """An archive to read from, whose sizes are known to be bearable.

    Raises:
        BadFile: No archive, a damaged one, or too large.
    """
    try:
        with zipfile.ZipFile(streams.BytesIO(content) if isinstance(content, bytes) else _Looked(content)) as archive:
            check_size(name, sum(member.file_size for member in archive.infolist()))
            yield archive
    except BadFile:
        raise
    except SPOILED as error:
        raise BadFile(
            name,
            found=f"no archive that can be read ({str(error) or type(error).__name__})",
            expected="arrays in .npz, or trace files in .zip",
            remedy="Write it again.",
        ) from None


def _blank(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    shape, kind, _ = head(archive, member)
    return np.broadcast_to(np.zeros((), kind), shape)


def head(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[tuple[int, ...], np.dtype, int]:
    """Shape and kind of an array, and how many bytes follow.

    Raises:
        ValueError, EOFError, zipfile.BadZipFile: It is none, or spoiled.
    """
    with archive.open(member) as file:
        version = npy.read_magic(file)
        if version not in _HEADERS:
            raise ValueError(f"version {version} of the format")
        shape, _, kind = _HEADERS[version](file)
        return shape, kind, member.file_size - file.tell()


def array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    """An array of an archive; what it claims to hold is compared with what there is before memory is asked for.

    Raises:
        ValueError, EOFError, zipfile.BadZipFile: It is none, or spoiled.
    """
    shape, kind, held = head(archive, member)
    claimed = int(np.prod(shape, dtype=object)) * kind.itemsize
    if claimed != held:
        raise zipfile.BadZipFile(f"{member.filename} holds {held} bytes for a claim of {claimed}")
    with archive.open(member) as file:
        return npy.read_array(file, allow_pickle=False)


def names(content: Content, name: str) -> set[str]:
    """Names of the arrays of an archive.

    Raises:
        BadFile: As `opened`.
    """
    with opened(content, name) as archive:
        return {member.removesuffix(".npy") for member in archive.namelist()}


def files(name: str, content: Content) -> list[tuple[str, bytes]]:
    """Name and bytes of every file of an archive.

    Raises:
        BadFile: As `opened`.
    """
    with opened(content, name) as archive:
        found = [member for member in archive.infolist() if not member.is_dir()]
        return [(PurePath(member.filename).name, archive.read(member)) for member in found]


def pack_files(given: Sequence[tuple[str, bytes]]) -> bytes:
    """Files as one archive, not compressed; a name that stands there before is numbered."""
    pieces, seen = _Pieces(), set()
    with zipfile.ZipFile(pieces, "w") as archive:  # pyright: ignore # it asks for no more of a file
        for number, (name, content) in enumerate(given):
            archive.writestr(f"{number}/{name}" if name in seen else name, content)
            seen.add(name)
    return b"".join(pieces.all.values())

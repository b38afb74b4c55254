"""Films of single pictures, in a folder or packed into a .zip, in the order of the numbers in their names.

Of an archive nothing is unpacked: a picture is read when its frame is asked for, and what it claims is checked first.
"""

import contextlib
import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import IO

import numpy as np
from jaxtyping import Float

from jshell.camera.forms import EXTRA, Film, check_form, grey, white_of
from jshell.errors import BadFile, require_extra
from jshell.io.files import SPOILED, check_file, spoiled

PICTURES = (".png", ".tif", ".tiff", ".bmp", ".pgm")
MOST_BYTES = 2**28  # of one picture in an archive
MOST_PACKED = 2**32  # of all of them together


def folder(path: Path) -> Film:
    """The pictures of a folder.

    Raises:
        BadFile: None, of different sizes, or too large.
        MissingExtra: The extra `camera` is not installed.
    """
    names = [one for one in path.iterdir() if is_picture(one)]
    names.sort(key=_numbered)
    return _film(str(path), [str(one) for one in names], lambda number: names[number].open("rb"))


def packed(path: Path) -> Film:
    """The pictures of a .zip.

    Raises:
        BadFile: As `folder`; no archive, or one of more than 4 GiB.
        MissingExtra: The extra `camera` is not installed.
    """
    check_file(path)
    try:
        archive = zipfile.ZipFile(path)
    except SPOILED as error:
        raise spoiled(str(path), ".zip of pictures", error) from None
    held = [(PurePosixPath(one.filename), one) for one in archive.infolist() if is_picture(PurePosixPath(one.filename))]
    held.sort(key=lambda pair: _numbered(pair[0]))
    total = sum(one.file_size for _, one in held)
    if total > MOST_PACKED or any(one.file_size > MOST_BYTES for _, one in held):
        archive.close()
        raise BadFile(
            str(path),
            found=f"{total / 2**30:.3g} GiB of pictures, unpacked",
            expected=f"at most {MOST_PACKED / 2**30:.3g} GiB, {MOST_BYTES / 2**20:.3g} MiB each",
            remedy="Cut the film; if it should be small, the archive is damaged.",
        )

    def opened(number: int) -> IO[bytes]:
        # no more than the member claims is ever read of it
        return io.BytesIO(archive.read(held[number][1]))

    with contextlib.ExitStack() as until_read:
        until_read.callback(archive.close)
        film = _film(str(path), [f"{path}, {name}" for name, _ in held], opened, archive.close)
        until_read.pop_all()  # the film closes it from here on
    return film


def is_picture(path: Path | PurePosixPath) -> bool:
    """Whether a name is that of a picture, and not of what systems put beside it."""
    hidden = path.name.startswith(".") or "__MACOSX" in path.parts
    return path.suffix.lower() in PICTURES and not hidden


def _film(
    name: str, places: list[str], opened: Callable[[int], IO[bytes]], close: Callable[[], None] = lambda: None
) -> Film:
    library = require_extra("PIL.Image", EXTRA, "pictures")
    broken = (*SPOILED, library.DecompressionBombError, library.DecompressionBombWarning)
    if not places:
        raise BadFile(
            name,
            found="no pictures",
            expected="pictures " + ", ".join(PICTURES),
            remedy="Name the folder or the archive that holds the frames.",
        )

    def raw(number: int) -> np.ndarray:
        try:
            with opened(number) as file, library.open(file) as picture:
                check_form(places[number], len(places), picture.size)
                if getattr(picture, "n_frames", 1) > 1:
                    raise BadFile(
                        places[number],
                        found=f"a film of {picture.n_frames} frames",
                        expected="single pictures",
                        remedy="Give that file by itself.",
                    )
                return np.asarray(picture)
        except BadFile:
            raise
        except broken as error:
            raise spoiled(places[number], "picture", error) from None

    first = raw(0)
    shape = (int(first.shape[0]), int(first.shape[1]))
    read = lambda number: grey(str(places[number]), raw(number), shape)  # noqa: E731
    return Film(name, len(places), shape, white_of(first.dtype, float(first.max())), read, close)


def _numbered(path: Path | PurePosixPath) -> tuple[list[int], str]:
    """Pictures in the order of the numbers in their names: 2 before 10."""
    return [int(part) for part in re.findall(r"\d{1,18}", path.stem)], path.name


def one_picture(path: Path) -> Float[np.ndarray, "rows columns"]:
    """A single picture as grey values.

    Raises:
        BadFile: No picture, or too large.
        MissingExtra: The extra `camera` is not installed.
    """
    check_file(path)
    library = require_extra("PIL.Image", EXTRA, "pictures")
    try:
        with library.open(path) as picture:
            check_form(str(path), 1, picture.size)
            return grey(str(path), np.asarray(picture))
    except BadFile:
        raise
    except (*SPOILED, library.DecompressionBombError, library.DecompressionBombWarning) as error:
        raise spoiled(str(path), "picture", error) from None

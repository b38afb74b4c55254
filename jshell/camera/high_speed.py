"""Films of high-speed cameras: Photron `.cih` or `.cihx` with `.mraw`, Phantom `.cine`; monochrome, not compressed.

Both hold bare pixels beside a header that knows rate, exposure and true depth.
pyMRAW (GPL, numba) and pims trust such headers; here every size is compared with
the file's own before it is used.

Source     Photron's headers as PFV writes them; Vision Research, Cine File Format
"""

import re
import struct
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float

from jshell.camera.forms import Film, check_form, grey
from jshell.errors import BadFile
from jshell.io.files import check_file

HEADERS = (".cih", ".cihx", ".mraw")
MOST_NUMBER = 1e12  # nothing that a header counts is larger
LONGEST_HEADER = 2**20  # bytes of a Photron header
# What a `.cihx` calls the lines of a `.cih`.
TAGS = {
    "recordRate": "Record Rate(fps)", "shutterSpeed": "Shutter Speed(s)", "totalFrame": "Total Frame",
    "width": "Image Width", "height": "Image Height", "bit": "Color Bit", "type": "Color Type",
    "depth": "EffectiveBit Depth", "side": "EffectiveBit Side", "skipFrame": "Save Step", "saveStep": "Save Step",
}  # fmt: skip


def photron(path: Path) -> Film:
    """A film of a Photron camera, by its header or its pixels.

    Raises:
        BadFile: A header or pixels missing, or at odds with each other; colours.
    """
    where = str(path)
    header = next((path.with_suffix(one) for one in HEADERS[:2] if path.with_suffix(one).exists()), None)
    if header is None:
        raise BadFile(where, found="no .cih or .cihx beside it", expected="the camera's header", remedy="Copy both.")
    fields, pixels = _photron_header(header), path.with_suffix(".mraw")
    count, rows, columns, bits = (
        int(_number(header, fields, name, 1.0)) for name in ("Total Frame", "Image Height", "Image Width", "Color Bit")
    )
    check_form(where, count, (rows, columns))
    if bits not in (8, 12, 16) or "mono" not in fields.get("Color Type", "mono").lower():
        raise BadFile(
            where,
            found=f"{fields.get('Color Type', '')} {bits} bits a pixel",
            expected="grey values of 8, 12 or 16 bits",
            remedy="Save the film as monochrome MRAW, or as TIFF pictures.",
        )
    size = rows * columns * bits // 8
    _held(pixels, count * size)
    rate = _number(header, fields, "Record Rate(fps)", 1e-6)
    step = _number(header, fields, "Save Step", 1.0) if "Save Step" in fields else 1.0
    depth = int(_number(header, fields, "EffectiveBit Depth", 1.0)) if "EffectiveBit Depth" in fields else bits
    raised = "high" in fields.get("EffectiveBit Side", "lower").lower()
    file = open(pixels, "rb")  # noqa: SIM115  (the film closes it)

    def read(number: int) -> Float[np.ndarray, "rows columns"]:
        file.seek(number * size)
        raw = np.frombuffer(file.read(size), "<u2" if bits == 16 else "u1")
        values = _twelve(raw) if bits == 12 else raw
        if raised and depth < bits:
            values = values >> (bits - depth)
        return grey(f"{pixels}, frame {number + 1}", values.reshape(rows, columns))

    return Film(
        str(pixels), count, (rows, columns), 2.0 ** min(depth, bits) - 1, read, file.close,
        np.arange(count) * step / rate, _exposure(fields.get("Shutter Speed(s)", "")),
    )  # fmt: skip


def phantom(path: Path) -> Film:
    """A film of a Phantom camera; its times are the frames' own stamps where it has them.

    Raises:
        BadFile: No Cine file, colours, compressed or packed pixels, or a file that ends before its last frame.
    """
    check_file(path)
    where, length = str(path), path.stat().st_size
    with ExitStack() as opened:  # closes the file where what follows raises; else the film does
        file = opened.enter_context(open(path, "rb"))

        def unpack(form: str, at: int) -> tuple[Any, ...]:
            size = struct.calcsize("<" + form)
            if not 0 <= at <= length - size:
                raise BadFile(
                    where, found=f"a reference to byte {at} of {length}", expected="a Cine file", remedy=AGAIN
                )
            file.seek(at)
            return struct.unpack("<" + form, file.read(size))

        mark, _, compression, _, _, _, _, count, bitmap, setup, offsets = unpack("2sHHHiIiIIII", 0)
        if mark != b"CI" or compression != 0:
            raise BadFile(where, found=f"{mark!r}, compression {compression}", expected="a raw Cine", remedy=AGAIN)
        columns, rows, _, bits = unpack("iiHH", bitmap + 4)
        check_form(where, count, (abs(rows), columns))
        (rate,), (exposure,), (depth,) = (unpack("I", setup + at) for at in (FRAME_RATE, SHUTTER_NS, REAL_DEPTH))
        starts = unpack(f"{count}Q", offsets)
        size = abs(rows) * columns * bits // 8
        (colours,) = unpack("I", setup + COLOURS)
        first = _pixels(unpack, where, starts[0])
        if bits not in (8, 16) or colours != 0 or first[1] != size:
            raise BadFile(
                where,
                found=f"{bits} bits a pixel in {first[1]} bytes a frame, colour filter {colours}",
                expected=f"grey values of 8 or 16 bits in {size} bytes",
                remedy="Save the film not packed and monochrome, or as TIFF pictures.",
            )
        times = _stamps(unpack, setup, offsets, count)
        closing = opened.pop_all()
    if times is None and rate > 0:
        times = np.arange(count) / rate

    def read(number: int) -> Float[np.ndarray, "rows columns"]:
        place = f"{where}, frame {number + 1}"
        start, held = _pixels(unpack, place, starts[number])
        if held != size or start + size > length:
            raise BadFile(place, found=f"{held} bytes", expected=f"{size} bytes", remedy=AGAIN)
        file.seek(start)
        values = np.frombuffer(file.read(size), "u1" if bits == 8 else "<u2").reshape(abs(rows), columns)
        # rows are stored from the bottom up, unless their number is negative
        return grey(place, values[::-1] if rows > 0 else values)

    depth = depth if 0 < depth <= bits else bits
    return Film(where, count, (abs(rows), columns), 2.0**depth - 1, read, closing.close, times, exposure * 1e-9 or None)


AGAIN = "Save the film again, or as TIFF pictures."
FRAME_RATE, COLOURS, REAL_DEPTH, SHUTTER_NS = 768, 808, 896, 1568  # bytes from the beginning of the setup block
SETUP_LENGTH = 142
STAMPS = 1002  # the tagged block of the frames' times
MOST_BLOCKS = 64


def _pixels(unpack, place: str, at: int) -> tuple[int, int]:
    """Where a frame's pixels begin, and how many bytes they are."""
    (annotation,) = unpack("I", at)
    if annotation < 8:
        raise BadFile(place, found=f"an annotation of {annotation} bytes", expected="at least 8", remedy=AGAIN)
    return at + annotation, int(unpack("I", at + annotation - 4)[0])


def _stamps(unpack, setup: int, offsets: int, count: int) -> Float[np.ndarray, "frames"] | None:
    """Times of the frames since the first [s], from the tagged blocks behind the setup."""
    at = setup + int(unpack("H", setup + SETUP_LENGTH)[0])
    for _ in range(MOST_BLOCKS):
        if at + 8 > offsets:
            return None
        size, kind, more = unpack("IHH", at)
        if kind == STAMPS and size >= 8 + 8 * count:
            stamps = np.asarray(unpack(f"{count}Q", at + 8), dtype=np.uint64)
            # 32 bits of seconds, 32 of their fraction: whole numbers are subtracted, floating ones would round
            return (stamps - stamps[0]).astype(np.int64) / 2.0**32
        if not more or size < 8:
            return None
        at += size
    return None


def _photron_header(path: Path) -> dict[str, str]:
    check_file(path)
    raw = path.read_bytes()[:LONGEST_HEADER].decode("utf-8", errors="replace")
    if path.suffix.lower() == ".cih":
        lines = (line.split(" : ", 1) for line in raw.splitlines() if " : " in line)
        return {name.strip(): value.strip() for name, value in lines}
    found = re.search(r"<cih>.*</cih>", raw, re.DOTALL)
    if found is None or "<!ENTITY" in raw:
        raise BadFile(str(path), found="no <cih> … </cih>", expected="a Photron header", remedy=AGAIN)
    try:
        tree = ElementTree.fromstring(found[0])
    except ElementTree.ParseError as error:
        raise BadFile(str(path), found=str(error), expected="a Photron header", remedy=AGAIN) from None
    return {TAGS[one.tag]: (one.text or "").strip() for one in tree.iter() if one.tag in TAGS}


def _number(path: Path, fields: dict[str, str], name: str, least: float) -> float:
    try:
        value = float(fields[name])
    except (KeyError, ValueError):
        value = np.nan
    if not least <= value < MOST_NUMBER:
        raise BadFile(
            f"{path}, {name}", found=fields.get(name, "nothing"), expected=f"a number from {least:g}", remedy=AGAIN
        )
    return value


def _exposure(text: str) -> float | None:
    """Seconds of a shutter's `1/2000` or `0.0005`; None where it says neither."""
    found = re.fullmatch(r"(?:(\d+)\s*/\s*)?(\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)", text.strip())
    if found is None or float(found[2]) == 0:
        return None
    return float(found[2]) if found[1] is None else float(found[1]) / float(found[2])


def _held(path: Path, size: int) -> None:
    check_file(path)
    held = path.stat().st_size
    if held < size:
        raise BadFile(
            str(path), found=f"{held} bytes", expected=f"{size} bytes, as the header says", remedy="Copy it again."
        )


def _twelve(raw: np.ndarray) -> np.ndarray:
    """Two numbers of 12 bits from every three bytes, the first one's upper bits first."""
    a, b, c = raw.reshape(-1, 3).T.astype(np.uint16)
    return np.stack([(a << 4) | (b >> 4), ((b & 15) << 8) | c], axis=1).ravel()

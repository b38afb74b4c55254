"""Films as jobs, without database and processes: what is measured, and what a hostile client may send instead."""

import io
import json
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile

from jshell.io import read_trace
from jshell.service import tasks
from jshell.service.films import is_film

FILMS = Path(__file__).parents[2] / "data" / "films"


def film(frames=6) -> bytes:
    made = io.BytesIO()
    tifffile.imwrite(made, tifffile.imread(FILMS / "attached_R.tif")[:frames], photometric="minisblack")
    return made.getvalue()


def png(columns: int, rows: int) -> bytes:
    """The head of a picture that claims so many pixels, and a few of them."""
    parts = [(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(bytes(999)))]
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))  # noqa: E731
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in [*parts, (b"IEND", b"")])


def packed(**members: bytes) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name.replace("_", "/", 1) + ".png", content)
    return made.getvalue()


def claiming(size: int) -> bytes:
    """An archive of a picture that claims so many bytes."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("a.png", png(100, 100))
        archive.filelist[0].file_size = size
    return made.getvalue()


def test_a_look_and_a_measurement_of_a_film():
    given = [("a.tif", film())]
    seen = tasks.run("look", {}, given)
    assert seen.error is None, (seen.error, seen.fault)
    facts = json.loads(seen.files["look.json"])
    assert (facts["frames"], facts["rows"], facts["columns"], facts["rate"]) == (6, 120, 120, None)
    assert not facts["bright"]
    asked = {"rate": 1000.0, "pixel": 5.172414e-4, "holder": [85, 119, 56, 63], "grid": True}
    found = tasks.run("film", asked, [*given, ("a.tif", (FILMS / "grid.png").read_bytes())])
    assert found.error is not None  # a picture is opened by its suffix
    found = tasks.run("film", asked, [*given, ("grid.png", (FILMS / "grid.png").read_bytes())])
    assert found.error is None, (found.error, found.fault)
    assert set(found.files) == {"film.json", "trace.json", "trace.csv", "overlay.png", "outlines.nc"}
    record = json.loads(found.files["film.json"])
    assert record["frames"] == 6
    assert record["signature"]["outcome"] == "unusable_data"  # six frames are no ring-down, but sizes
    drawn = read_trace(FILMS / "attached_R_drawn.csv")
    assert record["channels"]["W"]["mean"] == pytest.approx(np.mean(drawn["W"][:6]), rel=2e-4)


HOSTILE = {
    "empty.tif": b"",
    "spoiled.tif": b"II*\0" + bytes(40),
    "spoiled.avi": b"RIFF" + bytes(60),
    "spoiled.cine": b"CI" + bytes(200),
    "cut.tif": film()[:9000],
    "giant.zip": packed(a=png(50_000, 20_000)),  # a billion pixels claimed
    "bomb.zip": claiming(2**28 + 1),
    "sizes.zip": packed(a=png(100, 100), b=png(90, 100)),
    "../../../up.tif": b"II*\0" + bytes(40),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_film_is_refused_in_words_of_its_own_name(name):
    for kind, asked in (("look", {}), ("film", {"rate": 1.0})):
        answer = tasks.run(kind, asked, [(name, HOSTILE[name])])
        assert answer.fault is None
        assert answer.error is not None, name
        assert answer.error["code"] == "bad_file"
        assert name.rsplit("/", 1)[-1] in answer.error["place"]
        assert "/tmp" not in " ".join(answer.error.values())


def test_what_is_a_film_is_told_by_its_name_or_by_what_an_archive_holds():
    assert is_film("a.TIF", b"")
    assert not is_film("a.csv", b"")
    assert is_film("a.zip", packed(run_1=b"x", run_2=b"x"))
    made = io.BytesIO(packed(run_1=b"x"))
    with zipfile.ZipFile(made, "a") as archive:
        archive.writestr("notes.csv", "t,V\n")
    assert not is_film("a.zip", made.getvalue())  # a batch of recordings with a picture beside them
    assert not is_film("a.zip", b"PK spoiled")

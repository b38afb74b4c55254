"""Films as cameras write them: pixels to the bit, rate, skipped frames, depth and exposure from the header."""

import struct
from fractions import Fraction

import numpy as np
import pytest

from jshell.errors import BadFile, BadValue, JshellError, MissingExtra

pytest.importorskip("skimage", reason="no scikit-image: pip install jshell[camera]")
from jshell.camera import View, measure, open_film

COUNT, ROWS, COLUMNS = 7, 48, 64


def _frames(white, seed=0):
    """A dark disc that grows, noise, and no symmetry by which a flip could hide."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    rng = np.random.default_rng(seed)
    grey = [
        0.8 - 0.6 * (np.hypot(rows - 20, (columns - 30) / 1.2) < 12 + 0.5 * k) + 0.05 * rng.uniform(size=rows.shape)
        for k in range(COUNT)
    ]
    return np.round(white * np.array(grey)).astype(np.uint16)


def photron(path, bits=16, depth=12, side="Lower", xml=False, **fields):
    """A header and its pixels."""
    frames = _frames(2**depth - 1)
    serialized = frames << (bits - depth) if side == "Higher" else frames
    if bits == 12:
        a, b = serialized.reshape(-1, 2).T
        raw = np.stack([a >> 4, ((a & 15) << 4) | (b >> 8), b & 255], axis=1).astype(np.uint8).tobytes()
    else:
        raw = serialized.astype("<u2" if bits == 16 else "u1").tobytes()
    path.with_suffix(".mraw").write_bytes(raw)
    if xml:
        header = (
            "PhotronRaw\n<cih><recordInfo><recordRate>2000</recordRate><shutterSpeed>4000</shutterSpeed></recordInfo>"
            f"<frameInfo><totalFrame>{COUNT}</totalFrame><skipFrame>1</skipFrame></frameInfo><imageDataInfo><resolution>"
            f"<width>{COLUMNS}</width><height>{ROWS}</height></resolution><colorInfo><type>Mono</type><bit>{bits}</bit>"
            f"</colorInfo><effectiveBit><depth>{depth}</depth><side>{side}</side></effectiveBit></imageDataInfo></cih>"
        )
        path.with_suffix(".cihx").write_text(header)
        return path.with_suffix(".cihx"), frames
    lines = {
        "Record Rate(fps)": 2000, "Shutter Speed(s)": "1/4000", "Total Frame": COUNT, "Save Step": 2,
        "Image Width": COLUMNS, "Image Height": ROWS, "Color Type": "Mono", "Color Bit": bits,
        "EffectiveBit Depth": depth, "EffectiveBit Side": side, **fields,
    }  # fmt: skip
    text = "#Camera Information Header\n" + "\n".join(f"{name} : {value}" for name, value in lines.items())
    path.with_suffix(".cih").write_text(text)
    return path.with_suffix(".cih"), frames


def phantom(path, bits=16, depth=12, missing=None, **header):
    """A Cine file as its manufacturer describes it; a frame's stamp may be missing from the row."""
    frames = _frames(2**depth - 1)
    setup = bytearray(7240)
    struct.pack_into("<2sH", setup, 140, b"ST", len(setup))
    for at, value in ((768, 2000), (808, 0), (896, depth), (1568, 250_000)):
        struct.pack_into("<I", setup, at, value)
    taken = np.arange(COUNT) + (0 if missing is None else np.arange(COUNT) >= missing)
    stamps = [(1_700_000_000 << 32) + round(k / 2000 * 2**32) for k in taken]
    tagged = struct.pack("<IHH", 8 + 8 * COUNT, 1002, 0) + struct.pack(f"<{COUNT}Q", *stamps)
    size = ROWS * COLUMNS * bits // 8
    bitmap, at_setup = 44, 84
    offsets = at_setup + len(setup) + len(tagged)
    starts = [offsets + 8 * COUNT + k * (8 + size) for k in range(COUNT)]
    form = {"mark": b"CI", "compression": 0, "rows": ROWS} | header
    raw = struct.pack("<2sHHHiIiIIIIQ", form["mark"], 44, form["compression"], 1, 0, COUNT, 0, COUNT, bitmap, at_setup,
                      offsets, 0)  # fmt: skip
    raw += struct.pack("<IiiHHIIiiII", 40, COLUMNS, form["rows"], 1, bits, 0, size, 0, 0, 0, 0)
    raw += bytes(setup) + tagged + struct.pack(f"<{COUNT}Q", *starts)
    for frame in frames:
        rows = frame[::-1] if form["rows"] > 0 else frame
        raw += struct.pack("<II", 8, size) + rows.astype("<u2" if bits == 16 else "u1").tobytes()
    path.write_bytes(raw)
    return path, frames


def video(path, codec="ffv1", form="gray", skip=(), rate=30, options=None):
    """A film by FFmpeg; frames of `skip` are left out, and the clock goes on."""
    av = pytest.importorskip("av", reason="no PyAV: pip install jshell[camera]")
    frames = _frames(255).astype(np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        stream.width, stream.height, stream.pix_fmt = COLUMNS, ROWS, form
        for k, grey in enumerate(frames):
            if k in skip:
                continue
            frame = av.VideoFrame.from_ndarray(grey, format="gray").reformat(format=form)
            frame.pts, frame.time_base = k, Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path, np.delete(frames, list(skip), axis=0)


@pytest.mark.parametrize(
    ("form", "step"),
    [
        ({"bits": 8, "depth": 8}, 2),
        ({"bits": 12}, 2),
        ({"bits": 16}, 2),
        ({"bits": 16, "side": "Higher"}, 2),
        ({"xml": True}, 1),
    ],
)
def test_photron_films_keep_every_grey_value(tmp_path, form, step):
    path, frames = photron(tmp_path / "a", **form)
    with open_film(path) as film:
        np.testing.assert_array_equal(list(film), frames)
        assert film.white == 2 ** form.get("depth", 12) - 1
        assert film.exposure == pytest.approx(1 / 4000 if step == 2 else 4000)
        np.testing.assert_allclose(film.times, step * np.arange(COUNT) / 2000)
    with open_film(tmp_path / "a.mraw") as film:  # either file names the film
        assert film.count == COUNT


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("rows", [ROWS, -ROWS])
def test_phantom_films_keep_every_grey_value(tmp_path, bits, rows):
    path, frames = phantom(tmp_path / "a.cine", bits, min(bits, 12), rows=rows)
    with open_film(path) as film:
        np.testing.assert_array_equal(list(film), frames)
        np.testing.assert_allclose(film.times, np.arange(COUNT) / 2000, atol=1e-9)
        assert (film.white, film.exposure) == (2 ** min(bits, 12) - 1, pytest.approx(250e-6))


def test_a_skipped_frame_is_a_gap_and_is_told(tmp_path):
    found = measure(phantom(tmp_path / "a.cine", missing=3)[0], View())
    np.testing.assert_allclose(found.trace.times, np.array([0, 1, 2, 4, 5, 6, 7]) / 2000, rtol=1e-7)
    assert any("1 frames are missing" in text for text in found.warnings)
    slow = measure(video(tmp_path / "a.avi", skip=(2,))[0], View(rate=1000))
    np.testing.assert_allclose(slow.trace.times, np.array([0, 1, 3, 4, 5, 6]) / 1000, rtol=1e-7)


@pytest.mark.parametrize("suffix", ["avi", "mkv"])
def test_lossless_videos_keep_every_grey_value(tmp_path, suffix):
    path, frames = video(tmp_path / f"a.{suffix}")
    with open_film(path) as film:
        np.testing.assert_array_equal(list(film), frames)
        np.testing.assert_array_equal(film.read(2), frames[2])  # backward as well
        np.testing.assert_allclose(film.times, np.arange(COUNT) / 30, atol=1e-3)  # some know milliseconds only


def test_a_compressed_video_is_read_and_its_rate_doubted(tmp_path):
    path, frames = video(tmp_path / "a.mp4", "mpeg4", "yuv420p", options={"qscale": "1"})
    with open_film(path) as film:
        assert np.abs(film.read(COUNT - 1) - frames[-1]).mean() < 6
    found = measure(path, View())
    np.testing.assert_allclose(found.trace.times, np.arange(COUNT) / 30, rtol=1e-6)
    assert any("give the camera's rate" in text for text in found.warnings)


def test_an_edge_that_moves_while_it_is_exposed_is_told(tmp_path):
    path, _ = photron(tmp_path / "a", **{"Save Step": 1, "Shutter Speed(s)": "0.004"})
    assert any("smeared" in text for text in measure(path, View()).warnings)
    path, _ = photron(tmp_path / "b")
    assert not any("smeared" in text for text in measure(path, View()).warnings)


def test_a_rate_is_asked_for_where_the_film_has_none_and_compared_where_it_has(tmp_path):
    tifffile = pytest.importorskip("tifffile", reason="no tifffile: pip install jshell[camera]")
    tifffile.imwrite(tmp_path / "a.tif", _frames(4095), photometric="minisblack")
    with pytest.raises(BadValue, match="frames per second"):
        measure(tmp_path / "a.tif", View())
    path, _ = photron(tmp_path / "b")
    assert any("the film itself says 1000" in text for text in measure(path, View(rate=2000)).warnings)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: photron(p / "a", **{"Total Frame": 10**9})[0], "1000000000 frames"),
        (lambda p: photron(p / "a", **{"Image Width": 10**7})[0], "frames of"),
        (lambda p: photron(p / "a", **{"Record Rate(fps)": 0})[0], "Record Rate"),
        (lambda p: photron(p / "a", **{"Color Type": "Bayer"})[0], "grey values"),
        (lambda p: photron(p / "a", **{"Image Height": 2 * ROWS})[0], "as the header says"),
        (lambda p: phantom(p / "a.cine", mark=b"XX")[0], "raw Cine"),
        (lambda p: phantom(p / "a.cine", compression=1)[0], "raw Cine"),
        (lambda p: phantom(p / "a.cine", rows=10**7)[0], "frames of"),
    ],
)
def test_headers_at_odds_with_their_pixels_are_refused(tmp_path, make, words):
    with pytest.raises(BadFile, match=words):
        open_film(make(tmp_path))


@pytest.mark.parametrize("kind", ["cine", "mraw", "avi"])
def test_spoiled_films_end_in_typed_errors(tmp_path, kind):
    made = {"cine": lambda: phantom(tmp_path / "a.cine")[0], "mraw": lambda: photron(tmp_path / "a", xml=True)[0],
            "avi": lambda: video(tmp_path / "a.avi")[0]}  # fmt: skip
    path = made[kind]()
    whole = path.read_bytes()
    head = min(len(whole), 1500 if kind == "avi" else 9000)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        spoiled = bytearray(whole[: rng.integers(1, len(whole))] if seed % 3 == 0 else whole)
        for at in rng.integers(0, min(head, len(spoiled)), rng.integers(1, 12)):
            spoiled[at] = rng.integers(256)
        path.write_bytes(spoiled)
        try:
            with open_film(path) as film:
                for number in range(min(film.count, COUNT)):
                    assert film.read(number).shape == film.shape
        except JshellError:
            pass


def test_a_video_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "a.avi").write_bytes(b"x")
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(MissingExtra, match=r"jshell\[camera\]"):
        open_film(tmp_path / "a.avi")

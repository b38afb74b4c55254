"""A film whose geometry is known: height and width come back without bias, with errors that are what they say."""

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter
from scipy.special import erf, erfc

from jshell.contour import poles
from jshell.errors import BadFile, BadName, MissingExtra, UnusableData
from jshell.io import read_trace

pytest.importorskip("skimage", reason="no scikit-image: pip install jshell[camera]")
pytest.importorskip("tifffile", reason="no tifffile: pip install jshell[camera]")
from jshell.camera import View, lens_from_grid, measure, open_film, write_outlines
from jshell.camera.hull import extent
from jshell.camera.outline import Outline, find_outline
from jshell.camera.revolution import revolved

ROWS = COLUMNS = 256
NOISE = 0.005  # of full scale
BLUR = 1.0  # px


def _coordinates(k1=0.0, fine=1):
    """True places of the points of a picture, `fine` to a pixel's side, whose lens shows r in r (1 + k₁ r²)."""
    rows, columns = ((np.mgrid[: fine * ROWS, : fine * COLUMNS] + 0.5) / fine - 0.5).astype(float)
    middle, radius = (COLUMNS - 1) / 2, np.hypot(ROWS, COLUMNS) / 2
    x, y = (columns - middle) / radius, (rows - middle) / radius
    seen = np.hypot(x, y)
    true = seen.copy()
    for _ in range(20 if k1 else 0):
        true = seen / (1 + k1 * true**2)
    ratio = np.where(seen > 0, true / np.where(seen > 0, seen, 1), 1)
    return middle + radius * x * ratio, middle + radius * y * ratio


def _shell(height, width, rng=None, k1=0.0, noise=NOISE):
    """A dark ellipse out of focus, in 16 bits: drawn twice as fine, blurred, and gathered by the pixels."""
    x, y = _coordinates(k1, fine=2)
    x, y = (x - 127.3) / (width / 2), (y - 126.6) / (height / 2)
    size = np.hypot(x, y)
    slope = np.hypot(x / (width / 2), y / (height / 2)) / np.where(size > 0, size, 1)
    sharp = 0.5 * (1 - erf((size - 1) / np.where(slope > 0, slope, 1) / (np.sqrt(2) * 0.35)))
    blurred = gaussian_filter(sharp, 2 * np.sqrt(BLUR**2 - 1 / 12))  # a pixel is 1/12 wide by itself
    inside = blurred.reshape(ROWS, 2, COLUMNS, 2).mean(axis=(1, 3))
    grey = 0.85 - 0.7 * inside
    if rng is not None:
        grey = grey + noise * rng.normal(size=grey.shape)
    return np.clip(np.round(65535 * grey), 0, 65535).astype(np.uint16)


def _film(path, sizes, seed=0, **form):
    import tifffile

    rng = np.random.default_rng(seed)
    tifffile.imwrite(path, np.stack([_shell(h, w, rng, **form) for h, w in sizes]), photometric="minisblack")
    return path


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    times = np.arange(60) / 1000
    heights = 150 + 12 * np.exp(-times / 0.03) * np.cos(2 * np.pi * 90 * times)
    widths = 170 - 5 * np.exp(-times / 0.03) * np.cos(2 * np.pi * 90 * times)
    sizes = np.stack([heights, widths], axis=1)
    return _film(tmp_path_factory.mktemp("film") / "a.tif", sizes), sizes


@pytest.mark.long
def test_height_and_width_of_a_noisy_film_are_without_bias_and_their_errors_honest(film):
    path, sizes = film
    found = measure(path, View(rate=1000))
    np.testing.assert_allclose(found.trace.times, np.arange(60) / 1000)
    assert dict(found.trace.settings) == {"channel_units": "height: px; width: px"}
    assert found.warnings == ()
    for name, truth in zip(("height", "width"), sizes.T, strict=True):
        off = found.trace[name] - truth
        assert abs(off.mean()) < 0.05
        # 60 frames know their own scatter to 9 %
        assert 0.7 < np.sqrt(np.mean((off / found.trace.sigma[name]) ** 2)) < 1.3


FILMS = Path(__file__).parents[2] / "data" / "films"


def test_the_film_that_comes_with_jshell_shows_what_was_drawn():
    drawn = read_trace(FILMS / "attached_R_drawn.csv")
    lens = lens_from_grid(FILMS / "grid.png")
    view = View(pixel=0.0225 / 43.5, lens=lens, holder=(85, 119, 56, 63))
    found = measure(FILMS / "attached_R.tif", view)
    assert found.warnings == ("1000 frames per second, as the film says",)
    np.testing.assert_allclose(found.trace.times, np.arange(120) / 1000)
    for name in ("H", "W"):
        off = found.trace[name] - drawn[name]
        assert abs(off.mean()) < 0.05 * view.pixel
        # 120 frames know their own scatter to 6 %
        assert 0.8 < np.std(off / found.trace.sigma[name]) < 1.2


def test_without_its_holder_an_outline_that_leaves_the_picture_is_no_longer_than_it():
    found = measure(FILMS / "attached_R.tif", View())
    assert any("leaves the picture" in text for text in found.warnings)
    assert found.trace["height"].max() < 120


def test_a_flat_end_is_as_high_as_its_line_and_a_leaning_one_as_its_corner():
    rng = np.random.default_rng(0)
    x, y = np.mgrid[:ROWS, :COLUMNS][::-1] - np.array([127.3, 126.6])[:, None, None]
    for lean in (0.0, 0.01):
        above = -40 - lean * x - y  # a plane that cuts the disc
        away = np.maximum(np.hypot(x, y) - 80, above / np.hypot(1, lean))
        corner = np.sqrt(80**2 - 40**2)
        ends = []
        for _ in range(12):
            grey = 0.85 - 0.35 * erfc(away / (np.sqrt(2) * BLUR)) + NOISE * rng.normal(size=x.shape)
            ends.append(extent(find_outline(grey), np.pi / 2))
        off = np.array([one.value for one in ends]) - (120 + lean * corner)
        # the sharp corner is rounded by the blur: a slope times its width
        assert abs(off.mean()) < 0.01 + 2 * lean * BLUR
        assert off.std() < 2 * np.mean([one.sigma for one in ends])


@pytest.mark.slow
def test_over_two_hundred_frames_the_errors_are_right_to_a_tenth(tmp_path):
    rng = np.random.default_rng(3)
    sizes = np.stack([150 + rng.uniform(-8, 8, 200), 170 + rng.uniform(-8, 8, 200)], axis=1)
    found = measure(_film(tmp_path / "a.tif", sizes), View(rate=1000))
    for name, truth in zip(("height", "width"), sizes.T, strict=True):
        off = found.trace[name] - truth
        assert abs(off.mean()) < 0.01
        assert 0.9 < np.std(off / found.trace.sigma[name]) < 1.1


def test_widths_at_heights_are_those_of_the_ellipse_with_errors_that_are_right(film):
    path, sizes = film
    found = measure(path, View(rate=1000, widths=True))
    for share, name in ((0.25, "width_25"), (0.5, "width_50"), (0.75, "width_75")):
        off = found.trace[name] - sizes[:, 1] * 2 * np.sqrt(share * (1 - share))
        error = found.trace.sigma[name]
        assert abs(off.mean()) < 0.02 + 3 * error.mean() / np.sqrt(off.size), name  # blur draws a round edge inward
        # of n independent frames the scatter of errors is right to 1/sqrt(2n)
        assert abs(np.std(off / error) - 1) < 3 / np.sqrt(2 * off.size), name
    scaled = measure(path, View(rate=1000, pixel=1e-4, widths=True)).trace
    np.testing.assert_allclose(scaled["W_75"], 1e-4 * found.trace["width_75"])


def test_a_section_gives_volume_area_and_poles(film, tmp_path):
    path, sizes = film
    found = measure(path, View(rate=1000, section=True))
    b, a = sizes.T / 2
    e = np.sqrt(1 - (b / a) ** 2)
    truth = {
        "volume": 4 / 3 * np.pi * a**2 * b,
        "area": 2 * np.pi * a**2 * (1 + (1 - e**2) / e * np.arctanh(e)),
        "upper": b - 126.6,
        "lower": -b - 126.6,
    }
    for name, exact in truth.items():
        off = found.trace[name] - exact
        # blur draws the edge of a round body inward by b²/2ρ, a hundredth of a pixel here
        assert np.abs(off).max() < {"volume": 1e-3, "area": 1e-3}.get(name, 0) * exact.mean() + 0.1, name
    assert dict(found.trace.settings)["channel_units"].endswith("volume: px3; area: px2; upper: px; lower: px")
    xarray = pytest.importorskip("xarray", reason="no xarray: pip install jshell[io]")
    write_outlines(tmp_path / "outlines.nc", found)
    with xarray.open_dataset(tmp_path / "outlines.nc", engine="h5netcdf", decode_times=False) as serialized:
        points = found.outlines[4].points
        np.testing.assert_array_equal(serialized["x"][4, : len(points)], points[:, 0])
        np.testing.assert_allclose(serialized["t"], found.trace.times)


@pytest.mark.long
def test_a_dimple_seen_in_a_section_has_the_volume_of_its_shape(rest_R):
    shape, q = rest_R.meridian, rest_R.coordinates
    curve, ends = shape.at_points(q), [float(x) for x in poles(shape, q)]
    top, bottom = max(ends), min(ends)
    down = np.asarray(curve.x)[0] > np.asarray(curve.x)[-1]
    x = np.r_[top if down else bottom, curve.x, bottom if down else top]
    turn, r = np.r_[0.0, shape.angles, np.pi], np.r_[0.0, curve.r, 0.0]
    # the meridian and its mirror image, drawn finely: 100 px to a radius
    around = np.r_[turn, 2 * np.pi - turn[-2::-1]]
    whole = CubicSpline(around, np.c_[np.r_[r, -r[-2::-1]], np.r_[x, x[-2::-1]]], bc_type="periodic")
    closed = 300 + 100 * whole(np.linspace(0, 2 * np.pi, 1601)) * np.array([1.0, -1.0])
    body = revolved(Outline(closed, 0.01, 3.5, 1.0, False), np.pi / 2)
    assert body.volume.value == pytest.approx(1e6 * float(rest_R.volume), rel=1e-4)
    assert body.area.value == pytest.approx(1e4 * float(rest_R.area), rel=1e-4)
    assert body.upper.value - body.lower.value == pytest.approx(100 * float(rest_R.gap), abs=0.01)


def test_a_pixels_size_makes_lengths(film):
    found = measure(film[0], View(rate=1000, pixel=1e-4)).trace
    np.testing.assert_allclose(found["H"], 1e-4 * film[1][:, 0], rtol=1e-3)
    assert list(found.sigma) == ["H", "W"]


def test_a_grid_takes_barrel_distortion_off(tmp_path):
    import tifffile

    k1 = -0.03
    x, y = _coordinates(k1)
    dots = np.cos(2 * np.pi * (x - 127.5) / 20) + np.cos(2 * np.pi * (y - 127.5) / 20)
    grid = 0.8 - 0.6 / (1 + np.exp(-8 * (dots - 1.3)))
    tifffile.imwrite(tmp_path / "grid.tif", (65535 * grid).astype(np.uint16))
    lens = lens_from_grid(tmp_path / "grid.tif")
    assert abs(lens.k1 - k1) < 0.002
    assert abs(lens.spacing - 20) < 0.05
    path = _film(tmp_path / "a.tif", [(150, 170)] * 6, k1=k1)
    bent, straight = (measure(path, View(rate=1000, lens=one)).trace for one in (None, lens))
    assert abs(np.mean(bent["width"]) - 170) > 0.5  # what is left without a grid
    assert abs(np.mean(straight["width"]) - 170) < 0.05
    assert abs(np.mean(straight["height"]) - 150) < 0.05


def test_frames_without_a_shell_are_gaps_and_pictures_in_a_folder_are_a_film(tmp_path):
    from PIL import Image

    rng = np.random.default_rng(1)
    for k in range(12):
        frame = _shell(150, 170, rng) if k != 3 else np.full((ROWS, COLUMNS), 55000, np.uint16)
        Image.fromarray((frame // 257).astype(np.uint8)).save(tmp_path / f"frame{k}.png")  # 10 comes after 9
    found = measure(tmp_path, View(rate=500, pixel=1.0))
    np.testing.assert_allclose(found.trace.times, np.delete(np.arange(12), 3) / 500)
    assert found.outlines[3] is None
    assert found.warnings == ("1 frames show no shell and are gaps, the first is 4",)


def test_what_is_no_film_is_refused(tmp_path, monkeypatch):
    import tifffile

    (tmp_path / "a.tif").write_bytes(b"II*\0" + bytes(40))
    with pytest.raises(BadFile):
        open_film(tmp_path / "a.tif")
    (tmp_path / "a.gif").write_bytes(b"x")
    with pytest.raises(BadName, match=r"suffix \.gif"):
        open_film(tmp_path / "a.gif")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadFile, match="no pictures"):
        open_film(tmp_path / "empty")
    tifffile.imwrite(tmp_path / "b.tif", np.full((3, 64, 64), 100, np.uint8), photometric="minisblack")
    with pytest.raises(UnusableData, match="a shell in 0 of 3 frames"):
        measure(tmp_path / "b.tif", View(rate=1.0))
    monkeypatch.setitem(__import__("sys").modules, "tifffile", None)
    with pytest.raises(MissingExtra, match=r"jshell\[camera\]"):
        open_film(tmp_path / "b.tif")

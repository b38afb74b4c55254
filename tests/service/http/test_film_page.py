"""A film, and a table that leaves its columns open, in a browser: dropped, settled, fitted."""

import base64
import os
import zipfile
from pathlib import Path

import httpx
import pytest
import tifffile
from PIL import Image
from playwright.sync_api import expect

import jshell

from .conftest import RECORDING, ROOT

FILMS = ROOT / "data" / "films"
PATIENT = 120_000  # [ms] for a job whose process may have to start
CONDITIONS = {"radius": "0.0225", "thickness d": "4.95e-3", "Young": "5e5", "gas pressure P₀": "99000"}
CONDITIONS |= {"outer pressure Pₑₓₜ": "178200", "density": "1260", "viscosity of the liquid η": "1.06"}
DROP = """
([name, words]) => {
  const bytes = Uint8Array.from(atob(words), (letter) => letter.charCodeAt(0));
  const given = new DataTransfer();
  given.items.add(new File([bytes], name));
  const event = new DragEvent("drop", {dataTransfer: given, bubbles: true, cancelable: true});
  document.querySelector(".drop").dispatchEvent(event);
}
"""


def drop(page, path: Path) -> None:
    """Let a file fall onto the page, as a hand with a mouse does."""
    page.goto("/fits/new")
    page.evaluate(DROP, [path.name, base64.b64encode(path.read_bytes()).decode()])


def fit_with_fixed_alpha2(page) -> None:
    """From a recording that was read to its fit: conditions, one constant held, done."""
    give_conditions(page)
    expect(page.locator("figure[data-drawn] canvas")).to_have_count(2)
    page.get_by_label("Role of α₂").select_option("fixed")
    page.get_by_label("Fixed value of α₂").fill("1.1")
    page.get_by_role("button", name="Fit", exact=True).click()
    page.wait_for_selector("#chi", timeout=PATIENT)


def give_conditions(page) -> None:
    page.wait_for_url("**/traces/conditions?trace=*")
    for label, text in CONDITIONS.items():
        page.get_by_label(label).fill(text)
    page.get_by_role("button", name="Go on").click()
    page.wait_for_url("**/fits/new?trace=*")


def fits_in(page, name: str) -> None:
    """Nothing is wider than the window, wide or narrow; `JSHELL_SCREENSHOTS` keeps pictures."""
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        for _ in range(50):  # curves are drawn anew a moment later
            if narrow := page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"):
                break
            page.wait_for_timeout(100)
        assert narrow, (page.url, width)
        if folder := os.environ.get("JSHELL_SCREENSHOTS"):
            page.wait_for_timeout(200)
            page.screenshot(path=f"{folder}/{name}-{width}.png", full_page=True)


def test_a_film_is_dropped_and_its_shell_measured_analysed_and_fitted(page, served):
    drop(page, FILMS / "attached_R.tif")
    page.wait_for_selector("svg.frame polygon.outline", timeout=PATIENT)
    assert "120 frames of 120 × 120 pixels, 1000 a second as the film says" in page.inner_text("#content")
    # the rod is boxed by hand, from its upper left to beyond the picture's lower edge
    frame = page.locator("svg.frame")
    frame.scroll_into_view_if_needed()
    at = frame.bounding_box()
    scale = min(at["width"], at["height"]) / 120
    left, top = at["x"] + (at["width"] - 120 * scale) / 2, at["y"] + (at["height"] - 120 * scale) / 2
    page.mouse.move(left + 56.5 * scale, top + 85.5 * scale)
    page.mouse.down()
    page.mouse.move(left + 63.5 * scale, top + 119.5 * scale, steps=4)
    page.mouse.up()
    fields = [
        page.get_by_label(f"{end} {line}").input_value() for line in ("row", "column") for end in ("First", "Last")
    ]
    assert fields == ["85", "119", "56", "63"]
    page.get_by_label("A pixel at the shell").fill("0,5172414")
    page.set_input_files("input[name=grid]", FILMS / "grid.png")
    fits_in(page, "film-first")
    page.get_by_role("button", name="Measure the film").click()
    page.wait_for_selector("img.strip", timeout=PATIENT)
    expect(page.locator("figure[data-drawn] canvas")).to_have_count(2)  # H and W
    fits_in(page, "film-measured")

    # the same as the library says
    lens = jshell.camera.lens_from_grid(FILMS / "grid.png")
    view = jshell.camera.View(pixel=5.172414e-4, lens=lens, holder=(85, 119, 56, 63))
    signature = jshell.signals.extract(jshell.camera.measure(FILMS / "attached_R.tif", view).trace)
    found = httpx.get(f"{served}/api/v1/films/{page.url.rsplit('/', 1)[1]}", timeout=30, trust_env=False).json()
    assert found["result"]["signature"]["f_minus_Hz"] == pytest.approx(signature.f_minus_Hz, rel=1e-6)
    assert f"{signature.f_minus_Hz:.2f}" in page.get_by_role("row", name="slow frequency").inner_text()
    assert page.locator("img.strip").evaluate("e => e.naturalWidth") > 800

    page.get_by_role("button", name="Measure again with changes").click()
    page.wait_for_selector("svg.frame")
    assert page.get_by_label("First row").input_value() == "85"
    assert page.get_by_text("the one sent before").count() == 1
    page.go_back()
    page.get_by_role("button", name="Fit the short model to it").click()
    fit_with_fixed_alpha2(page)
    fits_in(page, "film-fit")


def test_a_table_is_dropped_its_columns_chosen_and_the_fit_shown(page, tmp_path):
    rows = [line.split(",") for line in RECORDING.read_text().splitlines() if line[:1].isdigit()]
    table = tmp_path / "scope.csv"
    table.write_text("\n".join(f"{i};{float(t):.6g};{h};{w}" for i, (t, h, w) in enumerate(r[:3] for r in rows)))
    drop(page, table)
    page.get_by_role("heading", name="leaves open").wait_for()
    assert page.get_by_role("alert").count() == 1
    for place, role, unit in ((2, "t", "ms"), (3, "H", "mm"), (4, "W", "mm")):
        page.get_by_label(f"Column {place} is read as").select_option(role)
        page.get_by_label(f"Unit of column {place}").fill(unit)
    fits_in(page, "table-settle")
    page.get_by_role("button", name="Read it so").click()
    fit_with_fixed_alpha2(page)
    assert page.locator("#outcome").inner_text().startswith("ok")


def test_pictures_in_an_archive_are_a_film_and_what_is_none_is_refused_in_words(page, tmp_path):
    frames = tifffile.imread(FILMS / "attached_R.tif")[:12]
    with zipfile.ZipFile(tmp_path / "frames.zip", "w") as archive:
        for number, frame in enumerate(frames):
            Image.fromarray(frame).save(tmp_path / "one.png")
            archive.write(tmp_path / "one.png", f"run/frame{number}.png")
    drop(page, tmp_path / "frames.zip")
    page.wait_for_selector("svg.frame", timeout=PATIENT)
    assert "whose rate the film does not say" in page.inner_text("#content")
    page.get_by_label("Frames a second").fill("a thousand")
    page.get_by_role("button", name="Measure the film").click()
    assert "a number" in page.get_by_role("alert").inner_text()
    page.get_by_label("Frames a second").fill("1000")
    page.get_by_role("button", name="Measure the film").click()
    page.wait_for_selector("img.strip", timeout=PATIENT)
    assert "height" in page.inner_text("#content")  # in pixels, of which no fit is made
    assert page.get_by_role("button", name="Fit the short model to it").count() == 0

    (tmp_path / "spoiled.tif").write_bytes(b"II*\0" + bytes(40))
    drop(page, tmp_path / "spoiled.tif")
    page.get_by_role("heading", name="It failed").wait_for(timeout=PATIENT)
    words = page.inner_text("#content")
    assert "spoiled.tif" in words
    assert "/tmp" not in words

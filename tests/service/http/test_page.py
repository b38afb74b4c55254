"""The page in a browser, from the one command on: a recording in, a fit with its picture and its numbers out.

One service and one fit serve the browser, the client and the API, for starting and compiling cost most.
"""

import zipfile
from pathlib import Path

import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

import jshell
from jshell.calibration import BatchResult, Recordings, fit_batch, recordings_file
from jshell.errors import BadName, BadValue
from jshell.service import batches, chunks

from .conftest import RECORDING

PATIENT = 120_000  # [ms] for a first fit, which compiles
BROKEN = b"t,V\n0,3.0\n1,nan\n2,3.1\n"


@pytest.fixture(scope="module")
def fitted(served: str) -> dict:
    """The fit that all look at, done, as the API shows it."""
    with jshell.Client(served) as client:
        job = client.submit(RECORDING, fix={"alpha2": 1.1}).wait(110)
        assert job.state == "done", job
    return httpx.get(f"{served}/api/v1/fits/{job.id}", timeout=30, trust_env=False).json()


def test_upload_fit_picture_numbers_download(page, served, fitted, tmp_path):
    page.goto("/")
    page.get_by_role("link", name="New fit").first.click()
    page.set_input_files("input[type=file]", RECORDING)  # chosen, it goes up at once
    page.wait_for_url("**/fits/new?trace=*")
    assert page.locator("figure[data-drawn] canvas").count() == 2  # H and W with their estimated start
    assert page.locator("text=Found: ω₋ ≈ 0.3998").count() == 1
    page.locator("summary", has_text="attached_R_HW.csv").click()
    assert page.get_by_role("cell", name="mm", exact=True).count() == 2

    page.get_by_label("Role of α₂").select_option("fixed")
    page.get_by_label("Fixed value of α₂").fill("1.1")
    page.keyboard.press("Tab")
    expect(page.locator('td[data-label="Estimated start"]').first).to_have_text("5.51", timeout=20_000)  # it follows
    expect(page.locator("figure[data-drawn] canvas")).to_have_count(2)
    page.get_by_role("button", name="Fit", exact=True).click()
    page.wait_for_selector("#chi", timeout=PATIENT)
    page.wait_for_selector("figure[data-drawn] canvas")
    assert page.locator("figure[data-drawn] canvas").count() == 4  # fit and residual of both

    result = fitted["result"]
    assert page.url.endswith(fitted["id"])  # the same data and options are the same job
    shown = {
        cell.get_attribute("data-name"): float(cell.get_attribute("data-value"))
        for cell in page.locator("td[data-name]").all()
    }
    for row in (*result["estimates"], *result["derived"]):
        if row["role"] != "nuisance":
            assert shown[row["name"]] == row["value"], row["name"]
    assert page.locator("#chi").inner_text() == f"{result['chi_square']:.6g}"
    assert page.locator("#outcome").inner_text().startswith("ok")

    with page.expect_download() as wanted:
        page.get_by_role("link", name="Record (.json)").click()
    wanted.value.save_as(tmp_path / "record.json")
    record = jshell.load(tmp_path / "record.json")
    assert {one.name: one.value for one in record.estimates} == {
        row["name"]: row["value"] for row in result["estimates"]
    }
    with page.expect_download() as wanted:
        page.get_by_role("link", name="Table (.csv)").click()
    wanted.value.save_as(tmp_path / "table.csv")
    assert f"alpha1,{record['alpha1'].value!r}" in (tmp_path / "table.csv").read_text()


def test_a_drag_across_a_curve_chooses_the_window(page, fitted):
    page.goto(f"/fits/new?trace={fitted['traces'][0]}")
    over = page.locator("figure[data-drawn] .u-over").first
    box = over.bounding_box()
    at = lambda part: (box["x"] + part * box["width"], box["y"] + 60)  # noqa: E731
    page.mouse.move(*at(0.5))
    page.mouse.down()
    page.mouse.move(*at(0.9), steps=4)
    page.mouse.up()
    start, stop = (page.locator(f"#fit input[name={name}]") for name in ("start", "stop"))
    assert float(start.input_value()) == pytest.approx(108, abs=2)  # of 216 ms
    assert float(stop.input_value()) == pytest.approx(194, abs=2)
    page.wait_for_timeout(300)
    over.dblclick()
    assert start.input_value() == stop.input_value() == ""
    # and the page of the fit says what it read
    page.goto(f"/fits/{fitted['id']}")
    read = page.locator("section:has(#read)").inner_text()
    assert "85 to 216 ms" in read
    assert "H, W" in read


def test_the_python_shown_asks_for_the_same_fit(page, fitted, monkeypatch):
    page.goto(f"/fits/{fitted['id']}")
    program = page.locator("#python").inner_text()
    asked: dict = {}
    monkeypatch.setattr(jshell.io, "read_trace", lambda name: name)
    monkeypatch.setattr(
        jshell.calibration, "fit_trajectories", lambda traces, **given: asked.update(given, traces=traces)
    )
    exec(program, {})
    assert asked["traces"] == [RECORDING.name]
    assert asked["fix"] == {"alpha2": 1.1}
    assert asked["loss"] == "modal"
    page.get_by_role("button", name="Copy as Python").click()
    page.get_by_role("button", name="Copied").wait_for()


def test_a_bad_recording_is_refused_in_words(page):
    page.goto("/fits/new")
    page.set_input_files("input[type=file]", {"name": "broken.csv", "mimeType": "text/csv", "buffer": BROKEN})
    alert = page.get_by_role("alert")
    alert.wait_for()
    words = alert.inner_text()
    assert "broken.csv, row 3, column `V`" in words
    assert "nan" in words


def test_a_recording_without_conditions_is_asked_for_them(page):
    page.goto("/fits/new")
    plain = RECORDING.read_text().split("t [ms]")[1]
    page.set_input_files(
        "input[type=file]", {"name": "bare.csv", "mimeType": "text/csv", "buffer": f"t [ms]{plain}".encode()}
    )
    page.wait_for_url("**/traces/conditions?trace=*")
    numbers = {"radius": "0.0225", "thickness d": "4.95e-3", "Young": "5e5", "gas pressure P₀": "99000"}
    numbers |= {"outer pressure Pₑₓₜ": "178200", "density": "1260", "viscosity of the liquid η": "1,06"}
    for label, text in numbers.items():
        page.get_by_label(label).fill(text)
    page.get_by_role("button", name="Go on").click()
    page.wait_for_url("**/fits/new?trace=*")
    assert page.locator("figure[data-drawn] canvas").count() == 2


def test_the_sliders_move_the_numbers(page):
    page.goto("/simulate")
    before = page.locator("#slow").inner_text()
    slider = page.locator("input[data-for=Pext_hat]")
    slider.evaluate("e => { e.value = 2.4; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    expect(page.locator("#slow")).not_to_have_text(before, timeout=20_000)
    assert page.locator("#Pext_hat").input_value() == "2.4"
    page.wait_for_selector("figure[data-drawn] canvas")
    assert float(page.locator("#slow").inner_text()) > float(before)  # a higher load, a stiffer gas


@pytest.mark.parametrize("width", [1280, 390])
def test_no_page_is_wider_than_its_window_and_every_field_has_a_name(browser, served, fitted, width):
    context = browser.new_context(base_url=served, viewport={"width": width, "height": 900})
    page = context.new_page()
    trace = fitted["traces"][0]
    for path in (
        "/",
        "/fits/new",
        f"/fits/new?trace={trace}",
        f"/fits/{fitted['id']}",
        "/simulate",
        "/api",
        "/nothing",
    ):
        page.goto(path)
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), path
        nameless = page.evaluate(
            "[...document.querySelectorAll('input:not([type=hidden]), select, button, a')]"
            ".filter(e => !(e.labels && e.labels.length) && !e.getAttribute('aria-label') && !e.textContent.trim())"
            ".map(e => e.outerHTML)"
        )
        assert nameless == [], path
        assert page.locator("h1").count() == 1, path
        assert page.locator("html[lang=en]").count() == 1
    page.goto("/")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
    context.close()


def test_without_javascript_the_forms_post_and_the_curves_are_pictures(browser, served, fitted):
    context = browser.new_context(base_url=served, java_script_enabled=False)
    page = context.new_page()
    page.goto(f"/fits/new?trace={fitted['traces'][0]}")
    assert page.locator("noscript img, figure img").first.is_visible()
    page.get_by_label("Role of α₂").select_option("fixed")
    page.get_by_label("Fixed value of α₂").fill("1,1")  # a decimal comma
    page.get_by_role("button", name="Fit", exact=True).click()
    page.wait_for_url("**/fits/*")
    assert page.url.endswith(fitted["id"])
    picture = page.locator("figure img").first
    assert picture.is_visible()
    assert picture.evaluate("e => e.naturalWidth") > 100
    page.goto("/simulate?d_hat=0.08&P0_hat=0.9&Pext_hat=1.2&eta_hat=0.01")
    assert page.locator("#slow").inner_text() == "0.8243"
    assert "from a law fitted to the simulator's modes" in page.locator("#result").inner_text()
    page.get_by_text("Constants of the model").click()
    page.get_by_label("β₁").fill("5.29412")
    page.get_by_role("button", name="Show").click()
    page.wait_for_url("**beta1=5.29412**")
    assert page.locator("#decay").inner_text() == "34"  # ½ 0.68/0.01
    assert "by the given β1" in page.locator("#result").inner_text()
    context.close()


def test_a_wrong_field_comes_back_with_all_others_as_they_were(page, fitted):
    page.goto(f"/fits/new?trace={fitted['traces'][0]}")
    page.get_by_label("Lowest α₁").fill("5")
    page.get_by_label("Highest α₁").fill("4")
    page.get_by_role("button", name="Fit", exact=True).click()
    page.get_by_role("alert").first.wait_for()
    assert "below the highest" in page.get_by_role("alert").first.inner_text()
    assert page.get_by_label("Lowest α₁").input_value() == "5"


def test_the_client_gives_the_librarys_own_objects(served, fitted):
    with jshell.Client(served) as client:
        result = client.fit(RECORDING, fix={"alpha2": 1.1}, seconds=100)
        assert isinstance(result, jshell.FitResult)
        assert result["alpha1"].value == next(
            r["value"] for r in fitted["result"]["estimates"] if r["name"] == "alpha1"
        )
        assert "alpha1" in result.report()
        assert "f_minus = 26.598 ± 0.072 Hz" in result.report()  # the recording is in SI
        assert client.job(fitted["id"]).over
        with pytest.raises(BadValue, match="alpha9"):
            client.submit(RECORDING, fix={"alpha9": 1.0})
        with pytest.raises(BadName, match="strict loss"):
            client.fit(RECORDING, loss="strict", seconds=60)


def test_the_modes_of_a_shell_are_found_and_shown(page, served):
    with jshell.Client(served) as client:
        found = client.modes(jshell.presets.R.conditions, elements=16, count=2, liquid="ideal", seconds=100)
        job = next(client.jobs("modes"))
    assert found == jshell.dynamics.modes(jshell.presets.R.conditions, elements=16, count=2, liquid="ideal").table()
    page.goto(f"/modes/{job.id}")
    assert f"{found[0].omega:.5g}" in page.locator("table").inner_text()
    for button, address in (("Find its exact modes", "modes"), ("Run the full simulator", "simulations")):
        page.goto("/simulate")
        page.get_by_role("button", name=button).click()
        page.wait_for_url(f"**/{address}/*")
        expect(page.get_by_text("d̂ = 0.22").first).to_be_visible()
        page.get_by_role("button", name="Cancel").click()
        expect(page.get_by_text("cancelled").first).to_be_visible()


def archived(client: jshell.Client, records: Recordings, path: Path, sound: int) -> BatchResult:
    """What comes of the records as trace files, all but the first few of them spoiled."""
    with zipfile.ZipFile(path, "w") as archive:
        for row, values in enumerate(records.values):
            conditions = jshell.Reduced(
                *(float(getattr(records.conditions, name)[row]) for name in recordings_file.CONDITIONS)
            )
            trace = jshell.Trace(records.times, dict(zip("VS", values, strict=True)), conditions)
            jshell.io.write_trace(path.with_suffix(".csv"), trace)
            archive.writestr(f"{row}.csv", path.with_suffix(".csv").read_bytes() if row < sound else b"spoiled")
    return client.fit_batch(path, seconds=100)


def test_a_batch_goes_up_in_chunks_and_its_table_and_report_are_made_when_asked_for(served, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "STEP", 1)
    monkeypatch.setattr(chunks, "MAX_CHUNK_BYTES", 1)
    shells = jshell.Reduced(*(np.full(3, x) for x in (0.22, 0.9, 1.6, 0.004, 1.4, 0.5)))
    V = np.random.default_rng(0).uniform(3.0, 4.0, (3, 1, 20))
    values = np.concatenate([V, V + 10.0], axis=1)  # too short to be fitted: nothing is compiled
    records = Recordings(0.1 * np.arange(20.0), values, shells, np.full((3, 2), 0.1), np.array([20, 19, 18]))
    with jshell.Client(served) as client:
        found, expected = client.fit_batch(records, seconds=100), fit_batch(records)
        (tmp_path / "batch.npz").write_bytes(recordings_file.encode(records))
        again = client.fit_batch(tmp_path / "batch.npz", seconds=100)
        for name in BatchResult.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
            np.testing.assert_array_equal(getattr(again, name), getattr(expected, name))
        made = [job for job in client.jobs("batch") if job.state == "done"]
        assert len(made) == 3
        assert archived(client, records, tmp_path / "good.zip", 3).outcomes == expected.outcomes
        # a part of which no file can be read fails; then all of them go up together
        assert archived(client, records, tmp_path / "bad.zip", 1).outcomes == expected.outcomes
    link = f"{served}/api/v1/batches/{made[0].id}"
    assert httpx.get(f"{link}.csv", timeout=30, trust_env=False).text.splitlines()[1].startswith("1,unusable_data,")
    record = httpx.get(f"{link}.npz", timeout=30, trust_env=False).content
    assert batches.unpack_result(record).outcomes == expected.outcomes[2:]
    assert httpx.get(f"{link}.txt", timeout=30, trust_env=False).text == str(batches.unpack_result(record))


def test_a_running_fit_is_cancelled_from_its_page(page, served):
    page.goto("/")
    with jshell.Client(served) as client:
        job = client.submit(RECORDING, profile=True, seed=77)  # a profile compiles for long
        page.goto(f"/fits/{job.id}")
        page.get_by_role("button", name="Cancel").click()
        page.wait_for_selector(".badge.cancelled")
        assert client.job(job.id).state == "cancelled"
        page.get_by_role("link", name="Fit again with changes").click()
        assert page.locator("input[name=profile]").is_checked()


def test_the_shell_is_drawn_as_the_sliders_move(page, served):
    page.goto("/simulate")
    page.wait_for_selector("#shell[data-drawn]", timeout=PATIENT)
    before = page.get_attribute("#shell .wall", "d")
    page.fill("#Pext_hat", "1.7")
    page.wait_for_selector('#shell[data-drawn*="Pext_hat=1.7"]', timeout=PATIENT)
    found = httpx.get(f"{served}/simulate/shape?Pext_hat=1.7", timeout=60, trust_env=False).json()
    modes = jshell.modes(jshell.Reduced(0.22, 0.9, 1.7, 0.004), liquid="second", elements=24)
    assert found["modes"][0]["omega"] == pytest.approx(float(modes.omega[0]), rel=1e-9)
    assert f"{found['modes'][0]['omega']:.4g}" in page.inner_text("#shell-modes")
    assert page.get_attribute("#shell .wall", "d") != before
    # what takes longer follows
    page.wait_for_selector("#shell-exact:has-text('m = 3')", timeout=PATIENT)
    around = jshell.modes(jshell.Reduced(0.22, 0.9, 1.7, 0.004), azimuth=(1, 2, 3), count=1, elements=24).around
    assert around is not None
    said = page.inner_text("#shell-exact")
    assert "Symmetry: round" in said
    for m, omega in zip((1, 2, 3), around.omega[:, 0], strict=True):
        assert f"m = {m}: ω {float(omega):.4g}" in said
    page.click("#play")  # stands still
    page.check('input[name=shown][value="-1"]')
    page.wait_for_timeout(100)
    still = page.get_attribute("#shell .wall", "d")
    page.wait_for_timeout(100)
    assert page.get_attribute("#shell .wall", "d") == still

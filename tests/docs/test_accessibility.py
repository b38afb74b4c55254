"""The built pages under axe, light and dark: nothing serious."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
OPEN = "document.querySelectorAll('details').forEach(one => one.open = true)"
SERIOUS = ("serious", "critical")

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """The pages, without what their cells show: that has no words of its own but the pictures."""
    folder = tmp_path_factory.mktemp("pages")
    words = [sys.executable, "-m", "sphinx", "-q", "-D", "nb_execution_mode=off", "-b", "html", str(DOCS), str(folder)]
    subprocess.run(words, capture_output=True, timeout=900, check=True)
    return folder


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_page_has_a_serious_fault(built, scheme):
    axe = pytest.importorskip("axe_playwright_python.base", reason="pip install axe-playwright-python")
    browsers = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install playwright")
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no chromium: apt-get install chromium")
    faults, looked = {}, 0
    with browsers.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(color_scheme=scheme, viewport={"width": 1280, "height": 900})
        for file in sorted(built.rglob("*.html")):
            name = str(file.relative_to(built))
            if name.startswith("_"):
                continue
            page.goto(f"file://{file}")
            page.evaluate(OPEN)
            page.evaluate(axe.AXE_SCRIPT)
            answer = page.evaluate("axe.run(document)")
            looked += len(answer["passes"]) > 5
            rows = [f"{one['id']} × {len(one['nodes'])}" for one in answer["violations"] if one["impact"] in SERIOUS]
            faults |= {name: rows} if rows else {}
        browser.close()
    assert looked > 50
    assert faults == {}

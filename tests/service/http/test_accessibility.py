"""Every page of the service under axe, in both colours and widths: nothing serious.

The rules are those of axe-core, which `axe-playwright-python` carries. What they find on a page that is spoiled on
purpose shows that they look.
"""

from collections.abc import Iterator

import httpx
import numpy as np
import pytest

import jshell
from jshell.calibration import Recordings

from .conftest import RECORDING

axe = pytest.importorskip("axe_playwright_python.base", reason="pip install axe-playwright-python")
SERIOUS = ("serious", "critical")
OPEN = "document.querySelectorAll('details').forEach(one => one.open = true)"  # what is folded away is read as well


def found(page) -> list[str]:
    """What axe objects to on the page that is open, gravest first."""
    page.evaluate(axe.AXE_SCRIPT)
    answer = page.evaluate("axe.run(document)")
    assert len(answer["passes"]) > 5  # it has looked
    rows = [(row["impact"], row["id"], node["html"]) for row in answer["violations"] for node in row["nodes"]]
    return [" | ".join(row) for row in rows if row[0] in SERIOUS]


@pytest.fixture(scope="module")
def addresses(served: str) -> list[str]:
    """Every page there is, with jobs of every kind, done, failed and waiting."""
    with jshell.Client(served) as client:
        trace = client.upload(RECORDING)
        jobs = [client.submit(trace, fix={"alpha2": 1.1}), client.submit(trace, loss="strict")]
        client.modes(jshell.presets.R.conditions, elements=16, count=2, liquid="ideal", seconds=100)
        shells = jshell.Reduced(*(np.full(2, x) for x in (0.22, 0.9, 1.6, 0.004, 1.4, 0.5)))
        short = Recordings(0.1 * np.arange(20.0), np.full((2, 2, 20), 3.0), shells)  # too short to be fitted
        client.fit_batch(short, seconds=100)
        waited = [job.wait(110).id for job in jobs]
        made = [f"/modes/{next(client.jobs('modes')).id}", f"/batches/{next(client.jobs('batch')).id}"]
    run = {"d_hat": "0.22", "P0_hat": "0.9", "Pext_hat": "1.62", "elements": "16", "duration": "20"}
    made.append(httpx.post(f"{served}/simulations", data=run, timeout=30, trust_env=False).headers["location"])
    return [
        "/", "/fits/new", f"/fits/new?trace={trace}", f"/fits/new?trace={trace}&low.alpha1=5&high.alpha1=4",
        *(f"/fits/{one}" for one in waited), *made, f"/traces/settle?trace={trace}",
        f"/traces/conditions?trace={trace}", "/simulate", "/simulate?d_hat=-1", "/api", "/licences", "/login",
        "/problems/bad_value", "/nothing", f"/inversions/new?trace={trace}",
    ]  # fmt: skip


@pytest.fixture(params=[("light", 1280), ("dark", 390)], ids=["light-1280", "dark-390"])
def page(request, browser, served) -> Iterator:
    scheme, width = request.param
    context = browser.new_context(
        base_url=served, viewport={"width": width, "height": 900}, color_scheme=scheme, bypass_csp=True,
        reduced_motion="reduce",
    )  # fmt: skip
    yield context.new_page()
    context.close()


def test_no_page_has_a_serious_fault(page, addresses):
    faults = {}
    for address in addresses:
        page.goto(address)
        page.evaluate(OPEN)
        faults[address] = found(page)
    assert {address: rows for address, rows in faults.items() if rows} == {}


def test_a_spoiled_page_is_found_out(page):
    page.goto("/simulate")
    page.evaluate("document.querySelector('label[for=Pext_hat]').remove()")
    page.evaluate("document.querySelector('main h1').style.color = 'rgb(150, 160, 170)'")
    rows = found(page)
    assert any("| label |" in row for row in rows)
    grey = "document.body.style.background = document.querySelector('main p').style.color = 'rgb(120, 120, 120)'"
    page.evaluate(grey)
    assert any("| color-contrast |" in row for row in found(page))

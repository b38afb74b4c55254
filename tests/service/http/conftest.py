"""A service to ask: one in this process that only takes jobs in, and one as a user starts it."""

import contextlib
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import uvicorn

from jshell.service.app import create_app
from jshell.service.server import configured
from jshell.service.settings import Settings
from jshell.service.store import Store

ROOT = Path(__file__).parents[3]
RECORDING = ROOT / "data" / "examples" / "attached_R_HW.csv"


@contextlib.contextmanager
def listening(settings: Settings, port: int = 0) -> Iterator[tuple[str, Store]]:
    """A service in a thread, without a worker: jobs wait."""
    store = Store.open(settings.db, queue=settings.queue)
    config = configured(create_app(settings, store), settings)
    config.port = port
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    until = time.monotonic() + 30
    while not server.started:
        assert time.monotonic() < until, "the service did not start"
        time.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield f"http://127.0.0.1:{port}", store
    finally:
        server.should_exit = True
        thread.join(15)
        store.close()


@pytest.fixture(scope="session")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a service that takes jobs and does none."""
    db = tmp_path_factory.mktemp("quiet") / "jobs.db"
    settings = Settings(db=f"sqlite:///{db}", warm=False, queue=100_000, upload=2**20)
    with listening(settings) as (address, _):
        yield address


@pytest.fixture
def http(quiet: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=quiet, timeout=30, trust_env=False) as client:
        yield client


@pytest.fixture(scope="session")
def recording(quiet: str) -> str:
    """Identifier of the example recording, uploaded."""
    with RECORDING.open("rb") as file:
        response = httpx.post(f"{quiet}/api/v1/traces", files={"file": (RECORDING.name, file)}, timeout=30)
    assert response.status_code == 201, response.text
    return response.json()["id"]


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a service started by the one command, with a worker."""
    folder = tmp_path_factory.mktemp("served")
    log = folder / "log"
    command = [
        sys.executable,
        "-m",
        "jshell",
        "serve",
        "--port",
        "0",
        "--cold",
        "--nice",
        "0",
        "--db",
        f"sqlite:///{folder / 'jobs.db'}",
    ]
    with log.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=os.environ | {"JSHELL_TOKEN": ""})
    try:
        until = time.monotonic() + 90
        while (found := re.search(r"http://\S+", log.read_text())) is None or not _answers(found[0]):
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.1)
        yield found[0]
    finally:
        process.terminate()
        try:
            process.wait(25)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10)


def _answers(address: str) -> bool:
    try:
        return httpx.get(f"{address}/healthz", timeout=5, trust_env=False).status_code == 200
    except httpx.TransportError:
        return False


@pytest.fixture(scope="session")
def chromium() -> str:
    """Where Debian's browser is."""
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no chromium: apt-get install chromium")
    return found


@pytest.fixture(scope="session")
def browser(chromium: str) -> Iterator:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def page(browser, served) -> Iterator:
    """A page that must not complain."""
    context = browser.new_context(base_url=served, viewport={"width": 1280, "height": 900})
    opened = context.new_page()
    opened.set_default_timeout(20_000)
    complaints: list[str] = []
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
    yield opened
    context.close()
    expected = ("status of 422", "status of 404")
    assert [text for text in complaints if not any(words in text for words in expected)] == []

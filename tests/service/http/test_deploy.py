"""The files of docs/deploy, looked at without containers: every setting is one that is understood."""

import importlib
import inspect
import ipaddress
import re
import shlex
from pathlib import Path

import httpx
import pytest
import yaml
from typer.testing import CliRunner

from jshell.cli.main import app
from jshell.service import server, settings

from .conftest import RECORDING, listening

DEPLOY = Path(__file__).parents[3] / "docs" / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
TOKEN = "a-long-random-token-of-the-group"


def test_the_server_starts_with_the_settings_of_the_file(monkeypatch):
    """Read by the terminal's own way in, up to the moment at which it would listen."""
    services, told = COMPOSE["services"], []
    command = [
        word.replace("${SITE:?see the top of this file}", "fits.example.org") for word in services["server"]["command"]
    ]
    assert command[:2] == ["jshell", "serve"]
    monkeypatch.setenv("JSHELL_TOKEN", TOKEN)
    monkeypatch.setattr(server, "serve", lambda chosen, report: told.append(chosen))
    monkeypatch.setattr(importlib.import_module("jshell.cli.serve").os, "_exit", lambda code: None)
    done = CliRunner().invoke(app, command[1:])
    assert done.exit_code == 0, done.output
    chosen: settings.Settings = told[0]
    assert (chosen.host, chosen.token) == ("0.0.0.0", TOKEN)
    assert "fits.example.org" in chosen.allowed_hosts
    assert re.fullmatch(r"postgresql\+psycopg://jshell@(\w+)/jshell", chosen.db)[1] in services
    assert re.fullmatch(r"tcp://(\w+):8786", chosen.engine)[1] in services
    inside = COMPOSE["networks"]["inside"]["ipam"]["config"][0]["subnet"]
    assert ipaddress.ip_network(chosen.proxy) == ipaddress.ip_network(inside)


def test_parts_belong_together():
    services = COMPOSE["services"]
    for name, one in services.items():
        assert set(one["networks"]) <= set(COMPOSE["networks"]), name
        assert set(one.get("depends_on", ())) <= set(services), name
        for volume in one.get("volumes", ()):
            source = volume.split(":")[0]
            assert source in COMPOSE["volumes"] or (DEPLOY / source).exists(), volume
    assert [name for name, one in services.items() if "ports" in one] == ["proxy"]  # the world reaches it alone
    caddy = (DEPLOY / "Caddyfile").read_text()
    port = services["server"]["command"][services["server"]["command"].index("--port") + 1]
    assert f"reverse_proxy server:{port}" in caddy
    assert int(services["server"]["stop_grace_period"].removesuffix("s")) > 10
    for word in re.findall(r"\$\{(\w+)", (DEPLOY / "compose.yaml").read_text()):
        assert f"{word}=" in (DEPLOY / "index.md").read_text()
    assert services["worker"]["command"][2] in services["server"]["command"]
    importlib.import_module(services["worker"]["command"][-1])


@pytest.mark.long
@pytest.mark.parametrize("part", ["scheduler", "worker"])
def test_dask_knows_its_options(part):
    words = COMPOSE["services"][part]["command"]
    cli = importlib.import_module(f"distributed.cli.dask_{part}").main
    known = {option for param in cli.params for option in (*param.opts, *param.secondary_opts)}
    assert words[0] == "dask"
    assert {word for word in words if word.startswith("--")} <= known


def test_the_walk_names_options_that_there_are():
    serve = inspect.signature(importlib.import_module("jshell.cli.serve").serve).parameters
    text = (DEPLOY / "index.md").read_text()
    for option in re.findall(r"`--(proxy|root-path|allow-host|workers)", text):
        assert option.replace("-", "_") in serve
    assert all(shlex.split(line) for line in re.findall(r"^docker compose .*$", text, re.M))


@pytest.mark.long
def test_a_name_with_accents_comes_however_a_client_writes_it(http: httpx.Client):
    kind = {"Content-Type": "multipart/form-data; boundary=x"}
    for number, name in enumerate(
        (b"filename*=utf-8''%C3%A9t%C3%A9.csv", b"filename=\"e.csv\"; filename*=UTF-8'fr'%C3%A9t%C3%A9.csv")
    ):
        part = b'--x\r\nContent-Disposition: form-data; name="file"; ' + name + b"\r\n\r\n"
        content = b"# number %d\n" % number + RECORDING.read_bytes()
        sent = http.post("/api/v1/traces", content=part + content + b"\r\n--x--\r\n", headers=kind)
        assert (sent.status_code, sent.json()["name"]) == (201, "été.csv"), sent.text
    told = http.get(f"/api/v1/traces/{sent.json()['id']}/content").headers["content-disposition"]
    assert told == "attachment; filename=\"_t_.csv\"; filename*=UTF-8''%C3%A9t%C3%A9.csv"


@pytest.mark.parametrize("root", ["/fits", "/api"])
def test_a_service_under_a_path_is_the_same_whether_its_proxy_takes_the_path_away_or_not(tmp_path, root):
    chosen = settings.Settings(db=f"sqlite:///{tmp_path / 'jobs.db'}", warm=False, root_path=root)
    with listening(chosen) as (there, _), httpx.Client(base_url=there, timeout=30, trust_env=False) as http:
        for elements in (40, 50):
            job = http.post(f"{root}/api/v1/modes", json={"d_hat": 0.2, "P0_hat": 0.9, "elements": elements})
            assert job.json()["links"]["self"] == job.headers["location"]
        links = job.json()["links"]
        assert links["page"] == f"{root}/modes/{job.json()['id']}"
        listed = http.get("/api/v1/modes?limit=1").json()
        assert listed["jobs"][0]["links"] == links
        assert http.get(listed["next"]).json()["jobs"][0]["links"]["self"].startswith(f"{root}/api/v1/modes/")
        assert listed["next"].startswith(f"{root}/api/v1/modes?")
        assert http.delete(links["self"]).json()["links"] == http.get(links["self"]).json()["links"] == links
        pages = ("/", "/login", "/licences", "/static/jshell.css", "/healthz")
        for path in (*pages, *(one.removeprefix(root) for one in links.values())):
            for asked in (path, root + path):
                assert http.get(asked).status_code == 200, asked
        assert http.get("/fits/new").status_code == http.get(f"{root}/fits/new").status_code != 404
        for path in ("/nothing", "/api/v1/nothing", f"/fits/{'0' * 24}", f"/api/v1/fits/{'0' * 24}"):
            first, second = http.get(path), http.get(root + path)
            assert first.status_code == second.status_code == 404, path
            assert first.headers["content-type"] == second.headers["content-type"], path
        problem = second.json()  # its addresses are those that whoever asks can open
        assert (problem["instance"], http.get(problem["type"]).status_code) == (root + path, 200)
        assert problem["type"] == f"{root}/problems/not_found"

"""What importing the package does, and that its doors lead somewhere."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import jshell

ROOMS = sorted(
    module.name
    for module in pkgutil.iter_modules(jshell.__path__, "jshell.")
    if module.ispkg and module.name != "jshell.plot"
)


def test_importing_the_package_leaves_the_plotter_out():
    code = "import sys, jshell; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_importing_the_package_leaves_the_service_out_until_its_client_is_asked_for():
    code = """
import sys, jshell
assert not [name for name in sys.modules if name.startswith("jshell.service")]
assert {"fastapi", "sqlalchemy", "httpx", "prometheus_client"}.isdisjoint(sys.modules)
assert jshell.Client.__module__ == "jshell.service.client"
assert not hasattr(jshell, "Server")
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["jshell", *ROOMS])
def test_every_announced_name_exists(name):
    module = importlib.import_module(name)
    announced = getattr(module, "__all__", [])
    assert len(set(announced)) == len(announced)
    for member in announced:
        assert hasattr(module, member), f"{name} announces {member}, which does not exist"

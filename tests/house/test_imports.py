"""What importing the package does, and that its doors lead somewhere."""

import importlib
import os
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


@pytest.mark.parametrize(
    ("load", "left_out"),
    [("jshell", {"jax", "numpy", "scipy", "jshell.calibration"}), ("jshell.calibration", {"matplotlib", "httpx"})],
)
def test_importing_leaves_out_what_is_not_needed_yet(load, left_out):
    code = f"import sys, {load}; sys.exit(', '.join({left_out} & set(sys.modules)) or 0)"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("load", ["jshell", "jshell.trace", "jshell.memory", "jax, jshell"])
def test_numbers_are_float64_whatever_is_imported_first(load):
    code = f"import {load}, jax.numpy as jnp; print(jnp.zeros(1).dtype)"
    kept = {key: value for key, value in os.environ.items() if key != "JAX_ENABLE_X64"}
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, env=kept)
    assert done.stdout.strip() == "float64", done.stderr


def test_every_lazy_name_is_known_to_the_package_itself():
    assert set(jshell.__all__) <= set(dir(jshell))
    with pytest.raises(AttributeError, match="no attribute 'nonesuch'"):
        _ = jshell.nonesuch
    assert jshell.Trace is importlib.import_module("jshell.trace").Trace


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


@pytest.mark.parametrize(
    ("room", "old", "new"),
    [("calibration", "campaign", "joint_fits"), ("plot", "paper", "figures"), ("plot", "paper_numbers", "printed")],
)
def test_what_moved_answers_to_its_old_name_and_says_the_new_one(room, old, new):
    module = importlib.import_module(f"jshell.{room}")
    with pytest.warns(DeprecationWarning, match=f"jshell.paper.{new}"):
        assert getattr(module, old) is importlib.import_module(f"jshell.paper.{new}")

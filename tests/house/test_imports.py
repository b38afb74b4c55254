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


@pytest.mark.filterwarnings("ignore:.*is `jshell.paper:DeprecationWarning")  # names of the release before
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

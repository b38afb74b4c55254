"""A service that is told to stop before it has begun."""

import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from jshell.starting import serves

ROOT = Path(__file__).parents[3]
EARLY = "import os, signal, time\nos.kill(os.getpid(), signal.{})\ntime.sleep(5)\n"  # what is imported first


@pytest.mark.parametrize("how", ["module", "script"])
@pytest.mark.parametrize("told", ["SIGTERM", "SIGINT"])
def test_told_to_stop_while_the_first_module_is_imported_it_ends_well(tmp_path, how, told):
    (tmp_path / "platform.py").write_text(EARLY.format(told))  # which `jshell.programs` imports
    module, name = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]["jshell"].split(":")
    script = tmp_path / "bin" / "jshell"
    script.parent.mkdir()
    script.write_text(f"import sys\nfrom {module} import {name}\nsys.exit({name}())\n")  # as an installer writes it
    called = ["-m", "jshell"] if how == "module" else [script]
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run(
        [sys.executable, *called, "serve", "--db", f"sqlite:///{tmp_path}/jobs.db"], capture_output=True, timeout=60,
        env=os.environ | {"PYTHONPATH": paths}, cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.long
def test_another_verb_or_program_ends_as_it_always_did(tmp_path):
    (tmp_path / "platform.py").write_text(EARLY.format("SIGTERM"))
    other = tmp_path / "other.py"
    other.write_text("import jshell\n")
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    for called in (["-m", "jshell", "doctor"], [other, "serve"]):
        done = subprocess.run(
            [sys.executable, *called], capture_output=True, timeout=60, env=os.environ | {"PYTHONPATH": paths}
        )
        assert done.returncode == -signal.SIGTERM, called


@pytest.mark.parametrize(
    ("called", "words", "found"),
    [
        ("python -m jshell serve --port 0", 4, True),
        ("python -X dev -m jshell serve", 2, True),
        ("/usr/bin/python3 /usr/bin/jshell serve", 2, True),
        ("python jshell.exe serve", 2, True),
        ("python -m jshell", 1, False),
        ("python -m jshell submit serve", 3, False),
        ("python other.py jshell serve", 3, False),
        ("python -m other serve", 2, False),
        ("python -c spawn_main() --multiprocessing-fork", 4, False),  # a process of the service's own
        ("python", 0, False),
    ],
)
def test_what_python_was_called_with_says_whether_it_serves(called, words, found):
    assert serves(called.split(), words) is found

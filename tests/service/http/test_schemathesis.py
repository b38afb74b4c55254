"""The API against its own description: requests that fit it and requests that do not, every check, no failure.

One check is left out: that what was deleted is gone. DELETE calls a job off; its line in the list stays.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

CONFIG = Path(__file__).with_name("schemathesis.toml")


def failures(quiet: str, folder: Path, examples: int, phases: str, seconds: float) -> str:
    """Run the fuzzer against a service; what it printed, which is asserted to hold no failure."""
    command = [
        sys.executable,
        "-c",
        "from schemathesis.cli import schemathesis as run; run()",
        "--config-file",
        str(CONFIG),
    ]
    options = ["--checks", "all", "--exclude-checks", "use_after_free", "--max-examples", str(examples)]
    options += ["--phases", phases, "--seed", "0", "--no-color", "--continue-on-failure"]
    done = subprocess.run(
        [*command, "run", f"{quiet}/openapi.json", *options],
        capture_output=True, text=True, timeout=seconds, cwd=folder, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    found = re.search(r"Tested: (\d+)", done.stdout)
    assert found is not None
    assert int(found[1]) >= 29, done.stdout[-3000:]  # every operation was asked
    return done.stdout


def test_the_api_keeps_its_description(quiet, tmp_path):
    failures(quiet, tmp_path, 3, "fuzzing,stateful", 120)


@pytest.mark.slow
def test_the_api_keeps_its_description_for_a_thousand_requests_of_each_kind(quiet, tmp_path):
    failures(quiet, tmp_path, 1000, "examples,coverage,fuzzing,stateful", 3600)

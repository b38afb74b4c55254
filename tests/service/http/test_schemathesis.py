"""The API against its own description: requests that fit it and requests that do not, every check, no failure.

One check is left out: that what was deleted is gone. DELETE calls a job off; its line in the list stays.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from jshell.service import tasks
from jshell.service.jobs import PLURAL
from jshell.service.settings import Settings
from jshell.service.store import JobFailure

from .conftest import RECORDING, listening

CONFIG = Path(__file__).with_name("schemathesis.toml")


def failures(
    quiet: str, folder: Path, examples: int, phases: str, seconds: float, config: Path = CONFIG, operations: int = 29
) -> str:
    """Run the fuzzer against a service; what it printed, which is asserted to hold no failure."""
    command = [
        sys.executable,
        "-c",
        "from schemathesis.cli import schemathesis as run; run()",
        "--config-file",
        str(config),
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
    assert int(found[1]) >= operations, done.stdout[-3000:]  # every operation was asked
    return done.stdout


@pytest.mark.long
def test_the_api_keeps_its_description(quiet, tmp_path):
    failures(quiet, tmp_path, 3, "fuzzing,stateful", 120)


SHELL = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.62, "eta_hat": 0.004, "kappa": 1.4, "nu": 0.5}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, dict[str, str]]]:
    """A service with a job of every kind that is done, and a trace: address, kind to identifier."""
    db = f"sqlite:///{tmp_path_factory.mktemp('done') / 'jobs.db'}"
    with listening(Settings(db=db, warm=False, queue=100_000, upload=2**20)) as (address, store):
        trace = store.add_trace(RECORDING.name, RECORDING.read_bytes()).id
        motion = {"model": "oscillator", "conditions": SHELL, "duration": 5.0, "every": 0.1}
        asked = {
            "fit": ({}, [trace]), "batch": ({}, [trace]), "simulate": (motion, []),
            "modes": ({"conditions": SHELL, "liquid": "ideal", "count": 1, "elements": 12}, []),
            "invert": ({"unknown": ["youngs_modulus"], "exact": False, "elements": 12}, [trace]),
        }  # fmt: skip
        ids = {"traces": trace}
        for kind, (specification, traces) in asked.items():
            job = store.submit(kind, specification, traces).job
            held = store.lease("me", 15)
            made = tasks.run(kind, specification, store.files(traces))
            assert made.files or made.error, made
            outcome = made.files if made.files else JobFailure(**(made.error or {}))
            assert store.finish(job.id, "me", held.attempt, outcome)
            ids[PLURAL[kind]] = job.id
        yield address, ids


@pytest.mark.slow
def test_every_result_is_what_its_description_says(done, tmp_path):
    """Jobs that are done, asked for by their own names: else a fuzzer meets none but those that wait."""
    address, ids = done
    config = tmp_path / "with_ids.toml"
    parts = [
        f"[[operations]]\ninclude-path-regex = '^/api/v1/{plural}/.id.'\nparameters = {{ id = '{name}' }}\n"
        for plural, name in ids.items()
    ]
    config.write_text("\n".join([CONFIG.read_text(), *parts]))
    failures(address, tmp_path, 50, "examples,coverage,fuzzing", 1800, config)


@pytest.mark.slow
def test_the_api_keeps_its_description_for_a_thousand_requests_of_each_kind(quiet, tmp_path):
    failures(quiet, tmp_path, 1000, "examples,coverage,fuzzing,stateful", 3600)

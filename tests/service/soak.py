"""Many fits of many lengths in one process, as a worker does them: memory and compilations. Run as a script."""

import json
import os
import sys
import tempfile
from pathlib import Path

import jax
import numpy as np

import jshell
from jshell import io
from jshell.oscillator import random_shell, random_trace
from jshell.service import tasks

SHELLS = 10
SHORTEST = 401
LONGEST = 1400


def resident() -> float:
    """Memory held [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main(fits: int, lengths: int, settle: int) -> dict[str, float | int]:
    """Fit, and tell what it took."""
    traces = [
        random_trace(random_shell(seed), seed, duration=60.0, samples=LONGEST, noise=0.01) for seed in range(SHELLS)
    ]
    sizes = np.linspace(SHORTEST, LONGEST, lengths).astype(int)
    compiled: list[str] = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, _, **more: compiled.append(name) if name.endswith("backend_compile_duration") else None
    )
    outcomes: dict[str, int] = {}
    base = highest = 0.0
    for number in range(fits):
        whole = traces[number % SHELLS]
        size = int(sizes[number % lengths])
        cut = jshell.Trace(
            np.asarray(whole.times)[:size],
            {name: np.asarray(values)[:size] for name, values in whole.channels.items()},
            whole.conditions,
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "trace.csv"
            io.write_trace(path, cut)
            content = path.read_bytes()
        answer = tasks.run("fit", {"netcdf": False}, [("trace.csv", content)])
        found = json.loads(answer.files["record.json"])["outcome"] if answer.files else "error"
        outcomes[found] = outcomes.get(found, 0) + 1
        if number + 1 == settle:
            base = resident()
        if number + 1 >= settle:
            highest = max(highest, resident())
    return {"compilations": len(compiled), "grown_MB": highest - base, "held_MB": highest, **outcomes}


if __name__ == "__main__":
    print(json.dumps(main(*(int(text) for text in sys.argv[1:4]))))

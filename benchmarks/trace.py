"""How long a rest shape, its modes and a trace of R take, warm: `make bench`.

Prints a table in Markdown. Pin it to one core to compare with the figures in docs/performance.md:

    taskset -c 0 .venv/bin/python benchmarks/trace.py
"""

import os
import time
from collections.abc import Callable

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax

import jshell as js
from jshell.shell import presets

REPEATS = 3


def seconds(job: Callable[[], object]) -> tuple[float, float]:
    """First call, compilation included, and the best of the following."""
    times = []
    for _ in range(1 + REPEATS):
        began = time.perf_counter()
        jax.block_until_ready(job())
        times.append(time.perf_counter() - began)
    return times[0], min(times[1:])


def main() -> None:
    c = presets.R.conditions
    ramped = js.Reduced(c.thickness, c.gas_pressure, 1.62, c.viscosity)
    print(f"cores: {len(os.sched_getaffinity(0))}\n")
    print("| job | elements | first call [s] | warm [s] |")
    print("|---|---|---|---|")
    for elements in (16, 24, 32, 48):
        first, warm = seconds(lambda n=elements: js.dynamics.modes(c, elements=n, count=2).omega)
        print(f"| rest shape and two Stokes-layer modes of R | {elements} | {first:.1f} | {warm:.3f} |")
    for elements in (16, 24, 32, 48):
        first, warm = seconds(lambda n=elements: js.dynamics.simulate(ramped, elements=n).channels["V"])
        print(f"| trace of R, ramp 25 to 1.62, hold to 70, 2800 steps | {elements} | {first:.1f} | {warm:.2f} |")


if __name__ == "__main__":
    main()

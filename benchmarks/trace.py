"""What the simulator costs, warm, on one core: `make bench`.

Prints tables in Markdown: rest shape and modes, the liquid's orders, a trace against the number of elements, batches,
derivatives.
Pin it to one core to compare with the figures in docs/performance.md:

    taskset -c 0 .venv/bin/python benchmarks/trace.py [modes] [liquids] [elements] [batches] [derivatives]

Times are processor seconds of this process. Where a run is long, a tenth of it is timed and multiplied: steps cost
the same throughout.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp

import jshell as js
from jshell.shell import presets

REPEATS = 2
TURNS = 5  # pairs of runs, one after the other, so that a busy machine slows both
DURATION = 70.0
R = presets.R.conditions.as_arrays()
RAMPED = eqx.tree_at(lambda c: c.outer_pressure, R, jnp.asarray(1.62))


def seconds(job: Callable[[], object]) -> tuple[float, float]:
    """First call, compilation included, and the best of the following [processor seconds]."""
    times = []
    for _ in range(1 + REPEATS):
        began = time.process_time()
        jax.block_until_ready(job())
        times.append(time.process_time() - began)
    return times[0], min(times[1:])


def mode_table() -> None:
    """Rest shape and two modes in a viscous liquid, with their error against 64 elements."""
    exact = js.dynamics.modes(R, elements=64, count=2).omega
    print("| rest shape and two modes of R, elements | error of omega | first call [s] | warm [s] |")
    print("|---|---|---|---|")
    for elements in (12, 16, 24, 32, 48):
        job = lambda n=elements: js.dynamics.modes(R, elements=n, count=2).omega  # noqa: E731
        first, warm = seconds(job)
        print(
            f"| {elements} | {float(jnp.max(jnp.abs(job() / exact - 1))):.0e} | {first:.1f} | {warm:.3f} |", flush=True
        )


def liquid_table() -> None:
    """A trace to second order over the same with the layer alone, and modes of R in the exact liquid."""
    to_order = lambda order: js.dynamics.simulate(  # noqa: E731
        RAMPED, elements=24, duration=DURATION, losses=js.dynamics.Losses(order=order)
    )["V"]
    ratios = []
    for _ in range(TURNS):
        layer, second = (min(seconds(lambda order=order: to_order(order))) for order in (1, 2))
        ratios.append(second / layer)
    print("\n| second order over the layer alone, 24 elements, in turn | least | median | largest |")
    print("|---|---|---|---|")
    print(f"| trace of R to {DURATION:g} | {min(ratios):.2f} | {statistics.median(ratios):.2f} | {max(ratios):.2f} |")
    for held in (0.0, 0.3272):
        _, warm = seconds(lambda pad=held: js.dynamics.modes(R, attached=pad, count=4).omega)
        print(f"| four modes of R in the exact liquid, pad {held:g} [s] | {warm:.2f} | – | – |", flush=True)


def element_table() -> None:
    """A trace of R to t = 70: ramp of 25 to 1.62, 4200 steps."""
    print("\n| trace of R, elements | nodes | first call [s] | warm [s] |")
    print("|---|---|---|---|")
    for elements, follow in (
        (16, False),
        (24, False),
        (24, True),
        (32, False),
        (48, False),
        (64, False),
        (128, False),
        (256, False),
    ):
        share = 1 if elements < 64 else 10
        run = lambda n=elements, f=follow, s=share: js.dynamics.simulate(  # noqa: E731
            RAMPED, elements=n, follow=f, duration=DURATION / s
        )["V"]
        first, warm = seconds(run)
        print(f"| {elements} | {'follow' if follow else 'fixed'} | {first:.1f} | {share * warm:.2f} |", flush=True)


def batch_table() -> None:
    """Batches of shells, a tenth of the trace."""
    print("\n| batch of shells, 24 elements | traces per second |")
    print("|---|---|")
    for size in (1, 4, 16, 64):
        shells = eqx.tree_at(lambda c: c.outer_pressure, R, jnp.linspace(1.6, 1.65, size))
        one = jax.jit(jax.vmap(lambda c: js.dynamics.simulate(c, elements=24, duration=DURATION / 10)["V"]))
        shells = jax.tree.map(lambda x, n=size: jnp.broadcast_to(x, (n,)), shells)
        _, warm = seconds(lambda one=one, shells=shells: one(shells))
        print(f"| {size} | {size / (10 * warm):.2f} |", flush=True)


def derivative_table() -> None:
    """The derivative of the mean volume of the trace by the outer pressure."""
    print("\n| derivative of a functional of the trace | over the run | temporary memory [MB] |")
    print("|---|---|---|")
    for elements in (24, 32):

        def mean(P, n=elements):
            trace = js.dynamics.simulate(eqx.tree_at(lambda c: c.outer_pressure, RAMPED, P), elements=n)
            return jnp.mean(trace.channels["V"][600:])

        P = jnp.asarray(1.62)
        forward = jax.jit(mean)
        _, base = seconds(lambda f=forward, at=P: f(at))
        ways = {"reverse": jax.grad(mean), "forward": lambda P, f=mean: jax.jvp(f, (P,), (jnp.ones(()),))[1]}
        for name, way in ways.items():
            compiled = jax.jit(way).lower(P).compile()
            _, warm = seconds(lambda c=compiled, at=P: c(at))
            memory = compiled.memory_analysis().temp_size_in_bytes / 1e6
            print(f"| {name}, {elements} elements | {warm / base:.1f} x | {memory:.0f} |", flush=True)


TABLES = {
    "modes": mode_table,
    "liquids": liquid_table,
    "elements": element_table,
    "batches": batch_table,
    "derivatives": derivative_table,
}


def main() -> None:
    print(f"cores: {len(os.sched_getaffinity(0))}\n")
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main()

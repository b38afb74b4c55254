"""How often 95% intervals hold the truth: white noise, and autocorrelated noise.

One shell, `random_shell(0)`; 2 000 records (seeds 0 to 1999) of V and S, 400 samples, noise 1 % of each
channel's scatter. The fits start at the truth, all at once; each is then judged as `fit_trajectories` judges its
own, and its intervals are those of `FitResult.interval`.

    python benchmarks/coverage.py [replicates]
"""

import operator
import sys
import time
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jshell as js
from jshell.calibration.diagnostics import trace_result
from jshell.calibration.least_squares import SolverResult, levenberg_marquardt
from jshell.calibration.losses import TraceModel, projected
from jshell.calibration.parameters import Unknowns, unknowns
from jshell.calibration.problem import join
from jshell.calibration.records import record

NAMES = ("alpha1", "alpha2", "k_vs", "beta1")
SHELL = js.oscillator.random_shell(0)
BLOCK = 100
STAMPS = ("exact", "9 digits", "3 digits", "jitter", "removed")
TIMES = np.linspace(0.0, 40.0, 400)


def noisy(clean: js.Trace, memory: float, seed: int, noise: float = 0.01) -> js.Trace:
    """The trace with noise e_k = φ e_{k-1} + fresh of `noise` times each channel's scatter."""
    random = np.random.default_rng([seed, 7])
    channels = {}
    for name, values in clean.channels.items():
        fresh = random.standard_normal(np.shape(values))
        e = np.empty_like(fresh)
        e[0] = fresh[0]
        for k in range(1, e.size):
            e[k] = memory * e[k - 1] + np.sqrt(1 - memory**2) * fresh[k]
        channels[name] = np.asarray(values) + noise * np.std(values) * e
    return js.Trace(clean.times, channels, clean.conditions)


def stamped(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """When samples were taken, and what their stamps say.

    Args:
        kind: `exact`; `9 digits` or `3 digits` of stamps; `jitter`, of 1% of a step, known; `removed`, some rows.
    """
    times = TIMES
    if kind == "jitter":
        times = TIMES + 0.01 * TIMES[1] * np.random.default_rng(0).uniform(-1, 1, TIMES.size)
    if kind == "removed":
        times = TIMES[np.arange(TIMES.size) % 37 != 30]
    if kind == "9 digits":
        return times, np.array([float(f"{t:.9g}") for t in times])
    return times, np.round(times, 3) if kind == "3 digits" else times


def coverage(
    memory: float, replicates: int, noise: str = "auto", stamps: str = "exact"
) -> tuple[np.ndarray, int, float]:
    """Share of intervals that hold the truth, how many fits did not end ok, and the mean reduced χ²."""
    times, stamp = stamped(stamps)
    clean = js.oscillator.simulate(
        SHELL.conditions, SHELL.coefficients, initial=SHELL.initial, times=times, equilibrium=SHELL.state
    )
    clean = js.Trace(stamp, clean.channels, clean.conditions)
    c = SHELL.coefficients
    true = np.array([float(x) for x in (c.alpha1, c.alpha2, c.k_vs, c.beta1)])
    parameters = unknowns(NAMES, frozenset({"alpha1", "alpha2", "beta1"}))
    start = jnp.asarray(parameters.unconstrained(true[None])[0])
    held, lost, reduced = np.zeros(4), 0, 0.0
    for at in range(0, replicates, BLOCK):
        traces = [noisy(clean, memory, seed) for seed in range(at, at + BLOCK)]
        models = [TraceModel((record(trace, ("V", "S"), SHELL.state),), "strict") for trace in traces]
        many = jax.tree.map(lambda *rows: jnp.stack(rows), *models)
        endings = fits(parameters, many, start)
        for k, (trace, model) in enumerate(zip(traces, models, strict=True)):
            if at + k >= replicates:
                break
            one = jax.tree.map(operator.itemgetter(slice(k, k + 1)), endings)
            found = trace_result(join(model), parameters, one, true[None], [trace], noise=noise)
            reduced += found.reduced_chi_square
            lost += found.outcome != js.Outcome.OK
            limits = np.array([found.interval(name) for name in NAMES])
            held += (limits[:, 0] < true) & (true < limits[:, 1])
    return held / replicates, lost, reduced / replicates


def batch_coverage(memory: float, replicates: int, noise: str = "auto") -> tuple[np.ndarray, int]:
    """The same of `fit_batch`, and how many rows were not ok; starts and rest states are its own."""
    clean = js.oscillator.simulate(
        SHELL.conditions, SHELL.coefficients, initial=SHELL.initial, times=TIMES, equilibrium=SHELL.state
    )
    found = js.calibration.fit_batch([noisy(clean, memory, seed) for seed in range(replicates)], noise=noise)
    c = SHELL.coefficients
    held = []
    for name in NAMES:
        low, high = found.interval(name)
        held.append(np.mean((low < float(getattr(c, name))) & (float(getattr(c, name)) < high)))
    return np.array(held), int(np.sum(~found.ok))


@eqx.filter_jit
def fits(parameters: Unknowns, models: TraceModel, start: jax.Array) -> SolverResult:
    """One fit for each problem, from one start."""
    free = jnp.full(start.shape, jnp.inf)
    one = lambda model: levenberg_marquardt(  # noqa: E731
        lambda u: projected(parameters.constrained(u), model), start, -free, free
    )
    return eqx.filter_vmap(one)(models)


def main() -> None:
    replicates = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    warnings.simplefilter("ignore")
    print("| noise | errors | stamps | " + " | ".join(NAMES) + " | not ok | χ² per datum | s |")
    print("|---|---|---|" + "---|" * 7)
    cases = [(0.0, "auto", "exact"), (0.9, "auto", "exact"), (0.9, "white", "exact")]
    for memory in (0.0, 0.5, 0.9):
        began = time.perf_counter()
        share, lost = batch_coverage(memory, replicates)
        cells = " | ".join(f"{100 * x:.1f} %" for x in share)
        name = "white" if memory == 0 else f"AR({memory})"
        print(f"| {name} | batch | exact | {cells} | {lost} | – | {time.perf_counter() - began:.0f} |", flush=True)
    for memory, kind, stamps in (*cases, *((0.0, "auto", stamps) for stamps in STAMPS[1:])):
        began = time.perf_counter()
        share, lost, reduced = coverage(memory, replicates, kind, stamps)
        cells = " | ".join(f"{100 * x:.1f} %" for x in share)
        name = "white" if memory == 0 else f"AR({memory})"
        print(
            f"| {name} | {kind} | {stamps} | {cells} | {lost} | {reduced:.3f} | {time.perf_counter() - began:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()

"""One measurement of `gpu.py`, in a process of its own: says what it found as lines of JSON.

python benchmarks/gpu_rows.py traces --counts 16 --on gpu --folder FOLDER
"""

import argparse
import fcntl
import json
import time
from contextlib import contextmanager, nullcontext
from functools import lru_cache
from pathlib import Path

CHUNK = {"fits": 50_000, "settled": 50_000, "second": 64, "exact": 16, "traces": 256}  # in one program: bounds memory
ELEMENTS, TRACED, DURATION = 32, 24, 7.0  # of modes; of a trace, a tenth of the usual run
TRIES = 3
SETTLED = 1e-16  # of the cost: a search ends where its next step promises less, 3e-7 standard errors


@contextmanager
def alone(folder: Path):
    """Nothing else is timed on the GPU meanwhile."""
    with open(folder / "gpu.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def shells(count: int):
    """R under other loads and in other liquids."""
    import numpy as np

    import jshell as js

    R = js.presets.R.conditions
    return js.Reduced(R.thickness, R.gas_pressure, np.linspace(1.6, 1.66, count), np.linspace(0.002, 0.006, count))


def vibrating(kind: str):
    """A function of one shell: ω, τ and the outcome of its four slowest modes."""
    import jax.numpy as jnp

    import jshell as js

    def modes(shell):
        found = js.dynamics.modes(shell, liquid=kind, elements=ELEMENTS)
        return jnp.stack([found.omega, found.tau, found.outcome.astype(float)])

    return modes


def moving(kind: str):
    """A function of one shell: V in time."""
    import jshell as js

    return lambda shell: js.dynamics.simulate(shell, elements=TRACED, duration=DURATION)["V"]


def batched(kind: str, count: int, say, lock) -> None:
    """Shells by vmap, or in turn on a CPU where that is quicker; compiled ahead of time, then timed."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    one = (moving if kind == "traces" else vibrating)(kind)
    chunk = min(count, CHUNK[kind])
    in_turn = jax.default_backend() == "cpu"
    run = jax.jit((lambda s: jax.lax.map(one, s)) if in_turn else jax.vmap(one))
    everything = shells(count).as_arrays()
    rows = everything.outer_pressure.shape
    part = lambda at: jax.tree.map(lambda x: jnp.broadcast_to(x, rows)[at : at + chunk], everything)  # noqa: E731
    began = time.perf_counter()
    program = run.lower(part(0)).compile()
    compiled = time.perf_counter() - began
    times = []
    with lock():
        for _ in range(TRIES):
            began = time.perf_counter()
            found = [np.asarray(program(part(at))) for at in range(0, count, chunk)]
            times.append(time.perf_counter() - began)
            if sum(times) > 20:
                break
    values = np.concatenate(found)
    ended = int(np.sum(values[:, 2] == 0)) if kind != "traces" else int(np.sum(np.isfinite(values).all(axis=1)))
    say(kind, count, compiled, min(times), len(times), {"values": values}, ok=ended, of=int(values[:, -1].size))


@lru_cache
def _drawn(count: int) -> list:
    from jshell.oscillator.sampler import random_shell

    return [random_shell(seed) for seed in range(count)]


def records(count: int, seed: int):
    """Random shells' exact motions with 1 % noise, by the library's own generator of batches."""
    import numpy as np

    import jshell as js
    from jshell.calibration import Recordings
    from jshell.oscillator import Coefficients
    from jshell.oscillator.ensemble import traces
    from jshell.shell.rest import RestState

    drawn = _drawn(200)
    random = np.random.default_rng(seed)
    which = random.integers(0, len(drawn), count)
    pick = lambda get: np.array([float(get(s)) for s in drawn])[which]  # noqa: E731
    conditions = js.Reduced(
        *(
            pick(lambda s, n=n: getattr(s.conditions, n))
            for n in ("thickness", "gas_pressure", "outer_pressure", "viscosity")
        )
    )
    constants = [
        pick(lambda s, n=n: getattr(s.coefficients, n)) for n in ("alpha1", "alpha2", "k_vs", "beta1", "beta2")
    ]
    rest = RestState(pick(lambda s: s.state.volume), pick(lambda s: s.state.pressure))
    initial = np.array([s.initial for s in drawn])[which].T * random.uniform(0.5, 1.5, (4, count))
    moves = traces(conditions, Coefficients(*constants), rest, initial, 0.1, 400)
    values = np.stack([np.asarray(moves.volume) + rest.volume, np.asarray(moves.area) + 4 * np.pi]).transpose(2, 0, 1)
    values = np.ascontiguousarray(values)
    noise = random.standard_normal(values.shape, np.float32)
    values += 0.01 * values.std(axis=2, keepdims=True) * noise
    return Recordings(0.1 * np.arange(400), values, conditions)


def fitted(kind: str, count: int, begin: int, say, lock) -> None:
    """Fits of V and S, in chunks: as a user's, or each search to its very end, where alone both can agree."""
    import jax
    import numpy as np

    from jshell.calibration import fit_batch
    from jshell.signals import lane_search

    if kind == "settled":
        lane_search.FLAT = SETTLED
    chunk, first, spent, parts, repeats = min(count, CHUNK[kind]), 0.0, 0.0, [], 1
    own = []
    for k, at in enumerate(range(0, count, chunk)):
        with jax.default_device(jax.devices("cpu")[0]):  # the same data for both
            batch = records(min(chunk, count - at), begin + k)
        if k == 0:
            began = time.perf_counter()
            fit_batch(batch)
            first, repeats = time.perf_counter() - began, TRIES if count <= chunk else 1
        with lock():
            times = []
            for _ in range(repeats):
                began = time.perf_counter()
                found = fit_batch(batch)
                times.append(time.perf_counter() - began)
        spent += min(times)
        parts.append((found.values[:, :4], found.stderr[:, :4], found.outcome))
        if kind == "settled":
            own.append(np.abs(fit_batch(nudged(batch)).values[:, :4] - found.values[:, :4]) / found.stderr[:, :4])
    values, stderr, outcome = (np.concatenate(x) for x in zip(*parts, strict=True))
    given = {"values": values, "stderr": stderr, "outcome": outcome}
    if own:
        given["own"] = np.concatenate(own)
    say(kind, count, first, spent, repeats, given, ok=int(np.sum(outcome == 0)), of=count)


def nudged(batch):
    """The same records, the last bit of every sample turned up, down or left: what rounding alone may do to a fit."""
    import dataclasses

    import numpy as np

    turned = np.random.default_rng(0).integers(-1, 2, batch.values.shape)
    return dataclasses.replace(batch, values=batch.values + turned * np.spacing(batch.values))


def eigenvalues(say, lock) -> None:
    """The only part of jshell that asks for eigenvalues of a matrix without symmetry: does the device have them?"""
    import jax
    import numpy as np

    from jshell.oscillator import damped_modes, matrices
    from jshell.shell.rest import RestState

    with jax.default_device(jax.devices("cpu")[0]):
        drawn = _drawn(64)
    stack = lambda get: jax.tree.map(lambda *x: np.array([float(y) for y in x]), *map(get, drawn))  # noqa: E731
    given = stack(lambda s: s.conditions), stack(lambda s: s.coefficients), stack(lambda s: RestState(*s.state))
    run = jax.jit(jax.vmap(lambda c, k, s: damped_modes(matrices(k, s, c))))
    began = time.perf_counter()
    found = jax.block_until_ready(run(*given))
    first, began = time.perf_counter() - began, time.perf_counter()
    with lock():
        found = jax.block_until_ready(run(*given))
    # by size and frequency, each rounded: a pair's real parts tie but for rounding, and may stand either way
    values = np.array([sorted(row, key=lambda z: (round(abs(z), 9), round(z.imag, 9))) for row in np.asarray(found)])
    say("eigenvalues", 64, first, time.perf_counter() - began, 1, {"values": values}, ok=64, of=64)


def child(args) -> None:
    """Measure what is asked for and write rows."""
    folder = Path(args.folder)
    import jshell as js  # noqa: F401  # float64 before JAX

    began = time.perf_counter()
    import jax

    device = jax.devices()[0]
    gpu = device.platform != "cpu"
    lock = (lambda: alone(folder)) if gpu else nullcontext

    def say(kind, count, first, warm, repeats, arrays, **more):
        import resource

        import numpy as np

        np.savez(folder / f"{kind}-{count}-{args.on}-{args.begin}.npz", **arrays)
        stats = (device.memory_stats() or {}) if gpu else {}
        row = {
            "kind": kind, "count": count, "on": args.on, "device": device.device_kind, "first_s": round(first, 3),
            "warm_s": round(warm, 5), "repeats": repeats, **more,
            "gpu_gb": round(stats.get("peak_bytes_in_use", 0) / 1e9, 2),
            "host_gb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, 2),
            "started_s": round(time.perf_counter() - began, 1),
        }  # fmt: skip
        print("ROW " + json.dumps(row), flush=True)

    for count in args.counts:
        if args.kind in ("fits", "settled"):
            fitted(args.kind, count, args.begin, say, lock)
        elif args.kind == "eigenvalues":
            eigenvalues(say, lock)
        else:
            batched(args.kind, count, say, lock)


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("kind")
    ask.add_argument("--counts", type=int, nargs="+", required=True)
    ask.add_argument("--on", required=True, help="what the rows say of the place")
    ask.add_argument("--folder", required=True, help="where the numbers go, and the lock is")
    ask.add_argument("--begin", type=int, default=0, help="seed of the first records")
    child(ask.parse_args())


if __name__ == "__main__":
    main()

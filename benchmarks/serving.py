"""How fast the service answers, and what HTTP costs a batch.

Starts `jshell serve` as a user does, asks it from this process, and prints tables in Markdown. Without arguments all of
them, else those named:

    .venv/bin/python benchmarks/serving.py clients full batch short

`clients`: 32 clients hand in 1 000 different fits while the worker fits them. `full`: the same against a short queue.
`batch`: 10 000 traces handed in at once, as arrays in memory, as one file of arrays, as files of traces in an archive;
against `fit_batch` in this process from the same arrays, file and files, both warm, in turn; the same numbers to the
bit, else it fails. `short`: the same for arrays of fewer samples. `floor.py` shows what the least that any service does
would leave of it.
"""

import contextlib
import http.client
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from jshell import Client, Reduced
from jshell.calibration import Recordings, fit_batch, recordings_file
from jshell.calibration.recordings_file import CONDITIONS
from jshell.io import read_trace, write_trace
from jshell.trace import Trace

CLIENTS, FITS = 32, 1_000
ROWS, TURNS = 10_000, 8
REST = 0.5  # [s] before a turn, in which the service brings its log home
RECORDING = Path(__file__).parents[1] / "data" / "examples" / "attached_R_HW.csv"


@contextlib.contextmanager
def served(*options: str) -> Iterator[str]:
    """Address of a fresh service."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        command = [
            sys.executable,
            "-m",
            "jshell",
            "serve",
            "--port",
            "0",
            "--db",
            f"sqlite:///{folder}/jobs.db",
            *options,
        ]
        with log.open("wb") as out:
            process = subprocess.Popen(
                command, stdout=out, stderr=subprocess.STDOUT, env=os.environ | {"JSHELL_TOKEN": ""}
            )
        try:
            until = time.monotonic() + 120
            while (found := re.search(r"http://\S+", log.read_text())) is None:
                if process.poll() is not None or time.monotonic() > until:
                    raise RuntimeError(log.read_text())
                time.sleep(0.1)
            with Client(found[0]) as client:
                while not client.healthy():
                    time.sleep(0.1)
            yield found[0]
        finally:
            process.terminate()
            process.wait(30)


def handed_in(address: str, trace: str) -> tuple[Counter, np.ndarray, float]:
    """Statuses and times of all submits, and the wall time they took together."""
    where, numbers, turn = urlsplit(address), iter(range(FITS)), threading.Lock()
    statuses: Counter = Counter()
    spent: list[float] = []

    def ask() -> None:
        line = http.client.HTTPConnection(where.hostname or "", where.port, timeout=60)
        while True:
            with turn:
                number = next(numbers, None)
            if number is None:
                return
            body = json.dumps({"traces": [trace], "seed": number, "fix": {"alpha2": 1.1}})
            begun = time.perf_counter()
            line.request("POST", "/api/v1/fits", body, {"Content-Type": "application/json"})
            answer = line.getresponse()
            answer.read()
            took = time.perf_counter() - begun
            with turn:
                statuses[answer.status] += 1
                spent.append(took)

    begun = time.perf_counter()
    threads = [threading.Thread(target=ask) for _ in range(CLIENTS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return statuses, 1e3 * np.array(spent), time.perf_counter() - begun


def said(statuses: Counter) -> str:
    return ", ".join(f"{count} × {status}" for status, count in sorted(statuses.items()))


def clients() -> None:
    """32 clients, 1 000 fits."""
    with served("--queue", "2000", "--workers", "1") as address, Client(address) as client:
        trace = client.upload(RECORDING)
        client.submit(trace, fix={"alpha2": 1.1}, seed=10**6).result(300)  # compiled
        statuses, spent, whole = handed_in(address, trace)
        begun = time.perf_counter()
        while sum(1 for _ in client.jobs(state="done")) < FITS + 1:
            time.sleep(1.0)
            if time.perf_counter() - begun > 1800:
                raise RuntimeError("not all fits ended")
        fitted = FITS / (whole + time.perf_counter() - begun)
    print(f"\n### {CLIENTS} clients, {FITS} fits, one worker process\n")
    print("| answers | submits/s | median [ms] | p95 [ms] | worst [ms] | fits/s |\n|---|---|---|---|---|---|")
    p = np.quantile(spent, [0.5, 0.95, 1.0])
    print(
        f"| {said(statuses)} | {FITS / whole:.0f} | {p[0]:.0f} | {p[1]:.0f} | {p[2]:.0f} | {fitted:.1f} |", flush=True
    )


def full() -> None:
    """The same against a queue of 100."""
    with served("--queue", "100", "--cold") as address, Client(address) as client:
        statuses, spent, _ = handed_in(address, client.upload(RECORDING))
    print(f"\n### a queue of 100, {CLIENTS} clients, {FITS} fits\n")
    print(f"| answers | p95 [ms] |\n|---|---|\n| {said(statuses)} | {np.quantile(spent, 0.95):.0f} |", flush=True)


def batch() -> None:
    """10 000 traces of 400 samples in one call, beside the library's own way with the same traces.

    Other ones in every turn, for the service keeps equal bytes once. The best of its turns, and the median of all.
    """
    from fits import recordings

    records, _ = recordings(ROWS, 0.01)
    fit_batch(records)
    print(f"\n### one batch of {ROWS} traces of 400 samples, {records.values.nbytes / 2**20:.0f} MiB\n")
    print("| handed in as | worker processes | library [s] | through HTTP [s] | of its throughput, best | median |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for workers in ("1", "2"):
            with served("--workers", workers) as address, Client(address, timeout=600) as client:
                client.fit_batch(records, seed=TURNS, seconds=1800)  # every process has compiled
                for kind, turns in (("arrays", TURNS), ("npz", TURNS), ("trace files", 1)):
                    records, row = compared(client, kind, records, turns, Path(folder))
                    print(f"| {kind} | {workers} | {row} |", flush=True)


def short() -> None:
    """The same arrays with every second and every fourth sample, two worker processes."""
    from fits import recordings

    whole, _ = recordings(ROWS, 0.01)
    print(f"\n### one batch of {ROWS} shorter traces, arrays in memory, two worker processes\n")
    print("| samples | library [s] | through HTTP [s] | of its throughput, best | median |\n|---|---|---|---|---|")
    for every in (2, 4):
        values = np.ascontiguousarray(np.asarray(whole.values)[:, :, ::every])
        records = Recordings(np.asarray(whole.times)[::every], values, whole.conditions)
        fit_batch(records)
        with served("--workers", "2") as address, Client(address, timeout=600) as client:
            client.fit_batch(records, seed=TURNS, seconds=1800)  # every process has compiled
            _, row = compared(client, "arrays", records, TURNS, Path())
        print(f"| {values.shape[2]} | {row} |", flush=True)


def compared(client: Client, kind: str, records: Recordings, turns: int, folder: Path) -> tuple[Recordings, str]:
    """The latest records, and times and ratios as cells of a row."""
    spent = []
    for turn in range(turns):
        records = changed(records)
        mine, theirs = handed(kind, records, folder)
        time.sleep(REST)
        begun = time.perf_counter()
        here = mine(turn)
        fitted = time.perf_counter()
        there = theirs(client, turn)
        spent.append((fitted - begun, time.perf_counter() - fitted))
        if not np.array_equal(here.values, there.values, equal_nan=True):
            raise RuntimeError("other numbers through HTTP than here")
    best, middle = np.min(spent, axis=0), np.median(spent, axis=0)
    return records, f"{best[0]:.2f} | {best[1]:.2f} | {best[0] / best[1]:.2f} | {middle[0] / middle[1]:.2f}"


def handed(kind: str, records: Recordings, folder: Path) -> tuple[Callable, Callable]:
    """The library's own way from what a user has to a result, and the way over HTTP."""
    if kind == "arrays":
        return (
            lambda seed: fit_batch(records, seed=seed),
            lambda client, seed: client.fit_batch(records, seed=seed, seconds=1800),
        )
    if kind == "npz":
        path = folder / "batch.npz"
        path.write_bytes(recordings_file.encode(records))
        return (
            lambda seed: fit_batch(recordings_file.decode(path.read_bytes()), seed=seed),
            lambda client, seed: client.fit_batch(path, seed=seed, seconds=1800),
        )
    paths, whole = [folder / f"{row:05d}.csv" for row in range(ROWS)], folder / "traces.zip"
    conditions = np.array([np.broadcast_to(getattr(records.conditions, n), (ROWS,)) for n in CONDITIONS])
    with zipfile.ZipFile(whole, "w") as archive:
        for path, values, mine in zip(paths, records.values, conditions.T, strict=True):
            write_trace(path, Trace(np.asarray(records.times), dict(zip("VS", values, strict=True)), Reduced(*mine)))
            archive.write(path, path.name)
    return (
        lambda seed: fit_batch([read_trace(path) for path in paths], seed=seed),
        lambda client, seed: client.fit_batch(whole, seed=seed, seconds=1800),
    )


def changed(records: Recordings) -> Recordings:
    """The same but for the last digit of every first sample."""
    values = np.array(records.values)
    values[:, 0, 0] = np.nextafter(values[:, 0, 0], np.inf)
    return Recordings(records.times, values, records.conditions, records.sigma, records.counts)


def main() -> None:
    for name in sys.argv[1:] or ("clients", "full", "batch", "short"):
        {"clients": clients, "full": full, "batch": batch, "short": short}[name]()


if __name__ == "__main__":
    main()

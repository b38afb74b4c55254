"""What the service costs: jobs through the store, fits through worker and engine, a batch of thousands in one job.

The same fits in every row, all compiled beforehand; ratios are to this process doing them by itself. PostgreSQL is a
private one in a temporary folder, Dask a local cluster; both are left out, in words, where they are not installed.
"""

import argparse
import contextlib
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from jshell import io
from jshell.calibration import Recordings, fit_batch, recordings_file
from jshell.calibration.recordings import stacked
from jshell.oscillator import random_shell, random_trace
from jshell.service import batches, tasks
from jshell.service.settings import Settings
from jshell.service.store import Store
from jshell.service.worker import Worker

PATIENCE = 3600.0


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--fits", type=int, default=200)
    options.add_argument("--batch", type=int, default=10_000)
    options.add_argument("--jobs", type=int, default=1000)
    options.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    asked = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="jshell-bench-") as folder, postgresql() as server:
        databases = {"SQLite": f"sqlite:///{folder}/jobs.db"}
        if server is None:
            print("PostgreSQL is not installed: its rows are missing.\n")
        else:
            databases["PostgreSQL"] = server
        print("| database | submissions/s | leases and finishes/s |\n|---|---|---|")
        for name, url in databases.items():
            print(f"| {name} | {' | '.join(f'{rate:.0f}' for rate in store_rates(url, asked.jobs))} |", flush=True)
        contents = trace_files(asked.fits)
        alone = library_rate(contents)
        print(f"\n| {asked.fits} fits of 400 samples | fits/s | of this process alone |\n|---|---|---|")
        print(f"| this process alone, no service | {alone:.1f} | 1 |", flush=True)
        rows = [("SQLite, 1 process", databases["SQLite"], "processes", 1)]
        if asked.workers > 1:
            rows.append((f"SQLite, {asked.workers} processes", databases["SQLite"], "processes", asked.workers))
        with dask(asked.workers) as address:
            if server is not None and address is not None:
                rows.append((f"PostgreSQL, Dask with {asked.workers} workers", server, address, asked.workers))
            for words, url, engine, workers in rows:
                rate = service_rate(url, engine, workers, contents)
                print(f"| {words} | {rate:.1f} | {rate / alone:.2f} |", flush=True)
        records = many(asked.batch)
        print(f"\n| one batch of {asked.batch} traces | traces/s | of the library |\n|---|---|---|")
        plain = batch_rate(records)
        print(f"| `fit_batch` | {plain:.0f} | 1 |", flush=True)
        rate = batch_job_rate(databases["SQLite"], records)
        print(f"| one job: upload kept, fitted in a process, results kept | {rate:.0f} | {rate / plain:.2f} |")


def store_rates(url: str, count: int) -> tuple[float, float]:
    """Submissions, and leases with finishes, of one thread."""
    store = Store.open(url, queue=10**6)
    began = time.perf_counter()
    for number in range(count):
        store.submit("simulate", {"number": number}, [], f"key {number}")
    between = time.perf_counter()
    content = os.urandom(20_000)
    while (job := store.lease("bench", 60)) is not None:
        store.finish(job.id, "bench", job.attempt, {"record.json": content})
    ended = time.perf_counter()
    store.close()
    return count / (between - began), count / (ended - between)


def trace_files(count: int) -> list[bytes]:
    """Traces of random shells as CSV."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.csv"
        for seed in range(count):
            io.write_trace(path, random_trace(random_shell(seed), seed))
            found.append(path.read_bytes())
    return found


def library_rate(contents: Sequence[bytes]) -> float:
    """Fits of this process."""
    for content in contents[:10]:
        tasks.run("fit", {"netcdf": False}, [("trace.csv", content)])
    began = time.perf_counter()
    for content in contents:
        answer = tasks.run("fit", {"netcdf": False}, [("trace.csv", content)])
        assert answer.files, answer
    return len(contents) / (time.perf_counter() - began)


def service_rate(url: str, engine: str, workers: int, contents: Sequence[bytes]) -> float:
    """Fits from submission to result, once every process has compiled."""
    store = Store.open(url, queue=10**6)
    worker = Worker(Settings(db=url, engine=engine, workers=workers), store)
    worker.start()
    traces = [store.add_trace("trace.csv", content).id for content in contents]
    # every row is a job of its own, by its seed; the first ones make every process compile
    seed = int(time.time())
    first = [submit(store, trace, seed - 1) for trace in traces[: 4 * workers]]
    wait(store, first)
    began = time.perf_counter()
    jobs = [submit(store, trace, seed) for trace in traces]
    wait(store, jobs)
    took = time.perf_counter() - began
    assert all(store.job(job).state == "done" for job in jobs)
    worker.stop(10)
    store.close()
    return len(contents) / took


def submit(store: Store, trace: str, seed: int) -> str:
    """A fit of a trace."""
    return store.submit("fit", {"netcdf": False, "seed": seed}, [trace]).job.id


def wait(store: Store, jobs: Sequence[str]) -> None:
    """Until all are over; the last is looked at first, for it ends last."""
    deadline = time.monotonic() + PATIENCE
    for job in reversed(jobs):
        while not store.job(job).over:
            assert time.monotonic() < deadline
            time.sleep(0.02)


def many(count: int) -> Recordings:
    """Traces of random shells as arrays."""
    return stacked([random_trace(random_shell(seed), seed) for seed in range(count)])


def batch_rate(records: Recordings) -> float:
    """Traces of this process, in one call, compiled beforehand."""
    rows = np.shape(records.values)[0]
    fit_batch(records)
    began = time.perf_counter()
    fit_batch(records)
    return rows / (time.perf_counter() - began)


def batch_job_rate(url: str, records: Recordings) -> float:
    """Traces of one job, from the bytes of the upload to those of the result; the process has compiled beforehand."""
    store = Store.open(url, queue=10**6)
    worker = Worker(Settings(db=url, seconds=PATIENCE), store)
    worker.start()
    content = recordings_file.encode(records)
    trace = store.add_trace("many.npz", content).id
    wait(store, [store.submit("batch", {"seed": 1}, [trace]).job.id])
    rows = np.shape(records.values)[0]
    values = np.array(records.values)
    values[0, 0, 0] = np.nextafter(values[0, 0, 0], 9)  # other bytes: a new upload
    again = recordings_file.encode(Recordings(records.times, values, records.conditions, records.sigma, records.counts))
    began = time.perf_counter()
    trace = store.add_trace("again.npz", again).id
    job = store.submit("batch", {"seed": 2}, [trace]).job.id
    wait(store, [job])
    found = batches.unpack_result(store.result(job, "record.npz"))
    took = time.perf_counter() - began
    assert len(found) == rows
    worker.stop(10)
    store.close()
    return rows / took


@contextlib.contextmanager
def dask(workers: int) -> Iterator[str | None]:
    """The address of a local cluster, where Dask is installed."""
    try:
        from distributed import LocalCluster
    except ImportError:
        print("Dask is not installed: its row is missing.\n")
        yield None
        return
    with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


@contextlib.contextmanager
def postgresql() -> Iterator[str | None]:
    """The address of a private, empty database that waits for the disk as any other; None where there is no server."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    which = shutil.which("initdb")
    binaries = found[-1] if found else Path(which).parent if which else None
    if binaries is None:
        yield None
        return
    folder = Path(tempfile.mkdtemp(prefix="jshell-pg-", dir="/tmp"))
    who: dict = {}
    if os.geteuid() == 0:  # it refuses to run as root
        user = pwd.getpwnam("postgres")
        os.chown(folder, user.pw_uid, user.pw_gid)
        who = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
    made = [binaries / "initdb", "-D", folder / "data", "-U", "jshell", "-A", "trust", "-E", "UTF8", "--locale=C"]
    subprocess.run(made, check=True, capture_output=True, timeout=120, cwd=folder, **who)
    options = ["-c", "listen_addresses=", "-c", f"unix_socket_directories={folder}"]
    server = subprocess.Popen(
        [binaries / "postgres", "-D", folder / "data", *options], cwd=folder, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, **who,
    )  # fmt: skip
    try:
        ready = [binaries / "pg_isready", "-q", "-h", folder]
        for _ in range(300):
            if subprocess.run(ready, timeout=30, check=False).returncode == 0:
                break
            time.sleep(0.1)
        yield f"postgresql+psycopg://jshell@/postgres?host={folder}"
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(60)
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()

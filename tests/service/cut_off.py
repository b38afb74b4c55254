"""A cluster, or a whole service, that is gone for a while and comes back. Run as a script; prints JSON."""

import contextlib
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from crash import TIMEOUT, Counting, cheap

from jshell.service.database import Database
from jshell.service.settings import Settings
from jshell.service.worker import Worker


def dask(url: str, jobs: int, pause: float, patience: float) -> dict:
    """A cluster whose scheduler stops for a while, dies and comes back; and whose worker is cut off for a while."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    program = [sys.executable, "-W", "ignore", "-m"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def scheduler() -> subprocess.Popen:
        options = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-show"]
        return subprocess.Popen([*program, "distributed.cli.dask_scheduler", *options], **quiet)

    def workers() -> list[subprocess.Popen]:
        options = [address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60"]
        return [subprocess.Popen([*program, "distributed.cli.dask_worker", *options], **quiet) for _ in range(2)]

    processes = [scheduler()]
    processes += workers()
    store = Counting(Database(url))
    worker = Worker(Settings(db=url, engine=address, workers=2, lease=5, warm=False), store)
    began = time.monotonic()

    def wait_for(done: int) -> None:
        while store.counts()["done"] < done and time.monotonic() - began < patience:
            time.sleep(0.05)

    try:
        worker.start()
        names = [store.submit("simulate", cheap(number), []).job.id for number in range(jobs)]
        wait_for(jobs // 6)
        processes[0].send_signal(signal.SIGSTOP)
        time.sleep(pause)
        processes[0].send_signal(signal.SIGCONT)
        wait_for(jobs // 3)
        processes[1].send_signal(signal.SIGSTOP)  # a worker is cut off
        time.sleep(pause)
        processes[1].send_signal(signal.SIGCONT)
        wait_for(jobs // 2)
        # one of seconds among those of milliseconds: something is under way when everything dies
        names.append(store.submit("simulate", cheap(jobs) | {"every": 5e-6}, []).job.id)
        while store.job(names[-1]).state == "queued" and time.monotonic() - began < patience:
            time.sleep(0.05)
        for one in processes:
            one.kill()
            one.wait(30)
        time.sleep(pause)
        processes[:] = [scheduler(), *workers()]
        wait_for(jobs + 1)
        rows = [store.job(name) for name in names]
    finally:
        worker.stop(10)
        for one in processes:
            with contextlib.suppress(ProcessLookupError):
                one.kill()
            one.wait(30)
    return {
        "done": sum(row.state == "done" for row in rows),
        "stuck": sum(not row.over for row in rows),
        "twice": sum(count > 1 for count in store.recorded.values()),
        "again": sum(row.attempt > 1 for row in rows),
        "seconds": round(time.monotonic() - began, 1),
    }


def late(url: str, cache: str) -> dict:
    """A service frozen for longer than its lease, while another does its job."""
    store = Counting(Database(url))
    frozen = subprocess.Popen(
        [sys.executable, "-W", "ignore", str(Path(__file__).with_name("crash.py")), "servant", url, cache],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert frozen.stdout is not None
    assert frozen.stdout.readline() == "started\n"
    job = store.submit("simulate", cheap(1) | {"every": 5e-6}, []).job.id
    _wait(lambda: store.job(job).state == "running")
    first = store.job(job)
    frozen.send_signal(signal.SIGSTOP)
    worker = Worker(Settings(db=url, lease=2, cache=cache, warm=False), store)
    worker.start()
    _wait(lambda: store.job(job).over)
    frozen.send_signal(signal.SIGCONT)
    # what the frozen one would say now, and what it says itself in the seconds that follow
    refused = int(not store.finish(job, first.owner or "", first.attempt, {"late": b""}))
    time.sleep(10)
    row = store.job(job)
    frozen.terminate()
    frozen.wait(30)
    frozen.stdout.close()
    worker.stop(10)
    names = store.result_names(job)
    recorded = store.recorded[job] + ("late" in names)
    store.close()
    return {"state": row.state, "attempt": row.attempt, "recorded": recorded, "refused": refused}


def _wait(until: Callable[[], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT
    while not until():
        if time.monotonic() > deadline:
            raise TimeoutError("the service does not do its job")
        time.sleep(0.02)


COMMANDS = {
    "dask": lambda a: dask(a[0], int(a[1]), float(a[2]), float(a[3])),
    "late": lambda a: late(a[0], a[1]),
}

if __name__ == "__main__":
    print(json.dumps(COMMANDS[sys.argv[1]](sys.argv[2:])))

"""A service that is stopped and started again and again, as a user does it. Run as a script; prints JSON."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import sqlalchemy as sa
from crash import Counting, cheap

from jshell.service import tables
from jshell.service.database import Database

SERVE = (sys.executable, "-m", "jshell", "serve", "--port", "0", "--nice", "0")
PATIENCE = 3600.0


def begun(url: str, log: Path, *options: str) -> subprocess.Popen:
    """`jshell serve`, without waiting for it."""
    with log.open("ab") as out:
        return subprocess.Popen(
            [*SERVE, "--db", url, *options], stdout=out, stderr=out, env=os.environ | {"JSHELL_TOKEN": ""}
        )


def starts(times: int, seed: int) -> dict:
    """Started, and told to end after 0 to 2 s from then on; apart those told before Python was at our first line."""
    chance, log = random.Random(seed), b""
    codes: dict[int, int] = {}
    before: dict[int, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(times):
            process = begun(f"sqlite:///{folder}/jobs.db", Path(folder) / "log")
            time.sleep(chance.uniform(0.0, 2.0))
            counted = codes if _catches(process.pid) else before
            process.send_signal(signal.SIGTERM)
            code = process.wait(60)
            counted[code] = counted.get(code, 0) + 1
        log = (Path(folder) / "log").read_bytes()
    return {"codes": codes, "before": before, "tracebacks": log.count(b"Traceback")}


def _catches(process: int) -> bool:
    """Whether a process listens to the signal that tells it to end."""
    with contextlib.suppress(FileNotFoundError):
        mask = int(Path(f"/proc/{process}/status").read_text().split("SigCgt:")[1].split()[0], 16)
        return bool(mask >> (signal.SIGTERM - 1) & 1)
    return False


def restarts(url: str, jobs: int, kills: int, seed: int) -> dict:
    """Jobs, while the server is killed at random moments, and processes in the middle of a job, two at most a job."""
    chance = random.Random(seed)
    store = Counting(Database(url))
    names = [store.submit("simulate", cheap(number) | {"every": 5e-5}, []).job.id for number in range(jobs)]
    began = time.monotonic()
    servers = workers = 0
    deaths: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        server = begun(url, log, "--cold")

        def over() -> int:
            counts = store.counts()
            return counts["done"] + counts["failed"]

        try:
            while (done := over()) < jobs and time.monotonic() - began < PATIENCE:
                time.sleep(chance.uniform(0.0, 0.2))
                running = store.jobs("running")
                # what a killed server left runs by name only, until its silence is noticed: no process is in its middle
                busy = [one for one in running if f":{server.pid}:" in (one.owner or "")]
                if servers < kills and done >= servers * jobs / (kills + 1) and running:
                    time.sleep(chance.uniform(0.0, 0.5))
                    server.kill()
                    server.wait(30)
                    servers += 1
                    server = begun(url, log, "--cold")
                elif workers < kills and done >= workers * jobs / (kills + 1) and busy:
                    name, children = busy[0].id, _children(server.pid)
                    if deaths.get(name, 0) < 2 and children and store.job(name).state == "running":
                        children[0].kill()
                        deaths[name] = deaths.get(name, 0) + 1
                        workers += 1
        finally:
            server.terminate()
            code = server.wait(60)
    rows = [store.job(name) for name in names]
    found = {
        "done": sum(row.state == "done" for row in rows),
        "worker_died": sum(row.error is not None and row.error.code == "worker_died" for row in rows),
        "stuck": sum(not row.over for row in rows),
        "unrecorded": sum(not store.result_names(row.id) for row in rows),
        "attempts": max(row.attempt for row in rows),
        "deaths": _deaths(store),
        "servers": servers, "workers": workers, "code": code, "seconds": round(time.monotonic() - began, 1),
    }  # fmt: skip
    store.close()
    return found


def _deaths(store: Counting) -> int:
    """Processes that died in the middle of a job, as the store has counted them."""
    with store.database.reading() as connection:
        return int(connection.execute(sa.select(sa.func.sum(tables.jobs.c.deaths))).scalar_one())


def _children(process: int) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return [one for one in psutil.Process(process).children() if "spawn_main" in " ".join(one.cmdline())]
    return []


COMMANDS = {
    "starts": lambda a: starts(int(a[0]), int(a[1])),
    "restarts": lambda a: restarts(a[0], int(a[1]), int(a[2]), int(a[3])),
}

if __name__ == "__main__":
    print(json.dumps(COMMANDS[sys.argv[1]](sys.argv[2:])))

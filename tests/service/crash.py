"""What a service must survive, done to it for real: kills, freezes, full disks. Run as a script; prints JSON.

Children are forked, not spawned, so that hundreds of them start within seconds: they touch the database only.
"""

import contextlib
import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import sqlite3
import struct
import sys
import threading
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

from jshell.engines import processes as engines
from jshell.errors import JshellError, StoreUnavailable
from jshell.service import copies as taken
from jshell.service import store as stores
from jshell.service.database import Database
from jshell.service.settings import Settings
from jshell.service.store import Store
from jshell.service.worker import Worker

CONDITIONS = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}
TIMEOUT = 60.0
LIBRARIES = ["jax", "diffrax", "optimistix", "lineax", "equinox", "optax", "scipy.signal", "scipy.stats", "jaxtyping"]
warnings.filterwarnings("ignore", message="os.fork")  # the children never touch JAX


def cheap(number: int) -> dict:
    """A job that takes a tenth of a second."""
    initial = [0.01 + 1e-6 * number, 0.0, 0.0, 0.0]
    return {
        "model": "oscillator",
        "conditions": CONDITIONS,
        "duration": 5.0,
        "every": 0.1,
        "initial": initial,
        "netcdf": False,
    }


def child(work) -> tuple[int, int]:
    """A forked process that does some work and writes into a pipe; its id and the pipe's end."""
    read, write = os.pipe()
    process = os.fork()
    if process:
        os.close(write)
        return process, read
    code = 1
    try:
        os.close(read)
        work(write)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def drained(pipe: int, seconds: float = 0.0) -> bytes:
    """All that is in a pipe now."""
    found = b""
    os.set_blocking(pipe, False)
    deadline = time.monotonic() + seconds
    while True:
        with contextlib.suppress(BlockingIOError):
            part = os.read(pipe, 2**16)
            found += part
            if part:
                continue
        if time.monotonic() >= deadline:
            return found
        time.sleep(0.001)


def sound(path: Path) -> bool:
    """Whether SQLite finds a file whole."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return connection.execute("PRAGMA integrity_check").fetchone()[0] == "ok"


def numbers_in(path: Path) -> set[int]:
    """The numbers of the jobs in a copy."""
    with contextlib.closing(sqlite3.connect(path)) as connection:
        rows = connection.execute("SELECT specification FROM jobs").fetchall()
    return {json.loads(text)["number"] for (text,) in rows}


def submits(url: str, times: int, seed: int) -> dict:
    """A server killed around its answer to a submission; the client asks again under the same key."""
    chance = random.Random(seed)
    store = Store.open(url, queue=10**6)
    usual = []
    for number in range(5):
        began = time.monotonic()
        store.submit("simulate", {"number": -1 - number}, [], f"warm {number}")
        usual.append(time.monotonic() - began)
    store.close()
    acknowledged = 0
    killed_before = 0

    for number in range(times):
        key = f"key {number}"

        def answer(pipe: int, number=number, key=key) -> None:
            store = Store.open(url, queue=10**6)
            for warm in range(3):
                store.submit("simulate", {"number": -10 - 3 * number - warm}, [], f"warm {number} {warm}")
            os.write(pipe, b"r")  # ready for the request
            made = store.submit("simulate", {"number": number}, [], key)
            os.write(pipe, b"a" + made.job.id.encode())
            time.sleep(TIMEOUT)

        process, pipe = child(answer)
        os.set_blocking(pipe, True)
        assert os.read(pipe, 1) == b"r"
        time.sleep(chance.uniform(0.0, 2 * sorted(usual)[2]))
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        told = drained(pipe)
        os.close(pipe)
        store = Store.open(url, queue=10**6)
        if told.startswith(b"a"):
            acknowledged += 1
            assert store.job(told[1:].decode()).specification == {"number": number}, "an acknowledged job is lost"
        else:
            killed_before += 1
        again = store.submit("simulate", {"number": number}, [], key)
        if told:
            assert again.job.id == told[1:].decode(), "recorded twice"
        store.close()
    store = Store.open(url, queue=10**6)
    counts = Counter(job.specification["number"] for job in store.jobs(limit=10**6))
    store.close()
    return {
        "acknowledged": acknowledged,
        "killed_before_answer": killed_before,
        "lost": sum(counts[number] == 0 for number in range(times)),
        "twice": sum(count > 1 for count in counts.values()),
    }


def pressing(url: str, first: int):
    """Submits, leases and finishes without end; tells the number of every accepted job."""

    def work(pipe: int) -> None:
        store, number = None, first
        while True:
            try:
                store = store or Store.open(url, queue=10**6)
                store.submit("simulate", {"number": number}, [], f"key {number}")
                os.write(pipe, struct.pack("<q", number))
                number += 1
                job = store.lease("load", 60) if number % 2 else None
                if job is not None:
                    store.finish(job.id, "load", job.attempt, {"a": os.urandom(3000)})
            except StoreUnavailable:
                continue  # the other one was frozen in the middle of its turn: a client asks again

    return work


def copies(folder: str, times: int, seed: int, how: str) -> dict:
    """Under load: processes frozen, files copied, thawed; or copied and put back as `jshell` does it."""
    chance, path = random.Random(seed), Path(folder) / "jobs.db"
    url = f"sqlite:///{path}"
    Store.open(url).close()
    children = [child(pressing(url, 10**9 * (one + 1))) for one in range(2)]
    told: set[int] = set()
    rest = {pipe: b"" for _, pipe in children}

    def listen() -> None:
        for _, pipe in children:
            whole = rest[pipe] + drained(pipe)
            end = len(whole) // 8 * 8
            told.update(struct.unpack(f"<{end // 8}q", whole[:end]))
            rest[pipe] = whole[end:]

    unsound = missing = 0
    try:
        for number in range(times):
            time.sleep(chance.uniform(0.01, 0.1))
            copy = Path(folder) / f"copy{number}"
            copy.mkdir()
            if how == "freeze":
                for process, _ in children:
                    os.kill(process, signal.SIGSTOP)
                for process, _ in children:
                    os.waitpid(process, os.WUNTRACED)
                listen()
                for tail in ("", "-wal", "-shm"):
                    part = Path(f"{path}{tail}")
                    if part.exists():
                        shutil.copyfile(part, copy / part.name)
                for process, _ in children:
                    os.kill(process, signal.SIGCONT)
            else:
                listen()
                taken.backup(url, copy / "taken")
                taken.restore(copy / "taken", f"sqlite:///{copy / path.name}")
            before = set(told)
            Store.open(f"sqlite:///{copy / path.name}").close()  # opened as a server would
            unsound += not sound(copy / path.name)
            missing += len(before - numbers_in(copy / path.name))
            shutil.rmtree(copy)
    finally:
        for process, _ in children:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
    listen()
    return {"copies": times, "jobs": len(told), "unsound": unsound, "missing": missing}


class Counting(Store):
    """Counts what was recorded."""

    def __init__(self, database: Database) -> None:
        super().__init__(database, queue=10**6)
        self.recorded: Counter = Counter()
        self.lock = threading.Lock()

    def finish(self, job, owner, attempt, outcome) -> bool:
        done = super().finish(job, owner, attempt, outcome)
        with self.lock:
            self.recorded[job] += done
        return done


def kills(url: str, jobs: int, times: int, seed: int, cache: str, patience: float | int) -> dict:
    """Worker processes killed at random times while jobs run."""
    chance = random.Random(seed)
    # hundreds of processes: they come from one that has imported the libraries, and started nothing
    ready = multiprocessing.get_context("forkserver")
    ready.set_forkserver_preload(LIBRARIES)
    engines.multiprocessing = SimpleNamespace(
        get_context=lambda _: ready, parent_process=multiprocessing.parent_process
    )
    store = Counting(Database(url))
    settings = Settings(db=url, workers=2, lease=5, cache=cache, warm=False, nice=0)
    worker = Worker(settings, store)
    worker.start()
    names = [store.submit("simulate", cheap(number), []).job.id for number in range(jobs)]
    done, hits = 0, 0
    began = time.monotonic()
    deadline = began + patience
    while time.monotonic() < deadline:
        counts = store.counts()
        over = counts["done"] + counts["failed"]
        if over == jobs:
            break
        # spread over nine tenths of the run, as many per finished job as asked for; the rest is for late ones
        if hits < times and over >= 0.9 * hits * jobs / (times + 1):
            time.sleep(chance.uniform(0.0, 0.3))
            busy = [slot for slot in worker._slots if slot.job is not None and slot._process]
            if busy:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(chance.choice(busy)._process, signal.SIGKILL)
                    hits += 1
        time.sleep(0.01)
    stuck = [name for name in names if not store.job(name).over]
    rows = [store.job(name) for name in names]
    worker.stop(10)
    failed = [row for row in rows if row.state == "failed"]
    done = [row for row in rows if row.state == "done"]
    return {
        "done": len(done),
        "failed": len(failed),
        "failed_otherwise": sum(row.error.code != stores.DIED or row.attempt != 3 for row in failed),
        "stuck": len(stuck),
        "twice": sum(count > 1 for count in store.recorded.values()),
        "unrecorded": sum(store.recorded[row.id] != 1 or not store.result_names(row.id) for row in done),
        "kills": hits,
        "attempts": sum(row.attempt for row in rows),
        "seconds": round(time.monotonic() - began, 1),
    }


def full(folder: str) -> dict:
    """A disk with no more room: refused in words, sound, and at work again once there is room."""
    path = Path(folder) / "jobs.db"
    store = Store.open(f"sqlite:///{path}", queue=10**6)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**21, hard))
    accepted, refusal = [], None
    for number in range(10000):
        try:
            store.add_trace(f"{number}.csv", os.urandom(20000))
            accepted.append(store.submit("simulate", {"number": number}, []).job.id)
        except StoreUnavailable as error:
            refusal = error
            break
    healthy = store.healthy()
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    again = store.submit("simulate", {"number": -1}, []).job.id
    kept = all(store.job(name).state == "queued" for name in [*accepted, again])
    store.close()
    return {
        "accepted": len(accepted), "refused": str(refusal), "healthy_when_full": healthy, "kept": kept,
        "sound": sound(path),
    }  # fmt: skip


def readonly(folder: str) -> dict:
    """A folder that may not be written, met by a user who is not root."""
    path = Path(folder) / "jobs.db"
    store = Store.open(f"sqlite:///{path}")
    store.submit("simulate", {"number": 1}, [])
    store.close()
    before = path.read_bytes()
    os.chmod(folder, 0o555)
    os.chmod(path, 0o444)
    if os.geteuid() == 0:
        os.setegid(65534)
        os.seteuid(65534)
    words = []
    for url in (f"sqlite:///{path}", f"sqlite:///{folder}/other.db"):
        try:
            Store.open(url).submit("simulate", {"number": 2}, [])
            words.append("accepted")
        except JshellError as error:
            words.append(f"{type(error).__name__}: {error}")
    os.seteuid(os.getuid())
    os.chmod(folder, 0o755)
    return {"words": words, "untouched": path.read_bytes() == before, "files": sorted(os.listdir(folder))}


def servant(url: str, cache: str) -> None:
    """A server without its web: a worker that runs until SIGTERM."""
    store = Store.open(url, queue=10**6)
    worker = Worker(Settings(db=url, workers=1, lease=2, cache=cache, warm=False, nice=0), store)
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    worker.start()
    print("started", flush=True)
    over.wait(TIMEOUT * 10)
    worker.stop(10)
    store.close()


def _folder(parent: str, name: str) -> str:
    path = Path(parent) / name
    path.mkdir()
    return str(path)


COMMANDS = {
    "submits": lambda a: submits(a[0], int(a[1]), int(a[2])),
    "freeze": lambda a: copies(a[0], int(a[1]), int(a[2]), "freeze"),
    "backup": lambda a: copies(a[0], int(a[1]), int(a[2]), "backup"),
    "kills": lambda a: kills(a[0], int(a[1]), int(a[2]), int(a[3]), a[4], float(a[5])),
    "small": lambda a: {
        "submits": submits(f"sqlite:///{a[0]}/submits.db", 8, 0),
        "submits_elsewhere": submits(a[1], 4, 1) if len(a) > 1 else None,
        "freeze": copies(_folder(a[0], "freeze"), 6, 0, "freeze"),
        "backup": copies(_folder(a[0], "backup"), 6, 0, "backup"),
        "full": full(_folder(a[0], "full")),
        "readonly": readonly(_folder(a[0], "readonly")),
    },
    "full": lambda a: full(a[0]),
    "readonly": lambda a: readonly(a[0]),
    "servant": lambda a: servant(a[0], a[1]),
}

if __name__ == "__main__":
    print(json.dumps(COMMANDS[sys.argv[1]](sys.argv[2:])))

"""Deaths that have killed other queues: a name that comes back, a recovery cut off, a disk that was full."""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import psutil
import pytest

from jshell.errors import StoreUnavailable
from jshell.service.settings import Settings
from jshell.service.store import Store
from jshell.service.worker import Worker

from .conftest import Cluster, programs

CONDITIONS = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}
CHEAP = {"model": "oscillator", "conditions": CONDITIONS, "duration": 5.0, "every": 0.1, "netcdf": False}
LIMIT = 17 * 2**20  # bytes of a file: PostgreSQL's log has files of 16 MiB


@pytest.fixture
def own(cluster) -> Iterator[Cluster]:
    """A PostgreSQL that may be killed."""
    binaries = programs()
    assert binaries is not None
    made = Cluster(binaries)
    yield made
    made.stop()


@pytest.mark.long
def test_a_worker_that_comes_back_under_its_old_name_is_another(store):
    """Its last life neither keeps the job from it nor records anything in its place."""
    job = store.submit("simulate", CHEAP, []).job
    worker = Worker(Settings(engine="inline", lease=0.2, warm=False), store)
    owner = worker._slots[0].owner
    assert store.lease(owner, 15).attempt == 1  # and then it was gone
    worker.start()
    deadline = time.monotonic() + 60
    while (row := store.job(job.id)).state != "done":
        assert time.monotonic() < deadline, row
        time.sleep(0.05)
    assert (row.attempt, row.owner) == (2, owner)
    assert not store.heartbeat(job.id, owner, 1)
    assert not store.finish(job.id, owner, 1, {"late": b""})
    assert store.result_names(job.id) == ("trace.csv", "trace.json")
    worker.stop(5)


def test_postgresql_killed_in_the_middle_of_its_recovery_keeps_what_was_accepted(own):
    chance, accepted = random.Random(0), []
    store = Store.open(own.database(), queue=10**6)
    for round in range(3):
        accepted += [store.submit("simulate", {"number": 100 * round + number}, []).job.id for number in range(20)]
        own.process.kill()
        own.process.wait(30)
        own.begin()
        time.sleep(chance.uniform(0.0, 0.3))
        own.process.kill()
        own.process.wait(30)
        own.begin()
        with contextlib.suppress(StoreUnavailable):  # told in words while it is gone
            store.counts()
        own.wait()
        assert [row.id for row in store.jobs(limit=1000)] == accepted[::-1]
    while (job := store.lease("me", 15)) is not None:
        assert store.finish(job.id, "me", 1, {})
    assert store.counts()["done"] == 60
    store.close()


@pytest.mark.slow
def test_sqlite_killed_in_the_middle_of_its_recovery_keeps_what_was_accepted(tmp_path):
    url, chance, accepted = f"sqlite:///{tmp_path / 'jobs.db'}", random.Random(0), []
    Store.open(url).close()
    code = (
        "import sys, os; from jshell.service.store import Store; store = Store.open(sys.argv[1], queue=10**6);"
        "[print(store.submit('simulate', {'at': sys.argv[2], 'n': n}, []).job.id, flush=True) for n in range(10**6)]"
    )
    for round in range(3):
        with subprocess.Popen([sys.executable, "-c", code, url, str(round)], stdout=subprocess.PIPE, text=True) as one:
            assert one.stdout is not None
            accepted += [one.stdout.readline().strip() for _ in range(50)]
            one.send_signal(signal.SIGKILL)
            accepted += [line.strip() for line in one.stdout if line.endswith("\n")]
        with subprocess.Popen([sys.executable, "-c", code, url, "again"], stdout=subprocess.PIPE, text=True) as one:
            deadline = time.monotonic() + 20  # it opens the file, and its log
            while time.monotonic() < deadline and not any(
                "jobs.db" in f.path for f in psutil.Process(one.pid).open_files()
            ):
                time.sleep(0.002)
            time.sleep(chance.uniform(0.0, 0.02))
            one.kill()
            accepted += [line.strip() for line in one.stdout or () if line.endswith("\n")]
    store = Store.open(url)
    assert set(accepted) <= {row.id for row in store.jobs(limit=10**6)}
    store.close()


@pytest.mark.skipif(shutil.which("prlimit") is None, reason="no prlimit: apt-get install util-linux")
def test_a_full_disk_of_postgresql_is_refused_and_recovers(own):
    store, accepted = Store.open(own.database()), []

    def limit(most: int | str) -> None:
        for one in (own.process.pid, *(child.pid for child in psutil.Process(own.process.pid).children())):
            subprocess.run(["prlimit", f"--pid={one}", f"--fsize={most}:"], check=True, cwd="/", **own.who)

    limit(LIMIT)

    def fill() -> None:
        for number in range(10):
            accepted.append((store.add_trace(f"{number}.csv", content := os.urandom(2**22)).id, content))

    with pytest.raises(StoreUnavailable, match="othing that was accepted is lost"):
        fill()
    assert accepted
    limit("unlimited")
    content = b"room again"
    accepted.append((store.add_trace("last.csv", content).id, content))
    store.close()
    again = Store.open(store.database.url.render_as_string(hide_password=False))
    assert [again.trace_content(name) for name, _ in accepted] == [content for _, content in accepted]
    assert again.healthy()
    again.close()

"""What goes wrong around a service: kills, freezes, full disks, locks, damage; small, and in full where slow."""

import contextlib
import hashlib
import json
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from jshell.errors import BadStore, BadValue, StoreUnavailable
from jshell.service import database
from jshell.service.store import Store

SCRIPT = Path(__file__).parent / "crash.py"
SOAK = Path(__file__).parent / "soak.py"
CUT_OFF = Path(__file__).parent / "cut_off.py"
RESTARTS = Path(__file__).parent / "restarts.py"
CONDITIONS = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}


def ran(*arguments: object, seconds: float = 100.0, script: Path = SCRIPT) -> dict:
    """What a script found out."""
    command = [sys.executable, "-W", "ignore", str(script), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def small() -> Iterator[dict]:
    """A little of everything, in one process."""
    with tempfile.TemporaryDirectory(prefix="jshell-") as folder:  # pytest's own are closed to all but their owner,
        Path(folder).chmod(0o755)  # and somebody else than root has to get there
        yield ran("small", folder)


@pytest.mark.long
def test_a_server_killed_around_its_answer_loses_and_doubles_nothing(small):
    found = small["submits"]
    assert found["acknowledged"] + found["killed_before_answer"] == 8
    assert (found["lost"], found["twice"]) == (0, 0)


@pytest.mark.long
@pytest.mark.parametrize("how", ["freeze", "backup"])
def test_a_copy_under_load_is_sound_and_holds_all_that_was_accepted(small, how):
    found = small[how]
    assert found["jobs"] > 0
    assert (found["copies"], found["unsound"], found["missing"]) == (6, 0, 0)


@pytest.mark.long
def test_a_full_disk_is_refused_in_words_and_recovers(small):
    found = small["full"]
    assert found["accepted"] > 0
    assert "disk" in found["refused"]
    assert "Free some space" in found["refused"]
    assert found["kept"]
    assert found["sound"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody who may not look into a folder")
def test_a_folder_that_may_not_be_entered_is_refused_in_words():
    with tempfile.TemporaryDirectory(prefix="jshell-") as folder:  # 0700, root's
        try:
            os.seteuid(65534)
            with pytest.raises(StoreUnavailable, match="Permission denied"):
                Store.open(f"sqlite:///{folder}/jobs.db")
        finally:
            os.seteuid(0)


def test_a_folder_that_may_not_be_written_is_refused_in_words(small):
    found = small["readonly"]
    old, new = found["words"]
    assert "readonly database" in old
    assert "unable to open" in new
    for words in found["words"]:
        assert words.startswith("StoreUnavailable")
        assert "writable" in words
    assert found["untouched"]
    assert found["files"] == ["jobs.db"]


def test_a_locked_database_is_refused_in_words_and_recovers(local, monkeypatch):
    path = str(local.database.url.database)
    local.close()
    monkeypatch.setattr(database, "PATIENCE", 0.1)
    store = Store.open(f"sqlite:///{path}")
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(StoreUnavailable, match=r"locked.*end that program"):
            store.submit("simulate", {}, [])
        assert not store.healthy()
        other.execute("ROLLBACK")
    assert store.submit("simulate", {}, []).created
    store.close()


def test_a_new_file_that_another_server_is_making_is_waited_for(tmp_path):
    """SQLite waits for no writer where a write-ahead log begins: of two servers that began at once it refused one."""
    path = tmp_path / "jobs.db"
    with contextlib.closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as other:
        for step in ("CREATE TABLE migrations (number INTEGER, name TEXT, applied FLOAT)", "BEGIN IMMEDIATE"):
            other.execute(step)
        timer = threading.Timer(0.3, other.execute, ("ROLLBACK",))
        timer.start()
        try:
            store = Store.open(f"sqlite:///{path}")
        finally:
            timer.join()
    assert store.submit("simulate", {}, []).created
    store.close()


@pytest.mark.parametrize("tail", database.BESIDE)
def test_no_database_begins_beside_what_another_one_has_left(tmp_path, tail):
    """The file was moved away without its log: SQLite removed it, and with it the jobs that were in it alone."""
    left = tmp_path / f"jobs.db{tail}"
    left.write_bytes(b"jobs of another one")
    with pytest.raises(BadValue, match=f"jobs.db{tail}.*Put these beside"):
        Store.open(f"sqlite:///{tmp_path / 'jobs.db'}")
    assert left.read_bytes() == b"jobs of another one"
    assert not (tmp_path / "jobs.db").exists()


def filled(path: Path) -> None:
    store = Store.open(f"sqlite:///{path}")
    for number in range(50):
        store.add_trace(f"{number}.csv", os.urandom(5000))
        store.submit("simulate", {"number": number}, [])
    store.close()


def test_a_damaged_database_is_refused_and_not_touched(tmp_path):
    path = tmp_path / "jobs.db"
    filled(path)
    whole = path.read_bytes()
    page = database.PAGE
    for spoiled in (
        whole[:page] + os.urandom(2 * page) + whole[3 * page :],  # pages overwritten
        whole[: len(whole) // 2],  # torn
        whole[:50] + os.urandom(50) + whole[100:],  # a header of nonsense
    ):
        path.write_bytes(spoiled)
        before = digest(path)
        with pytest.raises(BadStore, match="put back a backup") as caught:
            Store.open(f"sqlite:///{path}")
        assert "not touched" in caught.value.remedy
        assert digest(path) == before
        assert [one.name for one in tmp_path.iterdir()] == ["jobs.db"]
    path.write_bytes(whole)
    store = Store.open(f"sqlite:///{path}")
    assert len(store.jobs(limit=100)) == 50
    store.close()


def test_damage_met_at_work_is_told_as_damage(tmp_path):
    path = tmp_path / "jobs.db"
    filled(path)
    store = Store.open(f"sqlite:///{path}")
    with path.open("r+b") as file:
        size = path.stat().st_size
        file.seek(database.PAGE)
        file.write(os.urandom(size - 2 * database.PAGE))

    def work() -> None:
        for row in range(100):
            store.jobs(limit=100)
            store.traces(limit=100)
            store.submit("simulate", {"number": 1000 + row}, [])

    with pytest.raises(BadStore, match="put back a backup"):
        work()
    store.close()


def test_a_file_of_something_else_is_refused_and_not_touched(tmp_path):
    text, other = tmp_path / "notes.txt", tmp_path / "other.db"
    text.write_text("my thesis\n")
    with contextlib.closing(sqlite3.connect(other)) as connection, connection:
        connection.execute("CREATE TABLE thesis (page)")
    for path in (text, other):
        before = digest(path)
        with pytest.raises(BadStore, match="Name another file"):
            Store.open(f"sqlite:///{path}")
        assert digest(path) == before
    with pytest.raises(StoreUnavailable, match="no folder"):
        Store.open(f"sqlite:///{tmp_path}/none/jobs.db")
    (tmp_path / "touched.db").touch()
    Store.open(f"sqlite:///{tmp_path / 'touched.db'}").close()


def test_a_network_file_system_is_refused(tmp_path, monkeypatch):
    kinds = {line.split()[2] for line in Path("/proc/mounts").read_text().splitlines()}
    monkeypatch.setattr(database, "REMOTE", kinds)
    with pytest.raises(BadValue, match="network file system"):
        Store.open(f"sqlite:///{tmp_path / 'jobs.db'}")


def test_a_database_that_nobody_serves_is_told_within_a_moment(tmp_path):
    began = time.monotonic()
    with pytest.raises(StoreUnavailable, match="that was accepted is lost"):
        Store.open(f"postgresql+psycopg://nobody@/none?host={tmp_path}")
    assert time.monotonic() - began < 30


def long(number: int) -> dict:
    initial = [0.01 + 1e-6 * number, 0.0, 0.0, 0.0]
    return {"model": "oscillator", "conditions": CONDITIONS, "duration": 5.0, "every": 2e-5, "initial": initial,
            "netcdf": False}  # fmt: skip


@contextlib.contextmanager
def servant(url: str, cache: Path) -> Iterator[subprocess.Popen]:
    """A service without its web, in a process of its own."""
    command = [sys.executable, "-W", "ignore", str(SCRIPT), "servant", url, str(cache)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "started\n"
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(30)
        process.stdout.close()


def reached(store: Store, job: str, *states: str, seconds: float = 100.0):
    deadline = time.monotonic() + seconds
    while (row := store.job(job)).state not in states:
        assert time.monotonic() < deadline, row
        time.sleep(0.05)
    return row


def gone(processes: list[psutil.Process], seconds: float) -> bool:
    return not psutil.wait_procs(processes, timeout=seconds)[1]


@pytest.mark.long
def test_a_killed_service_leaves_no_process_and_another_does_its_job(local, tmp_path):
    url, cache = f"sqlite:///{local.database.url.database}", tmp_path / "programs"
    job = local.submit("simulate", long(1), []).job.id
    with servant(url, cache) as first:
        reached(local, job, "running")
        children = psutil.Process(first.pid).children(recursive=True)
        assert children
        first.kill()
        assert gone(children, 30)
    with servant(url, cache):
        row = reached(local, job, "done", "failed")
        assert (row.state, row.attempt) == ("done", 2)


@pytest.mark.slow
def test_a_service_told_to_end_in_the_middle_of_a_job_drains(local, tmp_path):
    with servant(f"sqlite:///{local.database.url.database}", tmp_path / "programs") as process:
        job = local.submit("simulate", long(2) | {"every": 1e-6}, []).job.id
        reached(local, job, "running")
        children = psutil.Process(process.pid).children(recursive=True)
        began = time.monotonic()
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
        assert time.monotonic() - began < 10
        assert gone(children, 10)
    assert local.job(job).state == "queued"  # given back


@pytest.mark.slow
def test_fifty_services_told_to_end_while_they_start_end_well():
    found = ran("starts", 50, 0, seconds=600, script=RESTARTS)
    assert set(found["codes"]) == {"0"}  # from the program's own first line on
    assert set(found["before"]) <= {"0", str(-signal.SIGTERM)}
    assert found["codes"]["0"] + sum(found["before"].values()) == 50
    assert found["tracebacks"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_sixty_jobs_outlive_twenty_killed_servers_and_twenty_killed_workers(url, seed):
    found = ran("restarts", url, 60, 20, seed, seconds=3800, script=RESTARTS)
    assert (found["servers"], found["workers"]) == (20, 20)
    assert found["deaths"] >= 15  # the others ended, or lost their server, in the moment of the kill
    assert (found["done"], found["worker_died"], found["stuck"], found["unrecorded"]) == (60, 0, 0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_two_hundred_servers_killed_around_their_answers(url, seed):
    found = ran("submits", url, 200, seed, seconds=1200)
    assert found["acknowledged"] > 20
    assert found["killed_before_answer"] > 20
    assert (found["lost"], found["twice"]) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["freeze", "backup"])
def test_two_hundred_copies_under_load(tmp_path, how):
    found = ran(how, tmp_path, 200, 0, seconds=1200)
    assert (found["copies"], found["unsound"], found["missing"]) == (200, 0, 0)


@pytest.mark.slow
def test_a_thousand_jobs_outlive_two_hundred_killed_workers(url, tmp_path):
    found = ran("kills", url, 1000, 200, 0, tmp_path / "programs", 3600, seconds=3800)
    assert found["kills"] == 200
    assert found["stuck"] == found["twice"] == found["unrecorded"] == found["failed_otherwise"] == 0
    assert found["done"] + found["failed"] == 1000
    assert found["failed"] <= 10  # three deaths of one job: 1 000 (1/6)³, about 5, by chance


@pytest.mark.slow
def test_a_cluster_may_stop_die_and_come_back(url, tmp_path):
    found = ran("dask", url, 60, 30.0, 900.0, seconds=1000, script=CUT_OFF)
    assert (found["done"], found["stuck"], found["twice"]) == (61, 0, 0)
    assert found["again"] > 0  # what ran when the scheduler died was run again


@pytest.mark.slow
def test_what_a_frozen_service_delivers_late_is_refused(url, tmp_path):
    found = ran("late", url, tmp_path / "programs", seconds=600, script=CUT_OFF)
    assert found == {"state": "done", "attempt": 2, "recorded": 1, "refused": 1}


@pytest.mark.slow
def test_ten_thousand_fits_of_a_thousand_lengths(tmp_path):
    found = ran(10_000, 1000, 500, seconds=7200, script=SOAK)
    assert found["compilations"] <= 12
    assert found["grown_MB"] <= 100
    assert found["ok"] == 10_000

"""The worker with real processes: done, killed, cancelled, limited, drained."""

import dataclasses
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import jax
import psutil
import pytest

from jshell.engines.inline import Inline
from jshell.service.settings import Settings
from jshell.service.store import JobRow, Store
from jshell.service.worker import Worker

CONDITIONS = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}
PATIENCE = 120.0


def asked(number: int, every: float = 0.1) -> dict:
    initial = [0.01 + 1e-6 * number, 0.0, 0.0, 0.0]
    return {"model": "oscillator", "conditions": CONDITIONS, "duration": 5.0, "every": every, "initial": initial,
            "netcdf": False}  # fmt: skip


def long(number: int) -> dict:
    """A job of a second or two: it writes 250 000 rows."""
    return asked(number, 2e-5)


def awaited(store: Store, job: str, *states: str) -> JobRow:
    """A job once it is in a state."""
    deadline = time.monotonic() + PATIENCE
    while (row := store.job(job)).state not in states:
        assert time.monotonic() < deadline, row
        time.sleep(0.02)
    return row


@pytest.fixture(scope="module")
def programs(tmp_path_factory) -> Iterator[str]:
    """A folder of compiled programs; the setting of this process is put back."""
    before = jax.config.jax_compilation_cache_dir
    yield before or str(tmp_path_factory.mktemp("programs"))
    jax.config.update("jax_compilation_cache_dir", before)


@pytest.fixture(scope="module")
def running(tmp_path_factory, programs) -> Iterator[tuple[Store, Worker]]:
    store = Store.open(f"sqlite:///{tmp_path_factory.mktemp('worker') / 'jobs.db'}")
    worker = Worker(Settings(lease=2, warm=False, cache=programs, nice=1), store)
    worker.start()
    yield store, worker
    worker.stop(10)
    store.close()


def slot(worker: Worker):
    return worker._slots[0]


def test_a_job_is_done_in_a_process(running):
    store, worker = running
    job = store.submit("simulate", asked(0), []).job
    row = awaited(store, job.id, "done", "failed")
    assert (row.state, row.attempt, row.progress) == ("done", 1, 1.0)
    assert store.result_names(job.id) == ("trace.csv", "trace.json")
    assert slot(worker)._process in {child.pid for child in psutil.Process().children(recursive=True)}
    assert psutil.Process(slot(worker)._process).nice() == 1


def test_an_error_of_the_user_comes_back_in_words(running):
    store, _ = running
    trace = store.add_trace("camera.csv", b"t,V\n1,2\n")
    job = store.submit("fit", {}, [trace.id]).job
    row = awaited(store, job.id, "done", "failed")
    assert row.state == "failed"
    assert (row.error.code, row.error.place) == ("bad_file", "camera.csv")
    assert (row.error.found, row.error.expected) == ("a single row of numbers", "at least two")
    assert row.error.remedy


def test_a_fault_of_our_own_is_a_number_in_the_log(running, caplog):
    store, _ = running
    job = store.submit("simulate", asked(0) | {"initial": "four"}, []).job
    row = awaited(store, job.id, "done", "failed")
    assert row.error.code == "internal"
    assert "Traceback" not in row.error.cause
    number = row.error.cause.split("error ")[1].split()[0]
    assert any(number in one.message and "Traceback" in one.message for one in caplog.records)


@pytest.mark.long
def test_a_killed_process_is_replaced_and_its_job_done_again(running):
    store, worker = running
    job = store.submit("simulate", long(1), []).job
    awaited(store, job.id, "running")
    time.sleep(0.2)
    killed = slot(worker)._process
    os.kill(killed, signal.SIGKILL)
    row = awaited(store, job.id, "done", "failed")
    assert (row.state, row.attempt) == ("done", 2)
    assert slot(worker)._process != killed


@pytest.mark.long
def test_a_cancelled_job_is_stopped_and_the_next_one_done(running):
    store, worker = running
    job = store.submit("simulate", long(2), []).job
    awaited(store, job.id, "running")
    process = psutil.Process(slot(worker)._process)
    store.cancel(job.id)
    process.wait(PATIENCE)
    other = store.submit("simulate", asked(3), []).job
    assert awaited(store, other.id, "done", "failed").state == "done"
    assert store.job(job.id).state == "cancelled"
    assert store.result_names(job.id) == ()


@pytest.mark.long
@pytest.mark.parametrize("limit", ["seconds", "memory"])
def test_a_job_beyond_a_limit_is_ended_in_words(running, limit):
    store, worker = running
    own = slot(worker)
    usual = own.settings
    values = {"seconds": 0.3} if limit == "seconds" else {"memory": 2**20}
    own.settings = dataclasses.replace(usual, **values)
    try:
        job = store.submit("simulate", long(10 + len(limit)), []).job
        row = awaited(store, job.id, "done", "failed")
    finally:
        own.settings = usual
    assert row.error.code == "limit_reached"
    assert ("time" if limit == "seconds" else "memory") in row.error.place
    assert "at most" in row.error.cause


@pytest.mark.long
def test_a_service_that_stops_gives_back_what_it_has_not_done(running):
    store, worker = running
    job = store.submit("simulate", long(4), []).job
    awaited(store, job.id, "running")
    process = psutil.Process(slot(worker)._process)
    began = time.monotonic()
    worker.stop(1.0)
    assert time.monotonic() - began < 10
    row = awaited(store, job.id, "queued")
    assert (row.attempt, row.owner) == (1, None)
    process.wait(PATIENCE)
    other = Worker(worker.settings, store)
    other.start()
    assert awaited(store, job.id, "done", "failed").attempt == 2
    other.stop(10)


def test_this_process_serves_too_and_keeps_its_leases(local):
    worker = Worker(Settings(engine="inline", lease=1.0, warm=False), local)
    worker.start()
    jobs = [local.submit("simulate", asked(number, 4e-5), []).job.id for number in range(3)]
    rows = [awaited(local, job, "done", "failed") for job in jobs]
    worker.stop(10)
    assert [(row.state, row.attempt) for row in rows] == [("done", 1)] * 3


@pytest.mark.long
def test_a_slot_outlives_whatever_an_engine_says(local, monkeypatch):
    """A slot that ended would leave what waits unattended, in a service that looks well."""
    said = [Exception("Client is closed"), None]

    class Odd(Inline):
        def submit(self, fn, /, *args, **kwargs):
            if fault := said.pop(0) if said else None:
                raise fault
            return super().submit(fn, *args, **kwargs)

    monkeypatch.setattr("jshell.service.worker.engines.open", lambda _: Odd())
    worker = Worker(Settings(lease=2, warm=False, engine="inline"), local)
    worker.start()
    job = local.submit("simulate", asked(0), []).job
    assert awaited(local, job.id, "done", "failed").state == "done"
    worker.stop(10)
    assert not said


def test_a_worker_outlives_a_database_that_does_not_answer(local, monkeypatch):
    worker = Worker(Settings(engine="inline", lease=5, warm=False), local)
    monkeypatch.setattr("jshell.service.database.PATIENCE", 0.2)
    worker.start()
    path = Path(str(local.database.url.database))
    import sqlite3

    other = sqlite3.connect(path, isolation_level=None)
    job = local.submit("simulate", asked(5), []).job
    awaited(local, job.id, "done")
    other.execute("BEGIN EXCLUSIVE")
    time.sleep(0.5)
    other.execute("ROLLBACK")
    other.close()
    job = local.submit("simulate", asked(6), []).job
    assert awaited(local, job.id, "done", "failed").state == "done"
    worker.stop(10)


@pytest.mark.long
def test_nothing_is_left_behind(local, programs):
    before = {child.pid for child in psutil.Process().children(recursive=True)}
    threads = threading.active_count()
    worker = Worker(Settings(warm=False, cache=programs), local)
    worker.start()
    time.sleep(0.1)  # in the middle of its start
    worker.stop(5)
    deadline = time.monotonic() + PATIENCE
    while {
        c.pid for c in psutil.Process().children(recursive=True) if "resource_tracker" not in " ".join(c.cmdline())
    } - before:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    while threading.active_count() > threads:
        assert time.monotonic() < deadline
        time.sleep(0.1)

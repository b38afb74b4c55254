"""Engines run tasks wherever they are asked to, lose only what died, and leave nothing behind."""

import concurrent.futures
import operator
import os
import re
import signal
import struct
import sys
import threading
import time
from concurrent.futures import Future

import jax
import psutil
import pytest

from jshell import engines
from jshell.errors import BadName, BadValue, WorkerLost
from jshell.programs import quiet

PATIENCE = 90.0  # [s] for a spawned process to begin and answer


def alive(pids) -> list[int]:
    return [pid for pid in pids if psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE]


def test_inline_task_is_done_when_it_is_submitted_and_keeps_its_fault():
    with engines.open("inline") as engine:
        assert engine.submit(operator.add, 1, 2).result(timeout=0) == 3
        assert isinstance(engine.submit(operator.truediv, 1, 0).exception(timeout=0), ZeroDivisionError)
    with pytest.raises(RuntimeError):
        engine.submit(operator.add, 1, 2)


@pytest.mark.parametrize("name", ["dask", "processes:", "processes:two", "inline "])
def test_unknown_engine_is_refused_by_name(name):
    with pytest.raises(BadName, match="processes:N"):
        engines.open(name)


def test_no_process_at_all_is_refused():
    with pytest.raises(BadValue, match="at least 1"):
        engines.open("processes:0")


def test_address_without_a_scheduler_is_refused(monkeypatch):
    monkeypatch.setattr("jshell.engines.cluster.PATIENCE", 0.3)
    with pytest.raises(BadValue, match="no Dask scheduler"):
        engines.open("tcp://127.0.0.1:9")


@pytest.mark.long
def test_dead_process_costs_its_own_task_and_is_replaced():
    with engines.open("processes:2") as engine:
        others = [engine.submit(os.getpid) for _ in range(4)]
        began = {future.result(timeout=PATIENCE) for future in others}

        sleeper = engine.submit(time.sleep, 600.0)
        suicide = engine.submit(signal.raise_signal, signal.SIGKILL)
        waiting = [engine.submit(pow, 2, k) for k in range(5)]
        with pytest.raises(WorkerLost, match="raise_signal"):
            suicide.result(timeout=PATIENCE)
        assert [future.result(timeout=PATIENCE) for future in waiting] == [1, 2, 4, 8, 16]
        assert sleeper.running()

        assert engine.stop(sleeper)
        with pytest.raises(WorkerLost, match=r"sleep\(600"):
            sleeper.result(timeout=PATIENCE)
        began |= {engine.submit(os.getpid).result(timeout=PATIENCE)}
    assert not alive(began)


def level() -> str | None:
    """In the process: what XLA may say."""
    return jax.config.jax_logging_level


def test_programs_of_our_own_are_not_warned_of_unless_the_user_listens(monkeypatch):
    monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
    assert [quiet(chosen) for chosen in (None, "NOTSET", "DEBUG")] == ["CRITICAL", "CRITICAL", "DEBUG"]
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    try:
        with engines.open("processes:1") as engine:
            assert engine.submit(level).result(timeout=PATIENCE) == "CRITICAL"
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    monkeypatch.setenv("TF_CPP_MIN_LOG_LEVEL", "0")
    assert quiet("NOTSET") == "NOTSET"


def half_an_answer() -> None:
    """In the process: a message that says it is long, a few bytes of it, and death."""
    frame = sys._getframe()
    while "pipe" not in frame.f_locals:
        assert frame.f_back is not None
        frame = frame.f_back
    os.write(frame.f_locals["pipe"].fileno(), struct.pack("!i", 10**6) + b"half")
    signal.raise_signal(signal.SIGKILL)


def test_death_in_the_middle_of_an_answer_is_a_death():
    with engines.open("processes:1") as engine:
        with pytest.raises(WorkerLost, match="half_an_answer"):
            engine.submit(half_an_answer).result(timeout=PATIENCE)
        assert engine.submit(operator.add, 1, 1).result(timeout=PATIENCE) == 2


def test_a_process_killed_while_idle_is_replaced_and_costs_nothing():
    with engines.open("processes:1") as engine:
        pid = engine.submit(os.getpid).result(timeout=PATIENCE)
        os.kill(pid, signal.SIGKILL)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        assert engine.submit(os.getpid).result(timeout=PATIENCE) != pid


def test_a_process_that_cannot_be_started_is_said_and_tried_again(monkeypatch):
    with engines.open("processes:1") as engine:
        pid = engine.submit(os.getpid).result(timeout=PATIENCE)
        os.kill(pid, signal.SIGKILL)
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)

        def none_left(*_) -> None:
            raise BlockingIOError("no process left")

        with monkeypatch.context() as patch:
            patch.setattr("multiprocessing.process.BaseProcess.start", none_left)
            for _ in range(2):
                assert isinstance(engine.submit(os.getpid).exception(timeout=PATIENCE), WorkerLost)
        assert engine.submit(operator.add, 1, 1).result(timeout=PATIENCE) == 2


def test_faults_of_a_task_come_back_with_where_they_arose():
    with engines.open("processes:1") as engine:
        fault = engine.submit(operator.truediv, 1, 0).exception(timeout=PATIENCE)
        assert isinstance(fault, ZeroDivisionError)
        assert "Traceback" in fault.__notes__[0]
        for unsendable in (lambda: 1, threading.Lock):
            fault = engine.submit(unsendable).exception(timeout=PATIENCE)
            assert re.search("pickle|local object", str(fault))  # the second since Python 3.12


def leave_by_an_exception() -> tuple[int, Future, Future]:
    """Begin two tasks, then fail; the worker, the running and the waiting task."""
    found = ()
    try:
        with engines.open("processes:1") as engine:
            pid = engine.submit(os.getpid).result(timeout=PATIENCE)
            found = pid, engine.submit(time.sleep, 600.0), engine.submit(operator.add, 1, 1)
            while not found[1].running():
                time.sleep(0.01)
            raise KeyError
    except KeyError:
        return found


def test_exception_ends_what_runs_and_drops_what_waits():
    pid, running, waiting = leave_by_an_exception()
    concurrent.futures.wait([running, waiting], timeout=PATIENCE)
    assert isinstance(running.exception(timeout=0), WorkerLost)
    assert waiting.cancelled()
    assert not alive([pid])


@pytest.mark.slow
def test_dead_worker_of_a_cluster_costs_its_own_task_and_is_not_tried_again():
    distributed = pytest.importorskip("distributed", reason="no Dask: pip install distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=":0"
    ) as cluster:
        with engines.open(cluster.scheduler_address) as engine:
            doomed = engine.submit(signal.raise_signal, signal.SIGKILL)
            with pytest.raises(WorkerLost, match="raise_signal"):
                doomed.result(timeout=PATIENCE)
            assert [future.result(timeout=PATIENCE) for future in [engine.submit(pow, 2, k) for k in range(4)]] == [
                1,
                2,
                4,
                8,
            ]
            with pytest.raises(ZeroDivisionError):
                engine.submit(operator.truediv, 1, 0).result(timeout=PATIENCE)
        # leaving the engine leaves the cluster running
        assert cluster.scheduler_info["workers"]


@pytest.mark.long
def test_a_cluster_that_has_lost_its_scheduler_for_good_is_left_in_peace():
    distributed = pytest.importorskip("distributed", reason="no Dask: pip install distributed")
    with distributed.LocalCluster(n_workers=0, processes=True, host="127.0.0.1", dashboard_address=":0") as cluster:
        engine = engines.open(cluster.scheduler_address)
        waiting = engine.submit(pow, 2, 3)
        engine._client.sync(engine._client._close)  # what it does by itself once it has given up its scheduler
        with pytest.raises(WorkerLost, match=r"pow\(2, 4\)"):
            engine.submit(pow, 2, 4)
        engine.shutdown(wait=False, cancel_futures=True)
        assert waiting.cancelled() or isinstance(waiting.exception(timeout=PATIENCE), WorkerLost)


@pytest.mark.long
def test_what_a_cluster_is_given_while_its_client_closes_ends():
    """It has let go of what it held, and holds one more: nothing of Dask would ever end that."""
    distributed = pytest.importorskip("distributed", reason="no Dask: pip install distributed")
    with distributed.LocalCluster(n_workers=0, processes=True, host="127.0.0.1", dashboard_address=":0") as cluster:
        engine = engines.open(cluster.scheduler_address)
        engine._client.status = "closing"
        waiting = engine.submit(pow, 2, 3)
        engine._client.status = "running"
        assert isinstance(waiting.exception(timeout=PATIENCE), WorkerLost)
        engine.shutdown(wait=False, cancel_futures=True)

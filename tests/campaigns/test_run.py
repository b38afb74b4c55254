"""A campaign ends the same however it was run: killed, resumed, here, in processes, on a cluster."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
import psutil
import pytest

from jshell import campaigns
from jshell.engines import Inline
from jshell.errors import BadFile, WorkerLost

PATIENCE = 180.0  # [s] for a process to begin, compile and finish a run

CHILD = """
import sys
from jshell import campaigns

if __name__ == "__main__":
    design, out, engine = sys.argv[1:]
    campaigns.run(design, out, engine=engine)
"""


def files(folder: Path) -> dict[str, bytes]:
    """Everything a campaign left, to the byte."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def begin(design: Path, out: Path, engine: str) -> subprocess.Popen:
    """A campaign in a process of its own."""
    script = design.with_name("child.py")
    script.write_text(CHILD, encoding="utf-8")
    return subprocess.Popen([sys.executable, "-W", "ignore", str(script), str(design), str(out), engine])


def kill_family(process: psutil.Process) -> None:
    """Kill a process as a power cut would, and see its children off."""
    children = process.children(recursive=True)
    process.send_signal(signal.SIGKILL)
    _, alive = psutil.wait_procs(children, timeout=30.0)
    for child in alive:
        child.kill()
    assert not alive, f"left behind: {alive}"


def wait_for(condition, process: subprocess.Popen) -> None:
    limit = time.monotonic() + PATIENCE
    while not condition() and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.02)


@pytest.mark.long
def test_campaign_killed_in_its_process_and_resumed_here_equals_an_undisturbed_one(small, undisturbed, tmp_path):
    design, out = campaigns.write_design(tmp_path / "design.toml", small), tmp_path / "out"
    process = begin(design, out, "processes:1")
    try:
        wait_for(lambda: list(out.glob("runs/*.npz")), process)
        finished = len(list(out.glob("runs/*.npz")))
        kill_family(psutil.Process(process.pid))
    finally:
        process.kill()
        process.wait(timeout=30.0)
    assert finished >= 1
    (out / "runs" / "torn.npz.new").write_bytes(b"half a fi")
    found = campaigns.run(design, out)
    assert not found.missing
    assert files(out) == files(undisturbed)


@pytest.mark.long
def test_cluster_gives_the_same_files(small, undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed", reason="no Dask: pip install distributed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=":0"
        ) as cluster,
    ):
        campaigns.run(small, tmp_path, engine=cluster.scheduler_address)
    assert files(tmp_path) == files(undisturbed)


class Losing(Executor):
    """An engine whose worker dies under some runs a number of times."""

    def __init__(self, times: int) -> None:
        self.left = {0.9: times}
        self.inner = Inline()

    def submit(self, fn, /, *args, **kwargs) -> Future:
        (run,) = args
        if self.left.get(run.P0_hat, 0) == 0:
            return self.inner.submit(fn, *args, **kwargs)
        self.left[run.P0_hat] -= 1
        future: Future = Future()
        future.set_exception(WorkerLost("task", found="a dead worker", expected="a live one", remedy="Again."))
        return future


@pytest.mark.long
@pytest.mark.parametrize(("times", "missing"), [(2, 0), (6, 2)])
def test_lost_run_is_tried_three_times_and_then_left_unfinished(small, tmp_path, times, missing):
    told = []
    found = campaigns.run(small, tmp_path, engine=Losing(times), progress=told.append)
    assert len(found.missing) == missing
    assert [step.outcome for step in told].count("lost") == times
    assert len(campaigns.run(small, tmp_path)) == 4


@pytest.mark.long
def test_failed_run_is_kept_with_its_outcome_and_reason(undisturbed):
    found = campaigns.catalog(undisturbed)
    (failed,) = campaigns.failures(found)
    assert failed.findings.outcome == "no_buckled_state"
    assert "sphere" in failed.findings.reason
    assert np.isnan(found["V_e"]).tolist() == [False, False, False, True]
    assert found.outcomes() == {"ok": 3, "no_buckled_state": 1}


@pytest.mark.long
def test_finished_runs_are_not_done_again_and_progress_says_so(small, undisturbed):
    told = []
    before = {path: path.stat().st_mtime_ns for path in (undisturbed / "runs").iterdir()}
    campaigns.run(small, undisturbed, progress=told.append)
    assert [(step.done, step.total) for step in told] == [(4, 4)]
    assert before == {path: path.stat().st_mtime_ns for path in (undisturbed / "runs").iterdir()}


@pytest.mark.long
def test_folder_of_another_design_is_refused(undisturbed):
    other = campaigns.Design("other", (campaigns.Family("one", "modes", {"d_hat": 0.2, "P0_hat": 1.0, "load": 1.1}),))
    with pytest.raises(BadFile, match="another design"):
        campaigns.run(other, undisturbed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_campaign_killed_at_a_random_time_gives_the_same_catalogue(small, undisturbed, tmp_path, seed):
    design, out = campaigns.write_design(tmp_path / "design.toml", small), tmp_path / "out"
    moment = np.random.default_rng(seed).uniform(0.0, 25.0)
    process = begin(design, out, "processes:2" if seed % 2 else "inline")
    try:
        limit = time.monotonic() + moment
        wait_for(lambda: time.monotonic() > limit, process)
        if process.poll() is None:
            kill_family(psutil.Process(process.pid))
    finally:
        process.kill()
        process.wait(timeout=30.0)
    process = begin(design, out, "inline")
    try:
        assert process.wait(timeout=PATIENCE) == 0
    finally:
        process.kill()
    assert (out / "catalog.csv").read_bytes() == (undisturbed / "catalog.csv").read_bytes()
    assert files(out) == files(undisturbed)


@pytest.mark.slow
def test_processes_and_a_cluster_of_processes_give_the_same_files(small, undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed", reason="no Dask: pip install distributed")
    campaigns.run(small, tmp_path / "processes", engine="processes:2")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=":0"
    ) as cluster:
        campaigns.run(small, tmp_path / "cluster", engine=cluster.scheduler_address)
    assert files(tmp_path / "processes") == files(tmp_path / "cluster") == files(undisturbed)
    assert not [
        child for child in psutil.Process(os.getpid()).children(recursive=True) if "spawn_main" in child.cmdline()
    ]

"""Databases for the service's tests: a file each for SQLite, a private cluster for PostgreSQL."""

import itertools
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from jshell.service.store import Store

NUMBERS = itertools.count()


def programs() -> Path | None:
    """Where PostgreSQL's programs are."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    which = shutil.which("initdb")
    return found[-1].parent if found else Path(which).parent if which else None


class Cluster:
    """A PostgreSQL that belongs to this test run, reached by a socket in a folder of its own."""

    def __init__(self, binaries: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="jshell-pg-", dir="/tmp"))  # a socket's path must be short
        self.who: dict = {}
        if os.geteuid() == 0:  # it refuses to run as root
            who = pwd.getpwnam("postgres")
            os.chown(self.folder, who.pw_uid, who.pw_gid)
            self.who = {"user": who.pw_uid, "group": who.pw_gid, "extra_groups": []}
        data = self.folder / "data"
        made = [binaries / "initdb", "-D", data, "-U", "jshell", "-A", "trust", "-E", "UTF8", "--locale=C", "-N"]
        subprocess.run(made, check=True, capture_output=True, timeout=120, cwd=self.folder, **self.who)
        options = {"listen_addresses": "", "unix_socket_directories": self.folder, "fsync": "off"}
        settings = [text for name, value in options.items() for text in ("-c", f"{name}={value}")]
        self.log = (self.folder / "log").open("wb")
        self._psql, self._command = binaries / "psql", [binaries / "postgres", "-D", data, *settings]
        self.begin()
        self.wait()

    def begin(self) -> None:
        """Start it; it may have to recover first."""
        given = {"cwd": self.folder, "stdout": self.log, "stderr": subprocess.STDOUT, **self.who}
        self.process = subprocess.Popen(self._command, **given)

    def wait(self) -> None:
        """Until it answers; started again where what was killed before it was not quite gone."""
        deadline = time.monotonic() + 60
        while self._ask("SELECT 1").returncode:
            assert time.monotonic() < deadline, (self.folder / "log").read_text()
            if self.process.poll() is not None:
                self.begin()
            time.sleep(0.1)

    def _ask(self, words: str) -> subprocess.CompletedProcess:
        command = [self._psql, "-h", self.folder, "-U", "jshell", "-d", "postgres", "-c", words]
        return subprocess.run(command, capture_output=True, timeout=60, check=False)

    def database(self) -> str:
        """The address of a new, empty database."""
        name = f"jobs{next(NUMBERS)}"
        assert not self._ask(f"CREATE DATABASE {name}").returncode
        return f"postgresql+psycopg://jshell@/{name}?host={self.folder}"

    def stop(self) -> None:
        self.process.send_signal(signal.SIGINT)  # without waiting for clients
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(30)
        self.log.close()
        shutil.rmtree(self.folder, ignore_errors=True)


@pytest.fixture(scope="session")
def cluster() -> Iterator[Cluster]:
    binaries = programs()
    if binaries is None:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    if os.geteuid() == 0 and "postgres" not in {one.pw_name for one in pwd.getpwall()}:
        pytest.skip("PostgreSQL refuses to run as root, and there is no user `postgres`")
    made = Cluster(binaries)
    yield made
    made.stop()


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """The address of an empty database, of either kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'jobs.db'}"
    return request.getfixturevalue("cluster").database()


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    made = Store.open(url, queue=500)
    yield made
    made.close()


@pytest.fixture
def local(tmp_path: Path) -> Iterator[Store]:
    """A store in a file."""
    made = Store.open(f"sqlite:///{tmp_path / 'jobs.db'}", queue=500)
    yield made
    made.close()

"""Everything about the service that its keeper may choose; the rest is not a choice."""

import re
from dataclasses import dataclass, field

from jshell.errors import BadValue

MAX_BODY_BYTES = 32 * 2**20  # bytes of a body that is no form: it stays in memory while it arrives
LOCAL = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class Settings:
    """How a service runs.

    Args:
        db: Where jobs are kept: `sqlite:///jshell.db`, or `postgresql+psycopg://user@host/database`.
        engine: Where jobs run: `processes` (spawned), `inline`, or `tcp://host:port` of a Dask scheduler.
        workers: Jobs that run at the same time.
        lease: Time without a heartbeat, on the observer's own clock, after which a job is given to another [s].
        attempts: Deaths of its worker in the middle of it after which a job is given up; restarts do not count.
        seconds: Longest time of one job [s]; spawned processes only.
        memory: Largest resident memory of the process of one job [bytes]; spawned processes on Linux only.
        nice: How far processes of jobs stand back behind the server on a busy machine, 0 to 19.
        queue: Jobs that may wait.
        upload: Largest body of a request [bytes].
        arrival: Time in which the body of a request must arrive [s].
        traces: Most traces of one job.
        cache: Folder of compiled programs, kept between runs; None is that of every jshell command.
        warm: Whether a process compiles the usual fit before its first job.
        host: Address the server listens at.
        port: Port it listens at.
        token: What a request must bear where the service is open to other machines.
        allowed_hosts: Names by which the service may be called.
        root_path: Where a proxy in front shows the service, e.g. `/fits`; its addresses begin with it.
        proxy: Address or network of that proxy, whose word on who asks, and whether by TLS, is believed.

    Raises:
        BadValue: A number outside its meaning.
    """

    db: str = "sqlite:///jshell.db"
    engine: str = "processes"
    workers: int = 1
    lease: float | int = 15.0
    attempts: int = 3
    seconds: float | int = 600.0
    memory: int = 4 * 2**30
    nice: int = 10
    queue: int = 1000
    upload: int = 256 * 2**20
    arrival: float | int = 120.0
    traces: int = 10_000
    cache: str | None = None
    warm: bool = True
    host: str = "127.0.0.1"
    port: int = 8765
    token: str | None = field(default=None, repr=False)
    allowed_hosts: tuple[str, ...] = LOCAL
    root_path: str = ""
    proxy: str | None = None

    def __post_init__(self) -> None:
        for name in ("workers", "lease", "attempts", "seconds", "memory", "queue", "upload", "arrival", "traces"):
            value = getattr(self, name)
            if not value > 0:
                raise BadValue(name, found=f"{value:g}", expected="a number above 0", remedy="Leave it out.")
        if not 0 <= self.nice <= 19:
            raise BadValue("nice", found=str(self.nice), expected="0 to 19", remedy="10 is usual.")
        if self.root_path and not re.fullmatch(r"(/[\w.~-]+)+", self.root_path, re.ASCII):
            raise BadValue(
                "root_path", found=repr(self.root_path), expected="/name", remedy="Write it without an end /."
            )
        if not 0 <= self.port < 2**16:
            raise BadValue("port", found=str(self.port), expected="0 to 65535", remedy="8765 is usual; 0 picks one.")

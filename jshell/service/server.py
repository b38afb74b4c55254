"""The service on its way: opened, listening, and drained when it is told to stop."""

import contextlib
import os
import signal
import socket
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

from jshell.errors import BadValue, require_extra
from jshell.service.settings import Settings

if TYPE_CHECKING:
    from uvicorn import Config

HEADER = 16 * 1024  # bytes of a request's line and headers
IDLE = 15  # seconds that a quiet connection is kept
PACKAGES = ("uvicorn", "fastapi", "sqlalchemy", "jinja2", "python_multipart", "prometheus_client")  # of the extra


def serve(settings: Settings, report: Callable[[str], None] | None = None) -> None:
    """Listen until a signal says stop; then finish or give back what runs, within ten seconds.

    A signal during the start ends the process at once, with 0: nothing was accepted yet. After this returns the process
    should end without Python's own goodbyes, for a thread that compiles would abort it.

    Args:
        settings: What the keeper chose.
        report: Is called with the address once it is known.

    Raises:
        BadValue: An open address without a token, or a port that is taken.
        BadStore, StoreUnavailable: As `Store.open`.
        MissingExtra: The extra `service` is not installed.
    """
    for module in PACKAGES:
        require_extra(module, "service", "jshell serve")
    import uvicorn

    from jshell.service.app import create_app
    from jshell.service.safety import check_open
    from jshell.service.store import Store
    from jshell.service.worker import Worker

    check_open(settings)
    listening = _listen(settings)
    store = Store.open(settings.db, queue=settings.queue, attempts=settings.attempts)
    try:
        worker = Worker(settings, store)
        _raise_limit()
        if report is not None:
            host, port = listening.getsockname()[:2]
            report(f"http://{f'[{host}]' if ':' in host else host}:{port}")
        server = uvicorn.Server(configured(create_app(settings, store, worker), settings))

        def on_signal(sig: int, frame: FrameType | None) -> None:
            worker.stopping.set()  # from now on a process that dies was told to, too
            uvicorn.Server.handle_exit(server, sig, frame)

        server.handle_exit = on_signal
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: None if server.started else os._exit(0))
        server.run(sockets=[listening])  # it drains on a signal and then sends it on: to the line above
    finally:
        store.close()
        listening.close()


def configured(app: Any, settings: Settings) -> "Config":
    """How uvicorn is to serve an application of the service.

    Its warnings are all of what anybody may send, lines of any number that nobody can act on: they are left out. It
    speaks no WebSocket, for whoever asks for one would leave the connections that are counted here.

    Args:
        app: The application.
        settings: What the keeper chose.
    """
    from uvicorn import Config

    from jshell.service.connections import MOST, Connection

    return Config(  # httptools is faster, but reads a header without end
        app, http=Connection, ws="none", log_level="error", server_header=False, date_header=True, backlog=MOST,
        h11_max_incomplete_event_size=HEADER, timeout_keep_alive=IDLE, timeout_graceful_shutdown=2, lifespan="on",
        access_log=False, proxy_headers=settings.proxy is not None, forwarded_allow_ips=settings.proxy,
    )  # fmt: skip


def _raise_limit() -> None:
    """Have as many files open as the system allows: every connection is one."""
    with contextlib.suppress(ImportError, OSError, ValueError):  # Windows has no such limit
        import resource

        most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (most if most > 0 else 65536, most))


def _listen(settings: Settings) -> socket.socket:
    six = ":" in settings.host
    host = "127.0.0.1" if settings.host == "localhost" else settings.host
    try:
        return socket.create_server(
            (host, settings.port), family=socket.AF_INET6 if six else socket.AF_INET, backlog=2048, dualstack_ipv6=six
        )
    except OSError as error:
        raise BadValue(
            "--host, --port", found=str(error.strerror), expected="an address that is free",
            remedy="Choose another --port; 0 picks one.",
        ) from None  # fmt: skip

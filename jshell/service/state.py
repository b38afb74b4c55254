"""What a running service holds, as its routes see it."""

import threading
import time
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from fastapi import Depends, Request

from jshell.service.settings import Settings
from jshell.service.store import Store

EDGES = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)  # [s] of the histogram of answers


@dataclass
class Metrics:
    """Requests that were answered, by method and status, and how long they took."""

    requests: Counter[tuple[str, int]] = field(default_factory=Counter)
    slots: list[int] = field(default_factory=lambda: [0] * (len(EDGES) + 1))
    seconds: float = 0.0
    _turn: threading.Lock = field(default_factory=threading.Lock)

    def add(self, method: str, status: int, seconds: float) -> None:
        """Count one answer."""
        slot = next((i for i, edge in enumerate(EDGES) if seconds <= edge), len(EDGES))
        with self._turn:
            self.requests[method, status] += 1
            self.slots[slot] += 1
            self.seconds += seconds

    def text(self, jobs: MutableMapping[str, int] | dict[str, int], version: str) -> str:
        """All of it in Prometheus' text format."""
        with self._turn:
            requests, slots, seconds = dict(self.requests), list(self.slots), self.seconds
        lines = [
            "# HELP jshell_info Version of the service.", "# TYPE jshell_info gauge",
            f'jshell_info{{version="{version}"}} 1',
            "# HELP jshell_jobs Jobs by state.", "# TYPE jshell_jobs gauge",
            *(f'jshell_jobs{{state="{state}"}} {count}' for state, count in sorted(jobs.items())),
            "# HELP jshell_requests_total Requests answered.", "# TYPE jshell_requests_total counter",
            *(
                f'jshell_requests_total{{method="{method}",status="{status}"}} {count}'
                for (method, status), count in sorted(requests.items())
            ),
            "# HELP jshell_request_seconds Time to the end of an answer.", "# TYPE jshell_request_seconds histogram",
        ]  # fmt: skip
        total = 0
        for edge, count in zip((*EDGES, "+Inf"), slots, strict=True):
            total += count
            lines.append(f'jshell_request_seconds_bucket{{le="{edge}"}} {total}')
        lines += [f"jshell_request_seconds_sum {seconds:.6f}", f"jshell_request_seconds_count {total}"]
        return "\n".join(lines) + "\n"


KNOWN = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")


class Counted:
    """Counts and times every answer on its way out."""

    def __init__(self, app: Callable[..., Awaitable[None]], metrics: Metrics) -> None:
        self.app, self.metrics = app, metrics

    async def __call__(self, scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        status, begin = 500, time.perf_counter()

        async def seen(message: MutableMapping[str, Any]) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, seen)
        finally:
            method = scope["method"] if scope["method"] in KNOWN else "other"
            self.metrics.add(method, status, time.perf_counter() - begin)


@dataclass(frozen=True)
class Service:
    """What the routes share."""

    settings: Settings
    store: Store
    metrics: Metrics


async def _service(request: Request) -> Service:
    return request.app.state.service


Here = Annotated[Service, Depends(_service)]

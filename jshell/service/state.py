"""What a running service holds, as its routes see it."""

import time
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, disable_created_metrics, generate_latest

from jshell.service.sessions import Guesses
from jshell.service.settings import Settings
from jshell.service.store import Store

EDGES = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)  # [s] of the histogram of answers
disable_created_metrics()  # a time beside every number: nobody asked for them


class Metrics:
    """Requests that were answered, by method and status, and how long they took; jobs by state, when it is asked."""

    def __init__(self) -> None:
        self._all = CollectorRegistry()
        self._version = Gauge("jshell_info", "Version of the service.", ["version"], registry=self._all)
        self._jobs = Gauge("jshell_jobs", "Jobs by state.", ["state"], registry=self._all)
        self._requests = Counter("jshell_requests", "Requests answered.", ["method", "status"], registry=self._all)
        self._seconds = Histogram(
            "jshell_request_seconds", "Time to the end of an answer.", buckets=EDGES, registry=self._all
        )

    def add(self, method: str, status: int, seconds: float) -> None:
        """Count one answer."""
        self._requests.labels(method, str(status)).inc()
        self._seconds.observe(seconds)

    def text(self, jobs: Mapping[str, int], version: str) -> str:
        """All of it in Prometheus' text format."""
        self._version.labels(version).set(1)
        for state, count in jobs.items():
            self._jobs.labels(state).set(count)
        return generate_latest(self._all).decode()


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
    guesses: Guesses = field(default_factory=Guesses)


async def _service(request: Request) -> Service:
    return request.app.state.service


Here = Annotated[Service, Depends(_service)]

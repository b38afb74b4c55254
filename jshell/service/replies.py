"""What goes over the wire from the service: answers of the API."""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from jshell.service.schemas import Id, JobKind, State


class TraceOut(BaseModel):
    """A stored trace."""

    id: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{32}$")]
    name: str
    sha256: str
    size: int
    created: float = Field(description="Seconds since 1970.")


class Failure(BaseModel):
    """Why a job failed, in the library's words."""

    code: str
    place: str
    cause: str = Field(description="`found` and `expected` in one sentence.")
    found: str
    expected: str = Field(description="Empty where it is no more than a job that ends.")
    remedy: str


class TraceRead(TraceOut):
    """A stored trace, and what was read in it; or why it cannot be read: a file of a batch may be anything."""

    samples: int | None
    duration: float | None = Field(description="Dimensionless, or seconds where there are no conditions.")
    channels: list[str]
    sigma: list[str]
    units: dict[str, str] = Field(description="Column to unit, as read in the file; - is a pure number.")
    conditions: dict[str, float] | None
    scales: dict[str, float] | None = Field(description="SI value of the units of length, pressure and density.")
    loss: Literal["strict", "modal"] | None = Field(description="The loss that a fit would take by itself.")
    warnings: list[str]
    error: Failure | None


class JobOut(BaseModel):
    """A job: where it stands, and where its results are."""

    id: Id
    kind: JobKind
    state: State
    created: float
    started: float | None
    finished: float | None
    attempt: int
    progress: float = Field(ge=0, le=1)
    traces: list[str]
    specification: dict[str, Any]
    error: Failure | None
    links: dict[str, str]


class FitOut(JobOut):
    """A fit, with its result where there is one; its fields are those of `FitResult.record()`."""

    result: dict[str, Any] | None = None


class IntervalOut(BaseModel):
    """A profile interval of one parameter; null where an end is open."""

    value: float | None
    low: float | None
    high: float | None
    reason: str


class ProfileOut(BaseModel):
    """Profile intervals of a fit; its fields are those of `jshell.calibration.Profile.record`."""

    level: float
    criterion: str
    intervals: dict[str, IntervalOut]


class ModeOut(BaseModel):
    """One mode; null where its outcome leaves nothing to say."""

    model_config = ConfigDict(allow_inf_nan=False)

    mode: int = Field(ge=1, le=10**6, description="From 1, slowest first.")
    omega: float | None = Field(description="|s|; null where it is overdamped.")
    Omega: float | None = Field(description="Im s.")
    tau: float | None = Field(description="Decay time; null without loss.")
    dV: float | None
    dS: float | None
    outcome: str


class OrderModeOut(ModeOut):
    """One mode of one order around the axis."""

    azimuth: int = Field(ge=0, le=10**6, description="Its order m; 0 keeps the symmetry.")
    mode: int = Field(ge=1, le=10**6, description="From 1 within its order.")
    omega: float | None = Field(description="|s|; null where it is overdamped or grows.")
    growth: float | None = Field(description="Rate at which it grows, or null.")
    dH: float | None
    dW: float | None
    seen: str = Field(description="What of a recording sees it.")


class ModesOut(JobOut):
    """Modes, once they are found: those that keep the axial symmetry, or rows of several orders."""

    result: list[OrderModeOut] | list[ModeOut] | None = None


class FilmOut(JobOut):
    """A film's measurement, or a look at one, with what was found."""

    result: dict[str, Any] | None = None


class EstimateOut(BaseModel):
    """An unknown of an inversion; null where the data do not tell."""

    name: str
    value: float | None
    stderr: float | None


class InversionFound(BaseModel):
    """What every record of an inversion holds, among more."""

    title: str
    outcome: str
    estimates: list[EstimateOut] = Field(min_length=1)
    intervals: dict[str, Annotated[list[float | None], Field(min_length=2, max_length=2)]]


class InversionOut(JobOut):
    """An inversion, with its result where there is one; its fields are those of `jshell.inversion.Inversion.record`."""

    result: dict[str, Any] | None = None


class TracePage(BaseModel):
    """Traces, the latest first."""

    traces: list[TraceOut]
    next: str | None = Field(description="Address of the next page; null on the last.")


class JobPage(BaseModel):
    """Jobs, the latest first."""

    jobs: list[JobOut]
    next: str | None = Field(description="Address of the next page; null on the last.")


class DecayOut(BaseModel):
    """How fast the trace rings down, and who says so."""

    tau: float | None = Field(description="Decay time; null without loss, or where the shell is not buckled.")
    origin: Literal["law", "given beta1"] = Field(description="law: fitted to the simulator's modes.")
    error: dict[str, float] | None = Field(description="Relative error of the law: median, largest.")
    outside: list[str] = Field(description="What lies outside the range the law was fitted in.")
    words: str


class SimulateOut(BaseModel):
    """What the short model says of a shell."""

    outcome: str
    advice: str
    omega_minus: float | None
    omega_plus: float | None
    omega_sphere: float | None
    omega_marmottant: float | None
    tau: float | None
    decay: DecayOut
    volume: float | None
    pressure: float | None
    softening: dict[str, float | None] = Field(description="Sphere before buckling over the buckled shell after it.")
    crossing: dict[str, list[float | None]] = Field(description="Angular frequencies over the outer pressure.")
    trace: dict[str, list[float | None]] = Field(description="t, V and S after a push of one percent of the volume.")
    conditions: dict[str, float]
    coefficients: dict[str, float | None] = Field(description="beta1 is null where the shell is not buckled.")


class Health(BaseModel):
    """Whether the service can take and run jobs."""

    status: Literal["ok"]
    version: str = Field(min_length=1)


class ProblemOut(Failure):
    """Problem details of RFC 9457, with the library's code, place, cause and remedy."""

    type: str
    title: str
    status: int
    detail: str
    instance: str


def finite(value: Any) -> Any:
    """A value as JSON knows it: NaN and infinity are null."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

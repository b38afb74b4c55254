"""What goes over the wire to the service: requests of the API, with their limits.

Jobs are data: names out of closed lists, numbers, and arithmetic as text that
the library parses itself. Nothing here can name a function or a file.
"""

import math
import re
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    create_model,
    model_validator,
)
from typing_extensions import TypedDict  # pydantic needs this one below Python 3.12

from jshell.calibration.options import CONDITIONS, CONSTANTS, OPTIONS, choices_of, default_of, words_of
from jshell.calibration.parameters import Expression, check_value, unknowns
from jshell.calibration.problem import POSITIVE
from jshell.inversion.response import CHANNELS
from jshell.inversion.unknowns import SI
from jshell.membrane.stability import HIGHEST_ORDER
from jshell.shell.presets import R

Id = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{8,64}$", max_length=64)]
Text = Annotated[str, StringConstraints(min_length=1, max_length=200)]
CONSTANT = rf"^({'|'.join(CONSTANTS)})(\[[1-9][0-9]{{0,4}}\])?$"
Constant = Annotated[str, StringConstraints(pattern=CONSTANT)]
Condition = Literal[CONDITIONS]
Key = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=r"^[\x21-\x7e]+$")]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e12, le=1e12)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e12)]


def _whole(value: Any) -> Any:
    """JSON has one kind of number: 32.0 is a whole one."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Whole = Annotated[int, Field(strict=True), BeforeValidator(_whole)]
Around = Annotated[Whole, Field(ge=0, le=HIGHEST_ORDER)]
Pixel = Annotated[Whole, Field(ge=0, le=10**6)]
Degrees = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=180)]
State = Literal["queued", "running", "done", "failed", "cancelled"]
JobKind = Literal["fit", "batch", "simulate", "modes", "look", "film", "invert"]


def _closed(schema: dict[str, Any]) -> None:
    """Say in the description what is refused anyway: names beside the pattern."""
    for part in schema.get("properties", {}).values():
        if "patternProperties" in part:
            part["additionalProperties"] = False


class Wire(BaseModel):
    """A request: names that the schema does not know are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, json_schema_extra=_closed)


def _ordered(pair: tuple[float | None, float | None]) -> tuple[float | None, float | None]:
    low, high = pair
    if low is not None and high is not None and not low < high:
        raise ValueError("the lowest value must be below the highest")
    return pair


Bounds = Annotated[tuple[Number | None, Number | None], AfterValidator(_ordered)]


def _arithmetic(text: str) -> str:
    """A tie as it came, once it has been read: a worker would only find out later."""
    for name in Expression(text).names:
        if not re.fullmatch(CONSTANT, name):
            raise ValueError(f"{name!r} is no constant of the model: {', '.join(CONSTANTS)}")
    return text


# `jshell.calibration.Prior` as it comes over the wire
_PRIOR: Any = create_model(
    "Prior", __base__=Wire, __doc__="What is known of a parameter before the data.", mean=(Number, ...),
    sigma=(Positive, ...),
)  # fmt: skip


def _or_none(kind: Any) -> Any:
    return kind | None


_MANY: dict[str, Any] = {"default_factory": dict, "max_length": 100}
_WIRE: dict[str, tuple[Any, dict[str, Any]]] = {  # what may come over the wire of an option, and how much of it
    "fix": (dict[Constant, Number], _MANY),
    "bounds": (dict[Constant, Bounds], _MANY),
    "tie": (dict[Constant, Annotated[Text, AfterValidator(_arithmetic)]], _MANY),
    "local": (list[Constant | Condition], {"default_factory": list, "max_length": 20}),
    "uncertain": (dict[Condition, Positive | None], {"default_factory": dict}),
    "priors": (dict[Constant, _PRIOR], _MANY),
    "channels": (list[Text] | None, {"default": None, "min_length": 1, "max_length": 20}),
    "start": (_or_none(Number), {"default": None}),
    "stop": (_or_none(Number), {"default": None}),
    "drop": (list[tuple[Number, Number]], {"default_factory": list, "max_length": 100}),
    "starts": (Whole, {"default": default_of("starts"), "ge": 0, "le": 50}),
    "seed": (Whole, {"default": default_of("seed"), "ge": 0, "le": 2**31 - 1}),
}
_PROFILE = "Asymmetric 95 % intervals by profile likelihood as well."


def _field(name: str) -> tuple[Any, Any]:
    """An option of `jshell.calibration.FitOptions` as a field of a request."""
    words = words_of(name)
    words = words[0].upper() + words[1:] + "."
    if name in _WIRE:
        kind, limits = _WIRE[name]
        return kind, Field(description=words, **limits)
    known = choices_of(name)
    kind = Literal[tuple(one for one in known if one is not None)]
    return (_or_none(kind) if None in known else kind), Field(default_of(name), description=words)


_FIELDS = {name: _field(name) for name in OPTIONS}
_FIELDS["profile"] = (bool, Field(False, strict=True, description=_PROFILE))

if TYPE_CHECKING:

    class Options(Wire):
        """All may be left out; names, choices, words and defaults are those of `jshell.calibration.FitOptions`."""

else:
    Options = create_model("Options", __base__=Wire, **_FIELDS)


class FitRequest(Options):
    """Fit the short model to one or many traces that share their constants."""

    traces: list[Id] = Field(min_length=1, max_length=10_000, description="Identifiers that POST /traces gave.")

    @model_validator(mode="after")
    def _agrees(self) -> "FitRequest":
        """What the library refuses of any record is refused at once."""
        asked: Any = self
        ties = {name: Expression(text) for name, text in asked.tie.items()}
        read = {name for tie in ties.values() for name in tie.names}
        lost = {"strict": ("tau",), "modal": ("beta1", "beta2")}.get(asked.loss or "", ())
        for name in (*asked.fix, *asked.bounds, *asked.priors, *ties, *read):
            base, _, number = name.removesuffix("]").partition("[")
            if base in lost:
                raise ValueError(f"{name} is no constant of the loss {asked.loss}")
            if number and (int(number) > len(self.traces) or base not in (*asked.local, "tau")):
                raise ValueError(f"{name} is no constant here: of {len(self.traces)} traces, or it is not local")
        names = tuple(dict.fromkeys([*CONSTANTS, *asked.fix, *asked.bounds, *ties, *read]))
        positive = frozenset(name for name in names if name.partition("[")[0] in POSITIVE)
        ends = {name: (-math.inf if low is None else low, math.inf if high is None else high)
                for name, (low, high) in asked.bounds.items()}  # fmt: skip
        unknowns(names, positive, asked.fix, ends, asked.tie)
        return self


class BatchOptions(Wire):
    """The options of `jshell.calibration.fit_batch`."""

    loss: Literal["strict", "modal"] | None = None
    channels: list[Text] | None = Field(None, min_length=1, max_length=20)
    noise: Literal["auto", "white"] = "auto"
    solver: Literal["exact", "diffrax"] = "exact"
    equilibrium: Literal["plateau", "trace"] = "plateau"
    fix: dict[Literal["alpha1", "alpha2", "k_vs", "tau"], Number] = Field(default_factory=dict)
    bounds: dict[Literal["alpha1", "alpha2", "k_vs", "tau"], Bounds] = Field(default_factory=dict)
    starts: Whole = Field(0, ge=0, le=20)
    seed: Whole = Field(0, ge=0, le=2**31 - 1)

    @model_validator(mode="after")
    def _can_be(self) -> "BatchOptions":
        """As of a single fit."""
        for name, value in self.fix.items():
            check_value(f"fix[{name!r}]", name, value, positive=name in POSITIVE)
        return self


class Conditions(Wire):
    """A shell and its load without units: lengths in R0, pressures in E d/R0."""

    d_hat: float = Field(float(R.conditions.thickness), strict=True, gt=0, lt=1, description="Thickness d/R0.")
    P0_hat: float = Field(float(R.conditions.gas_pressure), strict=True, gt=0, le=1e6, description="Gas pressure.")
    Pext_hat: float = Field(
        float(R.conditions.outer_pressure), strict=True, gt=0, le=1e6, description="Outer pressure."
    )
    eta_hat: float = Field(float(R.conditions.viscosity), strict=True, ge=0, le=1e3, description="Viscosity.")
    kappa: float = Field(1.4, strict=True, ge=1, le=10, description="Polytropic exponent.")
    nu: float = Field(0.5, strict=True, gt=-1, le=0.5, description="Poisson ratio.")

    def shell(self) -> dict[str, float]:
        """The shell and its load alone, of a request that says more."""
        return {name: getattr(self, name) for name in Conditions.model_fields}


class SimulateRequest(Conditions):
    """The short model at once, or a run of the simulator as a job."""

    model: Literal["reduced", "simulator"] = Field("reduced", description="simulator: a job, 202.")
    alpha1: float | None = Field(None, strict=True, gt=0, le=1e3, description="Added-mass factor of the volume.")
    alpha2: float | None = Field(None, strict=True, gt=0, le=1e3, description="Added-mass factor of the area.")
    k_vs: float | None = Field(None, strict=True, ge=-1e3, le=1e3, description="Volume-area coupling.")
    beta1: float | None = Field(
        None, strict=True, ge=0, le=1e4, description="Damping factor of the volume; null: as fast as the simulator."
    )
    duration: float = Field(60.0, strict=True, gt=0, le=400, description="Length of the trace.")
    ramp: float = Field(25.0, strict=True, ge=0, le=200, description="Simulator: time of the pressure's rise.")
    elements: Whole = Field(24, ge=12, le=64, description="Simulator: elements.")


class ModesRequest(Conditions):
    """The small vibrations of a shell about its rest shape, as a job."""

    liquid: Literal["exact", "second", "layer", "ideal"] = Field(
        "exact",
        description="exact: any viscosity; second, layer: orders of a thin layer; ideal: no viscosity. Left out it is "
        "exact, and second for orders above 0 around the axis, where the exact one is not known.",
    )
    count: Whole = Field(4, ge=1, le=6, description="How many of each order, slowest first.")
    elements: Whole = Field(32, ge=12, le=64, description="Elements of the meridian.")
    attached: float = Field(0.0, strict=True, ge=0, lt=1.5, description="Half-angle of the pad that holds it; 0: free.")
    azimuth: list[Around] | None = Field(
        None, min_length=1, max_length=8, description="Orders m around the axis, as [0, 1, 2, 3]; left out, 0 alone."
    )

    @model_validator(mode="after")
    def _known(self) -> "ModesRequest":
        """What `jshell.dynamics.modes` refuses is refused at once."""
        if max(self.azimuth or [0]) == 0:
            return self
        if self.liquid == "exact" and "liquid" in self.model_fields_set:
            raise ValueError("the exact liquid is known for order 0 only; second is the best for others")
        if self.count > self.elements // 4:
            raise ValueError(f"count must be at most a quarter of the elements, {self.elements // 4}")
        return self


OfShell = Annotated[str, StringConstraints(pattern=rf"^({'|'.join(SI)})$")]  # those without units are among them
Channel = Annotated[str, StringConstraints(pattern=rf"^({'|'.join(CHANNELS)})$")]


class InvertRequest(Wire):
    """What is asked of ring-downs of one shell, as of `jshell.invert`: SI, or without units as the traces."""

    traces: list[Id] = Field(min_length=1, max_length=20, description="Identifiers that POST /traces gave.")
    unknown: list[OfShell] = Field(
        default_factory=list, max_length=len(SI), description="What is asked, beside what has bounds or a prior."
    )
    known: dict[OfShell, Number] = Field(default_factory=dict, description="What is known, over the traces' headers.")
    bounds: dict[OfShell, Bounds] = Field(default_factory=dict, description="Where something asked is looked for.")
    priors: dict[OfShell, _PRIOR] = Field(  # pyright: ignore[reportInvalidTypeForm]
        default_factory=dict, description="What is known of it before the data."
    )
    local: list[OfShell] = Field(
        default_factory=list, max_length=len(SI), description="What every recording has for itself."
    )
    channels: list[Channel] | None = Field(
        None, min_length=1, max_length=len(CHANNELS), description="Null: those of H, W, V, S that are there."
    )
    start: Number | None = Field(None, description="Where the ring-down begins [s, or time unit]; null: after a snap.")
    stop: Number | None = Field(None, description="Where it ends [s, or time unit].")
    free_rest: bool = Field(False, strict=True, description="The values where channels rest are no data.")
    nuisance: bool | None = Field(
        None, strict=True, description="Seek pad and weak spot too, from priors; null: where there are SI units."
    )
    exact: bool = Field(True, strict=True, description="Correct the answer to the exact liquid.")
    elements: Whole = Field(20, ge=12, le=40, description="Elements of the meridian; of a trace 24 where 20 stands.")
    level: Literal["modal", "trace"] = Field(
        "modal", description="modal: ring-downs; trace: records through the snap, simulated whole, some minutes."
    )
    ramp: Number | None = Field(
        None, ge=0, description="trace: time of the pressure's rise [s, or time unit], 0 at once; null: the file's."
    )
    origin: Number = Field(0.0, description="trace: when the pressure begins to rise [s, or time unit].")

    @model_validator(mode="after")
    def _asks(self) -> "InvertRequest":
        """What `jshell.invert` refuses of any recording is refused at once."""
        asked = {*self.unknown, *self.priors, *self.bounds}
        if not asked:
            raise ValueError("nothing is asked: name a number of the shell among the unknown")
        if both := sorted(asked & set(self.known)):
            raise ValueError(f"{', '.join(both)} cannot be known and asked; a prior says what is known of it")
        if more := sorted(set(self.local) - asked):
            raise ValueError(f"{', '.join(more)} can only be local where it is asked")
        return self


class FilmOptions(Wire):
    """What is known of a camera, as of `jshell.camera.View`."""

    rate: Positive | None = Field(None, description="Frames per second; null: the film's own.")
    pixel: Positive | None = Field(None, description="Size of a pixel at the shell [m]; null: lengths in pixels.")
    bright: bool = Field(False, strict=True, description="The shell is brighter than what surrounds it.")
    axis: Degrees | None = Field(90.0, description="Direction of the axis [degrees], 90 upright; null: look for it.")
    holder: tuple[Pixel, Pixel, Pixel, Pixel] | None = Field(
        None, description="First and last row, first and last column of what holds the shell, left out."
    )
    section: bool = Field(False, strict=True, description="The film shows a section along the axis.")
    start: Number | None = Field(None, description="Start of the analysis [s].")
    stop: Number | None = Field(None, description="End of the analysis [s].")


class ReadingFields(TypedDict, total=False):
    """What a file leaves open, as of `jshell.io.Reading`."""

    columns: dict[str, str | int] | str | None
    units: dict[str, str] | str | None
    rate: float | None
    time_from: str | int | None
    rows: tuple[int | None, int | None] | str | None
    missing: Literal["refuse", "drop"]

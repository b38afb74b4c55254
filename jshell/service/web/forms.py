"""What a browser sends, and of the form of a new fit the API's own request.

Every field is optional and has the library's default, so that the form posts
without JavaScript, and a link can hold all of it.
"""

import re
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Request, Response
from fastapi.responses import RedirectResponse
from pydantic import BaseModel, ValidationError
from starlette.datastructures import ImmutableMultiDict

from jshell.calibration.option_texts import read_texts
from jshell.calibration.options import CONSTANTS, OPTIONS, FitOptions, choices_of, default_of, described
from jshell.errors import BadValue, JshellError, NotFound
from jshell.io.sheets import NUMBER
from jshell.service.problems import brief, of_validation
from jshell.service.safety import clean_name
from jshell.service.schemas import FitRequest
from jshell.service.store import JobRow

Schema = TypeVar("Schema", bound=BaseModel)
STRICT, MODAL = ("alpha1", "alpha2", "k_vs", "beta1"), ("alpha1", "alpha2", "k_vs", "tau")
CONDITIONS = {
    "thickness": "thickness d",
    "youngs_modulus": "Young's modulus E",
    "gas_pressure": "gas pressure P₀",
    "outer_pressure": "outer pressure Pₑₓₜ",
    "viscosity": "viscosity η",
}
CHOICES = tuple(name for name in OPTIONS if choices_of(name))  # options that are a choice among names
TEXTS = ("drop", "priors")  # options that are written as in the terminal, several with commas between
STRICT_ONLY = ("solver", "beta2", "dipole")
IDS = ("id", "trace", "before", "look", "film", "kept")  # parts of an address, and fields, that name what is kept
ID = re.compile(r"[0-9a-f]{8,64}")  # as the API has it
MOST_FILES = 200  # of a form; as many traces
LONGEST = 200  # characters of a field


@dataclass(frozen=True)
class Choice:
    """A select of the form: an option, what it chooses, and per value its words; the first is the usual one."""

    name: str
    words: str
    values: tuple[tuple[str, str], ...]


def validated(kind: type[Schema], fields: Mapping[str, Any], remedy: str) -> Schema:
    """What the fields of a form ask for.

    Raises:
        BadValue: A field that the API would refuse, too.
    """
    try:
        return kind.model_validate(fields)
    except ValidationError as error:
        found = of_validation(error.errors())
        raise BadValue(f"field {found.place}", found=found.found, expected=found.expected, remedy=remedy) from None


def selects(loss: str) -> list[Choice]:
    """The selects that any fit by this loss has, beside loss and rest state."""
    names = [
        one for one in CHOICES if one not in ("loss", "equilibrium") and (loss == "strict" or one not in STRICT_ONLY)
    ]
    return [choice(name) for name in names]


def choice(name: str) -> Choice:
    """An option in the library's words."""
    known = choices_of(name)
    usual = default_of(name)
    rest = [(key, f"{key}: {words}") for key, words in known.items() if key != usual]
    first = ("" if usual is None else usual, known[usual] if usual is None else f"{usual}: {known[usual]}")
    return Choice(name, described(name), (first, *rest))


@dataclass
class PageForm:
    """What stands in the fields, as text; and what is wrong with it.

    Attributes:
        traces: Identifiers.
        fields: Name of a field to its text.
        channels: Those ticked; empty is the library's choice.
        files: Names of a field, and Starlette's uploads.
        error: The first thing that is wrong.
    """

    traces: list[str]
    fields: dict[str, str] = field(default_factory=dict)
    channels: list[str] = field(default_factory=list)
    files: list[tuple[str, Any]] = field(default_factory=list)
    error: JshellError | None = None

    def text(self, name: str) -> str:
        """What stands in a field."""
        return self.fields.get(name, "")

    def role(self, name: str) -> str:
        """`free`, `fixed` or `local`."""
        return self.fields.get(f"role.{name}", "free")

    def bounds(self, name: str) -> tuple[float | None, float | None]:
        """The lowest and the highest value of a parameter, where they are said."""
        low, high = (self.number(end) if self.text(end) else None for end in (f"low.{name}", f"high.{name}"))
        return low, high

    def uploads(self, name: str) -> list[tuple[str, bytes]]:
        """Name and bytes of the files in a field; one that was left empty is none."""
        return [
            (clean_name(one.filename), content)
            for key, one in self.files
            if key == name and ((content := one.file.read()) or one.filename)
        ]

    def request(self) -> FitRequest:
        """The API's request for a fit.

        Raises:
            BadValue: A field that holds no number, or a value that the API refuses.
        """
        said = lambda *names: [name for name in names if self.text(name)]  # noqa: E731
        asked: dict[str, Any] = {"traces": self.traces, "profile": self.text("profile") == "on"}
        asked |= {"channels": self.channels} if self.channels else {}
        asked |= {name: self.text(name) for name in said(*CHOICES)}
        asked |= {name: self.written(name) for name in said(*TEXTS)}
        asked |= {name: self.time(name) for name in said("start", "stop")}
        asked |= {name: self.number(name) for name in said("starts", "seed")}
        fix, bounds, tie, local = {}, {}, {}, []
        for name in CONSTANTS:
            role = self.role(name)
            if role == "fixed":
                fix[name] = self.number(f"value.{name}")
            elif role == "local":
                local.append(name)
            elif role == "tied":
                tie[name] = self.text(f"tie.{name}")
            if role != "fixed" and self.bounds(name) != (None, None):
                bounds[name] = self.bounds(name)
        known = {name: self.text(f"known.{name}") for name in CONDITIONS}
        uncertain = {
            name: None if how == "free" else self.number(f"relative.{name}") / 100
            for name, how in known.items()
            if how in ("free", "prior")
        }
        asked |= {"fix": fix, "bounds": bounds, "tie": tie, "local": local, "uncertain": uncertain}
        return validated(FitRequest, asked, "Correct the field.")

    def written(self, name: str) -> Any:
        """An option that is written as in the terminal, several with commas between; times in the form's unit."""
        found = read_texts(name, self.text(name).split(","), f"field {name}")
        if name == "priors":
            return {key: {"mean": one.mean, "sigma": one.sigma} for key, one in found.items()}
        return [[end / self.time_factor for end in span] for span in found]

    @property
    def time_factor(self) -> float:
        """How many of the form's unit of time are one dimensionless unit."""
        return (self.number("time_factor") if self.text("time_factor") else 1.0) or 1.0

    def time(self, name: str) -> float:
        """A dimensionless time, from a field in the unit that the form shows."""
        return self.number(name) / self.time_factor

    def number(self, name: str) -> float:
        """The number in a field; a decimal comma is understood, and the schema tells which must be whole."""
        text = self.text(name).strip().replace(",", ".").replace("−", "-")
        if not NUMBER.fullmatch(text):
            raise BadValue(
                f"field {name}", found=repr(text) if text else "nothing", expected="a number",
                remedy="Write it, or choose free.",
            )  # fmt: skip
        return float(text)


def check_ids(given: Iterable[tuple[str, Any]]) -> None:
    """Refuse identifiers of another form than any has, before a database is asked: not every one takes all letters.

    Raises:
        NotFound: Naming the first.
    """
    for name, text in given:
        if name in IDS and isinstance(text, str) and text and not ID.fullmatch(text.strip()):
            raise NotFound(
                name,
                found=brief(text),
                expected="the identifier of a job or a trace",
                remedy="See the list at /.",
            )


async def ids_checked(request: Request) -> None:
    """Of every address of the page."""
    check_ids([*request.path_params.items(), *request.query_params.multi_items()])


def read(given: ImmutableMultiDict[Any, Any]) -> PageForm:
    """The form that a browser sent, or what of it stands in an address.

    Raises:
        NotFound: An identifier of another form than any has.
    """
    check_ids(given.multi_items())
    texts = [(name, text.strip()[:LONGEST]) for name, text in given.multi_items() if isinstance(text, str)]
    listed = lambda wanted: [text for name, text in texts if name == wanted]  # noqa: E731
    files = [(name, file) for name, file in given.multi_items() if not isinstance(file, str)]
    return PageForm(listed("trace")[:MOST_FILES], dict(texts), listed("channel")[:20], files)


async def _sent(request: Request) -> AsyncIterator[PageForm]:
    """Its files stay open until it is answered."""
    if request.method != "POST":
        yield read(request.query_params)
        return
    async with request.form(max_files=MOST_FILES) as given:
        yield read(given)


Sent = Annotated[PageForm, Depends(_sent)]  # what a route of the page is asked for


def onward(bare: bool, traces: Sequence[str]) -> Response:
    """From files to the form of their fit; first to the shell's conditions where some of them lack these."""
    chosen = "&".join(f"trace={one}" for one in traces)
    return RedirectResponse(f"/traces/conditions?{chosen}" if bare else f"/fits/new?{chosen}", 303)


def again(job: JobRow) -> list[tuple[str, str]]:
    """The fields that ask for a job once more, for a link to the form."""
    asked: Mapping[str, Any] = job.specification
    pairs: list[tuple[str, str]] = [("trace", trace) for trace in job.traces]
    pairs += [("channel", name) for name in asked.get("channels") or ()]
    pairs += [(name, str(asked[name])) for name in (*CHOICES, "start", "stop", "starts", "seed") if asked.get(name)]
    if asked.get("drop"):
        pairs.append(("drop", ", ".join(f"{first:.10g}:{last:.10g}" for first, last in asked["drop"])))
    if asked.get("priors"):
        priors = [f"{name}={one['mean']:.10g}:{one['sigma']:.10g}" for name, one in asked["priors"].items()]
        pairs.append(("priors", ", ".join(priors)))
    for name, value in (asked.get("fix") or {}).items():
        pairs += [(f"role.{name}", "fixed"), (f"value.{name}", f"{value:.10g}")]
    for name, text in (asked.get("tie") or {}).items():
        pairs += [(f"role.{name}", "tied"), (f"tie.{name}", text)]
    pairs += [(f"role.{name}", "local") for name in asked.get("local") or ()]
    for name, (low, high) in (asked.get("bounds") or {}).items():
        pairs += [(f"low.{name}", f"{low:.10g}")] if low is not None else []
        pairs += [(f"high.{name}", f"{high:.10g}")] if high is not None else []
    for name, value in (asked.get("uncertain") or {}).items():
        pairs.append((f"known.{name}", "free" if value is None else "prior"))
        pairs += [] if value is None else [(f"relative.{name}", f"{100 * value:.6g}")]
    return [*pairs, ("profile", "on")] if asked.get("profile") else pairs


def python(job: JobRow, names: Sequence[str], found: FitOptions | None) -> str:
    """The same fit as a program.

    Args:
        job: What was asked.
        names: Of the files.
        found: What the library made of it: the loss and the channels.
    """
    asked = dict(job.specification)
    profile = asked.pop("profile", False)
    if found is not None:
        asked |= {"loss": found.loss, "channels": list(found.channels or ())}
    options = []
    for name, value in sorted(asked.items(), key=lambda pair: pair[0] not in ("loss", "channels")):
        if name == "bounds":
            pairs = ", ".join(f"{key!r}: ({_end(low, '-')}, {_end(high, '')})" for key, (low, high) in value.items())
            options.append(f"bounds={{{pairs}}}")
        elif name == "priors":
            pairs = ", ".join(
                f"{key!r}: js.calibration.Prior({one['mean']!r}, {one['sigma']!r})" for key, one in value.items()
            )
            options.append(f"priors={{{pairs}}}")
        else:
            options.append(f"{name}={value!r}")
    files = ", ".join(repr(name) for name in names)
    lines = ["import jshell as js", "", f"traces = [js.io.read_trace(name) for name in [{files}]]"]
    lines += ["result = js.calibration.fit_trajectories(", "    traces,", *(f"    {one}," for one in options), ")"]
    lines.append("print(result)")
    return "\n".join([*lines, "print(result.profile().report())"] if profile else lines) + "\n"


def _end(value: float | None, sign: str) -> str:
    return f"float('{sign}inf')" if value is None else repr(value)

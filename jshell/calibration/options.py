"""What can be chosen of a fit: every choice once, with its default, its words, its check, and JSON both ways.

The signature of `fit_trajectories`, the terminal's verbs, the service's requests
and the page's form all say and refuse what stands here.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from jshell.errors import BadValue, choose

CONSTANTS = ("alpha1", "alpha2", "k_vs", "beta1", "beta2", "tau")
CONDITIONS = ("thickness", "youngs_modulus", "gas_pressure", "outer_pressure", "viscosity")

Number = float | int
Tie = Callable[[Mapping[str, Any]], Any]  # a parameter from the others, by name


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter before the data: a mean and a standard error, both in its own unit."""

    mean: Number
    sigma: Number

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mean) and math.isfinite(self.sigma) and self.sigma > 0):
            raise BadValue(
                "prior",
                found=f"mean {self.mean:g}, sigma {self.sigma:g}",
                expected="finite numbers, sigma above 0",
                remedy="Fix the parameter if it is known exactly.",
            )


def choice(default: Any, words: str, choices: Mapping[Any, str] | None = None, *, make: Any = None) -> Any:
    """A field of `FitOptions`.

    Args:
        default: Where nothing is chosen.
        words: What it chooses.
        choices: What may be chosen, with what that means; None where it is no choice among names.
        make: The default of a field that holds a container.
    """
    given: dict[str, Any] = {"default": default} if make is None else {"default_factory": make}
    return field(**given, metadata={"words": words, "choices": choices})


@dataclass(frozen=True)
class FitOptions:
    """The options of a fit of traces; or of a table of frequencies, where `kind` says so.

    Attributes:
        kind: `trajectories`, or `frequencies`: of the options below those that `fit_frequencies` has.
        Others: As the arguments of `fit_trajectories` and `fit_frequencies`.

    Raises:
        BadName: A choice that is not among those there are.
        BadValue: A number of starts below 0.
    """

    kind: str = "trajectories"
    loss: str | None = choice(
        None,
        "how traces are compared with the oscillator",
        {
            None: "strict for traces of V and S alone, modal otherwise",
            "strict": "V and S follow the oscillator",
            "modal": "only ω-, ω+ and τ of any channels",
        },
    )
    weighting: str | None = choice(
        None,
        "what is fitted of a table of frequencies",
        {None: "V_e omega", "V_e omega": "V_e ω", "V_e^2 omega^2": "V_e² ω²"},
    )
    solver: str = choice(
        "exact",
        "how the oscillator's motion is computed",
        {"exact": "closed form", "diffrax": "adaptive steps, strict loss only"},
    )
    equilibrium: str = choice(
        "plateau",
        "where the rest state comes from",
        {"plateau": "the plateau law", "trace": "where each trace settles, which needs V"},
    )
    fix: Mapping[str, Number] = choice(None, "constants not to be fitted, with their values", make=dict)
    bounds: Mapping[str, tuple[Number, Number]] = choice(None, "lowest and highest value of constants", make=dict)
    tie: Mapping[str, str | Tie] = choice(
        None, "constants that follow from others by arithmetic, such as 0.3*alpha1", make=dict
    )
    local: Sequence[str] = choice(None, "parameters that every trace has of its own", make=tuple)
    uncertain: Mapping[str, Number | None] = choice(
        None, "conditions that are parameters, with their relative standard error where it is known", make=dict
    )
    priors: Mapping[str, Prior] = choice(
        None, "what is known of parameters beforehand: mean and standard error", make=dict
    )
    robust: str | None = choice(
        None,
        "how much samples far off count",
        {None: "in full, least squares", "huber": "less and less", "cauchy": "hardly"},
    )
    noise: str = choice(
        "auto",
        "what the noise is taken to be",
        {"auto": "what the residual shows, autocorrelated where it is", "white": "independent from sample to sample"},
    )
    channels: Sequence[str] | None = choice(None, "channels to read; those of V, S, H and W by default")
    start: float | int | None = choice(
        None, "first time read; by default 5 after the dip of a record that holds a snap"
    )
    stop: float | int | None = choice(None, "last time read; the end by default")
    drop: Sequence[tuple[Number, Number]] = choice(None, "spans of time whose samples are left out", make=tuple)
    missing: str = choice(
        "refuse",
        "what becomes of samples that are no numbers",
        {"refuse": "the trace is refused", "drop": "they are left out"},
    )
    beta2: str = choice(
        "equal_decay",
        "the damping factor of the area",
        {"equal_decay": "follows from beta1, so that both modes decay alike", "free": "fitted, strict loss only"},
    )
    dipole: str = choice(
        "corrected",
        "the convention of beta2",
        {"corrected": "dissipation of the dipole corrected", "printed": "as the source prints it"},
    )
    starts: int = choice(3, "random starts beside the one that the data give")
    seed: int = choice(0, "of random starts")

    def __post_init__(self) -> None:
        for one in fields(self):
            value, known = getattr(self, one.name), one.metadata.get("choices")
            if known is not None:
                choose(one.name, value, known, expected="one of " + ", ".join(n for n in known if n is not None))
            if one.default_factory is dict:
                object.__setattr__(self, one.name, dict(value or {}))
            elif one.default_factory is tuple:
                object.__setattr__(self, one.name, tuple(value or ()))
        object.__setattr__(self, "channels", tuple(self.channels) if self.channels else None)
        if self.starts < 0:
            raise BadValue("starts", found=f"{self.starts}", expected="at least 0", remedy="Give a number of starts.")

    def changed(self, **given: Any) -> "FitOptions":
        """The same options but those that are given."""
        return replace(self, **given)

    def differing(self) -> dict[str, Any]:
        """Those that are not what they are by default."""
        usual = FitOptions(self.kind)
        pairs = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value for name, value in pairs.items() if value != getattr(usual, name)}

    def record(self) -> dict[str, Any]:
        """As a JSON object; a tie that is a function by its name."""
        return asdict(replace(self, tie=tie_in_words(self.tie)))

    @staticmethod
    def from_record(found: Mapping[str, Any]) -> "FitOptions":
        """Back from a JSON object, whole or in part; the open end of a bound may be null.

        Raises:
            BadName: No such option, or no such choice.
        """
        from jshell.io.records import number  # with JAX, which the terminal's help does not wait for

        check_names(found, tuple(one.name for one in fields(FitOptions)))
        given = {name: value for name, value in found.items() if value is not None}
        if "bounds" in given:
            end = lambda value, none: none if value is None else number(value)  # noqa: E731
            given["bounds"] = {
                name: (end(low, -math.inf), end(high, math.inf)) for name, (low, high) in given["bounds"].items()
            }
        if "priors" in given:
            given["priors"] = {
                name: one if isinstance(one, Prior) else Prior(**one) for name, one in given["priors"].items()
            }
        for name in ("channels", "local"):
            if name in given:
                given[name] = tuple(given[name])
        if "drop" in given:
            given["drop"] = tuple((number(first), number(last)) for first, last in given["drop"])
        return FitOptions(**given)


def described(name: str) -> str:
    """What an option chooses."""
    return next(one for one in fields(FitOptions) if one.name == name).metadata["words"]


def words_of(name: str) -> str:
    """What an option chooses, and what may be chosen."""
    known = choices_of(name)
    if not known:
        return described(name)
    listed = [f"{key} ({words})" for key, words in known.items() if key is not None]
    usual = f"; {known[None]} by default" if None in known and name != "weighting" else ""
    return f"{described(name)}: {' or '.join(listed)}{usual}"


def choices_of(name: str) -> dict[Any, str]:
    """What may be chosen of an option, with what that means; empty where it is no choice among names."""
    one = next(one for one in fields(FitOptions) if one.name == name)
    return dict(one.metadata["choices"] or {})


def default_of(name: str) -> Any:
    """What an option is where nothing is chosen."""
    return getattr(FitOptions(), name)


OPTIONS = tuple(one.name for one in fields(FitOptions) if one.name not in ("kind", "weighting"))  # of a fit of traces


def check_names(given: Mapping[str, Any] | Sequence[str], known: Sequence[str]) -> None:
    """Refuse an option that does not exist.

    Raises:
        BadName: Naming it.
    """
    for name in given:
        choose("option", name, sorted(known), remedy="Leave it out, or choose one of these.")


def tie_in_words(tie: Mapping | None) -> dict[str, str]:
    """Ties as text: arithmetic as it is, a function by its name."""
    return {
        name: given if isinstance(given, str) else f"function {getattr(given, '__name__', type(given).__name__)}"
        for name, given in (tie or {}).items()
    }

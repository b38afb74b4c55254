"""The general trace fit: local, tied and uncertain parameters, priors, robust losses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from jshell.calibration.joint import CONDITIONS, Joint, join, nominal_values, residual, single_names, spread
from jshell.calibration.least_squares import from_many_starts
from jshell.calibration.losses import Problem
from jshell.calibration.parameters import Prior, Tie, unknowns
from jshell.calibration.report import FitResult
from jshell.calibration.robust import TUNING, reweigh
from jshell.calibration.starts import Modes, strict_start
from jshell.calibration.verdict import trace_result
from jshell.errors import BadName
from jshell.trace import Trace

POSITIVE = frozenset({"alpha1", "alpha2", "beta1", "beta2", "tau", *CONDITIONS})


@dataclass(frozen=True)
class Asked:
    """What makes a fit general; all empty is the plain fit."""

    tie: Mapping[str, str | Tie]
    local: tuple[str, ...]
    uncertain: Mapping[str, float | None]
    priors: Mapping[str, Prior]
    robust: str | None

    def __post_init__(self) -> None:
        if self.robust not in (None, *TUNING):
            raise BadName(
                f"robust {self.robust!r}", found="no such loss", expected=" or ".join(TUNING), remedy="Choose one."
            )

    @property
    def general(self) -> bool:
        return bool(self.tie or self.local or self.uncertain or self.priors or self.robust)


def fit_jointly(
    asked: Asked,
    problem: Problem,
    modes: Sequence[Modes | None],
    natural: np.ndarray,
    cut: list[Trace],
    texts: list[str],
    *,
    fix: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    absolute: bool,
    equilibrium: str,
    noise: str,
) -> FitResult:
    """Fit traces with parameters of their own, shared or tied ones, and what is known of them.

    Args:
        asked: What makes it general.
        problem: The traces and how they are compared.
        modes: Found in each trace, or None.
        natural: (starts, constants) of the plain problem.
        cut: The traces inside the window.
        texts: Warnings so far.
        fix, bounds: By the solver's names; a constant without a number means that of every trace.
        absolute: Whether errors of the data were given.
        equilibrium: Where rest states come from.
        noise: `auto` or `white`.
    """
    joint = join(problem, local=asked.local, uncertain=asked.uncertain, priors=asked.priors, equilibrium=equilibrium)
    positive = frozenset(name for name in joint.names if name.split("[")[0] in POSITIVE)
    fixed, limits = spread(fix, joint.names), spread(bounds, joint.names)
    squared = frozenset(name for name in joint.names if name.split("[")[0] in problem.squared)
    space = unknowns(joint.names, positive, fixed, limits, spread(asked.tie, joint.names), squared)
    rows = _starts(joint, natural, modes, fix)
    low, high = jnp.asarray(space.low), jnp.asarray(space.high)
    ending = from_many_starts(residual, (space, joint), jnp.asarray(space.seen(rows)), low, high)
    found = None
    if asked.robust is not None:
        ending, found = reweigh(asked.robust, joint, space, ending)
    return trace_result(problem, space, ending, rows, cut, absolute, texts, joint=joint, noise=noise, robust=found)


def _starts(joint: Joint, natural: np.ndarray, modes: Sequence[Modes | None], fix: Mapping[str, float]) -> np.ndarray:
    """(starts, parameters): shared constants as in the plain fit, local ones from the trace's own modes."""
    problem, nominal = joint.problem, nominal_values(joint)
    plain, rows = problem.names, np.ones((len(natural), len(joint.names)))
    names = single_names(problem)
    for number, (record, places) in enumerate(zip(problem.records, joint.places, strict=True)):
        own = modes[number] if number < len(modes) else None
        heard = strict_start([record], [own], dict(fix)) if problem.loss == "strict" and own is not None else None
        for k, (name, place) in enumerate(zip(names, places, strict=True)):
            base = f"tau[{number + 1}]" if name == "tau" and "tau" not in plain else name
            values = natural[:, plain.index(base)]
            local = joint.names[place].endswith("]") and name != "tau"
            if local and heard is not None and k < 4:
                shared = natural[0, plain.index(base)]
                values = values / shared * heard[k] if shared != 0 else values + heard[k]
            rows[:, place] = values
    for name, value in nominal.items():
        rows[:, joint.names.index(name)] = value
    return rows

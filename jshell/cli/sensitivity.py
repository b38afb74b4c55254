"""`jshell sensitivity`: what a number of the short model depends on, at a point and over a range."""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import jshell
from jshell.cli.constants import Damped, with_damping
from jshell.cli.destinations import Picture, drawable
from jshell.cli.output import Json, log, print_json, speaking, table
from jshell.cli.problem import Case, named, with_conditions, with_options
from jshell.errors import BadValue


@dataclass(frozen=True)
class SobolOptions:
    """A sampling plan over ranges of the inputs."""

    vary: Annotated[
        list[str] | None,
        typer.Option("--range", help="INPUT=LOW,HIGH or INPUT=LOW,HIGH,log; with it, Sobol indices."),
    ] = None
    rows: Annotated[int, typer.Option(help="Rows of the sampling plan, a power of two.")] = 1024
    seed: Annotated[int, typer.Option(help="Seed of the sampling plan.")] = 0
    missing: Annotated[str, typer.Option(help="Runs that give no number: refuse or drop.")] = "refuse"


@speaking
@with_conditions
@with_damping
@with_options(SobolOptions, "plan")
def sensitivity(
    problem: Case,
    damped: Damped,
    plan: SobolOptions,
    of: Annotated[
        str,
        typer.Option("--of", help="omega_minus, omega_plus, tau, volume, pressure, stability_margin or omega_sphere"),
    ] = "omega_minus",
    following: Annotated[
        list[str] | None,
        typer.Option(
            "--next", help="D_HAT,P0_HAT,PEXT_HAT of a shell that could be measured next; give several to rank them."
        ),
    ] = None,
    sigma: Annotated[float, typer.Option(help="Relative standard error of a frequency, for --next.")] = 0.01,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Percent that a number changes with 1 % of each input; --range: Sobol indices; --next: which shell to measure."""
    drawable(plot)
    constants = damped.constants
    if following:
        _advise(problem, constants, following, sigma, plot, as_json)
        return
    if of == "tau":
        problem.needs_viscosity()
        if not damped.given:
            # what depends on what is asked of eq:taureal; a β1 that follows the shell would hide its own share
            log(f"tau is α1/(2 β1 η̂) with the source's β1 = {float(constants.beta1):.3g}; --beta1 chooses")
    if plan.vary:
        found = jshell.sensitivity.sobol(
            of, _ranges(plan.vary), problem.conditions, constants, rows=plan.rows, seed=plan.seed, missing=plan.missing
        )
        shown = _sobol_table(found)
    else:
        found = jshell.sensitivity.elasticities(of, problem.conditions, constants)
        shown = _elasticity_table(found)
    record = found.record()
    if isinstance(found, jshell.sensitivity.Elasticities):
        information = jshell.sensitivity.information(problem.conditions, constants)
        record |= {"one_shell_leaves_free": list(information.words)}
        shown += "\n" + "\n".join(f"from this shell's two frequencies alone, {line}" for line in information.words)
    if plot is not None:
        drawing = importlib.import_module("jshell.plot.sensitivity")
        draw = drawing.elasticity_bars if isinstance(found, jshell.sensitivity.Elasticities) else drawing.sobol_bars
        importlib.import_module("jshell.plot").save(draw(found).figure, plot)
    if as_json:
        print_json({**record, "plot": None if plot is None else str(plot), "conditions": problem.record()})
    else:
        typer.echo(shown)


def _advise(
    problem: Case,
    constants: "jshell.oscillator.Coefficients",
    texts: list[str],
    sigma: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Rank candidates by what they would add to the shell of the conditions, taken as measured."""
    c = problem.conditions
    d, P0, P = np.array([_triple(text) for text in texts]).T
    candidates = c.replace(thickness=d, gas_pressure=P0, outer_pressure=P)
    found = jshell.sensitivity.next_experiment(candidates, constants, c, sigma)
    if plot is not None:
        axes = importlib.import_module("jshell.plot.sensitivity").ranking(found, texts)
        importlib.import_module("jshell.plot").save(axes.figure, plot)
    order = np.argsort(-np.nan_to_num(found.gain, nan=-np.inf))
    if as_json:
        print_json({"best": named(found.conditions), "gain": found.gain, "stderr_before": found.before,
                    "stderr_after": found.after, "plot": None if plot is None else str(plot),
                    "conditions": problem.record()})  # fmt: skip
    else:
        typer.echo(table([(texts[k], found.gain[k]) for k in order], ("measure next: d̂,P̂0,P̂ext", "rise of ln det F")))
        typer.echo("")
        rows = [*zip(jshell.sensitivity.identifiability.PARAMETERS, found.before, found.after, strict=True)]
        typer.echo(table(rows, ("relative error of", "now", "with the best")))


def _triple(text: str) -> tuple[float, float, float]:
    """d̂, P̂0 and P̂ext of a candidate.

    Raises:
        BadValue: A text that is none.
    """
    try:
        d, P0, P = (float(part) for part in text.split(","))
    except ValueError:
        raise BadValue(
            "--next", found=repr(text), expected="D_HAT,P0_HAT,PEXT_HAT", remedy="Try 0.1,0.9,1.3."
        ) from None
    return d, P0, P


def _ranges(texts: list[str]) -> "dict[str, jshell.sensitivity.Range]":
    """Ranges from `input=low,high[,log]`.

    Raises:
        BadValue: A text that is none.
    """
    found = {}
    for text in texts:
        name, _, rest = text.partition("=")
        parts = rest.split(",")
        try:
            low, high = float(parts[0]), float(parts[1])
        except (ValueError, IndexError):
            raise BadValue(
                "--range", found=repr(text), expected="INPUT=LOW,HIGH or INPUT=LOW,HIGH,log", remedy="thickness=.05,.3"
            ) from None
        found[name] = jshell.sensitivity.Range(low, high, parts[2] if len(parts) > 2 else "linear")
    return found


def _elasticity_table(found: "jshell.sensitivity.Elasticities") -> str:
    rows = [*zip(found.inputs, found.at, found.derivative, found.elasticity, strict=True)]
    return table(rows, (f"{found.name} = {found.value:.6g}", "value", "derivative", "% per %"))


def _sobol_table(found: "jshell.sensitivity.SobolIndices") -> str:
    rows = [
        (n, s, f"{a[0]:.3f} … {a[1]:.3f}", t, f"{b[0]:.3f} … {b[1]:.3f}")
        for n, s, a, t, b in zip(
            found.inputs, found.first, found.first_interval, found.total, found.total_interval, strict=True
        )
    ]
    percent = f"{100 * found.confidence:g} %"
    head = f"{found.name}, {found.runs} runs, {found.missing} without a number"
    return table(rows, (head, "alone", percent, "in all", percent))

"""`jshell rest`, `branch`, `modes` and `frequencies`: a shell at rest, its vibrations, what the short model says."""

import importlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.constants import with_masses
from jshell.cli.destinations import drawable
from jshell.cli.driving import wall_loss
from jshell.cli.output import Json, finish, judged, log, print_json, speaking, table
from jshell.cli.problem import Case, with_conditions, with_options
from jshell.errors import BadValue, Outcome

REST_DIMENSIONS = {"P": "pressure", "difference": "pressure", "P_ext": "pressure", "elastic": "energy",
                   "gap": "length", "clearance": "length"}  # fmt: skip
THIN = 0.05  # d_hat below which a dimple may lose its axial symmetry
Elements = Annotated[int, typer.Option("--elements", help="Spline elements from pole to pole.")]
Attached = Annotated[
    float, typer.Option("--attached", help="Half-angle of the pad that holds the shell [rad]; 0 is free.")
]
Spot = Annotated[str | None, typer.Option("--weak-spot", help="DEPTH,WIDTH of a thinner wall at the buckling pole.")]
Energy = Annotated[str, typer.Option("--energy", help="Elastic energy: current, reference or koiter.")]


@dataclass(frozen=True)
class ShapeOptions:
    """A rest shape as a command line gives it."""

    branch: Annotated[str, typer.Option("--branch", help="buckled or sphere.")] = "buckled"
    elements: Elements = 32
    attached: Attached = 0.0
    spot: Spot = None

    def keywords(self) -> dict[str, Any]:
        """The same for `jshell.membrane.rest` and what begins there."""
        return {"branch": self.branch, "elements": self.elements, "attached": self.attached,
                "weak_spot": weak_spot(self.spot)}  # fmt: skip


with_shape = with_options(ShapeOptions, "shape")


def weak_spot(text: str | None, default: "jshell.contour.WeakSpot | None" = None) -> "jshell.contour.WeakSpot":
    """A weak spot from `depth,width`; without a text the default, or none.

    Raises:
        BadValue: Not two numbers.
    """
    if text is None:
        return jshell.contour.NO_WEAK_SPOT if default is None else default
    try:
        depth, width = (float(part) for part in text.split(","))
    except ValueError:
        raise BadValue("--weak-spot", found=repr(text), expected="DEPTH,WIDTH", remedy="Try 0.15,0.35.") from None
    return jshell.contour.WeakSpot(depth, width)


def said_of(found: "jshell.membrane.RestShape", asked: bool = False) -> str | None:
    """Whether a dimple is round: computed where asked for or the law is near, else by the law; None of a thick one."""
    if int(found.outcome) != Outcome.OK:
        return None
    if asked or jshell.membrane.symmetry_in_doubt(found):
        return jshell.dynamics.roundness(found).verdict
    return jshell.membrane.law_of(found) if float(found.conditions.thickness) < THIN else None


def whole_numbers(option: str, text: str | None) -> list[int]:
    """Orders around the axis from `0,1,2`, each once and rising; without a text the axisymmetric ones.

    Raises:
        BadValue: Not whole numbers of at least 0, or above the highest order.
    """
    highest = jshell.membrane.HIGHEST_ORDER
    try:
        numbers = [0] if text is None else [int(part) for part in text.split(",")]
    except ValueError:
        numbers = [-1]
    if min(numbers) < 0 or max(numbers) > highest:
        raise BadValue(option, found=repr(text), expected=f"whole numbers from 0 to {highest}", remedy="Try 0,1,2,3.")
    return sorted(set(numbers))


@speaking
@with_conditions
@with_shape
def rest(
    problem: Case,
    shape: ShapeOptions,
    volume: Annotated[
        float | None, typer.Option("--volume", help="Hold V/V0 at this; the outer pressure is found, not given.")
    ] = None,
    grading: Annotated[str, typer.Option("--grading", help="Where the nodes go: rim or uniform.")] = "rim",
    energy: Energy = "current",
    symmetry: Annotated[
        bool, typer.Option("--symmetry", help="Say whether the shape is round, and how fast it leaves that if not.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Rest shape: volume, area and inner pressure of a shell at a load, or at a volume."""
    found = jshell.membrane.rest(
        problem.conditions, **shape.keywords(), area=energy, volume_ratio=volume, grading=grading
    )
    outcome = judged(Outcome(int(found.outcome)), found.volume_ratio, found.area_ratio, found.pressure)
    ok = outcome == Outcome.OK
    numbers: dict[str, Any] = {
        "V_over_V0": found.volume_ratio,
        "S_over_S0": found.area_ratio,
        "P": found.pressure,
        "difference": found.difference,
        "P_ext": found.outer_pressure,
        "elastic": found.elastic,
        "gap": found.gap,
    }
    numbers = {key: value if ok else None for key, value in numbers.items()}
    # of a wall that touches itself this is the reason
    numbers["clearance"] = found.clearance if np.isfinite(found.clearance) else None
    stable = bool(found.stability > 0) if ok else None
    near = shape.branch == "buckled" and jshell.membrane.symmetry_in_doubt(found)
    symmetric = jshell.dynamics.roundness(found) if ok and (symmetry or near) else None
    if as_json:
        if symmetric is not None:
            numbers["symmetry"] = {
                "verdict": symmetric.verdict,
                "order": symmetric.order,
                "eigenvalue": symmetric.stability.eigenvalue,
                "growth": symmetric.growth,
            }
        units = problem.si(numbers, REST_DIMENSIONS)
        print_json(
            {
                **numbers,
                **units,
                "stable": stable,
                "branch": shape.branch,
                "outcome": outcome,
                "conditions": problem.record(),
            }
        )
    else:
        words = {
            "V_over_V0": "volume V/V0",
            "S_over_S0": "area S/S0",
            "P": "inner pressure P [E d/R0]",
            "difference": "pressure difference ΔP [E d/R0]",
            "P_ext": "outer pressure [E d/R0]",
            "elastic": "elastic energy [E d R0^2]",
            "gap": "poles apart [R0]",
            "clearance": "room between facing walls [R0]",
        }
        rows = [(words[key], value, REST_DIMENSIONS.get(key)) for key, value in numbers.items()]
        rows.append(("stable", {True: "yes", False: "no", None: "–"}[stable], None))
        if symmetric is not None:
            rows.append(("symmetry", symmetric.verdict, None))
        elif ok and shape.branch == "buckled" and problem.conditions.thickness < THIN:
            rows.append(("symmetry", jshell.membrane.law_of(found), None))
        typer.echo(problem.table(rows, ("at rest", "value")))
    finish(outcome)


@speaking
@with_conditions
def branch(
    problem: Case,
    elements: Elements = 32,
    energy: Energy = "current",
    lowest: Annotated[float, typer.Option("--lowest", help="V/V0 at which the deflated end stops.")] = 0.3,
    rows: Annotated[int, typer.Option("--rows", help="States shown in the table.")] = 16,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw ΔP against V here: png, pdf or svg.")] = None,
    symmetry: Annotated[
        bool, typer.Option("--symmetry", help="Find where the dimple first stops being round.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Deflation branch: every dimpled shape from the sphere to contact, its folds, eigenvalue and Maxwell point."""
    drawable(plot)
    c = problem.conditions
    found = jshell.membrane.deflation_branch(c, elements=elements, area=energy, lowest=lowest)
    threshold = jshell.membrane.buckling_eigenvalue(c.thickness, c.poisson_ratio, area=energy)
    maxwell = jshell.membrane.maxwell_point(c, area=energy, elements=elements, branch=found)
    loss = jshell.membrane.symmetry_loss(found, c, area=energy) if symmetry else None
    columns = {
        "V_over_V0": found.volume_ratio,
        "difference": found.difference,
        "P_ext": found.outer_pressure,
        "elastic": found.elastic,
        "stability": found.stability,
        "held_stability": found.held_stability,
        "gap": found.gap,
    }
    marks: list[tuple[str, float | None, float | None]] = [
        (f"fold of the {fold.of}", fold.volume_ratio, fold.difference) for fold in found.folds
    ]
    marks.append(("first eigenvalue", float(threshold.volume_ratio), float(threshold.difference)))
    marks.append(("Maxwell point", maxwell.volume_ratio, maxwell.difference))
    if loss is not None:
        at = loss.checked if loss.volume_ratio is None else loss.volume_ratio
        marks.append((loss.words, at, loss.difference))
    if as_json:
        listed = [
            {"of": fold.of, "V_over_V0": fold.volume_ratio, "difference": fold.difference} for fold in found.folds
        ]
        eigenvalue = {"difference": threshold.difference, "over_classical": threshold.over_classical}
        point = {
            "V_over_V0": maxwell.volume_ratio,
            "difference": maxwell.difference,
            "deflation_over_classical": maxwell.deflation_over_classical,
            "over_classical": maxwell.over_classical,
        }
        eigenvalue |= {"V_over_V0": threshold.volume_ratio, "outcome": Outcome(int(threshold.outcome))}
        point |= {"outcome": maxwell.outcome}
        marked = {"folds": listed, "eigenvalue": eigenvalue, "maxwell": point}
        if loss is not None:
            marked["symmetry_loss"] = {
                "V_over_V0": loss.volume_ratio,
                "difference": loss.difference,
                "order": loss.order,
                "checked_V_over_V0": loss.checked,
                "words": loss.words,
                "outcome": loss.outcome,
            }
        print_json({"branch": columns, **marked, "outcome": found.outcome, "conditions": problem.record()})
    else:
        shown = np.unique(np.linspace(0, found.length.size - 1, max(2, rows)).round().astype(int))
        header = ("V/V0", "ΔP", "P_ext", "energy", "stability", "at held V", "gap")
        typer.echo(table([tuple(column[k] for column in columns.values()) for k in shown], header))
        typer.echo("")
        typer.echo(table(marks, ("mark", "V/V0", "ΔP [E d/R0]")))
    if plot is not None:
        drawing = importlib.import_module("jshell.plot")
        axes = drawing.deflation(found, threshold=threshold, maxwell=maxwell, loss=loss)
        drawing.save(axes.figure, plot)
        log(f"drawn: {plot}")
    # a branch that ends where the wall touches itself has been followed to its end
    outcome = Outcome.OK if found.outcome == Outcome.CONTACT else found.outcome
    finish(outcome if loss is None or outcome != Outcome.OK else loss.outcome)


def liquid_said(
    liquid: Annotated[
        str | None,
        typer.Option(
            "--liquid",
            help="exact (any viscosity), second or layer (orders of a thin layer), ideal. By default exact, and second "
            "for orders above 0, where the exact one is not known.",
        ),
    ] = None,
    stokes_layer: Annotated[
        bool | None,
        typer.Option("--stokes-layer/--no-stokes-layer", help="Deprecated: --liquid layer, --liquid ideal."),
    ] = None,
) -> str | None:
    """The liquid that the options say, the deprecated one among them."""
    if stokes_layer is None:
        return liquid
    liquid = "layer" if stokes_layer else "ideal"
    log(f"--{'' if stokes_layer else 'no-'}stokes-layer is now --liquid {liquid}; the default is exact")
    return liquid


@speaking
@with_conditions
@with_shape
@with_options(liquid_said, "liquid")
@with_options(wall_loss, "loss")
def modes(
    problem: Case,
    shape: ShapeOptions,
    liquid: str | None,
    loss: "jshell.membrane.WallLoss | None",
    count: Annotated[int, typer.Option("--count", help="How many modes.")] = 4,
    azimuth: Annotated[
        str | None,
        typer.Option("--azimuth", help="Orders around the axis, as 0,1,2,3."),
    ] = None,
    symmetry: Annotated[
        bool, typer.Option("--symmetry", help="Say whether the shape is round, and how fast it leaves that if not.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Small vibrations about the rest shape: frequencies, decay times, what of a recording sees them."""
    if liquid != "ideal":
        problem.needs_viscosity()
    orders = [0] if azimuth is None else whole_numbers("--azimuth", azimuth)
    found = jshell.dynamics.modes(
        problem.conditions, azimuth=orders, count=count, liquid=liquid, wall_loss=loss, **shape.keywords()
    )
    if liquid is None and found.around is not None:
        log("orders above 0: the liquid is a Stokes layer to second order, right to 0.7 % in tau at eta_hat = 0.004")
    outcome = Outcome(int(found.worst))
    said = said_of(found.rest, symmetry) if shape.branch == "buckled" else None
    if as_json:
        rows = () if found.axial is None else found.axial.table()
        listed = lambda rows: [asdict(row) | in_si(row, problem) for row in rows]  # noqa: E731
        record = {"modes": listed(rows), "outcome": outcome, "conditions": problem.record()}
        if found.around is not None:
            record["azimuthal"] = listed(found.around.table())
        if said is not None:
            record["symmetry"] = said
        print_json(record)
    else:
        typer.echo(modes_table(found, problem, everything=azimuth is not None))
        if said is not None:
            typer.echo(f"\nsymmetry: {said}")
    finish(outcome)


def modes_table(found: "jshell.dynamics.AllModes", problem: Case, *, everything: bool) -> str:
    """Vibrations as a table: those of m = 0 by their number, or of every order from the slowest on."""
    if everything:
        header = ("m", "mode", "ω = |s|", "Ω", "τ", "grows at", "dV", "dH", "dW", "seen by", "outcome")
        rows = found.table()
        lines = [
            (str(row.azimuth), str(row.mode), row.omega, row.Omega, row.tau, row.growth, row.dV, row.dH, row.dW,
             row.seen, row.outcome)
            for row in rows
        ]  # fmt: skip
    else:
        header = ("mode", "ω = |s|", "Ω", "τ", "dV", "dS", "outcome")
        rows = () if found.axial is None else found.axial.table()
        lines = [(str(row.mode), row.omega, row.Omega, row.tau, row.dV, row.dS, row.outcome) for row in rows]
    text = table(lines, header)
    if problem.scales is None:
        return text
    orders = [(str(row.azimuth),) if everything else () for row in rows]  # pyright: ignore[reportAttributeAccessIssue]
    kinds = ("angular frequency", "angular frequency", "time")
    measured = [
        (*order, str(row.mode), *map(problem.in_units, (row.omega, row.Omega, row.tau), kinds))
        for order, row in zip(orders, rows, strict=True)
    ]
    first = ("m", "mode") if everything else ("mode",)
    return f"{text}\n\n{table(measured, (*first, 'intrinsic ω/2π', 'damped Ω/2π', 'τ'))}"


def in_si(row: Any, problem: Case) -> dict[str, float | None]:
    """A vibration's frequencies, intrinsic and damped, and decay time where the problem has units; else nothing."""
    if problem.scales is None:
        return {}
    hertz, seconds = float(problem.scales.frequency), float(problem.scales.time)
    scaled = lambda number, unit: None if number is None else number * unit  # noqa: E731
    return {
        "f_Hz": scaled(row.omega, hertz),
        "f_damped_Hz": scaled(row.Omega, hertz),
        "tau_s": scaled(row.tau, seconds),
    }


@speaking
@with_conditions
@with_masses
def frequencies(
    problem: Case,
    constants: "jshell.oscillator.Coefficients",
    as_json: Json = False,
) -> None:
    """The short model's two frequencies (eq:defw, plateau law), beside the sphere's and Marmottant's."""
    found = jshell.oscillator.frequencies(problem.conditions, constants)
    outcome = Outcome(int(found.outcome))
    numbers = {
        "omega_minus": found.omega_minus,
        "omega_plus": found.omega_plus,
        "P": found.pressure,
        "V": found.volume,
        "stability_margin": found.stability_margin,
        "omega_sphere": found.omega_sphere,
        "omega_marmottant": found.omega_marmottant,
    }
    if outcome == Outcome.NO_BUCKLED_STATE:
        buckled = ("omega_minus", "omega_plus", "P", "V", "stability_margin")
        numbers |= dict.fromkeys(buckled)
    if as_json:
        used = {"alpha1": constants.alpha1, "alpha2": constants.alpha2, "kVS": constants.k_vs}
        hertz = {} if problem.scales is None else {"hertz": _in_hertz(numbers, float(problem.scales.time))}
        print_json({**numbers, **hertz, "outcome": outcome, "constants": used, "conditions": problem.record()})
    else:
        words = {
            "omega_minus": "slow frequency ω−",
            "omega_plus": "fast frequency ω+",
            "P": "inner pressure P_e",
            "V": "volume V_e",
            "stability_margin": "stability margin (1 at the limit)",
            "omega_sphere": "sphere, had it not buckled",
            "omega_marmottant": "Marmottant's buckled law",
        }
        typer.echo(table([(words[key], value) for key, value in numbers.items()], ("short model", "value")))
        if problem.scales is not None:
            hertz = _in_hertz(numbers, float(problem.scales.time))
            rows = [(words[key], value) for key, value in hertz.items()]
            typer.echo(f"\n{table(rows, ('undamped, ω/2π', 'Hz'))}")
    finish(outcome)


def _in_hertz(numbers: dict[str, Any], unit: float) -> dict[str, float | None]:
    """The frequencies among them, intrinsic (undamped), in Hz; `unit` is the unit of time [s]."""
    turns = 2 * np.pi * unit
    return {key: None if x is None else float(x) / turns for key, x in numbers.items() if key.startswith("omega")}

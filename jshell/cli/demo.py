"""`jshell demo`: the main job from end to end, beside the published values."""

import importlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.fits import fit_record
from jshell.cli.output import Json, finish, log, print_json, speaking, table
from jshell.cli.traces import settled, signature_table
from jshell.errors import BadFile, MissingExtra, Outcome

# Shells whose computed modes are fitted by eq:defw: (d̂, P̂0), loaded so that the plateau law gives V/V0 = 0.75.
SHELLS = (
    (0.10, 0.4),
    (0.10, 0.9),
    (0.14, 0.6),
    (0.14, 1.5),
    (0.18, 0.4),
    (0.18, 0.9),
    (0.22, 0.54),
    (0.22, 0.9),
    (0.22, 1.5),
)
VOLUME_RATIO = 0.75
SNAP_LOAD = 1.62  # the weak spot buckles the shell R below its threshold, above this load for certain
RECORDING = "attached_R_HW.csv"

# Published or independently computed, each with where it is from.
SOURCE_ROWS = {
    "rest": {"V/V0": 0.6992, "S/S0": 0.9484, "P": 1.4853},
    "undamped": (1.190, 1.981, 2.931, 4.269),
    "simulation": {"omega_minus": 1.0, "omega_plus": 2.0},
    "attached": {"omega_minus": 0.4, "omega_plus": 1.6},
    "joint fit": {"alpha1": 3.6, "alpha2": 1.1, "kVS": 0.23},
}


@speaking
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the trace, the table and the figure.")] = Path("out/demo"),
    elements: Annotated[int, typer.Option(help="Spline elements from pole to pole.")] = 24,
    as_json: Json = False,
) -> None:
    """Rest, vibrate, buckle, analyse, fit: the whole of jshell on the source's configuration R."""
    if out.exists() and not out.is_dir():
        raise BadFile("--out", found=f"the file {out}", expected="a folder", remedy="Choose another name.")
    out.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    conditions = jshell.presets.R.conditions

    with step("rest shape and modes of R"):
        rest = jshell.membrane.rest(conditions, elements=elements, throw=True)
        undamped = jshell.dynamics.modes(conditions, elements=elements, liquid="ideal", throw=True)
        damped = jshell.dynamics.modes(conditions, elements=elements, throw=True)
        attached = jshell.dynamics.modes(conditions, elements=elements, attached=0.3272, throw=True)
    show(rest_rows(rest, undamped, damped, attached), as_json)

    with step("the snap: ramp to 1.62, then hold"):
        snap = conditions.replace(outer_pressure=SNAP_LOAD)
        trace = jshell.dynamics.simulate(snap, elements=elements, throw=True)
        jshell.io.write_trace(out / "snap.csv", trace)
        ringing = jshell.signals.extract(trace, throw=True)
    show(snap_rows(trace, ringing), as_json)

    with step(f"eq:defw fitted to the modes of {len(SHELLS)} shells"):
        rows = frequency_table(elements)
        write_table(out / "frequencies.csv", rows)
        joint = jshell.calibration.fit_frequencies(rows)
    show(joint_rows(joint), as_json)
    note(
        f"  selection: {len(SHELLS)} free shells, d̂ 0.10–0.22, P̂0 0.4–1.5, modes 1 and 2 (|s|, layer to second order), "
        "V_e and P_e of the computed rest shape\n  weighting: residuals in V_e ω, unweighted; the source fitted "
        "other shells, large oscillations and a flow with box effects",
        as_json,
    )

    with step("the camera recording of an attached shell"):
        recording = jshell.io.read_trace(jshell.io.example(RECORDING))
        recorded = jshell.signals.extract(recording, throw=True)
    note(signature_table(recorded), as_json)

    with step("the short model fitted to the snap and to the recording"):
        fits = trace_fits(trace, recording)
    for name, found in fits.items():
        note(f"\n{name}\n{found.report()}", as_json)

    with step("figure"):
        figure = picture(out / "demo.png", rest, damped, trace, ringing, rows, joint, recording, recorded)
    log(f"wrote {out / 'snap.csv'}, {out / 'frequencies.csv'}" + (f", {figure}" if figure else ""))
    seconds = time.perf_counter() - began
    if as_json:
        print_json(
            {
                "rest": {"V_over_V0": rest.volume_ratio, "S_over_S0": rest.area_ratio, "P": rest.pressure},
                "modes": {
                    "undamped": undamped.omega,
                    "omega": damped.omega,
                    "tau": damped.tau,
                    "attached": attached.omega,
                },
                "snap": ringing.record(),
                "joint_fit": fit_record(joint),
                "recording": recorded.record(),
                "fits": {name: fit_record(found) for name, found in fits.items()},
                "figure": None if figure is None else str(figure),
                "seconds": seconds,
            }
        )
    else:
        typer.echo(f"\ndone in {seconds:.0f} s")
    finish(joint.outcome)


@contextmanager
def step(words: str) -> Iterator[None]:
    """Say on stderr what is being done, and how long it took."""
    log(f"· {words} …")
    began = time.perf_counter()
    yield
    log(f"  {time.perf_counter() - began:.1f} s")


def show(rows: list[tuple], as_json: bool) -> None:
    """A table ours / source / difference."""
    if as_json:
        return
    shown = []
    for words, ours, source, where in rows:
        difference = None if source is None else f"{100 * (float(ours) / float(source) - 1):+.1f} %"
        shown.append((words, float(ours), source, difference, where))
    typer.echo("\n" + table(shown, ("", "ours", "source", "difference", "where the source's value is from")) + "\n")


def note(text: str, as_json: bool) -> None:
    if not as_json:
        typer.echo(text + "\n")


def rest_rows(rest, undamped, damped, attached) -> list[tuple]:
    """Rest shape and modes of R."""
    two = "two independent codes"
    paper = "the source's simulation, in a box (up to 7 % high)"
    at_rest = {"V/V0": rest.volume_ratio, "S/S0": rest.area_ratio, "P": rest.pressure}
    rows = [(f"{name} at rest", at_rest[name], SOURCE_ROWS["rest"][name], two) for name in at_rest]
    rows += [
        (f"ω of mode {k + 1}, no viscosity", undamped.omega[k], value, two)
        for k, value in enumerate(SOURCE_ROWS["undamped"])
    ]
    for k, (sign, key) in enumerate((("−", "omega_minus"), ("+", "omega_plus"))):
        rows.append((f"ω{sign}, viscous liquid", damped.omega[k], SOURCE_ROWS["simulation"][key], paper))
        rows.append(("τ of it", damped.tau[k], None, "not published per mode"))
    for k, (sign, key) in enumerate((("−", "omega_minus"), ("+", "omega_plus"))):
        rows.append(
            (
                f"ω{sign}, attached (pad 0.327)",
                attached.omega[k],
                SOURCE_ROWS["attached"][key],
                "the source's simulation",
            )
        )
    return rows


def snap_rows(trace: "jshell.Trace", found: "jshell.signals.Signature") -> list[tuple]:
    """The snap of R, its modes from V."""
    paper = "the source's simulation"
    return [
        ("V/V0 after the snap", settled(trace, "V") / jshell.shell.SPHERE_VOLUME, 0.691, "an independent code"),
        ("ω− from V", found.omega_minus, SOURCE_ROWS["simulation"]["omega_minus"], paper),
        ("ω+ from V", found.omega_plus, SOURCE_ROWS["simulation"]["omega_plus"], paper),
        ("τ from V", found.tau, 8.0, "an independent code (6 to 8.6 with the window)"),
        ("A+/A− on V", found.amplitude_ratio["V"], 0.52, paper),
        ("A+/A− on H", found.amplitude_ratio["H"], 0.21, paper),
        ("A+/A− on W", found.amplitude_ratio["W"], 0.22, paper),
    ]


def joint_rows(joint: "jshell.FitResult") -> list[tuple]:
    """Constants of eq:defw from our modes, beside the source's joint fit."""
    rows = []
    for name, key in (("alpha1", "alpha1"), ("alpha2", "alpha2"), ("k_vs", "kVS")):
        found = joint[name]
        words = f"{key} (± {found.stderr:.2g})" if np.isfinite(found.stderr) else key
        rows.append((words, found.value, SOURCE_ROWS["joint fit"][key], "the source's joint fit"))
    return rows


def frequency_table(elements: int) -> dict[str, np.ndarray]:
    """Modes of `SHELLS`, one row each, the liquid to second order; a shell without a buckled state stops it."""
    jax = importlib.import_module("jax")  # help need not wait for it
    kappa = jshell.presets.R.conditions.kappa
    d, P0 = (jax.numpy.asarray(column) for column in zip(*SHELLS, strict=True))
    load = P0 * VOLUME_RATIO ** (-kappa) + jshell.shell.plateau_pressure(d)
    viscosity = jshell.presets.R.conditions.viscosity

    def one(d, P0, load):
        return jshell.dynamics.modes(
            jshell.Reduced(d, P0, load, viscosity), elements=elements, count=2, liquid="second"
        )

    found = jax.vmap(one)(d, P0, load)
    worst = Outcome(int(np.max(np.asarray(found.outcome))))
    finish(worst)
    columns: dict[str, Any] = {"d_hat": d, "P0_hat": P0, "Pext_hat": load}
    columns |= {"omega_minus": found.omega[:, 0], "omega_plus": found.omega[:, 1]}
    columns |= {"V_e": found.rest.volume, "P_e": found.rest.pressure}
    return {name: np.asarray(values) for name, values in columns.items()}


def write_table(path: Path, rows: dict[str, np.ndarray]) -> None:
    """A table of numbers that `jshell fit --table` reads."""
    np.savetxt(
        path, np.column_stack(list(rows.values())), delimiter=",", header=",".join(rows), comments="", fmt="%.10g"
    )


def trace_fits(trace: "jshell.Trace", recording: "jshell.Trace") -> "dict[str, jshell.FitResult]":
    """The short model fitted to the snap, strictly and by modes, and to the recording by modes."""
    return {
        "the snap, strict (V and S follow the oscillator)": jshell.calibration.fit_trajectories(
            trace, "strict", channels=("V", "S"), equilibrium="trace"
        ),
        "the snap, modal (only ω−, ω+, τ count)": jshell.calibration.fit_trajectories(trace, "modal", channels=("V",)),
        "the recording, modal": jshell.calibration.fit_trajectories(recording, "modal"),
    }


def picture(path: Path, *parts) -> Path | None:
    """The overview figure; a word instead where matplotlib is not installed."""
    try:
        jshell.plot.save(jshell.plot.overview(*parts), path)
    except MissingExtra as missing:
        log(str(missing))
        return None
    return path

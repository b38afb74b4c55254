"""Our numbers beside the source's: the tables of docs/paper.md, from the shipped campaign.

.venv/bin/python benchmarks/paper.py                 # what the campaign says, a minute
.venv/bin/python benchmarks/paper.py trajectories    # the joint fit of the records, minutes
.venv/bin/python benchmarks/paper.py losses          # R again with other losses, minutes
.venv/bin/python benchmarks/paper.py table           # every run over eq:defw, one line each
"""

import sys

import jax.numpy as jnp
import numpy as np

import jshell as js
from jshell import campaigns, dynamics
from jshell.dynamics import Losses
from jshell.oscillator import SOURCE, Reynolds
from jshell.oscillator.drag import reynolds_decay_time
from jshell.paper.figures import Material, read_spheres
from jshell.paper.joint_fits import ShellRuns, calibrate_trajectories, deviations
from jshell.paper.printed import printed
from jshell.signals import Signature, extract
from jshell.trace import Trace

RATIOS = ("V", "H", "W")


def row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def head(*cells: str) -> None:
    print()
    row(*cells)
    print("|" + "---|" * len(cells))


def middle(values: np.ndarray) -> str:
    """Median, and median size, in percent."""
    fine = 100 * values[np.isfinite(values)]
    return f"{np.median(fine):+.1f}, {np.median(np.abs(fine)):.1f}" if fine.size else "–"


def over_the_curve(runs: ShellRuns) -> None:
    """Every run against eq:defw with the source's constants: medians by selection and by family."""
    rows_of = (runs.extracted, runs.identified, runs.layered[:, :2])
    extracted, same, modal = (deviations(runs, SOURCE, omega) for omega in rows_of)
    plain = deviations(runs, SOURCE, runs.undamped[:, :2])
    free = runs.free_and_thin
    usual = free & (runs.filled >= 0.36) & (runs.filled <= 1.8)
    rows = [("free, η̂ ≤ 0.013", free), ("the same, P̂₀ 0.36–1.8", usual)]
    names = dict.fromkeys(name for own in runs.families for name in own)
    rows += [(f"family {name}", runs.within(name)) for name in names]
    columns = ("extracted: number", "ω₋: median, median size [%]", "ω₊", "identified: number", "ω₋", "ω₊")
    head("runs", *columns, "modes: number", "ω₋", "ω₊", "undamped ω₋", "ω₊")
    for words, chosen in rows:
        if not np.isfinite(modal[chosen]).any():
            continue
        cells = [words]
        for values in (extracted, same, modal):
            cells.append(str(int(np.isfinite(values[chosen]).all(axis=1).sum())))
            cells += [middle(values[chosen, k]) for k in (0, 1)]
        row(*cells, *(middle(plain[chosen, k]) for k in (0, 1)))


def every_run(runs: ShellRuns) -> None:
    """One line per run from which frequencies were extracted."""
    said = deviations(runs, SOURCE, runs.extracted)
    head("run", "families", "d̂", "P̂₀", "P̂ₑₓₜ", "η̂", "ω₋", "over eq:defw [%]", "ω₊", "over eq:defw [%]")
    for k in np.flatnonzero(np.isfinite(runs.extracted).all(axis=1)):
        numbers = (runs.thickness, runs.gas_pressure, runs.outer_pressure, runs.viscosity)
        cells = [f"{part[k]:.4g}" for part in numbers]
        for j in (0, 1):
            cells += [f"{runs.extracted[k, j]:.3f}", f"{100 * said[k, j]:+.1f}"]
        row(runs.names[k], " ".join(runs.families[k]), *cells)


def readings(material: Material) -> None:
    """The constants by every reading and both weightings."""
    head("reading", "shells", "residual in", "α₁", "α₂", "k_VS", "outcome", "rms left")
    for reading in material.readings:
        for weighting, fit in reading.fits.items():
            cells = [f"{fit[name].value:.3g} ± {fit[name].stderr:.2g}" for name in ("alpha1", "alpha2", "k_vs")]
            left = np.sqrt(fit.chi_square / fit.n_data)
            row(reading.words, reading.shells, weighting, *cells, fit.outcome.word, f"{left:.2f}")


def trajectories(material: Material) -> None:
    """The same constants from the records."""
    runs, results = material.runs, list(material.campaign)
    snap = runs.free_and_thin & ~runs.small & np.isfinite(runs.extracted).all(axis=1)
    usual = snap & (runs.filled >= 0.36) & (runs.filled <= 1.8)
    head("records", "number", "channels", "α₁", "α₂", "k_VS", "outcome", "left of the scatter [%]")
    for words, chosen in (("snaps, P̂₀ 0.36–1.8", usual), ("all snaps", snap)):
        for channels in (("V",), RATIOS):
            fit = calibrate_trajectories([results[k].trace for k in np.flatnonzero(chosen)], channels=channels)
            cells = [f"{fit[name].value:.3g}" for name in ("alpha1", "alpha2", "k_vs")]
            left = 10 * np.sqrt(fit.chi_square / fit.n_data)
            row(words, int(chosen.sum()), " ".join(channels), *cells, fit.outcome.word, f"{left:.0f}")


def ratios(material: Material) -> None:
    """A+/A- of R, free and attached, by two sinusoids and by three, for several beginnings of the window."""
    head("R", "window from the dip +", "ω₋, ω₊", "τ", "V", "H", "W", "three: ω", "V", "H", "W")
    for kind, family in (("free", "R-free"), ("attached", "R-attached")):
        theirs = [printed("fig:detail-attached", f"{kind}_ratio_{name}").value for name in RATIOS]
        said = [printed("fig:detail-attached", f"{kind}_omega_{sign}").value for sign in ("minus", "plus")]
        row(f"{kind}, source", "not told", f"{said[0]}, {said[1]}", "not told", *theirs, *(4 * ["–"]))
        trace = material.trace(family)
        zero = extract(trace, RATIOS).t_dip
        for late in (0.0, 2.0, 5.0, 8.0):
            row(f"{kind}, ours", late, *told(trace, extract(trace, RATIOS, start=zero + late)))


def told(trace: Trace, extracted: Signature) -> list[str]:
    """Cells of one extraction."""
    pair = [extracted.amplitude_ratio[name] or np.nan for name in RATIOS]
    cells = [
        f"{extracted.omega_minus:.2f}, {extracted.omega_plus:.2f}",
        f"{extracted.tau:.1f}",
        *(f"{x:.2g}" for x in pair),
    ]
    three = extracted.fits[2]
    cut = trace.between(*extracted.window)
    elapsed = np.asarray(cut.times, dtype=float) - extracted.window[0]
    angle, fall = elapsed[:, None] * three.Omega, np.exp(-elapsed / three.tau)[:, None]
    columns = np.concatenate([fall * np.cos(angle), fall * np.sin(angle), np.ones_like(fall)], axis=1)
    cells.append(", ".join(f"{omega:.2f}" for omega in three.omega))
    for name in RATIOS:
        parts = np.linalg.lstsq(columns, np.asarray(cut[name], dtype=float), rcond=None)[0]
        sizes = np.hypot(parts[:3], parts[3:6])
        cells.append(", ".join(f"{size / sizes[0]:.2g}" for size in sizes[1:]))
    return cells


def spheres(material: Material) -> None:
    """Extracted over eq:wsphere."""
    found = read_spheres(material.table)
    head("spheres", "number", "prefactor: lowest", "mean", "highest")
    kinds = (
        ("small oscillation", found.small),
        ("step", ~found.small & ~found.radial),
        ("radial equation, step", found.radial),
    )
    for words, chosen in kinds:
        for step in sorted({*found.step[chosen].tolist()}):
            values = found.prefactor[(found.step == step) & chosen]
            row(
                f"{words} δP̂ = {step:g}",
                values.size,
                *(f"{value:.4f}" for value in (values.min(), values.mean(), values.max())),
            )


def motions(material: Material) -> None:
    """What the modes are: how the volume motion climbs, what mass it carries, how V and S move together."""
    runs = material.runs
    words = ("P̂₀", "share of V in modes 1–4 [%]", "dS/dV of modes 1, 2", "α₁ by eq:MinBuck of the main volume mode")
    head(*words, "α₂ by eq:omega-lim of mode 1")
    for k in np.flatnonzero(runs.within("pressure")):
        main = int(np.argmax(runs.share[k]))
        mass = 4 * np.pi * 1.4 * runs.pressure[k] / (runs.volume[k] * runs.undamped[k, main] ** 2)
        shares = ", ".join(f"{100 * share:.0f}" for share in runs.share[k])
        slopes = ", ".join(f"{slope:.2f}" for slope in runs.area_per_volume[k, :2])
        limit = printed("eq:omega-lim", "factor").value / (runs.volume[k] * runs.layered[k, 0]) ** 2
        row(f"{runs.gas_pressure[k]:g}", shares, slopes, f"{mass:.2f} (mode {main + 1})", f"{limit:.2f}")


def changes(material: Material) -> None:
    """What decides the constants: each reading over the one that it changes in one respect."""
    fits = {reading.key: reading.fits for reading in material.readings}
    plain, squared = "V_e omega", "V_e^2 omega^2"
    start = fits["modes range"][plain]
    head("change from the modes at P̂₀ 0.36 to 1.8", "α₁", "α₂", "k_VS")
    for words, changed in (
        ("no viscosity", fits["undamped range"][plain]),
        ("large oscillations after the snap", fits["identified range"][plain]),
        ("gas pressures up to 5", fits["modes"][plain]),
        ("residual in V̂ₑ²ω̂²", fits["modes range"][squared]),
        ("ω₊ the mode that moves the volume most", fits["by volume"][plain]),
    ):
        row(words, *(f"× {changed[name].value / start[name].value:.2f}" for name in ("alpha1", "alpha2", "k_vs")))
    extracted = fits["identified range"][plain]
    head("extracted at P̂₀ 0.36 to 1.8", "source", "off by [%]", "in errors of both together")
    for name in ("alpha1", "alpha2", "k_vs"):
        theirs, ours = printed("subsec:agree", name), extracted[name]
        assert theirs.error is not None
        both = np.hypot(ours.stderr, theirs.value * theirs.error / 100)
        off = ours.value - theirs.value
        row(f"{name} {ours.value:.3g} ± {ours.stderr:.2g}", theirs.value, f"{100 * off / theirs.value:+.0f}",
            f"{off / both:+.1f}")  # fmt: skip


def details(material: Material) -> None:
    """The single numbers of docs/paper.md: R, thickness, decay times."""
    table, runs = material.table, material.runs
    head("R", "ω₋, ω₊ from V, S, H, W", "modes", "undamped", "S_e/S₀")
    for family in ("R-free", "R-attached"):
        (k,) = np.flatnonzero(runs.within(family))
        pairs = (runs.extracted[k], runs.layered[k, :2], runs.undamped[k, :2])
        row(family, *(", ".join(f"{value:.3f}" for value in pair) for pair in pairs), f"{table['S_e_over_S0'][k]:.4f}")
    head("d̂", "ω₋ extracted", "mode 1")
    thick = np.flatnonzero(runs.within("thickness"))
    for k in thick[np.argsort(runs.thickness[thick])]:
        row(f"{runs.thickness[k]:g}", f"{runs.extracted[k, 0]:.3f}", f"{runs.layered[k, 0]:.3f}")
    speed, size = runs.pole_speed / runs.viscosity, runs.viscosity * runs.tau
    free, spread = (runs.held == 0) & np.isfinite(size), lambda x: f"{np.min(x):.3g} to {np.max(x):.3g}"
    snaps, water = free & ~runs.small, np.isclose(runs.viscosity, 0.004)
    head("free runs", "number", "Re of the pole", "η τ/(ρ R₀²)", "over the law")
    for words, chosen in (
        ("snaps, Re 3 to 500", snaps & (speed > 3) & (speed < 500)),
        ("snaps, η̂ = 0.004", snaps & water),
        ("small kicks, η̂ = 0.004", free & runs.small & water),
        ("snap, η̂ = 0.13", runs.within("viscosity") & np.isclose(runs.viscosity, 0.13)),
    ):
        law = np.asarray(reynolds_decay_time(jnp.asarray(speed[chosen]), length="radius"))
        row(words, int(chosen.sum()), spread(speed[chosen]), spread(size[chosen]), spread(size[chosen] / law))


def losses() -> None:
    """R's snap with other losses, extracted from V, H and W."""
    R = js.presets.R.conditions
    case = js.Reduced(R.thickness, R.gas_pressure, 1.62, R.viscosity)
    settings = (
        ("liquid to second order", Losses()),
        ("Stokes layer alone", Losses(order=1)),
        ("second order and the source's drag", Losses(drag=Reynolds())),
        ("the source's drag alone", Losses(stokes="none", drag=Reynolds())),
    )
    head("losses of R", "shell", "ω₋, ω₊", "τ", "left by one, two, three [%]", "A₊/A₋ of V", "H", "W")
    for words, chosen in settings:
        for kind, pad in (("free", 0.0), ("attached", 0.3272)):
            trace = dynamics.simulate(case, elements=24, losses=chosen, attached=pad, duration=100.0 if pad else 70.0)
            extracted = extract(trace, RATIOS)
            left = ", ".join(f"{100 * part:.0f}" for part in extracted.residuals)
            pair = [f"{extracted.amplitude_ratio[name] or np.nan:.2g}" for name in RATIOS]
            row(
                words,
                kind,
                f"{extracted.omega_minus:.2f}, {extracted.omega_plus:.2f}",
                f"{extracted.tau:.1f}",
                left,
                *pair,
            )


def main() -> None:
    asked = sys.argv[1:]
    if "losses" in asked:
        losses()
        return
    material = Material(campaigns.catalog())
    if "trajectories" in asked:
        trajectories(material)
    elif "table" in asked:
        every_run(material.runs)
    else:
        over_the_curve(material.runs)
        readings(material)
        ratios(material)
        spheres(material)
        motions(material)
        changes(material)
        details(material)


if __name__ == "__main__":
    main()

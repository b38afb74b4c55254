"""Figures of the source that show frequencies of many shells: what they depend on, and the one curve they lie on.

Symbols    ω±  slow and fast angular frequency   V_e, P_e volume and pressure at rest   d̂, P̂0, η̂ the shell's numbers
Source     Mokbel et al. 2021: fig:resul, fig:w, eq:defw
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.report import FitResult
from jshell.errors import Outcome
from jshell.oscillator import SOURCE, Coefficients, squared_frequencies
from jshell.paper.joint_fits import BOTH_HEARD, JointFit, ShellRuns, deviations
from jshell.paper.printed import printed
from jshell.plot.frequencies import curves
from jshell.plot.style import (
    BLACK,
    BLUE,
    FAST,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    SLOW,
    VERMILION,
    Axes,
    Figure,
    new_figure,
    style,
)

EXTRACTED: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 0.5, "zorder": 3}
MARK: dict[str, Any] = {
    "marker": "D",
    "linestyle": "none",
    "color": BLACK,
    "markerfacecolor": "none",
    "markersize": 6.5,
    "zorder": 4,
}
PAGE_TOP = 3.0  # the master curve's page ends at so many times the middle ω+
WORDS = ("thickness", "viscosity of R", "inner pressure")
NAMED = (("alpha1", "α₁"), ("alpha2", "α₂"), ("k_vs", "k$_{VS}$"))
HEARD_WORDS = "extracted; in (c) P̂ₑₓₜ − P̂₀ fixed"
OMEGA = "slow angular frequency ω̂₋ [√(E d/ρ R₀³)]"


def control(runs: ShellRuns, thickness: str, viscosity: str, pressure: str, shape: str) -> Figure:
    """fig:resul: the slow angular frequency against thickness, viscosity and pressure, one parameter at a time from R.

    Args:
        runs: The campaign.
        thickness, viscosity, pressure, shape: Families of the design in which that is varied; in `shape` both
            pressures rise alike, so that the shape stays.
    """
    with style():
        figure = new_figure((8.4, 3.2))
        axes = figure.subplots(1, 3)
        at = lambda family: runs.within(family) & (runs.held == 0)  # noqa: E731
        theirs = printed("fig:detail-attached", "free_omega_minus").value

        rows = _ordered(at(thickness), runs.thickness)
        _family(axes[0], runs.thickness[rows], runs, rows, BLUE, HEARD_WORDS)
        axes[0].set_xlabel("thickness d̂ = d/R₀")
        axes[0].plot([printed("subsec:param", "d_hat").value], [theirs], **MARK, label="source, R")

        rows = _ordered(at(viscosity), runs.viscosity)
        _family(axes[1], runs.viscosity[rows], runs, rows, BLUE, HEARD_WORDS)
        axes[1].set_xscale("log")
        axes[1].set_xlabel("viscosity η̂ = η/√(E d ρ R₀)")
        axes[1].plot([printed("subsec:param", "eta_hat").value], [theirs], **MARK)
        _ends(axes[1])

        rows = _ordered(at(pressure), runs.pressure)
        _family(axes[2], runs.pressure[rows], runs, rows, BLUE, "")
        rows = _ordered(at(shape), runs.pressure)
        _family(axes[2], runs.pressure[rows], runs, rows, ORANGE, "shape fixed", marker="s")
        axes[2].plot([printed("sec:simulresul", "P_e_of_R").value], [theirs], **MARK)
        axes[2].set_xlabel("inner pressure at rest P̂ₑ [E d/R₀]")
        for ax, letter, words in zip(axes, "abc", WORDS, strict=True):
            ax.set_ylim(0.0, None)
            ax.set_title(rf"$\bf{{({letter})}}$  {words}", loc="left")
        axes[0].set_ylabel(OMEGA)
        named: dict[str, Any] = {}
        for ax in axes:
            handles, labels = ax.get_legend_handles_labels()
            named = dict(zip(labels, handles, strict=True)) | named
        figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=len(named))
    return figure


def master(readings: Sequence[JointFit], runs: ShellRuns) -> Figure:
    """fig:w: V_e² ω±² against V_e P_e, as extracted after the snap and as computed for small vibrations.

    The fits in V_e ω of all shells, and of those with the gas pressures of the source's fig:resul, are drawn through.

    Args:
        readings: Of the campaign, from `jshell.paper.joint_fits.calibrate`.
        runs: The campaign.
    """
    by_key = {reading.key: reading for reading in readings}
    panels = (
        ("identified", "identified range", "a", "extracted after the snap"),
        ("modes", "modes range", "b", "small vibrations with Stokes layer"),
    )
    with style():
        figure = new_figure((8.2, 4.3))
        axes = figure.subplots(1, 2, sharey=True)
        top = PAGE_TOP * max(float(np.median(_squares(by_key[key])[:, 1])) for key, *_ in panels)
        for ax, (key, narrow, letter, words) in zip(axes, panels, strict=True):
            reading = by_key[key]
            x, y = reading.table["V_e"] * reading.table["P_e"], _squares(reading)
            ax.plot(x, y[:, 0], "^", color=SLOW, label="ω̂₋", **EXTRACTED)
            ax.plot(x, y[:, 1], "o", color=FAST, label="ω̂₊", **EXTRACTED)
            grid = np.linspace(0.1, 1.03 * x.max(), 300)
            lines: list[tuple[str, Coefficients, FitResult | None, str, Any]] = [
                ("source", SOURCE, None, GREEN, (0, (4, 2)))
            ]
            for which, look in ((key, "-"), (narrow, (0, (1, 1.2)))):
                if which in by_key:
                    fit = by_key[which].fits["V_e omega"]
                    lines.append(("all" if which == key else "P̂₀ 0.36–1.8", fit.coefficients, fit, BLACK, look))
            for who, c, fit, colour, look in lines:
                _pair(ax, c, grid, colour, look, _constants(who, c, fit))
            outside = int(np.sum(y > top))
            if outside:
                beyond = f"{outside} beyond the page"
                ax.text(0.99, 0.99, beyond, transform=ax.transAxes, ha="right", va="top", fontsize=7, color="#555555")
            ax.set_xlabel("V̂ₑ P̂ₑ [E d R₀²]")
            ax.set_xlim(0.0, grid[-1])
            ax.set_title(rf"$\bf{{({letter})}}$  {words}", loc="left")
        _other_modes(axes[1], runs)
        axes[0].set_ylim(0.0, top)
        axes[0].set_ylabel("V̂ₑ² ω̂±² [E d R₀³/ρ]")
        for ax in axes:
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=1)
    return figure


def _squares(reading: JointFit) -> np.ndarray:
    """(shells, 2) V_e² ω±² of a reading."""
    omega = np.stack([reading.table["omega_minus"], reading.table["omega_plus"]], axis=1)
    return (reading.table["V_e"][:, None] * omega) ** 2


def every_run(runs: ShellRuns) -> Figure:
    """ω- and ω+ of every run over eq:defw with the source's constants, family by family; medians as bars.

    Args:
        runs: The campaign.
    """
    extracted = 100 * deviations(runs, SOURCE, runs.extracted)
    modal = 100 * deviations(runs, SOURCE, runs.layered[:, :2])
    families = [
        name for name in dict.fromkeys(one for own in runs.families for one in own) if _any(extracted, runs, name)
    ]
    with style():
        figure = new_figure((8.0, 3.4))
        axes = figure.subplots(1, 2, sharey=True)
        for k, (ax, colour, sign) in enumerate(zip(axes, (SLOW, FAST), ("₋", "₊"), strict=True)):
            ax.axhline(0.0, color=BLACK, linewidth=0.8)
            ax.axhspan(-7.0, 7.0, color=PALE, alpha=0.45, linewidth=0, zorder=0, label="source's own box, ±7 %")
            for place, name in enumerate(families):
                rows = runs.within(name)
                _swarm(ax, place - 0.16, extracted[rows, k], colour, "o", "extracted" if place == 0 else None)
                words = "mode with Stokes layer" if place == 0 else None
                _swarm(ax, place + 0.16, modal[rows, k], GREY, "s", words)
            ax.set_xticks(range(len(families)), [name.replace("_", " ") for name in families], rotation=30, ha="right")
            chosen = extracted[runs.free_and_thin, k]
            middle, size = float(np.nanmedian(chosen)), float(np.nanmedian(np.abs(chosen)))
            words = f"ω̂{sign} free, η̂ ≤ {BOTH_HEARD:g}: median {middle:+.0f} %, of size {size:.0f} %"
            ax.set_title(rf"$\bf{{({'ab'[k]})}}$  {words}", loc="left")
        axes[0].set_ylabel("over eq. defw, source's constants [%]")
        axes[0].legend(loc="upper left")
        low, high = axes[0].get_ylim()
        axes[0].set_ylim(low, high + 0.2 * (high - low))
    return figure


def constants(readings: Sequence[JointFit], more: Sequence[tuple[str, FitResult]] = ()) -> Figure:
    """α1, α2 and k_VS by every reading of the campaign and both weightings, beside the source's joint fit.

    Args:
        readings: Of the campaign.
        more: Other fits of the same constants, with their words.
    """
    rows: list[tuple[str, Sequence[tuple[str, FitResult]]]] = []
    for reading in readings:
        fits = [(weighting, fit) for weighting, fit in reading.fits.items()]
        rows.append((f"{reading.words} ({reading.shells})", fits))
    rows += [(words, [("V_e omega", fit)]) for words, fit in more]
    looks = {"V_e omega": (BLUE, "o", "residual in V̂ₑω̂"), "V_e^2 omega^2": (VERMILION, "s", "residual in V̂ₑ²ω̂²")}
    with style():
        figure = new_figure((8.6, 0.9 + 0.34 * len(rows)))
        axes = figure.subplots(1, 3, sharey=True)
        for ax, (name, words) in zip(axes, NAMED, strict=True):
            number = printed("subsec:agree", name)
            ax.axvspan(number.value - number.spread, number.value + number.spread, color=GREEN, alpha=0.25, linewidth=0)
            ax.axvline(number.value, color=GREEN, linewidth=1.0, label=f"source {words} = {number.value:g}")
            for place, (_, fits) in enumerate(rows):
                for (weighting, fit), shift in zip(fits, (-0.14, 0.14), strict=False):
                    colour, marker, label = looks[weighting]
                    found = fit[name]
                    error = found.stderr if np.isfinite(found.stderr) else 0.0
                    face = colour if fit.outcome == Outcome.OK else "white"
                    ax.errorbar(
                        [found.value], [place + shift], xerr=[error], fmt=marker, color=colour, markersize=3.8,
                        linewidth=1.0, markerfacecolor=face, label=label if place == 0 else None,
                    )  # fmt: skip
            ax.set_title(words, loc="left")
            ax.set_xlim(0.0, _reach(rows, name, number.value))
            _beyond(ax, rows, name)
        axes[0].set_yticks(range(len(rows)), [words for words, _ in rows])
        axes[0].set_ylim(len(rows) - 0.5, -0.5)
        handles, words = axes[0].get_legend_handles_labels()
        words = [word if "source" not in word else "source, with its error" for word in words]
        figure.legend(
            handles, words, loc="outside lower center", ncols=len(words), title="hollow: ended at k$_{VS}$ = 0"
        )
    return figure


def _family(ax: Axes, x: np.ndarray, runs: ShellRuns, rows: np.ndarray, colour: str, label: str,
            marker: str = "o") -> None:  # fmt: skip
    """A family's extracted frequencies as points, its modes as a line, eq:defw with the source's constants dashed."""
    ax.plot(x, runs.extracted[rows, 0], marker, color=colour, label=label or None, **EXTRACTED)
    ax.plot(x, runs.layered[rows, 0], color=colour, linewidth=0.9, zorder=1)
    said = _said(runs, rows)
    ax.plot(x, said, color=colour, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
    if label == HEARD_WORDS:
        ax.plot([], [], color=colour, linewidth=0.9, zorder=1, label="mode 1, Stokes layer")
        ax.plot([], [], color=colour, linewidth=0.9, linestyle=(0, (4, 2)), label="eq. defw, source")


def _said(runs: ShellRuns, rows: np.ndarray) -> np.ndarray:
    """ω- of eq:defw with the source's constants at the runs' own rest states."""
    c = SOURCE
    one = lambda V, P: squared_frequencies(V, P, c.alpha1, c.alpha2, c.k_vs)  # noqa: E731
    squared = np.asarray(jax.vmap(one)(jnp.asarray(runs.volume[rows]), jnp.asarray(runs.pressure[rows])))[:, 0]
    return np.sqrt(np.where(squared > 0, squared, np.nan))


def _ordered(mask: np.ndarray, by: np.ndarray) -> np.ndarray:
    rows = np.flatnonzero(mask)
    return rows[np.argsort(by[rows])]


def _ends(ax: Axes) -> None:
    """Where the source finds both frequencies, one, none."""
    for key, words in (("eta_both", "both"), ("eta_slow_only", "one"), ("eta_fully_damped", "none")):
        at = printed("subsec:agree", key).value
        ax.axvline(at, color=GREY, linewidth=0.7, linestyle=(0, (1, 2)), zorder=0)
        ax.annotate(words, (at, 1.0), xycoords=("data", "axes fraction"), xytext=(-2, -1), textcoords="offset points",
                    ha="right", va="top", fontsize=6.5, color="#555555", rotation=90)  # fmt: skip


def _pair(ax: Axes, c: Coefficients, grid: np.ndarray, colour: str, line, label: str) -> None:
    slow, fast = curves(c, grid, 1.4, 1.0)
    ax.plot(grid, slow, color=colour, linestyle=line, linewidth=1.0, label=label)
    ax.plot(grid, fast, color=colour, linestyle=line, linewidth=1.0)


def _constants(who: str, c: Coefficients, fit: FitResult | None) -> str:
    parts = []
    for key, symbol, value in (("alpha1", "α₁", c.alpha1), ("alpha2", "α₂", c.alpha2), ("k_vs", "k$_{VS}$", c.k_vs)):
        error = "" if fit is None or not np.isfinite(fit[key].stderr) else f" ± {fit[key].stderr:.2g}"
        parts.append(f"{symbol} {float(value):.2g}{error}")
    return f"{who}: " + ", ".join(parts)


def _other_modes(ax: Axes, runs: ShellRuns) -> None:
    """Modes 3 and 4, where they fit on the page: their size the share of the volume's motion."""
    x = runs.volume * runs.pressure
    for k in (2, 3):
        y = (runs.volume * runs.layered[:, k]) ** 2
        size = 3 + 26 * np.nan_to_num(runs.share[:, k])
        label = "modes 3, 4 (area: share of V's motion)" if k == 2 else None
        ax.scatter(x, y, s=size, facecolor="none", edgecolor=GREY, linewidth=0.6, zorder=1, label=label)


def _any(values: np.ndarray, runs: ShellRuns, family: str) -> bool:
    return bool(np.isfinite(values[runs.within(family)]).any())


def _swarm(ax: Axes, at: float, values: np.ndarray, colour: str, marker: str, label: str | None) -> None:
    """Points of a family spread sideways in their order, and a bar at their median."""
    fine = np.sort(values[np.isfinite(values)])
    if fine.size == 0:
        return
    places = at + 0.10 * np.linspace(-1, 1, fine.size) if fine.size > 1 else np.array([at])
    ax.plot(
        places, fine, marker, color=colour, markersize=3.4, alpha=0.8, markeredgewidth=0, linestyle="none", label=label
    )
    ax.plot([at - 0.15, at + 0.15], 2 * [float(np.median(fine))], color=colour, linewidth=1.6)


def _reach(rows, name: str, theirs: float) -> float:
    """An axis that holds the source's value and every fit but the absurd."""
    values = [fit[name].value + (fit[name].stderr if np.isfinite(fit[name].stderr) else 0.0)
              for _, fits in rows for _, fit in fits]  # fmt: skip
    return 1.08 * min(max([theirs, *values]), 3.2 * theirs)


def _beyond(ax: Axes, rows, name: str) -> None:
    """A fit that the axis does not hold, in words at its edge."""
    for place, (_, fits) in enumerate(rows):
        for (weighting, fit), shift in zip(fits, (-0.14, 0.14), strict=False):
            if fit[name].value > ax.get_xlim()[1]:
                colour = BLUE if weighting == "V_e omega" else VERMILION
                error = f" ± {fit[name].stderr:.2g}" if np.isfinite(fit[name].stderr) else ""
                ax.annotate(f"{fit[name].value:.2g}{error} →", (0.995, place + shift),
                            xycoords=("axes fraction", "data"), ha="right", va="center", fontsize=6.5, color=colour,
                            bbox={"facecolor": "white", "linewidth": 0, "pad": 1.0})  # fmt: skip

"""Driven shells: an answer in time, its spectrum, response curves, bifurcations, softening, hysteresis.

Symbols    V volume   ω angular frequency of the drive   P̂ext outer pressure   ω±  those of the buckled shell
"""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from jshell.oscillator import Bifurcation, Crossing, Response, ResponseCurve, SimulatedModes, Trajectory, harmonics
from jshell.oscillator.spectrum import spectrum
from jshell.plot.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    PURPLE,
    VERMILION,
    Axes,
    axes_or_new,
    new_figure,
    style,
)
from jshell.quantities import quantity
from jshell.shell.elasticity import SPHERE_VOLUME

if TYPE_CHECKING:
    from matplotlib.figure import Figure
else:
    Figure = Any

DRIVE = "ω [√(E d/ρ R₀³)]"


def answer(response: Response) -> Figure:
    """Added pressure, volume, pole and scattered pressure of one run, and the spectrum of the pressure scattered."""
    t = np.asarray(response.times)
    with style():
        figure = new_figure((7.4, 6.4))
        grid = figure.subplot_mosaic([["p", "x"], ["V", "s"], ["h", "h"]])
        rows = (
            ("p", response.pressure, GREY, "added p [E d/R₀]"),
            ("V", response.motion.V / SPHERE_VOLUME, GREEN, "volume V/V₀"),
            ("x", response.front, ORANGE, "buckling pole Δx₁ [R₀]"),
            ("s", response.scattered, PURPLE, "scattered r pₛ [E d]"),
        )
        for name, values, colour, label in rows:
            grid[name].plot(t, np.asarray(values), color=colour, linewidth=1.0)
            grid[name].set_xlabel(quantity("t").label())
            grid[name].set_ylabel(label)
            grid[name].set_xlim(t[0], t[-1])
        echo = spectrum(response.times, jnp.nan_to_num(response.scattered), skip=float(t[-1] - t[0]) / 3, finer=8)
        level = 20 * np.log10(np.maximum(np.asarray(echo.amplitude), 1e-12) / float(np.max(echo.amplitude)))
        w = np.asarray(echo.angular_frequency)
        last = float(w[np.nonzero(level > -60)[0][-1]])
        grid["h"].plot(w, level, color=PURPLE, linewidth=1.0)
        grid["h"].set_xlim(0.0, min(1.1 * last, float(echo.highest)))
        grid["h"].set_ylim(-70, 3)
        grid["h"].set_xlabel("angular frequency ω [√(E d/ρ R₀³)]")
        grid["h"].set_ylabel("level of r pₛ [dB]")
    return figure


def response_curves(curves: ResponseCurve | tuple[ResponseCurve, ...], ax: Axes | None = None) -> Axes:
    """Amplitude of the volume over the drive's angular frequency; unstable orbits dashed, one colour per curve."""
    listed = (curves,) if isinstance(curves, ResponseCurve) else curves
    with style():
        ax = axes_or_new(ax)
        for curve, colour in zip(listed, (BLUE, VERMILION, GREEN, PURPLE, ORANGE) * len(listed), strict=False):
            w, a = np.asarray(curve.angular_frequencies), np.asarray(curve.amplitude) / SPHERE_VOLUME
            order = np.argsort(w)
            w, a, stable = w[order], a[order], np.asarray(curve.multiplier)[order] <= 1
            ax.plot(w, np.where(stable, a, np.nan), color=colour, label=f"{float(curve.drive):g}")
            ax.plot(w, a, color=colour, linewidth=0.8, linestyle=(0, (2, 2)))
        ax.set_yscale("log")
        ax.set_xlabel(f"drive {DRIVE}")
        ax.set_ylabel("amplitude of V/V₀")
        ax.legend(title="drive [E d/R₀]", title_fontsize=7.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def bifurcation_diagram(found: Bifurcation, ax: Axes | None = None) -> Axes:
    """The volume once a period over the drive's amplitude; grey where the shell leaves the buckled state."""
    A, V = np.asarray(found.amplitudes), np.asarray(found.volume) / SPHERE_VOLUME
    with style():
        ax = axes_or_new(ax, (5.2, 3.2))
        ax.plot(np.broadcast_to(A, V.shape).ravel(), V.ravel(), ".", markersize=0.8, color=BLUE, rasterized=True)
        ended = np.asarray(found.outcome) != 0
        if ended.any():
            low, high = A[ended].min(), A[ended].max()
            ax.axvspan(low, high, color=PALE, alpha=0.6, linewidth=0, zorder=0)
            ax.text(high, 0.97, "leaves the buckled state ", transform=ax.get_xaxis_transform(), ha="right", va="top",
                    color="#555555", fontsize=7.5)  # fmt: skip
        ax.set_xlim(A.min(), A.max())
        ax.set_xlabel("amplitude of the drive [E d/R₀]")
        ax.set_ylabel("ΔV/V₀, once a period")
    return ax


def softening_curve(found: Crossing, ax: Axes | None = None, *, simulated: SimulatedModes | None = None) -> Axes:
    """Angular frequencies over the outer pressure through buckling, relative to the stress-free sphere (fig:soft).

    Args:
        found: Of the two-variable model.
        ax: Where to draw; by default on a new figure.
        simulated: Rows of the same shell by the simulator, drawn beside it: a dot per mode, its area
            the mode's share of the volume's motion.
    """
    P = np.asarray(found.pressures)
    with style():
        ax = axes_or_new(ax, (5.6, 3.4))
        ax.axvline(float(found.load), color=PALE, linewidth=1.0, zorder=0)
        for values, colour, look, label in (
            (found.sphere, BLACK, "-", "sphere"),
            (found.fast, VERMILION, "-", "buckled, ω₊"),
            (found.slow, BLUE, "-", "buckled, ω₋"),
            (found.marmottant, GREY, ":", "Marmottant's buckled law"),
        ):
            ax.plot(P, np.asarray(values), color=colour, linestyle=look, label=label)
        if simulated is not None and len(simulated):
            at = np.broadcast_to(simulated.outer_pressure[:, None], simulated.omega.shape)
            seen = (at <= P.max()).ravel()
            size = 6 + 70 * simulated.share.ravel()[seen]
            ax.scatter(at.ravel()[seen], (simulated.omega / float(found.unit)).ravel()[seen], s=size, color=GREEN,
                       alpha=0.75, linewidth=0, zorder=3,
                       label="simulated modes 1–4,\narea: share of the volume")  # fmt: skip
        ax.set_ylim(0, None)
        ax.set_xlim(P.min(), P.max())
        ax.set_xlabel(quantity("Pext_hat").label())
        ax.set_ylabel("angular frequency ω / stress-free sphere")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def softening_map(thickness: np.ndarray, gas_pressure: np.ndarray, drop: np.ndarray, ax: Axes | None = None) -> Axes:
    """How far the slow angular frequency falls at buckling, over thickness and gas pressure.

    Args:
        thickness: (columns,) d̂.
        gas_pressure: (rows,) P̂0.
        drop: (rows, columns) `softening(...).slow`.
        ax: Where to draw; by default on a new figure.
    """
    with style():
        ax = axes_or_new(ax, (4.8, 3.4))
        levels = np.array([2, 2.5, 3, 3.5, 4, 5, 6, 8, 10, 15, 20])
        first, last = np.searchsorted(levels, (np.nanmin(drop), np.nanmax(drop)))
        levels = levels[max(first - 1, 0) : max(last + 1, first + 2)]
        shades = ax.contourf(thickness, gas_pressure, drop, levels=levels, cmap="cividis_r", extend="both")
        lines = ax.contour(thickness, gas_pressure, drop, levels=levels, colors="white", linewidths=0.6)
        ax.clabel(lines, fmt="%g", fontsize=6.5)
        ax.set_xscale("log")
        ax.set_yscale("log")
        for axis, values in ((ax.xaxis, thickness), (ax.yaxis, gas_pressure)):
            marks = [m * 10.0**k for k in range(-4, 6) for m in (1, 2, 5)]
            shown = [mark for mark in marks if values.min() * 0.999 <= mark <= values.max() * 1.001]
            axis.set_ticks(shown, [f"{mark:g}" for mark in shown])
            axis.set_ticks([], minor=True)
        ax.set_xlabel(quantity("d_hat").label())
        ax.set_ylabel("gas pressure P̂₀ [E d/R₀]")
        bar = ax.figure.colorbar(shades, ax=ax, pad=0.02)
        bar.set_label("ω of the sphere / ω₋ at buckling")
    return ax


def hysteresis(trajectory: Trajectory, ax: Axes | None = None) -> Axes:
    """Volume over the outer pressure, with the loads at which a slow pressure buckles and unbuckles the shell."""
    P, V = np.asarray(trajectory.trace["P_ext"]), np.asarray(trajectory.trace["V"]) / SPHERE_VOLUME
    buckled = np.asarray(trajectory.trace["buckled"]) == 1
    at = trajectory.thresholds
    with style():
        ax = axes_or_new(ax, (4.6, 3.2))
        ax.plot(P, np.where(buckled, V, np.nan), color=BLUE, linewidth=0.9, label="buckled")
        ax.plot(P, np.where(buckled, np.nan, V), color=BLACK, linewidth=0.9, label="sphere")
        for load, word in ((at.buckling_pressure, "buckles"), (at.unbuckling_pressure, "unbuckles")):
            ax.axvline(float(load), color=GREY, linewidth=0.7, linestyle=(0, (3, 2)), zorder=0)
            ax.text(float(load), 1.01, word, transform=ax.get_xaxis_transform(), ha="center", va="bottom", fontsize=7)
        ax.set_xlabel(quantity("Pext_hat").label())
        ax.set_ylabel("volume V/V₀")
        ax.legend(loc="lower left")
    return ax


def radius(run: Any, ax: Axes | None = None) -> Axes:
    """R/R0 of a coated bubble over time, with its buckling and break radii (a run of `comparators.radial_run`)."""
    bubble, t = run.bubble, np.asarray(run.times) * 1e6
    with style():
        ax = axes_or_new(ax, (5.2, 3.0))
        ax.plot(t, np.asarray(run.radius) / bubble.radius, color=BLUE, linewidth=1.0)
        for level, word in ((bubble.buckling_radius, "buckles below"), (bubble.break_radius, "breaks above")):
            if np.isfinite(level):
                ax.axhline(level / bubble.radius, color=GREY, linewidth=0.7, linestyle=(0, (3, 2)), zorder=0)
                ax.text(t[-1], level / bubble.radius, f" {word}", ha="left", va="center", fontsize=7, color="#555555")
        ax.set_xlim(t[0], t[-1])
        ax.set_xlabel("time t [µs]")
        ax.set_ylabel("radius R/R₀")
    return ax


def harmonic_levels(response: Response, angular_frequency: float) -> dict[str, float]:
    """Amplitudes of the scattered pressure at 1/2, 1, 3/2, 2 and 3 times the drive, over the last half of the run.

    Multiples that the samples are too coarse for are left out.
    """
    t = response.times
    first = t.size // 2
    orders = (0.5, 1.0, 1.5, 2.0, 3.0)
    found = jax.device_get(harmonics(t[first:], response.scattered[first:], angular_frequency, orders))
    return {f"{order:g}": float(value) for order, value in zip(orders, found, strict=True) if np.isfinite(value)}

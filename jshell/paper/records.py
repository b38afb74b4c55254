"""Figures of the source that show records in time: V and S for three pressures, attached against free.

Symbols    V, S, H, W volume, area, height, width   ω±  angular frequencies   τ decay time   A±  amplitudes
Source     Mokbel et al. 2021: fig:oscill, fig:detail-attached
"""

from collections.abc import Mapping, Sequence

import numpy as np

from jshell.paper.printed import printed
from jshell.plot.style import (
    BLACK,
    BLUE,
    CHANNEL,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    VERMILION,
    Axes,
    Figure,
    new_figure,
    style,
)
from jshell.plot.traces import SPHERE, two_modes
from jshell.signals import Signature
from jshell.trace import Trace

BEFORE, AFTER = 6.0, 32.0  # shown before and after the dip [time unit]
LADDER = (ORANGE, BLUE, GREEN)  # rising pressure
UNIT = "[√(ρ R₀³/E d)]"


def relaxation(
    traces: Sequence[Trace], reference: Trace, extracted: Mapping[str, Signature], moments: Sequence[float] = ()
) -> Figure:
    """fig:oscill: V and S through the snap for three gas pressures, and the damped pair on V and on S of R.

    Args:
        traces: Snaps by rising gas pressure, R among them or not, each with V, S and conditions.
        reference: The snap of R.
        extracted: `V` and `S` to what was extracted there from `reference`.
        moments: Times of `reference` at which pictures were taken; they are lettered.
    """
    with style():
        figure = new_figure((7.6, 4.6))
        axes = np.asarray(figure.subplots(2, 2, sharex="col", width_ratios=(1.25, 1.0)))
        for row, name in enumerate(("V", "S")):
            size, symbol = SPHERE[name]
            ax = axes[row, 0]
            for trace, colour in zip(traces, LADDER, strict=False):
                times, zero = np.asarray(trace.times), _snap(trace)
                shown = (times >= zero - BEFORE) & (times <= zero + AFTER)
                P0 = float(trace.conditions.gas_pressure) if trace.conditions is not None else np.nan
                ax.plot(times[shown] - zero, np.asarray(trace[name])[shown] / size, color=colour, label=f"P̂₀ = {P0:g}")
            ax.set_ylabel(symbol)
            ax.margins(x=0.0)
            _with_fit(axes[row, 1], reference, extracted[name], name)
        axes[0, 0].legend(loc="upper right", ncols=3, columnspacing=1.0)
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.10 * (high - low))
        value = printed("fig:oscill", "S_e_over_S0").value
        axes[1, 0].axhline(value, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
        axes[1, 0].text(
            0.01, value, f"source {value:g}", transform=axes[1, 0].get_yaxis_transform(), ha="left", va="bottom",
            fontsize=7, color="#555555",
        )  # fmt: skip
        _letters(axes[0, 0], reference, moments)
        axes[1, 0].set_xlabel(f"time after the snap t {UNIT}")
        axes[1, 1].set_xlabel(f"time after the dip t {UNIT}")
        _title(axes[0, 0], "a", "three gas pressures")
        _title(axes[0, 1], "b", "R and two damped sinusoids")
    return figure


def attached(free: tuple[Trace, Signature], held: tuple[Trace, Signature]) -> Figure:
    """fig:detail-attached: V, H and W of R ringing free and attached, one damped pair for the three of them.

    Args:
        free: The free shell's snap, and what was extracted from its V, H and W.
        held: The same of the attached shell.
    """
    with style():
        figure = new_figure((7.6, 5.6))
        axes = np.asarray(figure.subplots(3, 2, sharex="col"))
        for column, (kind, (trace, extracted)) in enumerate((("free", free), ("attached", held))):
            for row, name in enumerate(("V", "H", "W")):
                ax = axes[row, column]
                size, symbol = SPHERE[name]
                times, zero = np.asarray(trace.times), extracted.t_dip
                shown = (times >= zero) & (times <= zero + AFTER)
                ax.plot(
                    times[shown] - zero, np.asarray(trace[name])[shown] / size, color=CHANNEL[name], linewidth=2.6,
                    alpha=0.6,
                )  # fmt: skip
                fitted = (times >= extracted.window[0]) & shown
                curve = two_modes(extracted, name, times[fitted]) / size
                ax.plot(times[fitted] - zero, curve, color=BLACK, linewidth=0.8)
                theirs = printed("fig:detail-attached", f"{kind}_ratio_{name}").value
                words = _ratios(trace, extracted, name, theirs)
                _headroom(ax, 0.34)
                ax.text(0.99, 0.98, words, transform=ax.transAxes, ha="right", va="top", fontsize=7.5)
                ax.margins(x=0.0)
                if column == 0:
                    ax.set_ylabel(symbol)
            theirs = ", ".join(
                f"{printed('fig:detail-attached', f'{kind}_omega_{sign}').value:.1f}" for sign in ("minus", "plus")
            )
            ours = f"{extracted.omega_minus or np.nan:.2f}, {extracted.omega_plus or np.nan:.2f}"
            _title(axes[0, column], "ab"[column], f"{kind}: ω̂± = {ours}  (source {theirs})")
            axes[2, column].set_xlabel(f"time after the dip t {UNIT}")
    return figure


def _ratios(trace: Trace, extracted: Signature, name: str, theirs: float) -> str:
    """A+/A- of the pair, and of the second and third of three sinusoids where they are found."""
    ratio = extracted.amplitude_ratio[name]
    words = f"A₊/A₋ = {np.nan if ratio is None else ratio:.2g}  (source {theirs:g})"
    three = extracted.fits[2] if len(extracted.fits) > 2 else None
    if three is None or not three.converged or three.omega.size < 3:
        return words
    cut = trace.between(*extracted.window)
    elapsed = np.asarray(cut.times, dtype=float) - extracted.window[0]
    angle, fall = elapsed[:, None] * three.Omega, np.exp(-elapsed / three.tau)[:, None]
    columns = np.concatenate([fall * np.cos(angle), fall * np.sin(angle), np.ones_like(fall)], axis=1)
    parts = np.linalg.lstsq(columns, np.asarray(cut[name], dtype=float), rcond=None)[0]
    sizes = np.hypot(parts[:3], parts[3:6])
    more = ", ".join(
        f"{size / sizes[0]:.2g} at {omega:.2f}" for size, omega in zip(sizes[1:], three.omega[1:], strict=True)
    )
    return f"{words}\nof three sinusoids: {more}"


def _with_fit(ax: Axes, trace: Trace, extracted: Signature, name: str) -> None:
    """A channel after the dip with its damped pair, numbers beside it."""
    size, _ = SPHERE[name]
    times, zero = np.asarray(trace.times), extracted.t_dip
    shown = (times >= zero) & (times <= zero + AFTER)
    ax.axvspan(extracted.window[0] - zero, AFTER, color=PALE, alpha=0.35, linewidth=0, zorder=0)
    ax.plot(
        times[shown] - zero, np.asarray(trace[name])[shown] / size, color=BLUE if name == "V" else VERMILION,
        linewidth=2.6, alpha=0.55,
    )  # fmt: skip
    fitted = (times >= extracted.window[0]) & shown
    ax.plot(times[fitted] - zero, two_modes(extracted, name, times[fitted]) / size, color=BLACK, linewidth=0.8)
    ax.margins(x=0.0)
    _headroom(ax, 0.24)
    fast = np.nan if extracted.omega_plus is None else extracted.omega_plus
    words = f"ω̂₋ = {extracted.omega_minus:.2f},  ω̂₊ = {fast:.2f},  τ̂ = {extracted.tau:.1f}"
    two, three = (f"{100 * left:.0f} %" for left in extracted.residuals[1:])
    words += f"\nleaves {two} of the scatter; three sinusoids {three}"
    ax.text(0.99, 0.98, words, transform=ax.transAxes, ha="right", va="top", fontsize=7.5)


def _snap(trace: Trace) -> float:
    """When the buckling pole sinks fastest; without its velocity, when the volume falls fastest."""
    times = np.asarray(trace.times)
    speed = trace["v_front"] if "v_front" in trace.channels else np.gradient(np.asarray(trace["V"]), times)
    return float(times[int(np.argmin(np.asarray(speed)))])


def _headroom(ax: Axes, share: float) -> None:
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + share * (high - low))


def _letters(ax: Axes, trace: Trace, moments: Sequence[float]) -> None:
    """Letters at the moments of the pictures, on the curve of V."""
    from matplotlib.patheffects import withStroke

    times, zero, size = np.asarray(trace.times), _snap(trace), SPHERE["V"][0]
    for letter, at in zip("abcdefghij", moments, strict=False):
        if -BEFORE <= at - zero <= AFTER:
            level = float(np.interp(at, times, np.asarray(trace["V"]))) / size
            ax.plot([at - zero], [level], "o", color=BLACK, markersize=2.6, zorder=4)
            ax.annotate(letter, (at - zero, level), xytext=(3, 3), textcoords="offset points", fontsize=7.5,
                        path_effects=[withStroke(linewidth=2.0, foreground="white")])  # fmt: skip


def _title(ax: Axes, letter: str, words: str) -> None:
    ax.set_title(rf"$\bf{{({letter})}}$  {words}", loc="left", fontsize=8.5)

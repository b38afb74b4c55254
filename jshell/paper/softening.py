"""The source's figure of softening: angular frequencies before and after buckling over the outer pressure.

Symbols    ω angular frequency over that of the stress-free sphere [-]   P̂ext outer pressure [E d/R0]
Source     Mokbel et al. 2021: fig:soft; Marmottant et al. 2005 for the dotted law
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jshell.oscillator import SOURCE, crossing, simulated_modes
from jshell.oscillator import softening as drop
from jshell.paper.printed import printed
from jshell.plot.style import BLACK, BLUE, GREEN, GREY, VERMILION, Axes, Figure, new_figure, style
from jshell.quantities import quantity

POINTS = 160
BEYOND = 1.45  # the last outer pressure over the buckling load
SHADES = (BLUE, VERMILION, GREEN)


def softening(thickness: Sequence[float] = (0.02, 0.05, 0.1), pressures: Sequence[float] = (0.4, 0.9, 2.5)) -> Figure:
    """fig:soft: the source's model, its sphere and Marmottant's law, and the simulator's first two modes as dots.

    Args:
        thickness: d̂ of (a), three at most, at P̂0 = 0.4.
        pressures: P̂0 of (b), three at most, at d̂ = 0.02.
    """
    gas, thin = printed("fig:soft", "P0_hat").value, printed("fig:soft", "d_hat").value
    with style():
        figure = new_figure((8.2, 3.7))
        left, right = figure.subplots(1, 2, sharey=True)
        for d, colour in zip(thickness, SHADES, strict=False):
            _shell(left, d, gas, colour, f"d̂ = {d:g}")
        for P0, colour in zip(pressures, SHADES, strict=False):
            _shell(right, thin, P0, colour, f"P̂₀ = {P0:g}")
        right.set_xscale("log")
        marks = (0.4, 0.6, 1.0, 2.0, 3.0)
        right.set_xticks(marks, [f"{mark:g}" for mark in marks])
        right.set_xticks([], minor=True)
        left.set_title(rf"$\bf{{(a)}}$  P̂₀ = {gas:g}", loc="left")
        right.set_title(rf"$\bf{{(b)}}$  d̂ = {thin:g}", loc="left")
        left.set_ylabel("angular frequency ω / stress-free sphere")
        left.set_ylim(0.0, 1.18)
        ours = drop(thin, gas, SOURCE)
        theirs = printed("subsec:soft", "slow_drop").value, printed("subsec:soft", "fast_drop_lowest").value
        fall = f"fall at buckling, d̂ = {thin:g}: ω̂₋ by {float(ours.slow):.1f}, ω̂₊ by {float(ours.fast):.1f}"
        fall += f"\n(source: {theirs[0]:g}, more than {theirs[1]:g})"
        left.text(0.99, 0.02, fall, transform=left.transAxes, ha="right", va="bottom", fontsize=7)
        for ax in (left, right):
            ax.set_xlabel(quantity("Pext_hat").label())
            ax.legend(loc="upper right", ncols=3, columnspacing=1.0)
        figure.legend(*_key(left), loc="outside lower center", ncols=4)
    return figure


def _shell(ax: Axes, d: float, P0: float, colour: str, label: str) -> None:
    """One shell through its buckling."""
    load = float(crossing(d, P0, SOURCE, np.array([P0])).load)
    found = crossing(d, P0, SOURCE, np.linspace(P0, BEYOND * load, POINTS))
    P = np.asarray(found.pressures)
    ax.plot(P, np.asarray(found.sphere), color=colour, label=label)
    for values, look in ((found.slow, "-"), (found.fast, "-"), (found.marmottant, (0, (1, 1.5)))):
        ax.plot(P, np.asarray(values), color=colour, linestyle=look, linewidth=1.0 if look == "-" else 1.3)
    stored = simulated_modes().of(d, P0)
    for k, marker in ((0, "v"), (1, "o")):
        ax.plot(
            stored.outer_pressure, stored.omega[:, k] / float(found.unit), marker, color=colour, markersize=4.2,
            markeredgecolor="white", markeredgewidth=0.5, linestyle="none", zorder=3,
        )  # fmt: skip


def _key(ax: Axes) -> tuple[list, list[str]]:
    """Marks that stand for all colours."""
    looks: tuple[tuple[dict[str, Any], str], ...] = (
        ({"linestyle": "-"}, "eq. wsphere, then ω̂₊ and ω̂₋ of eq. defw, source's constants"),
        ({"linestyle": (0, (1, 1.5))}, "Marmottant"),
        ({"linestyle": "none", "marker": "v"}, "simulated mode 1"),
        ({"linestyle": "none", "marker": "o"}, "mode 2"),
    )
    handles = [ax.plot([], [], color=GREY if "marker" in look else BLACK, **look)[0] for look, _ in looks]
    return handles, [words for _, words in looks]

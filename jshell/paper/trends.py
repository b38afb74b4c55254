"""What the source says of all its shells in a sentence: thick liquids stop the ringing, the area hardly changes.

Symbols    V volume, V_t where a kick has thrown it, V_e at rest [R0³]   S_e area at rest, S_0 of the sphere [R0²]
           η̂ viscosity [-]   d̂ thickness [R0]
Source     Mokbel et al. 2021: sec:simulresul, subsec:agree; fig:oscill for the area
"""

from collections.abc import Mapping

import numpy as np

from jshell.paper.joint_fits import ShellRuns
from jshell.paper.printed import printed
from jshell.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, Figure, new_figure, style
from jshell.shell.elasticity import SPHERE_AREA
from jshell.trace import Trace

SHOWN = 20.0  # of a record after its kick [time unit]
NEAR = 0.06  # how far from the sphere's area shells of d̂ up to 0.22 may be
THICK = 0.22
COLOURS = (BLUE, GREEN, ORANGE, VERMILION)


def trends(runs: ShellRuns, kicks: Mapping[int, Trace]) -> Figure:
    """V after the same small kick in liquids ever thicker, and the area at rest of every buckled shell.

    Args:
        runs: The campaign.
        kicks: Row of the campaign to the record of its kick.
    """
    with style():
        figure = new_figure((7.6, 3.2))
        left, right = figure.subplots(1, 2)
        left.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
        for colour, row in zip(COLOURS, sorted(kicks, key=lambda row: runs.viscosity[row]), strict=False):
            times, swing = _swing(kicks[row], runs.volume[row])
            left.plot(times, swing, color=colour, linewidth=1.2, label=f"η̂ = {runs.viscosity[row]:g}")
        left.set_xlim(0.0, SHOWN)
        left.set_xlabel("time after the kick's height t [√(ρ R₀³/E d)]")
        left.set_ylabel("(V − V$_e$)/(V$_t$ − V$_e$)")
        left.set_title(r"$\bf{(a)}$  a small kick", loc="left")
        left.legend(loc="upper right")

        right.axhspan(1 - NEAR, 1 + NEAR, color=GREY, alpha=0.15, linewidth=0, label="within 6 %")
        theirs = printed("fig:oscill", "S_e_over_S0").value
        right.axhline(theirs, color=BLACK, linewidth=0.9, linestyle=(0, (4, 2)), label=f"source, R: {theirs:g}")
        right.axvline(THICK, color=GREY, linewidth=0.7, linestyle=(0, (1, 2)), zorder=0)
        buckled = np.isin(np.array(runs.kinds, dtype=str), ("snap", "kick", "modes"))
        for words, chosen, colour, marker in (
            ("free", buckled & (runs.held == 0), BLUE, "o"),
            ("attached", buckled & (runs.held > 0), VERMILION, "s"),
        ):
            right.plot(runs.thickness[chosen], runs.area[chosen] / SPHERE_AREA, marker, color=colour, markersize=3.4,
                       alpha=0.8, markeredgewidth=0, linestyle="none", label=words)  # fmt: skip
        right.set_xlabel("thickness d̂ = d/R₀")
        right.set_ylabel("area at rest S$_e$/S₀")
        right.set_title(r"$\bf{(b)}$  area of every buckled shell", loc="left")
        right.legend(loc="lower left")
    return figure


def _swing(trace: Trace, rest: float) -> tuple[np.ndarray, np.ndarray]:
    """From where the kick has thrown V on: time, and V over that height, both about the volume at rest."""
    V = np.asarray(trace["V"], dtype=float)
    top = int(np.argmax(V))
    times = np.asarray(trace.times, dtype=float)[top:]
    return times - times[0], (V[top:] - rest) / (V[top] - rest)

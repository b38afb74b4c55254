"""The deflation branch: pressure difference against volume, with its marks; the loss of symmetry of many.

Symbols    V/V₀ volume [-]   ΔP pressure difference [E d/R0]
"""

from collections.abc import Sequence

import numpy as np

from jshell.errors import Outcome
from jshell.membrane import Branch, Maxwell, SymmetryLoss, Threshold
from jshell.membrane.round import LAW
from jshell.plot.style import BLACK, BLUE, GREEN, GREY, ONE, ORANGE, PALE, VERMILION, Axes, axes_or_new, style

FOLDS = {
    "difference": ("v", "fold of the pressure"),
    "volume": ("s", "fold of the volume"),
    "load": ("D", "fold of the load"),
}


# thicknesses of Table 1 of the source (tab:orders), d̂
TABLE_1 = (("contrast agents", 4e-4, 5e-3), ("simulations", 0.04, 0.3), ("macroshells", 0.01, 0.5))


def deflation(
    branch: Branch,
    ax: Axes | None = None,
    *,
    threshold: Threshold | None = None,
    maxwell: Maxwell | None = None,
    loss: SymmetryLoss | None = None,
) -> Axes:
    """Pressure difference against volume along a deflation branch.

    Drawn through where the shape is stable at held volume, dashed where it is not, dotted where it is no longer round.
    With the threshold, the line of the compressed sphere is drawn up to it.

    Args:
        branch: From `jshell.membrane.deflation_branch`.
        ax: Where to draw; by default on a new figure.
        threshold: Eigenvalue of the sphere, from `buckling_eigenvalue`.
        maxwell: From `maxwell_point`.
        loss: From `symmetry_loss`.
    """
    V, p = branch.volume_ratio, branch.difference
    stable = branch.held_stability > 0
    lost = np.zeros_like(stable)
    if loss is not None and loss.volume_ratio is not None and loss.difference is not None:
        # from the fold of the volume on volumes fall
        k = int(np.argmax(V)) + int(np.sum(V[np.argmax(V) :] > loss.volume_ratio))
        V, p = np.insert(V, k, loss.volume_ratio), np.insert(p, k, loss.difference)
        stable, lost = np.insert(stable, k, stable[max(k - 1, 0)]), np.arange(V.size) >= k
        stable &= np.arange(V.size) <= k
    with style():
        ax = axes_or_new(ax, ONE)
        ax.plot(V, np.where(stable, p, np.nan), color=BLUE, label="dimple, stable at held volume")
        if np.any(lost):
            ax.plot(V[lost], p[lost], color=ORANGE, linestyle=(0, (1, 1.5)), label="not round")
        unstable = ~stable & ~lost
        if np.any(unstable):
            # a dashed stretch begins at the last stable state, so that the line has no gap
            edge = unstable.copy()
            edge[1:] |= unstable[:-1]
            edge[:-1] |= unstable[1:]
            ax.plot(V, np.where(edge, p, np.nan), color=BLUE, linestyle=(0, (3, 2)), linewidth=1.0, label="unstable")
        if threshold is not None and int(threshold.outcome) == Outcome.OK:
            top, at = float(threshold.difference), float(threshold.volume_ratio)
            ax.plot([1.0, at], [0.0, top], color=GREY, label="sphere")
            ax.plot([at], [top], "o", color=BLACK, label="first eigenvalue")
        for kind, (marker, words) in FOLDS.items():
            folds = [fold for fold in branch.folds if fold.of == kind]
            if folds:
                places = [fold.volume_ratio for fold in folds], [fold.difference for fold in folds]
                ax.plot(*places, marker, color=VERMILION, markerfacecolor="white", zorder=3.5, label=words)
        if maxwell is not None and maxwell.outcome == Outcome.OK:
            at, height = [maxwell.volume_ratio], [maxwell.difference]
            # below the folds: a fold of the load may lie there
            ax.plot(at, height, "*", color=GREEN, markersize=10, zorder=2.5, label="Maxwell point")
        if loss is not None and loss.volume_ratio is None:
            ax.plot([], [], " ", label=f"{loss.words} V/V₀ = {loss.checked:.3f}")
        elif loss is not None and loss.volume_ratio is not None and loss.difference is not None:
            ax.plot([loss.volume_ratio], [loss.difference], "P", color=ORANGE, markersize=8, label=loss.words)
        if branch.outcome == Outcome.CONTACT:
            ax.plot(V[-1:], p[-1:], "X", color=ORANGE, label="wall touches itself")
        ax.set_xlim(min(0.28, V.min() - 0.02), 1.01)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel("volume V/V₀")
        ax.set_ylabel("pressure difference ΔP [E d/R₀]")
        ax.legend(loc="upper left")
    return ax


def symmetry_map(thicknesses: Sequence[float], losses: Sequence[SymmetryLoss], ax: Axes | None = None) -> Axes:
    """Where dimples stop being round: volume over thickness, with the order that sets in, the law, and Table 1.

    Args:
        thicknesses: d̂ of each shell [-].
        losses: From `symmetry_loss` of its branch; one that stays round is drawn as an open mark where that was seen.
        ax: Where to draw; by default on a new figure.
    """
    with style():
        ax = axes_or_new(ax, ONE)
        d = np.geomspace(min(4e-4, min(thicknesses)), max(0.5, max(thicknesses)), 300)
        law = 1 - (d / LAW) ** 2
        ax.fill_between(d, np.clip(law, 0.0, 1.0), 0.0, color=PALE, linewidth=0.0, label="not round")
        ax.plot(d, np.where(law > 0, law, np.nan), color=GREY, label=f"d̂ = {LAW:.3f} √(1 − V/V₀)")  # ν = 1/2
        for thickness, loss in zip(thicknesses, losses, strict=True):
            if loss.volume_ratio is None:
                ax.plot([thickness], [loss.checked], "o", color=BLUE, markerfacecolor="white")
            else:
                ax.plot([thickness], [loss.volume_ratio], "o", color=VERMILION)
                point = thickness, loss.volume_ratio
                ax.annotate(f"m = {loss.order}", point, (-4, -3), textcoords="offset points", ha="right", va="top")
        for row, (words, low, high) in enumerate(TABLE_1):
            ax.plot([low, high], [0.05 + 0.07 * row] * 2, color=GREEN, linewidth=3.0, solid_capstyle="butt")
            ax.annotate(words, (low, 0.075 + 0.07 * row), color=GREEN, fontsize=6.0)
        ax.set_xscale("log")
        ax.set_ylim(0.0, 1.0)
        ax.set_xlabel("thickness d̂")
        ax.set_ylabel("volume V/V₀")
        ax.legend(loc="upper right")
    return ax

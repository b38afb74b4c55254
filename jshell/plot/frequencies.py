"""Frequencies of many shells on one curve.

Symbols    V_e, P_e volume and inner pressure at rest   ω±  slow and fast angular frequency
Source     Mokbel et al. 2021: eq:defw, where V_e² ω±² depends on V_e P_e alone; fig:w
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jshell.calibration.frequency_table import prepare
from jshell.calibration.report import FitResult
from jshell.oscillator import SOURCE, Coefficients, squared_frequencies
from jshell.plot.style import FAST, GREY, SLOW, Axes, axes_or_new, style
from jshell.quantities import quantity

MOST_NAMED = 16  # shells whose thickness is written beside them
POINTS = 200


def master_curve(
    table: Mapping[str, object],
    fit: FitResult | None = None,
    ax: Axes | None = None,
    *,
    source: Coefficients | None = SOURCE,
) -> Axes:
    """V_e² ω±² against V_e P_e: the shells of a table, the fitted curves, and those of the source's constants.

    Args:
        table: Columns by name, as `jshell.calibration.fit_frequencies` takes them.
        fit: Its result; None draws no fitted curves.
        ax: Where to draw; by default on a new figure.
        source: Constants to compare with, in grey; None leaves them out.

    Raises:
        BadName, BadShape: A table that cannot be read.
    """
    rows = prepare(table).rows
    V, P, omega = np.asarray(rows.volume), np.asarray(rows.pressure), np.asarray(rows.omega)
    x, y = V * P, (V[:, None] * omega) ** 2
    kept = np.isfinite(y).any(axis=1)
    x, y = x[kept], y[kept]
    span = np.ptp(x) if np.ptp(x) > 0 else x.max()
    grid = np.linspace(max(x.min() - 0.12 * span, 0.02 * x.max()), x.max() + 0.06 * span, POINTS)
    gas = np.unique(np.stack([np.asarray(rows.kappa)[kept], np.asarray(rows.area_modulus)[kept]], axis=1), axis=0)

    drawn: list[tuple[Any, str]] = []  # what the legend shows, and its words
    with style():
        ax = axes_or_new(ax)
        if source is not None:
            drawn.append(
                (_pairs(ax, source, grid, gas, (GREY, GREY), linestyle=(0, (4, 2))), f"source {_caption(source)}")
            )
        if fit is not None:
            drawn.append((_pairs(ax, fit.coefficients, grid, gas, (SLOW, FAST)), f"fit {_caption(fit.coefficients)}"))
        slow_symbol, fast_symbol = (quantity(key).symbol for key in ("omega_minus", "omega_plus"))
        points = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 3}
        slow = ax.plot(x, y[:, 0], marker="o", color=SLOW, markersize=5.2, label=f"slow {slow_symbol}", **points)[0]
        fast = ax.plot(x, y[:, 1], marker="s", color=FAST, label=f"fast {fast_symbol}", **points)[0]
        drawn += [(line, str(line.get_label())) for line in (slow, fast)]
        _thicknesses(ax, table, np.asarray(kept), x, y)

        top = max(float(np.nanmax(line.get_ydata())) for line in ax.get_lines())
        ax.set_ylim(0.0, 1.45 * top)
        ax.set_xlim(grid[0], grid[-1])
        _legend(ax, drawn)
        V_symbol, P_symbol = quantity("V").symbol, quantity("P").symbol
        ax.set_xlabel(f"{V_symbol}ₑ{P_symbol}ₑ [E d R₀²]")
        ax.set_ylabel(f"{V_symbol}ₑ² ω² [E d R₀³/ρ]")
    return ax


def _thicknesses(ax: Axes, table: Mapping[str, object], kept: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
    """Write d̂ beside the fast mode of each shell, where a table of few shells says that they differ in it."""
    d = np.asarray(table.get("d_hat", ()), dtype=float)
    if d.shape != kept.shape or np.unique(d[kept]).size < 2 or kept.sum() > MOST_NAMED:
        return
    fast = y[:, 1]
    near_x, near_y = 0.03 * np.ptp(x), 0.05 * np.nanmax(fast)  # about the size of a number
    for place, height, thickness in zip(x, fast, d[kept], strict=True):
        if np.isfinite(height):
            # the number goes below its marker where the one of another would lie on it
            covered = np.any((np.abs(x - place) < near_x) & (fast > height) & (fast - height < near_y))
            shift = (4, -8) if covered else (4, 3)
            ax.annotate(f"{thickness:.3g}", (place, height), shift, textcoords="offset points", fontsize=6, color=GREY)
    ax.text(0.985, 0.02, r"numbers: $\hat d$", transform=ax.transAxes, ha="right", fontsize=6, color=GREY)


def curves(
    coefficients: Coefficients, product: Float[np.ndarray, "points"], kappa: float, area_modulus: float
) -> Float[np.ndarray, "2 points"]:
    """V_e² ω² of the slow and of the fast mode over V_e P_e; NaN where the slow mode is unstable."""
    c = coefficients
    unit = jnp.asarray(1.0)  # at V_e = 1 the pressure is the product, and ω² is V_e² ω²
    one = lambda p: squared_frequencies(  # noqa: E731
        unit, p, c.alpha1, c.alpha2, c.k_vs, kappa=float(kappa), area_modulus=float(area_modulus)
    )
    found = np.array(jax.vmap(one)(jnp.asarray(product))).T
    return np.where(found >= 0, found, np.nan)


def _pairs(ax: Axes, c: Coefficients, grid: np.ndarray, gas: np.ndarray, colours: tuple[str, str], **look: Any):
    """Slow and fast curve for every gas and wall of the table; the first pair stands for all in the legend."""
    pairs = []
    for kappa, modulus in gas:
        both = curves(c, grid, kappa, modulus)
        rows = zip(both, colours, strict=True)
        pairs.append(tuple(ax.plot(grid, row, color=colour, linewidth=1.1, **look)[0] for row, colour in rows))
    return pairs[0]


def _legend(ax: Axes, drawn: list[tuple[Any, str]]) -> None:
    from matplotlib.legend_handler import HandlerTuple

    handles, words = zip(*drawn, strict=True)
    together = {tuple: HandlerTuple(ndivide=None, pad=0.3)}
    ax.legend(handles, words, handler_map=together, loc="upper left", ncols=2, columnspacing=1.0, handletextpad=0.5)


def _caption(c: Coefficients) -> str:
    rows = (("alpha1", c.alpha1), ("alpha2", c.alpha2), ("kVS", c.k_vs))
    return ", ".join(f"{_printed(quantity(key).symbol)} {float(value):.3g}" for key, value in rows)


def _printed(symbol: str) -> str:
    """A symbol with its index lowered: `k_VS`."""
    letter, _, index = symbol.partition("_")
    return rf"{letter}$_{{\mathrm{{{index}}}}}$" if index else symbol

"""Frequencies of many shells on one curve.

Symbols    V_e, P_e volume and inner pressure at rest   ω±  slow and fast pulsation
Source     Mokbel et al. 2021: eq:defw, where V_e² ω±² depends on V_e P_e alone; fig:w
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jshell.calibration.frequency_table import prepare
from jshell.calibration.report import FitResult
from jshell.oscillator import SOURCE, Coefficients, squared_frequencies
from jshell.plot.style import FAST, GREY, SLOW, Axes, axes_or_new, style
from jshell.quantities import quantity

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

    with style():
        ax = axes_or_new(ax)
        for number, (kappa, modulus) in enumerate(gas):  # one pair of curves per gas and wall
            if source is not None:
                slow, fast = curves(source, grid, kappa, modulus)
                name = f"source: {_constants(source)}" if number == 0 else None
                ax.plot(grid, slow, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0, label=name)
                ax.plot(grid, fast, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
            if fit is not None:
                slow, fast = curves(fit.coefficients, grid, kappa, modulus)
                name = f"fit: {_constants(fit.coefficients)}" if number == 0 else None
                ax.plot(grid, fast, color=FAST, label=name)
                ax.plot(grid, slow, color=SLOW)
        slow_symbol, fast_symbol = (quantity(key).symbol for key in ("omega_minus", "omega_plus"))
        points = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 3}
        ax.plot(x, y[:, 1], marker="s", color=FAST, label=f"fast {fast_symbol}", **points)
        ax.plot(x, y[:, 0], marker="o", color=SLOW, markersize=5.2, label=f"slow {slow_symbol}", **points)
        top = np.nanmax([line.get_ydata().max() for line in ax.get_lines() if len(line.get_ydata())])
        ax.set_ylim(0.0, 1.45 * top)
        ax.set_xlim(grid[0], grid[-1])
        ax.legend(loc="upper left", ncols=2, columnspacing=1.0, handletextpad=0.5)
        V_symbol, P_symbol = quantity("V").symbol, quantity("P").symbol
        ax.set_xlabel(f"{V_symbol}ₑ{P_symbol}ₑ [E d R₀²]")
        ax.set_ylabel(f"{V_symbol}ₑ² ω² [E d R₀³/ρ]")
    return ax


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


def _constants(c: Coefficients) -> str:
    return ", ".join(f"{float(value):.3g}" for value in (c.alpha1, c.alpha2, c.k_vs))

"""What depends on what: bars of elasticities and of Sobol indices."""

import numpy as np

from jshell.plot.style import BLUE, GREY, SKY, Axes, axes_or_new, style
from jshell.sensitivity import Elasticities, NextExperiment, SobolIndices

WORDS = {
    "thickness": "d̂",
    "gas_pressure": "P̂₀",
    "outer_pressure": "P̂ₑₓₜ",
    "viscosity": "η̂",
    "kappa": "κ",
    "poisson_ratio": "ν",
    "alpha1": "α₁",
    "alpha2": "α₂",
    "k_vs": "k$_{\\mathrm{VS}}$",
    "beta1": "β₁",
}
OBSERVABLES = {"omega_minus": "ω₋", "omega_plus": "ω₊", "tau": "τ", "volume": "Vₑ", "pressure": "Pₑ"}


def elasticity_bars(found: Elasticities, ax: Axes | None = None) -> Axes:
    """Percent of the observable per percent of each input, largest on top."""
    order = np.argsort(np.abs(found.elasticity))
    with style():
        ax = axes_or_new(ax)
        ax.barh([WORDS[found.inputs[i]] for i in order], found.elasticity[order], color=BLUE, height=0.65)
        ax.axvline(0, color=GREY, linewidth=0.7)
        name = OBSERVABLES.get(found.name, found.name)
        ax.set_xlabel(f"elasticity of {name}: % per %")
    return ax


def sobol_bars(found: SobolIndices, ax: Axes | None = None) -> Axes:
    """First-order and total index of each input with their confidence intervals."""
    place = np.arange(len(found.inputs))
    with style():
        ax = axes_or_new(ax)
        for shift, values, ends, colour, label in (
            (-0.18, found.first, found.first_interval, BLUE, "alone"),
            (0.18, found.total, found.total_interval, SKY, "with all it touches"),
        ):
            error = np.abs(np.stack([values - ends[:, 0], ends[:, 1] - values]))
            ax.bar(place + shift, values, width=0.34, color=colour, label=label, yerr=error, capsize=2,
                   error_kw={"linewidth": 0.8})  # fmt: skip
        ax.set_xticks(place, [WORDS.get(name, name) for name in found.inputs])
        name = OBSERVABLES.get(found.name, found.name)
        ax.set_ylabel(f"share of the variance of {name}")
        ax.legend()
    return ax


def ranking(found: NextExperiment, names: list[str], ax: Axes | None = None) -> Axes:
    """What each candidate would add to the information, best on top; those without frequencies are left out."""
    order = [k for k in np.argsort(np.nan_to_num(found.gain, nan=-np.inf)) if np.isfinite(found.gain[k])]
    with style():
        ax = axes_or_new(ax)
        ax.barh([names[k] for k in order], found.gain[order], color=BLUE, height=0.65)
        ax.set_xlabel("information gained: rise of ln det F")
        ax.set_ylabel("candidate d̂, P̂₀, P̂ₑₓₜ")
    return ax

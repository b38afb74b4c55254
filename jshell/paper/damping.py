"""Figures of the source that show damping and the spherical check: τ against Re, angular frequencies of the sphere.

Symbols    τ decay time   Re = v R0 ρ/η Reynolds number of the buckling pole   C_x drag coefficient
           ω_sph angular frequency of the sphere   δP̂ step of the outer pressure [E d/R0]
Source     Mokbel et al. 2021: fig:tau, eq:oscillSph, eq:wsphere; Almedeij 2008
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jshell.oscillator.drag import reynolds_decay_time
from jshell.paper.joint_fits import ShellRuns
from jshell.paper.printed import printed
from jshell.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, Figure, new_figure, style

ETA_LAYER = 0.13  # above it the Stokes layer is as thick as the shell: sqrt(η/ω) > 0.4 R0
STEPS = {0.45: GREEN, 0.225: VERMILION, 0.045: BLUE}  # the source's three families


@dataclass(frozen=True)
class Spheres:
    """Spherical oscillations after a step of the outer pressure, a row each.

    Attributes:
        gas_pressure: (runs,) P̂0, inside and outside before the step.
        step: (runs,) δP̂.
        volume: (runs,) V_e at rest [R0³].
        extracted: (runs,) angular frequency extracted.
        said: (runs,) eq:wsphere at that rest state.
        small: (runs,) whether it was a small oscillation about the compressed sphere instead of the step's own.
        radial: (runs,) whether it is the radial equation's, since the simulated sphere left its shape.
    """

    gas_pressure: Float[np.ndarray, " runs"]
    step: Float[np.ndarray, " runs"]
    volume: Float[np.ndarray, " runs"]
    extracted: Float[np.ndarray, " runs"]
    said: Float[np.ndarray, " runs"]
    small: Bool[np.ndarray, " runs"]
    radial: Bool[np.ndarray, " runs"]

    @property
    def prefactor(self) -> Float[np.ndarray, " runs"]:
        """Extracted over eq:wsphere."""
        return self.extracted / self.said


def damping(runs: ShellRuns) -> Figure:
    """fig:tau: η τ/(ρ R0²) against the Reynolds number of the pole, with the settling sphere's law.

    Args:
        runs: The campaign, with the pole's fastest speed.
    """
    free = (runs.held == 0) & np.isfinite(runs.tau) & (runs.viscosity > 0)
    reynolds = runs.pole_speed / np.where(runs.viscosity > 0, runs.viscosity, np.nan)
    with style():
        figure = new_figure((5.4, 4.0))
        ax = figure.add_subplot()
        grid = np.geomspace(4e-3, 3e3, 240)
        for length, look in (("radius", "-"), ("diameter", (0, (5, 2)))):
            law = np.asarray(reynolds_decay_time(jnp.asarray(grid), length=length))
            words = f"settling sphere, Re of the {length}" + (" (source)" if length == "radius" else "")
            ax.plot(grid, law, color=BLACK, linewidth=1.1, linestyle=look, label=words)
        big = free & ~runs.small
        thin = big & (runs.viscosity <= ETA_LAYER)
        ax.plot(reynolds[thin], (runs.viscosity * runs.tau)[thin], "o", color=BLUE, markeredgecolor="white",
                markeredgewidth=0.5, label="extracted after the snap", zorder=3)  # fmt: skip
        thick = big & ~thin
        ax.plot(reynolds[thick], (runs.viscosity * runs.tau)[thick], "o", color=BLUE, markerfacecolor="white",
                label=f"η̂ > {ETA_LAYER:g}: no thin layer", zorder=3)  # fmt: skip
        small = free & runs.small
        if small.any():
            ax.plot(reynolds[small], (runs.viscosity * runs.tau)[small], "s", color=ORANGE, markeredgecolor="white",
                    markeredgewidth=0.5, label="extracted after a small kick", zorder=3)  # fmt: skip
        tau = runs.decay[:, 0]
        ax.plot(reynolds[free], (runs.viscosity * tau)[free], "_", color=VERMILION, markersize=7, markeredgewidth=1.3,
                label="slow mode in its Stokes layer", zorder=2)  # fmt: skip
        ratio = printed("subsec:damp", "alpha1_over_beta1").value
        prefactor = printed("eq:taureal", "prefactor").value
        ax.axhline(prefactor * ratio, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
        ax.annotate(f"source at η̂ = 0.13: 2 × {ratio:g}", (1.0, prefactor * ratio), xycoords=("axes fraction", "data"),
                    xytext=(-2, 3), textcoords="offset points", ha="right", fontsize=7.5, color="#555555")  # fmt: skip
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("Reynolds number of the pole Re = v R₀ ρ/η")
        ax.set_ylabel("decay time η τ/(ρ R₀²)")
        ax.legend(loc="lower left")
    return figure


def spheres(found: Spheres) -> Figure:
    """eq:oscillSph: the sphere after a step of pressure, its ω, and eq:wsphere with and without its factor 1.07.

    Args:
        found: The spherical families.
    """
    theirs = printed("eq:wsphere", "prefactor").value
    with style():
        figure = new_figure((7.6, 3.4))
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        for step in sorted({*found.step.tolist()}, reverse=True):
            colour = next((known for size, known in STEPS.items() if abs(step / size - 1) < 1e-6), GREY)
            for kind, chosen in _kinds(found).items():
                rows = np.flatnonzero((found.step == step) & chosen)
                rows = rows[np.argsort(found.gas_pressure[rows])]
                if rows.size == 0:
                    continue
                x, small = found.gas_pressure[rows], kind == "small"
                look = {"marker": "x" if small else "o", "linestyle": "none", "color": colour, "markersize": 5.0}
                look |= {"markerfacecolor": "white"} if kind == "radial" else {}
                words = {"small": "small oscillation", "step": "step", "radial": "step, kept spherical"}[kind]
                right.plot(x, found.prefactor[rows], **look, label=f"{words}, δP̂ = {step:g}")
                if small:
                    continue
                left.plot(x, found.extracted[rows], **look)
                left.plot(x, found.said[rows], color=colour, linewidth=1.0, zorder=1)
                left.plot(x, theirs * found.said[rows], color=colour, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
        left.plot([], [], color=BLACK, linewidth=1.0, label="eq. wsphere")
        left.plot([], [], color=BLACK, linewidth=0.9, linestyle=(0, (4, 2)), label=f"{theirs:g} × eq. wsphere (source)")
        right.axhline(1.0, color=BLACK, linewidth=0.8, zorder=0)
        right.axhline(theirs, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)), zorder=0)
        right.annotate(f"source {theirs:g}", (1.0, theirs), xycoords=("axes fraction", "data"), xytext=(0, -3),
                       textcoords="offset points", ha="right", va="top", fontsize=7.5, color="#555555")  # fmt: skip
        for ax in (left, right):
            ax.set_xlabel("gas pressure P̂₀ [E d/R₀]")
        left.set_ylabel("angular frequency of the sphere ω̂ [√(E d/ρ R₀³)]")
        right.set_ylabel("ω̂ extracted over eq. wsphere")
        left.legend(loc="upper left")
        right.legend(loc="center right")
        left.set_title(r"$\bf{(a)}$  angular frequencies", loc="left")
        right.set_title(r"$\bf{(b)}$  prefactor", loc="left")
    return figure


def _kinds(found: Spheres) -> dict[str, np.ndarray]:
    return {"step": ~found.small & ~found.radial, "radial": found.radial, "small": found.small}

"""The constants from a whole campaign: what was extracted from all runs, their modes, their trajectories, side by side.

The source fits one curve to the frequencies of all its simulations. Here the
same is done with several readings of "the frequencies" and both weightings, so
that a difference to the source's constants has a number for each of its causes:
large or small oscillations, with or without the liquid's viscosity, which mode
is called ω+, which shells, which residual. No fit starts from published constants.

Symbols    ω-, ω+ angular frequencies [sqrt(E d/(ρ_f R0³))]   V_e volume [R0³], P_e pressure [E d/R0] at rest
           share dV²/Σ dV² over the modes followed: what a mode takes of a sudden pressure's work on the volume
Valid for  free buckled shells; extracted frequencies up to the viscosity at which the source finds both
Source     Mokbel et al. 2021: eq:defw, fig:w, section "Oscillation frequencies"
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jshell.calibration.master_curve import WEIGHTINGS, fit_frequencies
from jshell.calibration.report import FitResult, FitWarning
from jshell.calibration.trajectories import fit_trajectories
from jshell.errors import BadName, BadShape, BadValue
from jshell.oscillator import Coefficients, squared_frequencies
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.signals.snap import AFTER_SNAP, dip
from jshell.trace import Trace, Values

FOLLOWED = 4  # modes of each shell
BOTH_HEARD = 0.013  # the viscosity up to which the source determines both frequencies
SOURCE_PRESSURES = (0.36, 1.8)  # gas pressures of the source's family in fig:resul
AT_REST = 0.03  # a record that settles further than this from the rest volume did not reach the buckled state
RINGING = ("snap", "kick")  # kinds of runs in which a buckled shell rings
SAME_MODE = 0.15  # a frequency further than this from a mode's is not that mode's
KAPPA = 1.4
SMALL = 3  # fewest shells a fit is made of: two frequencies each for three constants
NEEDED = ("key", "families", "kind", "outcome", "d_hat", "P0_hat", "eta_hat", "V_e", "P_e", "omega_minus", "omega_plus")


@dataclass(frozen=True)
class ShellRuns:
    """What a calibration reads of a campaign: a row each, NaN where a run has no such number.

    Attributes:
        names: What each run is called.
        families: Which families of the design each belongs to.
        kinds: What was done: `snap`, `kick`, …
        thickness, gas_pressure, outer_pressure, viscosity: (runs,) d̂, P̂0, P̂ext, η̂.
        held: (runs,) angle of the pad that holds the shell [rad]; 0 for a free one.
        volume, area, pressure: (runs,) V_e [R0³], S_e [R0²], P_e [E d/R0] of the rest shape.
        extracted: (runs, 2) ω-, ω+ extracted from V, S, H and W together, where the run ended well at its rest shape.
        heard_on_volume: (runs, 2) the same on V alone.
        three: (runs, 3) three frequencies extracted from V, S, H and W together.
        tau: (runs,) decay time extracted.
        pole_speed: (runs,) fastest motion of the buckling pole in the window of extraction [sqrt(E d/(ρ_f R0))].
        layered, decay: (runs, modes) |s| and τ of the slowest modes with Stokes layer.
        undamped: (runs, modes) ω without viscosity.
        share: (runs, modes) share of the volume's motion, of the undamped modes.
        area_per_volume: (runs, modes) dS/dV of the modes with Stokes layer [1/R0].
    """

    names: tuple[str, ...]
    families: tuple[tuple[str, ...], ...]
    kinds: tuple[str, ...]
    thickness: Float[np.ndarray, " runs"]
    gas_pressure: Float[np.ndarray, " runs"]
    outer_pressure: Float[np.ndarray, " runs"]
    viscosity: Float[np.ndarray, " runs"]
    held: Float[np.ndarray, " runs"]
    volume: Float[np.ndarray, " runs"]
    area: Float[np.ndarray, " runs"]
    pressure: Float[np.ndarray, " runs"]
    extracted: Float[np.ndarray, "runs 2"]
    heard_on_volume: Float[np.ndarray, "runs 2"]
    three: Float[np.ndarray, "runs 3"]
    tau: Float[np.ndarray, " runs"]
    pole_speed: Float[np.ndarray, " runs"]
    layered: Float[np.ndarray, "runs modes"]
    decay: Float[np.ndarray, "runs modes"]
    undamped: Float[np.ndarray, "runs modes"]
    share: Float[np.ndarray, "runs modes"]
    area_per_volume: Float[np.ndarray, "runs modes"]

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if len(values) != len(self.names):
                raise BadShape(
                    f"runs, {name}",
                    found=f"{len(values)} rows",
                    expected=f"{len(self.names)}, one per run",
                    remedy="Give every column the same length.",
                )

    def __len__(self) -> int:
        return len(self.names)

    def where(self, rows: Bool[np.ndarray, " runs"]) -> "ShellRuns":
        """Some of the runs."""
        picked = np.flatnonzero(rows)
        parts: dict[str, Any] = {}
        for name, values in vars(self).items():
            parts[name] = tuple(values[i] for i in picked) if isinstance(values, tuple) else values[picked]
        return ShellRuns(**parts)

    def within(self, *families: str) -> Bool[np.ndarray, " runs"]:
        """Which runs belong to some families of the design."""
        return np.array([bool({*own} & {*families}) for own in self.families])

    @property
    def small(self) -> Bool[np.ndarray, " runs"]:
        """Which runs were small oscillations from the start: a kick about the rest shape, no snap."""
        return np.array(self.kinds, dtype=str) == "kick"

    @property
    def free_and_thin(self) -> Bool[np.ndarray, " runs"]:
        """Free buckled shells in a liquid so thin that the source finds both frequencies."""
        buckled = np.isin(np.array(self.kinds, dtype=str), (*RINGING, "modes"))
        return buckled & (self.held == 0) & (self.viscosity <= BOTH_HEARD) & np.isfinite(self.volume)

    @property
    def filled(self) -> Float[np.ndarray, " runs"]:
        """Gas pressure of the stress-free sphere that belongs to P_e at V_e, offsets included [E d/R0]."""
        return self.pressure * (self.volume / SPHERE_VOLUME) ** KAPPA

    @property
    def identified(self) -> Float[np.ndarray, "runs 2"]:
        """Of all extracted those nearest to modes 1 and 2 with Stokes layer, within 15 %; NaN where none is."""
        candidates = np.concatenate([self.extracted, self.three], axis=1)[:, None, :]
        off = np.abs(candidates / self.layered[:, :2, None] - 1)
        off = np.where(np.isfinite(off), off, np.inf)
        nearest = np.argmin(off, axis=2)
        found = np.take_along_axis(np.broadcast_to(candidates, off.shape), nearest[:, :, None], axis=2)[:, :, 0]
        return np.where(np.min(off, axis=2) < SAME_MODE, found, np.nan)

    @property
    def by_volume(self) -> Float[np.ndarray, "runs 2"]:
        """ω- the slowest mode with Stokes layer, ω+ the one above it that moves the volume most."""
        known = np.asarray(np.isfinite(self.share).all(axis=1))
        above = 1 + np.argmax(np.where(known[:, None], self.share, 0.0)[:, 1:], axis=1)
        both = np.stack([self.layered[:, 0], self.layered[np.arange(len(self)), above]], axis=1)
        return np.where(known[:, None], both, np.nan)


@dataclass(frozen=True)
class JointFit:
    """One way to read the campaign, fitted.

    Attributes:
        key: Its short name.
        words: What was fitted.
        shells: How many shells; two frequencies each.
        fits: Weighting to the fit.
        table: What was fitted, as `fit_frequencies` takes it.
        names: The runs.
    """

    key: str
    words: str
    shells: int
    fits: Mapping[str, FitResult]
    table: Mapping[str, np.ndarray]
    names: tuple[str, ...]


def read_runs(table: Mapping[str, object]) -> ShellRuns:
    """What a calibration needs of a campaign's table.

    Args:
        table: Columns by name, as a campaign's catalogue exports them: conditions, rest states, what was extracted,
            `modes_omega_1` to `_4` and so on. Texts and numbers; empty cells, None and NaN are missing.

    Raises:
        BadName: A column that is needed is missing.
    """
    for name in NEEDED:
        if name not in table:
            raise BadName(
                "campaign table", found=f"no column {name}", expected=", ".join(NEEDED), remedy="Export it again."
            )
    count = len(np.asarray(table["key"]))
    texts = lambda name: tuple(str(text) for text in np.asarray(table[name]))  # noqa: E731

    def numbers(name: str, missing: float = np.nan) -> np.ndarray:
        if name not in table:
            return np.full(count, missing)
        cells = np.asarray(table[name], dtype=object).tolist()
        return np.array([missing if cell is None or cell == "" else float(cell) for cell in cells])

    several = lambda name: np.stack([numbers(f"{name}_{k + 1}") for k in range(FOLLOWED)], axis=1)  # noqa: E731
    volume, settled = numbers("V_e"), numbers("V_settled")
    kinds = texts("kind")
    fine = np.array(
        [outcome == "ok" and kind in RINGING for outcome, kind in zip(texts("outcome"), kinds, strict=True)]
    )
    fine &= ~(np.abs(settled / volume - 1) > AT_REST)
    extracted = lambda *names: np.where(fine[:, None], np.stack([numbers(name) for name in names], axis=1), np.nan)  # noqa: E731
    dV = several("undamped_dV") ** 2
    modal_dV = several("modes_dV")
    return ShellRuns(
        names=texts("key"),
        families=tuple(tuple(text.split()) for text in texts("families")),
        kinds=kinds,
        thickness=numbers("d_hat"),
        gas_pressure=numbers("P0_hat"),
        outer_pressure=numbers("P_ext" if "P_ext" in table else "Pext_hat"),
        viscosity=numbers("eta_hat"),
        held=numbers("attached", 0.0),
        volume=volume,
        area=numbers("S_e"),
        pressure=numbers("P_e"),
        extracted=extracted("omega_minus", "omega_plus"),
        heard_on_volume=extracted("V_omega_minus", "V_omega_plus"),
        three=extracted("three_omega_1", "three_omega_2", "three_omega_3"),
        tau=np.where(fine, numbers("tau"), np.nan),
        pole_speed=numbers("v_pole_ring"),
        layered=several("modes_omega"),
        decay=several("modes_tau"),
        undamped=several("undamped_omega"),
        share=dV / dV.sum(axis=1, keepdims=True),
        area_per_volume=several("modes_dS") / np.where(np.abs(modal_dV) > 1e-9, modal_dV, np.nan),
    )


def calibrate(runs: ShellRuns) -> tuple[JointFit, ...]:
    """α1, α2 and k_VS of a campaign, by every reading of its frequencies and both weightings.

    Args:
        runs: The campaign, from `read_runs`.

    Returns:
        One reading each, the source's own procedure first. Those with fewer than three shells are left out.

    Raises:
        BadValue: No reading has enough shells.

    Source:
        eq:defw. Free shells only; η̂ up to 0.013, where the source finds both frequencies.
    """
    free = runs.free_and_thin
    low, high = SOURCE_PRESSURES
    usual = (runs.filled >= low) & (runs.filled <= high)
    snap = free & np.isfinite(runs.extracted).all(axis=1) & ~runs.small
    modal, plain = runs.layered[:, :2], runs.undamped[:, :2]
    asked = (
        ("heard", "extracted after the snap, as the source does", snap, runs.extracted),
        ("on volume", "the same, on V alone", snap, runs.heard_on_volume),
        ("identified", "extracted, nearest to modes 1, 2", snap, runs.identified),
        ("identified range", "the same, P̂₀ 0.36 to 1.8", snap & usual, runs.identified),
        ("kick", "extracted after small kicks", free & runs.small, runs.extracted),
        ("modes of heard", "modes 1, 2 of the shells that snapped", snap, modal),
        ("modes", "modes 1, 2 of all shells", free, modal),
        ("modes range", "the same, P̂₀ 0.36 to 1.8", free & usual, modal),
        ("undamped range", "the same without viscosity", free & usual, plain),
        ("by volume", "mode 1, main volume mode, P̂₀ 0.36 to 1.8", free & usual, runs.by_volume),
    )
    found = []
    for key, words, rows, omega in asked:
        rows = rows & np.isfinite(omega).all(axis=1)
        count = int(rows.sum())
        if count < SMALL:
            continue
        # rows that are not read stay in the table as missing, so that one compiled program fits every reading
        chosen = np.where(rows[:, None], omega, np.nan)
        table = {"omega_minus": chosen[:, 0], "omega_plus": chosen[:, 1], "V_e": runs.volume, "P_e": runs.pressure}
        fits = {}
        for weighting in WEIGHTINGS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FitWarning)  # the fit's outcome and texts say the same
                fit = fit_frequencies(table, weighting)
            fits[weighting] = replace(fit, title=f"{words}: {count} shells, residual in {weighting}")
        names = tuple(runs.names[i] for i in np.flatnonzero(rows))
        found.append(JointFit(key, words, count, fits, {name: part[rows] for name, part in table.items()}, names))
    if not found:
        raise BadValue(
            "runs",
            found=f"{len(runs)} runs, too few with both frequencies",
            expected=f"{SMALL} free buckled shells or more",
            remedy="Add runs of low viscosity.",
        )
    return tuple(found)


def calibrate_trajectories(traces: Sequence[Trace], *, channels: Sequence[str] = ("V",)) -> FitResult:
    """The same constants from the records themselves: every trace by its own pair and decay, the constants shared.

    A channel counts by its own standard deviation after the snap, so that no record outweighs another.

    Args:
        traces: With conditions; from five units after the dip on.
        channels: Read of each.

    Source:
        eq:defw inside the fit of fig:oscill, all runs at once.
    """
    weighed = [_evenly(trace, channels) for trace in traces]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the result carries them
        return fit_trajectories(weighed, "modal", channels=channels, equilibrium="trace", noise="white", starts=1)


def _evenly(trace: Trace, channels: Sequence[str]) -> Trace:
    """The ring-down of a snap; the error of every sample a tenth of its channel's standard deviation there."""
    cut = trace.between(dip(trace, tuple(channels)) + AFTER_SNAP, None)
    error = lambda name: np.full(np.shape(cut.times), 0.1 * np.std(np.asarray(cut[name])))  # noqa: E731
    sigma: dict[str, Values] = {name: error(name) for name in channels}
    picked: dict[str, Values] = {name: cut[name] for name in channels}
    return Trace(cut.times, picked, cut.conditions, sigma, cut.outcome, cut.settings, cut.scales)


def deviations(
    runs: ShellRuns, constants: Coefficients, omega: Float[np.ndarray, "runs 2"]
) -> Float[np.ndarray, "runs 2"]:
    """Each frequency over that of eq:defw at the run's own V_e and P_e, less one; NaN where either is missing.

    Args:
        runs: The campaign.
        constants: Of the two-variable model.
        omega: Extracted or computed.
    """
    c = constants
    one = lambda V, P: squared_frequencies(V, P, c.alpha1, c.alpha2, c.k_vs)  # noqa: E731
    said = np.asarray(jax.vmap(one)(jnp.asarray(runs.volume), jnp.asarray(runs.pressure)))
    return omega / np.sqrt(np.where(said > 0, said, np.nan)) - 1

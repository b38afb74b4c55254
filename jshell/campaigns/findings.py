"""What one run found: its rest state, its modes, and what is extracted from its record.

A row of the catalogue. What does not exist for a run (modes of a breathing
sphere, a frequency in a record that ended early) is None, never a number.

Symbols    as the columns are named in `Findings`
Source     Mokbel et al. 2021, sections "Two frequencies" and "Fixed shells"
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from jshell.campaigns.planned import told_when_asked
from jshell.dynamics import Modes, OrderModes, Roundness
from jshell.errors import Outcome
from jshell.membrane import RestShape
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.signals import extract
from jshell.trace import Trace

EXTRACTED = ("V", "S", "H", "W")  # together: on V alone a third mode is often taken for the second
MODES = 4
SWING = 1e-3  # of V0: a smaller turning of V does not count as an oscillation
Four = tuple[float | None, ...]
NO_FOUR: Four = (None,) * MODES
NO_THREE: Four = (None,) * 3
LATER = ("symmetry", "growth", "azimuth_omega", "azimuth_tau")  # fields that came after the first campaigns


@dataclass(frozen=True)
class Findings:
    """One run's numbers, dimensionless; None where there is none.

    Attributes:
        outcome: How the run itself ended, a word of `Outcome`.
        reason: Why it is not ok, in words.
        heard: How the extraction ended, a word of `Outcome`; empty where there is no record.
        verdict: How many modes the record needs.
        P_ext: Outer pressure during the run: that of the problem and the offset.
        V_e, S_e, P_e: Rest state; V_e_over_V0, S_e_over_S0 its ratios to the stress-free sphere.
        modes_omega, modes_tau: |s| and τ of the four slowest modes in the run's liquid; τ alone where overdamped.
        modes_dV, modes_dS: Change of V and S along each, as in `jshell.dynamics.Modes`.
        undamped_omega: Of the four slowest modes without viscosity.
        undamped_dV: Change of V along each.
        omega_minus, omega_plus, tau: Two damped sinusoids of one decay, extracted from V, S, H, W together.
        omega_minus_stderr, omega_plus_stderr, tau_stderr: Their standard errors.
        residual: What they leave, over the signal's standard deviation.
        ratio_V, ratio_S, ratio_H, ratio_W: A+/A-, at the window's start.
        V_omega_minus, V_omega_plus, V_tau, V_residual: The same extracted from V alone, as in the source.
        three_omega, three_tau, three_residual: Three damped sinusoids on V, S, H, W together.
        one_omega, one_tau: One damped sinusoid on V.
        V_settled, S_settled: Where V and S end.
        t_dip, window_start, window_end: Time of the dip, and the window used.
        turnings: How often V turns after the dip by more than a thousandth of V0.
        v_pole, v_pole_ring: Highest speed of the buckling pole, and in the window.
        omega_sphere: eq:wsphere at the compressed sphere.
        prefactor: one_omega over omega_sphere.
        radial_omega, radial_prefactor: The same of a `step` for a sphere that can only breathe.
        symmetry: Whether the rest shape is round where that was computed, as `not round: m = 4, grows at rate 0.1`.
        growth: That rate; 0 where it is round.
        azimuth_omega, azimuth_tau: Of the slowest vibration of the orders m = 1 to 4 around the axis.
    """

    outcome: str
    reason: str = ""
    heard: str = ""
    verdict: str = ""
    P_ext: float | None = None
    V_e: float | None = None
    S_e: float | None = None
    P_e: float | None = None
    V_e_over_V0: float | None = None
    S_e_over_S0: float | None = None
    modes_omega: Four = NO_FOUR
    modes_tau: Four = NO_FOUR
    modes_dV: Four = NO_FOUR
    modes_dS: Four = NO_FOUR
    undamped_omega: Four = NO_FOUR
    undamped_dV: Four = NO_FOUR
    omega_minus: float | None = None
    omega_plus: float | None = None
    tau: float | None = None
    omega_minus_stderr: float | None = None
    omega_plus_stderr: float | None = None
    tau_stderr: float | None = None
    residual: float | None = None
    ratio_V: float | None = None
    ratio_S: float | None = None
    ratio_H: float | None = None
    ratio_W: float | None = None
    V_omega_minus: float | None = None
    V_omega_plus: float | None = None
    V_tau: float | None = None
    V_residual: float | None = None
    three_omega: Four = NO_THREE
    three_tau: float | None = None
    three_residual: float | None = None
    one_omega: float | None = None
    one_tau: float | None = None
    V_settled: float | None = None
    S_settled: float | None = None
    t_dip: float | None = None
    window_start: float | None = None
    window_end: float | None = None
    turnings: int | None = None
    v_pole: float | None = None
    v_pole_ring: float | None = None
    omega_sphere: float | None = None
    prefactor: float | None = None
    radial_omega: float | None = None
    radial_prefactor: float | None = None
    symmetry: str = ""
    growth: float | None = None
    azimuth_omega: Four = NO_FOUR
    azimuth_tau: Four = NO_FOUR

    def with_rest(self, state: RestShape) -> "Findings":
        """With the numbers of a rest state that was found."""
        V, S, P = (float(np.asarray(value)) for value in (state.volume, state.area, state.pressure))
        return dataclasses.replace(
            self, V_e=V, S_e=S, P_e=P, V_e_over_V0=V / SPHERE_VOLUME, S_e_over_S0=S / SPHERE_AREA
        )

    def with_modes(self, damped: Modes, undamped: Modes) -> "Findings":
        """With the modes that converged."""
        return dataclasses.replace(
            self,
            modes_omega=_sound(damped.omega, damped),
            modes_tau=_sound(damped.tau, damped, Outcome.OVERDAMPED),
            modes_dV=_sound(damped.dV, damped),
            modes_dS=_sound(damped.dS, damped),
            undamped_omega=_sound(undamped.omega, undamped),
            undamped_dV=_sound(undamped.dV, undamped),
        )

    def with_symmetry(self, found: Roundness) -> "Findings":
        """With what was computed about the roundness of the rest shape."""
        computed = int(found.stability.outcome) == Outcome.OK
        return dataclasses.replace(self, symmetry=found.verdict, growth=found.growth if computed else None)

    def with_azimuth(self, found: OrderModes) -> "Findings":
        """With the slowest vibration of each order around the axis that converged and does not grow."""
        slowest = lambda values: tuple(finite(values[k, 0]) if k < values.shape[0] else None for k in range(MODES))  # noqa: E731
        grows = np.isnan(np.asarray(found.omega))
        return dataclasses.replace(
            self,
            azimuth_omega=slowest(np.asarray(found.omega)),
            azimuth_tau=slowest(np.where(grows, np.nan, np.asarray(found.tau))),
        )

    def facts(self) -> dict[str, Any]:
        """Field to value, as kept in files."""
        return told_when_asked(self, LATER)

    def with_record(self, trace: Trace, start: float | None) -> "Findings":
        """With what is extracted from a time on (by default after the snap's dip)."""
        from scipy.signal import find_peaks  # here: it is slow to load, and few need it

        together, alone = extract(trace, EXTRACTED, start=start), extract(trace, "V", start=start)
        times, V, v = (np.asarray(values, dtype=float) for values in (trace.times, trace["V"], trace["v_front"]))
        begin = together.window[0] if start is None else start
        ring = times >= begin
        after = V[times >= (together.t_dip if start is None else start)]
        found = dataclasses.replace(
            self,
            heard=together.outcome.word,
            reason=self.reason or together.reason,
            t_dip=together.t_dip if start is None else None,
            turnings=sum(find_peaks(sign * after, prominence=SWING * SPHERE_VOLUME)[0].size for sign in (1, -1)),
            v_pole=float(np.max(np.abs(v))),
            v_pole_ring=float(np.max(np.abs(v[ring]))) if np.any(ring) else None,
        )
        if alone.outcome == Outcome.OK:
            one = alone.fits[0]
            sound = one.converged and np.all(np.isfinite([one.omega[0], one.tau]))
            sphere = self.omega_sphere if sound else None
            found = dataclasses.replace(
                found,
                V_omega_minus=alone.omega_minus,
                V_omega_plus=alone.omega_plus,
                V_tau=alone.tau,
                V_residual=alone.residual,
                one_omega=float(one.omega[0]) if sound else None,
                one_tau=float(one.tau) if sound else None,
                prefactor=None if sphere is None else float(one.omega[0]) / sphere,
            )
        if together.outcome != Outcome.OK:
            return found
        three, ratio, error = together.fits[2], together.amplitude_ratio, together.stderr
        return dataclasses.replace(
            found,
            verdict=together.verdict or "",
            omega_minus=together.omega_minus,
            omega_plus=together.omega_plus,
            tau=together.tau,
            omega_minus_stderr=finite(error["omega_minus"]),
            omega_plus_stderr=finite(error["omega_plus"]),
            tau_stderr=finite(error["tau"]),
            residual=together.residual,
            **{f"ratio_{name}": finite(ratio[name]) for name in EXTRACTED},
            three_omega=tuple(finite(value) for value in three.omega) if three.converged else NO_THREE,
            three_tau=finite(three.tau) if three.converged else None,
            three_residual=finite(three.residual) if three.converged else None,
            V_settled=together.offsets["V"],
            S_settled=together.offsets["S"],
            window_start=together.window[0],
            window_end=together.window[1],
        )

    def with_radial(self, trace: Trace) -> "Findings":
        """With what is extracted from the motion of a sphere that can only breathe."""
        found = extract(trace, "V", start=0.0)
        if found.outcome != Outcome.OK or not found.fits[0].converged or self.omega_sphere is None:
            return self
        omega = float(found.fits[0].omega[0])
        return dataclasses.replace(self, radial_omega=omega, radial_prefactor=omega / self.omega_sphere)

    def cells(self) -> dict[str, Any]:
        """Column to value: four modes are four columns, `modes_omega_1` to `modes_omega_4`."""
        row: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, tuple):
                row |= {f"{field.name}_{k + 1}": item for k, item in enumerate(value)}
            else:
                row[field.name] = value
        return row


def finite(value: Any) -> float | None:
    """A number, or None where it is none."""
    return float(value) if value is not None and math.isfinite(float(value)) else None


def _sound(values: Any, found: Modes, *also: Outcome) -> Four:
    """The values of the modes that are ok, or that ended in another way in which this number has its meaning."""
    good = np.isin(np.asarray(found.outcome), (Outcome.OK, *also))
    numbers = np.asarray(values)
    return tuple(finite(numbers[k]) if k < good.size and good[k] else None for k in range(MODES))

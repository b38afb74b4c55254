"""What is told of vibrations of orders m >= 1: frequencies, and what a recording sees of them.

Symbols    ω = |s| frequency [1/time]   τ decay time   H, W height and width of the outline [R0]
Source     `jshell.dynamics.azimuthal`
"""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.errors import Outcome
from jshell.membrane import RestShape

GROUND = 1e-7  # of a squared rate: slower is rounding


@dataclass(frozen=True)
class OrderMode:
    """One mode of one order as a table shows it; None where there is nothing to say.

    Attributes:
        azimuth, mode: m, and its number within that order, from 1.
        omega, Omega: |s| and Im s [1/time]; None where it grows.
        tau: Decay time [time]; None without loss or where it grows.
        growth: Rate at which it grows [1/time], or None.
        dH, dW: Change of height (of m >= 1 twice a period) and of width of the outline; vᵀM v = 1 [R0].
        outcome: `ok`, or why there is nothing.
        seen: What of a recording sees it: V, S, H, W, the outline.
        dV, dS: Change of volume [R0³] and area [R0²]; zero to first order for m >= 1.
    """

    azimuth: int
    mode: int
    omega: float | None
    Omega: float | None
    tau: float | None
    growth: float | None
    dH: float | None
    dW: float | None
    outcome: str
    seen: str = ""
    dV: float | None = 0.0
    dS: float | None = 0.0


class OrderModes(eqx.Module):
    """Vibrations of several orders, slowest first; arrays are (orders, modes).

    Attributes:
        orders: (orders,) m.
        omega: Frequency |s|; NaN where the motion grows instead [1/time].
        Omega: Damped frequency Im s [1/time].
        tau: Decay time -1/Re s; infinite without loss, negative where the motion grows [time].
        rate: Complex rate s [1/time].
        dH, dW: Change of height and width of the outline seen across the axis, along the mode with vᵀM v = 1: W by the
            best azimuth; H twice a period, since a ring that tilts is higher on one side. Zero for odd m and W [R0].
        shapes: (orders, modes, motions) motions (a, b + c, b - c).
        outcome: Integer of `Outcome`: ok; not_converged where a root was lost; or how the rest shape ended.
        rest: The shape they are vibrations of.
    """

    orders: Int[Array, "orders"]
    omega: Float[Array, "orders modes"]
    Omega: Float[Array, "orders modes"]
    tau: Float[Array, "orders modes"]
    rate: Complex[Array, "orders modes"]
    dH: Float[Array, "orders modes"]
    dW: Float[Array, "orders modes"]
    shapes: Complex[Array, "orders modes motions"]
    outcome: Int[Array, "orders modes"]
    rest: RestShape

    @readable
    def __repr__(self) -> str:
        lines = [
            f"m = {int(m)}: ω {number(omega, FREQUENCY)}, τ {number(tau, TIME)}"
            for m, omega, tau in zip(self.orders, self.omega, self.tau, strict=True)
        ]
        return shown(self, *lines, ended(self.outcome))

    def table(self) -> tuple[OrderMode, ...]:
        """The modes as rows of plain numbers, by orders."""
        finite = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        rows = []
        for i, m in enumerate(np.asarray(self.orders).tolist()):
            for k in range(self.omega.shape[1]):
                real = float(jnp.real(self.rate[i, k]))
                grows = real > GROUND
                measured = (finite(part[i, k]) for part in (self.omega, self.Omega, self.tau, self.dH, self.dW))
                omega, Omega, tau, dH, dW = measured
                tau, growth = (None, real) if grows else (tau, None)
                word = Outcome(int(self.outcome[i, k])).word
                rows.append(OrderMode(m, k + 1, omega, Omega, tau, growth, dH, dW, word, seen_by(m)))
        return tuple(rows)


def seen_by(azimuth: int) -> str:
    """What of a recording sees a vibration of an order to first order; its sum over the azimuth is zero for m >= 1."""
    if azimuth == 0:
        return "V, S, H, W, outline"
    if azimuth == 1:
        return "outline sideways; H twice a period"
    return f"outline{', W' if azimuth % 2 == 0 else ''}; H twice a period"

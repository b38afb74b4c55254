"""Small vibrations of a shell about its rest shape.

A shell in a liquid at rest rings with complex rates s and shapes v,

    (K + s Z(s)) v = 0,   s = -1/τ + iΩ ,

Z the impedance of the liquid, exact at any viscosity or by orders of a thin
Stokes layer, and of a wall that loses energy itself. Modes are numbered as the undamped ones they are followed from.

Symbols    ω = |s| intrinsic frequency   Ω damped frequency   τ decay time   dV, dS mode's change of V and S
Valid for  small amplitude; `second` and `layer` for a layer thin against the shell
Source     Mokbel et al. 2021: ω² = Ω² + 1/τ²; `jshell.flow` for the liquids, `roots` for how they are found
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from jshell.contour import area, volume
from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.dynamics.roots import Liquid, Roots, ShellMatrices, matrices, roots
from jshell.errors import Outcome
from jshell.membrane import RestShape, WallLoss
from jshell.membrane.energy import Area
from jshell.shell.parameters import Reduced
from jshell.undetermined import undetermined

RESIDUAL = 1e-8
SAME_ROOT = 1e-6  # relative
LOSSLESS = 1e-12  # a decay slower than this against |s| is none
OSCILLATES = 0.2  # Im s over |s|: below it a mode falls to 4e-14 within what would be one period


@dataclass(frozen=True)
class Mode:
    """One mode as a table shows it; None where its outcome leaves nothing to say.

    Attributes:
        mode: Its number, from 1.
        omega, Omega: |s| and Im s [1/time]; None for an overdamped mode.
        tau: Decay time [time]; None without loss.
        dV, dS: Change of volume [R0³] and area [R0²] along it, vᵀM v = 1.
        outcome: `ok`, `overdamped`, or why there is nothing.
    """

    mode: int
    omega: float | None
    Omega: float | None
    tau: float | None
    dV: float | None
    dS: float | None
    outcome: str


class Modes(eqx.Module):
    """Small vibrations, numbered from the slowest of the undamped ones; arrays are (modes,).

    Attributes:
        omega: Intrinsic frequency |s|, ω² = Ω² + 1/τ²; NaN where nothing oscillates [1/time].
        Omega: Damped frequency Im s; NaN where nothing oscillates [1/time].
        tau: Decay time -1/Re s; infinite without loss [time].
        dV, dS: Change of volume [R0³] and area [R0²] along the mode, vᵀM v = 1, dV >= 0.
        shapes: (modes, coordinates) the mode itself, complex where there is loss.
        rate: Complex rate s = -1/τ + iΩ [1/time].
        outcome: Integer of `Outcome` per mode: ok; overdamped where Im s < 0.2 |s|: what moves there creeps back,
            at about 1/τ, and has no frequency; not_converged where a root was lost, or how the rest shape ended:
            all numbers are NaN then.
        rest: The shape they are vibrations of.
    """

    omega: Float[Array, "modes"]
    Omega: Float[Array, "modes"]
    tau: Float[Array, "modes"]
    dV: Float[Array, "modes"]
    dS: Float[Array, "modes"]
    shapes: Complex[Array, "modes coordinates"]
    rate: Complex[Array, "modes"]
    outcome: Int[Array, "modes"]
    rest: RestShape

    @readable
    def __repr__(self) -> str:
        return shown(
            self,
            f"ω {number(self.omega, FREQUENCY)}",
            f"τ {number(self.tau, TIME)}",
            f"dV {number(self.dV, 'R0³')}",
            ended(self.outcome),
        )

    def table(self) -> tuple[Mode, ...]:
        """The modes as rows of plain numbers."""
        rows = []
        for k, outcome in enumerate(np.asarray(self.outcome).tolist(), 1):
            word = Outcome(outcome).word
            if outcome not in (Outcome.OK, Outcome.OVERDAMPED):
                rows.append(Mode(k, None, None, None, None, None, word))
                continue
            measured = (self.omega, self.Omega, self.tau, self.dV, self.dS)
            omega, Omega, tau, dV, dS = (x if np.isfinite(x := float(part[k - 1])) else None for part in measured)
            rows.append(Mode(k, omega, Omega, tau, dV, dS, word))
        return tuple(rows)


@eqx.filter_jit
def vibrations(
    state: RestShape, conditions: Reduced, count: int, liquid: Liquid | str, area: Area | str,
    loss: WallLoss | None = None,
) -> Modes:  # fmt: skip
    """Small vibrations about a given rest shape."""
    parts = matrices(state, conditions, liquid, area, loss)
    viscosity = jnp.zeros(()) if liquid == "ideal" else conditions.viscosity
    found = roots(parts, viscosity, count)
    # two paths that ended on one root: one of the modes was lost
    size = jnp.abs(found.s)
    apart = jnp.abs(found.s[:, None] - found.s[None]) + jnp.eye(count) * size[:, None]
    doubled = jnp.min(apart, axis=1) < SAME_ROOT * size
    return _measure(state, parts, found._replace(residual=jnp.where(doubled, jnp.inf, found.residual)))


def _measure(state: RestShape, parts: ShellMatrices, found: Roots) -> Modes:
    shape, q, s, v = state.meridian, state.coordinates, found.s, found.vectors
    slope_V = shape.free(jax.grad(lambda q: volume(shape, q))(q))
    slope_S = shape.free(jax.grad(lambda q: area(shape, q))(q))

    size = jnp.sqrt(jnp.abs(jnp.sum(v.conj() * (v @ parts.M.T), axis=1)))
    v = v / size[:, None]
    dV = v @ slope_V
    phase = jnp.where(jnp.abs(dV) > 1e-12, dV / jnp.abs(dV), 1.0)
    v = v / phase[:, None]

    creeps = ~(jnp.imag(s) > OSCILLATES * jnp.abs(s))
    lost = ~(found.residual < RESIDUAL) | ~(jnp.imag(s) > 0)
    outcome = jnp.where(creeps, Outcome.OVERDAMPED, Outcome.OK)
    outcome = jnp.where(lost, Outcome.NOT_CONVERGED, outcome)
    outcome = jnp.where(state.outcome != Outcome.OK, state.outcome, outcome)
    decays = -jnp.real(s) > LOSSLESS * jnp.abs(s)
    tau = jnp.where(decays, -1 / jnp.where(decays, jnp.real(s), -1.0), jnp.inf)
    whole = jnp.zeros((s.shape[0], q.shape[0]), complex).at[:, shape.active].set(v)
    nothing = (outcome != Outcome.OK) & (outcome != Outcome.OVERDAMPED)
    omega, Omega = undetermined(creeps | nothing, (jnp.abs(s), jnp.imag(s)))
    numbers = tau, jnp.real(v @ slope_V), jnp.real(v @ slope_S), whole, s
    tau, dV, dS, shapes, rate = undetermined(nothing, numbers)
    return Modes(omega, Omega, tau, dV, dS, shapes, rate, outcome, state)

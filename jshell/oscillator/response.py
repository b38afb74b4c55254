"""Steady answers to a tone: response curves and bifurcation diagrams.

A response curve follows one periodic orbit through the drive's angular frequencies, by
Newton on the map of one period; the eigenvalues of that map say whether the
orbit is stable. A bifurcation diagram lets many amplitudes run at once and
looks at them once a period.

Symbols    ω angular frequency of the drive [1/time]   A amplitude [E d/R0]   ΔV volume from rest [R0³]
Valid for  a shell that stays buckled; lanes that leave that state say so
Source     shooting: Nayfeh & Balachandran 1995, chapter 3
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int

from jshell.errors import BadValue, Outcome
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.drag import VISCOUS, Drag
from jshell.oscillator.drive import _ENDED, _as_arrays
from jshell.oscillator.fixed import DIVERGED, march, rk4
from jshell.oscillator.linear import matrices
from jshell.oscillator.motion import Driven
from jshell.oscillator.simulate import is_buckled
from jshell.oscillator.unbuckling import unbuckling_volume
from jshell.pressure import Tone
from jshell.renamed import renamed_arguments, renamed_attribute
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state

STEPS = 96  # a period: 4e-8 of the motion by the fourth-order rule
NEWTON = 12
CLOSED = 1e-9


class Bifurcation(eqx.Module):
    """What is left of each amplitude after its transients, once a period.

    Attributes:
        amplitudes: (lanes,) of the drive.
        volume: (kept, lanes) ΔV once a period; NaN where the motion ended.
        outcome: (lanes,) integers of `Outcome`.
        ended: (lanes,) when the motion ended, infinite where it did not.
        period: (lanes,) drive periods after which the answer repeats: 1, 2, 4, …; 0 where it does not within 8.
    """

    amplitudes: Float[Array, " lanes"]
    volume: Float[Array, "kept lanes"]
    outcome: Int[Array, " lanes"]
    ended: Float[Array, " lanes"]
    period: Int[Array, " lanes"]


class Strobe(NamedTuple):
    """How an answer is looked at once a period.

    Attributes:
        periods: How long each motion runs.
        keep: Periods kept at the end.
        steps: Fixed steps a period.
    """

    periods: int = 200
    keep: int = 50
    steps: int = STEPS


@renamed_arguments(pulsation="angular_frequency")
def bifurcation(
    conditions: Reduced,
    coefficients: Coefficients,
    amplitudes: Any,
    angular_frequency: float,
    *,
    drag: Drag = VISCOUS,
    equilibrium: RestState | None = None,
    **strobe: int,
) -> Bifurcation:
    """The answers to a tone of many amplitudes, each from rest, all in one fixed-step run.

    Args:
        conditions: The shell and its steady load.
        coefficients: Constants of the short model.
        amplitudes: (lanes,) of the tone [E d/R0].
        angular_frequency: Of the tone [1/time].
        drag: What takes energy away.
        equilibrium: Rest state; None takes it from the plateau law.
        strobe: periods (200) that each runs, those to keep (50) at the end, steps (96) a period; see `Strobe`.

    Raises:
        BadValue: More periods kept than run; amplitudes that are not finite.
    """
    A, seen = jnp.asarray(amplitudes, dtype=float), Strobe(**strobe)
    if not 0 < seen.keep <= seen.periods or A.ndim != 1 or not np.all(np.isfinite(np.asarray(A))):
        raise BadValue(
            "amplitudes, keep",
            found=f"shape {A.shape}, {seen.keep} of {seen.periods}",
            expected="a list of finite amplitudes, and 1 to `periods` kept",
            remedy="Check them.",
        )
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    given = _as_arrays((conditions, coefficients, state, drag))
    return _strobe(given, A, jnp.asarray(angular_frequency, float), seen)


@eqx.filter_jit
def _strobe(given: Any, A: jax.Array, angular_frequency: jax.Array, seen: Strobe) -> Bifurcation:
    conditions, coefficients, state, drag = given
    state = RestState(*state)
    driven = Driven(conditions, coefficients, state, drag, Tone(A, angular_frequency))
    start = jax.tree.map(lambda part: jnp.broadcast_to(part, A.shape), driven.begin())
    periods, keep, steps = seen
    step = 2 * jnp.pi / angular_frequency / steps
    run = march(
        driven, start, jnp.asarray(0.0), step, periods, steps, unbuckling_volume(conditions, coefficients, state)
    )
    outcome = jnp.asarray(_ENDED)[jnp.where(run.ending < 0, DIVERGED + 1, run.ending)]
    outcome = jnp.where(is_buckled(state), outcome, int(Outcome.NO_BUCKLED_STATE))
    alive = run.ending < 0
    volume = jnp.where(alive, run.motion.V[-keep:] - state.volume, jnp.nan)
    return Bifurcation(A, volume, outcome, run.ended, jnp.where(alive, _period_of(volume), 0))


def _period_of(volume: Float[Array, "kept lanes"]) -> Int[Array, " lanes"]:
    """Smallest of 1, 2, 4, 8 periods after which the strobed volume repeats to a thousandth of its size."""
    size = jnp.max(jnp.abs(volume), axis=0) + 1e-12
    found = jnp.zeros(volume.shape[1], int)
    for repeat in (8, 4, 2, 1):
        if repeat < volume.shape[0]:
            gap = jnp.max(jnp.abs(volume[repeat:] - volume[:-repeat])[-16:], axis=0)
            found = jnp.where(gap < 1e-3 * size, repeat, found)
    return found


class ResponseCurve(eqx.Module):
    """Periodic orbits along a sweep of the angular frequency.

    Attributes:
        angular_frequencies: (points,) in the order of the sweep.
        volume: (points, samples) ΔV over one period.
        harmonics: (points, orders) amplitudes of ΔV at 0 (mean), 1, 2, 3 times the drive.
        scattered: (points, orders) the same of the scattered pressure times distance, V̈/4π.
        multiplier: (points,) largest eigenvalue of the map of one period, by size; above 1 is unstable.
        outcome: (points,) ok, not_converged, or no_buckled_state (the orbit leaves the buckled state).
        drive: Amplitude of the tone.
    """

    angular_frequencies: Float[Array, " points"]
    volume: Float[Array, "points samples"]
    harmonics: Float[Array, "points 4"]
    scattered: Float[Array, "points 4"]
    multiplier: Float[Array, " points"]
    outcome: Int[Array, " points"]
    drive: Float[Array, ""]

    @property
    def amplitude(self) -> Float[Array, " points"]:
        """Half the distance between highest and lowest volume."""
        return (jnp.max(self.volume, axis=1) - jnp.min(self.volume, axis=1)) / 2

    pulsations = renamed_attribute("pulsations", "angular_frequencies")


@renamed_arguments(pulsations="angular_frequencies")
def response_curve(
    conditions: Reduced,
    coefficients: Coefficients,
    amplitude: float,
    angular_frequencies: Any,
    *,
    drag: Drag = VISCOUS,
    steps: int = STEPS,
    equilibrium: RestState | None = None,
) -> ResponseCurve:
    """The periodic answer to a tone, followed through its angular frequencies in the order given.

    Each orbit starts from the one before, the first from the linear answer; so
    sweeps up and down part where the answer folds.

    Args:
        conditions: The shell and its steady load.
        coefficients: Constants of the short model.
        amplitude: Of the tone [E d/R0].
        angular_frequencies: (points,) of the tone [1/time].
        drag: What takes energy away.
        steps: Fixed steps a period.
        equilibrium: Rest state; None takes it from the plateau law.
    """
    w = jnp.asarray(angular_frequencies, dtype=float)
    if w.ndim != 1 or not np.all(np.asarray(w) > 0):
        raise BadValue(
            "angular_frequencies", found="not a list above 0", expected="(points,) above 0", remedy="Check them."
        )
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    given = _as_arrays((conditions, coefficients, state, drag))
    return _sweep(given, jnp.asarray(amplitude, float), w, steps)


@eqx.filter_jit
def _sweep(given: Any, amplitude: jax.Array, angular_frequencies: jax.Array, steps: int) -> ResponseCurve:
    conditions, coefficients, state, drag = given
    state = RestState(*state)
    whole = lambda w: Driven(conditions, coefficients, state, drag, Tone(amplitude, w))  # noqa: E731
    rest, unravel = ravel_pytree(whole(angular_frequencies[0]).begin())
    limit = unbuckling_volume(conditions, coefficients, state)

    def period(y: jax.Array, w: jax.Array) -> tuple[jax.Array, jax.Array]:
        driven, h = whole(w), 2 * jnp.pi / w / steps

        def advance(y, k):
            rate = driven.rate(k * h, unravel(y))
            new = rk4(driven.rate, k * h, unravel(y), h)
            return ravel_pytree(new)[0], jnp.stack([y[0] - state.volume, rate.dV])

        return jax.lax.scan(advance, y, jnp.arange(steps))

    def follow(y, w):
        def newton(carry):
            y, _, count = carry
            end, J = _value_and_slopes(lambda y: period(y, w)[0], y)
            gap = end - y
            moved = jnp.linalg.solve(J - jnp.eye(y.size), gap)
            shorten = jnp.minimum(1.0, 0.5 / jnp.maximum(jnp.max(jnp.abs(moved)), 1e-300))
            return y - shorten * moved, jnp.max(jnp.abs(gap)), count + 1

        open_still = lambda carry: (carry[1] > CLOSED) & (carry[2] < NEWTON)  # noqa: E731
        found, gap, _ = jax.lax.while_loop(open_still, newton, (y, jnp.asarray(jnp.inf), 0))
        monodromy = _value_and_slopes(lambda y: period(y, w)[0], found)[1]
        _, orbit = period(found, w)
        closed = (gap <= CLOSED) & jnp.all(jnp.isfinite(found))
        inside = jnp.max(orbit[:, 0]) < limit - state.volume
        size = jnp.max(jnp.abs(jnp.linalg.eigvals(monodromy)))
        lines = jnp.fft.rfft(orbit, axis=0)[:4] / steps * jnp.array([1.0, 2.0, 2.0, 2.0])[:, None]
        next_start = jnp.where(closed, found, y)
        return next_start, (orbit[:, 0], jnp.abs(lines), size, closed, inside)

    system = matrices(coefficients, state, conditions)
    s = 1j * angular_frequencies[0]
    pushforward = jnp.array([-amplitude, 0.0]) / 1j + 0j  # p = A sin ωt is the imaginary part; V feels -p
    linear = jnp.linalg.solve(system.stiffness + s * system.damping + s**2 * system.mass, pushforward * 1j)
    start = rest.at[:2].add(jnp.imag(linear)).at[2:4].add(jnp.imag(s * linear))
    _, (volume, lines, size, closed, inside) = jax.lax.scan(follow, start, angular_frequencies)
    scattered = lines[..., 1] / (4 * jnp.pi)
    outcome = jnp.where(inside, int(Outcome.OK), int(Outcome.NO_BUCKLED_STATE))
    outcome = jnp.where(closed, outcome, int(Outcome.NOT_CONVERGED))
    hide = lambda part: jnp.where(closed.reshape(-1, *(1,) * (part.ndim - 1)), part, jnp.nan)  # noqa: E731
    return ResponseCurve(
        angular_frequencies, hide(volume), hide(lines[..., 0]), hide(scattered), hide(size), outcome, amplitude
    )


def _value_and_slopes(function: Any, at: jax.Array) -> tuple[jax.Array, jax.Array]:
    """A map and its Jacobian in one forward sweep."""
    pushforward = lambda direction: jax.jvp(function, (at,), (direction,))  # noqa: E731
    return jax.vmap(pushforward, out_axes=(None, -1))(jnp.eye(at.size))

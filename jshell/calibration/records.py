"""Traces as a solver sees them: data, weights, conditions, rest state.

Symbols    V_e volume [R0³], P_e pressure [E d/R0] at rest   σ standard error per sample
"""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.calibration.agreement import refuse_rest
from jshell.calibration.data import weighted
from jshell.calibration.options import choices_of
from jshell.calibration.sampling import sampling
from jshell.errors import BadName, BadValue, RangeWarning
from jshell.oscillator.simulate import is_buckled
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state, gas_pressure
from jshell.trace import Trace

EQUILIBRIA = tuple(choices_of("equilibrium"))
REST_TOLERANCE = 0.01
CRUSHED = 1e-3 * SPHERE_VOLUME  # volume at rest below which nothing is left to oscillate: the walls touch long before


class Record(eqx.Module):
    """One trace, as the solver sees it.

    Attributes:
        elapsed: (times,) since the window's first sample.
        data: (channels, times).
        weight: (channels, times), one over σ.
        conditions: The problem.
        state: Rest state.
        channels: Their names.
        uniform: Whether the times are an even grid.
    """

    elapsed: np.ndarray | jax.Array
    data: np.ndarray | jax.Array
    weight: np.ndarray | jax.Array
    conditions: Reduced
    state: RestState
    channels: tuple[str, ...] = eqx.field(static=True)
    uniform: bool = eqx.field(static=True)


def rest_state(trace: Trace, offset: float | None, equilibrium: str, number: int) -> tuple[RestState, tuple[str, ...]]:
    """The rest state of a trace, and warnings.

    Args:
        trace: With conditions.
        offset: Volume the trace settles to, where it has one.
        equilibrium: `plateau` or `trace`.
        number: Of the trace, for messages.

    Raises:
        BadName: No channel V for the rest state of the trace.
        BadValue: No buckled state, or one without a volume.
        UnusableData: A trace that rests elsewhere.
    """
    conditions = trace.conditions
    assert conditions is not None
    texts = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RangeWarning)
        plateau = buckled_state(conditions)
    if equilibrium == "plateau":
        texts += [str(w.message) for w in caught]
    standing = bool(is_buckled(plateau))
    if equilibrium == "plateau" and not standing:
        raise BadValue(
            f"trace {number}",
            found="no buckled rest state by the plateau law at this load",
            expected="an outer pressure above the plateau",
            remedy=_remedy(conditions),
        )
    if standing and float(plateau.volume) < CRUSHED:
        raise BadValue(
            f"trace {number}",
            found=f"a rest volume of {float(plateau.volume):.3g} [R0³] by the plateau law: the load crushes the shell",
            expected=f"at least {CRUSHED:.3g}, a gas that holds against the outer pressure",
            remedy="Check both pressures and their units.",
        )
    if equilibrium == "trace" and offset is None:
        raise BadName(
            f"trace {number}",
            found="no channel V to read a rest volume from",
            expected="V among the channels",
            remedy='Use equilibrium="plateau".',
        )
    if offset is not None and standing:
        refuse_rest(offset, float(plateau.volume), np.asarray(trace["V"]), number)
        gap = offset / float(plateau.volume) - 1
        if abs(gap) > REST_TOLERANCE:
            texts.append(
                f"trace {number} rests at V = {offset:.5g}, {100 * gap:+.1f}% from the plateau law's "
                f"{float(plateau.volume):.5g}; the fit uses the {equilibrium}'s"
            )
    if equilibrium == "plateau":
        return plateau, tuple(texts)
    volume = jnp.asarray(offset)
    return RestState(volume, jnp.asarray(gas_pressure(volume, conditions))), tuple(texts)


def _remedy(conditions: Reduced) -> str:
    """What to try where the plateau law has no buckled state."""
    if float(conditions.outer_pressure) < float(conditions.gas_pressure):
        return "The outer pressure is below the gas's: is one of them a gauge pressure? Both are absolute."
    return 'Check the conditions, or take equilibrium="trace".'


def record(trace: Trace, channels: tuple[str, ...], state: RestState) -> Record:
    """A trace as the solver sees it."""
    taken = sampling(np.asarray(trace.times, dtype=float))
    data, weight = weighted(trace, channels)
    assert trace.conditions is not None
    # numbers of NumPy: what is done outside the solver then compiles nothing
    conditions, state = jax.tree.map(np.float64, (trace.conditions, state))
    elapsed = taken.times - taken.times[0]
    return Record(elapsed, data, weight, conditions, state, channels, taken.even)

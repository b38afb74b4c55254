"""The one place that asks diffrax to integrate a motion in time.

An adaptive Runge-Kutta method of order 8 with dense output of order 7; events
end a motion where a margin crosses zero, located by Newton's method on the
dense output. Diffrax takes long to load, and is loaded when it is first used.

Valid for  smooth right-hand sides; kinks are met by shorter steps
Source     Prince and Dormand 1981 (Dopri8), by diffrax
"""

import importlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypedDict

import jax
import jax.numpy as jnp

from jshell.errors import choose

# Order of accuracy in fixed steps of each method that diffrax has for us.
ORDERS = {"euler": 1, "midpoint": 2, "heun": 2, "bosh3": 3, "tsit5": 5, "dopri5": 5, "dopri8": 8}
_METHODS = {name: name.capitalize() for name in ORDERS}
# How a motion is differentiated: in reverse through checkpoints, or forward for Jacobians.
ADJOINTS = {"reverse": "RecursiveCheckpointAdjoint", "forward": "ForwardMode"}


class Adaptive(TypedDict, total=False):
    """Keywords of an adaptive solver that several doors share, see `adaptive`."""

    rtol: float
    atol: float
    adjoint: str


class Scheme(NamedTuple):
    """How a motion is integrated.

    Attributes:
        rtol, atol: Tolerances of the adaptive step.
        method: A key of `ORDERS`.
        step: Length of fixed steps; None is adaptive.
        adjoint: A key of `ADJOINTS`.
        event_tolerance: To which a margin's zero is located.
        most_steps: After which it gives up.
    """

    rtol: Any
    atol: Any
    method: str = "dopri8"
    step: float | None = None
    adjoint: str = "reverse"
    event_tolerance: float = 1e-11
    most_steps: int = 2**16


class Solution(NamedTuple):
    """A motion as far as it went.

    Attributes:
        samples: The state at the times asked for, on the first axis; beyond the end not to be read.
        last: The state where it ended; None where no margins were given.
        stop: When it ended.
        hit: (margins,) which margin ended it.
        worked: Whether it reached its last time or a margin.
        accepted, rejected: Steps.
    """

    samples: Any
    last: Any
    stop: jax.Array
    hit: jax.Array
    worked: jax.Array
    accepted: jax.Array
    rejected: jax.Array


def adaptive(rtol: float = 1e-9, atol: float = 1e-11, adjoint: str = "reverse") -> Scheme:
    """Adaptive steps as the doors take them, with the defaults that they share."""
    choose("adjoint", adjoint, ADJOINTS)
    return Scheme(rtol, atol, adjoint=adjoint)


def integrate(
    rate: Callable[[Any, Any, Any], Any],
    state: Any,
    times: jax.Array,
    options: Scheme,
    *,
    begin: Any = None,
    args: Any = None,
    margins: Sequence[Callable[[Any, Any, Any], Any]] | None = None,
) -> Solution:
    """Follow y' = rate(t, y, args) through all times.

    Args:
        rate: Time derivative of the state.
        state: Where it begins: an array or a tree of arrays.
        times: (times,) increasing; the samples wanted.
        options: How.
        begin: When it begins; None is the first time. Samples before it hold the start.
        args: Passed on to `rate` and `margins`.
        margins: Functions of (t, y, args) whose zero ends the motion; none, but the last state wanted: an empty list.
    """
    diffrax = importlib.import_module("diffrax")
    start, wanted = (times[0], times) if begin is None else (begin, jnp.maximum(times, begin))
    saved, event = diffrax.SaveAt(ts=wanted), None
    if margins is not None:
        saved = diffrax.SaveAt(subs=[diffrax.SubSaveAt(ts=wanted), diffrax.SubSaveAt(t1=True)])
    if margins:
        event = diffrax.Event([_called(margin) for margin in margins], _newton(options.event_tolerance))
    control = diffrax.ConstantStepSize()
    if options.step is None:
        control = diffrax.PIDController(rtol=options.rtol, atol=options.atol)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        getattr(diffrax, _METHODS[options.method])(),
        t0=start,
        t1=times[-1],
        dt0=options.step,
        y0=state,
        args=args,
        saveat=saved,
        stepsize_controller=control,
        event=event,
        adjoint=getattr(diffrax, ADJOINTS[options.adjoint])(),
        max_steps=options.most_steps,
        throw=False,
    )
    worked = solution.result == diffrax.RESULTS.successful
    hit, stop, samples, last = jnp.zeros(0, bool), times[-1], solution.ys, None
    if margins is not None:
        samples, last = solution.ys
        last = jax.tree.map(lambda part: part[-1], last)
    if margins:
        worked = worked | (solution.result == diffrax.RESULTS.event_occurred)
        hit = jnp.stack([jnp.asarray(mask) for mask in jax.tree.leaves(solution.event_mask)])
        stop = jnp.where(jnp.any(hit), solution.ts[1][-1], times[-1])
    steps = (solution.stats["num_accepted_steps"], solution.stats["num_rejected_steps"])
    return Solution(samples, last, stop, hit, worked, *steps)


def _called(margin: Callable[[Any, Any, Any], Any]) -> Callable[..., Any]:
    """A margin as diffrax calls an event: with more keywords than it needs."""
    return lambda t, y, args, **_: margin(t, y, args)


def _newton(tolerance: float) -> Any:
    """Newton's method to a tolerance, by the root mean square."""
    optimistix = importlib.import_module("optimistix")
    return optimistix.Newton(tolerance, tolerance, optimistix.rms_norm)

"""Nonlinear least squares: Levenberg–Marquardt with bounds, from many starts at once.

Made for few unknowns and exact Jacobians. A step that would leave the bounds
is cut at them; an unknown that rests on a bound and is pushed outwards waits.
Nothing is thrown: every start ends with an `Outcome`.

Symbols    u unknowns   r residual   J = ∂r/∂u   λ damping of the step
Source     Nielsen 1999, "Damping parameter in Marquardt's method", for λ;
           Transtrum & Sethna 2012, arXiv:1201.5885, for bent steps
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypedDict, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jshell.errors import Outcome
from jshell.renamed import renamed

RUNNING = -1


class SolverResult(eqx.Module):
    """Where starts ended: a leading axis per start.

    Attributes:
        unknowns: The last accepted unknowns.
        cost: Sum of squared residuals there.
        outcome: Integers of `Outcome`.
        steps: Steps tried.
    """

    unknowns: Float[Array, "*starts free"]
    cost: Float[Array, "*starts"]
    outcome: Int[Array, "*starts"]
    steps: Int[Array, "*starts"]


def value_and_jacobian(function: Callable, at: Float[Array, " free"]) -> tuple[Any, Any]:
    """A function of arrays and its Jacobian (…, free) in one forward sweep."""
    pushforward = lambda direction: jax.jvp(function, (at,), (direction,))  # noqa: E731
    return jax.vmap(pushforward, out_axes=(None, -1))(jnp.eye(at.size))


class SearchOptions(TypedDict, total=False):
    """Keywords of `levenberg_marquardt`, which `from_many_starts` passes on.

    Attributes:
        max_steps: Most steps tried; 100.
        xtol: Converged when the undamped step moves no unknown by more than this part of its size; 1e-10.
        ftol: Converged when the undamped step promises less than this part of the cost; 1e-12.
        damping: Of the first step, relative to the squared lengths of the Jacobian's columns; 1e-3.
        bend: Bend steps along the residual's second derivative (geodesic acceleration): follows narrow curved
            valleys; the residual must allow reverse mode.
        condensed: The function gives rows of [J, r] instead, any with the QR factor of those of the data; no bends.
    """

    max_steps: int
    xtol: float
    ftol: float
    damping: float | Float[Array, ""]
    bend: bool
    condensed: bool


def _with_defaults(max_steps=100, xtol=1e-10, ftol=1e-12, damping: Any = 1e-3, bend=False, condensed=False):
    """The options with their defaults."""
    return max_steps, xtol, ftol, damping, bend, condensed


class _Descent(NamedTuple):
    """Where a search stands: what it has accepted, R and Qᵀr there; where it looks next, what that promises, and how it
    would end there if it did."""

    u: Any
    cost: Any
    R: Any
    q: Any
    scale: Any
    damping: Any
    growth: Any
    count: Any
    status: Any
    trial: Any
    promised: Any
    usable: Any
    next_status: Any


def _triangle(both: Float[Array, "rows columns"], free: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """From rows of [J, r]: cost, and J = QR as R and Qᵀr: orthogonal steps keep the digits that JᵀJ loses."""
    cost = both[:, -1] @ both[:, -1]
    usable = jnp.isfinite(cost) & jnp.all(jnp.isfinite(both))
    both = jnp.where(usable, both, 0.0)
    pad = jnp.zeros((max(0, free + 1 - both.shape[0]), free + 1))
    R = jnp.linalg.qr(jnp.concatenate([both, pad]), mode="r")
    return jnp.where(usable, cost, jnp.inf), R[:free, :free], R[:free, free]


def _begun(start: Float[Array, " free"], damping: Any) -> _Descent:
    """The residual stands once in the program: the start is the first trial, and is always taken."""
    zero, inf, none = jnp.asarray(0), jnp.asarray(jnp.inf), jnp.zeros(start.size)
    return _Descent(
        start, inf, jnp.zeros((start.size, start.size)), none, none, jnp.asarray(damping, float), jnp.asarray(2.0),
        zero - 1, zero + RUNNING, start, -inf, jnp.asarray(True), zero + RUNNING,
    )  # fmt: skip


def _judged(search: _Descent, seen: tuple, low, high, xtol, ftol, pulled: Callable | None = None) -> _Descent:
    """Judge the trial by what was seen there, then draw up the next one from where that leaves us."""
    u, cost, R, q, scale, damping, growth, count, _, trial, promised, usable, next_status = search
    new_cost, new_R, new_q = seen
    first = count < 0
    better = first | ((new_cost < cost) & usable)
    gain = (cost - new_cost) / jnp.where(promised > 0, promised, jnp.inf)
    eased = damping * jnp.maximum(1 / 3, 1 - (2 * gain - 1) ** 3)
    pick = lambda new, old: jnp.where(better, new, old)  # noqa: E731
    u, cost, R, q = pick(trial, u), pick(new_cost, cost), pick(new_R, R), pick(new_q, q)
    damping = jnp.where(first, damping, pick(jnp.maximum(eased, 1e-14), damping * growth))
    growth = jnp.where(first, growth, pick(2.0, 2 * growth))

    length = jnp.linalg.norm(R, axis=0)
    scale = jnp.maximum(scale, length)
    weight = jnp.where(scale > 0, scale, 1.0)
    g = R.T @ q
    held = ((u <= low) & (g > 0)) | ((u >= high) & (g < 0)) | (low == high)
    kept = jnp.where(held[None, :], 0.0, R) / weight[None, :]

    # damped and undamped step from the same singular values, the undamped one in directions that the data know
    left, s, right = jnp.linalg.svd(kept, full_matrices=False)
    share = left.T @ q
    straight = -(right.T @ (share * s / (s**2 + damping))) / weight
    curved, gentle = jnp.zeros(u.size), jnp.asarray(True)
    if pulled is not None:
        pullback = jnp.where(held, 0.0, pulled(u, straight)) / weight
        curved = -(right.T @ ((right @ pullback) / (s**2 + damping))) / weight
        gentle = jnp.linalg.norm(weight * curved) <= 0.75 * jnp.linalg.norm(weight * straight)
        curved = jnp.where(gentle, curved, 0.0)
    wanted = u + straight + curved / 2
    trial = jnp.clip(wanted, low, high)
    cut = jnp.any(trial != wanted)
    moved = trial - u
    ahead = R @ moved
    promised = -(2 * g @ moved + ahead @ ahead)

    known = s > 1e-14 * s[0]
    share = jnp.where(known, share, 0.0)
    undamped = right.T @ (share / jnp.where(known, s, 1.0)) / weight
    inside = jnp.all((u - undamped >= low) & (u - undamped <= high))
    still = jnp.all(jnp.abs(undamped) <= xtol * jnp.abs(u)) | jnp.all(jnp.abs(g) == 0)
    flat = share @ share <= ftol * cost

    # a step cut at a bound may promise nothing; shorter ones, nearer to the gradient, then do
    status = jnp.where(
        (still | flat) & (inside | ~cut), int(Outcome.OK), jnp.where(damping > 1e16, int(Outcome.STALLED), RUNNING)
    )
    # an unknown that once mattered and no longer does has run away to where the model is flat
    status = jnp.where(jnp.any(length < 1e-12 * scale) & (status != RUNNING), int(Outcome.STALLED), status)
    status = jnp.where(jnp.isfinite(cost), status, int(Outcome.NOT_FINITE))
    usable = ((promised > 0) | (pulled is not None)) & gentle
    return _Descent(u, cost, R, q, scale, damping, growth, count + 1, next_status, trial, promised, usable, status)


def _ended(search: _Descent, low, high) -> SolverResult:
    """Where a search stopped, and why."""
    u, status = search.u, jnp.where(search.status == RUNNING, int(Outcome.NOT_CONVERGED), search.status)
    on_bound = jnp.any(((u <= low) | (u >= high)) & (low < high))
    status = jnp.where((status == int(Outcome.OK)) & on_bound, int(Outcome.AT_BOUND), status)
    return SolverResult(u, search.cost, status, search.count)


def levenberg_marquardt(
    residual: Callable[[jax.Array], jax.Array],
    start: Float[Array, "*starts free"],
    low: Float[Array, " free"],
    high: Float[Array, " free"],
    **options: Unpack[SearchOptions],
) -> SolverResult:
    """Minimise the sum of squared residuals from one start, or from several at once.

    Whether it has converged is asked of the undamped step, never of the one
    taken: short steps under heavy damping are no minimum.

    Args:
        residual: Function of the unknowns.
        start: Where to begin, inside the bounds; one row per start where there are several.
        low: Lower bounds, -inf where there is none.
        high: Upper bounds, inf where there is none.
        options: How far and how, see `SearchOptions`.

    Returns:
        Outcome ok, at_bound, not_converged (out of steps), stalled (no step helps) or not_finite (at the start).
    """
    max_steps, xtol, ftol, damping, bend, condensed = _with_defaults(**options)
    free = start.shape[-1]

    def evaluate(u: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        if condensed:
            return _triangle(residual(u), free)
        r, J = value_and_jacobian(residual, u)
        return _triangle(jnp.concatenate([J, r[:, None]], axis=1), free)

    def pulled(u: jax.Array, straight: jax.Array) -> jax.Array:
        """Gradient of the residual against its second derivative along a step."""
        once = lambda x: jax.jvp(residual, (x,), (straight,))[1]  # noqa: E731
        twice = jax.jvp(once, (u,), (straight,))[1]
        return jax.vjp(residual, u)[1](twice)[0]

    def step(search: _Descent) -> _Descent:
        return _judged(search, evaluate(search.trial), low, high, xtol, ftol, pulled if bend else None)

    def running(search: _Descent) -> jax.Array:
        return (search.status == RUNNING) & (search.count < max_steps)

    begin = lambda start: _begun(start, damping)  # noqa: E731
    end = lambda search: _ended(search, low, high)  # noqa: E731
    if start.ndim == 1:
        return end(jax.lax.while_loop(running, step, begin(start)))

    # `vmap` of the loop would trace its body four times, to find which parts of the state differ from start to start
    def all_step(states):
        on = jax.vmap(running)(states)
        keep = lambda new, old: jnp.where(on.reshape(on.shape + (1,) * (new.ndim - 1)), new, old)  # noqa: E731
        return jax.tree.map(keep, jax.vmap(step)(states), states)

    states = jax.lax.while_loop(lambda states: jnp.any(jax.vmap(running)(states)), all_step, jax.vmap(begin)(start))
    return jax.vmap(end)(states)


def step_by_step(
    evaluate: Callable[[np.ndarray], np.ndarray],
    start: Float[np.ndarray, " free"],
    low: Float[np.ndarray, " free"],
    high: Float[np.ndarray, " free"],
    *,
    max_steps: int = 100,
    xtol: float = 1e-10,
    ftol: float = 1e-12,
) -> SolverResult:
    """The same search where the residual is no JAX function: one that runs programs of its own, or keeps what it saw.

    Args:
        evaluate: From the unknowns to (free + 1, free + 1) the triangular factor of [J, r], NaN where there is none.
        start, low, high, max_steps, xtol, ftol: As in `levenberg_marquardt`.
    """
    search = _start(start, 1e-3)
    while int(search.status) == RUNNING and int(search.count) < max_steps:
        search = _next(search, evaluate(np.asarray(search.trial)), low, high, xtol, ftol)
    return _end(search, low, high)


_start, _end = jax.jit(_begun), jax.jit(_ended)


@jax.jit
def _next(search: _Descent, both, low, high, xtol, ftol) -> _Descent:
    return _judged(search, _triangle(both, both.shape[1] - 1), low, high, xtol, ftol)


@eqx.filter_jit
def from_many_starts(
    residual: Callable[[jax.Array, Any], jax.Array],
    args: Any,
    starts: Float[Array, "starts free"],
    low: Float[Array, " free"],
    high: Float[Array, " free"],
    **options: Unpack[SearchOptions],
) -> SolverResult:
    """Minimise from every start; compiled once per shape.

    Args:
        residual: Module-level function of the unknowns and of `args`.
        args: Data, as a pytree.
        starts: One row per start.
        low: Lower bounds.
        high: Upper bounds.
        options: As in `levenberg_marquardt`; `condensed` starts go one after the other.
    """
    solve = lambda start: levenberg_marquardt(lambda u: residual(u, args), start, low, high, **options)  # noqa: E731
    return jax.lax.map(solve, starts) if options.get("condensed") else solve(starts)


def best_of(solution: SolverResult, size: float) -> tuple[int, np.ndarray]:
    """The start that ended lowest, and which starts ended as low.

    Args:
        solution: From `from_many_starts`.
        size: Sum of squares of the data as the residual weighs them, to tell zero from rounding.
    """
    cost = np.asarray(solution.cost)
    outcome = np.asarray(solution.outcome)
    ended = (outcome == Outcome.OK) | (outcome == Outcome.AT_BOUND)
    ranked = np.where(np.isfinite(cost), cost, np.inf)
    best = int(np.argmin(np.where(ended, ranked, np.inf))) if ended.any() else int(np.argmin(ranked))
    with np.errstate(invalid="ignore"):  # of starts that all ended nowhere
        same = ended & (ranked - ranked[best] <= 1e-7 * ranked[best] + 1e-16 * size)
    first = int(np.argmax(same)) if same.any() else best  # of equals the first, which comes from the data
    return first, same


__getattr__ = renamed(__name__, {"Ending": "SolverResult"})

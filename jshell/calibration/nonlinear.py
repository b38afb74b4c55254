"""The constants from large motions: many traces fitted at once by the nonlinear model.

Each trace has eight unknowns, four constants and its own initial state; its
volume and area follow the nonlinear equation of motion. The equation and its
eight tangents are integrated together, a batch of traces in the last axis, by
fixed steps (`rk4`) or trace by trace by the adaptive solver (`diffrax`).

Symbols    u = (ln α1, ln α2, k_VS, ln β1, ΔV, ΔS, ΔV̇, ΔṠ)   r weighted residual   J = ∂r/∂u   λ damping of the step
Valid for  V and S of buckled shells on one even grid of times; equal decay ties β2
Source     Mokbel et al. 2021: eq:Lag with eq:T, eq:Ug, eq:US, eq:D; Nielsen 1999 for λ
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jshell import integrator
from jshell.calibration.agreement import holder, rests_elsewhere
from jshell.calibration.data import conditions_of, refuse_missing, weighted, with_sigma
from jshell.calibration.least_squares import value_and_jacobian
from jshell.calibration.records import Record
from jshell.calibration.sampling import sampling
from jshell.calibration.starts import find_modes, strict_start
from jshell.errors import BadShape, BadValue, Outcome, RangeWarning, choose
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.fixed import rk4
from jshell.oscillator.motion import Driven
from jshell.shell.elasticity import SPHERE_AREA
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state
from jshell.trace import Trace, traces_of

SOLVERS = ("rk4", "diffrax")
CHANNELS = ("V", "S")
UNKNOWNS = 8
RESOLVED = 0.12  # ω₊ h of the fixed step: 1e-5 of the motion over ten periods
SETTLED = 1e-7  # share of χ² that the last step promises; of 800 samples it moves by a hundredth of σ, the rest less
HIDDEN = 1e-6  # share of χ² that the adaptive integrator's error hides: a thirtieth of σ
NOTHING = 1e-9  # the same of a record without noise, in σ²
UNDAMPED = 1e-8  # of the weights: as good as none, and the matrix stays positive
FRESH, RUNNING = -2, -1
WIDTH = MappingProxyType({"rk4": 128, "diffrax": 16})  # traces in flight: adaptive steps wait for each other
OPTIONS = integrator.Scheme(1e-8, 1e-10, adjoint="forward")


@dataclass(frozen=True)
class NonlinearFits:
    """Fits of many traces, a row each.

    Attributes:
        constants: (traces, 4) α1, α2, k_VS, β1; NaN where the outcome is not ok.
        stderr: (traces, 4) standard errors.
        initial: (traces, 4) ΔV, ΔS, ΔV̇, ΔṠ at the first sample.
        chi_square: (traces,) sum of squared weighted residuals.
        outcome: How each ended.
        steps: (traces,) steps tried.
        solver: Its name, and its step.
    """

    constants: np.ndarray
    stderr: np.ndarray
    initial: np.ndarray
    chi_square: np.ndarray
    outcome: tuple[Outcome, ...]
    steps: np.ndarray
    solver: str

    def coefficients(self, index: int) -> Coefficients:
        """The constants of one trace, β2 tied by equal decay."""
        alpha1, alpha2, k_vs, beta1 = (float(x) for x in self.constants[index])
        return Coefficients(alpha1, alpha2, k_vs, beta1)


class Lanes(eqx.Module):
    """Traces side by side, or one: data and 1/σ (2, times, traces), the problem and rest state of each."""

    data: Float[Array, "2 times *traces"]
    weight: Float[Array, "2 times *traces"]
    conditions: Reduced
    state: RestState
    step: Float[Array, ""]


def fit_nonlinear(traces: Trace | Sequence[Trace], *, solver: str = "rk4", max_steps: int = 40) -> NonlinearFits:
    """Fit the nonlinear model to V and S of many traces.

    Starts come from a matrix pencil through the linear model's equations.

    Args:
        traces: With conditions, channels V and S, all on one even grid of times.
        solver: `rk4`: fixed steps, all traces together; `diffrax`: adaptive steps.
        max_steps: Most steps tried.

    Returns:
        A row per trace. Errors are absolute where σ is given, else scaled by the reduced χ².
        Outcomes: ok; unusable_data (no two modes to start from, or at rest where the shell is not);
        no_buckled_state; not_converged; stalled; rank_deficient.

    Raises:
        BadName: No such solver; a channel that is missing.
        BadShape: Times that differ, or are not even.
        BadValue: A trace without conditions or viscosity, or with numbers that are not finite; σ of some traces and
            channels and not of others.
    """
    choose("solver", solver, SOLVERS)
    listed = traces_of(traces)
    absolute = with_sigma(listed, CHANNELS)
    times, data, weight = _read(listed)
    conditions = [trace.conditions for trace in listed if trace.conditions is not None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)
        shells = jax.tree.map(lambda *leaves: jnp.asarray(np.array([float(x) for x in leaves])), *conditions)
        state = jax.jit(buckled_state)(shells)
    starts, fastest = _starts(times, data, weight, conditions, state)

    # a record that rests where its shell cannot is of another shell
    elsewhere = rests_elsewhere(np.median(data[0], axis=0), np.asarray(state.volume))
    starts = np.where(elsewhere, np.nan, starts)
    usable = np.all(np.isfinite(starts), axis=0)
    spacing = float(times[-1] - times[0]) / (times.size - 1)
    substeps = max(1, int(np.ceil(spacing * fastest.max() / RESOLVED)))
    lanes = Lanes(jnp.asarray(data), jnp.asarray(weight), shells, state, jnp.asarray(spacing))
    safe = np.where(usable, starts, np.array([1.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0])[:, None])
    queue = jnp.asarray(np.argsort(fastest))  # side by side: traces that cost the adaptive solver as many steps
    ended = _descend(lanes, jnp.asarray(safe.T), queue, solver, substeps, max_steps)
    words = f"rk4, {substeps} steps a sample" if solver == "rk4" else "diffrax dopri8"
    return _result(jax.tree.map(np.asarray, ended), usable, np.asarray(state.volume), 2 * times.size, absolute, words)


def _read(traces: list[Trace]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Common times, data and weights (2, times, traces)."""
    times = sampling(np.asarray(traces[0].times, dtype=float)).times
    columns = []
    for number, trace in enumerate(traces, 1):
        if not float(conditions_of(trace, number).viscosity) > 0:
            raise BadValue(
                f"trace {number}",
                found="a viscosity of 0",
                expected="conditions with a viscosity, which beta1 multiplies",
                remedy="Build the trace with conditions=Reduced(…).",
            )
        holder(trace, number, inverted=True)
        mine = sampling(np.asarray(trace.times, dtype=float))
        if (
            mine.times.shape != times.shape
            or mine.times.size < 16
            or not mine.even
            or not np.allclose(mine.times - mine.times[0], times - times[0], rtol=1e-9, atol=1e-12)
        ):
            raise BadShape(
                f"trace {number}",
                found=f"{mine.times.size} times of its own",
                expected="one even grid of at least 16 times for all traces",
                remedy="Resample the traces, or fit them in groups.",
            )
        refuse_missing(trace, number, CHANNELS, remedy="Cut the trace.")
        columns.append(weighted(trace, CHANNELS))
    data, weight = (np.stack(part, axis=-1) for part in zip(*columns, strict=True))
    return times, data, weight


def _starts(times: np.ndarray, data: np.ndarray, weight: np.ndarray, conditions: list, state: RestState):
    """(unknowns, traces) from the modes of each trace, NaN where there are none; and the fastest ω of each."""
    elapsed = times - times[0]
    starts, fastest = np.full((UNKNOWNS, data.shape[2]), np.nan), np.ones(data.shape[2])
    V_e, P_e = (np.asarray(part) for part in state)
    for i, shell in enumerate(conditions):
        modes = find_modes(elapsed, data[:, :, i])
        if modes is None or not np.isfinite(V_e[i]):
            continue
        rest = RestState(V_e[i], P_e[i])
        one = Record(elapsed, data[:, :, i], weight[:, :, i], shell, rest, CHANNELS, True)
        alpha1, alpha2, k_vs, beta1 = strict_start([one], [modes], {})
        moves = np.real(modes.amplitudes.sum(axis=1)) + modes.offsets - np.array([V_e[i], SPHERE_AREA])
        rates = np.real((modes.amplitudes * modes.poles).sum(axis=1))
        starts[:, i] = [np.log(alpha1), np.log(alpha2), k_vs, np.log(max(beta1, 1e-3)), *moves, *rates]
        fastest[i] = max(1.0, float(np.abs(modes.poles).max()))
    return starts, fastest


def _driven(u: Any, lanes: Lanes) -> Driven:
    c = Coefficients(jnp.exp(u[0]), jnp.exp(u[1]), u[2], jnp.exp(u[3]))
    return Driven(lanes.conditions, c, lanes.state)


def _marched(u: Float[Array, "8 traces"], lanes: Lanes, substeps: int) -> Float[Array, "2 times traces"]:
    """V and S by fixed steps."""
    driven, h = _driven(u, lanes), lanes.step / substeps

    def sample(y, _):
        y, _ = jax.lax.scan(lambda y, _: (rk4(driven.rate, 0.0, y, h), None), y, None, length=substeps)
        return y, (y.V, y.S)

    start = driven.begin(tuple(u[4:]))
    _, (V, S) = jax.lax.scan(sample, start, None, length=lanes.data.shape[1] - 1)
    return jnp.stack([jnp.concatenate([start.V[None], V]), jnp.concatenate([start.S[None], S])])


def _residual(u: Float[Array, "8 traces"], lanes: Lanes, substeps: int) -> Float[Array, "2 times traces"]:
    return lanes.weight * (_marched(u, lanes, substeps) - lanes.data)


def _adaptive_residual(u: Float[Array, "8"], lane: Lanes) -> Float[Array, " data"]:
    """The same of one trace, by diffrax."""
    driven = _driven(u, lane)
    times = lane.step * jnp.arange(lane.data.shape[1])

    def field(t, y, args):
        rate = driven.rate(t, driven.begin()._replace(V=y[0], S=y[1], dV=y[2], dS=y[3]))
        return jnp.stack(rate[:4])

    found = integrator.integrate(field, jnp.stack(driven.begin(tuple(u[4:]))[:4]), times, OPTIONS)
    r = lane.weight * (jnp.asarray(found.samples)[:, :2].T - lane.data)
    return jnp.where(found.worked, r, jnp.nan).ravel()


def _evaluate(u: jax.Array, lanes: Lanes, solver: str, substeps: int):
    """Cost (traces,), gradient (traces, 8) and JᵀJ (traces, 8, 8); an infinite cost where the motion is none."""
    if solver == "rk4":
        function = lambda u: _residual(u, lanes, substeps)  # noqa: E731
        pushforward = lambda k: jax.jvp(function, (u,), (jnp.zeros_like(u).at[k].set(1.0),))  # noqa: E731
        r, J = jax.vmap(pushforward, out_axes=(None, 0))(jnp.arange(UNKNOWNS))
        cost = jnp.sum(r * r, axis=(0, 1))
        g = jnp.sum(J * r[None], axis=(1, 2)).T
        A = jnp.moveaxis(jnp.sum(J[:, None] * J[None], axis=(2, 3)), -1, 0)
    else:

        def one(
            u: jax.Array, data: jax.Array, weight: jax.Array, shell: Reduced, state: RestState
        ) -> tuple[jax.Array, jax.Array]:
            return value_and_jacobian(lambda u: _adaptive_residual(u, Lanes(data, weight, shell, state, lanes.step)), u)

        r, J = jax.vmap(one, in_axes=(1, 2, 2, 0, 0))(u, lanes.data, lanes.weight, lanes.conditions, lanes.state)
        cost, g, A = jnp.sum(r * r, axis=1), jnp.einsum("ldk,ld->lk", J, r), jnp.einsum("ldk,ldm->lkm", J, J)
    sound = jnp.isfinite(cost) & jnp.all(jnp.isfinite(A), axis=(1, 2))
    clean = lambda part: jnp.where(sound.reshape(-1, *(1,) * (part.ndim - 1)), part, 0.0)  # noqa: E731
    return jnp.where(sound, cost, jnp.inf), clean(g), clean(A)


class _LaneState(NamedTuple):
    """Where the descent of each lane stands: unknowns, χ², JᵀJ; where it looks next and what that promises."""

    u: Float[Array, "lanes 8"]
    cost: Float[Array, " lanes"]
    gradient: Float[Array, "lanes 8"]
    normal: Float[Array, "lanes 8 8"]
    scale: Float[Array, "lanes 8"]
    damping: Float[Array, " lanes"]
    growth: Float[Array, " lanes"]
    trial: Float[Array, "lanes 8"]
    promised: Float[Array, " lanes"]
    count: Int[Array, " lanes"]
    status: Int[Array, " lanes"]


class _Ended(NamedTuple):
    """Where the descent of each trace stopped."""

    u: Any
    cost: Any
    normal: Any
    status: Any
    count: Any


def _fresh(u: Float[Array, "lanes 8"]) -> _LaneState:
    """A descent that looks at its start next."""
    none, square = jnp.zeros_like(u), jnp.zeros((*u.shape, UNKNOWNS))
    like, whole = none[:, 0], jnp.zeros(len(u), int)
    endless = like + jnp.inf
    return _LaneState(u, endless, none, square, none, like + 1e-3, like + 2.0, u, endless, whole, whole + FRESH)


def _solve(A: Float[Array, "lanes 8 8"], damped: Float[Array, "lanes 8"], g: Float[Array, "lanes 8"]):
    """The damped step, and the fall of χ² that its quadratic model promises."""
    H = A + damped[:, :, None] * jnp.eye(UNKNOWNS)[None]
    moved = -jnp.linalg.solve(H, g[:, :, None])[:, :, 0]
    moved = jnp.where(jnp.isfinite(moved), moved, 0.0)
    return moved, -(2 * jnp.sum(g * moved, axis=1) + jnp.einsum("li,lij,lj->l", moved, A, moved))


def _improve(search: _LaneState, lanes: Lanes, solver: str, substeps: int, max_steps: int) -> _LaneState:
    """One step of Levenberg and Marquardt's method in every lane; the last, which promises next to nothing, unseen."""
    u, cost, g, A, scale, damping, growth, trial, promised, count, status = search
    fresh = status == FRESH
    new_cost, new_g, new_A = _evaluate(trial.T, lanes, solver, substeps)
    better = (new_cost < cost) & (promised > 0)
    pick = lambda new, old: jnp.where(better.reshape(-1, *(1,) * (new.ndim - 1)), new, old)  # noqa: E731
    gain = jnp.where(fresh, 0.5, (cost - new_cost) / jnp.where(promised > 0, promised, jnp.inf))
    eased = jnp.maximum(damping * jnp.maximum(1 / 3, 1 - (2 * gain - 1) ** 3), 1e-14)
    damping = jnp.where(better, eased, damping * growth)
    growth = jnp.where(better, 2.0, 2 * growth)
    u, cost, g, A = pick(trial, u), pick(new_cost, cost), pick(new_g, g), pick(new_A, A)

    scale = jnp.maximum(scale, jnp.diagonal(A, axis1=1, axis2=2))
    weight = jnp.where(scale > 0, scale, 1.0)
    moved, promised = _solve(A, damping[:, None] * weight, g)
    settled = better & (promised <= SETTLED * cost + NOTHING)
    # where no step helps, what an undamped one promises tells a minimum, known to the integrator's error, from a wall
    hidden = ~better & (_solve(A, UNDAMPED * weight, g)[1] <= HIDDEN * cost + NOTHING)
    short = (damping > 1e14) | jnp.all(jnp.abs(moved) <= 1e-9 * (0.1 + jnp.abs(u)), axis=1)
    count = count + ~fresh
    ended = jnp.where(count >= max_steps, int(Outcome.NOT_CONVERGED), RUNNING)
    ended = jnp.where(short, int(Outcome.STALLED), ended)
    ended = jnp.where(settled | hidden, int(Outcome.OK), ended)
    ended = jnp.where(jnp.isfinite(cost), ended, int(Outcome.STALLED))
    trial = u + moved
    u = jnp.where(settled[:, None], trial, u)
    return _LaneState(u, cost, g, A, scale, damping, growth, trial, promised, count, ended)


@eqx.filter_jit
def _descend(
    lanes: Lanes, start: Float[Array, "n 8"], queue: Int[Array, " n"], solver: str, substeps: int, max_steps: int
) -> _Ended:
    """Every trace to its minimum, `WIDTH` at a time: where one has ended the next in the queue takes its lane."""
    traces = len(start)
    width = min(traces, WIDTH[solver])

    def some(who: Int[Array, " lanes"]) -> Lanes:
        conditions, state = jax.tree.map(lambda leaf: leaf[who], (lanes.conditions, lanes.state))
        return Lanes(lanes.data[:, :, who], lanes.weight[:, :, who], conditions, state, lanes.step)

    def step(carry):
        search, who, called, ended = carry
        search = _improve(search, some(jnp.minimum(who, traces - 1)), solver, substeps, max_steps)
        over = search.status >= 0
        row = jnp.where(over, who, traces)  # what has not ended, and lanes without a trace, write nowhere
        found = _Ended(search.u, search.cost, search.normal, search.status, search.count)
        ended = jax.tree.map(lambda all_, mine: all_.at[row].set(mine, mode="drop"), ended, found)
        successor = called + jnp.cumsum(over) - 1
        who = jnp.where(over, queue.at[successor].get(mode="fill", fill_value=traces), who)
        begun = _fresh(start[jnp.minimum(who, traces - 1)])
        pick = lambda new, old: jnp.where(over.reshape(-1, *(1,) * (new.ndim - 1)), new, old)  # noqa: E731
        search = jax.tree.map(pick, begun, search)
        return search, who, called + jnp.sum(over), ended

    blank = _fresh(start)
    nowhere = _Ended(start, blank.cost, blank.normal, blank.status, blank.count)
    first = (_fresh(start[queue[:width]]), queue[:width], jnp.asarray(width), nowhere)
    *_, ended = jax.lax.while_loop(lambda carry: jnp.any(carry[1] < traces), step, first)
    return ended


def _result(
    ended: _Ended, usable: np.ndarray, volume: np.ndarray, size: int, absolute: bool, solver: str
) -> NonlinearFits:
    u = ended.u.T
    alpha1, alpha2, beta1 = np.exp(np.clip(u[[0, 1, 3]], -700, 700))  # a hopeless trace may have run anywhere
    constants = np.stack([alpha1, alpha2, u[2], beta1], axis=1)
    slope = np.stack([constants[:, 0], constants[:, 1], np.ones(len(constants)), constants[:, 3]], axis=1)
    stderr, outcomes = np.full(constants.shape, np.nan), []
    for i, status in enumerate(ended.status):
        outcome = Outcome(int(status))
        if not np.isfinite(volume[i]):
            outcome = Outcome.NO_BUCKLED_STATE
        elif not usable[i]:
            outcome = Outcome.UNUSABLE_DATA
        elif outcome == Outcome.OK:
            scale = np.sqrt(np.maximum(np.diagonal(ended.normal[i]), 1e-300))
            unit = ended.normal[i] / np.outer(scale, scale)
            if np.linalg.eigvalsh(unit)[0] < 1e-10:
                outcome = Outcome.RANK_DEFICIENT
            else:
                spread = np.sqrt(np.diagonal(np.linalg.inv(unit))) / scale
                factor = 1.0 if absolute else np.sqrt(ended.cost[i] / (size - UNKNOWNS))
                stderr[i] = spread[:4] * factor * slope[i]
        outcomes.append(outcome)
    good = np.array([outcome == Outcome.OK for outcome in outcomes])[:, None]
    hide = lambda part: np.where(good, part, np.nan)  # noqa: E731
    return NonlinearFits(
        hide(constants), hide(stderr), hide(u[4:].T), np.where(good[:, 0], ended.cost, np.nan), tuple(outcomes),
        ended.count, solver,
    )  # fmt: skip

"""The same fit of one block with the motion integrated in time by diffrax.

A check on the closed form, and the pattern for oscillators that have none:
64 motions from each unit of the initial state are one system, their
derivatives by the constants go along (forward mode), steps are constant so
that no record waits for another.

Symbols    u = (log α1, log α2, k_VS, log σ) unknowns   Φ(t) motion from the units of the initial state
Valid for  even sampling, equal decay
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS
"""

import importlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_kernel import BlockInput, LaneResult, PreparedBlock, found_of, prepare
from jshell.calibration.batch_shape import UNKNOWNS, Block, angular_frequencies, shape, uncoupled
from jshell.signals.lane_search import Evaluation, begin, descend
from jshell.signals.lanes import backward, cholesky, forward, lanewise, listed, total

LARGEST_TURN = 0.6  # rad a step: Dopri8 then errs by 1e-10 over a record
_shape = eqx.filter_jit(lanewise(shape))
_prepare = eqx.filter_jit(lanewise(prepare))


def motion(unknowns: Float[Array, "unknowns block"], data: Block, substeps: int) -> Float[Array, "times 2 4 block"]:
    """ΔV and ΔS at every sample from each unit of the initial state."""
    alpha1, alpha2, k, rate = jnp.exp(unknowns[0]), jnp.exp(unknowns[1]), unknowns[2], jnp.exp(unknowns[3])
    m1, m2 = uncoupled(alpha1, alpha2, data.volume, data.gas, data.wall).masses

    def field(t, y, args):
        gas, wall, coupling, m1, m2, rate, step = args
        pullback = jnp.stack([(gas * y[0] + coupling * y[1]) / m1, (coupling * y[0] + wall * y[1]) / m2])
        return step * jnp.concatenate([y[2:], -pullback - 2 * rate * y[2:]])

    times = data.values.shape[1]
    # not by `integrator`: its samples come from the dense output, which rounds otherwise than the ends of the steps
    # taken here and costs a tenth to a quarter more; loaded here since that takes long and most fits need none
    diffrax = importlib.import_module("diffrax")
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        diffrax.Dopri8(),
        t0=0.0,
        t1=float(times - 1),
        dt0=1 / substeps,
        y0=jnp.broadcast_to(jnp.eye(4)[:, :, None], (4, 4, unknowns.shape[1])),
        args=(data.gas, data.wall, k / data.volume, m1, m2, rate, data.step),
        saveat=diffrax.SaveAt(t0=True, steps=True),
        stepsize_controller=diffrax.ConstantStepSize(),
        adjoint=diffrax.ForwardMode(),
        max_steps=(times - 1) * substeps,
        throw=False,
    )
    return jnp.asarray(solution.ys)[::substeps, :2]


def evaluate(unknowns: Float[Array, "unknowns block"], data: Block, substeps: int) -> Evaluation:
    """As `batch_kernel.evaluate`, from integrated motions; `linear` is the initial state."""
    pushforward = lambda along: jax.jvp(lambda u: motion(u, data, substeps), (unknowns,), (along,))  # noqa: E731
    along = jnp.broadcast_to(jnp.eye(UNKNOWNS)[:, :, None], (UNKNOWNS, UNKNOWNS, unknowns.shape[1]))
    F, dF = jax.vmap(pushforward, out_axes=(None, 0))(along)
    inside = (jnp.arange(F.shape[0])[:, None] < data.count)[:, None, None]
    sums = jnp.sum(jnp.where(inside, F, 0.0), axis=0)

    def centre(x):
        mean = jnp.sum(jnp.where(inside, x, 0.0), axis=-4, keepdims=True) / data.count
        return jnp.where(inside, x - mean, 0.0)

    root = jnp.sqrt(data.weight)
    F, dF = centre(F) * root[:, None], centre(dF) * root[:, None]
    y = jnp.swapaxes(data.values, 0, 1) * root

    always_true = data.count[0] >= 0
    N = jnp.einsum("tcib,tcjb->ijb", F, F)
    L = cholesky(listed(N), always_true)
    half = forward(L, list(jnp.einsum("tcib,tcb->ib", F, y)), always_true)
    C = jnp.stack(backward(L, half, always_true))
    T = jnp.einsum("utcib,ib->utcb", dF, C)
    mixed = jnp.einsum("utcb,tcib->uib", T, F)
    U = jnp.stack(forward(L, [mixed[:, i] for i in range(4)], always_true))
    gradient = jnp.einsum("utcb,tcb->ub", T, y) - jnp.einsum("uib,ib->ub", mixed, C)
    normal = jnp.einsum("utcb,vtcb->uvb", T, T) - jnp.einsum("iub,ivb->uvb", U, U)
    cost = data.power - total(h * h for h in half)
    cost = jnp.where(shape(unknowns, data).sound & jnp.isfinite(cost), cost, jnp.inf)
    swing = jnp.einsum("cib,ib->cb", sums, C)
    return Evaluation(cost, gradient, normal, C, jnp.concatenate([swing, jnp.zeros((6, swing.shape[1]))]))


@eqx.filter_jit
@lanewise
def _descended(prepared: PreparedBlock, start: jax.Array, low: jax.Array, high: jax.Array, substeps: int) -> LaneResult:
    first = jnp.clip(jnp.where(jnp.isnan(start), prepared.start, start), low, high)
    at = lambda u, data: evaluate(u, data, substeps)  # noqa: E731
    search = descend(begin(first, prepared.data, at), prepared.data, low, high, at)
    modes, data = shape(search.unknowns, prepared.data), prepared.data
    state = jnp.concatenate([search.evaluation.linear, data.mean - search.evaluation.sums[:2] / data.count])
    return found_of(search, prepared, first, state, *angular_frequencies(modes))


def solve(
    inputs: BlockInput, start: np.ndarray, low: np.ndarray, high: np.ndarray, cell: int, used: np.ndarray
) -> LaneResult:
    """Fit block after block; arguments of `batch_kernel.solve_blocks`."""
    parts = []
    for number in range(int(used)):
        prepared = _prepare(jax.tree.map(lambda x, number=number: jnp.asarray(x[number]), inputs), low, high, cell)
        first = np.where(np.isnan(start[number]), np.asarray(prepared.start), start[number])
        modes = _shape(jnp.asarray(first), prepared.data)
        turns = np.asarray(modes.damped[1] * prepared.data.step)[np.asarray(modes.sound)]
        substeps = 1
        while substeps < 16 and turns.size and turns.max() > LARGEST_TURN * substeps:
            substeps *= 2
        box = jnp.asarray(start[number]), jnp.asarray(low), jnp.asarray(high)
        parts.append(_descended(prepared, *box, substeps))
    return LaneResult(*(np.stack([np.asarray(p) for p in part]) for part in zip(*parts, strict=True)))

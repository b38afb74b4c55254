"""Small vibrations of a shell about its rest shape.

Without loss, K v = ω² M v. The Stokes layer makes the eigenproblem

    F(s) v = (K + s² M + s^{3/2} sqrt(η̂) G) v = 0,   s = -1/τ + iΩ ,

whose roots are followed from the undamped ones while the layer is switched on.
M is only positive semidefinite, since a tangential motion of a massless shell
moves no liquid: M v = ω⁻² K v is solved, with the rigid translation taken out.

Symbols    ω = |s| intrinsic frequency   Ω damped frequency   τ decay time   dV, dS mode's change of V and S
Valid for  small amplitude; Stokes layer thin against the shell
Source     Mokbel et al. 2021: ω² = Ω² + 1/τ²; first-order boundary layer for G
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Complex, Float, Int

from jshell.contour import NO_WEAK_SPOT, WeakSpot, area, volume
from jshell.errors import BadValue, Outcome
from jshell.flow import flow, slip_matrix
from jshell.membrane import RestShape, rest, stiffness, wall
from jshell.membrane.energy import Area
from jshell.membrane.rest import Branch, raise_unless_ok
from jshell.shell.parameters import Reduced

SWITCHING_STEPS = 8  # the layer is switched on in equal steps of sqrt(η̂)
NEWTON_STEPS = 3  # at each of them; the last value is checked by the residual
RESIDUAL = 1e-8
SPARE_MODES = 4
SAME_ROOT = 1e-6  # relative
LOSSLESS = 1e-12  # a decay slower than this against |s| is none
TRANSLATION = 1e3  # stiffness given to the rigid translation, which carries no mass in the modal problem


class Modes(eqx.Module):
    """Small vibrations, slow ones first; arrays are (modes,).

    Attributes:
        omega: Intrinsic frequency |s|, ω² = Ω² + 1/τ² [1/time].
        Omega: Damped frequency Im s [1/time].
        tau: Decay time -1/Re s; infinite without loss [time].
        dV, dS: Change of volume [R0³] and area [R0²] along the mode, vᵀM v = 1, dV >= 0.
        shapes: (modes, coordinates) the mode itself, complex where there is loss.
        outcome: Integer of `Outcome` per mode: ok, or not_converged where a root was lost.
        rest: The shape they are vibrations of.
    """

    omega: Float[Array, "modes"]
    Omega: Float[Array, "modes"]
    tau: Float[Array, "modes"]
    dV: Float[Array, "modes"]
    dS: Float[Array, "modes"]
    shapes: Complex[Array, "modes coordinates"]
    outcome: Int[Array, "modes"]
    rest: RestShape

    @property
    def rate(self) -> Complex[Array, "... modes"]:
        """Complex rate s = -1/τ + iΩ [1/time]."""
        return -1 / self.tau + 1j * self.Omega


class Matrices(NamedTuple):
    """Stiffness, added mass and slip matrix of a rest shape on its free coordinates, and its translation."""

    K: Float[Array, "free free"]
    M: Float[Array, "free free"]
    G: Float[Array, "free free"]
    shift: Float[Array, "free"]


def modes(
    conditions: Reduced,
    *,
    count: int = 4,
    stokes_layer: bool = True,
    branch: Branch | str = "buckled",
    elements: int = 32,
    attached: float = 0.0,
    weak_spot: WeakSpot = NO_WEAK_SPOT,
    area: Area | str = "current",
    throw: bool = False,
) -> Modes:
    """Small vibrations about a rest shape; differentiable and vmappable in the conditions.

    Args:
        conditions: The problem without units.
        count: How many modes, slowest first; oscillating ones only, the translation left out.
        stokes_layer: Whether the liquid's viscosity acts, by its exact half-order impedance.
        branch, elements, attached, weak_spot, area: As in `jshell.membrane.rest`.
        throw: Raise `NotOk` unless rest shape and all modes are ok (outside `jit` only).

    Raises:
        BadValue: `count` is not between 1 and a quarter of the coordinates.

    Example:
        >>> import jshell as js
        >>> found = js.dynamics.modes(js.presets.R.conditions, stokes_layer=False)
        >>> print(found.omega.round(3))
        [1.19  1.981 2.931 4.269]
    """
    if not 1 <= count <= elements // 2:
        raise BadValue(
            "count", found=repr(count), expected=f"1 to {elements // 2}", remedy="Raise `elements` for more modes."
        )
    conditions = conditions.as_arrays()
    state = rest(
        conditions, branch=branch, elements=elements, attached=attached, weak_spot=weak_spot, area=area, throw=throw
    )
    found = vibrations(state, conditions, count, bool(stokes_layer), area)
    if throw:
        raise_unless_ok("modes", jnp.max(found.outcome))
    return found


def matrices(state: RestShape, conditions: Reduced, area: Area | str = "current") -> Matrices:
    """K, M and G about a rest shape."""
    shape, q = state.meridian, state.coordinates
    current = flow(shape, q)
    K = stiffness(shape, q, wall(shape, conditions, state.profile), conditions, area)
    pick = lambda full: full[shape.active][:, shape.active]  # noqa: E731
    return Matrices(pick(K), pick(current.mass), pick(slip_matrix(shape, current)), shape.free(shape.shift))


@eqx.filter_jit
def vibrations(state: RestShape, conditions: Reduced, count: int, stokes_layer: bool, area: Area | str) -> Modes:
    """Small vibrations about a given rest shape."""
    parts = matrices(state, conditions, area)
    frozen = jax.lax.stop_gradient(parts)
    # loss may reorder the roots: follow a few more than are wanted
    followed = min(count + SPARE_MODES, parts.K.shape[0] // 4) if stokes_layer else count
    squared, vectors = _undamped(frozen, followed)
    s = jnp.sqrt(squared.astype(complex)) * 1j
    viscosity = conditions.viscosity if stokes_layer else 0.0

    def follow(s, v):
        if stokes_layer:
            s, v = _switch_on(frozen, jax.lax.stop_gradient(viscosity), s, v)
        s, v = _newton(parts, viscosity, jax.lax.stop_gradient(s), jax.lax.stop_gradient(v))
        F, _ = _pencil(frozen, jax.lax.stop_gradient(viscosity), s)
        size = jnp.linalg.norm(frozen.K) * jnp.linalg.norm(v)
        return s, v, jnp.linalg.norm(F @ v) / size

    s, v, residual = jax.vmap(follow)(s, vectors.T)
    order = jnp.argsort(jax.lax.stop_gradient(jnp.abs(s)))[:count]
    s, v, residual = s[order], v[order], residual[order]
    # two paths that ended on one root: one of the modes was lost
    apart = jnp.abs(s[:, None] - s[None]) + jnp.eye(count) * jnp.abs(s)[:, None]
    residual = jnp.where(jnp.min(apart, axis=1) < SAME_ROOT * jnp.abs(s), jnp.inf, residual)
    return _measure(state, parts, s, v, residual, stokes_layer)


def _undamped(parts: Matrices, count: int) -> tuple[Float[Array, "modes"], Float[Array, "free modes"]]:
    """Lowest roots of K v = ω² M v, translation deflated, by Cholesky of K on the larger eigenvalues ω⁻².

    An unstable state has no Cholesky factor: its numbers come out NaN and its modes as not converged.
    """
    push = parts.M @ parts.shift
    weight = parts.shift @ push
    safe = jnp.where(weight > 0, weight, 1.0)
    L = jnp.linalg.cholesky(parts.K + TRANSLATION / safe * jnp.outer(push, push))
    deflated = parts.M - jnp.outer(push, push) / safe
    half = jsl.solve_triangular(L, deflated, lower=True)
    compact = jsl.solve_triangular(L, half.T, lower=True)
    values, vectors = jnp.linalg.eigh((compact + compact.T) / 2)
    best = slice(-1, -1 - count, -1)
    return 1 / values[best], jsl.solve_triangular(L.T, vectors[:, best], lower=False)


def _pencil(parts: Matrices, viscosity, s):
    """F(s) and its derivative with respect to s."""
    half = jnp.sqrt(s)
    loss = jnp.sqrt(viscosity) * parts.G
    F = parts.K + s**2 * parts.M + s * half * loss
    return F, 2 * s * parts.M + 1.5 * half * loss


def _newton(parts: Matrices, viscosity, s, v):
    """One Newton step on F(s) v = 0 with v's size along itself kept.

    Derivatives of the matrices enter through F alone: with frozen s and v the
    step carries the exact first derivative of the root and of the mode.
    """
    frozen, thickness = jax.lax.stop_gradient((parts, viscosity))
    v = v / jnp.linalg.norm(v)
    F, slope = _pencil(frozen, thickness, s)
    residual = _pencil(parts, _above_zero(viscosity), s)[0] @ v
    top = jnp.concatenate([F, (slope @ v)[:, None]], axis=1)
    bottom = jnp.concatenate([v.conj(), jnp.zeros(1)])[None]
    change = jnp.linalg.solve(jnp.concatenate([top, bottom]), jnp.concatenate([-residual, jnp.zeros(1)]))
    return s + change[-1], v + change[:-1]


def _above_zero(viscosity):
    """Keeps the derivative of sqrt finite at zero viscosity."""
    return jnp.maximum(viscosity, 1e-300)


def _switch_on(parts: Matrices, viscosity, s, v):
    """Follow a root from no viscosity to all of it, in equal steps of sqrt(η̂)."""

    def step(carry, fraction):
        s, v = carry
        for _ in range(NEWTON_STEPS):
            s, v = _newton(parts, viscosity * fraction**2, s, v)
        return (s, v), None

    fractions = jnp.linspace(0.0, 1.0, SWITCHING_STEPS + 1)[1:]
    (s, v), _ = jax.lax.scan(step, (s, v.astype(complex)), fractions)
    return s, v


def _measure(state: RestShape, parts: Matrices, s, v, residual, stokes_layer: bool) -> Modes:
    shape, q = state.meridian, state.coordinates
    slope_V = shape.free(jax.grad(lambda q: volume(shape, q))(q))
    slope_S = shape.free(jax.grad(lambda q: area(shape, q))(q))

    size = jnp.sqrt(jnp.abs(jnp.sum(v.conj() * (v @ parts.M.T), axis=1)))
    v = v / size[:, None]
    dV = v @ slope_V
    phase = jnp.where(jnp.abs(dV) > 1e-12, dV / jnp.abs(dV), 1.0)
    v = v / phase[:, None]

    lost = ~(residual < RESIDUAL) | ~(jnp.imag(s) > 0)
    outcome = jnp.where(lost, Outcome.NOT_CONVERGED, Outcome.OK)
    outcome = jnp.where(state.outcome != Outcome.OK, state.outcome, outcome)
    decays = -jnp.real(s) > LOSSLESS * jnp.abs(s)
    tau = jnp.where(decays, -1 / jnp.where(decays, jnp.real(s), -1.0), jnp.inf)
    whole = jnp.zeros((s.shape[0], q.shape[0]), complex).at[:, shape.active].set(v)
    omega = jnp.abs(s)
    return Modes(omega, jnp.imag(s), tau, jnp.real(v @ slope_V), jnp.real(v @ slope_S), whole, outcome, state)

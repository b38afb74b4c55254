"""Roots of a shell in its liquid: K v + s Z(s) v = 0, followed from the undamped ones while viscosity is switched on.

K is the stiffness, Z the impedance of the liquid at the complex rate s. One
unknown serves all liquids, σ = √s with Re σ > 0: the half-order layer is a
polynomial in it, the exact liquid knows s through λ = σ/√η̂ alone, and the branch
cut of √s, which overdamped pairs approach, is at its border.

    ideal    K + s² M
    layer    K + s² M + s^{3/2} √η̂ G
    second   K + s² M + s^{3/2} √η̂ G + s η̂ D
    exact    K + s Z(s)

and s C beside each where the wall loses energy itself.

Newton's bordered step finds σ and v together; with the matrices of the shape
differentiable and the rest frozen, one more step carries the exact derivative
ds/dp = -vᵀ(∂F/∂p)v / vᵀF'v.

Symbols    s = -1/τ + iΩ rate [1/time]   M, G, D added mass, slip matrix, second order   C wall   F = K + s Z
Valid for  small amplitude; layer η̂ << 1, second η̂ < 0.03, exact any η̂
Source     Mehrmann and Voss 2004 for Newton on a nonlinear eigenproblem; `jshell.flow` for the impedances,
           `jshell.membrane.viscous` for C
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Bool, Complex, Float, Int

from jshell.errors import choose
from jshell.flow import ViscousLiquid, flow, impedance, second_resistance, slip_matrix, viscous_liquid
from jshell.membrane import RestShape, WallLoss, stiffness, wall, wall_resistance
from jshell.membrane.energy import Area
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced

Liquid = Literal["exact", "second", "layer", "ideal"]
LIQUIDS = ("exact", "second", "layer", "ideal")

SWITCHING_STEPS = 8  # the layer is switched on in equal steps of √η̂
NEWTON_STEPS = 3  # at each of them; the last value is checked by the residual
TRANSLATION = 1e3  # stiffness given to the rigid translation, which carries no mass in the modal problem

THINNEST = 250.0  # |λ| beyond which the quadrature of the exact liquid ends; second order is right to 1e-4 in τ there
THIN = 0.06  # √(η̂/ω): up to here a root of second order is a good start for an exact one
STEPS = 300  # Newton steps that an exact root may take on its way from the thin layer
TRIES = 6  # Newton steps at one viscosity
SETTLED = 1e-11  # relative change of σ in the last of them
KINSHIP = 0.8  # overlap of a mode with itself at the viscosity before; neighbours have less
LEAP = 0.15  # largest relative error of the extrapolated σ
GROWTH, LEAST_GROWTH = 2.0, 1.01  # of √η̂ from step to step: the boldest tried, and where following gives up


class ShellMatrices(NamedTuple):
    """Stiffness, added mass, slip matrix and second order of a rest shape on its free coordinates; the translation.

    `liquid` is what the exact impedance needs, or None; `C` the wall's own resistance, or None.
    """

    K: Float[Array, "free free"]
    M: Float[Array, "free free"]
    G: Float[Array, "free free"]
    D: Float[Array, "free free"]
    shift: Float[Array, "free"]
    free: Int[Array, "free"]
    liquid: ViscousLiquid | None
    C: Float[Array, "free free"] | None = None


class Roots(NamedTuple):
    """Rates s, their vectors, and the residual of each relative to ‖K‖ ‖v‖; arrays are (modes, …)."""

    s: Complex[Array, "modes"]
    vectors: Complex[Array, "modes free"]
    residual: Float[Array, "modes"]


def check_liquid(liquid: str) -> None:
    """Refuse an unknown liquid."""
    choose("liquid", liquid, LIQUIDS, remedy="exact is right at any η̂.")


def matrices(
    state: RestShape,
    conditions: Reduced,
    liquid: Liquid | str,
    area: Area | str = "current",
    loss: WallLoss | None = None,
) -> ShellMatrices:
    """What the roots of a rest shape in a liquid need; matrices that the liquid does not know are zero."""
    shape, q = state.meridian, state.coordinates
    current = flow(shape, q)
    elastic = wall(shape, conditions, state.profile)
    K = stiffness(shape, q, elastic, conditions, area)
    none = jnp.zeros_like(K)
    G = slip_matrix(shape, current) if liquid != "ideal" else none
    D = second_resistance(shape, current) if liquid in ("second", "exact") else none
    pick = lambda full: full[shape.active][:, shape.active]  # noqa: E731
    exact = viscous_liquid(shape, q, current) if liquid == "exact" else None
    C = None if loss is None else pick(wall_resistance(shape, q, elastic, loss))
    return ShellMatrices(pick(K), pick(current.mass), pick(G), pick(D), shape.free(shape.shift), shape.active, exact, C)


def roots(parts: ShellMatrices, viscosity: Scalar, count: int) -> Roots:
    """The roots that the slowest undamped modes become, in their order; differentiable in parts and viscosity."""
    frozen, given = jax.lax.stop_gradient((parts, jnp.asarray(viscosity, dtype=float)))
    squared, vectors = undamped(frozen, count)
    start = jnp.sqrt(1j * jnp.sqrt(squared.astype(complex)))
    root = jnp.sqrt(jnp.maximum(given, 1e-300))

    def follow(begun):
        sigma, v = begun
        if parts.liquid is None:
            found = switched_on(frozen, root, sigma, v)
        else:
            found = _thickened(frozen, root, sigma, v)
        sigma, v = jax.lax.stop_gradient(_normed(*found))
        F, slope = _linearised(frozen, root, sigma)
        residual = jnp.linalg.norm(F @ v) / (jnp.linalg.norm(frozen.K) * jnp.linalg.norm(v))
        # derivatives of the shape enter through F alone: the step carries the exact first derivative
        now = jnp.sqrt(jnp.maximum(jnp.asarray(viscosity, dtype=float), 1e-300))
        sigma, v = _stepped(F, slope, _dynamic_stiffness(parts, now, sigma) @ v, sigma, v)
        return sigma**2, v, residual

    # a root of the exact liquid takes as many steps as it needs; the others take all the same
    begun = (start, vectors.T.astype(complex))
    return Roots(*(jax.vmap(follow)(begun) if parts.liquid is None else jax.lax.map(follow, begun)))


def undamped(parts: ShellMatrices, count: int) -> tuple[Float[Array, "modes"], Float[Array, "free modes"]]:
    """Lowest roots of K v = ω² M v, translation deflated, by Cholesky of K on the larger eigenvalues ω⁻².

    An unstable state has no Cholesky factor: its numbers come out NaN and its modes as not converged.
    """
    momentum = parts.M @ parts.shift
    weight = parts.shift @ momentum
    safe = jnp.where(weight > 0, weight, 1.0)
    L = jnp.linalg.cholesky(parts.K + TRANSLATION / safe * jnp.outer(momentum, momentum))
    deflated = parts.M - jnp.outer(momentum, momentum) / safe
    half = jsl.solve_triangular(L, deflated, lower=True)
    compact = jsl.solve_triangular(L, half.T, lower=True)
    values, vectors = jnp.linalg.eigh((compact + compact.T) / 2)
    best = slice(-1, -1 - count, -1)
    return 1 / values[best], jsl.solve_triangular(L.T, vectors[:, best], lower=False)


def _series(parts: ShellMatrices, root: Scalar, sigma: Complex[Array, ""]) -> Complex[Array, "free free"]:
    """F by orders of the layer; `root` is √η̂."""
    solid = _solid(parts, sigma)
    return solid + sigma**4 * parts.M + sigma**3 * root * parts.G + (sigma * root) ** 2 * parts.D


def _solid(parts: ShellMatrices, sigma: Complex[Array, ""]) -> Array:
    """What of F is the wall's and the gas's."""
    return parts.K if parts.C is None else parts.K + sigma**2 * parts.C


def _dynamic_stiffness(parts: ShellMatrices, root: Scalar, sigma: Complex[Array, ""]) -> Complex[Array, "free free"]:
    """F(σ) of the liquid that the parts were made for."""
    if parts.liquid is None:
        return _series(parts, root, sigma)
    decay = sigma / root
    thin = jax.lax.stop_gradient(jnp.abs(decay)) > THINNEST
    Z = impedance(parts.liquid, jnp.where(thin, THINNEST, decay))[parts.free][:, parts.free]
    return jnp.where(thin, _series(parts, root, sigma), _solid(parts, sigma) + (sigma * root) ** 2 * Z)


def _linearised(
    parts: ShellMatrices, root: Scalar, sigma: Complex[Array, ""]
) -> tuple[Complex[Array, "free free"], Complex[Array, "free free"]]:
    """F and its derivative with respect to σ."""
    at = lambda sigma: _dynamic_stiffness(parts, root, sigma)  # noqa: E731
    return jax.jvp(at, (sigma,), (jnp.ones_like(sigma),))


def _stepped(F, slope, residual, sigma, v):
    """One Newton step on F(σ) v = 0 that keeps the size of v along itself."""
    top = jnp.concatenate([F, (slope @ v)[:, None]], axis=1)
    bottom = jnp.concatenate([v.conj(), jnp.zeros(1)])[None]
    change = jnp.linalg.solve(jnp.concatenate([top, bottom]), jnp.concatenate([-residual, jnp.zeros(1)]))
    return sigma + change[-1], v + change[:-1]


def _normed(sigma, v):
    return sigma, v / jnp.linalg.norm(v)


def switched_on(parts: ShellMatrices, root: Scalar, sigma, v):
    """A root of the series, from no viscosity to all of it in equal steps of √η̂, the wall's along with it."""

    def step(carry, fraction):
        thinned = parts._replace(liquid=None, C=None if parts.C is None else fraction**2 * parts.C)
        for _ in range(NEWTON_STEPS):
            sigma, v = _normed(*carry)
            F, slope = _linearised(thinned, fraction * root, sigma)
            carry = _stepped(F, slope, F @ v, sigma, v)
        return carry, None

    fractions = jnp.linspace(0.0, 1.0, SWITCHING_STEPS + 1)[1:]
    return jax.lax.scan(step, (sigma, v), fractions)[0]


class _Path(NamedTuple):
    """An exact root on its way: √η̂, σ and v where it stands; √η̂ and σ before; what is being tried."""

    root: Float[Array, ""]
    sigma: Complex[Array, ""]
    v: Complex[Array, "free"]
    root_before: Float[Array, ""]
    sigma_before: Complex[Array, ""]
    growth: Float[Array, ""]
    trial_root: Float[Array, ""]
    trial_sigma: Complex[Array, ""]
    trial_v: Complex[Array, "free"]
    guess: Complex[Array, ""]
    tried: Int[Array, ""]
    steps: Int[Array, ""]
    arrived: Bool[Array, ""]


def _thickened(parts: ShellMatrices, target: Float[Array, ""], sigma, v):
    """An exact root: from the second order of a thin layer, by growing viscosities, each mode kept to its kin.

    Every pass is one Newton step at the viscosity being tried. Once it has settled near what the last two
    viscosities foretold, with a vector that is still the same mode's, it is kept and the next viscosity is bolder;
    else the next try is more timid. A root that cannot be followed keeps its last residual at the target: not zero.
    """
    thin = jnp.minimum(target, THIN * jnp.sqrt(jnp.abs(sigma) ** 2))
    sigma, v = _normed(*switched_on(parts, thin, sigma, v))
    zero = jnp.asarray(0)
    start = _Path(
        thin, sigma, v, thin / 2, sigma, jnp.asarray(GROWTH), thin, sigma, v, sigma, zero, zero, jnp.asarray(False)
    )

    def going(path: _Path):
        return ~path.arrived & (path.steps < STEPS) & (path.growth > LEAST_GROWTH)

    def one(path: _Path) -> _Path:
        F, slope = _linearised(parts, path.trial_root, path.trial_sigma)
        sigma, v = _normed(*_stepped(F, slope, F @ path.trial_v, path.trial_sigma, path.trial_v))
        settled = jnp.abs(sigma - path.trial_sigma) < SETTLED * jnp.abs(sigma)
        kin = _overlap(parts.M, path.v, v) > KINSHIP
        near = jnp.abs(sigma - path.guess) < LEAP * jnp.abs(sigma)
        good = settled & kin & near & (jnp.real(sigma) > 0) & (jnp.imag(sigma) > 0)
        failed = ~good & (settled | (path.tried + 1 >= TRIES) | ~jnp.isfinite(jnp.abs(sigma)))

        # where the path stands, and how bold it is
        stand = lambda kept, old: jnp.where(good, kept, old)  # noqa: E731
        root, now, vector = stand(path.trial_root, path.root), stand(sigma, path.sigma), stand(v, path.v)
        root_before, before = stand(path.root, path.root_before), stand(path.sigma, path.sigma_before)
        first = path.trial_root == path.root  # the start itself: nothing lies before it
        before = jnp.where(good & first, now, before)
        root_before = jnp.where(good & first, path.root_before, root_before)
        growth = jnp.where(failed, jnp.sqrt(path.growth), path.growth)
        growth = jnp.where(good, jnp.minimum(path.growth**1.5, GROWTH), growth)

        # what to try next
        following = jnp.minimum(root * growth, target)
        foretold = now + (now - before) / (root - root_before) * (following - root)
        anew = good | failed
        pick = lambda fresh, same: jnp.where(anew, fresh, same)  # noqa: E731
        return _Path(
            root, now, vector, root_before, before, growth,
            pick(following, path.trial_root), pick(foretold, sigma), pick(vector, v), pick(foretold, path.guess),
            jnp.where(anew, 0, path.tried + 1), path.steps + 1, good & (path.trial_root >= target),
        )  # fmt: skip

    path = jax.lax.while_loop(going, one, start)
    # a path that gave up reports where it stood: no root at the target
    return path.sigma, path.v


def _overlap(M, a, b) -> Float[Array, ""]:
    """|a·M b| over both sizes: 1 for one mode, little for two."""
    product = lambda x, y: jnp.abs(x.conj() @ (M @ y))  # noqa: E731
    return product(a, b) / jnp.sqrt(product(a, a) * product(b, b))

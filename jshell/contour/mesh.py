"""Building a discretisation: breakpoints in, constant matrices out; and moving its nodes.

A quintic spline on one element is a polynomial in the position u within it, so
every matrix is a constant one times the element's polynomials. The same lines
build a meridian once, from NumPy numbers, and rebuild it inside a compiled
program, from breakpoints that it has chosen itself.

Symbols    θ material angle [rad]   a angle held by a pad [rad]
Valid for  neighbouring elements of like lengths where the liquid is computed: ratios up to about 2
Source     the curve and its parameter: Mokbel et al. 2021, numerical method
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.contour.curve import Meridian, Near
from jshell.contour.grading import MORE, towards_edge
from jshell.contour.splines import ORDER, Numbers, ParitySplines, local_splines
from jshell.errors import BadValue
from jshell.shell.elasticity import Scalar
from jshell.sizes import limited

POINTS = 5  # Gauss points per element: a quintic's curvature squared is integrated to rounding
NEAR_POINTS = 10  # graded points on each element that touches a node
GRADING = 4  # s = u⁴ turns a logarithm at s = 0 into u³ log u
MINIMUM_ELEMENTS = 8
MOST_ELEMENTS = 1024  # its matrices take 2 GB


def breakpoints(elements: int, attached: float = 0.0, crowded: bool = False) -> tuple[np.ndarray, int | None]:
    """Even breakpoints of the meridian [rad], and the index of a pad's edge.

    The edge of a pad is a breakpoint; the elements are shared between the free
    part and the pad in proportion to their lengths, two at least for the pad.
    Where they crowd there, `MORE` come to each part.
    """
    if attached == 0.0:
        return np.linspace(0.0, np.pi, elements + 1), None
    held = max(2, round(elements * attached / np.pi))
    more = MORE if crowded else 0
    edge, whole = elements - held + more, elements + 2 * more
    moving, kept = towards_edge(edge, whole, crowded)
    breaks = np.concatenate([moving * (np.pi - attached), np.pi - kept[1:] * attached])
    breaks[edge] = np.pi - attached
    return breaks, edge


def meridian(
    elements: int = 32, attached: float = 0.0, breaks: np.ndarray | None = None, *, crowded: bool = False
) -> Meridian:
    """A discretisation of the meridian.

    Args:
        elements: Number of spline elements from pole to pole, at least 8.
        attached: Half-angle of the pad that holds the shell around θ = π [rad]; 0 is a free shell.
            Position and slope are held from θ = π - attached on.
        breaks: (elements + 1,) breakpoints [rad], increasing from 0 to π; even by default. With a pad, the
            breakpoint at its edge keeps its place and its index, see `breakpoints`.
        crowded: Twelve elements more, which shrink towards a pad's edge; nothing without a pad.

    Raises:
        BadValue: Too few elements, a pad that leaves nothing free, or breakpoints that do not fit.

    Example:
        >>> from jshell.contour import meridian
        >>> meridian(16).nodes.shape
        (17,)
    """
    if not isinstance(elements, int | np.integer) or elements < MINIMUM_ELEMENTS:
        raise BadValue(
            "elements",
            found=repr(elements),
            expected=f"an integer of at least {MINIMUM_ELEMENTS}",
            remedy="32 is usual.",
        )
    limited("elements", elements, MOST_ELEMENTS, "elements")
    if not 0.0 <= attached <= 2.0:
        raise BadValue("attached", found=repr(attached), expected="an angle from 0 to 2 rad", remedy="0.33 is usual.")
    usual, edge = breakpoints(int(elements), float(attached), crowded)
    chosen = usual if breaks is None else _checked(np.asarray(breaks, dtype=float), usual, edge)
    return _build(chosen, float(attached), edge, crowded and edge is not None)


def regrade(shape: Meridian, breaks: Float[Array, "nodes"]) -> Meridian:
    """The same discretisation with its nodes elsewhere; may be compiled, and differentiated in the breakpoints.

    Args:
        shape: Any meridian of as many elements and the same pad.
        breaks: (elements + 1,) breakpoints [rad], increasing from 0 to π; the edge of a pad stays where it is.
    """
    if shape.edge is not None:
        breaks = breaks.at[shape.edge].set(shape.nodes[shape.edge])
    return _build(breaks, shape.attached, shape.edge, shape.crowded)


def halved(shape: Meridian) -> Meridian:
    """Every element cut in the middle."""
    nodes = shape.nodes
    breaks = jnp.sort(jnp.concatenate([nodes, (nodes[1:] + nodes[:-1]) / 2]))
    return _build(breaks, shape.attached, None if shape.edge is None else 2 * shape.edge)


def with_pad(shape: Meridian, angle: Scalar, nodes: Float[Array, "nodes"] | None = None) -> Meridian:
    """The same discretisation held by a pad of another size, its nodes stretched along; differentiable in the angle.

    The number of elements on the pad stays, and so does the static `attached`, which is then nominal: the size is
    that of `nodes[edge]`.

    Args:
        shape: Any meridian; a free one has no pad to change.
        angle: Half-angle of the pad [rad]; may be traced.
        nodes: Nodes to stretch instead of the shape's own [rad].
    """
    old = jax.lax.stop_gradient(shape.nodes if nodes is None else nodes)
    if shape.edge is None:
        return _build(old, shape.attached, None)
    place = old[shape.edge]
    free = old[: shape.edge] * ((jnp.pi - angle) / place)
    held = jnp.pi - (jnp.pi - old[shape.edge :]) * (angle / (jnp.pi - place))
    return _build(jnp.concatenate([free, held]), shape.attached, shape.edge, shape.crowded)


def with_small_edge(shape: Meridian, count: int, ratio: Scalar = 2.0) -> Meridian:
    """The same discretisation with more elements on both sides of a pad's edge, ever smaller towards it.

    A held shell's splines hold the wall's stretch at the edge too, where the clamped wall holds position and slope
    alone: an error of first order in the length of the element there, and in that only.

    Args:
        shape: A meridian with a pad.
        count: How many more on each side.
        ratio: Of neighbours' lengths; may be traced, and takes no other program. The liquid's kernels lose digits
            beyond 2.
    """
    assert shape.edge is not None
    # of given numbers NumPy makes it: JAX would compile hundreds of programs that are run once
    traced = any(isinstance(part, Tracer) for part in (shape.nodes, ratio))
    xp = jnp if traced else np
    nodes, smaller = xp.asarray(shape.nodes), xp.asarray(ratio, dtype=float)
    shares = smaller ** -np.minimum(np.arange(count + 1.0), count - 1.0)
    inside = xp.cumsum(shares)[:-1] / xp.sum(shares)
    before, edge, after = (nodes[shape.edge + k] for k in (-1, 0, 1))
    parts = [
        nodes[: shape.edge], before + inside * (edge - before), edge[None],
        (after + inside * (edge - after))[::-1], nodes[shape.edge + 1 :],
    ]  # fmt: skip
    return _build(xp.concatenate(parts), shape.attached, shape.edge + count)


def carry(u: Float[Array, "before"], old: Meridian, new: Meridian) -> Float[Array, "coordinates"]:
    """A velocity or displacement (coordinates of `old`) as coordinates of `new`; zero where a pad holds.

    The nearest splines in the mean square over θ: sixth order in the spacing, exact for what both can represent.
    """
    ux, ur = u[: old.x_size], u[old.x_size :]
    x = ParitySplines(old.nodes, "even", old.edge)(new.angles) @ ux
    r = ParitySplines(old.nodes, "odd", old.edge)(new.angles) @ ur
    return fit(new, jnp.asarray(x), jnp.asarray(r))


def transfer(q: Float[Array, "before"], old: Meridian, new: Meridian) -> Float[Array, "coordinates"]:
    """The coordinates on `new` of a shape given on `old`; a held part stays exactly where it is held."""
    return new.sphere + carry(q - old.sphere, old, new)


def resampled(values: Float[Array, "before"], old: Meridian, new: Meridian) -> Float[Array, "points"]:
    """An even function known at the Gauss points of `old`, at those of `new`."""
    basis = old.potential_basis[0]
    coefficients = jnp.linalg.solve(*_normal(basis, old.weights, values - 1.0))
    return 1.0 + jnp.asarray(ParitySplines(old.nodes, "even")(new.angles) @ coefficients)  # a plain wall stays one


def fit(
    shape: Meridian, x: Float[Array, "points"], r: Float[Array, "points"], derivative: int = 0
) -> Float[Array, "coordinates"]:
    """Free coordinates of the splines nearest to two functions at the Gauss points; the held ones are zero.

    With `derivative` 1 the functions are slopes: the shape nearest to them that closes at both poles, and does not
    move along the axis.
    """
    moves = jnp.zeros(shape.sphere.shape).at[shape.active].set(1.0)

    def nearest(basis, values, moves, rigid):
        gram, target = _normal(basis, shape.weights, values)
        gram = gram + (jnp.outer(rigid, rigid) if derivative else 0.0)
        return jnp.linalg.solve(gram * moves[:, None] * moves[None] + jnp.diag(1 - moves), target * moves)

    bases = shape.x_basis[derivative], shape.r_basis[derivative]
    parts = zip(bases, (x, r), shape.split(moves), shape.split(shape.shift), strict=True)
    return jnp.concatenate([nearest(*part) for part in parts])


def _normal(basis: Numbers, weights: Numbers, values: Numbers) -> tuple[Numbers, Numbers]:
    """Matrix and right side of a weighted least-squares fit."""
    weighted = basis.T * weights[None]
    return weighted @ basis, weighted @ values


def _checked(breaks: np.ndarray, even: np.ndarray, edge: int | None) -> np.ndarray:
    """The breakpoints, if they can be those of a meridian."""
    fits = breaks.shape == even.shape
    ends = fits and breaks[0] == 0.0 and abs(breaks[-1] - np.pi) < 1e-12
    edged = ends and (edge is None or abs(breaks[edge] - even[edge]) < 1e-12)
    if not (edged and np.all(np.diff(breaks) > 0)):
        where = "" if edge is None else f", number {edge} at {even[edge]:.6g}"
        raise BadValue(
            "breaks",
            found=f"{breaks.size} numbers, {np.array2string(breaks, threshold=6, precision=4)}",
            expected=f"{even.size} increasing angles from 0 to π{where}",
            remedy="Start from contour.breakpoints.",
        )
    return breaks


def _build(breaks: Numbers, attached: float, edge: int | None, crowded: bool = False) -> Meridian:
    """All matrices, from breakpoints that are NumPy numbers or traced by JAX."""
    xp = breaks.__array_namespace__()
    elements = len(breaks) - 1
    local = local_splines(breaks, edge)
    even, odd = ParitySplines(breaks, "even", edge, local), ParitySplines(breaks, "odd", edge, local)
    potential = even if edge is None else ParitySplines(breaks, "even")

    gauss, gauss_weights = np.polynomial.legendre.leggauss(POINTS)
    lengths = breaks[1:] - breaks[:-1]
    angles = (breaks[:-1, None] + lengths[:, None] * (gauss[None] + 1) / 2).reshape(-1)
    weights = (lengths[:, None] * gauss_weights[None] / 2).reshape(-1)
    element_of = np.repeat(np.arange(elements), POINTS)
    node = np.arange(elements + 1)[:, None]
    touching = (element_of[None] == node) | (element_of[None] == node - 1)

    bases = [
        xp.stack([b.within(gauss, k).reshape(elements * POINTS, b.size) for k in range(3)])
        for b in ((even, odd) if potential is even else (even, odd, potential))
    ]
    sphere = [
        xp.linalg.solve(*_normal(basis[0], weights, wave))
        for basis, wave in zip(bases, (xp.cos(angles), xp.sin(angles)), strict=False)
    ]
    if edge is not None:
        moves = np.concatenate([~even.beyond(edge), ~odd.beyond(edge)])
        shift = np.zeros(even.size + odd.size)
    else:
        moves = np.ones(even.size + odd.size, dtype=bool)
        shift = np.concatenate([np.ones(even.size), np.zeros(odd.size)])
    off_axis = np.ones((elements + 1, 1))
    off_axis[[0, -1]] = 0.0
    return Meridian(
        angles=jnp.asarray(angles),
        weights=jnp.asarray(weights),
        x_basis=jnp.asarray(bases[0]),
        r_basis=jnp.asarray(bases[1]),
        potential_basis=jnp.asarray(bases[0 if potential is even else 2]),
        nodes=jnp.asarray(breaks),
        x_nodes=jnp.asarray(even.at_breaks()),
        r_nodes=jnp.asarray(odd.at_breaks() * off_axis),
        potential_nodes=jnp.asarray(potential.at_breaks()),
        far=jnp.asarray(np.where(touching, 0.0, 1.0) * weights[None]),
        near=_near(breaks, even, odd, potential),
        sphere=jnp.asarray(xp.concat(sphere)),
        active=jnp.asarray(np.flatnonzero(moves)),
        shift=jnp.asarray(shift),
        elements=elements,
        attached=attached,
        edge=edge,
        crowded=crowded,
    )


class Beside:
    """Graded quadrature on the two elements that touch every node.

    A ring kernel near its own ring divides two small numbers, so differences
    from the node are never formed by subtraction: a spline's value, its slope,
    its divided difference from the node and the slope of that come from its
    exact Taylor coefficients about the node.

    Args:
        breaks: (elements + 1,) breakpoints [rad], NumPy numbers or traced by JAX.
        points: Graded points on each of the two elements.

    Attributes:
        weights, gaps: (nodes, 2 points) weights, and distances from the node with their sign [rad].
    """

    def __init__(self, breaks: Numbers, points: int = NEAR_POINTS) -> None:
        xp = breaks.__array_namespace__()
        gauss, gauss_weights = np.polynomial.legendre.leggauss(points)
        u = (gauss + 1) / 2
        self._graded, graded_weights = u**GRADING, GRADING * u ** (GRADING - 1) * gauss_weights / 2
        lengths = (breaks[1:] - breaks[:-1])[:, None]
        self._half = lengths[:, :, None] / 2
        # beyond a pole there is no element: weight zero, geometry of the other side
        inside, nothing = lengths * graded_weights[None], xp.zeros((1, points))
        self.weights = jnp.asarray(
            xp.concat([xp.concat([nothing, inside]), xp.concat([inside, nothing])], axis=1)
        )  # fmt: skip
        self.gaps = self._sides(lengths * self._graded[None], -lengths * self._graded[None])

    def _sides(self, after: Numbers, before: Numbers) -> Float[Array, "nodes near ..."]:
        """(nodes, 2 points, …): the element before each node, then the one after it."""
        xp = self._half.__array_namespace__()
        first = xp.concat([after[:1], before])
        second = xp.concat([after, before[-1:]])
        return jnp.asarray(xp.concat([first, second], axis=1))

    def polynomials(self, basis: ParitySplines, order: int) -> list[Float[Array, "nodes near size"]]:
        """The first `order` of value, slope, quotient and its slope; the basis has the breakpoints given here."""
        xp = self._half.__array_namespace__()
        sides = []
        for side in (1, -1):
            taylor = basis.taylor(side)
            du = 2.0 * side * self._graded[:, None]
            k = np.arange(ORDER)
            value = du**k
            slope = k * du ** np.maximum(k - 1, 0)
            quotient = np.where(k >= 1, du ** np.maximum(k - 1, 0), 0.0)
            quotient_slope = np.where(k >= 2, (k - 1) * du ** np.maximum(k - 2, 0), 0.0)
            made = (value, slope, quotient, quotient_slope)[:order]
            scales = (1.0, self._half, self._half, self._half**2)
            sides.append([xp.matmul(xp.asarray(m), taylor) / s for m, s in zip(made, scales, strict=False)])
        return [self._sides(after, before) for after, before in zip(*sides, strict=True)]


def _near(breaks: Numbers, even: ParitySplines, odd: ParitySplines, potential: ParitySplines) -> Near:
    """The quadrature beside every node, with what the potential flow needs of each basis."""
    beside = Beside(breaks)
    xv, xs, xq, xqs = beside.polynomials(even, 4)
    rv, rs, rq, rqs = beside.polynomials(odd, 4)
    pot = xv if potential is even else beside.polynomials(potential, 1)[0]
    return Near(
        weights=beside.weights,
        gaps=beside.gaps,
        x_slope=xs,
        r_slope=rs,
        x_quotient=xq,
        r_quotient=rq,
        x_quotient_slope=xqs,
        r_quotient_slope=rqs,
        r_value=rv,
        x_value=xv,
        potential=pot,
    )

"""Stiffness against motions that are not axisymmetric: against the energy in space, the sphere, and another code."""

import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell import membrane
from jshell.contour import azimuthal
from jshell.errors import BadShape, BadValue, Outcome
from jshell.membrane.azimuthal import local_form, order_of, orthonormal, point_hessians, stiffness_of_order
from jshell.membrane.energy import stiffness_at, wall
from jshell.membrane.stability import shared, usual_orders

ELEMENTS = 24
FOURIER = json.loads((Path(__file__).parents[1] / "data" / "reference" / "fourier.json").read_text())
M = 3  # order whose stiffness is compared with differences of the energy


@pytest.fixture(scope="module", params=["current", "reference", "koiter"])
def loaded(request, rest_R):
    """The dimple of R with a weak spot and another Poisson ratio, which it need not be at rest with."""
    conditions = eqx.tree_at(lambda c: c.poisson_ratio, rest_R.conditions, jnp.asarray(0.3))
    profile = 1 - 0.15 * jnp.exp(-((rest_R.meridian.angles / 0.35) ** 2))
    moduli = wall(rest_R.meridian, conditions, profile)
    shape, q, difference = rest_R.meridian, rest_R.coordinates, jnp.asarray(0.12)
    hessians = point_hessians(shape, q, moduli, difference, request.param)
    expected = eqx.filter_jit(stiffness_at)(shape, q, moduli, difference, request.param)
    splines = azimuthal(shape)
    return request.param, moduli, (*_forms(splines, hessians), expected, splines)


@eqx.filter_jit
def _forms(splines, hessians):
    return local_form(hessians, 0), stiffness_of_order(splines, hessians, M), splines.moving(M)


@pytest.mark.slow
def test_order_zero_is_the_axisymmetric_stiffness(loaded, rest_R):
    form, _, _, expected, _ = loaded[2]
    shape = rest_R.meridian
    X, R = np.asarray(shape.x_basis), np.asarray(shape.r_basis)
    # c = 0: b + c and b - c are both the radial displacement
    no_x, no_r = np.zeros((*X.shape[:2], R.shape[2])), np.zeros((*R.shape[:2], X.shape[2]))
    motions = np.concatenate([np.concatenate([X, no_x], 2), *[np.concatenate([no_r, R], 2)] * 2])
    found = np.einsum("apn,pab,bpk->nk", motions, np.asarray(form), motions)
    np.testing.assert_allclose(found, expected, atol=1e-10 * float(jnp.max(jnp.abs(expected))))


def energy_in_space(curve, displacement, moduli, difference, area, m, shape):
    """Elastic energy plus ΔP V of a displaced shell by quadrature over θ and φ, in Cartesian coordinates and NumPy.

    displacement: (9, points) a, b, c with their θ-derivatives.
    """
    x, r, x1, r1, x2, r2 = (np.asarray(part)[:, None] for part in curve)
    phi = np.linspace(0, 2 * np.pi, 8 * m, endpoint=False)[None]  # the energy's waves up to 4 m are summed exactly
    a, a1, a2, b, b1, b2, c, c1, c2 = (part[:, None] for part in displacement)
    C, S = np.cos(m * phi), np.sin(m * phi)
    no = np.zeros_like(C * x)
    # components along, away from and around the axis, with derivatives; each a list by order of the φ-derivative
    parts = {}
    for k, (ak, bk, ck, xk, rk) in enumerate(((a, b, c, x, r), (a1, b1, c1, x1, r1), (a2, b2, c2, x2, r2))):
        along = [xk + ak * C, -m * ak * S, -(m**2) * ak * C]
        away = [rk + bk * C, -m * bk * S, -(m**2) * bk * C]
        around = [ck * S, m * ck * C, -(m**2) * ck * S]
        er, ef = np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
        flat0 = away[0] * er + around[0] * ef
        flat1 = (away[1] - around[0]) * er + (around[1] + away[0]) * ef
        flat2 = (away[2] - 2 * around[1] - away[0]) * er + (around[2] + 2 * away[1] - around[0]) * ef
        for j, (height, flat) in enumerate(zip(along, (flat0, flat1, flat2), strict=True)):
            parts[k, j] = np.stack([height + no, *(flat + no)])
    t, f = parts[1, 0], parts[0, 1]
    sine = np.sin(np.asarray(shape.angles))[:, None]
    normal = np.cross(t, f, axis=0)
    size = np.linalg.norm(normal, axis=0)

    def dot(u, v):
        return np.sum(u * v, axis=0)

    metric = np.stack([[dot(t, t), dot(t, f) / sine], [dot(t, f) / sine, dot(f, f) / sine**2]])
    form = -np.stack(
        [[dot(normal, parts[2, 0]), dot(normal, parts[1, 1]) / sine],
         [dot(normal, parts[1, 1]) / sine, dot(normal, parts[0, 2]) / sine**2]]
    ) / size  # fmt: skip
    metric, form = np.moveaxis(metric, (0, 1), (-2, -1)), np.moveaxis(form, (0, 1), (-2, -1))
    squares, axes = np.linalg.eigh(metric)
    U = np.einsum("...ik,...k,...jk->...ij", axes, np.sqrt(squares), axes)
    l1, l2 = np.sqrt(squares[..., 0]), np.sqrt(squares[..., 1])
    KA, KS, KB = (np.asarray(part)[:, None] for part in (moduli.area, moduli.shear, moduli.bending))
    stretching = KA / 2 * (l1 + l2 - 2) ** 2 + KS / 2 * (l1 - l2) ** 2
    if area == "koiter":
        mixed = np.linalg.solve(U, form)
        b11, b22 = mixed[..., 0, 0] - 1, mixed[..., 1, 1] - 1
        twist = (mixed[..., 0, 1] + mixed[..., 1, 0]) / 2
        nu = (KA - KS) / (KA + KS)
        bending = KB / 2 * (b11**2 + b22**2 + 2 * twist**2 * (1 - nu) + 2 * nu * b11 * b22)
    else:
        bending = 2 * KB * (np.trace(np.linalg.solve(metric, form), axis1=-2, axis2=-1) / 2 - 1) ** 2
    surface = size if area == "current" else sine
    work = difference * dot(parts[0, 0], normal) / 3
    weights = np.asarray(shape.weights)[:, None] * (phi[0, 1] - phi[0, 0])
    return np.sum(weights * (surface * (stretching + bending) + work))


@pytest.mark.slow
def test_stiffness_is_the_second_difference_of_the_energy_in_space(loaded, rest_R):
    area, moduli, (_, K, moving, _, splines) = loaded
    shape = rest_R.meridian
    u = np.random.default_rng(0).standard_normal(3 * splines.size) * np.asarray(moving)
    parts = zip(splines.motion(M), u.reshape(3, -1), strict=True)
    a, p, g = (np.asarray(family.values) @ part for family, part in parts)
    way = np.concatenate([a, (p + g) / 2, (p - g) / 2])
    expected = u @ np.asarray(K) @ u

    def second(size):
        def at(s):
            return energy_in_space(shape.at_points(rest_R.coordinates), s * size * way, moduli, 0.12, area, M, shape)

        return (at(1) - 2 * at(0) + at(-1)) / size**2

    # the step's error, of second order, is taken off by Richardson's rule
    found = (4 * second(2e-5) - second(4e-5)) / 3
    assert found == pytest.approx(expected, rel=1e-6)


def _first_order(state):
    splines, hessians, nulls = shared(state)
    return nulls, eqx.filter_jit(order_of)(state.meridian, splines, hessians, nulls, jnp.asarray(1))


@pytest.mark.long
def test_moving_and_turning_a_dimple_costs_nothing(rest_R):
    nulls, order = _first_order(rest_R)
    K, T = np.asarray(order.K), np.asarray(nulls)
    K = K * np.asarray(order.moving)[:, None]
    size = np.linalg.norm(K[:, np.asarray(order.moving)])
    lost = np.linalg.norm(K @ T, axis=0) / size / np.linalg.norm(T, axis=0)
    # the dimple's wandering is no spline, and null to what they resolve
    assert np.all(lost[:2] < 1e-8)
    assert lost[2] < 1e-6
    assert np.linalg.matrix_rank(np.asarray(order.nulls), tol=1e-6) == 3


@pytest.mark.long
def test_a_thick_dimple_is_round(rest_R):
    found = membrane.stability(rest_R, orders=range(1, 9), elements=ELEMENTS, throw=True)
    assert found.verdict == "round"
    assert int(found.order) == 2
    assert "m = 2" in repr(found)
    # another code's at V/V0 = 0.7; R has 0.6992
    np.testing.assert_allclose(found.eigenvalues, list(FOURIER["lowest"][0]["lam"].values()), rtol=0.01)


def test_thinner_shells_have_more_orders_to_look_at():
    assert usual_orders(0.22).size < usual_orders(0.02).size <= usual_orders(1e-4).size


@pytest.mark.long
def test_what_cannot_be_looked_at_is_refused(rest_R):
    with pytest.raises(BadValue, match="orders"):
        membrane.stability(rest_R, orders=[0, 1])
    with pytest.raises(BadShape, match="batch"):
        membrane.stability(eqx.tree_at(lambda s: s.volume, rest_R, rest_R.volume[None]))


@pytest.mark.slow
@pytest.mark.parametrize("row", FOURIER["lowest"], ids=lambda row: f"d{row['d']:g}")
def test_stability_finds_the_eigenvalues_of_another_code_on_its_own(row, make_problem):
    shape = membrane.rest(make_problem(row["d"], 0.9, 1.6), volume_ratio=row["V"])
    found = membrane.stability(shape, orders=range(1, 9), throw=True)
    np.testing.assert_allclose(found.eigenvalues, list(row["lam"].values()), rtol=1e-3)
    assert found.error < 0.01 * abs(found.eigenvalue)


@pytest.mark.slow
@pytest.mark.parametrize(("thickness", "sign"), [(0.02, -1), (0.03, 1)])
@pytest.mark.parametrize("elements", [20, 32])
@pytest.mark.parametrize("grading", ["rim", "uniform"])
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_the_sign_is_right_from_any_number_of_elements(thickness, sign, elements, grading, make_problem):
    conditions = make_problem(thickness, 0.9, 1.6)
    shape = membrane.rest(conditions, volume_ratio=0.7, elements=elements, grading=grading)
    assert int(shape.outcome) == Outcome.OK
    found = membrane.stability(shape)
    many = membrane.stability(membrane.rest(conditions, volume_ratio=0.7, elements=112), elements=112)
    assert np.sign(found.eigenvalue) == sign
    assert found.eigenvalue == pytest.approx(float(many.eigenvalue), rel=0.01)


@pytest.mark.long
def test_a_basis_has_the_derivative_of_its_span():
    """Of no motions too: orders above 1 have none that cost nothing."""
    rng = np.random.default_rng(0)
    form = jnp.asarray(np.diag(rng.uniform(1, 2, 5)))
    columns, way = jnp.asarray(rng.standard_normal((2, 5, 3)) * np.array([1, 1, 0]))

    @jax.jit
    def onto(size):  # the projection on the span does not know its basis
        basis = orthonormal(columns + size * way, form)
        return basis @ basis.T, orthonormal(jnp.zeros((5, 3)), (1 + size) * form)

    (exact, nothing), h = jax.jit(jax.jacfwd(onto))(0.0), 1e-5
    np.testing.assert_allclose(exact, (onto(h)[0] - onto(-h)[0]) / (2 * h), rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(nothing, 0.0)
    projection = onto(0.0)[0] @ form
    np.testing.assert_allclose(projection @ projection, projection, atol=1e-14)
    np.testing.assert_allclose(projection @ columns, columns, atol=1e-13)


@pytest.mark.slow
def test_eigenvalues_have_the_derivatives_of_their_differences(make_problem):
    c = make_problem(0.1, 0.9, 1.2)

    def lowest(numbers):
        changed = eqx.tree_at(lambda c: (c.thickness, c.outer_pressure), c, tuple(numbers))
        return membrane.stability(membrane.rest(changed, elements=48), orders=(2, 3), elements=48).eigenvalues

    at = jnp.array([0.1, 1.2])
    exact = jax.jacfwd(lowest)(at)
    compiled = jax.jit(lowest)
    for k, step in enumerate((1e-4, 1e-3)):
        way = jnp.zeros(2).at[k].set(step)
        one, two = ((compiled(at + h * way) - compiled(at - h * way)) / (2 * h * step) for h in (1, 2))
        np.testing.assert_allclose(exact[:, k], (4 * one - two) / 3, rtol=1e-5)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(lowest))(at), exact, rtol=1e-9)


@pytest.mark.long
def test_what_depends_on_the_shape_is_asked_for_under_jit(rest_R):
    with pytest.raises(BadValue, match="elements"):
        eqx.filter_eval_shape(lambda state: membrane.stability(state, orders=(2,)), rest_R)

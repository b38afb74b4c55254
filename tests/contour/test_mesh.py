"""Moving the nodes: what may change, what must not, and where they go."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import (
    area,
    breakpoints,
    carry,
    dimple,
    dimple_breaks,
    halved,
    meridian,
    regrade,
    rim_breaks,
    transfer,
    volume,
    with_pad,
    with_small_edge,
)
from jshell.contour import volume as volume_of
from jshell.contour.mesh import fit
from jshell.errors import BadValue

ELEMENTS = 16
UNEVEN = np.pi * (np.linspace(0, 1, ELEMENTS + 1) + 0.03 * np.sin(2 * np.pi * np.linspace(0, 1, ELEMENTS + 1)))


@pytest.fixture(scope="module")
def even():
    return meridian(ELEMENTS)


@pytest.fixture(scope="module")
def moved():
    return jax.jit(regrade)


carried, transferred = jax.jit(carry), jax.jit(transfer)


@pytest.mark.long
@pytest.mark.parametrize("attached", [0.0, 0.3272])
def test_a_compiled_meridian_is_the_one_built_from_numbers(attached, moved):
    base, edge = breakpoints(ELEMENTS, attached)
    breaks = base + 0.02 * np.sin(2 * base) * (base < np.pi - attached)
    if edge is not None:
        breaks[edge] = base[edge]
    built = meridian(ELEMENTS, attached, breaks)
    compiled = moved(meridian(ELEMENTS, attached), jnp.asarray(breaks))
    assert jax.tree.structure(built) == jax.tree.structure(compiled)
    for one, other in zip(jax.tree.leaves(built), jax.tree.leaves(compiled), strict=True):
        # rounding, of second derivatives too
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11 * float(jnp.abs(one).max()))


@pytest.mark.long
def test_what_both_meshes_represent_is_transferred_exactly(even, moved):
    new = moved(even, jnp.asarray(UNEVEN))
    # shares no breakpoint but the poles: a translation is all that both hold besides the sphere
    shifted = even.sphere + 0.3 * even.shift
    np.testing.assert_allclose(transferred(shifted, even, new), new.sphere + 0.3 * new.shift, atol=1e-13)
    random = jnp.asarray(np.random.default_rng(0).standard_normal(even.sphere.shape))
    np.testing.assert_allclose(carried(random, even, even), random, atol=1e-11)


@pytest.mark.long
def test_a_transferred_shape_converges_at_sixth_order():
    errors = []
    for elements in (12, 24):
        old = meridian(elements)
        new = meridian(elements, breaks=np.interp(np.linspace(0, 1, elements + 1), np.linspace(0, 1, 17), UNEVEN))
        wave = lambda mesh: fit(mesh, jnp.cos(2 * mesh.angles), jnp.sin(2 * mesh.angles))  # noqa: E731
        there = new.at_points(carried(wave(old), old, new))
        errors.append(float(jnp.abs(there.x - jnp.cos(2 * new.angles)).max()))
    # a factor of 64 a halving; 30 leaves room for the two meshes' constants
    assert errors[0] / errors[1] > 30
    assert errors[1] < 1e-6


@pytest.mark.long
def test_a_pad_stays_held_through_a_transfer(moved):
    old = meridian(ELEMENTS, 0.3272)  # as large as the one compiled above
    q = dimple(old, 0.8, 0.3)
    new = moved(old, rim_breaks(old, dimple(old, 0.7, 0.1)))
    held = np.asarray(new.angles) > np.pi - 0.3272
    before, after = new.at_points(new.sphere), new.at_points(transferred(q, old, new))
    np.testing.assert_allclose(np.asarray(after.x)[held], np.asarray(before.x)[held], atol=1e-13)
    np.testing.assert_allclose(np.asarray(after.r1)[held], np.asarray(before.r1)[held], atol=1e-12)
    assert float(new.nodes[new.edge]) == np.pi - 0.3272
    # free parts moved as they had on the old nodes
    assert float(volume_of(new, transferred(q, old, new))) == pytest.approx(
        float(volume_of(old, q)), rel=1e-4
    )  # what 16 elements resolve


@pytest.mark.long
@pytest.mark.parametrize("attached", [0.0, 0.3272])
def test_nodes_crowd_at_the_rim_and_neighbours_stay_alike(attached, moved):
    shape = meridian(24, attached)
    for _ in range(2):
        shape = moved(shape, rim_breaks(shape, dimple(shape, 0.7, 0.05)))
    lengths = np.diff(shape.nodes)
    # a cap of V/V0 = 0.7 is mirrored at cos θ = 1 - h, h²(3 - h) = 0.6: θ = 1.02
    middle = (np.asarray(shape.nodes)[1:] + np.asarray(shape.nodes)[:-1]) / 2
    assert abs(middle[np.argmin(lengths)] - 1.02) < 0.1
    assert lengths.min() < np.pi / 24 / 2
    # slope 0.2 along θ; a pad shares its own elements, so the edge may jump by more
    ratio = np.maximum(lengths[1:] / lengths[:-1], lengths[:-1] / lengths[1:])
    if shape.edge is not None:
        ratio = np.delete(ratio, shape.edge - 1)
    assert ratio.max() < 1.3


def test_a_sphere_is_graded_evenly(even):
    np.testing.assert_allclose(rim_breaks(even, even.sphere), np.linspace(0, np.pi, ELEMENTS + 1), atol=1e-6)


@pytest.mark.long
def test_measures_of_a_sphere_converge_in_the_nodes_derivative(even):
    # the sphere is one shape on any nodes: its volume hardly feels them
    slope = jax.jit(jax.grad(lambda b: volume_of(regrade(even, b), regrade(even, b).sphere)))(jnp.asarray(UNEVEN))
    assert np.all(np.isfinite(slope))
    # the poles are no nodes to move
    assert float(jnp.abs(slope[1:-1]).max()) < 1e-7


@pytest.mark.long
def test_volume_and_area_of_a_spheroid_converge_at_twice_the_order_of_slopes():
    errors = []
    for elements in (8, 16, 32):
        mesh = meridian(elements, breaks=np.interp(np.linspace(0, 1, elements + 1), np.linspace(0, 1, 17), UNEVEN))
        q = fit(mesh, 0.5 * jnp.cos(mesh.angles), jnp.sin(mesh.angles))
        e = np.sqrt(0.75)
        closed = 2 * np.pi * (1 + 0.25 / e * np.arctanh(e))
        errors.append([abs(float(volume_of(mesh, q)) / (2 * np.pi / 3) - 1), abs(float(area(mesh, q)) / closed - 1)])
    errors = np.array(errors)
    # position is of order 6, and an integral of the best fit of order 2 x 5 or better until rounding
    assert np.all(np.log2(errors[0] / errors[1]) > 6)
    assert np.all(errors[2] < 1e-11)


@pytest.mark.parametrize(
    "breaks", [np.linspace(0, np.pi, 16), np.linspace(0, 3, 17), np.sort(np.r_[np.linspace(0, np.pi, 16), 0.0])]
)
def test_breakpoints_that_are_none_are_refused(breaks):
    with pytest.raises(BadValue, match="breaks"):
        meridian(ELEMENTS, breaks=breaks)


@pytest.mark.long
def test_a_pad_of_another_size_is_a_mesh_built_for_it():
    shape, even = with_pad(meridian(16, 0.3), 0.41), meridian(16, 0.41)
    assert shape.edge == even.edge
    np.testing.assert_allclose(shape.nodes, even.nodes, atol=1e-14)
    np.testing.assert_allclose(shape.sphere, even.sphere, atol=1e-12)
    np.testing.assert_allclose(shape.near.x_slope, even.near.x_slope, atol=1e-10)


@pytest.mark.parametrize("attached", [0.2, 0.3272, 0.6])
def test_elements_shrink_towards_a_pads_edge_by_one_ratio(attached):
    breaks, edge = breakpoints(32, attached, True)
    assert len(breaks) == 32 + 12 + 1
    assert breaks[edge] == np.pi - attached
    lengths = np.diff(breaks)
    for side in (lengths[edge - 8 : edge], lengths[edge : edge + 8][::-1]):
        np.testing.assert_allclose(side[:-1] / side[1:], 1.6, rtol=1e-9)
    # as long as without them, elsewhere
    assert lengths[0] == pytest.approx(np.diff(breakpoints(32, attached)[0])[0], rel=0.05)


def test_nodes_crowd_at_a_rim_and_at_a_pads_edge():
    shape = meridian(24, 0.3272, crowded=True)
    breaks = np.asarray(dimple_breaks(shape, 0.7, 0.05))
    assert breaks[shape.edge] == np.pi - 0.3272
    lengths = np.diff(breaks)
    assert lengths[shape.edge - 1 : shape.edge + 1].max() < 0.005
    # a cap of V/V0 = 0.7 is mirrored at cos θ = 1 - h, h²(3 - h) = 0.6: θ = 1.02; even elements are 0.13 long
    assert lengths[np.searchsorted(breaks, 1.02) - 1] < 0.08
    ratio = np.maximum(lengths[1:] / lengths[:-1], lengths[:-1] / lengths[1:])
    # 1.6 at the edge times the rim's 1.2 at most
    assert ratio.max() < 1.9


@pytest.mark.long
def test_halves_of_the_elements_hold_every_shape():
    before = meridian(16, 0.35, crowded=True)
    after = halved(before)
    assert (after.elements, after.edge) == (2 * before.elements, 2 * before.edge)
    q = before.sphere.at[before.active].add(0.01 * np.random.default_rng(0).standard_normal(before.active.size))
    there = transfer(q, before, after)
    # normal equations of small elements keep half the digits
    assert float(volume(after, there)) == pytest.approx(float(volume(before, q)), rel=1e-8)


@pytest.mark.long
def test_a_free_mesh_has_no_pad_to_change():
    np.testing.assert_array_equal(with_pad(meridian(16), 0.3).nodes, meridian(16).nodes)


@pytest.mark.long
def test_small_elements_beside_a_pads_edge_hold_every_shape_of_the_mesh_before():
    before = with_pad(meridian(16, 0.3), 0.35)
    after = with_small_edge(before, 3, 2.0)
    k, old = after.edge, np.diff(before.nodes)
    assert k == before.edge + 3
    assert after.nodes[k] == pytest.approx(np.pi - 0.35, abs=1e-14)
    for lengths, whole in ((np.diff(after.nodes)[k - 4 : k], old[before.edge - 1]),
                           (np.diff(after.nodes)[k : k + 4][::-1], old[before.edge])):  # fmt: skip
        np.testing.assert_allclose(lengths / whole, [1 / 2, 1 / 4, 1 / 8, 1 / 8], rtol=1e-10)
    q = before.sphere.at[before.active].add(0.01 * np.random.default_rng(0).standard_normal(before.active.size))
    there = transfer(q, before, after)
    # breakpoints added to a spline leave it what it is; normal equations of small elements keep half the digits
    np.testing.assert_allclose(after.at_nodes(there)[0][: k - 3], before.at_nodes(q)[0][: k - 3], atol=1e-9)
    assert float(volume(after, there)) == pytest.approx(float(volume(before, q)), rel=1e-8)

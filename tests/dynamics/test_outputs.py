"""What a run is asked for besides its channels, on motions that are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import carry, meridian, regrade, transfer
from jshell.dynamics import Losses, Motion, far_pressure, liquid_at, meridians, mode_shapes, to_xarray
from jshell.dynamics.run import Setup
from jshell.errors import BadName, BadShape, BadValue
from jshell.trace import Trace


def breathing(R, samples=4) -> Motion:
    """A sphere whose radius grows evenly, 0.02 a sample, its nodes moving as if they followed something."""
    shape = meridian(32)
    times = 0.1 * np.arange(samples)
    radius = 1 - 0.2 * times
    nodes = shape.nodes[None] + 0.01 * jnp.arange(samples)[:, None] * jnp.sin(shape.nodes)[None]

    @jax.jit
    @jax.vmap
    def on_its_nodes(size, breaks):
        other = regrade(shape, breaks)
        return transfer(shape.sphere * size, shape, other), carry(-0.2 * shape.sphere, shape, other)

    q, u = on_its_nodes(jnp.asarray(radius), nodes)
    channels = {"V": 4 * np.pi / 3 * radius**3, "V_rate": -0.8 * np.pi * radius**2}
    setup = Setup(shape, jnp.ones(shape.angles.size), None, R, Losses(), jnp.asarray(0.0), "current")
    return Motion(Trace(times, channels, R), q, u, nodes, setup)


@pytest.fixture(scope="module")
def motion(R):
    return breathing(R)


def test_far_pressure_is_the_slope_of_the_volumes_rate():
    errors = []
    for samples in (41, 81):
        t = np.linspace(0.0, 6.0, samples)
        found = far_pressure(Trace(t, {"V_rate": np.sin(t)}), 10.0)
        errors.append(np.abs(found - np.cos(t) / (40 * np.pi)).max())
    # fifth order inside, fourth at the ends at worst
    assert np.log2(errors[0] / errors[1]) > 3.9
    assert errors[1] < 1e-6


def test_far_pressure_of_a_bubble_is_the_known_one():
    """Far from a sphere of radius R(t) the pressure is ρ (R² R̈ + 2 R Ṙ²)/r: Lamb, art. 56."""
    t = np.linspace(0.0, 5.0, 201)
    R, speed, pushforward = 1 + 0.1 * np.sin(2 * t), 0.2 * np.cos(2 * t), -0.4 * np.sin(2 * t)
    found = far_pressure(Trace(t, {"V_rate": 4 * np.pi * R**2 * speed}), 50.0)
    np.testing.assert_allclose(found, (R**2 * pushforward + 2 * R * speed**2) / 50, atol=1e-7)


def test_far_pressure_refuses_what_it_cannot_read():
    t = np.linspace(0.0, 1.0, 11)
    with pytest.raises(BadName, match="V_rate"):
        far_pressure(Trace(t, {"V": t}), 10.0)
    with pytest.raises(BadValue, match="distance"):
        far_pressure(Trace(t, {"V_rate": t}), 0.5)
    with pytest.raises(BadShape, match="at least 6"):
        far_pressure(Trace(t[:5], {"V_rate": t[:5]}), 10.0)


@pytest.mark.long
def test_meridians_are_read_on_the_nodes_of_their_sample(motion):
    angles = np.linspace(0.0, np.pi, 37)
    shapes, rates = meridians(motion, angles)
    radius = 1 - 0.2 * np.asarray(motion.trace.times)
    # a sphere on 32 quintic elements
    np.testing.assert_allclose(np.hypot(shapes.x, shapes.r), radius[:, None] * np.ones(37), atol=1e-7)
    np.testing.assert_allclose(rates.x, -0.2 * np.cos(angles)[None] * np.ones((4, 1)), atol=1e-7)
    np.testing.assert_allclose(rates.r, -0.2 * np.sin(angles)[None] * np.ones((4, 1)), atol=1e-7)
    turned, _ = meridians(motion, angles, samples=[3, 2, 1, 0])
    np.testing.assert_array_equal(turned.x, shapes.x[::-1])
    with pytest.raises(BadValue, match="angles"):
        meridians(motion, np.array([0.0, 4.0]))


@pytest.mark.long
def test_the_liquid_around_a_sample_is_that_of_its_shape(motion):
    k, place = 3, 2.0
    found = liquid_at(motion, k, np.full(183, place), np.zeros(183))
    radius = 1 - 0.2 * float(motion.trace.times[k])
    assert float(found.v_x[0]) == pytest.approx(-0.2 * radius**2 / place**2, rel=1e-7)


@pytest.mark.long
def test_a_motion_becomes_a_dataset(motion):
    xarray = pytest.importorskip("xarray", reason="no xarray: pip install jshell[io]")
    data = to_xarray(motion, np.linspace(0.0, np.pi, 37))
    assert isinstance(data, xarray.Dataset)
    assert data["x"].dims == ("t", "theta")
    front = data["x"].sel(theta=0.0)
    np.testing.assert_allclose(front, 1 - 0.2 * data["t"], atol=1e-7)
    assert float(data["v_r"].sel(theta=np.pi / 2, method="nearest")[0]) == pytest.approx(-0.2, abs=1e-7)
    assert data.attrs["d_hat"] == pytest.approx(0.22)
    assert data["V_rate"].attrs["long_name"] == "rate of the volume"


def _turned(x, r):
    """Volume of a meridian by the trapezium rule."""
    return -np.pi * np.trapezoid(np.asarray(r) ** 2, np.asarray(x), axis=-1)


@pytest.mark.long
def test_mode_shapes_swing_about_the_rest_shape(modes_R):
    phases = np.linspace(0.0, 2 * np.pi, 361)
    shapes = mode_shapes(modes_R, phases=phases)
    assert shapes.x.shape == (4, 361, 181)
    rest = (np.asarray(shapes.x)[:, :1] + np.asarray(shapes.x)[:, 180:181]) / 2
    across = (np.asarray(shapes.r)[:, :1] + np.asarray(shapes.r)[:, 180:181]) / 2
    moved = np.hypot(np.asarray(shapes.x) - rest, np.asarray(shapes.r) - across)
    # the farthest any point goes; half a degree of phase is 4e-5 of it
    np.testing.assert_allclose(moved.max(axis=(1, 2)), 0.15, rtol=1e-4)
    swing = _turned(shapes.x, shapes.r)
    assert np.all(swing[:, 0] > swing[:, 180])


def test_modes_that_were_lost_have_no_shapes(modes_R):
    import equinox as eqx

    lost = eqx.tree_at(lambda m: m.outcome, modes_R, modes_R.outcome.at[1].set(1))
    with pytest.raises(BadValue, match="not ok"):
        mode_shapes(lost)
    with pytest.raises(BadValue, match="largest"):
        mode_shapes(modes_R, largest=0.0)

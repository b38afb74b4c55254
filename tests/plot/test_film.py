"""A run as pictures: what is drawn is where the run has it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from jshell import plot
from jshell.contour import dimple, meridian
from jshell.dynamics import Losses, Motion
from jshell.dynamics.run import Setup
from jshell.errors import BadName, BadValue
from jshell.plot.film import LONGEST, arrows
from jshell.shell import Liquid, Reduced, Shell, scales
from jshell.trace import Trace

R = Reduced(0.2, 0.9, 1.6, 0.004)


@pytest.fixture(scope="module")
def motion() -> Motion:
    """A dent that deepens, swings and rests, by hand: the shapes are those of a mirrored cap."""
    shape = meridian(12)
    times = np.linspace(20.0, 25.0, 11)
    V = 4 * np.pi / 3 * np.array([0.98, 0.95, 0.90, 0.80, 0.70, 0.66, 0.70, 0.73, 0.71, 0.70, 0.70])
    dented = jax.jit(jax.vmap(lambda ratio: dimple(shape, ratio, jnp.asarray(0.2))))
    q = dented(jnp.asarray(V / (4 * np.pi / 3)))
    u = jnp.asarray(np.gradient(np.asarray(q), times, axis=0))
    x = np.asarray(q) @ np.asarray(jnp.pad(shape.x_nodes, ((0, 0), (0, q.shape[1] - shape.x_size)))).T
    channels = {"V": V, "H": x.max(axis=1) - x.min(axis=1), "x_front": x[:, 0], "x_back": x[:, -1]}
    setup = Setup(shape, jnp.ones(shape.angles.size), None, R, Losses(), jnp.asarray(0.0), "current")
    return Motion(Trace(times, channels, R), q, u, jnp.tile(shape.nodes, (11, 1)), setup)


def test_the_moments_tell_the_snap(motion):
    found = plot.moments(motion)
    times = np.asarray(motion.trace.times)
    assert set(found) <= set(times)
    assert found == sorted(found)
    # the deepest dent, the next turn of the volume, the end
    assert {times[5], times[7], times[10]} <= set(found)
    still = Motion(motion.trace, motion.coordinates, motion.velocity, motion.nodes, motion.setup)
    assert len(plot.moments(still)) <= 7


@pytest.mark.long
def test_arrows_are_the_liquids_velocity_and_lie_outside(motion):
    seen = arrows(motion, 4)
    # mirrored: as many above as below the axis, moving apart or together alike
    half = seen.x.size // 2
    np.testing.assert_array_equal(seen.r[:half], -seen.r[half:])
    np.testing.assert_array_equal(seen.v_r[:half], -seen.v_r[half:])
    assert np.hypot(seen.x - seen.x.mean(), seen.r).max() > 1.5
    # the dent draws liquid after itself, towards negative x, in front of the pole
    front = float(motion.trace["x_front"][4])
    before = (seen.x > front) & (np.abs(seen.r) < 0.2)
    assert before.sum() > 4
    assert np.all(seen.v_x[before] < 0)


@pytest.mark.long
def test_a_strip_has_a_picture_per_moment_and_the_contours(motion, tmp_path):
    figure = plot.filmstrip(motion, times=[21.0, 22.5, 23.5])
    titles = [ax.get_title(loc="left") for ax in figure.get_axes()]
    assert titles[0] == "(a)  t = 21.00,  V/V₀ = 0.900"
    assert titles[3] == "(d)  contours"
    contours = figure.get_axes()[3]
    lines = [line for line in contours.get_lines() if line.get_label().startswith("t =")]
    for line, sample in zip(lines, (2, 5, 7), strict=True):
        assert line.get_xdata()[0] == pytest.approx(float(motion.trace["x_front"][sample]))
    assert plot.save(figure, tmp_path / "strip.png").stat().st_size > 10_000


def test_a_strip_of_a_shell_with_units_tells_milliseconds(motion):
    unit = scales(Shell(22.5e-3, 5e-3, 0.5e6), Liquid(1260.0, 1.0))  # 2.4 ms
    figure = plot.filmstrip(motion, times=[21.0, 22.5, 23.5], flow=False, scales=unit)
    assert figure.get_axes()[0].get_title(loc="left") == f"(a)  t = {21e3 * unit.time:.1f} ms,  V/V₀ = 0.900"


@pytest.mark.long
def test_the_longest_arrow_is_as_long_as_said_and_the_wall_as_thick_as_it_is(motion):
    ax = plot.snapshot(motion, 22.0)
    (quiver,) = (item for item in ax.collections if hasattr(item, "U"))
    assert np.hypot(quiver.U, quiver.V).max() == pytest.approx(LONGEST)
    outer, inner = (patch.get_xy() for patch in ax.patches)
    # at the back pole, where the shell is still a sphere, the faces are the thickness apart
    assert inner[:, 0].min() - outer[:, 0].min() == pytest.approx(0.2, abs=1e-3)
    bare = plot.snapshot(motion, 22.0, flow=False)
    assert not [item for item in bare.collections if hasattr(item, "U")]


@pytest.mark.long
def test_a_film_has_its_pictures(motion, tmp_path):
    path = plot.animate(motion, tmp_path / "snap.gif", start=21.0, stop=24.0, frames=4, rate=5)
    with Image.open(path) as film:
        assert film.n_frames == 4
        assert film.info["duration"] == 200


def test_pictures_that_cannot_be_made_are_refused(motion, tmp_path):
    with pytest.raises(BadValue, match="time"):
        plot.snapshot(motion, 99.0)
    with pytest.raises(BadValue, match="moment"):
        plot.filmstrip(motion, times=[])
    with pytest.raises(BadName, match=r"\.gif"):
        plot.animate(motion, tmp_path / "snap.mp4")
    with pytest.raises(BadValue, match="frames"):
        plot.animate(motion, tmp_path / "snap.gif", frames=1)
    with pytest.raises(BadValue, match="start"):
        plot.animate(motion, tmp_path / "snap.gif", start=24.0, stop=21.0)

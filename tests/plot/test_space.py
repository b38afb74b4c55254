"""A shell in three dimensions."""

import numpy as np
import pytest

from jshell import plot
from jshell.contour import azimuthal
from jshell.errors import BadName, BadValue
from jshell.plot.space import _surface


@pytest.fixture(scope="module")
def lifted(rest_R):
    """A motion across the axis, which is the order 1 with b = -c = 1."""
    splines = azimuthal(rest_R.meridian)
    _, _, g = splines.motion(1)
    one = np.linalg.lstsq(np.asarray(g.values[0]), 2 * np.ones(g.values.shape[1]), rcond=None)[0]
    return np.concatenate([np.zeros(2 * splines.size), one])


def test_a_shift_across_the_axis_moves_every_point_alike(rest_R, lifted):
    (x, y, z), _ = _surface(rest_R, 1, lifted, 0.2)
    (x0, y0, z0), _ = _surface(rest_R, 1, lifted, 1e-12)
    np.testing.assert_allclose([x - x0, z - z0], 0.0, atol=1e-10)
    np.testing.assert_allclose(y - y0, 0.2, atol=1e-10)


def test_a_picture_is_drawn_and_the_axisymmetric_order_is_refused(rest_R, lifted, tmp_path):
    axes = plot.in_space(rest_R, 1, lifted)
    assert plot.save(axes.figure, tmp_path / "shell.png").stat().st_size > 10_000
    with pytest.raises(BadValue, match="order"):
        plot.in_space(rest_R, 0, lifted)
    with pytest.raises(BadName, match="film"):
        plot.rotating(rest_R, 1, lifted, tmp_path / "film.mp4")

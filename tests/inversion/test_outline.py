"""Widths of the outline at shares of its height, against a fine polygon and small displacements."""

import jax.numpy as jnp
import numpy as np
import pytest

import jshell as js
from jshell.contour.splines import ParitySplines
from jshell.errors import Outcome
from jshell.inversion.response import ACROSS, _across, _highest

FINE = 200001
SHARES = list(ACROSS.values())


def seen_from_aside(shape, q):
    """Widths of a polygon's silhouette, by linear interpolation."""
    angles = np.linspace(0, np.pi, FINE)
    splines = (ParitySplines(np.asarray(shape.nodes), parity, shape.edge) for parity in ("even", "odd"))
    x, r = (made(angles) @ np.asarray(part) for made, part in zip(splines, shape.split(q), strict=True))
    heights = x[-1] + np.array(SHARES) * (x.max() - x[-1])
    outer = slice(int(np.argmax(x)), None)  # what a dimple hides is not seen
    return 2 * np.interp(heights, x[outer][::-1], r[outer][::-1])


@pytest.mark.long
def test_widths_and_their_changes_are_those_of_a_polygon(rest_R):
    shape, q = rest_R.meridian, rest_R.coordinates
    generator = np.random.default_rng(0)
    v = np.zeros((2, q.size))
    v[:, np.asarray(shape.active)] = generator.standard_normal((2, np.asarray(shape.free(q)).size))
    top = _highest(ParitySplines(shape.nodes, "even", shape.edge), shape.x_nodes, shape.split(q)[0])
    widths, changes = _across(shape, q, jnp.asarray(v, complex), top, shape.x_nodes[-1])
    np.testing.assert_allclose(widths, seen_from_aside(shape, q), rtol=1e-8)  # of a polygon with 2e5 corners
    step = 1e-6
    for direction, change in zip(v, np.asarray(changes), strict=True):
        ends = [seen_from_aside(shape, q + sign * step * direction) for sign in (1, -1)]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), np.real(change), rtol=1e-4)


@pytest.mark.long
@pytest.mark.usefixtures("no_compilation")
def test_an_outlines_widths_tell_more_than_height_and_width(make_recording):
    every = make_recording(channels=("H", "W", *ACROSS))
    ask = {"unknown": ("youngs_modulus", "gas_pressure"), "exact": False, "nuisance": False}
    sure, plain = (js.invert(every, channels=names, **ask) for names in (("H", "W", *ACROSS), None))
    assert plain.recordings[0].channels == ("H", "W")  # unless they are asked for
    assert sure.outcome == Outcome.OK, sure.report()
    for name, value in (("youngs_modulus", 0.5e6), ("gas_pressure", 0.5e6 * 0.15)):
        assert abs(sure[name].value - value) < 3.5 * sure[name].stderr
        assert sure[name].stderr < plain[name].stderr

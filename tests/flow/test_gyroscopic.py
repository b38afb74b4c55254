"""The derivative of the momentum with the shape, by shape calculus and by differentiation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import meridian
from jshell.flow import added_mass, flow, gyroscopic


def smooth(mesh, seed):
    """Four smooth motions: even polynomials of cos θ in x, sin θ times the same in r."""
    random = np.random.default_rng(seed)
    t = np.asarray(mesh.angles)
    waves = np.cos(np.arange(4)[:, None] * t[None])
    rows = []
    for _ in range(4):
        x, r = random.standard_normal((2, 4)) @ waves
        fit = lambda basis, values: np.linalg.lstsq(np.asarray(basis[0]), values, rcond=None)[0]  # noqa: E731
        rows.append(np.concatenate([fit(mesh.x_basis, x), fit(mesh.r_basis, r * np.sin(t))]))
    return jnp.asarray(np.stack(rows))


@jax.jit
def compared(mesh, ways, tests):
    """Both derivatives along the same displacements, tested against the same motions."""
    q = mesh.sphere + 0.04 * ways[0]
    u = ways[1]
    shaped = gyroscopic(mesh, q, flow(mesh, q), u)
    along = lambda way: jax.jvp(lambda q: added_mass(mesh, q) @ u, (q,), (way,))[1]  # noqa: E731
    return tests @ shaped @ ways.T, tests @ jax.vmap(along)(ways).T


@pytest.mark.long
def test_turning_converges_to_the_derivative_of_the_added_mass():
    errors = []
    for elements in (16, 32):
        mesh = meridian(elements)
        shaped, differentiated = compared(mesh, smooth(mesh, 3), smooth(mesh, 4))
        errors.append(float(jnp.abs(shaped - differentiated).max() / jnp.abs(differentiated).max()))
    # equal up to discretisation error only: second derivatives of a quintic, fourth order, a factor 16
    assert errors[1] < errors[0] / 4
    assert errors[1] < 1e-3

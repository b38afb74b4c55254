"""The step's derivative: matrices against actions on one velocity, and both against differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.dynamics import Losses, kick, modes
from jshell.dynamics.motion import Loads, advance, initialise
from jshell.dynamics.operators import dense, free
from jshell.dynamics.run import Setup, body_of
from jshell.membrane import WallLoss

ELEMENTS, STEP, RADIUS = 16, 1 / 60, 0.5


@pytest.fixture(scope="module")
def moving(R):
    """A body with every loss, a shape, and two velocities."""
    found = modes(R, elements=ELEMENTS, liquid="layer")
    rest = found.rest
    losses = Losses(wall=WallLoss(0.01, 0.02, 0.003))
    setup = Setup(rest.meridian, rest.profile, None, R, losses, jnp.asarray(0.1), "current")
    body = body_of(setup, rest.meridian)
    return body, rest.coordinates, kick(found, 0.02, (1, 2, 3)), kick(found, 0.02, (2, 4))


@pytest.fixture(scope="module")
def both(moving):
    return eqx.filter_jit(each_way)(*moving)


def each_way(body, q, u, v):
    """Every force by its matrix, and by its action."""
    matrices = dense(body, q, u)
    actions = free(body, q, u, matrices.inverse)
    y = actions.potential(v)
    f = jnp.cos(body.shape.angles)
    return {
        "mass": (matrices.M @ v, actions.on_wall(actions.mass(v, y))),
        "slip": (matrices.W @ v, actions.slip(v, y)),
        "slip transposed": (matrices.W.T @ f, actions.on_wall(actions.slip_transposed(f))),
        "gyroscopic": (matrices.T @ v, actions.on_wall(actions.gyroscopic(v))),
        "gyroscopic transposed": (matrices.T.T @ v, actions.gyroscopic_transposed(v)),
        "second order": (matrices.B @ v, actions.bulk(v)),
        "wall": (matrices.C @ v, actions.solid(v)),
        "kinetic gradient": (matrices.kinetic_gradient, actions.kinetic_gradient),
    }


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "mass",
        "slip",
        "slip transposed",
        "gyroscopic",
        "gyroscopic transposed",
        "second order",
        "wall",
        "kinetic gradient",
    ],
)
def test_actions_are_the_matrices(both, name):
    by_matrix, by_action = both[name]
    # rounding
    np.testing.assert_allclose(by_action, by_matrix, rtol=0, atol=1e-12 * np.abs(by_matrix).max())


@pytest.mark.long
def test_the_derivative_of_a_step_is_its_difference(moving):
    body, q, u, _ = moving
    load = jnp.asarray(1.62)
    rng = np.random.default_rng(0)
    state = eqx.filter_jit(initialise)(body, q, u, load, "current")
    slip = 0.1 * jnp.max(jnp.abs(u)) * rng.normal(size=state.memory.shape)  # a layer with a past
    state = state._replace(memory=slip)
    along = jax.tree.map(lambda a: 0.1 * jnp.max(jnp.abs(a)) * rng.normal(size=a.shape), state)

    def step(size):
        moved = jax.tree.map(lambda a, d: a + size * d, state, along)
        harder = eqx.tree_at(lambda b: b.conditions.gas_pressure, body, 0.9 + 0.1 * size)
        loads = Loads(load + size, load + size, load)
        return advance(harder, moved, loads, jnp.asarray(STEP), RADIUS, "current")

    h = 1e-5
    along_it = jax.jit(lambda size: jax.jvp(step, (size,), (jnp.asarray(1.0),)))  # value and slope: one program
    _, slope = along_it(jnp.asarray(0.0))
    (ahead, _), (behind, _) = along_it(jnp.asarray(h)), along_it(jnp.asarray(-h))
    for name, exact, a, b in zip(state._fields, slope, ahead, behind, strict=True):
        for one, up, down in zip(jax.tree.leaves(exact), jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
            difference = (up - down) / (2 * h)
            # h² times a third derivative, rounding over h
            size = max(float(np.abs(difference).max()), 1e-6)
            np.testing.assert_allclose(one, difference, rtol=0, atol=3e-7 * size, err_msg=name)

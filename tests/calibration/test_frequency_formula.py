"""The forms of eq:defw that carry derivatives by lanes agree with the formula itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.calibration.batch_shape import Block, coupled, shape, uncoupled
from jshell.calibration.frequency_model import weighted
from jshell.calibration.frequency_table import prepare
from jshell.calibration.resampling import Resamples, evaluate
from jshell.oscillator.linear import frequencies_of_square, squares

V, P, KAPPA, K_A = np.array([2.4, 3.1]), np.array([0.3, 1.4]), 1.4, 1.0
ALPHA1, ALPHA2, K = np.array([3.6, 9.0]), np.array([1.1, 0.8]), np.array([0.23, -0.1])


def test_numpy_and_jax_say_the_same_to_the_bit():
    own = np.stack(squares(V, P, ALPHA1, ALPHA2, K**2, KAPPA, K_A))
    for i in range(2):
        jax_own = frequencies_of_square(V[i], P[i], ALPHA1[i], ALPHA2[i], K[i] ** 2, kappa=KAPPA, area_modulus=K_A)
        np.testing.assert_allclose(np.asarray(jax_own), own[:, i], rtol=1e-15)


@pytest.mark.parametrize("scaled", [False, True])
def test_the_form_of_the_lanes_is_the_formula(scaled):
    random = np.random.default_rng(0)
    V, P, alpha1, alpha2, k2, K_A = np.exp(random.uniform(-1.0, 1.0, (6, 200)))
    unit = V**2 if scaled else 1.0
    a, b, by_k, _ = uncoupled(alpha1, alpha2, V / np.sqrt(unit), KAPPA * P / V * unit, K_A / (4 * np.pi))
    slow, fast, half, gap = coupled(a, b, by_k * k2)
    wanted = unit * np.stack(squares(V, P, alpha1, alpha2, k2, KAPPA, K_A))
    # the slow one is the small difference a b - c over the fast one: rounding is of the size of that
    np.testing.assert_allclose(fast, wanted[1], rtol=1e-14)
    np.testing.assert_allclose(slow, wanted[0], rtol=1e-14, atol=1e-14 * np.max(a * b / fast + by_k * k2 / fast))
    np.testing.assert_allclose([2 * half, 2 * gap], [a - b, fast - slow], rtol=1e-11, atol=1e-11)


@pytest.mark.long
def test_the_lanes_of_a_batch_have_the_frequencies_and_their_slopes():
    gas, wall = KAPPA * P / V, K_A / (4 * np.pi) * np.ones(2)
    blank, each = jnp.zeros((2, 32, 2)), jnp.ones(2)  # the record's samples do not matter here
    data = Block(blank, blank[:, 0], each, 32 * each, each, blank[:, 0], *map(jnp.asarray, (gas, wall, V)))
    rate = np.full(2, 0.05)
    u = jnp.asarray(np.stack([np.log(ALPHA1), np.log(ALPHA2), K, np.log(rate)]))
    with jax.numpy_rank_promotion("allow"):  # as lanes are computed
        found = shape(u, data)

    def damped(one, V, P):
        w2 = frequencies_of_square(V, P, jnp.exp(one[0]), jnp.exp(one[1]), one[2] ** 2, kappa=KAPPA, area_modulus=K_A)
        return jnp.sqrt(w2 - jnp.exp(one[3]) ** 2)

    for lane in range(2):
        own, slope = damped(u[:, lane], V[lane], P[lane]), jax.jacfwd(damped)(u[:, lane], V[lane], P[lane])
        np.testing.assert_allclose(found.damped[:, lane], own, rtol=1e-13)
        np.testing.assert_allclose(found.damped_slope[:, :, lane], np.asarray(slope).T, rtol=1e-10, atol=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("squared", [False, True])
def test_the_lanes_of_a_bootstrap_have_the_cost_of_the_table_and_its_slope(squared):
    table = {
        "V_e": np.array([2.4, 2.7, 3.0]), "P_e": np.array([0.3, 0.6, 1.1]),
        "omega_minus": np.array([0.71, 0.86, np.nan]), "omega_plus": np.array([1.52, 1.44, 1.49]),
    }  # fmt: skip
    rows = prepare(table).rows
    weight = np.isfinite(rows.omega)[:, :, None] * np.ones(2)
    data = Resamples(rows, jnp.asarray(weight), jnp.full(2, 3.0), jnp.ones(2))
    u = jnp.asarray(np.stack([np.log(ALPHA1), np.log(ALPHA2), K**2]))
    with jax.numpy_rank_promotion("allow"):
        found = evaluate(u, data, squared)
    kind = "V_e^2 omega^2" if squared else "V_e omega"

    def cost(one):
        return jnp.sum(weighted(jnp.array([jnp.exp(one[0]), jnp.exp(one[1]), one[2]]), rows, kind) ** 2)

    for lane in range(2):
        assert float(found.cost[lane]) == pytest.approx(float(cost(u[:, lane])), rel=1e-12)
        # the kernel's gradient is that of half the cost, downhill
        slope = -jax.grad(cost)(u[:, lane]) / 2
        np.testing.assert_allclose(found.gradient[:, lane], slope, rtol=1e-9, atol=1e-12)

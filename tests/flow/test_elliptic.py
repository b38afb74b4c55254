"""Complete elliptic integrals against 50-digit arithmetic."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from jshell.flow import complete

# from a ring a billionth of a radius away to a ring seen from the axis; 0.999 and 0.9995 lie on both
# sides of the change of formula in the derivative
POINTS = np.concatenate([10.0 ** np.arange(-20, 0), np.linspace(0.1, 1, 37), [0.9985, 0.999, 0.9991, 0.9995, 1 - 1e-9]])


def exactly(function, m1):
    with mpmath.workdps(50):
        return [float(function(1 - mpmath.mpf(float(m)))) for m in m1]


def test_values_equal_fifty_digit_arithmetic():
    K, E = jax.jit(complete)(jnp.asarray(POINTS))
    # a few units in the last place: the module states 2e-16 and 2e-15 of its polynomials
    np.testing.assert_allclose(K, exactly(mpmath.ellipk, POINTS), rtol=1e-15)
    np.testing.assert_allclose(E, exactly(mpmath.ellipe, POINTS), rtol=4e-15)


@pytest.mark.parametrize(("index", "function"), [(0, mpmath.ellipk), (1, mpmath.ellipe)], ids=["K", "E"])
def test_derivatives_equal_fifty_digit_arithmetic(index, function):
    slope = jax.jit(jax.vmap(jax.grad(lambda m1: complete(m1)[index])))(jnp.asarray(POINTS))
    with mpmath.workdps(60):
        # step far below the smallest point, digits far beyond the step
        exact = [
            float((function(1 - m - h) - function(1 - m + h)) / (2 * h))
            for m, h in ((mpmath.mpf(float(m)), mpmath.mpf(float(m)) * mpmath.mpf(10) ** -15) for m in POINTS)
        ]
    # the quotient loses three digits where it hands over to the series
    np.testing.assert_allclose(slope, exact, rtol=1e-11)

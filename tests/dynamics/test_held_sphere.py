"""A stress-free sphere on a holder in the exact liquid, without splines or boundary integrals: NumPy alone.

Displacements are polynomials that are clamped at the pad's edge; the liquid is the closed form of every degree n.
"""

import numpy as np
import pytest
from numpy.polynomial import legendre

from jshell.dynamics import modes

BENDING, SHEAR = 1 / 9, 1 / 3  # over d̂² and 1, ν = ½


def clamped(pad, size):
    """cosθ and weights of points off the pad, displacements outward and along, and the strains of both."""
    edge = np.cos(np.pi - pad)
    t, weights = legendre.leggauss(1600)
    half = (1 - edge) / 2
    x = edge + half * (t + 1)
    y, square, z = (x - edge)[:, None], (1 - x**2)[:, None], x[:, None]
    p = legendre.legvander(t, size)
    unit = np.eye(size + 1)
    p1, p2 = (legendre.legval(t, legendre.legder(unit, k)).T / half**k for k in (1, 2))
    # outward y² p, along sinθ y p: position and slope are held, the stretch is not
    out, out1, out2 = y**2 * p, 2 * y * p + y**2 * p1, 2 * p + 4 * y * p1 + y**2 * p2
    way, way1 = y * p, p + y * p1
    along1, across = z * way - square * way1, z * way  # du/dθ, u cotθ
    swelling = np.hstack([2 * out, along1 + across])
    shearing = np.hstack([0 * out, along1 - across])
    bending = np.hstack([square * out2 - 2 * z * out1 + 2 * out, 0 * way])
    return x, 2 * np.pi * half * weights, out, way, (swelling, shearing, bending)


def by_degree(x, weights, out, way, degrees):
    """Parts P_n outward and dP_n/dθ along of every displacement, (degrees, displacements)."""
    A, B = np.zeros((2, degrees + 1, 2 * out.shape[1]))
    before, p = np.zeros_like(x), np.ones_like(x)
    for n in range(degrees + 1):
        A[n, : out.shape[1]] = (2 * n + 1) / (4 * np.pi) * (out.T @ (weights * p))
        if n:
            slope = -n * (before - x * p)  # sinθ dP_n/dθ
            B[n, out.shape[1] :] = (2 * n + 1) / (4 * np.pi * n * (n + 1)) * (way.T @ (weights * slope))
        before, p = p, ((2 * n + 1) * x * p - n * before) / (n + 1)
    return A, B


def impedances(decay, degrees):
    """Z/η̂ of every degree: outward, mixed, along; the closed form, Bessel functions by recursion."""
    n = np.arange(degrees + 1)
    L = n * (n + 1)
    ratio = np.empty(degrees + 1, complex)  # k_{n+1}/k_n
    ratio[0] = 1 + 1 / decay
    for k in n[1:]:
        ratio[k] = 1 / ratio[k - 1] + (2 * k + 1) / decay
    p = -(n + 1) - decay * np.concatenate([[1.0], 1 / ratio[:-1]])
    det = -(n + 1) * (1 + p) - L
    rows = []
    for A, B in np.eye(2):
        c, d = ((1 + p) * A - L * B) / det, (-(n + 1) * B - A) / det
        rows.append((-(decay**2 * c + 2 * (-2 * A + L * B)), -L * (-(n + 2) * c + d * (decay**2 + L - p - 1) - B + A)))
    size = 4 * np.pi / (2 * n + 1)
    return size * rows[0][0], size * rows[1][0], size * rows[1][1]


def held_roots(pad, thickness, viscosity, count, size, degrees):
    """The slowest roots s of K + s Z of a stress-free sphere on a pad, followed from the ideal liquid.

    With `size` polynomials of each displacement and so many `degrees` of the liquid. At a pad of 0.3272, 32 and 1600
    move what 24 and 800 give by 7e-6 in |s|, 2e-5 in τ, at 0.6 by nothing; at 0.2 40 and 1600 move 32 and 800 by 8e-5
    and 1.4e-4.
    """
    x, weights, out, way, strains = clamped(pad, size)
    K = sum(
        modulus * (part * weights[:, None]).T @ part
        for modulus, part in zip((1, SHEAR, BENDING * thickness**2), strains, strict=True)
    )
    A, B = by_degree(x, weights, out, way, degrees)

    def T(s, eta):
        one, mixed, two = impedances(np.sqrt(s / eta), degrees)
        both = (A * mixed[:, None]).T @ B
        return K + s * eta * ((A * one[:, None]).T @ A + both + both.T + (B * two[:, None]).T @ B)

    n = np.arange(degrees + 1)
    M = (A * (4 * np.pi / ((2 * n + 1) * (n + 1)))[:, None]).T @ A
    back = np.linalg.inv(np.linalg.cholesky(K)).T
    squares, motions = np.linalg.eigh(back.T @ M @ back)
    roots = []
    for k in range(1, count + 1):
        s, v = 1j / np.sqrt(squares[-k]), (back @ motions[:, -k]).astype(complex)
        for eta in np.linspace(0.15, 1, 7) ** 2 * viscosity:
            for _ in range(12):
                h = 1e-5 * abs(s)
                here, slope = T(s, eta), (T(s + h, eta) - T(s - h, eta)) / (2 * h)
                v = np.linalg.solve(here, slope @ v)
                v /= np.linalg.norm(v)
                change = (v @ here @ v) / (v @ slope @ v)
                s = s - change
                if abs(change) < 1e-10 * abs(s):
                    break
        roots.append(s)
    return np.array(roots)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thickness", "pad", "viscosity", "size", "degrees"),
    [
        (0.22, 0.2, 0.004, 40, 1600),
        (0.22, 0.3272, 0.004, 24, 800),
        (0.22, 0.45, 0.013, 24, 800),
        (0.1, 0.6, 6e-4, 24, 800),
    ],
)
def test_a_held_sphere_rings_as_polynomials_in_the_closed_form_of_the_liquid(
    thickness, pad, viscosity, size, degrees, make_problem
):
    known = held_roots(pad, thickness, viscosity, 3, size, degrees)
    rates = np.asarray(modes(make_problem(thickness, 1e-9, 1e-9, viscosity), branch="sphere", attached=pad).rate)
    found = rates[np.argmin(np.abs(rates[:, None] - known), axis=0)]
    # what is asked of modes in the exact liquid
    np.testing.assert_allclose(np.abs(found), np.abs(known), rtol=2e-4)
    np.testing.assert_allclose(found.real, known.real, rtol=5e-4)

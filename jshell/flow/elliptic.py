"""Complete elliptic integrals K and E, in terms of the complementary parameter.

A ring of sources is felt through K(m) and E(m) with 1 - m = ρ₋²/ρ₊², the
squared ratio of the shortest to the longest distance. Near its own ring 1 - m
is tiny, so it is the argument: no digits are lost where they matter most.

    K, E = P(1-m) - log(1-m) Q(1-m),   P, Q polynomials of degree 10

Symbols    m1 = 1 - m, complementary parameter [-], 0 < m1 <= 1
Accuracy   2e-16 (K) and 2e-15 (E) relative, against 50-digit arithmetic
Source     the form: Hastings 1955; the coefficients: relative least squares in
           50-digit arithmetic on Chebyshev points of (0, 1], made for this file
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_K_POLYNOMIAL = (
    1.386294361119892,
    0.09657359029121192,
    0.030885152388790953,
    0.014938688379742297,
    0.008810037201068507,
    0.006372276309600524,
    0.007415231599283511,
    0.010075098923177353,
    0.007395812853526722,
    0.0019285093314404399,
    0.00010756839716247939,
)
_K_LOGARITHM = (
    0.4999999999999999,
    0.12499999999857572,
    0.07031249867353752,
    0.04882788516469119,
    0.03737132056018661,
    0.030034941166413857,
    0.023456329975730505,
    0.014557183439982007,
    0.005241502914969563,
    0.0007521522196445506,
    2.2610986035577812e-05,
)
_E_POLYNOMIAL = (
    1.0000000000000007,
    0.44314718056716973,
    0.056805198369549,
    0.02183223669120082,
    0.01158243724730348,
    0.007717894968984932,
    0.008182980331841847,
    0.01091563499139161,
    0.008250353353383512,
    0.00223321484221139,
    0.00012919543185954007,
)
_E_LOGARITHM = (
    -6.444884221948049e-17,
    0.24999999999909742,
    0.09374999906112888,
    0.05859356277978339,
    0.042713824778597725,
    0.033421727808403905,
    0.025841552848186348,
    0.016181866993433314,
    0.005964017959775874,
    0.0008815863047422527,
    2.7332638494865596e-05,
)


def _horner(coefficients: tuple[float, ...], m1: Float[Array, "..."]) -> Float[Array, "..."]:
    total = jnp.full_like(m1, coefficients[-1])
    for c in coefficients[-2::-1]:
        total = total * m1 + c
    return total


@jax.custom_jvp
def complete(m1: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """K and E at the complementary parameter m1 = 1 - m.

    Args:
        m1: Complementary parameter [-], 0 < m1 <= 1.

    Returns:
        K(1 - m1) and E(1 - m1); their derivatives follow from K and E themselves.

    Source:
        DLMF 19.4.1-2 for the derivatives.

    Example:
        >>> from jshell.flow.elliptic import complete
        >>> import jax.numpy as jnp
        >>> print(complete(jnp.array(0.5))[0].round(10))
        1.8540746773
    """
    log = jnp.log(m1)
    K = _horner(_K_POLYNOMIAL, m1) - log * _horner(_K_LOGARITHM, m1)
    E = _horner(_E_POLYNOMIAL, m1) - log * _horner(_E_LOGARITHM, m1)
    return K, E


@complete.defjvp
def _derivatives(primals, tangents):
    (m1,), (dm1,) = primals, tangents
    K, E = complete(m1)
    m = 1 - m1

    # (E - m1 K)/m and (E - K)/m are smooth at m = 0, but not as quotients: series there.
    near = m < 1e-3
    safe = jnp.where(near, 1.0, m)
    half_pi = jnp.pi / 2
    first = half_pi * (1 / 2 + m * (1 / 16 + m * (3 / 128 + m * 25 / 2048)))
    second = -half_pi * (1 / 2 + m * (3 / 16 + m * (15 / 128 + m * 175 / 2048)))
    to_K = jnp.where(near, first, (E - m1 * K) / safe)
    to_E = jnp.where(near, second, (E - K) / safe)
    return (K, E), (-to_K / (2 * m1) * dm1, -to_E / 2 * dm1)

"""The plateau: the pressure difference that holds a dimpled shell, computed or by law.

A law is a power of the thickness fitted to such computations; the solver has
no range but that of its shapes, and knows that the plateau is not quite flat.

Symbols    ΔP_pl plateau [E d/R0]   V volume [R0³]
Source     Mokbel et al. 2021: eq:equiplateau for the law
"""

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.membrane.energy import Area
from jshell.membrane.equilibrium import raise_unless_ok
from jshell.membrane.rest import rest
from jshell.shell import rest as laws
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced

Law = Literal["solver", "coupier2019", "pogorelov"]


def plateau_pressure(
    thickness: Scalar,
    poisson_ratio: Scalar = 0.5,
    *,
    law: Law | str = "solver",
    volume_ratio: Scalar = 0.7,
    area: Area | str = "current",
    elements: int = 32,
) -> Float[Array, ""]:
    """Pressure difference that holds a dimpled shell [E d/R0].

    Args:
        thickness: d̂ [-].
        poisson_ratio: ν [-].
        law: `solver` computes it; `coupier2019` and `pogorelov` are the laws of `jshell.shell.plateau_pressure`.
        volume_ratio: V/V0 at which it is computed; the laws know no volume.
        area: Which elastic energy, for the solver.
        elements: Elements of the meridian, for the solver.

    Raises:
        BadName: Another law.
        NotOk: The solver found no dimpled shape.

    Example:
        >>> from jshell.membrane import plateau_pressure
        >>> print(f"{float(plateau_pressure(0.1)):.5f}")
        0.03073
    """
    if law != "solver":
        laws.warn_outside_plateau_range(thickness, law)
        return jnp.asarray(laws.plateau_pressure(thickness, poisson_ratio, law))
    conditions = Reduced(thickness, 1.0, 1.0, 0.0, 1.4, poisson_ratio)
    found = rest(conditions, volume_ratio=volume_ratio, area=area, elements=elements)
    raise_unless_ok("plateau", found.outcome)
    return found.difference

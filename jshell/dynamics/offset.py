"""The source's trick of an offset on both pressures, which keeps the shape.

Symbols    P_ext outer pressure, δP offset [E d/R0]   V volume [R0³]
Source     Mokbel et al. 2021, numerical method: offset δP of both pressures
"""

from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import gas_pressure


def offset(conditions: Reduced, volume: Number, amount: Number) -> Reduced:
    """The problem with an offset on both pressures at a given volume: the same rest shape, a stiffer gas.

    Args:
        conditions: The problem.
        volume: Volume of the rest shape that is kept [R0³].
        amount: δP added to the inner pressure at that volume and to the outer pressure [E d/R0].

    Source:
        The source's family at fixed shape, fig. of ω against the pressure.

    Example:
        >>> import jshell as js
        >>> R = js.presets.R.conditions
        >>> shape = js.membrane.rest(R)
        >>> stiffer = js.dynamics.offset(R, shape.volume, 1.0)
        >>> print(js.membrane.rest(stiffer).volume_ratio.round(4), shape.volume_ratio.round(4))
        0.6992 0.6992
    """
    c = conditions
    pressure = gas_pressure(volume, c) + amount
    filled = pressure * (volume / SPHERE_VOLUME) ** c.kappa
    return c.replace(gas_pressure=filled, outer_pressure=c.outer_pressure + amount)

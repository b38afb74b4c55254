"""What takes energy from a moving shell, alone or together.

The liquid sticks to the wall: its Stokes layer resists the slip of the wall over
the potential flow with the half-order derivative of Basset, as a sum of
exponentials or at one reference frequency, and to second order with a resistance
of the moving shape. Or the wall slips freely, as a clean bubble's, and the
potential flow itself loses 2η e:e. Beside them, where asked: the wall's own
viscosity, and the source's drag law of a settling sphere read at the buckling
pole.

Symbols    η̂ viscosity   w slip of the wall   a_k, x_k weights and rates of the memory
Valid for  η̂ << 1: to second order 2 % in τ at η̂ = 0.013, 8 % at 0.05
Source     Landau and Lifshitz, Fluid Mechanics, § 24; Lamb, art. 348; Mokbel et al. 2021, section "Damping"
"""

from collections.abc import Callable
from typing import Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.errors import BadValue, choose
from jshell.flow import single_frequency
from jshell.membrane import WallLoss
from jshell.memory import HalfDerivative, half_derivative
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Number

Stokes = Literal["memory", "frequency", "none"]
STOKES = ("memory", "frequency", "none")


class Losses(eqx.Module):
    """Which losses act.

    Args:
        stokes: `memory`: the half-order derivative over the band of `half`; `frequency`: at one reference
            frequency, cheaper and exact there; `none`.
        half: The half-order derivative; its band must hold the motion's frequencies.
        frequency: Reference frequency of `frequency`, real, or a mode's complex rate (`Modes.rate`) [1/time].
        order: Order of the layer in √η̂: 2, or 1 for the layer alone, whose decay times are a fifth too long at
            η̂ = 0.004.
        bulk: Whether the potential flow itself loses 2η e:e, the whole loss of a clean bubble: for a wall that slips
            freely, `stokes="none"`.
        wall: The wall's own viscosity, or None.
        drag: A law that gives 2/τ from the squared speed of the buckling pole and η̂ by its method
            `rate`, such as `jshell.oscillator.Reynolds()`; the source's alternative to a Stokes layer. Or None.

    Raises:
        BadName, BadValue: A choice that does not exist, a frequency missing, or bulk loss on a wall that sticks.

    Example:
        >>> from jshell.dynamics import Losses
        >>> Losses(stokes="none", bulk=True).bulk
        True
    """

    stokes: str = eqx.field(static=True, default="memory")
    half: HalfDerivative | None = None
    frequency: Number | complex | None = None
    order: int = eqx.field(static=True, default=2)
    bulk: bool = eqx.field(static=True, default=False)
    wall: WallLoss | None = None
    drag: Any = None

    def __check_init__(self) -> None:
        choose("stokes", self.stokes, STOKES, remedy="memory is usual.")
        if self.stokes == "frequency":
            _check_frequency(self.frequency)
        if self.order not in (1, 2):
            raise BadValue("order", found=repr(self.order), expected="1 or 2", remedy="2 is usual.")
        if self.bulk and self.stokes != "none":
            raise BadValue(
                "bulk",
                found=f"bulk loss beside the Stokes layer, stokes={self.stokes!r}",
                expected="bulk loss on a wall that slips freely",
                remedy="Where the liquid sticks, 2η e:e is one of four terms of its order, and alone takes τ a quarter "
                "too far: leave it out, order=2 has all four. For a clean bubble pass stokes='none'.",
            )
        if self.drag is not None and not isinstance(getattr(self.drag, "rate", None), Callable):
            raise BadValue(
                "drag",
                found=type(self.drag).__name__,
                expected="a law with a method `rate(squared speed, viscosity)`",
                remedy="Pass jshell.oscillator.Reynolds().",
            )

    @property
    def second(self) -> bool:
        """Whether the layer acts to second order."""
        return self.stokes != "none" and self.order == 2


NO_LOSSES = Losses(stokes="none")


def _check_frequency(given) -> None:
    oscillation = np.imag(given) if np.iscomplexobj(given) else given
    concrete = not isinstance(given, Tracer)
    if given is None or (concrete and not (np.isfinite(given) and oscillation > 0)):
        raise BadValue(
            "stokes_frequency",
            found=repr(given),
            expected="a frequency above 0",
            remedy="1.2 is near the first modes of R; or use the memory, which needs none.",
        )


def layer(losses: Losses, viscosity: Scalar) -> HalfDerivative:
    """The Stokes layer's impedance per area: the half-order derivative times sqrt(η̂)."""
    none = jnp.zeros(0)
    if losses.stokes == "frequency":
        one = single_frequency(viscosity, losses.frequency)  # type: ignore[arg-type]
        return HalfDerivative(none, none, jnp.asarray(one.resistance), jnp.asarray(one.mass))
    if losses.stokes == "none":
        return HalfDerivative(none, none, jnp.asarray(0.0), jnp.asarray(0.0))
    half = half_derivative() if losses.half is None else losses.half
    root = jnp.sqrt(jnp.maximum(viscosity, 1e-300))  # a finite derivative at no viscosity
    root = jnp.where(viscosity > 0, root, 0.0)
    return HalfDerivative(half.rates, root * half.weights, root * half.resistance, root * half.mass)


def drag_rate(losses: Losses, speed: Float[Array, ""], viscosity: Scalar) -> Float[Array, ""]:
    """2/τ of the drag law at the buckling pole's speed [1/time]."""
    if losses.drag is None:
        return jnp.asarray(0.0)
    return jnp.asarray(losses.drag.rate(speed**2, viscosity))

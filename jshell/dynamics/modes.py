"""Small vibrations of a shell about its rest shape, of every order around the axis: the door.

m = 0 keeps the axial symmetry of the shell, m >= 1 varies as cos mφ around it.

Symbols    m order around the axis   η̂ viscosity   δ = √(2η̂/ω) thickness of the Stokes layer [R0]
Valid for  as `vibrations` (m = 0) and `azimuthal` (m >= 1)
Source     `vibrations`, `azimuthal`
"""

import warnings
from collections.abc import Sequence
from typing import Unpack, overload

import jax
import numpy as np
from jax.core import Tracer

from jshell.contour import NO_WEAK_SPOT, WeakSpot
from jshell.dynamics.all_modes import AllModes, checked_azimuth
from jshell.dynamics.azimuthal import LIQUID_AROUND, check_count, check_order_liquid, orders_about, warn_of_thick_order
from jshell.dynamics.roots import Liquid, check_liquid
from jshell.dynamics.vibrations import Modes, vibrations
from jshell.errors import BadValue, RangeWarning
from jshell.membrane import WallLoss, rest
from jshell.membrane.energy import Area
from jshell.membrane.equilibrium import raise_unless_ok
from jshell.membrane.rest import ELEMENTS, Branch, RestOptions
from jshell.shell.parameters import Reduced

THICKEST = {"layer": 0.1, "second": 0.25}  # √(2η̂/ω) up to which each order is off by 15 and 5 % in τ at most [R0]


@overload
def modes(
    conditions: Reduced,
    *,
    azimuth: None = None,
    count: int = 4,
    liquid: Liquid | str | None = None,
    wall_loss: WallLoss | None = None,
    stokes_layer: bool | None = None,
    throw: bool = False,
    **shape: Unpack[RestOptions],
) -> Modes: ...


@overload
def modes(
    conditions: Reduced,
    *,
    azimuth: int | Sequence[int],
    count: int = 4,
    liquid: Liquid | str | None = None,
    wall_loss: WallLoss | None = None,
    throw: bool = False,
    **shape: Unpack[RestOptions],
) -> AllModes: ...


def modes(
    conditions: Reduced,
    *,
    azimuth: int | Sequence[int] | None = None,
    count: int = 4,
    liquid: Liquid | str | None = None,
    wall_loss: WallLoss | None = None,
    stokes_layer: bool | None = None,
    branch: Branch | str = "buckled",
    elements: int = ELEMENTS,
    attached: float = 0.0,
    weak_spot: WeakSpot = NO_WEAK_SPOT,
    area: Area | str = "current",
    throw: bool = False,
) -> Modes | AllModes:
    """Small vibrations about a rest shape; differentiable and vmappable in the conditions.

    Args:
        conditions: The problem without units.
        azimuth: Orders m around the axis, as (0, 1, 2, 3); `AllModes` come back then. By default the axisymmetric
            `Modes` alone.
        count: How many modes of each order, slowest first; oscillating ones only, the translation left out.
        liquid: What the liquid is: `exact`, viscous at any η̂; `second`, a Stokes layer to second order, a tenth
            of the work and right to 0.6 % in τ at η̂ = 0.004, 2 % at 0.013; `layer`, to first order, which makes τ
            a fifth too long at η̂ = 0.004; `ideal`, without viscosity. By default `exact` for m = 0 and `second`
            for m >= 1, where the exact one is not known.
        wall_loss: What the wall loses itself, of m = 0; with it a mode's decay is that of liquid and wall together.
        stokes_layer: Deprecated: True is `layer`, False is `ideal`.
        branch, elements, attached, weak_spot, area: As in `jshell.membrane.rest`.
        throw: Raise `NotOk` unless rest shape and all modes are ok (outside `jit` only).

    Raises:
        BadName: No such liquid; `exact` asked for m >= 1.
        BadValue: `count` is not between 1 and a quarter of the coordinates (m = 0) or of the elements (m >= 1); an
            order is not a whole number from 0 to 40; `wall_loss` asked for m >= 1.

    Warns:
        RangeWarning: A Stokes layer too thick for `layer` (0.1 R0) or `second` (0.25 R0), with the exact modes; or,
            of m >= 1, thicker than half the length over which the motion varies.

    Example:
        >>> import jshell as js
        >>> found = js.dynamics.modes(js.presets.R.conditions, liquid="ideal")
        >>> print(found.omega.round(3))
        [1.19  1.981 2.931 4.269]
    """
    if stokes_layer is not None:
        liquid = "layer" if stokes_layer else "ideal"
        warnings.warn(
            f"stokes_layer={stokes_layer} is now liquid={liquid!r}; the default, liquid='exact', is right at any "
            "viscosity",
            DeprecationWarning,
            stacklevel=2,
        )
    orders = (0,) if azimuth is None else checked_azimuth(azimuth)
    beyond = tuple(m for m in orders if m)
    along = "exact" if liquid is None else liquid
    around = LIQUID_AROUND if liquid is None else liquid
    check_liquid(along)
    if beyond:
        _refuse_wall_loss(wall_loss, beyond)
        check_order_liquid(around)
        check_count(count, elements)
    if not 1 <= count <= elements // 2:
        raise BadValue(
            "count", found=repr(count), expected=f"1 to {elements // 2}", remedy="Raise `elements` for more modes."
        )
    conditions = conditions.as_arrays()
    state = rest(
        conditions, branch=branch, elements=elements, attached=attached, weak_spot=weak_spot, area=area, throw=throw
    )
    axial = vibrations(state, conditions, count, along, area, wall_loss) if 0 in orders else None
    others = orders_about(state, beyond, count, around) if beyond else None
    found = AllModes(axial, others)
    if throw:
        raise_unless_ok("modes", found.worst)
    if axial is not None:
        _warn_of_thick_layer(axial, conditions, along, area, wall_loss)
    if others is not None:
        warn_of_thick_order(others, around)
    return axial if azimuth is None and axial is not None else found


def _refuse_wall_loss(loss: WallLoss | None, orders: Sequence[int]) -> None:
    if loss is not None:
        raise BadValue(
            "wall_loss", found=f"a loss of the wall and order m = {orders[0]}", expected="m = 0 alone",
            remedy="Leave out azimuth or wall_loss: around the axis the wall's loss is not known.",
        )  # fmt: skip


def _warn_of_thick_layer(
    found: Modes, conditions: Reduced, liquid: str, area: Area | str, loss: WallLoss | None
) -> None:
    """Warn where the layer is too thick for its series, with the exact modes beside (one concrete shell only)."""
    omega, viscosity = jax.lax.stop_gradient((found.omega, conditions.viscosity))
    if liquid not in THICKEST or isinstance(omega, Tracer) or isinstance(viscosity, Tracer) or np.ndim(viscosity):
        return
    thickest = float(np.max(np.sqrt(2 * float(viscosity) / np.nan_to_num(np.asarray(omega), nan=np.inf))))
    if thickest <= THICKEST[liquid]:
        return
    exact = vibrations(jax.lax.stop_gradient(found.rest), conditions, min(2, omega.shape[0]), "exact", area, loss)
    beside = [
        f"tau {row.tau:.3g}, " + (f"omega {row.omega:.3g}" if row.omega is not None else row.outcome)
        for row in exact.table()
        if row.tau is not None
    ]
    warnings.warn(
        f"the Stokes layer is {thickest:.2g} R0 thick, liquid={liquid!r} is made for less than "
        f"{THICKEST[liquid]:g}; liquid='exact' says: {'; '.join(beside)}",
        RangeWarning,
        stacklevel=3,
    )

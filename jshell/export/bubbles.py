"""The buckled branch as input of two bubble codes, jbubble and APECSS.

Both solve ρ (R R̈ + 3/2 Ṙ²) = P_gas - 2σ(R)/R - 4κ_s Ṙ/R² - 4µ Ṙ/R - P_ext for the radius R of a sphere of the shell's
volume. The law becomes a surface tension σ(R) and a surface viscosity κ_s(R); its mass, a density ρ, that of the rest
state: elsewhere it is off by M(V) R over that at rest. The branch alone: where it ends, the shell is a sphere again.

Source     jbubble 0.1.1: `Property`, `LipidShell`, `RayleighPlesset`, `PolytropicGas`
           APECSS 1.8 manual: sections "The *.apecss options file", "Gas-liquid interface"; struct APECSS_Interface
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jshell.export.law import RadialLaw
from jshell.io.files import write_bytes

Values = Float[np.ndarray, "rows"]


class _Radial(NamedTuple):
    """The buckled branch by radius [m]: σ [N/m], κ_s [kg/s]; and at rest radius, gas pressure, density, σ, κ_s."""

    radius: Values
    tension: Values
    surface_viscosity: Values
    rest: tuple[float, float, float, float, float]


def _radial(law: RadialLaw, exponent: float) -> _Radial:
    """The law with a gas of an exponent."""
    row = law.buckled
    R = row.radius
    rest = float(np.cbrt(3 * law.rest_volume / (4 * np.pi)))
    at = lambda part: float(np.interp(rest, R, part))  # noqa: E731
    gas_at_rest = at(row.gas * R ** (3 * law.kappa)) / rest ** (3 * law.kappa)
    gas = gas_at_rest * (rest / R) ** (3 * exponent)
    tension, viscosity = (gas - row.pressure) * R / 2, np.pi * row.damping * R**4
    # both codes take the gas at rest from σ: P_gas = P_ext + 2σ/R
    held = (gas_at_rest - law.rest_pressure) * rest / 2
    return _Radial(R, tension, viscosity, (rest, gas_at_rest, 4 * np.pi * rest * at(row.mass), held, at(viscosity)))


def _effective_exponent(law: RadialLaw) -> float:
    """Exponent of a gas that, under a constant σ, is as stiff as gas and wall together at rest."""
    row = _radial(law, law.kappa)
    rest, gas, _, held, _ = row.rest
    slope = float(np.interp(rest, row.radius, np.gradient(law.buckled.pressure, row.radius, edge_order=2)))
    return (2 * held / rest - slope * rest) / (3 * gas)


def _numbers(values: Values, indent: str = "    ") -> str:
    rows = [", ".join(f"{value:.12e}" for value in values[k : k + 6]) for k in range(0, len(values), 6)]
    return ",\n".join(indent + row for row in rows)


def write_jbubble(path: str | Path, law: RadialLaw) -> None:
    """Write a Python module for jbubble: `equation_of_motion()` gives its `RayleighPlesset` of the buckled shell.

    Args:
        path: `.py`.
        law: From `radial_law`.

    Raises:
        BadFile: Nothing can be written there.
    """
    row = _radial(law, law.kappa)
    rest, _, density, _, _ = row.rest
    text = f'''"""The buckled branch of a shell for jbubble, by jshell: R [m], SIGMA [N/m], KAPPA_S [kg/s].

RHO is the density that gives the shell's inertia at rest; the liquid's own is {law.density:.10g} kg/m^3.
Beyond the last radius the dimple is gone and the shell is a sphere: the table holds no more.
"""

R0, P_AMB, RHO, GAMMA = {rest:.12e}, {law.rest_pressure:.12e}, {density:.12e}, {law.kappa:.12g}
R = (
{_numbers(row.radius)},
)
SIGMA = (
{_numbers(row.tension)},
)
KAPPA_S = (
{_numbers(row.surface_viscosity)},
)


def equation_of_motion():
    """The equation of motion: jbubble.run_simulation(equation_of_motion(), pulse, ...)."""
    import jax.numpy as jnp
    from jbubble.bubble.eom import RayleighPlesset
    from jbubble.bubble.gas import PolytropicGas
    from jbubble.bubble.medium import NewtonianMedium
    from jbubble.bubble.property import Property
    from jbubble.bubble.shell import LipidShell

    class Table(Property):
        values: tuple

        def __call__(self, state):
            return jnp.interp(state.R, jnp.asarray(R), jnp.asarray(self.values))

    return RayleighPlesset(
        gas=PolytropicGas(gamma=GAMMA),
        shell=LipidShell(sigma=Table(SIGMA), kappa_s=Table(KAPPA_S)),
        medium=NewtonianMedium(mu=0.0),
        R0=R0,
        P_amb=P_AMB,
        rho_L=RHO,
    )
'''
    write_bytes(path, text.encode())


def write_apecss(path: str | Path, law: RadialLaw) -> None:
    """Write an options file for APECSS, and beside it a C header with the table for large motion.

    The options alone are right for small motion: a gas whose exponent makes it as stiff as gas and wall together.
    The header adds σ(R) and κ_s(R): included, `jshell_attach(Interface)` after `apecss_interface_processoptions`.

    Args:
        path: `.apecss`; the header is the same name with `.h`.
        law: From `radial_law`.

    Raises:
        BadFile: Nothing can be written there.
    """
    path = Path(path)
    exponent = _effective_exponent(law)
    row = _radial(law, exponent)
    rest, gas, density, held, viscosity = row.rest
    options = f"""# A buckled shell for APECSS, written by jshell.
# Small motion about rest: PolytropicExponent stands for gas and wall ({law.kappa:.6g} is the gas's own),
# ReferenceDensity for the shell's inertia ({law.density:.6g} kg/m^3 is the liquid's own),
# Viscosity for all losses ({law.viscosity:.6g} Pa s is the liquid's own). {path.with_suffix(".h").name}: large motion.
BUBBLE
RPModel RP
InitialRadius {rest:.12e}
PressureAmbient {law.rest_pressure:.12e}
InitialGasPressure {gas:.12e}
END
GAS
EoS IG
ReferencePressure {gas:.12e}
PolytropicExponent {exponent:.12e}
END
LIQUID
LiquidType Newtonian
ReferenceDensity {density:.12e}
Viscosity {viscosity / rest:.12e}
END
INTERFACE
SurfaceTensionCoeff {held:.12e}
LipidCoatingModel None
END
"""
    write_bytes(path, options.encode())
    write_bytes(path.with_suffix(".h"), _header(path.name, row).encode())


def _header(name: str, row: _Radial) -> str:
    rest, count = row.rest[0], len(row.radius)
    return f"""/* The buckled branch behind {name}, written by jshell: R [m], sigma [N/m], kappa_s [kg/s].
   After apecss_interface_processoptions(Interface): jshell_attach(Interface). The losses of the options file are in
   its Viscosity; jshell_kappa_s holds what differs from them away from rest. */
#ifndef JSHELL_LAW_H
#define JSHELL_LAW_H
#include "apecss.h"

#define JSHELL_ROWS {count}
static const double jshell_R[JSHELL_ROWS] = {{
{_numbers(row.radius)}
}};
static const double jshell_sigma[JSHELL_ROWS] = {{
{_numbers(row.tension)}
}};
static const double jshell_kappa_s[JSHELL_ROWS] = {{
{_numbers(row.surface_viscosity - row.rest[4] * row.radius / rest)}
}};

static double jshell_table(const double *y, double R, double *slope)
{{
  int low = 0, high = JSHELL_ROWS - 1;
  while (high - low > 1)
  {{
    int middle = (low + high) / 2;
    if (R < jshell_R[middle]) high = middle;
    else low = middle;
  }}
  *slope = (y[high] - y[low]) / (jshell_R[high] - jshell_R[low]);
  return y[low] + *slope * (R - jshell_R[low]);
}}

static APECSS_FLOAT jshell_tension(APECSS_FLOAT R, struct APECSS_Bubble *Bubble)
{{
  double slope;
  (void) Bubble;
  return jshell_table(jshell_sigma, R, &slope);
}}

static APECSS_FLOAT jshell_pressure(APECSS_FLOAT R, struct APECSS_Bubble *Bubble)
{{
  return 2.0 * jshell_tension(R, Bubble) / R;
}}

static APECSS_FLOAT jshell_pressure_rate(APECSS_FLOAT R, APECSS_FLOAT U, struct APECSS_Bubble *Bubble)
{{
  double slope, sigma = jshell_table(jshell_sigma, R, &slope);
  (void) Bubble;
  return 2.0 * U * (sigma / R - slope) / R;
}}

static APECSS_FLOAT jshell_viscous(APECSS_FLOAT R, APECSS_FLOAT U, struct APECSS_Interface *Interface)
{{
  double slope;
  (void) Interface;
  return 4.0 * jshell_table(jshell_kappa_s, R, &slope) * U / (R * R);
}}

static inline void jshell_attach(struct APECSS_Interface *Interface)
{{
  Interface->get_surfacetension = jshell_tension;
  Interface->get_pressure_surfacetension = jshell_pressure;
  Interface->get_pressurederivative_surfacetension = jshell_pressure_rate;
  Interface->get_pressure_viscous = jshell_viscous;
}}
#endif
"""

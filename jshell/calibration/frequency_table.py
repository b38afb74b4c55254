"""A table of frequencies, one row per shell, made ready for a fit.

Symbols    ω-, ω+ angular frequencies [sqrt(E d/(ρ_f R0³))]   V_e volume [R0³], P_e pressure [E d/R0] at rest
Valid for  rest states that are given, or those of the plateau law in its range
Source     Mokbel et al. 2021: eq:equiplateau, eq:equivol
"""

from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

from jshell.errors import BadName, BadShape, BadValue
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.shell.rest import buckled_state

POSITIVE = ("omega_minus", "omega_plus", "V_e", "P_e", "d_hat", "P0_hat", "Pext_hat")


class FrequencyTable(eqx.Module):
    """A table of frequencies, one row per shell: numbers only, NaN where a frequency is missing.

    Attributes:
        volume: V_e [R0³].
        pressure: P_e [E d/R0].
        kappa: Polytropic exponents [-].
        area_modulus: K_A [E d].
        omega: (shells, 2) slow and fast.
        sigma: (shells, 2) standard errors of `omega`; ones where unknown.
    """

    volume: np.ndarray | jax.Array
    pressure: np.ndarray | jax.Array
    kappa: np.ndarray | jax.Array
    area_modulus: np.ndarray | jax.Array
    omega: np.ndarray | jax.Array
    sigma: np.ndarray | jax.Array


@dataclass(frozen=True)
class Prepared:
    """A table ready to fit, the columns that were read, and what was noticed on the way."""

    rows: FrequencyTable
    absolute: bool
    notes: tuple[str, ...]
    columns: Mapping[str, np.ndarray]


def prepare(table: Mapping[str, object]) -> Prepared:
    """Frequencies and rest states from a table's columns.

    Args:
        table: Columns by name: `omega_minus`, `omega_plus` (either may be missing, or NaN in places);
            `V_e`, `P_e`, or `d_hat`, `P0_hat`, `Pext_hat`; optionally `sigma_minus`, `sigma_plus`, `kappa`, `nu`.
            Other columns are not read.

    Raises:
        BadName: A column that is needed is missing.
        BadShape: Columns of different lengths.
        BadValue: A frequency, rest state, condition or standard error that is not positive; κ below 1.
    """
    columns = {str(key): np.atleast_1d(np.asarray(table[key])) for key in table}
    read = ("omega_minus", "omega_plus", "V_e", "P_e", "d_hat", "P0_hat", "Pext_hat")
    read += ("sigma_minus", "sigma_plus", "kappa", "nu")
    columns = {key: values.astype(float) for key, values in columns.items() if key in read}
    sizes = {values.shape for values in columns.values()}
    if len(sizes) > 1 or any(len(size) != 1 for size in sizes):
        raise BadShape("table", found=f"columns of shapes {sizes}", expected="one length", remedy="Check the rows.")
    if not columns.keys() & {"omega_minus", "omega_plus"}:
        raise BadName(
            "table", found="no frequencies", expected="omega_minus, omega_plus", remedy="Name the columns so."
        )

    for key in (*POSITIVE, "kappa"):
        least = 1.0 if key == "kappa" else 0.0
        values = columns.get(key, np.ones(1))
        wrong = (values < least) | ((values == 0) & (least == 0))
        if wrong.any():
            raise BadValue(
                f"table, row {int(np.argmax(wrong)) + 1}, column {key!r}",
                found=f"{values[wrong][0]:g}",
                expected="at least 1" if least else "a number above 0",
                remedy="Check the sign and the unit.",
            )

    count = sizes.pop()[0]
    blank = np.full(count, np.nan)
    kappa, nu = columns.get("kappa", np.full(count, 1.4)), columns.get("nu", np.full(count, 0.5))
    volume, pressure, law = _rest(columns, kappa, nu)
    omega = np.stack([columns.get("omega_minus", blank), columns.get("omega_plus", blank)], axis=1)
    absolute = bool(columns.keys() & {"sigma_minus", "sigma_plus"})
    sigma = np.stack([columns.get("sigma_minus", blank), columns.get("sigma_plus", blank)], axis=1)
    if absolute and not np.all(sigma[np.isfinite(omega)] > 0):
        raise BadValue(
            "sigma_minus, sigma_plus",
            found="a missing or non-positive standard error",
            expected="a positive one for every frequency",
            remedy="Complete the columns, or leave both out.",
        )
    notes = [f"rest states from {law}"]
    lost = ~(np.isfinite(volume) & np.isfinite(pressure)) & np.isfinite(omega).any(axis=1)
    if lost.any():
        notes.append(f"{lost.sum()} rows have no buckled rest state and are left out")
    omega = np.where(lost[:, None], np.nan, omega)
    volume, pressure = np.where(np.isfinite(volume), volume, 1.0), np.where(np.isfinite(pressure), pressure, 1.0)
    sigma = sigma if absolute else np.ones_like(sigma)
    rows = FrequencyTable(volume, pressure, kappa, 1 / (2 * (1 - nu)), omega, np.where(np.isfinite(sigma), sigma, 1.0))
    return Prepared(rows, absolute, tuple(notes), columns)


def _rest(columns: dict, kappa: np.ndarray, nu: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """Volume, pressure, and where they come from."""
    if {"V_e", "P_e"} <= columns.keys():
        return columns["V_e"], columns["P_e"], "the columns V_e, P_e"
    if {"V_e", "P0_hat"} <= columns.keys():
        return columns["V_e"], columns["P0_hat"] * (SPHERE_VOLUME / columns["V_e"]) ** kappa, "the columns V_e, P0_hat"
    if {"d_hat", "P0_hat", "Pext_hat"} <= columns.keys():
        conditions = Reduced(columns["d_hat"], columns["P0_hat"], columns["Pext_hat"], kappa=kappa, poisson_ratio=nu)
        state = buckled_state(conditions)
        return np.asarray(state.volume), np.asarray(state.pressure), "the plateau law coupier2019"
    raise BadName(
        "table",
        found="no rest states",
        expected="V_e and P_e, or V_e and P0_hat, or d_hat, P0_hat and Pext_hat",
        remedy="Add the columns.",
    )

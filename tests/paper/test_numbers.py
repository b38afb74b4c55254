"""The numbers of data/paper are those of the source, and those the package works with."""

import csv
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName
from jshell.oscillator import SOURCE, squared_frequencies
from jshell.oscillator.drag import DISPLACED_MASS
from jshell.paper.printed import printed, printed_numbers, table_of_shells
from jshell.shell import Reduced, presets
from jshell.shell.elasticity import buckling_threshold
from jshell.shell.rest import RestState, plateau_pressure
from jshell.shell.sphere import sphere_frequency

ROOT = Path(__file__).parents[2]


def test_every_number_has_one_place_and_words():
    rows = printed_numbers()
    assert len(rows) == len({(row.where, row.key) for row in rows}) > 100
    assert all(row.words and np.isfinite(row.value) and row.unit for row in rows)


def test_every_misprint_that_is_named_is_explained():
    notes = (ROOT / "docs" / "source-notes.md").read_text(encoding="utf-8")
    named = {row.misprint for row in printed_numbers()} - {""}
    # E9, the two lengths of the Reynolds number, is told in the drag's own page
    drag = (ROOT / "jshell" / "oscillator" / "drag.py").read_text(encoding="utf-8")
    assert "Reynolds number of\n           the radius" in drag
    for row in named - {"E9"}:
        assert re.search(rf"^\| {row} \|", notes, re.M), row


def test_configuration_and_constants_are_those_the_package_uses():
    R = presets.R.conditions
    fields = {"d_hat": R.thickness, "P0_hat": R.gas_pressure, "eta_hat": R.viscosity, "Pext_hat": R.outer_pressure}
    assert {key: printed("subsec:param", key).value for key in fields} == fields
    joint = [printed("subsec:agree", key) for key in ("alpha1", "alpha2", "k_vs")]
    assert [row.value for row in joint] == [SOURCE.alpha1, SOURCE.alpha2, SOURCE.k_vs]
    assert [row.error for row in joint] == [3.5, 4.1, 6.6]
    assert printed("fig:tau", "prefactor").value == pytest.approx(DISPLACED_MASS)
    share = printed("subsec:param", "buckling_threshold_over_d_hat").value
    assert share * 0.22 == pytest.approx(float(buckling_threshold(jnp.asarray(0.22), 0.5)), rel=1e-12)


def test_printed_coefficients_make_eq_defw():
    a1, a2, kappa, V, P, k = 3.6, 1.1, 1.4, 2.9, 1.5, 0.23
    named = {key: printed("eq:defw", key).value for key in ("alpha1_factor", "alpha2_factor", "coupling_factor")}
    A, B = named["alpha1_factor"] * a1, named["alpha2_factor"] * a2 * kappa * V * P
    root = np.sqrt((A - B) ** 2 + 2 * a1 * a2 * (named["coupling_factor"] * k) ** 2)
    both = np.array([A + B - root, A + B + root]) / (printed("eq:defw", "denominator").value * a1 * a2 * V**2)
    np.testing.assert_allclose(squared_frequencies(V, P, a1, a2, k, kappa=kappa), both, rtol=1e-12)


def test_printed_coefficients_make_the_plateau_law():
    row = {key: printed("eq:equiplateau", key).value for key in ("exponent", "constant", "factor", "power")}
    d = 0.08
    law = (row["constant"] + row["factor"] * d ** row["power"]) / 0.75 ** row["exponent"] / d
    assert law == pytest.approx(float(plateau_pressure(jnp.asarray(d))), rel=1e-12)


def test_printed_estimate_of_the_poles_speed_follows_from_its_inputs():
    K, rho = (
        1e5 * printed("subsec:damp", "pole_speed_pressure").value,
        printed("subsec:damp", "pole_speed_density").value,
    )
    V = 0.5 * 4 * np.pi / 3
    factor, alpha2 = printed("eq:omega-lim", "factor").value, printed("subsec:agree", "alpha2").value
    speed = np.sqrt(factor * K / (alpha2 * rho * V**2))
    assert speed == pytest.approx(printed("subsec:damp", "pole_speed").value, rel=0.02)


def test_stress_free_sphere_has_the_usual_expression():
    factor = printed("eq:wsphere", "stress_free_modulus_factor").value
    thin = Reduced(1e-4, 0.9, 0.9)
    found = sphere_frequency(RestState(jnp.asarray(4 * np.pi / 3), jnp.asarray(0.9)), thin)
    assert float(found) ** 2 == pytest.approx(3 * 1.4 * 0.9 + factor, rel=1e-7)  # bending adds d²


def test_table_1_is_the_packages():
    rows = table_of_shells()
    for name, key in (("UCA", "contrast-agent"), ("Macroshell", "macroshell"), ("Experiments", "experiments"),
                      ("Simulations", "simulations")):  # fmt: skip
        known = presets.RANGES[key]
        assert rows[name] == {"d_hat": known.d_hat, "P0_hat": known.P0_hat, "eta_hat": known.eta_hat}
    lines = (ROOT / "data" / "paper" / "table1.csv").read_text(encoding="utf-8").splitlines()
    raw = {row["shell"]: row for row in csv.DictReader(line for line in lines if not line.startswith("#"))}
    low, high = presets.RANGES["contrast-agent"].thickness
    assert [float(raw["UCA"][f"d_{end}"]) for end in ("low", "high")] == pytest.approx([1e9 * low, 1e9 * high])


def test_unknown_numbers_are_refused():
    with pytest.raises(BadName, match="alpha2"):
        printed("subsec:agree", "alpha3")
    with pytest.raises(BadName, match="fig:tau"):
        printed("fig:nowhere", "x")

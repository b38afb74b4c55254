"""Slips of unit and of type in the numbers of a shell."""

import jax
import numpy as np
import pytest

import jshell as js
from jshell.errors import BadValue
from jshell.shell.parameters import check

GOOD = {"radius": 0.0225, "thickness": 0.005, "E": 5e5, "P0": 1e5, "Pext": 1.77e5, "density": 1260.0}


def reduced(**changes):
    n = {**GOOD, **changes}
    shell = js.Shell(n["radius"], n["thickness"], n["E"])
    return js.Reduced.from_si(shell, js.Gas(n["P0"]), js.Liquid(n["density"], 1.0), js.Load(n["Pext"]))


@pytest.mark.parametrize(
    ("changes", "hint"),
    [
        ({"E": 0.5}, "MPa"),
        ({"E": 500.0}, "kPa"),
        ({"P0": 1.0}, "bar"),
        ({"Pext": 1.77}, "bar"),
        ({"Pext": 177.0}, "kPa"),
        ({"P0": 0.1}, "MPa"),
        ({"radius": 22.5, "thickness": 5.0}, "mm"),
        ({"density": 1.26}, "g/cm"),
    ],
    ids=str,
)
def test_a_number_that_no_laboratory_has_names_its_likely_unit(changes, hint):
    with pytest.raises(BadValue, match=hint):
        reduced(**changes)


@pytest.mark.parametrize("wrong", ["0.22 mm", None, [0.22], (0.22,), 0.2 + 1j, b"1"], ids=repr)
def test_what_is_no_number_is_refused_with_its_type(wrong):
    with pytest.raises(BadValue, match="number"):
        check("thickness (d_hat)", wrong, "0 < d_hat < 1", lambda x: x > 0)


@pytest.mark.parametrize("name", ["radius", "thickness", "E", "P0", "Pext", "density"])
def test_the_numbers_without_units_are_differentiable_in_si(name):
    total = lambda x: sum(jax.tree.leaves(reduced(**{name: x})))  # noqa: E731
    x, h = GOOD[name], 1e-5 * GOOD[name]
    slope = (total(x + h) - total(x - h)) / (2 * h)
    np.testing.assert_allclose([jax.grad(total)(x), jax.jit(jax.grad(total))(x)], slope, rtol=1e-6)

"""One problem, its numbers by name."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadValue
from jshell.io.headers import CONDITION_KEYS
from jshell.shell import Reduced
from jshell.shell.parameters import CONDITION_FIELDS

SHELL = Reduced(0.22, 0.9, 1.6, 0.004, 1.3, 0.45)


def test_the_keys_of_files_are_all_the_fields_in_their_order():
    assert list(CONDITION_FIELDS.values()) == [field.name for field in dataclasses.fields(Reduced)]
    assert set(CONDITION_FIELDS) <= set(CONDITION_KEYS)
    assert SHELL.as_dict() == {
        "d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004, "kappa": 1.3, "nu": 0.45
    }  # fmt: skip
    assert Reduced.from_dict(SHELL.as_dict()) == SHELL
    assert Reduced.from_dict({"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6}) == Reduced(0.22, 0.9, 1.6)


def test_a_changed_copy_keeps_the_rest_and_is_checked():
    assert SHELL.replace(outer_pressure=2.0, viscosity=0.0) == Reduced(0.22, 0.9, 2.0, 0.0, 1.3, 0.45)
    many = SHELL.as_arrays().replace(thickness=jnp.array([0.1, 0.2]))
    np.testing.assert_array_equal(many.thickness, [0.1, 0.2])
    assert SHELL.outer_pressure == 1.6
    with pytest.raises(BadValue, match="d_hat"):
        SHELL.replace(thickness=-1.0)
    with pytest.raises(TypeError, match="d_hat"):
        SHELL.replace(d_hat=0.1)

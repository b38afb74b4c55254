"""One problem, its numbers by name."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadValue
from jshell.io.headers import CONDITION_KEYS
from jshell.shell import Reduced, Scales
from jshell.shell.parameters import CONDITION_FIELDS
from jshell.trace import Trace

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


ODD = [0.2 + 0.1j * np.ones(4), np.array(["0.2"] * 4), np.zeros(4, "M8[s]"), np.array([0.2] * 4, dtype=object)]


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: str(odd.dtype))
def test_what_is_no_real_number_is_refused_where_a_shell_or_a_record_is_made(odd):
    """Of complex values the fits read the real part in silence, of texts some what they spell."""
    good = np.arange(4.0)
    for make in (
        lambda: Reduced(odd, 0.9, 1.6),
        lambda: Scales(odd, 1.0, 1.0),
        lambda: Trace(odd, {"V": good}),
        lambda: Trace(good, {"V": odd}),
        lambda: Trace(good, {"V": good}, sigma={"V": odd}),
    ):
        with pytest.raises(BadValue, match=r"expected real numbers|, a ndarray"):
            make()


def test_scales_are_above_zero():
    with pytest.raises(BadValue, match="density"):  # its unit of time was NaN
        Scales(1e-3, 1e4, -1000.0)

import jax
import numpy as np

from jshell.signals import lanes


def test_an_accelerator_is_given_wide_blocks_and_the_same_numbers(monkeypatch):
    records = np.arange(2.0 * 3 * 5).reshape(2, 3, 5)
    turned = lanes.side_by_side(records, 8)
    small = lanes.lanes_for(10_000, 400), lanes.blocks_for(64), lanes.lanes_for(3, 10**6)
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert np.array_equal(lanes.side_by_side(records, 8), turned)
    assert turned.shape == (3, 8, 2)
    assert np.array_equal(turned[:, :5], np.moveaxis(records, 0, -1))
    assert not turned[:, 5:].any()
    wide = lanes.lanes_for(10_000, 400), lanes.blocks_for(64), lanes.lanes_for(3, 10**6)
    assert small == (64, 16, 1)
    assert wide == (16384, 1, 4)  # records beyond the last are copies: at most twice as many as there are
    assert lanes.lanes_for(10**6, 10**6) == 8

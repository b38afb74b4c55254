"""The shipped campaign, made anew: the same numbers, or a word on what moved."""

import pytest

from jshell import campaigns

# a run of each kind and mesh: compiling them is most of the minutes this takes
AGAIN = ("R-free", "sphere-small", "excess")


@pytest.mark.slow
@pytest.mark.parametrize("family", AGAIN)
def test_run_made_anew_is_the_shipped_one(shipped, family):
    before = shipped.where(family=family)[0]
    after = campaigns.perform(before.run)
    moved = campaigns.compare(
        campaigns.Catalog("before", (before,), ((family,),)), campaigns.Catalog("after", (after,), ((family,),))
    )
    if after.versions == before.versions:
        assert moved.identical, moved.worst()
    # on other versions rounding may differ, and a snap multiplies it
    for move in moved.moved:
        assert move.relative < 1e-4, move

"""What a refusal says of an option or a package that is not there."""

import sys

import pytest

from jshell.errors import BadName, MissingExtra, choose, require_extra


def test_a_choice_comes_back_or_is_refused_in_one_wording():
    assert choose("liquid", "exact", ("exact", "ideal")) == "exact"
    with pytest.raises(BadName) as caught:
        choose("liquid", "water", ("exact", "second", "ideal"), remedy="exact is right.")
    words = "liquid 'water': found no such liquid; expected one of exact, second, ideal. exact is right."
    assert str(caught.value) == words
    with pytest.raises(BadName, match=r"^--units: found 3; expected one of reduced, si\."):
        choose("--units", 3, ("reduced", "si"))
    with pytest.raises(BadName, match=r"^family 'a', kind 'b': found no such kind; expected c\."):
        choose("family 'a', kind", "b", ["c"], expected="c")
    with pytest.raises(BadName, match="found no such state"):
        choose("begin", "b", ["c"], noun="state")


def test_a_missing_package_names_its_extra(monkeypatch):
    assert require_extra("json", "io") is sys.modules["json"]
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingExtra) as caught:
        require_extra("xarray", "io", "Trace.to_xarray")
    words = "Trace.to_xarray: found no xarray; expected the extra `io`. Install it: pip install 'jshell[io]'."
    assert str(caught.value) == words
    with pytest.raises(MissingExtra, match=r"^xarray: "):
        require_extra("xarray", "io")

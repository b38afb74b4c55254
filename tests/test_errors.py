"""What a refusal says of an option or a package that is not there."""

import subprocess
import sys
from pathlib import Path

import pytest

from jshell.errors import BadName, BadValue, MissingExtra, choose, require_extra
from jshell.trace import traces_of


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


WITHOUT_A_TRACE = """
import jshell as js
from jshell.errors import BadValue
told = 0
for door in (js.fit, js.extract, js.calibration.fit_batch, js.calibration.fit_nonlinear, lambda x: js.invert(x, "d")):
    for given in ("film.csv", js.io.example("attached_R_HW.csv"), 5, None, {"t": [0.0]}):
        try:
            door(given)
        except BadValue as error:
            told += ("jshell.io.read_trace('" if ".csv" in str(given) else "expected a Trace") in str(error)
print(told)
"""


def test_who_gives_no_trace_is_told_how_to_get_one():
    for given in ("film.csv", Path("film.csv"), ["film.csv"]):
        with pytest.raises(BadValue, match=r"Read it: jshell\.io\.read_trace\('film\.csv'\)"):
            traces_of(given)
    with pytest.raises(BadValue, match="at least one trace"):
        traces_of([])
    # the doors ask it; in this process what checks the types would be first
    told = subprocess.run([sys.executable, "-c", WITHOUT_A_TRACE], check=True, capture_output=True, text=True).stdout
    assert told == "25\n"

"""One file per result: to the bit, drawn again, refused with reasons."""

import json

import numpy as np
import pytest

import jshell as js
from jshell.calibration import fit_frequencies, load
from jshell.errors import BadFile, BadValue
from jshell.files import NamedBytes

pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
TABLE = {
    "V_e": np.array([2.4, 2.7, 3.0, 2.9]),
    "P_e": np.array([0.3, 0.6, 1.1, 2.0]),
    "omega_minus": np.array([0.71, 0.86, np.nan, 1.21]),
    "omega_plus": np.array([1.52, 1.44, 1.49, 1.71]),
}


@pytest.fixture(params=["trace", "table"])
def result(request, fit):
    return fit if request.param == "trace" else fit_frequencies(TABLE, bounds={"alpha1": (0.5, np.inf)})


@pytest.mark.long
def test_a_result_comes_back_to_the_bit(result, tmp_path):
    read = js.load(result.save(tmp_path / "fit.json"))
    assert read == result
    assert read.record() == result.record()
    assert read.report() == result.report()
    assert read.residual.tobytes() == np.asarray(result.residual).tobytes()
    assert read.covariance.tobytes() == np.asarray(result.covariance).tobytes()
    assert read.specification == result.specification
    for old, new in zip(result.traces, read.traces, strict=True):
        assert new["V"].tobytes() == np.asarray(old["V"]).tobytes()
    assert load(NamedBytes("fit.json", (tmp_path / "fit.json").read_bytes())) == result
    assert (tmp_path / "fit.json").read_text() == read.save(tmp_path / "again.json").read_text()


@pytest.mark.long
def test_a_read_result_walks_around_its_minimum_as_the_fresh_one(result, tmp_path):
    read = js.load(result.save(tmp_path / "fit.json"))
    old, new = result.objective(), read.objective()
    assert new.names == old.names
    np.testing.assert_allclose(new.best, old.best, rtol=1e-14)
    assert (new.count, new.linear, new.freedom) == (old.count, old.linear, old.freedom)
    assert new.variance == pytest.approx(old.variance, rel=1e-12)
    one, two = result.profile(("alpha1",))["alpha1"], read.profile(("alpha1",))["alpha1"]
    np.testing.assert_allclose((two.low, two.high), (one.low, one.high), rtol=1e-9)
    if result.traces:
        # the start of each refit is the minimum to rounding, and the solver stops within 1e-10 of its own
        np.testing.assert_allclose(read.bootstrap(20).values, result.bootstrap(20).values, rtol=1e-8)


def test_what_a_file_cannot_hold_is_said(fit, tmp_path):
    path = fit.save(tmp_path / "fit.json")
    whole = json.loads(path.read_text())
    whole["specification"]["tie"] = {"alpha2": "function half"}
    path.write_text(json.dumps(whole))
    with pytest.raises(BadValue, match="function half"):
        js.load(path).profile()
    path.write_text(json.dumps(whole | {"specification": None}))
    with pytest.raises(BadValue, match="no options"):
        js.load(path).profile()


def test_a_file_says_its_schema_its_versions_and_its_seed(fit, tmp_path):
    found = json.loads(fit.save(tmp_path / "fit.json").read_text())
    assert (found["format"], found["schema"], found["kind"], found["seed"]) == ("jshell record", 1, "fit", 0)
    assert dict(found["versions"])["jshell"] == js.__version__
    assert found["specification"]["loss"] == "strict"
    assert len(found["data"]["traces"][0]["times"]) == 400


def test_what_is_no_record_is_refused(fit, tmp_path):
    path = fit.save(tmp_path / "fit.json")
    whole = json.loads(path.read_text())
    for change, match in (
        ({"schema": 99}, "schema 99"),
        ({"format": "x"}, "another make"),
        ({"kind": "campaign"}, "kind 'campaign'"),
        ({"estimates": None}, "missing or of another kind"),
    ):
        path.write_text(json.dumps(whole | change))
        with pytest.raises(BadFile, match=match):
            load(path)
    path.write_text("{")
    with pytest.raises(BadFile, match="no JSON"):
        load(path)
    with pytest.raises(BadFile, match="fit"):
        load(tmp_path / "nothing" / "fit.json")
    with pytest.raises(BadFile, match="folder"):
        fit.save(tmp_path / "nothing" / "fit.json")


def test_the_picture_of_a_file_is_that_of_the_fit(fit, trace, tmp_path):
    from jshell import plot

    read = js.load(fit.save(tmp_path / "fit.json"))
    one, two = plot.trace_fit(fit, trace), plot.trace_fit(read)
    for old, new in zip(one.ravel(), two.ravel(), strict=True):
        assert old.get_xlabel() == new.get_xlabel()
        for a, b in zip(old.get_lines(), new.get_lines(), strict=True):
            assert a.get_xydata().tobytes() == b.get_xydata().tobytes()


@pytest.mark.long
def test_netcdf_holds_the_same_numbers(result, tmp_path):
    import xarray

    with xarray.open_datatree(result.to_netcdf(tmp_path / "fit.nc"), engine="h5netcdf") as tree:
        names = [str(name) for name in tree["parameters"]["name"].values]
        value = tree["parameters"]["value"].values[names.index("alpha1")]
        assert value == result["alpha1"].value
        np.testing.assert_array_equal(tree["uncertainty"]["covariance"].values, result.covariance)

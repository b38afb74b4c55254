"""Files as instruments write them: every one gives the ring that was written into it, in seconds, and says how."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from jshell.errors import BadName, BadValue, GuessWarning, MissingExtra
from jshell.files import NamedBytes
from jshell.io import read_trace
from jshell.io.columns import SECONDS
from jshell.signals import extract

HERE = Path(__file__).parents[1] / "data" / "instruments"
TIMES = np.arange(40) * 1e-3
X = 0.5 * np.exp(-TIMES / 0.02) * np.cos(2 * np.pi * 90 * TIMES)
Y = 1 + 0.3 * np.exp(-TIMES / 0.02) * np.sin(2 * np.pi * 90 * TIMES)
FILES = {  # channel, its factor and offset, its unit, and what the reader must say
    "tektronix_tds.csv": ("CH1", 1, 0, "V", None),
    "tektronix_mso.csv": ("CH1", 1, 0, None, "`TIME` in s, as Tektronix writes it"),
    "keysight_infiniivision.csv": ("1", 1, 0, "Volt", "`x-axis` taken for `t`"),
    "keysight_infiniium.csv": ("Data:", 1, 0, None, "times from `xinc`"),
    "rigol_ds1000z.csv": ("CH1", 1, 0, "Volt", "times from `increment`"),
    "rigol_mso5000.csv": ("CH1", 1, 0, "V", "times from `tinc`"),
    "lecroy.csv": ("Ampl", 1, 0, None, "`Time` in s, as LeCroy writes it"),
    "rohde_schwarz.csv": ("C1", 1, 0, "V", "`time` taken for `t`"),
    "red_pitaya.csv": ("CH1", 1, 0, "V", "`Time` taken for `t`"),
    "digilent.csv": ("Channel 1", 1, 0, "V", "`Time` taken for `t`"),
    "labview.lvm": ("Voltage", 1, 0, None, "`X_Value` in s, as LabVIEW writes it"),
    "labview_no_x.lvm": ("Spannung_0", 1, 0, None, "times from `delta_x`"),
    "rigol_mso5000_time.csv": ("CH1", 1, 0, "V", "column `Time` taken for `t`"),
    "phyphox.csv": ("Acceleration x", 1, 0, "m/s^2", "`Time` taken for `t`"),
    "excel_german.csv": ("Spannung", 1e4, 0, "mV", "`.` parts thousands"),
    "logger_clock.csv": ("Druck", 100, 0, None, "`Date/Time` taken for `t`"),  # mbar in Pa
    "excel_unicode.txt": ("Spannung", 1e3, 0, "mV", "the text is UTF-16"),
    "excel_1252.csv": ("Weg", 1e-6, 0, None, "the text is Windows-1252"),  # µm in m
    "labview_dates.csv": ("Kanal", 1, 0, "V", "column `Uhrzeit` taken for `t`"),
    "spectrum_dbm.csv": ("Level", 10, -20, "dBm", "`Level` is in dBm, a logarithm"),
}


def _read(name, **said):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = read_trace(HERE / name, **said)
    return found, " ".join(str(one.message) for one in caught if one.category is GuessWarning)


@pytest.mark.parametrize("name", FILES)
def test_the_file_of_an_instrument_is_read_in_seconds_and_its_guesses_are_told(name):
    channel, factor, offset, unit, words = FILES[name]
    found, known = _read(name)
    np.testing.assert_allclose(found.times, TIMES, atol=1e-9)
    np.testing.assert_allclose(found[channel], factor * X + offset, atol=6e-3 * abs(factor))  # Rigol keeps two digits
    assert found.scales == SECONDS
    units = dict(found.settings).get("channel_units", "")
    assert (f"{channel}: {unit}" in units) if unit else (f"{channel}:" not in units)
    assert (words in known) if words else known == ""


def test_a_cell_out_of_range_is_refused_and_its_remedy_works():
    with pytest.raises(BadValue, match=r"row 7, column `Channel A`: found ∞; .*`--missing drop`"):
        _read("picoscope.csv")
    found, known = _read("picoscope.csv", missing="drop")
    assert found.times.size == 39
    assert "1 of 40 rows have gaps and are left out" in known
    np.testing.assert_allclose(found["Channel A"], 1e3 * np.delete(X, 3), atol=0.02)


@pytest.mark.parametrize(
    ("name", "frames", "channel"), [("imagej.csv", "Slice", "Height"), ("deeplabcut.csv", "frame", "top y")]
)
def test_frames_need_the_rate_of_the_camera(name, frames, channel):
    with pytest.raises(BadName, match=f"--rate 1000 --time-from {frames}"):
        _read(name)
    found, known = _read(name, rate=1000, time_from=frames)
    np.testing.assert_allclose(found.times, TIMES, atol=1e-12)
    factor, offset = (1, 0) if channel == "Height" else (9, 120)
    np.testing.assert_allclose(found[channel], factor * Y + offset, atol=1e-3)
    assert f"times from the frames of column `{frames}` at 1000 a second" in known


def test_tables_of_blanks_and_comments_keep_their_units():
    found, known = _read("blanks.dat")
    np.testing.assert_allclose(found.times, TIMES, atol=1e-9)
    np.testing.assert_allclose(found["V"], 1e-9 * Y, atol=1e-14)
    assert found.settings == (("rate", "1000"),)
    assert known == ""
    assert _read("tracker.txt")[0].times[1] == 1e-3


def test_a_recording_of_volts_is_analysed_in_hertz_without_conditions(tmp_path):
    times = np.arange(2000) * 1e-5
    ring = np.exp(-times / 4e-3) * (np.cos(2 * np.pi * 700 * times) + 0.5 * np.cos(2 * np.pi * 1100 * times + 1))
    noise = 1e-3 * np.random.default_rng(0).normal(size=times.size)
    rows = "\n".join(f"{1e3 * t:.6g},{x:.8g}" for t, x in zip(times, ring + noise, strict=True))
    file = NamedBytes("scope.csv", f"t [ms],CH1 [V]\n{rows}\n".encode())
    found = extract(read_trace(file), start=0)
    # an intrinsic frequency lies above the damped one: f² = F² + 1/(2πτ)²
    for heard, damped in ((found.f_minus_Hz, 700), (found.f_plus_Hz, 1100)):
        np.testing.assert_allclose(heard, np.hypot(damped, 1 / (2 * np.pi * 4e-3)), rtol=1e-4)
    np.testing.assert_allclose(found.tau_s, 4e-3, rtol=1e-2)
    assert found.record()["tau_s"] == found.tau_s


def test_spreadsheets_and_tdms_name_the_extra_that_is_missing(monkeypatch):
    for module, suffix in (("openpyxl", "xlsx"), ("nptdms", "tdms")):
        monkeypatch.setitem(__import__("sys").modules, module, None)
        with pytest.raises(MissingExtra, match=r"pip install 'jshell\[instruments\]'"):
            read_trace(NamedBytes(f"a.{suffix}", b"PK\x03\x04"))


def test_a_spreadsheet_is_read_as_the_text_that_it_would_be(tmp_path):
    openpyxl = pytest.importorskip("openpyxl", reason="no openpyxl: pip install jshell[instruments]")
    book = openpyxl.Workbook()
    book.active.append(["made by hand"])
    book.create_sheet("data")
    for row in (["# camera: fast"], ["t [ms]", "H [mm]", "who"], *([k, 3 + 0.1 * k, "me"] for k in range(9))):
        book["data"].append(row)
    book.save(tmp_path / "a.xlsx")
    with pytest.warns(GuessWarning, match="column `who` of words"):
        found = read_trace(tmp_path / "a.xlsx")
    np.testing.assert_allclose(found.times, np.arange(9) * 1e-3)
    np.testing.assert_allclose(found["H"], (3 + 0.1 * np.arange(9)) * 1e-3)
    assert found.settings == (("camera", "fast"),)


def test_a_tdms_file_is_read_with_its_units_and_step(tmp_path):
    nptdms = pytest.importorskip("nptdms", reason="no nptdms: pip install jshell[instruments]")
    properties = {"unit_string": "V", "wf_increment": 1e-3, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("scope", "CH1", X, properties=properties)])
    with pytest.warns(GuessWarning, match="times from `wf_increment`"):
        found = read_trace(tmp_path / "a.tdms")
    np.testing.assert_allclose(found.times, TIMES, atol=1e-12)
    np.testing.assert_array_equal(found["CH1"], X)
    assert found.scales == SECONDS

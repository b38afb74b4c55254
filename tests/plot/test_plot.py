"""Figures say what they show: labels from the registry, lines where the numbers are."""

import subprocess
import sys
from dataclasses import replace

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes

from jshell import plot
from jshell.calibration import Estimate, FitResult, fit_trajectories
from jshell.contour import area, dimple, meridian, volume
from jshell.dynamics.vibrations import Modes
from jshell.errors import BadName, BadShape, BadValue, MissingExtra, NotOk, Outcome
from jshell.membrane import Branch, RestShape, SymmetryLoss
from jshell.oscillator import SOURCE, squared_frequencies
from jshell.plot.shapes import outline
from jshell.plot.traces import two_modes
from jshell.quantities import quantity
from jshell.shell import Liquid, Reduced, Shell, presets, scales
from jshell.signals import Signature, extract
from jshell.trace import Trace

# the shells of these tests lie outside the plateau law's range, on purpose or by chance
pytestmark = [
    pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning"),
    pytest.mark.filterwarnings("ignore:the plateau law:jshell.calibration.report.FitWarning"),
]


def _dented() -> RestShape:
    shape = meridian(8)
    q = dimple(shape, 0.7, 0.2)
    number = jnp.asarray
    measures = (volume(shape, q), area(shape, q), number(1.4), number(0.8), number(0.6), number(0.1), number(0))
    plain = jnp.ones(shape.angles.size)
    conditions = presets.R.conditions.as_arrays()
    return RestShape(q, *measures, shape, plain, jnp.asarray(0.1), jnp.asarray(0.2), conditions, "current")


def _modes(count=2) -> Modes:
    rest = _dented()
    shapes = jnp.stack([rest.meridian.sphere * (k + 1.0) for k in range(count)]).astype(complex)
    rates = jnp.arange(1.0, count + 1.0)
    decaying = -0.2 / rates + 1j * rates
    return Modes(rates, rates, 5 * rates, rates, rates, shapes, decaying, jnp.zeros(count, int), rest)


def _ring(scales=None) -> Trace:
    t = np.linspace(0.0, 40.0, 401)
    fall = np.exp(-t / 8)
    V = 2.9 + 0.1 * fall * (np.cos(t) + 0.4 * np.cos(1.7 * t + 1))
    H = 1.3 + 0.05 * fall * (np.cos(t + 0.5) + 0.2 * np.cos(1.7 * t))
    return Trace(
        t, {"V": V, "S": 11.9 + 0 * t - 0.1 * fall * np.cos(t), "H": H}, Reduced(0.22, 0.9, 1.6), scales=scales
    )


def _heard(scales=None) -> Signature:
    """The true numbers of `_ring`, as a listener would report them."""
    start = {"V": (0.1, 0.04), "H": (0.05, 0.01)}
    omega = np.sqrt(np.array([1.0, 1.7]) ** 2 + 1 / 64)
    return Signature(
        *omega, 8.0, {"omega_minus": 0.002, "omega_plus": 0.003, "tau": 0.1}, start, {"V": (0.0, 1.0), "H": (0.5, 0.0)},
        {"V": 2.9, "H": 1.3}, 0.0, (0.3, 0.0, 0.0), 0.0, "two", ("V",), (0.0, 40.0), 0.0, Outcome.OK,
        frequency_unit=None if scales is None else scales.frequency,
    )  # fmt: skip


def _fit() -> FitResult:
    """A fit that found the constants of `_table`."""
    found = [Estimate(*pair) for pair in (("alpha1", 3.0), ("alpha2", 1.0), ("k_vs", 0.25))]
    none = np.zeros((0, 0))
    return FitResult("by hand", Outcome.OK, tuple(found), (), none, none, (), np.zeros(8), 0.0, 8, 3, False)


def _table() -> dict[str, np.ndarray]:
    V, P = np.array([2.8, 3.0, 3.2, 3.3]), np.array([1.4, 0.7, 1.8, 2.4])
    w2 = [np.asarray(squared_frequencies(v, p, 3.0, 1.0, 0.25)) for v, p in zip(V, P, strict=True)]
    slow, fast = np.sqrt(np.array(w2)).T
    return {"V_e": V, "P_e": P, "omega_minus": slow, "omega_plus": fast}


def _line(ax: Axes, label: str):
    return next(line for line in ax.get_lines() if line.get_label() == label)


def _draws(ax: Axes) -> bool:
    """Rendered without a warning: every glyph is there, every panel has room."""
    ax.figure.canvas.draw()
    return True


@pytest.mark.long
def test_a_shape_that_was_not_found_is_named_and_not_drawn():
    found, lost = _dented(), replace(_dented(), coordinates=_dented().coordinates * jnp.nan, outcome=jnp.asarray(4))
    ax = plot.rest_shape([found, lost])
    legend = ax.get_legend()
    assert legend is not None
    assert Outcome(4).word in legend.get_texts()[-1].get_text()
    assert np.isfinite(ax.get_xlim()).all()


def test_the_master_curve_names_thicknesses_where_shells_differ_in_it():
    table = {"omega_minus": [0.9, 1.0], "omega_plus": [1.6, 1.7], "V_e": [3.1, 3.2], "P_e": [0.8, 1.3]}
    ax = plot.master_curve(table | {"d_hat": [0.1, 0.22]})
    assert {"0.1", "0.22"} < {text.get_text() for text in ax.texts}
    assert not plot.master_curve(table | {"d_hat": [0.1, 0.1]}).texts


def test_figures_show_themselves_in_a_notebook():
    figure = plot.rest_shape(_dented()).figure
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[union-attr]


@pytest.mark.long
def test_importing_jshell_does_not_import_matplotlib():
    code = "import sys, jshell, jshell.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_missing_matplotlib_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtra, match=r"pip install 'jshell\[plot\]'"):
        plot.new_figure()


def test_the_users_settings_come_back():
    before = dict(matplotlib.rcParams)
    plot.channel(_ring(), "V")
    assert dict(matplotlib.rcParams) == before


def test_an_outline_is_closed_mirrored_and_encloses_the_shapes_volume():
    rest = _dented()
    x, r = outline(rest.meridian, rest.coordinates)
    assert (x[0], r[0]) == (x[-1], r[-1])
    np.testing.assert_allclose(r, -r[::-1], atol=1e-12)
    half = slice(0, x.size // 2 + 1)
    turned = -np.pi * np.trapezoid(r[half] ** 2, x[half])
    assert turned == pytest.approx(float(rest.volume), rel=5e-3)  # a trapezium rule through 42 points


def test_rest_shapes_have_equal_scales_and_tell_their_volume():
    rest = _dented()
    ax = plot.rest_shape([rest, rest], labels=["one", "two"])
    assert isinstance(ax, Axes)
    assert ax.get_aspect() == 1.0
    assert {"stress-free sphere", "one", "two"} == {line.get_label() for line in ax.get_lines()}
    assert ax.get_xlabel() == "along the axis x [R₀]"
    alone = plot.rest_shape(rest)
    assert _line(alone, f"V/V₀ = {float(rest.volume_ratio):.3f}")
    assert _draws(alone)
    with pytest.raises(BadShape):
        plot.rest_shape(rest, labels=["one", "two"])


def test_a_mode_swings_as_far_out_as_in():
    modes = _modes()
    ax = plot.mode_shape(modes, 1, scale=0.1)
    rest, up, down = (_line(ax, name).get_xydata() for name in ("rest", "V up", "V down"))
    np.testing.assert_allclose(up - rest, rest - down, atol=1e-12)
    assert _draws(ax)
    with pytest.raises(BadValue):
        plot.mode_shape(modes, 2)


def test_a_mode_of_a_shell_with_units_is_told_in_them():
    modes, unit = _modes(), scales(Shell(2.5e-6, 126e-9, 4.9e6), Liquid(1000.0, 1e-3))
    ax = plot.mode_shape(modes, 0, scales=unit)
    told = ax.texts[0].get_text()
    assert told.startswith(f"f = {1e-6 * float(modes.omega[0]) * unit.frequency:.3g} MHz")
    assert ax.get_xlabel() == "along the axis x [µm]"
    assert [one.get_text() for one in ax.get_xticklabels()] == ["-2.5", "0", "2.5"]


def test_a_channel_is_relative_to_the_sphere_and_marks_dip_and_window():
    ring = _ring()
    snap = np.where(ring.times < 5.0, 4.0 - 0.2 * ring.times, ring["V"])
    trace = Trace(ring.times, {"V": snap}, ring.conditions)
    ax = plot.channel(trace, "V", window=(10.0, 30.0))
    np.testing.assert_allclose(_line(ax, "V/V₀").get_ydata(), snap / (4 * np.pi / 3))
    assert ax.get_xlabel() == quantity("t").label()
    assert _line(ax, "dip").get_xdata()[0] == trace.times[np.argmin(snap)]
    assert [patch.get_label() for patch in ax.patches] == ["window"]
    assert plot.channel(trace, "V", relative=False).get_ylabel() == quantity("V").label()
    steady = Trace(ring.times, {"V": 2.9 + 0.1 * np.cos(ring.times)}, ring.conditions)
    assert len(plot.channel(steady, "V").get_lines()) == 1  # no snap, no dip
    with pytest.raises(BadName):
        plot.channel(trace, "Q")


def test_a_laboratory_reads_milliseconds_and_millimetres():
    scales = presets.preset("R-macro").unit
    trace = _ring(scales)
    ax = plot.channel(trace, "H", relative=False, laboratory=True)
    assert ax.get_xlabel() == quantity("t").label("ms")
    assert ax.get_ylabel() == quantity("H").label("mm")
    line = _line(ax, "H")
    np.testing.assert_allclose(line.get_ydata(), trace["H"] * 22.5)
    np.testing.assert_allclose(line.get_xdata(), trace.times * scales.time * 1e3)
    assert "Hz" in plot.identified_modes(trace, _heard(scales), "H", laboratory=True).texts[0].get_text()
    with pytest.raises(BadValue):
        plot.channel(_ring(), "H", laboratory=True)


def test_what_was_heard_lies_on_a_record_of_two_modes():
    trace = _ring()
    found = _heard()
    ax = plot.identified_modes(trace, found)
    curve = _line(ax, "two modes")
    np.testing.assert_allclose(curve.get_ydata(), trace["V"] / (4 * np.pi / 3), atol=1e-8)
    assert np.ptp(_line(ax, "residual, shifted").get_ydata()) < 1e-8
    assert ax.get_ylabel() == "volume V/V₀"
    assert _draws(ax)


@pytest.mark.slow
def test_the_curve_drawn_is_the_one_that_was_heard():
    trace = _ring()
    found = extract(trace, start=0.0)
    for name in ("V", "H"):  # H was not listened to, only measured at the frequencies of V: its curve is as good
        np.testing.assert_allclose(two_modes(found, name, trace.times), trace[name], atol=1e-7)


def test_nothing_heard_is_refused():
    deaf = replace(_heard(), outcome=Outcome.UNUSABLE_DATA, reason="too short", omega_minus=None)
    with pytest.raises(NotOk, match="too short"):
        plot.identified_modes(_ring(), deaf)
    with pytest.raises(BadName):
        plot.identified_modes(_ring(), _heard(), "S")


def test_the_fitted_master_curve_passes_through_the_points_of_its_law():
    table = _table()
    ax = plot.master_curve(table, _fit())
    points = _line(ax, f"slow {quantity('omega_minus').symbol}")
    np.testing.assert_allclose(points.get_xdata(), table["V_e"] * table["P_e"])
    np.testing.assert_allclose(points.get_ydata(), (table["V_e"] * table["omega_minus"]) ** 2)
    lines = [line for line in ax.get_lines() if len(line.get_xdata()) > 50]
    assert len(lines) == 4  # slow and fast, of the source and of the fit
    on_curve = np.interp(points.get_xdata(), *lines[2].get_data())
    np.testing.assert_allclose(on_curve, points.get_ydata(), rtol=1e-4)  # linear interpolation of 200 points
    assert ax.get_xlabel() == "VₑPₑ [E d R₀²]"
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words[0] == f"source α₁ {SOURCE.alpha1:g}, α₂ {SOURCE.alpha2:g}, k$_{{\\mathrm{{VS}}}}$ {SOURCE.k_vs:g}"
    assert _draws(ax)


@pytest.mark.filterwarnings("ignore::jshell.calibration.report.FitWarning")
def test_a_trace_fits_curve_is_near_the_truth_behind_the_noise():
    clean = _ring()
    noise = 0.02 * clean["H"].std() * np.random.default_rng(0).standard_normal(401)
    noisy = Trace(clean.times, {"H": clean["H"] + noise}, clean.conditions)
    found = fit_trajectories(noisy, "modal", fix={"alpha2": 1.0}, start=2.0)
    axes = plot.trace_fit(found, noisy, start=2.0)
    assert axes.shape == (1, 1)
    assert axes[0, 0].get_ylabel() == quantity("H").label()
    truth = clean.between(2.0, None)["H"]
    # eight parameters of 381 data: the curve is several times nearer to the truth than the 2 % noise
    assert np.std(_line(axes[0, 0], "fit").get_ydata() - truth) < 0.006 * np.std(truth)
    with pytest.raises(BadShape, match="start"):
        plot.trace_fit(found, noisy)
    with pytest.raises(BadShape, match="master_curve"):
        plot.trace_fit(_fit(), noisy)


def test_the_overview_has_its_six_panels_and_is_written(tmp_path):
    trace, table, modes = _ring(), _table(), _modes()
    found = _heard()
    camera = Trace(trace.times, {"H": trace["H"]}, trace.conditions, scales=presets.preset("R-macro").unit)
    figure = plot.overview(modes.rest, modes, trace, found, table, _fit(), camera, _heard(camera.scales))
    titles = [ax.get_title(loc="left") for ax in figure.get_axes()]
    assert [letter for letter in "abcdef" if any(f"({letter})" in title for title in titles)] == list("abcdef")
    for ending in ("png", "pdf", "svg"):
        assert plot.save(figure, tmp_path / f"page.{ending}").stat().st_size > 10_000
    with pytest.raises(BadName):
        plot.save(figure, tmp_path / "page.bmp")


def _branch() -> Branch:
    """Down a branch that turns back in volume once and is stable from there on."""
    V = np.array([0.96, 0.97, 0.98, 0.9, 0.8, 0.7, 0.6])
    p, held = np.linspace(0.04, 0.01, 7), np.array([-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    shapes = np.zeros((7, 1))
    return Branch(V, V, p, p, p, held, held, V, V, (), Outcome.OK, shapes, shapes, meridian(8))


def test_a_branch_is_dotted_from_where_it_is_no_longer_round():
    branch = _branch()
    axes = plot.deflation(branch, loss=SymmetryLoss(0.75, 0.017, 4, 0.75, Outcome.OK))
    lines = {line.get_label(): line for line in axes.lines}
    kept, lost, unstable = lines["dimple, stable at held volume"], lines["not round"], lines["unstable"]
    assert list(lost.get_xdata()) == [0.75, 0.7, 0.6]
    seen = np.isfinite(kept.get_ydata())
    assert list(kept.get_xdata()[seen]) == [0.98, 0.9, 0.8, 0.75]
    assert kept.get_ydata()[seen][-1] == lost.get_ydata()[0] == 0.017
    assert list(unstable.get_xdata()[np.isfinite(unstable.get_ydata())]) == [0.96, 0.97, 0.98]
    assert list(lines["loss of symmetry, m = 4"].get_xdata()) == [0.75]


@pytest.mark.parametrize(
    ("outcome", "words"),
    [(Outcome.OK, "round to the end, at"), (Outcome.NOT_CONVERGED, "round, not followed beyond")],
)
def test_a_branch_that_is_round_as_far_as_seen_says_how_far(outcome, words):
    axes = plot.deflation(_branch(), loss=SymmetryLoss(None, None, None, 0.6, outcome))
    labels = [line.get_label() for line in axes.lines]
    assert f"{words} V/V₀ = 0.600" in labels
    assert "not round" not in labels

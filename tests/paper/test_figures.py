"""The source's figures: our points where our numbers are, its numbers where it printed them."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.axes import Axes
from typer.testing import CliRunner

from jshell.cli.main import app
from jshell.errors import BadName, BadValue, Outcome
from jshell.oscillator import squared_frequencies
from jshell.paper import damping, figures, frequencies, records, softening, trends
from jshell.paper.joint_fits import calibrate
from jshell.paper.printed import printed, printed_numbers
from jshell.paper.shapes import meridian_stretches, setup
from jshell.plot.style import BLACK, BLUE, GREEN, ORANGE, SLOW
from jshell.shell import Reduced, presets
from jshell.signals import extract
from jshell.trace import Trace

EXTRACTED = ("V", "H", "W")  # everywhere: one compiled program
FAMILIES = ("thickness", "viscosity", "excess", "shape")
COUNT = 10  # as in the tests of the calibration, whose compiled fits then serve


def ring(P0: float, omega: tuple[float, float], volume: float) -> Trace:
    """A snap by hand: the pole sinks, the volume dips, and rings with two frequencies."""
    t = np.arange(0.0, 60.0, 0.1)
    later = np.maximum(t - 20.0, 0.0)
    ringing = np.exp(-later / 8) * (np.cos(omega[0] * later) + 0.5 * np.cos(omega[1] * later)) / 1.5
    step = 1 / (1 + np.exp(-4 * (t - 19.0)))
    V = 4 * np.pi / 3 * (1 - 0.1 * (1 - step)) * (1 - step) + step * volume * (1 - 0.05 * ringing * (t >= 20))
    channels = {
        "V": V, "S": 12.0 - 0.5 * step * ringing, "H": 2 - 0.7 * step - 0.2 * step * ringing,
        "W": 2 + 0.2 * step - 0.05 * step * ringing, "v_front": -step * (1 - step),
    }  # fmt: skip
    return Trace(t, channels, Reduced(0.22, P0, P0 + 0.7, 0.004))


class ByHand:
    """A campaign of shells that obey eq:defw, and spheres that obey eq:wsphere."""

    def __init__(self) -> None:
        V = np.linspace(2.4, 3.4, COUNT)
        P0 = np.linspace(0.4, 2.0, COUNT)
        P = P0 * (4 * np.pi / 3 / V) ** 1.4
        w = np.array([np.sqrt(squared_frequencies(v, p, 3.6, 1.1, 0.23)) for v, p in zip(V, P, strict=True)])
        rows = {
            "key": np.arange(COUNT).astype(str), "families": np.array((FAMILIES * 3)[:COUNT]),
            "kind": np.array(["snap"] * COUNT),
            "outcome": np.array(["ok"] * COUNT), "d_hat": np.linspace(0.1, 0.3, COUNT), "P0_hat": P0,
            "Pext_hat": P + 0.1, "eta_hat": np.geomspace(6e-4, 0.013, COUNT), "V_e": V, "P_e": P, "S_e": 12 + 0 * V,
            "V_settled": V, "omega_minus": w[:, 0], "omega_plus": w[:, 1], "tau": 8 + 0 * V, "v_pole_ring": 0.2 + 0 * V,
            "one_omega": 3.0 + 0 * V, "omega_sphere": 3.0 + 0 * V,
        }  # fmt: skip
        for k in range(4):
            rows[f"modes_omega_{k + 1}"] = rows[f"undamped_omega_{k + 1}"] = w[:, min(k, 1)] * (1 + 0.3 * max(k - 1, 0))
            rows[f"modes_tau_{k + 1}"] = 7.0 + 0 * V
            rows[f"undamped_dV_{k + 1}"] = rows[f"modes_dV_{k + 1}"] = rows[f"modes_dS_{k + 1}"] = 1.0 + 0 * V
        self.rows, self.omega = rows, w

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(self.rows)

    def __getitem__(self, name):
        return self.rows[name]

    def __iter__(self):
        for P0, V, omega in zip(self.rows["P0_hat"], self.rows["V_e"], self.omega, strict=True):
            yield SimpleNamespace(trace=ring(P0, tuple(omega), V))


@pytest.fixture(scope="module")
def campaign() -> ByHand:
    return ByHand()


@pytest.fixture(scope="module")
def material(campaign) -> figures.Material:
    return figures.Material(campaign)


def points(ax: Axes, colour: str, marker: str) -> np.ndarray:
    lines = [line for line in ax.get_lines() if line.get_color() == colour and line.get_marker() == marker]
    return np.concatenate([np.asarray(line.get_xydata()) for line in lines])


def words(figure) -> str:
    """All text of a figure."""
    return "\n".join(text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text")))


def test_every_drawn_figure_of_the_source_has_a_function():
    labels = {row.where for row in printed_numbers() if row.where.startswith("fig:")} | {"eq:oscillSph"}
    assert labels <= {one.label for one in figures.FIGURES}
    assert len({one.name for one in figures.FIGURES}) == len(figures.FIGURES)
    with pytest.raises(BadName, match="master"):
        figures.figure("fig:nothing")


def test_slow_pulsations_stand_over_what_was_varied(campaign, material):
    figure = figures.control(material)
    thick, thin, pressure = figure.axes[:3]
    rows = material.runs.within("thickness")
    seen = points(thick, BLUE, "o")
    np.testing.assert_allclose(seen[:, 0], campaign["d_hat"][rows])
    np.testing.assert_allclose(seen[:, 1], campaign["omega_minus"][rows])
    assert thin.get_xscale() == "log"
    rows = material.runs.within("shape")
    seen = points(pressure, ORANGE, "s")
    np.testing.assert_allclose(seen[:, 0], campaign["P_e"][rows])
    # the source's ω- of R, marked in every panel
    for ax in (thick, thin, pressure):
        mark = points(ax, BLACK, "D")
        assert mark[0, 1] == printed("fig:detail-attached", "free_omega_minus").value


@pytest.mark.long
def test_the_master_curve_goes_through_shells_that_obey_it(campaign, material):
    figure = frequencies.master(material.readings, material.runs)
    ax = figure.axes[0]
    seen = points(ax, SLOW, "^")
    np.testing.assert_allclose(seen[:, 1], (campaign["V_e"] * campaign["omega_minus"]) ** 2)
    drawn = next(line for line in ax.get_lines() if str(line.get_label()).startswith("all"))
    x, y = np.asarray(drawn.get_xydata()).T
    np.testing.assert_allclose(np.interp(seen[:, 0], x, y), seen[:, 1], rtol=2e-3)  # straight lines between 240 points
    assert "source: α₁ 3.6, α₂ 1.1" in words(figure)


def test_shells_that_obey_the_sources_curve_do_not_deviate(material):
    figure = figures.every_run(material)
    assert figure.axes[0].get_title(loc="left").endswith("of size 0 %")
    assert len(figure.axes[0].get_xticklabels()) == len(FAMILIES)


@pytest.mark.long
def test_constants_are_drawn_beside_the_sources(material):
    figure = frequencies.constants(calibrate(material.runs))
    bands = [ax.patches[0].get_extents().transformed(ax.transData.inverted()) for ax in figure.axes]
    for band, key in zip(bands, ("alpha1", "alpha2", "k_vs"), strict=True):
        number = printed("subsec:agree", key)
        assert (band.x0 + band.x1) / 2 == pytest.approx(number.value)
        assert (band.x1 - band.x0) / 2 == pytest.approx(number.value * number.error / 100)


def test_decay_times_stand_over_the_reynolds_number(campaign, material):
    ax = figures.damping(material).axes[0]
    seen = points(ax, BLUE, "o")
    np.testing.assert_allclose(seen[:, 0], 0.2 / campaign["eta_hat"])
    np.testing.assert_allclose(seen[:, 1], 8.0 * campaign["eta_hat"])
    laws = [line for line in ax.get_lines() if str(line.get_label()).startswith("settling")]
    assert [float(line.get_ydata()[0]) for line in laws] == pytest.approx([1 / 9, 2 / 9], rel=0.02)  # Re 0.03


def test_spheres_that_obey_the_law_have_prefactor_one():
    flat = np.ones(3)
    found = damping.Spheres(np.array([0.9, 1.2, 1.8]), 0.45 * flat, 3.9 * flat, 3 * flat, 3 * flat, flat > 2, flat > 2)
    figure = damping.spheres(found)
    seen = points(figure.axes[1], GREEN, "o")
    np.testing.assert_allclose(seen[:, 1], 1.0)
    assert "source 1.07" in words(figure)


def test_records_of_three_pressures_and_their_fits(material):
    traces = [ring(P0, (1.0, 1.7), V) for P0, V in ((0.6, 2.4), (0.9, 2.9), (1.5, 3.3))]
    together = extract(traces[1], EXTRACTED)
    extracted = {"V": together, "S": together}
    figure = records.relaxation(traces, traces[1], extracted, (18.0, 19.0, 21.0))
    left = figure.axes[0]
    drawn = [line for line in left.get_lines() if str(line.get_label()).startswith("P̂₀")]
    for line, trace in zip(drawn, traces, strict=True):
        x, y = np.asarray(line.get_xydata()).T
        # aligned where the pole sinks fastest, at t = 19
        np.testing.assert_allclose(y, np.interp(x + 19.0, trace.times, trace["V"]) / (4 * np.pi / 3), atol=1e-12)
    assert {"a", "b", "c"} <= {text.get_text() for text in left.texts}


def test_kicks_stand_over_their_height_and_areas_over_the_thickness(campaign, material):
    t = np.arange(0.0, 30.0, 0.1)
    rest, eta = material.runs.volume, material.runs.viscosity
    kicks = {
        row: Trace(t, {"V": rest[row] + 0.02 * np.exp(-t / tau) * np.sin(t)}, None) for row, tau in ((0, 9.0), (2, 1.0))
    }
    left, right = trends.trends(material.runs, kicks).axes
    thin = next(line for line in left.get_lines() if line.get_label() == f"η̂ = {eta[0]:g}")
    x, y = np.asarray(thin.get_xydata()).T
    assert (x[0], y[0]) == (0.0, 1.0)
    # the next extreme is half a period later and lower by exp(-π/9)
    assert (x[np.argmin(y)], y.min()) == pytest.approx((np.pi, -np.exp(-np.pi / 9)), rel=0.02)
    seen = points(right, BLUE, "o")
    np.testing.assert_allclose(seen, np.stack([campaign["d_hat"], campaign["S_e"] / (4 * np.pi)], axis=1))


def test_attached_beside_free_with_the_sources_ratios():
    free, held = ring(0.9, (1.0, 1.7), 2.9), ring(0.9, (0.4, 1.6), 2.9)
    both = [(trace, extract(trace, EXTRACTED)) for trace in (free, held)]
    assert both[0][1].outcome == Outcome.OK
    said = words(records.attached(*both))
    for value in (0.52, 0.21, 0.22, 1.3, 0.006, 0.4):
        assert f"(source {value:g})" in said


def test_the_laboratorys_figure_tells_hertz(material, rest_R):
    trace = ring(0.9, (0.4, 1.6), 2.9)
    said = words(setup(rest_R, trace, extract(trace, EXTRACTED), presets.R_MACRO.unit))
    assert "experiment: 30" in said
    assert "experiment: 90" in said


def test_stretches_are_those_of_the_wall(rest_R):
    right = meridian_stretches(rest_R).axes[1]
    along, around = (line for line in right.get_lines() if str(line.get_label()).startswith("λ"))
    # both stretches are one number at the poles, by symmetry
    np.testing.assert_allclose(along.get_ydata()[[0, -1]], around.get_ydata()[[0, -1]], atol=2e-3)


@pytest.mark.long
def test_softening_marks_the_drop():
    figure = softening.softening(thickness=(0.02,), pressures=(0.4,))
    assert "ω̂₋ by 4.5, ω̂₊ by 2.5" in words(figure)


def test_runs_are_chosen_by_family_and_pressure(campaign, material):
    found = material.trace("shape", near=2.0)
    assert found.conditions is not None
    assert found.conditions.gas_pressure == campaign["P0_hat"][7]  # the fourth family's last
    with pytest.raises(BadValue, match="attached"):
        material.trace("attached")


@pytest.mark.long
def test_the_verb_lists_and_draws(tmp_path):
    run = CliRunner().invoke(app, ["figures"])
    assert run.exit_code == 0
    assert "fig:detail-attached" in run.stdout
    assert CliRunner().invoke(app, ["figures", "fig:nowhere"]).exit_code == 2
    assert CliRunner().invoke(app, ["figures", "softening", "--format", "gif"]).exit_code == 2
    run = CliRunner().invoke(app, ["figures", "softening", "--out", str(tmp_path), "--json"])
    assert run.exit_code == 0, run.stderr
    assert (tmp_path / "softening.png").stat().st_size > 20_000


@pytest.mark.slow
def test_all_figures_are_drawn_from_the_shipped_campaign(tmp_path):
    run = CliRunner().invoke(app, ["figures", "--all", "--out", str(tmp_path)])
    assert run.exit_code == 0, run.stderr
    assert {path.stem for path in tmp_path.glob("*.png")} == {one.name for one in figures.FIGURES}

"""Pictures of results on axes of one's own: what is drawn are the numbers of the result."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.stats import chi2

import calib
from calib.errors import InputError
from calib.shown import ResultTable, Shown
from truebed import plots

S = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, 0.0], [0.5, 0.0, 9.0]]) * 1e-10


@pytest.fixture
def axes():
    return Figure().add_subplot()


def words(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_the_distribution_of_errors_is_that_of_the_held_out_poses(axes, campaign):
    trial = campaign.trials[0]
    assert plots.errors(axes, campaign, radius=trial.estimates[0].radius) is axes
    drawn = {line.get_label(): np.sort(line.get_xdata()) for line in axes.lines}
    found = trial.estimates[0].comparison
    np.testing.assert_allclose(drawn["before"], 1e3 * np.sort(found.before))
    np.testing.assert_allclose(drawn[f"{trial.name}, whitened"], 1e3 * np.sort(found.after))
    assert "stated radius" in words(axes)


def test_errors_have_plain_numbers_below_and_their_legend_above_the_curves(axes, campaign):
    """Powers of ten stood there, and the legend lay on the curve that a page is about."""
    figure = axes.get_figure()
    figure.set_size_inches(4.5, 3.8)  # half of a figure of two
    plots.errors(axes, campaign, radius=campaign.trials[0].estimates[0].radius)
    FigureCanvasAgg(figure).draw()
    ticks = [text.get_text() for text in axes.get_xticklabels()]
    assert len(ticks) > 1
    assert all(f"{float(text):g}" == text for text in ticks)
    lower = axes.get_legend().get_window_extent().y0
    assert lower > axes.transData.transform((1.0, 1.0))[1]


def test_residuals_are_drawn_by_component(axes, campaign):
    result = calib.calibrate(campaign.setting.nominal, campaign.trials[0].measurements)
    plots.residuals(axes, result)
    table = result.tables()["residuals"]
    for name, line in zip("xyz", axes.lines, strict=False):
        np.testing.assert_allclose(line.get_ydata(), 1e6 * table[f"{name}_m"])


@pytest.mark.parametrize("plane", ["xy", "zx"])
def test_the_ellipse_is_the_curve_of_one_mahalanobis_distance(axes, plane):
    which = ["xyz".index(letter) for letter in plane]
    plots.ellipse(axes, S, plane=plane, center=(1e-5, 0))
    ring = 1e-6 * axes.lines[0].get_xydata() - [1e-5, 0]
    distance = np.einsum("ni,ij,nj->n", ring, np.linalg.inv(S[np.ix_(which, which)]), ring)
    np.testing.assert_allclose(distance, chi2.ppf(0.95, 2), rtol=1e-9)


def test_the_ellipse_counts_what_it_holds(axes):
    points = np.random.default_rng(0).multivariate_normal(np.zeros(3), S, 4000)
    plots.ellipse(axes, S, points=points)
    inside = int(words(axes)[1].split()[0])
    assert abs(inside - 3800) < 4 * (4000 * 0.95 * 0.05) ** 0.5  # four standard deviations


def test_a_pose_count_is_drawn_with_its_scatter_and_its_rule(axes, campaign):
    problem = calib.design.Problem.of_poses(
        campaign.setting.nominal, campaign.setting.pool_q[:60], poses=40, criterion="O1"
    )
    count = calib.design.pose_count(problem, np.random.default_rng(0), sets=5)[0]
    plots.observability(axes, count)
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), count.mean)
    assert (count.chosen is not None) == any("stable" in word for word in words(axes))


def test_a_budget_and_its_target_are_drawn_in_um(axes):
    counts, one = np.array([10, 20]), np.array([0])
    budget = calib.design.PoseBudget(
        "V", 2e-5, counts, np.array([3e-5, 1e-5]), np.array([2e-5, 9e-6]), (one, one), 20, 12, one,
        "",
    )  # fmt: skip
    plots.pose_budget(axes, budget)
    assert [line.get_ydata()[0] for line in axes.lines] == pytest.approx([30.0, 20.0, 20.0])


class Counted(Shown):
    def tables(self):
        names = {
            "truth": "soft",
            "model": "geometric",
            "statement": ["believed", "chance", "alone"],
        }
        shares = {"robots": 40, "inside": [0.99, 0.94, 0.2], "sd": [0.05, 0.1, 0.05]}
        return {"coverage": ResultTable({**names, **shares})}


def test_what_falls_short_of_its_promise_is_drawn_otherwise(axes):
    plots.coverage(axes, Counted())
    assert words(axes)[1:] == ["holds", "falls short"]
    assert [len(bars[0].get_xdata()) for bars in axes.containers] == [2, 1]
    assert [t.get_text() for t in axes.get_yticklabels()][2] == "soft, geometric, alone"


def test_what_cannot_be_drawn_is_refused_in_a_sentence(axes, campaign):
    with pytest.raises(InputError, match=r"Selection has no table errors with after_mm; it has p"):
        plots.errors(axes, campaign.trials[0].selection)
    with pytest.raises(InputError, match="Trial cannot be drawn here; a PoseCount is wanted"):
        plots.observability(axes, campaign.trials[0])
    with pytest.raises(InputError, match="Campaign cannot be drawn here; a PoseBudget is wanted"):
        plots.pose_budget(axes, campaign)
    with pytest.raises(InputError, match="int cannot be drawn here; a result with tables is"):
        plots.errors(axes, 3)
    with pytest.raises(InputError, match="plane is xw; two of the letters"):
        plots.ellipse(axes, S, plane="xw")
    with pytest.raises(InputError, match="covariance has shape"):
        plots.ellipse(axes, S[:2])


@pytest.mark.parametrize("wrong", [None, Figure(), plt, [Figure().add_subplot()], S])
def test_what_are_no_axes_is_said_so(wrong):
    """Who writes plt for its axes would read that a module has no attribute set."""
    draws = (
        lambda: plots.ellipse(wrong, S),
        lambda: plots.residuals(wrong, None),
        lambda: plots.errors(wrong, None),
        lambda: plots.observability(wrong, None),
        lambda: plots.pose_budget(wrong, None),
        lambda: plots.coverage(wrong, None),
    )
    for draw in draws:
        with pytest.raises(InputError, match=r"axes is of the type .*; axes of matplotlib"):
            draw()

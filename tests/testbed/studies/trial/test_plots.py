"""Figures: what is drawn is the data, in bytes that repeat, readable without color."""

import itertools
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from testbed.report.plots import FEET, GAP, free_place
from testbed.report.svg import DARK, FAINT, INK, LIGHT, MIDDLE, SOFT
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.compare import measured_distance
from testbed.studies.trial.statement.records import sums_of
from testbed.studies.wen2022 import plots as plots_paper
from testbed.studies.wen2022.cloud.draws import clouds_of
from testbed.studies.wen2022.cloud.plots import zero_pose_clouds
from testbed.studies.wen2022.records import paper_budget_of, tool_point_of
from tests.fresh import python
from tests.reported import bare_campaign, html, paper_campaign, point_campaign, rigid_campaign

SVG = "{http://www.w3.org/2000/svg}"


def all_figures(campaign):
    """Every figure a campaign can have, by name."""
    out = {
        "held-out": plots.error_distributions(campaign.trials[:6]),
        "space": plots.pose_space(campaign),
        "parameters": plots_uncertainty.parameter_errors(campaign.trials[0]),
    }
    if campaign.random_sets:
        out["random"] = plots.random_sets(campaign.random_sets)
    if campaign.pose_count:
        out["count"] = plots.pose_count(campaign.pose_count)
    if paper_budget_of(campaign):
        out["budget"] = plots_paper.parameter_budget(paper_budget_of(campaign))
    if tool_point_of(campaign):
        out["clouds"] = zero_pose_clouds(clouds_of(campaign))
    return out


@pytest.mark.parametrize("make", [paper_campaign, rigid_campaign, bare_campaign, point_campaign])
def test_every_figure_is_one_well_formed_svg_element_without_anything_from_outside(make):
    figures = re.findall("<svg.*?</svg>", html(make), flags=re.DOTALL)
    assert len(figures) > 3
    for svg in figures:
        root = ET.fromstring(svg)
        assert root.tag == f"{SVG}svg"
        assert not [e for e in root.iter() if e.tag in {f"{SVG}style", f"{SVG}script"}]
        used = set(re.findall(r"(?:href=\"|url\()#([^\")]+)", svg))
        assert used == set(re.findall(r'\bid="([^"]+)"', svg))
        assert not re.search(r"(?:href=\"|url\()[^#]", svg)


def test_shares_rise_where_the_logarithm_of_an_error_says():
    campaign = bare_campaign()
    (trial,) = campaign.trials
    svg = plots.error_distributions([trial])
    error = np.sort(trial.estimates[0].comparison.after)
    (line,) = re.findall(rf'<path d="([^"]+)"[^>]*style="[^"]*stroke: {DARK}[^"]*"', svg)[:1]
    corners = np.array(re.findall(r"([-\d.]+) ([-\d.]+)", line), dtype=float)
    across = np.interp(np.log10(error), np.log10(error[[0, -1]]), corners[[0, -1], 0])
    up = np.interp(np.arange(1, len(error) + 1), [0, len(error)], corners[[0, -1], 1])
    steps = np.column_stack([across, up])
    gaps = np.abs(corners[:, None] - steps).max(axis=-1).min(axis=0)
    # lines are simplified to a ninth of a pixel
    assert gaps.max() < 0.2


def test_calibration_errors_are_distances_between_seen_and_predicted_reflectors():
    campaign = point_campaign()
    trial = campaign.trials[0]
    model = trial.estimates[0].identification.model
    seen = trial.measurements
    one_by_one = [
        np.linalg.norm(seen.position[k] - (T @ np.append(seen.offset[k], 1.0))[:3])
        for k, T in enumerate(model.poses(seen.q))
    ]
    # differences of lengths near one metre: a few times 1e-16
    np.testing.assert_allclose(measured_distance(seen, model), one_by_one, atol=1e-15)


def test_every_pool_pose_is_drawn_once_in_each_view():
    campaign = bare_campaign()
    svg = plots.pose_space(campaign)
    pool = campaign.setting.pool_nominal[:, :3, 3]
    paths = [
        path
        for path, look in re.findall(r'<path d="([^"]+)"[^>]*style="([^"]*)"', svg)
        if FAINT in look
    ]
    assert len(paths) == 2
    for path, column in zip(paths, (1, 2), strict=True):
        points = np.array(re.findall(r"M ([-\d.]+) ([-\d.]+)", path), dtype=float)
        assert len(points) == len(pool)
        slope, offset = np.polyfit(pool[:, column], points[:, 1], 1)
        np.testing.assert_allclose(points[:, 1], slope * pool[:, column] + offset, atol=1e-4)


def test_a_budget_of_many_sources_is_drawn_with_its_sums_below_and_the_discrepancy_open():
    statement = bare_campaign().trials[0].estimates[0].statement
    names, u = ("noise", "range scale", "station"), np.array([4.13e-6, 12.7e-6, 2.06e-6])
    larger = replace(statement, sources=names, source_u=u, discrepancy_u=33.3e-6, drift_u=0.0)
    svg = plots_uncertainty.budget_bars([("first", statement), ("second", larger)])
    told = re.findall(r"<text[^>]*>(?:<tspan[^>]*>)?([^<]+)", svg)
    for name in (*names, *sums_of(larger)):
        assert told.count(name) == 1
    assert told.index("station") > told.index("noise")
    assert told.index("parameters alone") > told.index("station")
    for value in (*u, *sums_of(larger).values(), *sums_of(statement).values()):
        assert f"{1e6 * value:.3g}" in told
    look = plots_uncertainty.bar_look
    assert look("discrepancy")["facecolor"] == "none"
    assert look("believed")["color"] == look("parameters alone")["color"] != look("noise")["color"]


def test_the_same_campaign_gives_the_same_bytes():
    assert all_figures(bare_campaign()) == all_figures(bare_campaign())


def test_bytes_do_not_depend_on_the_hash_seed_of_the_process():
    """Of another process and of this one, whose seed is no number that can be asked for."""
    code = (
        "import sys, numpy as np\n"
        "from testbed.studies.trial.plots import pose_count\n"
        "from testbed.studies.trial.set_records import PoseCountStudy\n"
        "n = np.arange(6, 60)\n"
        "m = np.outer(np.arange(1.0, 6.0), 1 - 1 / n)\n"
        "s = PoseCountStudy(n, ('O1', 'O2', 'O3', 'O4', 'O5'), m, m, 0.01 * m, (30, None))\n"
        "drawn = pose_count(s)\n"
    )
    there = python("-c", code + "sys.stdout.write(drawn)", PYTHONHASHSEED="1").stdout
    here = {}
    exec(code, here)
    assert here["drawn"] == there
    assert "the rule: 30 poses" in there
    assert there.count("the rule") == 1


def test_series_differ_in_marker_and_in_dashes_not_only_in_hue():
    looks = list(plots.LOOKS.values())
    assert len({look["marker"] for look in looks}) == len(looks)
    assert len(set(plots.DASHES.values())) == len(plots.DASHES) == len(looks)


# Vienot, Brettel and Mollon 1999: linear sRGB as one who lacks red or green cones sees it
BLIND = {
    "protan": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
    "deutan": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
}


@pytest.mark.parametrize("eye", ["protan", "deutan"])
def test_the_colors_of_all_pictures_are_told_apart_by_color_blind_eyes(eye):
    def seen(color):
        srgb = np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        linear = np.clip(np.array(BLIND[eye]) @ srgb**2.2, 0, 1)
        return linear ** (1 / 2.2)

    for one, other in itertools.combinations((DARK, MIDDLE, LIGHT), 2):
        # a quarter of an edge of the color cube: far beyond a just noticeable difference
        assert np.linalg.norm(seen(one) - seen(other)) > 0.25, (one, other)


def test_marks_of_every_color_stand_out_from_the_page():
    """Contrast of 3 to white, as WCAG 2.1 asks for what is no text (1.4.11)."""
    for color in (INK, SOFT, DARK, MIDDLE, LIGHT):
        s = np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
        assert 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05) >= 3, color


def test_captions_say_when_a_figure_shows_only_the_first_trials():
    assert plots.only([1, 2, 3], 4) == ""
    assert plots.only([1, 2, 3, 4, 5], 4) == " (the first 4 of 5)"


def laid_out(monkeypatch, draw):
    """The figure that a function draws, with its panels in their places, and its renderer."""
    made = []
    monkeypatch.setattr(plots, "svg_of", made.append)
    draw()
    (figure,) = made
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return figure, canvas.get_renderer()


@pytest.mark.parametrize("make", [rigid_campaign, paper_campaign])
def test_the_name_of_every_view_of_a_pose_set_lies_inside_the_picture(monkeypatch, make):
    campaign = make()
    figure, renderer = laid_out(monkeypatch, lambda: plots.pose_space(campaign))
    ends = [ax._left_title.get_window_extent(renderer) for ax in figure.axes]
    assert {ax.get_title("left") for ax in figure.axes} == {
        f"{trial.name}\n{view}" for trial in campaign.trials[:4] for view in ("above", "side")
    }
    assert max(end.x1 for end in ends) <= figure.bbox.x1
    below = sorted(ends, key=lambda end: (round(end.y1), end.x0))
    for one, following in itertools.pairwise(below):
        assert round(one.y1) != round(following.y1) or one.x1 < following.x0


def test_a_panel_above_an_empty_place_shows_its_ticks(monkeypatch):
    trials = (rigid_campaign().trials * 3)[:5]  # in two rows of three places
    figure, _ = laid_out(monkeypatch, lambda: plots.error_distributions(trials))
    shown = [ax for ax in figure.axes if ax.get_visible()]
    assert len(shown) == 5
    labeled = [ax.xaxis.get_tick_params()["labelbottom"] for ax in shown]
    assert labeled == [False, False, True, True, True]
    assert [bool(ax.get_xlabel()) for ax in shown] == labeled


def test_words_beside_a_line_lie_over_no_curve_and_are_left_out_only_where_they_would():
    """Boxes are judged a second time, by thousands of points along each curve."""
    rng, found = np.random.default_rng(0), []
    room, size = np.array([150.0, 75.0]), np.array([46.0, 7.5])

    def inside(side, foot):
        at = x + side * (size[0] + 2 * GAP) / room[0]
        return 0 <= at <= 1

    def touches(side, foot, gap, slack):
        wide, high = (size + np.array([2 * gap, gap])) / room
        left, low = x if side > 0 else x - wide, foot - gap / room[1]
        corner, end = np.array([left, low]) - slack, np.array([left + wide, foot + high]) + slack
        return any(((at > corner) & (at < end)).all(axis=1).any() for at in dense)

    for _ in range(200):
        x, dense, curves = float(rng.uniform(0.1, 0.9)), [], []
        for middle in rng.uniform(0.1, 0.9, 2):
            places = np.sort(rng.normal(middle, 0.08, 30))
            curves.append((places, np.linspace(1 / 30, 1.0, 30)))
            # with the floor before it, and the ceiling behind it
            knots = np.c_[np.r_[-1, places[0], places, 2], np.r_[0, 0, curves[-1][1], 1]]
            dense.append(np.vstack([np.linspace(*ends, 500) for ends in itertools.pairwise(knots)]))
        found.append(free_place(curves, x, tuple(room), tuple(size)))
        if found[-1] is not None:
            assert inside(*found[-1])
            assert not touches(*found[-1], 0.0, 0.0)
        else:
            for place in itertools.product((1, -1), FEET):
                assert not inside(*place) or touches(*place, 2 * GAP, 0.01)
    assert {place is None for place in found} == {True, False}


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_radius_is_named_in_every_panel_and_no_box_hides_a_curve(count):
    trials = (*paper_campaign().trials, *paper_campaign().trials)[:count]
    svg = plots.error_distributions(trials)
    named = re.findall(r"R95 ([\d.]+) µm", svg)
    radii = [trial.estimates[0].statement.point.radius_mean for trial in trials]
    assert named == [f"{1e6 * radius:.3g}" for radius in radii]
    assert svg.count('paint-order="stroke" stroke="#ffffff"') == count
    assert "opacity: 0.85" not in svg

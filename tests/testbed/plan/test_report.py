"""plan_report.html: the promise first, self-contained, its numbers those of the plan."""

import re
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from testbed.plan import plots as plan_plots
from testbed.plan.promises import PLANNED, efficiency_word
from testbed.plan.report import plan_report_html
from testbed.plan.report_goal import fine, number_section
from testbed.plan.words import headline_rows, terminal_text
from testbed.scenario.read import changed
from tests.planned import ROBOT, quick_plan, small_plan, with_blocked_move
from tests.reported import VERSIONS, printed_pages, read, said_twice

MAKES = [small_plan, quick_plan, with_blocked_move]


@cache
def html(make):
    return plan_report_html(make(), ROBOT, versions=VERSIONS)


@pytest.fixture(scope="module")
def text():
    return " ".join(read(html(small_plan)).text)


@pytest.mark.parametrize("make", MAKES)
def test_the_page_is_well_formed_and_needs_nothing_from_outside(make):
    page = html(make)
    seen = read(page)
    assert seen.open == []
    assert not {"script", "link", "img", "iframe", "object", "base"} & set(seen.tags)
    assert set(seen.links) - {f"#{one}" for one in seen.ids} == {"plan.rrd"}
    assert said_twice(page) == []
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    assert "nan" not in " ".join(seen.text).lower().replace("pennant", "").split()
    assert len(page.encode()) < 2e6
    if make is quick_plan:
        assert page == html.__wrapped__(make)


def test_a_plan_prints_on_five_pages(tmp_path):
    assert printed_pages(html(small_plan), tmp_path) <= 5


def test_the_first_screen_has_promise_proof_time_and_next_step(text):
    made = small_plan()
    first = text[: text.index(re.search("<h2>(.*?)</h2>", html(small_plan)).group(1))]
    assert first.startswith(PLANNED)
    for wanted in (
        f"tool point within {1e6 * made.foresight.R95_over:.1f} µm (3-D radius, 95 %)",
        "noise alone: the tracker states no systematic errors",
        "V-efficiency at least",
        "it is proven that fewer than",
        "✓ Every pose is free of collisions, faces the tracker and is in its line of sight, and "
        "every move is free",
        "Compare signs and zeros of the joints",
    ):
        assert wanted in first


def test_what_was_not_tested_is_a_warning_and_not_in_the_tick():
    made = quick_plan()
    loose = changed(made.scenario, {"tracker.acceptance_deg": 180.0, "pool.line_of_sight": False})
    page = plan_report_html(replace(made, scenario=loose), ROBOT, versions=VERSIONS)
    text = " ".join(read(page).text)
    doubts = ("whether the probe faces the tracker", "whether the beam is blocked")
    free = "! Every pose is free of collisions, and every move is free"
    assert f"{free}; but {' was not tested and '.join(doubts)} was not tested" in text
    assert "acceptance_deg is 180" in text
    assert "line_of_sight is false" in text
    assert "acceptance_deg is 180" in terminal_text(replace(made, scenario=loose))
    assert "Warning" not in terminal_text(made)


def test_the_numbers_of_the_tour_lie_apart_from_each_other_and_from_other_poses(monkeypatch):
    made, drawn = small_plan(), []
    monkeypatch.setattr(plan_plots, "svg_of", drawn.append)
    plan_plots.order_map(made)
    canvas = FigureCanvasAgg(drawn[0])
    canvas.draw()
    renderer = canvas.get_renderer()
    points = plan_plots.tool_points(made, made.tour.q)
    for ax, (i, j) in zip(drawn[0].axes, ((0, 1), (0, 2)), strict=True):
        texts = [text for text in ax.texts if text.get_text()]
        assert len(texts) > len(made.tour) / 2
        boxes = {text.get_text(): text.get_window_extent(renderer) for text in texts}
        for one, other in combinations(boxes.values(), 2):
            assert not one.overlaps(other)
        places = ax.transData.transform(points[:, [i, j]])
        for name, box in boxes.items():
            others = np.delete(places, int(name) - 1, axis=0)
            assert not any(box.contains(*place) for place in others)


def test_the_efficiency_is_one_number_and_never_rounded_up():
    made = small_plan()
    word = efficiency_word(made.proof.efficiency)
    assert 0 <= made.proof.efficiency - float(word) < 1e-3
    row = {what: value for what, value, _ in headline_rows(made)}
    assert row["certified efficiency"] == word
    assert f"V-efficiency at least {word}:" in made.proof.sentence
    table = number_section(made).blocks[1]
    counts, shown = (
        [line[table.head.index(name)] for line in table.rows] for name in ("poses", "efficiency")
    )
    assert shown[counts.index(str(len(made.places)))] == word


def test_values_of_the_headline_are_short_so_that_a_phone_has_room_for_their_words():
    """The place of the tracker pushed the words of every row off the screen."""
    assert max(len(value) for _, value, _ in headline_rows(small_plan())) <= 6


def test_what_two_decimals_do_not_show_is_no_zero():
    assert [fine(u, 1e6) for u in (0.0, 4.9e-9, 6e-9, 1.381e-6)] == [
        "< 0.01", "< 0.01", "0.01", "1.38"
    ]  # fmt: skip
    assert [fine(u, 1e3) for u in (4e-7, 6e-7, 1.381e-3)] == ["< 0.001", "0.001", "1.381"]


def test_a_blocked_move_is_the_verdict():
    text = " ".join(read(html(with_blocked_move)).text)
    assert "✗ Not every move is free" in text
    assert "every move is free ✓" not in text


def test_every_pose_is_in_the_table_of_the_measuring_order(text):
    made = small_plan()
    order = text[text.index("poses in measuring order") :]
    for k in range(len(made.tour)):
        first = f"{np.degrees(made.tour.q[k, 0]):.2f}".replace("-", "−")
        assert first in order
    assert "*: the move passes a stop on the way around" in order


def test_the_curve_in_the_table_is_the_plans_and_its_efficiency_the_certificates(text):
    made = small_plan()
    table = text[text.index("Uncertainty against the number of poses") :]
    for m, u in zip(made.curve.counts, made.curve.u, strict=True):
        assert re.search(rf" {m} {re.escape(f'{2e6 * u:#.4g}'.rstrip('.'))} ", table), m
    at = int(np.flatnonzero(made.curve.counts == len(made.places))[0])
    efficiency = made.curve.bound[at] / made.curve.u[at]
    assert f"{efficiency:.3f}" in table
    assert made.proof.efficiency == pytest.approx(efficiency, rel=1e-9)


def test_shades_grow_with_leverage_and_use_every_step():
    leverage = np.sort(small_plan().leverage)
    level = plan_plots.levels(leverage)
    assert (np.diff(level) >= 0).all()
    assert set(level.tolist()) == set(range(len(plan_plots.SHADES)))
    assert set(plan_plots.levels(np.ones(5)).tolist()) == {0}


def test_every_reason_that_refused_a_pose_is_counted(text):
    pool = small_plan().pool
    for name, count in zip(pool.rejection_names, pool.rejection_counts, strict=True):
        assert (f"{int(count)} {name}" in text) == (count > 0)

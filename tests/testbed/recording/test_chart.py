"""Charts: numbers that are round, words that do not lie on each other, colors everybody tells."""

import colorsys
from dataclasses import replace

import numpy as np
import pytest

from testbed.recording import style
from testbed.recording.chart import BOTTOM, SIZE, Chart, Series, frames_of, level, title_lines
from testbed.recording.parameters import (
    EDGE,
    MOST_ROWS,
    middles,
    parameter_words,
    place,
    row_heights,
    short_name,
)
from testbed.recording.story import numbered, timeline_of
from testbed.recording.ticks import decades, ticks
from testbed.recording.timeline import visit
from testbed.recording.write import story_bytes
from testbed.robots.catalog import load_robot, robot_names
from tests.planes import LOW, overlaps
from tests.recorded import column, store
from tests.toy_story import STOPS, chapter, story

RNG = np.random.default_rng(5)


def count(charts):
    """Items of a phase."""
    return len(charts[0].curves[0].values)


def chart(count, *scales, title="Held-out error [mm] by pose number"):
    names = ("before", "after", "stated u, 3-D, k = 1", "promised")
    curves = [
        Series(name, scale * RNG.uniform(0.2, 1, count), (9, 9, 9), name)
        for name, scale in zip(names, scales, strict=False)
    ]
    return Chart("toy", title, curves)


def seven():
    """As many kinds of robots as a coverage study has, and the promise."""
    kinds = ("rigid", "wen2022", "soft", "elastic", "unmodelled", "slight", "promised")
    curves = [Series(kind, RNG.uniform(60, 100, 200), (9, 9, 9)) for kind in kinds]
    return Chart("toy", "Inside [%] by robots, geometric", curves)


CHARTS = [
    [chart(61, 0.7, 0.012, 0.02)],
    [chart(29, 0.7, 0.3)],
    [chart(1, 40_000.0)],
    [chart(900, 1e-7, 2e-7)],
    [chart(200, 95, 90, title="Inside [%] by robots"), chart(200, 95, title="Inside [%]")],
    [seven(), seven()],
    [Chart("toy", "flat", (level("target", 12, 38021.7, (9, 9, 9)),))],
]


@pytest.mark.parametrize("charts", CHARTS)
def test_no_words_of_a_chart_lie_on_each_other_or_leave_the_plane(charts):
    words = [word for frame in frames_of(charts, count(charts)) for word in frame.words]
    assert overlaps(words) == []
    for word in words:
        left, top, right, bottom = word.box
        assert min(left, top) >= 0, word
        assert right <= SIZE[0], word
        assert bottom <= SIZE[1], word


@pytest.mark.parametrize("charts", CHARTS)
def test_curves_stay_below_their_legend_and_beside_their_numbers(charts):
    for frame in frames_of(charts, count(charts)):
        title = len(title_lines(frame.chart, frame.width))
        words = [*frame.words[:title], *frame.names]
        legend = max(word.box[3] for word in words)
        for curve in frame.chart.curves:
            points = frame.of(curve)
            assert points[:, 1].min() >= legend
            assert points[:, 0].min() >= frame.left
            assert points[:, 0].max() <= frame.left + frame.width


def test_charts_with_the_same_curves_share_one_legend_and_have_room_for_them():
    """Seven kinds of robots took three lines above each chart, which left a strip of 25 points."""
    charts = [seven(), seven()]
    one, other = frames_of(charts, count(charts))
    labels = [curve.label for curve in charts[0].curves]
    assert [word.text for word in one.words if word.text in labels] == labels
    assert not {word.text for word in other.words} & set(labels)
    assert (len(one.samples), len(other.samples)) == (len(labels), 0)
    for frame in (one, other):
        high = frame.place(np.array(1.0), np.array(frame.y[1]))[1]
        assert SIZE[1] - BOTTOM - high > 70
    unlike = [seven(), replace(seven(), curves=seven().curves[:3])]
    assert all(frame.shows_names for frame in frames_of(unlike, count(unlike)))


def test_parameter_names_do_not_lie_on_each_other_however_many():
    for count in (1, 7, 24, 30, MOST_ROWS):
        words = parameter_words(["discrepancy1"[: 5 + k % 4] for k in range(count)])
        assert overlaps(words) == []
        assert max(word.box[3] for word in words) <= SIZE[1] + 1
        assert min(word.box[0] for word in words) >= 0
        assert len(set(row_heights(count))) == -(-count // 4)


def test_long_names_touch_neither_a_number_nor_the_row_to_the_left():
    """A row ends with a point of 4.5 at the edge of its axis, where what is larger lies."""
    parts = [f"reflector{k}.{axis}" for k in (1, 2, 12) for axis in "xyz"]
    parts += [f"station{k}.{axis}" for k in (2, 3) for axis in ("x", "y", "z", "rx", "ry", "rz")]
    parts += ["gravity2.upper", "gravity2.fore", "harmonic3.sin1", "harmonic3.sin12", "moment6.hx"]
    names = parts + [f"anchor{k}.x" for k in range(1, MOST_ROWS - len(parts) + 1)]
    assert len({short_name(name) for name in names}) == len(names) == MOST_ROWS
    words = parameter_words(names)
    assert overlaps(words) == []
    ends = middles(MOST_ROWS) + place(EDGE) + 4.5
    for k, word in enumerate(words[8:MOST_ROWS], start=8):
        assert word.box[0] >= ends[k - 8] - 0.1
        assert word.text.startswith(names[k][0])
        assert names[k].endswith(word.text[-2:])


def test_the_parameter_axis_is_odd_and_ends_within_its_block():
    z = np.array([0.0, 0.5, 2.0, 100.0, 300.0])
    np.testing.assert_allclose(place(-z), -place(z), rtol=0, atol=1e-15)
    assert (np.diff(place(z)) > 0).all()


def test_ticks_are_round_few_and_inside():
    for _ in range(200):
        low = float(RNG.normal(scale=10.0 ** RNG.integers(-3, 5)))
        high = low + float(10.0 ** RNG.uniform(-2, 5))
        found = ticks(low, high, 5)
        assert 1 <= len(found) <= 6
        assert found.min() >= low - 1e-9
        assert found.max() <= high + 1e-9
        step = np.diff(found)
        if len(step):
            # 1, 2 or 5 times a power of ten, every step alike
            assert np.ptp(step) < 1e-6 * step[0] + 1e-9
            assert round(step[0] / 10 ** np.floor(np.log10(step[0] * (1 + 1e-9))), 6) in (1, 2, 5)


def test_decades_cover_a_logarithmic_axis():
    assert decades(0.008, 1.4).tolist() == [0.01, 0.1, 1.0]
    assert decades(0.3, 4.0).tolist() == [0.5, 1.0, 2.0]


def test_curves_far_apart_share_a_logarithmic_axis_and_the_place_is_the_decade():
    (frame,) = frames_of([chart(30, 0.7, 0.012)], 30)
    assert frame.is_log
    x, y = frame.place(np.zeros(3), np.array([0.01, 0.1, 1.0])).T
    assert np.ptp(np.diff(y)) < 1e-9  # equal steps up, by hand
    assert y[0] > y[1]
    assert x[0] == x[1]
    assert not frames_of([chart(30, 0.7, 0.3)], 30)[0].is_log


def test_the_dot_is_at_the_item_that_is_shown_and_the_chart_goes_with_its_phase(tmp_path):
    values = np.array([3.0, 1.0, 2.0])
    one, two = (
        Chart(name, "u by item", (Series("u", values, style.BLUE),), np.array([5, 10, 20]))
        for name in "ab"
    )
    chapters = [
        replace(chapter(c.origin, visit(STOPS)), charts=(c,), lines=numbered("pose", 3))
        for c in (one, two)
    ]
    whole = story(*chapters)
    (tmp_path / "toy.rrd").write_bytes(story_bytes(whole))
    opened, phases = store(tmp_path / "toy.rrd"), timeline_of(chapters).phases
    (frame,) = frames_of([one], 3)
    at, dots = column(opened, "/chart/b/now", "Points2D:positions")
    assert at.tolist() == phases[1].at.tolist()
    np.testing.assert_allclose(np.array(dots)[:, 0], frame.of(one.curves[0]), rtol=1e-6)
    assert np.ptp(np.array(dots)[:, 0, 0]) > 400  # across most of the plane
    cleared, _ = column(opened, "/chart/a", "Clear:is_recursive")
    assert cleared.tolist() == [phases[1].start]
    of_last = [line for line in opened.summary().splitlines() if "chart/b" in line]
    assert "Clear" not in "".join(of_last)


def luminance(color):
    """Relative, as WCAG has it."""
    c = np.array(color[:3]) / 255
    return np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [
        0.2126,
        0.7152,
        0.0722,
    ]


def test_better_and_worse_are_told_apart_by_everybody_and_on_the_viewers_dark_ground():
    assert style.AFTER_COLOR == (0x00, 0x72, 0xB2)
    assert style.BEFORE_COLOR == (0xD5, 0x5E, 0x00)
    # what a red-blind and a green-blind eye see of both (Viénot 1999, linear): still far apart
    linear = [np.array(c) / 255.0 for c in (style.BLUE, style.VERMILION)]
    for red, blue in ((0.11238, 0.00401), (0.29275, -0.02234)):
        rows = np.array([[red, 1 - red, 0], [red, 1 - red, 0], [blue, -blue, 1]])
        one, two = (rows @ c for c in linear)
        assert np.linalg.norm(one - two) > 0.6
    for color in (style.BLUE, style.VERMILION, style.LINE_COLOR, style.MUTED_COLOR):
        assert (luminance(color) + 0.05) / (luminance((14, 14, 14)) + 0.05) > 3  # WCAG, graphics


@pytest.mark.parametrize("name", robot_names())
def test_no_robot_has_the_color_of_the_ghost(name):
    hue = colorsys.rgb_to_hsv(*(value / 255 for value in style.GHOST_COLOR[:3]))[0]
    for visual in load_robot(name).visuals:
        own, saturation, value = colorsys.rgb_to_hsv(*visual.rgb)
        if saturation > 0.25 and value > 0.2:  # else it is gray
            away = abs(own - hue)
            assert 360 * min(away, 1 - away) > 40, visual.name


def test_in_a_viewer_of_1280_by_720_no_plane_is_scaled_below_its_own_size():
    """Words are not scaled with it: they would lie on each other."""
    assert SIZE[0] <= LOW[0]
    assert SIZE[1] <= LOW[1]

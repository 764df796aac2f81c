"""The recording of a plan read back: its curves and its room are the plan's."""

import numpy as np
import pytest

from calib.arrays import evenly
from calib.geometry.chain import forward
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.plan.recording import plan_story, summary
from testbed.recording.story import timeline_of
from testbed.recording.write import story_bytes
from tests import viewed
from tests.planes import unfitting
from tests.planned import ROBOT, quick_plan, small_plan
from tests.recorded import column, scalars, store

SINGLE = 2e-6
"""Scene geometry is float32: 1e-7 of about 3 m."""


@pytest.fixture(scope="module")
def made():
    return small_plan()


@pytest.fixture(scope="module")
def story(made):
    return plan_story(made, ROBOT)


@pytest.fixture(scope="module")
def timeline(story):
    return timeline_of(story.chapters)


@pytest.fixture(scope="module")
def path(story, tmp_path_factory):
    file = tmp_path_factory.mktemp("plan") / "plan.rrd"
    file.write_bytes(story_bytes(story))
    return file


@pytest.fixture(scope="module")
def opened(path):
    return store(path)


def goals(made):
    """The goal postures that the robot goes to."""
    return evenly(np.arange(len(made.goal.q)), 30)


def same_where_shown(at, values, expected):
    """Whether a curve is its numbers, but for those too large to draw, and most are drawn."""
    return np.array_equal(values, expected[at]) and len(at) > 0.5 * len(expected)


def test_curves_are_the_plans_numbers_bit_for_bit(opened, made):
    k, curve = 2.0 * 1e6, made.curve
    for name, expected in (
        ("designed", k * curve.u), ("no_set_below", k * curve.bound), ("random", k * curve.random)
    ):  # fmt: skip
        at, values = scalars(opened, f"/budget/{name}", "number")
        assert same_where_shown(at, values, expected)
    assert (scalars(opened, "/budget/target", "number")[1] == k * curve.target).all()
    at, values = scalars(opened, "/tour/U", "pose")
    measured = np.cumsum([role == "identify" for role in made.tour.roles])
    assert same_where_shown(at, values, k * made.u_of_step[measured - 1])
    _, values = scalars(opened, "/goal/U", "goal_pose")
    assert np.array_equal(values, k * made.u[goals(made)])


def test_every_text_fits_its_window(story):
    assert unfitting(story) == []


def test_a_held_out_pose_leaves_the_uncertainty_where_it_was(opened, made):
    at, values = scalars(opened, "/tour/U", "pose")
    curve = dict(zip(at.tolist(), values.tolist(), strict=True))
    held = [k for k in curve if made.tour.roles[k] == "test" and k - 1 in curve]
    assert held
    for place in held:
        assert curve[place] == curve[place - 1]


def points(opened, entity, component="Points3D:positions"):
    """Step and points (m, 3) of an entity's one row."""
    at, cells = column(opened, entity, component)
    shown = [(step, np.array(cell)) for step, cell in zip(at, cells, strict=True) if cell]
    ((step, values),) = shown
    return step, values


def test_the_pool_lies_at_its_tool_points(opened, made):
    step, seen = points(opened, "/world/pool")
    assert step == 0
    assert np.abs(seen - made.pool.T[:, :3, 3]).max() < SINGLE


def test_rejected_candidates_are_shown_by_reason_and_then_cleared(opened, made, story, timeline):
    names = set(made.pool.rejected_reason) - {made.pool.rejection_names[0]}
    assert names
    end = timeline.phase("candidates").stop
    for name in names:
        q = made.pool.rejected_q[[reason == name for reason in made.pool.rejected_reason]]
        entity = f"/world/rejected/{name.replace(' ', '_')}"
        step, seen = points(opened, entity)
        assert step == 0
        assert np.abs(seen - forward(ROBOT.model.chain, q)[:, :3, 3]).max() < SINGLE
        assert column(opened, entity, "Clear:is_recursive")[0].tolist() == [end]
        assert f"refused, {name}: " in "\n".join(story.chapters[0].text)


def test_chosen_poses_are_numbered_in_measuring_order(opened, made, timeline):
    step, seen = points(opened, "/world/chosen")
    assert step == timeline.phase("budget").start
    assert np.abs(seen - forward(ROBOT.model.chain, made.tour.q)[:, :3, 3]).max() < SINGLE
    steps, labels = column(opened, "/world/number", "Points3D:labels")
    labels = [label for label in labels if label]
    assert np.array_equal(steps[: len(labels)], timeline.phase("tour").at)
    assert labels == [[str(k + 1)] for k in range(len(made.tour))]  # one at a time
    at, strips = column(opened, "/world/path", "LineStrips3D:strips")
    tour = timeline.phase("tour")
    assert at[0] == tour.start
    assert at[-1] == tour.stop - 1
    whole = np.array(strips[-1][0])
    for point in seen:
        assert np.linalg.norm(whole - point, axis=1).min() < SINGLE


def test_the_beam_goes_from_the_station_to_the_probe_of_the_pose_measured(opened, made, timeline):
    tour = timeline.phase("tour")
    at, strips = column(opened, "/world/beam", "LineStrips3D:strips")
    assert np.array_equal(at, np.arange(tour.start, tour.stop))
    ends = np.array(strips)[:, 0]
    assert np.abs(ends[:, 0] - made.T_world_tracker[:3, 3]).max() < SINGLE
    settings = made.scenario.tracker.model_copy(update={"station_mm": made.station_mm})
    aim = tracker_from(settings, ROBOT.model.chain).aim(ROBOT.model.chain)
    T = forward(ROBOT.model.chain, made.tour.q)
    target = T[:, :3, 3] + T[:, :3, :3] @ aim
    assert np.abs(ends[tour.at - tour.start, 1] - target).max() < SINGLE
    assert column(opened, "/world/beam", "Clear:is_recursive")[0].tolist() == [tour.stop]


def test_the_robot_stands_at_every_step_and_at_each_pose_when_it_is_measured(
    opened, made, timeline
):
    link = "/world/robot" + "".join(f"/link{k}" for k in range(1, 7))
    at, _ = column(opened, link, "Transform3D:translation")
    assert np.array_equal(at, np.arange(timeline.n_steps))
    assert np.array_equal(timeline.q[timeline.phase("tour").at], made.tour.q)
    assert np.abs(timeline.q[timeline.phase("goal").at] - made.goal.q[goals(made)]).max() < 1e-14
    for k, via in enumerate(made.tour.vias):  # the drawn way passes the stops too
        first, last = (timeline.phase("tour").at[k] - 6, timeline.phase("tour").at[k])
        for stop in via:
            tool = forward(ROBOT.model.chain, np.vstack([stop, timeline.q[first : last + 1]]))
            way = np.linalg.norm(tool[1:, :3, 3] - tool[0, :3, 3], axis=1)
            # frames are some 0.1 m apart
            assert way.min() < 0.25


def test_goal_points_are_where_the_tool_point_will_be(opened, made, timeline):
    step, seen = points(opened, "/world/goal")
    assert step == timeline.phase("goal").start
    assert np.abs(seen - forward(ROBOT.model.chain, made.goal.q)[:, :3, 3]).max() < SINGLE


def test_the_obstacle_stands_where_the_scenario_says(opened):
    assert any(line.startswith("/world/obstacle1") for line in opened.summary().splitlines())


def test_the_summary_promises_what_the_plan_promises(made):
    assert f"within {1e6 * made.foresight.R95_over:.1f} µm" in summary(made)
    assert "PLANNED" in summary(made)


def test_a_plan_without_target_station_or_obstacle_is_recorded_too(tmp_path):
    file = tmp_path / "plan.rrd"
    file.write_bytes(story_bytes(plan_story(quick_plan(), ROBOT)))
    assert viewed.verify(file)
    summary_lines = store(file).summary()
    assert "/budget/target" not in summary_lines
    assert "obstacle" not in summary_lines


def test_recording_twice_gives_the_same_content(path, made, tmp_path):
    (tmp_path / "again.rrd").write_bytes(story_bytes(plan_story(made, ROBOT)))
    assert viewed.compare(path, tmp_path / "again.rrd")


def test_no_clock_of_this_machine_is_in_the_file(opened):
    assert "log_time" not in opened.summary()
    assert "log_tick" not in opened.summary()


@pytest.mark.slow
def test_no_view_complains_at_the_start_middle_and_end_of_any_phase(path, timeline):
    steps = [s for p in timeline.phases for s in (p.start, (p.start + p.stop) // 2, p.stop - 1)]
    with viewed.needs_driver():
        assert viewed.view_reports(path, steps) == ()

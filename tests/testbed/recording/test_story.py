"""Chapters end to end: any of them can be added, and none has to know the others."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.arrays import evenly
from testbed.recording import layout
from testbed.recording.chart import Chart, Series
from testbed.recording.layout import blueprint, camera
from testbed.recording.story import Panel, row_word, timeline_of
from testbed.recording.timeline import Phase, glide, resting, spread, visit
from testbed.recording.write import story_bytes
from testbed.robots.catalog import load_robot, robot_names
from testbed.robots.placements import link_poses
from tests import viewed
from tests.calibrated import table_of, true_model
from tests.planes import unfitting
from tests.recorded import column, scalars, store
from tests.reference import pool_r
from tests.toy_story import STOPS, chapter, held, story


def test_a_chapter_brings_its_place_on_the_timeline_its_curve_and_its_words(tmp_path):
    values = np.array([3.0, 1.0, 2.0])
    chart = Chart("toy", "u by item", (Series("u", values, (9, 9, 9)),))
    toy = replace(chapter("toy", visit(STOPS)), charts=(chart,), lines=("one", "two", "three"))
    whole = story(chapter("first", visit(STOPS[:2])), toy)
    (tmp_path / "toy.rrd").write_bytes(story_bytes(whole))
    assert viewed.verify(tmp_path / "toy.rrd")
    opened = store(tmp_path / "toy.rrd")
    phase = timeline_of(whole.chapters).phase("toy")
    at, drawn = scalars(opened, "/toy/u")
    assert np.array_equal(at, phase.at)
    assert np.array_equal(drawn, values)
    assert scalars(opened, "/toy/u", "toy_item")[0].tolist() == [0, 1, 2]
    steps, texts = column(opened, "/line", "TextDocument:text")
    assert steps.tolist() == [0, phase.start, *phase.at]
    assert texts[2:] == [["### one"], ["### two"], ["### three"]]
    steps, texts = column(opened, "/now", "TextDocument:text")
    assert steps.tolist() == [0, phase.start]
    assert texts[1] == ["**Toy**\n- toy"]
    assert column(opened, "/phase", "StateChange:state")[1] == [["first"], ["toy"]]


@pytest.mark.parametrize("name", robot_names())
def test_an_arm_is_in_the_picture_wherever_its_joints_may_take_it(name):
    robot = load_robot(name)
    chain, rng = robot.model.chain, np.random.default_rng(0)
    q = rng.uniform(*robot.limits.T, (300, chain.n_joints))
    bodies = link_poses(chain, q)[:, :, :3, 3].reshape(-1, 3)
    tools, station = robot.model.poses(q)[:, :3, 3], np.array([2.5, 0.4, 0.8])
    drawn = np.vstack([bodies, tools, station])
    front = tools[tools[:, 0] > 0.3]
    far, near = layout.AT_TRACKER, layout.AT_ROBOT
    for reach, aspect, look in ((tools, 1.4, far), (front, 1.4, near), (front, 1.05, far)):
        eye, target = camera(reach, chain.T_world_base[:3, 3], station, drawn, aspect, look)
        # a pinhole that looks from the eye to the target, world z up in it
        view = Rotation.align_vectors([[0, 0, 1]], [target - eye])[0]
        up = view.apply([0, 0, 1.0])
        view = Rotation.from_euler("z", np.arctan2(up[0], up[1])) * view
        x, y, z = view.apply(drawn - eye).T
        assert z.min() > 0
        assert np.abs(y / z).max() < 0.93 * np.tan(np.radians(27.5))
        assert np.abs(x / z).max() < 0.93 * aspect * np.tan(np.radians(27.5))
        # and not much farther off than it has to be, or than the workspace asks for
        size = np.quantile(np.linalg.norm(reach - reach.mean(axis=0), axis=1), 0.95)
        assert np.linalg.norm(eye - target) < 9 * size + np.linalg.norm(station)


def test_a_text_that_does_not_fit_its_window_is_found():
    lines = ("#### Toy", *(["- seven words that say nothing at all here"] * 9))
    long = replace(chapter("long", visit(STOPS)), text=lines)
    panel = Panel("p", "P", (0, 1), (0, 1))
    assert unfitting(story(long)) == []
    ((text, height, room),) = unfitting(story(replace(long, panel=panel)))
    assert text.startswith("#### Toy")
    assert height > room


def test_slow_drawing_gives_the_same_content(tmp_path):
    """The stream's own batches end after 0.2 s, and rows of one entity in two chunks differ."""
    for name, pause in (("quick", 0.0), ("slow", 0.6)):
        chapters = (
            chapter("first", visit(STOPS), lambda *_, pause=pause: time.sleep(pause)),
            chapter("second", visit(STOPS)),
        )
        (tmp_path / f"{name}.rrd").write_bytes(story_bytes(story(*chapters)))
    assert viewed.compare(tmp_path / "quick.rrd", tmp_path / "slow.rrd")


def test_without_a_motion_of_its_own_the_robot_stays_and_then_moves_on():
    timeline = timeline_of([
        chapter("go", visit(STOPS)), chapter("wait", spread(4, 10)), chapter("on", visit(STOPS)),
    ])  # fmt: skip
    go, wait, on = timeline.phases
    assert (timeline.q[wait.steps] == timeline.q[go.stop - 1]).all()
    assert timeline.moves_on(go.stop) == on.start
    assert timeline.moves_on(timeline.n_steps) is None
    assert timeline_of([chapter("go", visit(STOPS)), chapter("wait", spread(4, 10))]).moves_on(
        go.stop
    ) is None  # fmt: skip
    assert (go.stop, wait.stop) == (wait.start, on.start)
    assert on.stop == timeline.n_steps


def test_rows_are_called_poses_only_if_each_is_another_pose():
    model, q = true_model(), pool_r(6)
    assert row_word(table_of(model, q)) == "pose"
    # as from two stations: three poses, each of them read twice
    assert row_word(table_of(model, q, pose_id=np.repeat(np.arange(3), 2))) == "reading"


def test_items_are_spread_over_a_phase_and_a_phase_has_room_for_each():
    for count, length in ((1, 144), (7, 144), (144, 144), (500, 144)):
        motion = spread(count, length)
        assert motion.steps == count * max(1, length // count)
        assert len(np.unique(motion.at)) == count
        assert motion.at[0] == 0
        assert motion.at[-1] == (motion.steps - 1 if count > 1 else 0)


def test_a_robot_rests_at_a_stop_when_its_item_is_known():
    motion = visit(STOPS, 6)
    assert motion.at.tolist() == [4, 10, 16]
    for at in (motion.at, motion.at + 1):
        # a glide ends by adding the way there: one rounding of angles below 1
        assert np.abs(motion.q[at] - STOPS).max() < 1e-15


@pytest.mark.parametrize("count", [100, 350, 600])
def test_of_many_stops_too_the_robot_is_at_the_one_whose_item_is_known(count):
    """With two frames each, and with one, there is no time for a way: it was one stop behind."""
    stops = np.linspace(-1.0, 1.0, 6 * count).reshape(count, 6)
    motion = visit(stops)
    assert motion.steps <= 900
    assert np.abs(motion.q[motion.at] - stops).max() < 1e-15


@pytest.mark.parametrize(("count", "steps"), [(29, 366), (61, 174), (61, 61), (90, 61)])
def test_other_stops_share_the_frames_of_a_phase(count, steps):
    stops = np.linspace(-1.0, 1.0, 6 * count).reshape(count, 6)
    phase = resting(Phase("measure", "pose", 10, 10 + steps, np.arange(3)), count)
    assert phase.at[0] >= 10
    assert phase.at[-1] == 10 + steps - 1
    if count <= steps:
        assert (np.diff(phase.at) > 0).all()
        at = glide(stops, steps)[phase.at - 10]
        assert np.abs(at - stops).max() < 1e-15


def test_of_many_places_evenly_spread_ones_are_taken_with_both_ends():
    places = np.arange(0, 2000, 2)
    chosen = evenly(places, 150)
    assert len(chosen) == 150
    assert (chosen[0], chosen[-1]) == (places[0], places[-1])
    assert np.ptp(np.diff(chosen)) <= 2
    assert np.array_equal(evenly(places, 5000), places)


def test_of_the_panels_of_a_kind_that_of_the_last_chapter_lies_on_top():
    from rerun.blueprint import Tabs

    first, last = (
        replace(chapter(name, visit(STOPS)), panel=Panel(name, name.upper(), (0, 1), (0, 1)))
        for name in "ab"
    )
    tall = replace(last, panel=replace(last.panel, tall=True))
    for chapters, low, beside in (
        ((first, last), ["B", "A"], []),
        # beside a tall plane the words of now need all the room there is: the summary lies below
        ((first, tall), ["Summary", "A"], ["B"]),
        ((tall,), ["Summary"], ["B"]),
        ((chapter("c", visit(STOPS)),), ["Summary"], []),
    ):
        whole = story(*chapters)
        top, _, bottom = blueprint(whole, timeline_of(chapters)).root_container.contents
        (one,) = bottom.contents[1:]
        found = [view.name for view in one.contents] if isinstance(one, Tabs) else [one.name]
        assert found == low
        assert [view.name for view in top.contents[2:]] == beside
        texts = [view.name for view in top.contents[1].contents]
        assert texts == ["Line", "Now", *([] if "Summary" in low else ["Summary"])]


def test_recordings_leave_no_thread_and_no_memory_behind():
    """Rerun kept four threads and 20 MB of each (V28); what a process needs once, it needs once.

    Ten that leak hold 200 MB more; what an allocator keeps in pieces was 2 to 6 MB.
    """
    one = story(chapter("first", visit(STOPS)))
    for _ in range(3):
        story_bytes(one)
    before = held()
    for _ in range(10):
        assert len(story_bytes(one)) > 1e5  # a whole one: the robot's meshes are in it
    after = held()
    assert after["Threads"] <= before["Threads"]
    assert after["VmRSS"] - before["VmRSS"] < 20e3  # kB


def test_what_failed_is_let_go_of_with_the_next_recording(capfd):
    def fail(*_):
        raise KeyError("drawing")

    story_bytes(story(chapter("first", visit(STOPS))))
    before = held()["Threads"]
    for _ in range(3):
        with pytest.raises(KeyError, match="drawing"):
            story_bytes(story(chapter("first", visit(STOPS), fail)))
    story_bytes(story(chapter("first", visit(STOPS))))
    assert held()["Threads"] <= before
    assert capfd.readouterr() == ("", "")


def test_a_recording_of_the_callers_own_goes_on(tmp_path):
    import rerun as rr

    rr.init("mine", recording_id="mine")
    rr.save(tmp_path / "mine.rrd")
    try:
        rr.log("before", rr.TextLog("before"))
        story_bytes(story(chapter("first", visit(STOPS))))
        rr.log("after", rr.TextLog("after"))
        assert rr.get_recording_id() == "mine"
    finally:
        rr.disconnect()
        rr.set_global_data_recording(None)
    summary = store(tmp_path / "mine.rrd").summary()
    assert {"/before", "/after"} <= set(re.findall(r"/\w+", summary))
    assert "/world" not in summary


def test_a_full_disk_is_none_of_reruns_business(capfd):
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        data = story_bytes(story(chapter("first", visit(STOPS))))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(data) > 1e5
    assert capfd.readouterr() == ("", "")

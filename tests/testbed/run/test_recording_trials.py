"""A recording shows what was measured, and any trial of a campaign can be shown."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import step_transform
from calib.measurement import tables
from calib.measurement.accuracy import position_errors
from calib.measurement.observations import joined
from testbed.recording.chart import Chart, Series
from testbed.recording.layout import blueprint, cell
from testbed.recording.parameters import middles, place
from testbed.recording.story import Window, timeline_of
from testbed.recording.timeline import visit
from testbed.recording.write import story_bytes
from testbed.robots.catalog import load_robot
from testbed.robots.placements import placements
from testbed.run.derive import led_by
from testbed.run.play import load_run, play_run, recording_of
from testbed.scenario.origin import COMMENT
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.protocol import Records
from testbed.studies.trial.recording_cell import beam, predicted_places, seen_places, show
from testbed.studies.trial.recording_others import other_windows, own_timeline
from tests import recorded, viewed
from tests.command import call
from tests.recorded import (
    column,
    properties,
    record,
    scalars,
    small_campaign,
    store,
    structure,
    told,
)
from tests.reference import pool_r
from tests.reported import SMALL, played
from tests.toy_story import STOPS, story
from tests.toy_story import chapter as toy_chapter

SINGLE = 2e-7
"""Scene geometry is float32: 6e-8 of about 2 m."""
TWO = {
    "pool.size": 60,
    "test.poses": 12,
    "uncertainty.repeats": 2,
    "uncertainty.replications": 0,
    "studies.random_sets": 0,
    "identification.estimators": ["whitened"],
    "trial": [
        {"name": "one", "poses": 14, "method": "random"},
        {"name": "other", "poses": 16, "method": "random"},
    ],
}


def point_campaign():
    """Another scene: one reflector off the tool instead of full poses."""
    trial = [{"name": "only", "poses": 20, "method": "random"}]
    return played("position_only", {**SMALL, "uncertainty.replications": 0, "trial": trial})


@pytest.mark.parametrize("make", [small_campaign, point_campaign])
def test_the_measured_cloud_is_the_measured_points(make, tmp_path):
    campaign = make()
    shown = recorded.shown(campaign)
    opened = store(record(tmp_path / "campaign.rrd", campaign))
    measured = shown.trial.measurements.position
    last = np.array(column(opened, "/world/measured", "Points3D:positions")[1][-1])
    assert np.array_equal(last, measured.astype(np.float32))
    # by plain matrices, where the nominal robot has the target: not what is drawn
    T = shown.setting.nominal.poses(shown.trial.measurements.q)
    nominal = np.array([A[:3, :3] @ shown.setting.target + A[:3, 3] for A in T])
    assert np.linalg.norm(last - nominal, axis=1).max() > 1e-4
    path = f"/world/error_nominal_x{shown.arrows}"
    origins, vectors = (
        np.array(column(opened, path, f"Arrows3D:{name}")[1][-1]) for name in ("origins", "vectors")
    )
    assert np.abs(origins - nominal).max() < SINGLE
    assert np.abs(vectors / shown.arrows - (measured - nominal)).max() < SINGLE


def test_rows_of_all_kinds_are_shown_where_they_were_seen_in_the_world():
    """A second station, a reflector with a number and distances, by hand, row for row."""
    rng, q = np.random.default_rng(5), pool_r(4)
    station = step_transform(np.array([0.5, 3.0, 0.2, 0.1, -0.2, 1.0]))
    anchor, place = np.array([2.0, -1.0, 0.5]), np.array([0.03, -0.02, 0.07])
    fixtures = Fixtures(place[None], anchor[None], station[None])
    model = replace(load_robot("staubli_tx60").model, fixtures=fixtures)
    T = model.poses(q)
    target = np.array([A[:3, :3] @ place + A[:3, 3] for A in T])
    away = np.linalg.norm(target - anchor, axis=1)
    # what is seen lies 1 mm beside, in the axes of the station, or along the line
    beside, longer = 1e-3 * rng.normal(size=(4, 3)), 1e-3 * rng.normal(size=4)
    local = np.array([station[:3, :3].T @ (p - station[:3, 3]) for p in target]) + beside
    table = joined(
        [
            tables.points(q, local, sd=1e-5, reflector=0, station=1),
            tables.distances(q, away + longer, sd=1e-5, anchor=0, offset=place),
            tables.points(q, T[:, :3, 3] + beside, sd=1e-5),
        ]
    )
    seen, predicted = seen_places(model, table), predicted_places(model, table)
    np.testing.assert_allclose(predicted, [*target, *target, *T[:, :3, 3]], atol=1e-14)
    for k in range(4):
        turned = target[k] + station[:3, :3] @ beside[k]
        np.testing.assert_allclose(seen[k], turned, atol=1e-14)
        on_the_line = anchor + (away[k] + longer[k]) * (target[k] - anchor) / away[k]
        np.testing.assert_allclose(seen[4 + k], on_the_line, atol=1e-14)
    assert np.array_equal(seen[8:], table.position[8:])  # the world itself: no rounding


def test_the_beam_comes_from_what_measures_and_ends_on_the_target_of_the_row():
    """First station, second one, anchor; reflectors at places of their own: by hand."""
    q, rng = pool_r(3), np.random.default_rng(6)
    station, second = np.array([3.0, -2.0, 0.4]), step_transform(np.array([0.5, 3.0, 0.2, 0, 0, 1]))
    anchor, places = np.array([2.0, -1.0, 0.5]), 0.1 * rng.normal(size=(2, 3))
    fixtures = Fixtures(places[:1], anchor[None], second[None])
    model = replace(load_robot("staubli_tx60").model, fixtures=fixtures)
    table = joined(
        [
            tables.points(q[:1], np.zeros((1, 3)), sd=1e-5, offset=places[1]),
            tables.points(q[1:2], np.zeros((1, 3)), sd=1e-5, reflector=0, station=1),
            tables.distances(q[2:], np.ones(1), sd=1e-5, anchor=0, offset=places[1]),
        ]
    )
    at, drawn = np.array([2, 5, 6]), pool_r(9, seed=8)
    starts, ends = beam(model, fixtures, station, table, at, drawn)
    T = model.poses(drawn)
    for step, row in enumerate([0, 0, 0, 1, 1, 1, 2, 2, 2]):
        assert np.array_equal(starts[step], (station, second[:3, 3], anchor)[row])
        place = (places[1], places[0], places[1])[row]
        expected = T[step, :3, :3] @ place + T[step, :3, 3]
        np.testing.assert_allclose(ends[step], expected, atol=1e-14)


@pytest.mark.slow
def test_another_trial_is_shown_like_the_first(tmp_path):
    campaign = small_campaign()
    name = campaign.trials[1].name
    other = led_by(campaign, name)
    assert [trial.name for trial in other.trials] == [name, campaign.trials[0].name]
    first, second = (record(tmp_path / f"{k}.rrd", one) for k, one in enumerate((campaign, other)))
    opened = store(second)
    trial = campaign.trials[1]
    last = np.array(column(opened, "/world/measured", "Points3D:positions")[1][-1])
    assert np.array_equal(last, trial.measurements.position.astype(np.float32))
    assert properties(opened)["trial"] == [name]
    assert np.array_equal(properties(opened)["step"], trial.estimates[0].identification.step)
    text = column(opened, "/summary", "TextDocument:text", "step")
    assert not len(text[0])  # static
    assert not viewed.compare(first, second)
    assert viewed.compare(first, record(tmp_path / "2.rrd", led_by(other, campaign.trials[0].name)))
    # the parts that do not hang on the method are all there
    index = {f"/select/{t.selection.criterion}" for t in campaign.trials}
    index |= {"/select/random", "/world/leaves", "/chart/select/points"}
    lines = [
        {
            re.sub("/trials/[^/ ]+", "/trials/OTHER", line)
            for line in structure(store(path))
            if re.sub("(/world)?/trials/[^/]+", r"\1", line.split()[0]) not in index
        }
        for path in (first, second)
    ]
    assert lines[0] == lines[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("trials") / "run"
    play_run(changed(load_scenario("quick"), TWO), out)
    return out


def test_the_command_writes_the_recording_of_a_trial_beside_that_of_the_first(folder, tmp_path):
    before = (folder / "campaign.rrd").read_bytes()
    done = call("record", folder, "--trial", "other")
    assert (done.exit_code, done.stdout) == (0, f"{folder / 'campaign-other.rrd'}\n")
    campaign = load_run(folder)
    again = record(tmp_path / "again.rrd", led_by(campaign, "other"))
    assert viewed.compare(folder / "campaign-other.rrd", again)
    assert (folder / "campaign.rrd").read_bytes() == before
    call("record", folder, "--trial", "one")
    assert viewed.compare(folder / "campaign-one.rrd", folder / "campaign.rrd")


def test_a_recording_that_view_does_not_find_is_asked_for_by_its_command(folder):
    (folder / "campaign-other.rrd").unlink(missing_ok=True)
    result = call("view", folder, "--trial", "other", "--picture", folder / "x.png")
    assert result.exit_code == 2
    assert f"write it by `truebed record {folder} --trial other`" in result.stderr


def test_the_trial_that_the_recording_of_the_run_shows_needs_none_of_its_own(folder):
    own = folder / "campaign-one.rrd"
    own.unlink(missing_ok=True)
    assert recording_of(folder, "one") == recording_of(folder) == folder / "campaign.rrd"
    call("record", folder, "--trial", "one")
    assert recording_of(folder, "one") == own


def test_the_recording_of_the_run_shows_its_first_trial_that_did_not_fail(folder, tmp_path):
    """Also where an older version wrote the scenario, whose preset is a mere label."""
    copy = shutil.copytree(folder, tmp_path / "run")
    (copy / "campaign-other.rrd").unlink(missing_ok=True)
    result = json.loads((copy / "result.json").read_text())
    result["failed"] = {"one": "its poses are too few"}
    del result["trials"]["one"]
    (copy / "result.json").write_text(json.dumps(result))
    text = (copy / "scenario.toml").read_text().split(COMMENT)[0]
    (copy / "scenario.toml").write_text(text.replace('preset = "rigid"', 'preset = "wen2022"'))
    assert recording_of(copy, "other") == copy / "campaign.rrd"
    with pytest.raises(InputError, match=r"failed and cannot be shown \(its poses are too few\)"):
        recording_of(copy, "one")
    (copy / "result.json").unlink()
    with pytest.raises(InputError, match=r"the run is not finished; give the `truebed run`"):
        recording_of(copy, "other")


def test_a_recording_has_one_trial(folder, tmp_path):
    file = folder / "campaign.rrd"
    picture = tmp_path / "x.png"
    result = call("view", file, "--trial", "other", "--picture", picture)
    assert (result.exit_code, picture.exists()) == (2, False)
    assert result.stderr == (
        f"--trial is other, and {file} is one recording, which has its trial; give the run folder, "
        "or leave --trial out. [C41]\n"
    )
    result = call("view", tmp_path / "none.rrd", "--picture", picture)
    assert (result.exit_code, picture.exists()) == (2, False)
    assert result.stderr == f"{tmp_path}/none.rrd: no such recording; truebed record RUN. [F3]\n"


@pytest.mark.parametrize("verb", [("record",), ("view", "--picture", "x.png")])
@pytest.mark.parametrize("name", ["othr", "../run", ""])
def test_a_wrong_name_is_told_with_the_names_there_are(folder, verb, name):
    before = sorted(folder.parent.rglob("*"))
    result = call(verb[0], folder, "--trial", name, *verb[1:])
    close = '; did you mean "other"?' if name == "othr" else "."
    assert result.exit_code == 2
    assert result.stderr.startswith(
        f'there is no trial "{name}"; expected one of one, other{close}'
    )
    assert sorted(folder.parent.rglob("*")) == before


def test_a_trial_that_failed_cannot_be_shown():
    campaign = small_campaign()
    name = campaign.trials[1].name
    failed = replace(
        campaign,
        trials=campaign.trials[:1],
        records=Records(campaign.records.values, {name: "its poses are too few"}),
    )
    with pytest.raises(InputError) as caught:
        led_by(failed, name)
    assert str(caught.value) == (
        f'the trial "{name}" failed and cannot be shown (its poses are too few); '
        f"expected one of {campaign.trials[0].name}. [C41]"
    )


def test_each_trial_has_a_window_that_hides_what_is_of_the_others(tmp_path):
    """Which entities a window shows, by the rule of the viewer: the most special line decides."""
    campaign = small_campaign()
    first, other = campaign.trials
    shown = recorded.shown(campaign)
    windows = told(campaign).windows
    assert [window.name for window in windows] == [first.name, other.name]
    opened = store(record(tmp_path / "both.rrd"))
    entities = {line.split()[0] for line in opened.summary().splitlines()}
    lines = recorded.timeline(campaign)
    views = [cell(story_of(windows), lines, window) for window in windows]
    seen = [
        {one for one in entities if one.startswith("/world") and shows(view.contents, one)}
        for view in views
    ]
    own = f"/world/trials/{other.name}"
    assert {one for one in seen[0] if one.startswith("/world/trials")} == set()
    assert any(one.startswith(own) for one in seen[1])
    for gone in ("/world/chosen", "/world/measured", "/world/beam", f"/world/{shown.error_name}"):
        assert gone in seen[0], gone
        assert gone not in seen[1], gone
    assert not any(one.startswith((f"/{shown.ghost_path}", "/world/held_out")) for one in seen[1])
    ghost = f"{own}/true_x{shown.ghost}"  # as much larger than life as that of the first
    assert any(one.startswith(ghost) for one in seen[1])
    # what both have: the candidates; robot and tracker stand twice, each on its own way
    assert "/world/pool" in seen[0] & seen[1]
    for name in ("robot", "tracker"):
        parts = {one for one in entities if one.startswith(f"/world/{name}/")}
        assert parts <= seen[0] - seen[1]
        assert {one.replace("/world", own, 1) for one in parts} <= seen[1] - seen[0]
    last = np.array(column(opened, f"{own}/measured", "Points3D:positions")[1][-1])
    assert np.array_equal(last, other.measurements.position.astype(np.float32))
    after = column(opened, f"{own}/held_out/after_x{shown.arrows}", "Arrows3D:vectors")[1][-1]
    judged = other.estimates[0].comparison
    np.testing.assert_allclose(
        np.linalg.norm(after, axis=1), shown.arrows * judged.after, rtol=0, atol=1e-5
    )


def test_a_trial_alone_has_the_one_window(tmp_path):
    campaign = small_campaign()
    alone = replace(campaign, trials=campaign.trials[:1])
    assert other_windows(alone, recorded.shown(alone), load_robot("staubli_tx60"), {}) == ()


def test_each_window_has_words_curves_and_parameters_of_its_own(folder):
    """By the numbers of its trial, on the steps at which its own robot is at its poses."""
    campaign = load_run(folder)
    one, other = campaign.trials
    path = folder / "campaign.rrd"
    opened, lines = store(path), recorded.timeline(campaign)
    own = own_timeline(show(campaign, other), lines)
    assert (len(one.measurements), len(other.measurements)) == (14, 16)
    for words, trial, phases in (("", one, lines), ("/trials/other", other, own)):
        judged, found = trial.estimates[0].comparison, trial.estimates[0].identification
        at, values = scalars(opened, f"{words}/measure/nominal")
        table = trial.measurements
        off = position_errors(seen_as_poses(table), campaign.setting.nominal.poses(table.q))
        assert np.abs(values - 1e3 * off).max() < 1e-12  # a norm of numbers near 1 m, in mm
        assert np.array_equal(at, phases.phase("measure").at)
        at, values = scalars(opened, f"{words}/evaluate/after")
        assert np.array_equal(values, 1e3 * judged.after)
        assert np.array_equal(at, lines.phase("evaluate").at)
        steps, texts = column(opened, f"{words}/line", "TextDocument:text")
        said = dict(zip(steps.tolist(), (text[0] for text in texts), strict=True))
        at = phases.phase("measure").at
        assert said[at[-1]] == f"### pose {len(table)} of {len(table)}, {1e3 * off[-1]:.2f} mm off"
        assert said[phases.phase("select").at[0]].startswith("### set 1 of 1")
        (summary,) = column_static(opened, f"{words}/summary", "TextDocument:text")
        assert f"{trial.name} brings" in summary[0]
        listed = [line for line in summary[0].splitlines() if line.startswith("- ")]
        assert [line[2:].partition(":")[0] for line in listed] == [
            t.name for t in campaign.trials if t is not trial
        ]
        points = column(opened, f"{words}/parameters/error", "Points2D:positions")[1][-1]
        z = (judged.true_step - found.step) / found.standard_uncertainty
        off = np.array(points)[:, 0] - middles(len(points))
        assert np.sinh(off / place(1.0) * np.arcsinh(1.0)) == pytest.approx(z, rel=1e-4, abs=1e-5)
    told_now = column(opened, "/trials/other/now", "TextDocument:text")[1]
    assert [text[0].splitlines()[0] for text in told_now][1] == "**2 Measure: other**"
    # nothing of the pool, which both share, is in the file twice
    assert opened.summary().count("/pool ") == 1
    assert viewed.view_reports(path, steps=(lines.phase("measure").at[3],)) == ()


def test_a_chapter_for_all_trials_is_drawn_once_and_told_in_every_window(tmp_path):
    """Its curves too: each window looks at those of the first."""
    values = np.array([3.0, 1.0, 2.0])
    shared = replace(
        toy_chapter("shared", visit(STOPS)),
        charts=(Chart("shared", "u by item", (Series("u", values, (9, 9, 9)),)),),
        lines=("one", "two", "three"),
    )
    mine = replace(toy_chapter("first", visit(STOPS)), text=("#### Mine", "- mine"))
    whole = replace(
        story(toy_chapter("first", visit(STOPS)), shared),
        windows=(Window("a"), Window("b", "world/b", words="b/", summary="Own.", chapters=(mine,))),
    )
    (tmp_path / "toy.rrd").write_bytes(story_bytes(whole))
    opened, phases = store(tmp_path / "toy.rrd"), timeline_of(whole.chapters).phases
    entities = {line.split()[0] for line in opened.summary().splitlines()}
    assert "/shared/u" in entities
    assert "/b/shared/u" not in entities
    assert {"/chart/shared/curves", "/b/chart/shared/curves"} <= entities
    for words, texts in (("", ["Toy", "Toy"]), ("/b", ["Mine", "Toy"])):
        steps, said = column(opened, f"{words}/now", "TextDocument:text")
        assert steps.tolist() == [phase.start for phase in phases]
        assert [text[0].splitlines()[0].strip("*") for text in said] == texts
        lines = column(opened, f"{words}/line", "TextDocument:text")[1]
        assert [text[0] for text in lines][2:] == ["### one", "### two", "### three"]
    screens = blueprint(whole, timeline_of(whole.chapters)).root_container
    assert [screen.name for screen in screens.contents] == ["a", "b"]
    (charts, _) = screens.contents[1].contents[2].contents
    assert [view.origin for view in charts.contents] == ["/b/chart", "/shared"]


def seen_as_poses(table):
    """Measured points (m, 4, 4), not turned."""
    T = np.broadcast_to(np.eye(4), (len(table), 4, 4)).copy()
    T[:, :3, 3] = table.position
    return T


def column_static(opened, entity, component):
    """Cells of a component that holds at all times."""
    found = []
    for chunk in opened.stream().filter(content=entity):
        batch = chunk.to_record_batch()
        found += batch[component].to_pylist() if component in batch.schema.names else []
    return found


def test_in_its_window_the_robot_goes_through_the_trials_own_poses(folder):
    """Sets of unequal size: each pose has its turn in the measuring phase of the first trial."""
    campaign = load_run(folder)
    setting = campaign.setting
    other, lines = campaign.trials[1].measurements, recorded.timeline(campaign)
    shown = show(campaign, campaign.trials[1])
    own = own_timeline(shown, lines)
    at = own.phase("measure").at
    assert len(at) == len(other) != len(lines.phase("measure").at)
    assert (np.diff(at) > 0).all()
    assert lines.phase("measure").start <= at[0]
    assert own.phase("select").at.tolist() == [0]  # random: the set is there at once
    assert at[-1] < lines.phase("measure").stop
    # before + (stop - before): a rounding of angles of a few radians
    np.testing.assert_allclose(own.q[at], other.q, rtol=0, atol=4e-15)
    for name in ("select", "measure", "identify"):
        assert not np.array_equal(own.q[lines.phase(name).steps], lines.q[lines.phase(name).steps])
    after = lines.phase("evaluate").steps
    np.testing.assert_array_equal(own.q[after], lines.q[after])
    # what is drawn: the beam ends at its target, at every pose, and the first link is turned so
    opened = store(folder / "campaign.rrd")
    root = "/world/trials/other"
    steps, strips = column(opened, f"{root}/beam", "LineStrips3D:strips")
    ends = np.array([strips[list(steps).index(step)][0][1] for step in at])
    targets = setting.nominal.poses(other.q)[:, :3, 3]
    np.testing.assert_allclose(ends, targets, rtol=0, atol=SINGLE * 2)
    turned = column(opened, f"{root}/robot/link1", "Transform3D:quaternion")[1]
    first = column(opened, "/world/robot/link1", "Transform3D:quaternion")[1]
    z = np.array([turned[step][0] for step in at])[:, 2:]
    frames = placements(setting.nominal.chain).frames[0]
    half = 0.5 * (other.q[:, 0] + np.arctan2(frames[1, 0], frames[0, 0]))
    # a quaternion and its negative are one turn
    np.testing.assert_allclose(np.abs(z), np.abs(np.c_[np.sin(half), np.cos(half)]), atol=SINGLE)
    assert not np.allclose([first[step][0] for step in at], [turned[step][0] for step in at])


def shows(contents, entity):
    """Whether a query of the viewer holds an entity."""
    best = (-1, False)
    for line in contents:
        sign, path = line.split(maxsplit=1)
        root = path.removesuffix("/**")
        if entity == root or entity.startswith(f"{root}/"):
            best = max(best, (len(root), sign == "+"))
    return best[1]


def story_of(windows):
    return replace(story(toy_chapter("first", visit(STOPS))), windows=windows)

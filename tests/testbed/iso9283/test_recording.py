"""The recording of a test: what is drawn is what was read, and `record` writes it again."""

import numpy as np
import pytest

from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.recording import test_story as story_of
from testbed.iso9283.shown import shown_test
from testbed.recording.story import timeline_of
from testbed.recording.write import story_bytes
from tests import viewed
from tests.command import call
from tests.planes import unfitting
from tests.recorded import column, scalars, store
from tests.testbed.iso9283.made import CUBE, SESSION, path_rows, pose_rows, text_of

SINGLE = 2e-7
"""Scene geometry is float32: 6e-8 of about a meter, and a sum."""
WARM = np.array([0.0, 0.0, 0.03])
"""A robot that grows along z while it runs, in all [mm]."""


def written(folder, rows, session=SESSION, paths=None):
    """A session of these rows."""
    folder.mkdir(exist_ok=True)
    (folder / "cycles.csv").write_text(text_of(rows) if rows else "")
    (folder / "path.csv").write_text(text_of(paths or path_rows()))
    (folder / "session.toml").write_text(session)
    return folder


def drifting():
    """Thirty cycles of a robot that warms up evenly."""
    return [row | {"z_mm": row["z_mm"] + WARM[2] * (row["cycle"] - 1) / 29} for row in pose_rows()]


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("iso")
    written(folder / "data", drifting())
    done = call("iso9283", folder / "data", "--out", folder / "out")
    assert done.exit_code == 0
    return folder / "out"


@pytest.fixture(scope="module")
def shown(out):
    return shown_test(play_test(read_test(out.parent / "data")))


@pytest.fixture(scope="module")
def opened(out):
    return store(out / "iso9283.rrd")


def last(opened, entity, component):
    """The last row of an entity that is not empty."""
    rows = [row for row in column(opened, entity, component)[1] if row]
    return np.array(rows[-1])


def entity(opened, begin):
    """The one entity whose name begins so, and the factor in its name."""
    (name,) = {line.split()[0] for line in opened.summary().splitlines() if line.startswith(begin)}
    return name, int(name.rpartition("_x")[2])


@pytest.mark.slow
def test_the_recording_is_whole_its_words_fit_and_the_viewer_shows_it_without_complaint(out, shown):
    assert viewed.verify(out / "iso9283.rrd")
    story = story_of(shown)
    assert unfitting(story) == []
    names = [chapter.name for chapter in story.chapters]
    assert names == ["visit", "figures", "drift", "path1"]
    phases = timeline_of(story.chapters).phases
    assert viewed.view_reports(out / "iso9283.rrd", [phase.at[-1] for phase in phases]) == ()


def test_clouds_arrows_and_spheres_are_the_readings_larger_than_life(opened, shown):
    """By plain sums over the rows that were written: AP and RP as ISO 9283 defines them."""
    rows = drifting()
    read = np.array([
        [[row[f"{a}_mm"] for a in "xyz"] for row in rows if row["pose_id"] == f"P{k + 1}"]
        for k in range(5)
    ]) / 1e3  # fmt: skip
    command, middle = CUBE / 1e3, read.mean(axis=1)
    arrows, away = entity(opened, "/world/AP_x")
    spheres, wide = entity(opened, "/world/RP_x")
    vectors = last(opened, arrows, "Arrows3D:vectors")
    assert np.abs(vectors - away * (middle - command)).max() < SINGLE
    far = np.linalg.norm(read - middle[:, None], axis=2)
    RP = far.mean(axis=1) + 3 * far.std(axis=1, ddof=1)
    sizes = last(opened, spheres, "Ellipsoids3D:half_sizes")
    assert np.abs(sizes / wide - RP[:, None]).max() < SINGLE
    drawn = command + away * (middle - command)
    assert np.abs(last(opened, spheres, "Ellipsoids3D:centers") - drawn).max() < SINGLE
    cloud = last(opened, "/world/readings", "Points3D:positions").reshape(30, 5, 3)
    expected = drawn[:, None] + wide * (read - middle[:, None])
    assert np.abs(cloud.transpose(1, 0, 2) - expected).max() < SINGLE
    # clouds keep apart, and are seen
    assert 0.03 < sizes.max() < 0.5 * np.linalg.norm(command[1] - command[2])
    # the table has twelve digits of a meter: 1e-6 um, three times in a distance
    for name, value in (("AP", np.linalg.norm(middle - command, axis=1)), ("RP", RP)):
        assert scalars(opened, f"/figures/{name}")[1] == pytest.approx(1e6 * value, abs=5e-6)
    assert shown.called == tuple(f"pose P{k + 1}" for k in range(5))


def test_the_drift_is_that_of_the_last_ten_cycles(opened):
    _, mean = scalars(opened, "/drift/mean")
    rows, found = drifting(), []
    for end in range(10, 31):
        AP = []
        for k in range(5):
            own = [r for r in rows if r["pose_id"] == f"P{k + 1}" and end - 10 < r["cycle"] <= end]
            read = np.mean([[r[f"{a}_mm"] for a in "xyz"] for r in own], axis=0)
            AP.append(1e3 * np.linalg.norm(read - CUBE[k]))
        found.append(np.mean(AP))
    assert mean == pytest.approx(found, abs=5e-6)
    _, texts = column(opened, "/line", "TextDocument:text")
    assert any("cycles 21 to 30 of 30, pose P" in text[0] for text in texts)
    arrows, wide = entity(opened, "/world/drift_x")
    way = last(opened, arrows, "Arrows3D:vectors") / wide
    # twenty of twenty-nine parts of the warmth; the scatter of two means of ten is below 15 um
    assert way.mean(axis=0) == pytest.approx(WARM / 1e3 * 20 / 29, abs=15e-6)
    said = [text[0] for text in column(opened, "/now", "TextDocument:text")[1]]
    assert any("The robot drifts" in text or "Drift is not significant" in text for text in said)


def test_record_writes_it_again_and_only_from_a_whole_record(out):
    before = (out / "iso9283.rrd").read_bytes()
    again = out.parent / "before.rrd"
    again.write_bytes(before)
    result = call("record", out)
    assert (result.exit_code, result.stdout) == (0, f"{out / 'iso9283.rrd'}\n")
    assert viewed.compare(out / "iso9283.rrd", again)
    result = call("view", out, "--trial", "a", "--picture", out.parent / "x.png")
    assert result.exit_code == 2
    assert "a test after ISO 9283, which has no trials" in result.stderr
    whole = (out / "test.npz").read_bytes()
    (out / "test.npz").write_bytes(whole[:-40])
    result = call("record", out)
    assert result.exit_code == 2
    assert "truebed iso9283` command again" in result.stderr
    (out / "test.npz").unlink()
    assert call("record", out).exit_code == 2
    (out / "test.npz").write_bytes(whole)
    assert (out / "report.html").read_text().count('href="iso9283.rrd"') == 1


ONE = "\n".join(line for line in SESSION.splitlines() if "path" not in line)
NO_POSES = SESSION.replace('[cycles]\nfile = "cycles.csv"\n', "").replace("limits_um", "#")


MANY = np.tile(CUBE, (12, 1)) + np.arange(60)[:, None]
"""Sixty poses, no two of them in one place [mm]."""
ROWS = {
    "few cycles": (pose_rows(n=5), ONE, ["visit", "figures"]),  # too few to drift
    "one pose": (
        pose_rows(25, 10.0, np.ones((1, 3)), CUBE[:1]),
        ONE,
        ["visit", "figures", "drift"],
    ),
    "many poses": (pose_rows(5, 10.0, np.ones((60, 3)), MANY), ONE, ["visit", "figures"]),
    "a path": ([], NO_POSES, ["path1"]),
}


@pytest.mark.parametrize(("rows", "session", "names"), ROWS.values(), ids=ROWS)
def test_small_large_and_partial_tests_are_recorded_too(rows, session, names, tmp_path):
    folder = written(tmp_path / "data", rows, session)
    story = story_of(shown_test(play_test(read_test(folder))))
    assert [chapter.name for chapter in story.chapters] == names
    assert unfitting(story) == []
    (tmp_path / "test.rrd").write_bytes(story_bytes(story))
    assert viewed.verify(tmp_path / "test.rrd")

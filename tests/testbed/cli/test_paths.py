"""Paths that are not UTF-8, and those that no file has: refused at once, and nothing is written."""

import os
import shutil
import sys

import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.identify.folder import check_place, play_calibration
from testbed.robots.catalog import load_robot
from testbed.robots.write.folder import write_robot_folder
from testbed.run.play import play_run
from testbed.store import layout
from testbed.store.whole_folder import whole_folder
from testbed.studies import load_scenario
from tests.command import call
from tests.testbed.robots.test_robot_messages import with_mesh
from tests.testbed.studies.trial.fake_campaign import Fake, content, scenario

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
ODD = os.fsdecode(b"d\xff")
REFUSED = r"has a path that is not UTF-8, which records and MuJoCo cannot hold"


@pytest.fixture
def odd(tmp_path):
    folder = tmp_path / ODD
    folder.mkdir()
    return folder


def test_a_run_and_a_plan_go_there(odd):
    fake = Fake()
    for place in (odd.parent / "plain", odd / ODD):
        play_run(scenario(), place, studies=(fake,), derive=fake.derive)
    assert content(odd / ODD) == content(odd.parent / "plain")
    play_run(scenario(), odd / ODD, resume=True, studies=(fake,), derive=fake.derive)
    assert load_scenario(odd / ODD / "scenario.toml", finished=True) == scenario()
    with whole_folder(odd / "plan", layout.PLAN) as folder:
        (folder / layout.PLAN).write_bytes(b"{}")
    assert {path.name for path in odd.iterdir()} == {ODD, "plan"}


def scene_with_a_robot_there(odd):
    file = odd / "scene.toml"
    text = 'format = 1\nname = "x"\nseed = 1\nrobot = "./robot.toml"\n'
    file.write_text(text + '[[trial]]\nname = "a"\nposes = 12\n')
    return load_scenario(file)


def linked_robot(odd):
    """A robot whose plain name leads to a folder that has none."""
    (odd.parent / "arm").symlink_to(odd)
    return load_robot(odd.parent / "arm" / "robot.toml")


WAYS = {
    "robot.toml": lambda odd: load_robot(odd / "robot.toml"),
    "robot folder": load_robot,
    "urdf": lambda odd: load_robot(odd / "staubli_tx60.urdf"),
    "mjcf": lambda odd: load_robot(odd / "staubli_tx60.xml"),
    "link": linked_robot,
    "mesh root": lambda odd: load_robot(
        load_robot("staubli_tx60").folder / "staubli_tx60.urdf", mesh_root=odd
    ),
    "robot of a scenario": scene_with_a_robot_there,
    "measurements": lambda odd: read_session(odd / "points.csv", load_robot("staubli_tx60")),
    "session": lambda odd: read_session(odd / "session.toml", load_robot("staubli_tx60")),
    "identify": lambda odd: play_calibration(None, None, odd / "out"),
    "identify, asked first": lambda odd: check_place(odd / "out", overwrite=False),
    "robot written": lambda odd: write_robot_folder(load_robot("staubli_tx60"), odd / "out"),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_what_a_library_or_a_record_would_have_to_hold_is_refused_at_once(odd, way):
    for file in load_robot("staubli_tx60").folder.iterdir():
        if file.is_file():
            shutil.copy(file, odd)
    (odd / "points.csv").write_text("pose_id\n")
    (odd / "session.toml").write_text('match = "pose_id"\n')
    before = {path.name for path in odd.iterdir()}
    with pytest.raises(InputError, match=REFUSED) as caught:
        way(odd)
    assert any(name in ascii(str(caught.value)) for name in ("udcff", "arm"))
    assert {path.name for path in odd.iterdir()} - {"scene.toml"} == before


SCENE = 'format = 1\nname = "x"\nseed = 1\nrobot = {}\n[[trial]]\nname = "a"\nposes = 12\n'
NOWHERE = {
    "of 300 letters": ("x" * 300, "is too long for a path"),
    "with a NUL": ("a\0b", "holds a character that no path has"),
    "in a ring of links": ("ring", "is a ring of links"),
}
"""Names of files that no file system has, and what is said of them."""


def robot_of_a_scene(name):
    quoted = '"./' + name.replace("\0", "\\u0000") + '/arm.urdf"'
    yield "scene.toml", SCENE.format(quoted)
    yield "run", "scene.toml"


def file_of_a_session(name):
    quoted = '"' + name.replace("\0", "\\u0000")[:200] + '/a.csv"'
    yield "session.toml", f"[joints]\nfile = {quoted}\n[frames]\n"
    yield "identify", "staubli_tx60", "session.toml"


def mesh_of_a_robot(name):
    yield "arm.urdf", with_mesh(name)
    yield "identify", "arm.urdf", "a.csv"


CASES = {
    "scene": lambda name: [("run", f"{name}/scene.toml")],
    "scene to plan": lambda name: [("plan", f"{name}/scene.toml")],
    "robot of a scene": robot_of_a_scene,
    "robot": lambda name: [("identify", f"{name}/arm.urdf", "a.csv")],
    "robot to look at": lambda name: [("robots", f"{name}/arm.urdf")],
    "measurements": lambda name: [("identify", "staubli_tx60", f"{name}/a.csv")],
    "session": lambda name: [("identify", "staubli_tx60", f"{name}/session.toml")],
    "file of a session": file_of_a_session,
    "mesh": mesh_of_a_robot,
    "folder to write": lambda name: [("run", "quick", "--out", f"{name}/out")],
    "calibration to write": lambda name: [
        ("a.csv", "pose_id\n"), ("identify", "staubli_tx60", "a.csv", "--out", f"{name}/out")
    ],
    "run to report": lambda name: [("report", f"{name}/run")],
    "run to record": lambda name: [("record", f"{name}/run")],
    "recording to view": lambda name: [("view", f"{name}/campaign.rrd")],
    "measurements exported": lambda name: [("run", "quick", "--export", f"{name}/out")],
    "program": lambda name: [
        ("identify", "staubli_tx60", "a.csv", "--program", f"{name}/p.csv")
    ],
    "held-out poses": lambda name: [
        ("identify", "staubli_tx60", "a.csv", "--test", f"{name}/t.csv")
    ],
    "columns": lambda name: [("identify", "staubli_tx60", "a.csv", "--config", f"{name}/s.toml")],
    "mesh root": lambda name: [("identify", "arm.urdf", "a.csv", "--mesh-root", f"{name}/m")],
    "run to compare": lambda name: [("compare", f"{name}/run")],
}  # fmt: skip
"""Files to write, then the words of a command."""
WRITTEN = ("robot of a scene", "file of a session")
"""Cases whose file can hold a NUL: words of a command line and XML cannot."""


@pytest.mark.parametrize("kind", NOWHERE)
@pytest.mark.parametrize("case", CASES)
def test_a_path_that_no_file_has_ends_in_one_sentence_and_an_empty_folder(
    case, kind, tmp_path, monkeypatch
):
    """RELIABILITY V8: exit code 2, said in one line, and nothing but the user's files is there."""
    name, _ = NOWHERE[kind]
    if "\0" in name and case not in WRITTEN:
        pytest.skip("no command line and no XML holds a NUL")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ring").symlink_to("gnir")
    (tmp_path / "gnir").symlink_to("ring")
    *files, words = CASES[case](name)
    for file, text in files:
        (tmp_path / file).write_text(text)
    before = sorted(path.name for path in tmp_path.iterdir())
    done = call(*words)
    assert done.exit_code == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert "defect" not in done.stderr

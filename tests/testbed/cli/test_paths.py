"""Paths that are not UTF-8: they work where nothing must hold them, else are refused at once."""

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

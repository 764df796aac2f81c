"""A file of another kind is called by its kind, with the verb that takes it."""

import pytest

from testbed import assets
from tests.command import call

SESSION = 'format = 1\n[joints]\nfile = "a.csv"\n[frames]\nfile = "a.csv"\n'
FOLDER = assets.models() / "staubli_tx60"
QUICK = assets.scenes() / "quick.toml"
ROBOTS = ("staubli_tx60", FOLDER, FOLDER / "robot.toml", FOLDER / "staubli_tx60.urdf")


def said(*words):
    done = call(*words)
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()  # one sentence, not one for each key
    return line


@pytest.fixture
def session(tmp_path):
    (tmp_path / "a.csv").write_text("pose_id,q1_deg,x_mm\n1,2,3\n")
    (tmp_path / "session.toml").write_text(SESSION)
    return tmp_path / "session.toml"


@pytest.mark.parametrize("robot", ROBOTS)
def test_robot_and_data_in_each_others_place_are_called_swapped(robot, session):
    for data in (session, session.parent, session.parent / "a.csv"):
        line = said("identify", data, robot, "--out", session.parent / "out")
        assert line.startswith("ROBOT and DATA are swapped: ")
        assert line.endswith(f"; type truebed identify {robot} {data}. [S37]")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["identify", "SESSION", "nothing"], "a session of measurements, and a robot is wanted"),
        (["identify", "staubli_tx60", QUICK], "scenario, and a session of measurements is wanted"),
        (["identify", "staubli_tx60", FOLDER / "robot.toml"], "is a robot, and a session of"),
        (["identify", "staubli_tx60", FOLDER / "staubli_tx60.urdf"], "robot, and a table is want"),
        (["iso9283", QUICK], "is a scenario, and a session of measurements is wanted here; trueb"),
        (["run", "SESSION"], "measurements, and a scenario is wanted here; truebed identify ROBOT"),
        (["plan", FOLDER / "robot.toml"], "a robot, and a scenario is wanted here; truebed new sc"),
        (["new", "scene", "SESSION"], "is a session of measurements, and a robot is wanted here;"),
        (["new", "session", "SESSION"], "is a TOML file, and a table is wanted here; give a CSV"),
    ],
)
def test_each_verb_says_what_it_was_given_instead(words, told, session):
    words = [session if word == "SESSION" else word for word in words]
    assert told in said(*words, "--out", session.parent / "out")


def test_double_brackets_do_not_make_a_robot_of_a_session(session):
    session.write_text(SESSION.replace("[joints]", "[[joints]]"))
    line = said("check", session)
    assert "it must be a table; write [joints] and its keys below. [S37]" in line


def test_a_robot_without_joints_is_not_taken_for_a_session(tmp_path):
    (tmp_path / "robot.toml").write_text('format = 1\nname = "a"\n[sources]\nlimits = "b"\n')
    assert said("check", tmp_path / "robot.toml").endswith("[joints] is missing. [S37]")


def test_names_of_what_ships_and_folders_of_results_are_said_by_check_and_run(tmp_path):
    assert "`truebed robots staubli_tx60` shows" in said("check", "staubli_tx60")
    assert "`truebed scenes quick` shows" in said("check", "quick")
    (tmp_path / "manifest.json").write_text("{}")
    assert f"it is a run folder; to open it, type truebed view {tmp_path}." in said("run", tmp_path)

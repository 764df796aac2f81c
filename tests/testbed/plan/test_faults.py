"""Bad input of `truebed plan`: one clear error, exit code 2, nothing written."""

import pytest

from testbed.scenario.read import dump_scenario
from tests.command import call
from tests.planned import QUICK, scenario

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
LIST = {"kind": "list"}
POSE = [0.0, 10.0, 20.0, 0.0, 30.0, 0.0]
CASES = {
    "more poses than candidates": (
        {"plan.poses": 61},
        ["61 poses wanted", "the pool has 60", "enlarge the pool"],
    ),
    "listed goal out of reach": (
        {"plan.goal": LIST | {"tool_mm_deg": [[2000.0, 0.0, 0.0, 0.0, 0.0, 0.0]]}},
        ["entry 1 at (2000, 0, 0) mm is outside the robot's reach", "no nearer than 13"],
    ),
    "measured pose twice": (
        {"plan.measured": f"{HEAD}1,2,3,4,5,6\n9,8,7,6,5,4\n1,2,3,4,5,6\n"},
        ["measured.csv:4 is the same pose as", "measured.csv:2"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_clear_error_with_code_2_and_nothing_written(name, tmp_path):
    changes, words = CASES[name]
    (tmp_path / "in").mkdir()
    changes = dict(changes)
    if "plan.measured" in changes:
        file = tmp_path / "in" / "measured.csv"
        file.write_text(changes["plan.measured"], encoding="utf-8")
        changes["plan.measured"] = str(file)
    scene = tmp_path / "in" / "mine.toml"
    scene.write_text(dump_scenario(scenario(QUICK, **changes)), encoding="utf-8")
    done = call("plan", scene, "--out", tmp_path / "out")
    assert done.exit_code == 2, done.output
    error = [line for line in done.stderr.splitlines() if not line.startswith("[")]
    (line,) = error
    for word in words:
        assert word in line
    assert line.count("[M") + line.count("[S") + line.count("[C") == 1
    assert "Traceback" not in line
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_goal_that_is_no_number_is_refused_where_it_is_read(tmp_path):
    text = dump_scenario(scenario(QUICK, **{"plan.goal": LIST | {"joints_deg": [POSE]}}))
    scene = tmp_path / "mine.toml"
    scene.write_text(text.replace("20.0, 0.0, 30.0", "nan, 0.0, 30.0"), encoding="utf-8")
    assert "nan, 0.0, 30.0" in scene.read_text(encoding="utf-8")
    done = call("plan", scene, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "joints_deg[0][2] is nan; it must be a finite number" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("below", ["file/out", "file"])
def test_an_out_that_cannot_be_written_is_told_before_anything_is_computed(
    below, tmp_path, monkeypatch
):
    from testbed.plan import folder as plan_files

    def computed(*_, **__):
        raise AssertionError

    monkeypatch.setattr(plan_files, "make_plan", computed)
    (tmp_path / "file").write_text("mine")
    done = call("plan", "plan_tx60", "--out", tmp_path / below)
    assert done.exit_code == 2
    assert str(tmp_path / below) in done.stderr
    assert (tmp_path / "file").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]

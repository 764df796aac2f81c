"""Bad input of `truebed plan`: one clear error, exit code 2, nothing written."""

import pytest

from testbed.laboratory import pool
from testbed.scenario.read import dump_scenario
from tests.command import call
from tests.planned import QUICK, scenario

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
POINT = {"tracker.measures": "point", "identification.estimators": ["whitened"]}
LIST = {"kind": "list"}
INSIDE = [2600.0, 0.0, 300.0]
SCREEN = [{"kind": "box", "size_mm": [200.0, 200.0, 200.0], "position_mm": INSIDE}]
"""A box around the tracker."""
WALL = [{"kind": "box", "size_mm": [10.0, 280.0, 280.0], "position_mm": [1500.0, 0.0, 230.0]}]
"""Between the tracker and the middle of the robot's work space."""
FRAMES = [f"{frame}.{axis}" for frame in ("base", "tool") for axis in "xyz"]
"""Any two poses leave one direction of these unseen."""
POSE = [0.0, 10.0, 20.0, 0.0, 30.0, 0.0]


def measured(text):
    """A case with a CSV of measured poses."""
    return {"plan.measured": text}


CASES = {
    # 30 numbers, six rows a pose: 5 poses leave no equation to judge a calibration by
    "fewer poses than needed": (
        {"plan.poses": 3},
        ["poses is 3", "give 18 equations for 30 numbers", "write poses = 6 or more"],
    ),
    "fewer poses than needed, at stations compared": (
        {"plan.poses": 3, "plan.stations.list_mm": [INSIDE]},
        ["poses is 3", "give 18 equations for 30 numbers", "write poses = 6 or more"],
    ),
    "no equation to spare": (
        {"plan.poses": 5},
        ["poses is 5", "give 30 equations for 30 numbers", "write poses = 6 or more"],
    ),
    "no equation to spare beside poses measured": (
        measured(HEAD + "1,2,3,4,50,6\n9,8,7,6,60,4\n") | {"plan.poses": 3},
        ["with the 2 measured already, give 30 equations", "write poses = 4 or more"],
    ),
    "a random set that tells too little": (
        {
            "identification.free": FRAMES, "identification.estimators": ["whitened"],
            "plan.method": "random", "plan.poses": 2,
        },
        ["the 2 poses of", '"random" cannot tell the 6 numbers apart', "base.x", "exchange"],
    ),
    "more poses than candidates": (
        {"plan.poses": 61},
        ["61 poses wanted", "the pool has 60", "enlarge the pool"],
    ),
    # one reflector never shows how the tool is turned about it
    "unobservable whatever is chosen": (
        POINT | {"tracker.reflector_mm": [0.0, 0.0, 60.0], "plan.point_mm": [0.0, 0.0, 200.0]},
        ["tool.ry", "the tool point at the goal moves", "no pose of the pool shows it", "point_mm"],
    ),
    "nothing free": (
        {"identification.free": []},
        ["frees nothing"],
    ),
    "listed goal out of reach": (
        {"plan.goal": LIST | {"tool_mm_deg": [[2000.0, 0.0, 0.0, 0.0, 0.0, 0.0]]}},
        ["entry 1 at (2000, 0, 0) mm is outside the robot's reach", "no nearer than 13"],
    ),
    "path out of reach": (
        {
            "plan.goal": {
                "kind": "path",
                "tool_mm_deg": [[300.0, 0, 300, 0, 180, 0], [2000.0, 0, 300, 0, 180, 0]],
            }
        },
        ["entry 2 at (2000, 0, 300) mm is outside the robot's reach"],
    ),
    "goal box out of reach": (
        {"plan.goal.center_mm": [3000.0, 0.0, 0.0], "plan.goal.size_mm": [100.0, 100.0, 100.0]},
        ["[plan.goal] only 0 of 20 poses", "outside the box", "move center_mm"],
    ),
    "goal pose twice": (
        {"plan.goal": LIST | {"joints_deg": [POSE, POSE]}},
        ["entry 2 is the same pose as", "entry 1", "remove one of them"],
    ),
    "goal beyond a limit": (
        {"plan.goal": LIST | {"joints_deg": [[0.0, 10.0, 300.0, 0.0, 30.0, 0.0]]}},
        ["joint 3 is 300 deg", "-142.5 to 142.5 deg"],
    ),
    "station that sees nothing": (
        {"plan.stations.list_mm": [INSIDE], "cell.obstacle": SCREEN},
        ["the station cannot be used", "(2600, 0, 300) mm sees nothing", "of 60 candidates"],
    ),
    "station that sees too little": (
        {"plan.stations.list_mm": [[0.0, 0.0, 3000.0]], "tracker.acceptance_deg": 10.0},
        ["but no design: 8 poses wanted, the pool has"],
    ),
    "own station that sees nothing": (
        {"tracker.station_mm": INSIDE, "cell.obstacle": SCREEN},
        ["only 0 of 60 poses are feasible", "line of sight"],
    ),
    "station below the floor": (
        {"plan.stations.list_mm": [INSIDE, [2600.0, 0.0, -900.0]]},
        ["station 2 at (2600, 0, -900) mm lies 525 mm below the floor"],
    ),
    "own station below the floor": (
        {"tracker.station_mm": [0.0, 0.0, -3000.0]},
        ["[tracker] station_mm at (0, 0, -3000) mm lies 2625 mm below the floor"],
    ),
    "station in the work space": (
        {"plan.stations.list_mm": [INSIDE, [600.0, 0.0, 500.0]]},
        ["station 2 at (600, 0, 500) mm is 0.78 m from the base", "work space", "1.19 m or more"],
    ),
    "station in meters": (
        {"tracker.station_mm": [2.6, -2.0, 0.3]},
        ["at (2.6, -2, 0.3) mm is 0.00 m from the base", "it is in mm: are these meters?"],
    ),
    "station twice": (
        {"plan.stations.list_mm": [INSIDE, [2600.0, 0.5, 300.0]]},
        ["station 2 at (2600, 0, 300) mm is the same as station 1"],
    ),
    "collisions not tested": (
        {"pool.self_collision": False},
        ["self_collision is false", "a plan is for a real robot", "remove that key"],
    ),
    "goal pose in collision": (
        {"plan.goal": LIST | {"joints_deg": [POSE, [0.0, 120.0, 140.0, 0.0, 0.0, 0.0]]}},
        ["joints_deg entry 2 makes the robot hit itself"],
    ),
    "path corner in collision": (
        {"plan.goal": {"kind": "path", "joints_deg": [POSE, [0.0, 120.0, 140.0, 0.0, 0.0, 0.0]]}},
        ["joints_deg entry 2 makes the robot hit itself"],
    ),
    "held-out poses nobody can measure": (
        {
            "tracker.station_mm": INSIDE,
            "plan.goal.center_mm": [350.0, 0.0, 150.0],
            "plan.goal.size_mm": [120.0, 120.0, 120.0],
            "cell.obstacle": WALL,
        },
        ["[plan.goal] only", "held-out poses are feasible"],
    ),
    "start with too few joints": (
        {"plan.start_deg": [1.0, 2.0]},
        ["[plan] start_deg has 2 numbers", "6 joints"],
    ),
    "measured pose twice": (
        measured(HEAD + "1,2,3,4,5,6\n9,8,7,6,5,4\n1,2,3,4,5,6\n"),
        ["measured.csv:4 is the same pose as", "measured.csv:2"],
    ),
    "measured pose not a number": (
        measured(HEAD + "1,2,3,4,5,6\n1,2,nan,4,5,6\n"),
        ["measured.csv:3", 'q3_deg is "nan"', "it must be a number"],
    ),
    "measured pose with an empty cell": (
        measured(HEAD + "1,2,3,4,,6\n"),
        ["measured.csv:2", 'q5_deg is ""'],
    ),
    "measured column missing": (
        measured(HEAD.replace("q4_deg", "q4") + "1,2,3,4,5,6\n"),
        ["no column for joint 4", "q4_deg, q4_rad"],
    ),
    "measured without a row": (measured(HEAD), ["has no joint targets"]),
    "target out of reach": (
        {"plan.poses": 0, "plan.target_um": 1.0},
        ["target_um is 1, which 60 poses do not reach", "no set of so many goes below"],
    ),
    "start in collision": (
        {"plan.start_deg": [0.0, 120.0, 140.0, 0.0, 0.0, 0.0]},
        ["[plan] start_deg", "hits itself"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_clear_error_with_code_2_and_nothing_written(name, tmp_path, monkeypatch):
    # a tenth of the draws shows what is a hundred times too rare
    monkeypatch.setattr(pool, "PATIENCE", ((20_000, 1e-3), (4_000, 1e-2)))
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

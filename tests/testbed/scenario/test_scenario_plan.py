"""[cell] and [plan] in the scenario file: optional, strict, and written out again."""

import tomllib
from copy import deepcopy

import pytest

from calib.errors import InputError
from testbed.robots.catalog import load_robot
from testbed.scenario.hashes import scenario_hash
from testbed.scenario.read import changed, dump_scenario
from testbed.studies import load_scenario, parse_scenario, scenario_of
from tests.campaign import record_hash

TRIAL = {"name": "a", "poses": 20, "method": "random"}
SMALL = {"format": 1, "name": "small", "robot": "staubli_tx60", "trial": [TRIAL]}
BOX = {"kind": "box", "size_mm": [1, 2, 3], "position_mm": [4, 5, 6]}
ZERO = [0.0] * 6


def small(**tables):
    return scenario_of(deepcopy(SMALL) | deepcopy(tables))


def fault(**tables):
    with pytest.raises(InputError) as caught:
        scenario_of(deepcopy(SMALL) | tables, where="x.toml")
    (line,) = str(caught.value).splitlines()
    return line


FULL = {
    "cell": {"obstacle": [BOX, {"kind": "mesh", "file": "/cells/table.obj", "unit": "m"}]},
    "tracker": {"acceptance_deg": 50.0},
    "plan": {
        "target_um": 30.0,
        "target_is": "worst",
        "order": "random",
        "criterion": "G",
        "goal": {"kind": "path", "tool_mm_deg": [ZERO, ZERO], "weights": [2.0]},
        "stations": {"grid": {"from_mm": [0, 0, 0], "to_mm": [1, 1, 1], "count": [2, 3, 1]}},
        "start_deg": ZERO,
    },
}


def test_everything_survives_the_file():
    for tables in (
        {},
        FULL,
        {"plan": {"stations": {"list_mm": [[1, 2, 3], [4, 5, 6]]}}},
        {"plan": {"goal": {"kind": "list", "joints_deg": [ZERO, ZERO], "weights": [1.0, 2.0]}}},
        {"plan": {"use": {"payload_kg": 5.0, "tool": "gripper", "temperature_degC": -3.5}}},
        {"plan": {"use": {"tool": "gripper"}}},
        {"plan": {"goal": {"center_mm": [400, 0, 300], "size_mm": [100, 100, 100]}}},
    ):
        scenario = small(**tables)
        text = dump_scenario(scenario)
        assert parse_scenario(text, where="again") == scenario
        assert dump_scenario(parse_scenario(text, where="again")) == text
        absent = {"use"} - set(tables.get("plan", {}))
        assert set(tomllib.loads(text)["plan"]) == set(type(scenario.plan).model_fields) - absent


def test_without_the_tables_there_is_nothing_in_the_way_and_a_plan_of_29_poses():
    scenario = small()
    assert scenario.cell.obstacle == ()
    assert scenario.tracker.acceptance_deg == 180.0
    assert (scenario.plan.poses, scenario.plan.target_um) == (29, 0.0)
    assert scenario.plan.goal.kind == "box"
    assert not scenario.plan.stations.given
    assert small(pool={"size": 20}).plan.poses == 20
    assert small(plan={"target_um": 30}).plan.poses == 0


def test_a_file_made_for_planning_needs_no_trial():
    document = {key: value for key, value in SMALL.items() if key != "trial"}
    scenario = scenario_of(document | {"plan": {"poses": 40}})
    assert [(t.name, t.method) for t in scenario.trial] == [("designed", "detmax")]


def test_an_obstacle_moves_every_record_and_a_plan_none():
    robot = load_robot("staubli_tx60")
    base = small()
    for key in ("setting", "a", "random_sets"):
        other = small(cell={"obstacle": [BOX]})
        assert record_hash(other, robot, key) != record_hash(base, robot, key)
        assert record_hash(small(plan={"poses": 9}), robot, key) == record_hash(base, robot, key)
    assert scenario_hash(small(plan={"poses": 9}), robot) != scenario_hash(base, robot)


def test_a_mesh_counts_by_its_content_not_by_its_place(tmp_path):
    robot = load_robot("staubli_tx60")
    hashes = []
    for name, content in (("a", b"v 0 0 0"), ("b", b"v 0 0 0"), ("c", b"v 0 0 1")):
        file = tmp_path / f"{name}.obj"
        file.write_bytes(content)
        scenario = small(cell={"obstacle": [{"kind": "mesh", "file": str(file)}]})
        hashes.append(record_hash(scenario, robot, "setting"))
    assert hashes[0] == hashes[1] != hashes[2]
    gone = small(cell={"obstacle": [{"kind": "mesh", "file": str(tmp_path / "gone.obj")}]})
    with pytest.raises(InputError, match=r"gone\.obj\" cannot be read: No such file"):
        scenario_hash(gone, robot)
    with (tmp_path / "gone.obj").open("wb") as sparse:
        sparse.truncate(5 * 10**9)  # takes no room
    with pytest.raises(InputError, match=r"gone\.obj\" cannot be read: it has 5000 MB"):
        scenario_hash(gone, robot)


def test_files_start_from_the_scenario_and_stay_below_it(tmp_path):
    document = 'format = 1\nname = "x"\nrobot = "staubli_tx60"\n'
    plan = '[plan]\nmeasured = "{0}"\n[[cell.obstacle]]\nkind = "mesh"\nfile = "{1}"\n'
    file = tmp_path / "x.toml"
    file.write_text(document + plan.format("done.csv", "meshes/table.obj"))
    scenario = load_scenario(file)
    assert scenario.plan.measured == str((tmp_path / "done.csv").resolve())
    assert scenario.cell.obstacle[0].file == str((tmp_path / "meshes/table.obj").resolve())
    # what is written in a run folder means the same files
    assert parse_scenario(dump_scenario(scenario), where="y", folder=tmp_path / "r") == scenario
    for names, at in ((("../a.csv", "t.obj"), "[plan] measured is "),
                      (("a.csv", "../../t.obj"), "[[cell.obstacle]] 1 file is ")):  # fmt: skip
        file.write_text(document + plan.format(*names))
        with pytest.raises(InputError, match="a file beside the scenario") as caught:
            load_scenario(file)
        assert at in str(caught.value)


def test_a_sweep_over_the_pool_carries_the_plan_along():
    scenario = changed(small(), {"pool.box_size_mm": [100.0, 100.0, 100.0]})
    assert scenario.plan.goal.size_mm is None  # still the pool's box, whatever that is now

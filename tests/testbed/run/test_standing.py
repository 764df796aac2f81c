"""A run is refused where no tracker could stand, as a plan is; every shipped scene has room."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import inverse
from testbed.assets import scenes
from testbed.laboratory.bench import open_bench
from testbed.laboratory.tracker.stations import NEAREST, require_ranges, require_stations
from testbed.robots.catalog import load_robot
from testbed.robots.robot import workspace
from testbed.robots.room import BESIDE, from_arm
from testbed.robots.room import reach as length_of
from testbed.scenario.read import changed
from testbed.streams import stream
from testbed.studies import load_scenario
from tests.command import call
from tests.testbed.robots.described_cases import ARMS

NOWHERE = {
    "below the floor": (
        '[tracker]\nstation_mm = [2600.0, 0.0, -900.0]\n',
        "[tracker] station_mm at (2600, 0, -900) mm lies 525 mm below the floor; put the tracker "
        "above the floor. [S37]",
    ),
    "in the work space": (
        '[tracker]\nstation_mm = [600.0, 0.0, 500.0]\n',
        "[tracker] station_mm at (600, 0, 500) mm is 0.78 m from the base: the tracker would stand "
        "in the robot's work space; it needs 1.19 m or more, the arm's length and 0.5 m; move the "
        "tracker away from the robot. [S37]",
    ),
    "too near": (
        '[tracker]\nstation_mm = [1250.0, 0.0, 0.0]\n',
        "a pose of the pool brings the target to 0.",
    ),
    "a second one in the work space": (
        '[tracker]\nstation_mm = [2600.0, -2000.0, 300.0]\n[fixtures]\n'
        'stations_mm = [[2200.0, 2400.0, 600.0], [300.0, 0.0, 900.0]]\n',
        "[fixtures] stations_mm entry 2 at (300, 0, 900) mm is 0.95 m from the base",
    ),
}  # fmt: skip
SCENE = """format = 1
name = "standing"
seed = 1
robot = "staubli_tx60"
pool = {{ size = 300, line_of_sight = false }}
truth.preset = "rigid"
identification.estimators = ["whitened"]
{}
[[trial]]
name = "a"
poses = 20
method = "random"
"""


@pytest.mark.parametrize("where", NOWHERE)
def test_a_run_with_a_tracker_where_none_can_stand_is_refused_and_leaves_nothing(
    where, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    table, says = NOWHERE[where]
    (tmp_path / "scene.toml").write_text(SCENE.format(table))
    done = call("run", "scene.toml", "--out", "out")
    assert done.exit_code == 2, done.stderr
    assert done.stderr.startswith(f"scene.toml: {says}"), done.stderr
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize("scene", sorted(path.stem for path in scenes().glob("*.toml")))
def test_every_shipped_scene_has_room_for_its_tracker(scene):
    """By numbers worked out here: the links one after the other, targets as far as poses bring."""
    scenario = load_scenario(scene)
    bench = open_bench(scenario)
    require_stations(bench)
    chain = bench.robot.model.chain
    arm = np.hypot(chain.links[:, 1], chain.links[:, 2]).sum()
    arm += np.linalg.norm(chain.T_flange_tool[:3, 3])
    assert length_of(chain, bench.robot.limits) <= arm + 1e-12
    others = scenario.fixtures.stations_mm if scenario.fixtures else ()
    for station in (scenario.tracker.station_mm, *others):
        assert np.linalg.norm(station) / 1e3 > arm + BESIDE
    q = stream(1, "standing").uniform(*bench.robot.limits.T, (500, chain.n_joints))
    require_ranges(bench, q, "any")
    away = bench.robot.model.poses(q)[:, :3, 3] - bench.tracker.station
    assert np.linalg.norm(away, axis=1).min() > NEAREST + 0.2  # whatever is mounted on the tool


def test_a_gantry_has_its_tracker_beside_its_slides_and_not_beyond_all_of_them(tmp_path):
    """Slides carry the arm along lines: 8 m in all, and the arm that they carry is 1 m long."""
    (tmp_path / "gantry.urdf").write_text(ARMS["gantry"])
    robot = load_robot(tmp_path / "gantry.urdf")
    scene = load_scenario("quick").model_copy(update={"robot": str(tmp_path / "gantry.urdf")})
    chain, limits = robot.model.chain, robot.limits

    def standing(place):
        tracker = scene.tracker.model_copy(update={"station_mm": tuple(1e3 * place)})
        return open_bench(scene.model_copy(update={"tracker": tracker}))

    # the one that `truebed new scene` proposes
    beside = np.array(workspace(robot).station_mm) / 1e3
    require_stations(standing(beside))
    q = np.random.default_rng(0).uniform(*limits.T, (5000, 6))
    T = inverse(chain.T_world_base) @ robot.model.poses(q)
    free = from_arm(chain, limits, beside) - length_of(chain, limits)
    assert 0.5 < free <= np.linalg.norm(T[:, :3, 3] - beside, axis=1).min()
    # among the places of its tool, and a little above them
    for x, y, z in T[:2, :3, 3]:
        with pytest.raises(InputError, match=r"m from where the arm can slide: the tracker would"):
            require_stations(standing(np.array([x, y, max(z, 3.5)])))


def test_a_target_as_near_as_a_tracker_measures_is_taken_and_a_nearer_one_is_not():
    """The probe comes straight towards the tracker: the distance is known."""
    zero = np.zeros((1, 6))
    for gap, fits in ((NEAREST + 1e-6, True), (NEAREST - 1e-6, False)):
        bench = open_bench(load_scenario("quick"))
        target = bench.robot.model.poses(zero)[0]
        aimed = target[:3, 3] + target[:3, :3] @ bench.tracker.aim(bench.robot.model.chain)
        place = (aimed + gap * np.eye(3)[0]) * 1e3
        scenario = changed(load_scenario("quick"), {"tracker.station_mm": place.tolist()})
        there = open_bench(scenario)
        if fits:
            require_ranges(there, zero, "it")
        else:
            with pytest.raises(InputError, match=r"a pose of it brings the target to 0\.80 m"):
                require_ranges(there, zero, "it")

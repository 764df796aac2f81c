"""A scenario on any arm: it brings workspace and station; presets fit its joints or say so."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import rot_x
from calib.geometry.joint_errors import gravity_terms
from calib.geometry.model import RobotModel
from calib.identification.joint_models import extended_model, gravity_quarters
from testbed import assets
from testbed.gates.toml import read_toml
from testbed.laboratory.pool import Candidates, joint_ranges
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.terms import gravity_loads
from testbed.report.page import render
from testbed.robots.catalog import TRACKER, TRACKER_FILE, load_robot, robot_names
from testbed.robots.file import TrackerFile
from testbed.robots.robot import STAND, workspace, workspace_of_reach
from testbed.robots.room import BESIDE, from_arm, reach
from testbed.run.derive import page_of, recording_bytes
from testbed.run.play import play_run
from testbed.scenario.checks import check_robot
from testbed.scenario.presets import TRUTH_PRESETS
from testbed.scenario.read import dump_scenario
from testbed.studies import parse_scenario, scenario_of
from tests.testbed.robots.described_cases import ARMS, urdf

TX60, UR10, IIWA = (load_robot(n) for n in ("staubli_tx60", "universal_ur10", "kuka_iiwa7"))
SCALE = 0.3


def scenario(robot="kuka_iiwa7", **tables):
    """A scenario that leaves all it can to the robot."""
    trial = [{"name": "random", "poses": 20, "method": "random"}]
    return scenario_of({"format": 1, "name": "any", "robot": robot, "trial": trial} | tables)


def smaller(robot):
    """The same arm with all lengths times SCALE, and no workspace of its own."""
    links = robot.model.chain.links * [1, SCALE, SCALE, 1, 1]
    return replace(
        robot,
        model=RobotModel(Chain(links)),
        base_offset=robot.base_offset * SCALE,
        workspace=None,
        visuals=(),
    )


@pytest.mark.parametrize("name", robot_names())
def test_a_scenario_without_box_and_station_takes_the_robots(name):
    robot, bare = load_robot(name), scenario(name)
    assert bare.pool.box_center_mm == robot.workspace.box_center_mm
    assert bare.pool.box_size_mm == robot.workspace.box_size_mm
    assert bare.tracker.station_mm == robot.workspace.station_mm
    # what is written stays, key by key
    own = scenario(name, pool={"box_size_mm": [500.0, 500.0, 500.0]})
    assert own.pool.box_size_mm == (500.0, 500.0, 500.0)
    assert own.pool.box_center_mm == robot.workspace.box_center_mm
    assert parse_scenario(dump_scenario(bare), where="again") == bare


@pytest.mark.parametrize("name", robot_names())
def test_the_stated_workspace_is_reachable_and_seen(name):
    robot, bare = load_robot(name), scenario(name)
    simulator = Simulator(robot, robot.model.chain)
    tracker = tracker_from(bare.tracker, robot.model.chain)
    candidates = Candidates(robot, simulator, bare.pool, tracker.station)
    pool = candidates.draw(np.random.default_rng(0), size=40)
    assert pool.n_drawn < 20 * 40  # one candidate in twenty or better
    low, high = joint_ranges(robot, bare.pool).T
    assert ((pool.q >= low) & (pool.q <= high)).all()
    # the tracker stands outside the reach, and not below the floor
    reach = np.abs(robot.model.chain.links[:, 1:3]).sum()
    assert np.hypot(*tracker.station[:2]) > reach + 0.3
    assert tracker.station[2] - STAND >= robot.base_offset - 1e-12


def test_the_drawn_tracker_is_as_tall_as_stations_assume():
    file = assets.models() / TRACKER / TRACKER_FILE
    assert read_toml(file, TrackerFile, "tracker").beam_height_mm == 1e3 * STAND


def test_the_workspace_found_from_the_reach_grows_with_the_arm():
    """A fixed sample of postures: an arm of 0.3 times the size has a box of 0.3 times the size."""
    whole = workspace_of_reach(replace(IIWA, base_offset=-10.0))
    small = workspace_of_reach(replace(smaller(IIWA), base_offset=-10.0 * SCALE))
    for key in ("box_center_mm", "box_size_mm"):
        # both rounded to whole centimeters
        np.testing.assert_allclose(
            getattr(small, key), SCALE * np.array(getattr(whole, key)), atol=5 + SCALE * 5
        )
    assert workspace(smaller(IIWA)) == workspace_of_reach(smaller(IIWA))


def test_an_arm_that_hangs_below_its_base_works_there():
    """The quill of a SCARA is above the plane of its base only where it is drawn in."""
    whole, hung, stands = (
        workspace_of_reach(replace(IIWA, base_offset=offset)) for offset in (-10.0, 1.0, 0.3)
    )
    assert hung.box_size_mm == whole.box_size_mm
    assert hung.box_center_mm == whole.box_center_mm
    assert stands.box_size_mm[2] < whole.box_size_mm[2]


def test_the_workspace_found_from_the_reach_holds_feasible_poses():
    for robot in (UR10, TX60, smaller(IIWA)):
        found = workspace_of_reach(robot)
        bare = scenario("kuka_iiwa7")
        pool = bare.pool.model_copy(
            update={
                "box_center_mm": found.box_center_mm,
                "box_size_mm": found.box_size_mm,
                "joint_ranges_deg": found.joint_ranges_deg,
            }
        )
        station = np.array(found.station_mm) / 1e3
        candidates = Candidates(robot, Simulator(robot, robot.model.chain), pool, station)
        drawn = candidates.draw(np.random.default_rng(0), size=20)
        assert drawn.n_drawn < 400
    # joints that turn on and on are kept to half a turn about the middle
    assert workspace_of_reach(UR10).joint_ranges_deg == ((-180.0, 180.0),) * 6
    assert workspace_of_reach(TX60).joint_ranges_deg == ()


FOLDED = [
    (f"a{k}", kind, ".1 0 .3", "0 0 0", "0 0 1", (-1, 1))
    for k, kind in enumerate(("revolute", "revolute", "prismatic", "revolute"))
]
"""Its slide counts at its farthest: the box of its tool is small beside its length."""


@pytest.mark.parametrize("name", [*ARMS, "folded"])
def test_the_station_found_from_the_reach_is_where_a_tracker_can_stand(name, tmp_path):
    arm = urdf(name, FOLDED) if name == "folded" else ARMS[name]
    (tmp_path / "arm.urdf").write_text(arm)
    robot = load_robot(tmp_path / "arm.urdf")
    chain, limits = robot.model.chain, robot.limits
    station = np.array(workspace_of_reach(robot).station_mm) / 1e3
    assert from_arm(chain, limits, station) >= reach(chain, limits) + BESIDE
    # by numbers worked out here, where nothing slides before it turns
    if chain.kinds[0] == "revolute":
        slides = np.abs(limits).max(axis=1) @ chain.prismatic
        ends = np.linalg.norm(chain.T_flange_tool[:3, 3]) + slides
        arm = np.hypot(chain.links[:, 1], chain.links[:, 2]).sum() + ends
        assert reach(chain, limits) <= arm + 1e-12
        assert np.linalg.norm(station) >= reach(chain, limits) + BESIDE


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        ([[-90.0, 90.0]], "has 1 entry; kuka_iiwa7 has 7 joints"),
        ([[-90.0, 90.0]] * 6 + [[-90.0, 180.0]], "joint 7 go from -90 to 180 deg; .*175"),
        ([[-90.0, 90.0]] * 6 + [[90.0, -90.0]], "joint 7 go from 90 to -90 deg"),
    ],
)
def test_joint_ranges_that_the_robot_cannot_have_are_named(ranges, says):
    with pytest.raises(InputError, match=says) as caught:
        check_robot(scenario(pool={"joint_ranges_deg": ranges}), IIWA, where="x.toml")
    assert caught.value.code == "S37"


@pytest.mark.parametrize("preset", TRUTH_PRESETS)
@pytest.mark.parametrize("robot", [TX60, UR10, IIWA], ids=lambda robot: robot.name)
def test_each_preset_fits_the_arm_or_is_refused_in_words_before_anything_is_drawn(robot, preset):
    truth = scenario(robot.name, truth={"preset": preset})
    fits = ("rigid", "elastic", "drives", "moving", "payloads", "gears")
    closed = preset in fits or robot is not IIWA
    if not closed:
        with pytest.raises(InputError, match=r"gravity_mdeg does not fit this arm, kuka_iiwa7"):
            check_robot(truth, robot, where="x.toml")
        return
    if preset == "unmodelled" and robot is UR10:
        with pytest.raises(InputError, match=r'"posture" does not fit this arm, universal_ur10'):
            check_robot(truth, robot, where="x.toml")
        return
    check_robot(truth, robot, where="x.toml")
    true = draw_truth(robot, truth.truth, 0)
    q = np.zeros((2, len(robot.limits)))
    assert np.isfinite(true.poses(q)).all()


def test_without_a_preset_an_arm_of_another_kind_has_no_sag():
    truth = scenario().truth
    assert truth.gravity_mdeg == (0.0, 0.0, 0.0)
    assert truth.harmonic_mdeg == 6.0  # the rest of the preset stays
    assert truth.perturb == "links"
    assert scenario("universal_ur10").truth.gravity_mdeg == (10.0, 6.0, 8.0)
    check_robot(scenario(), IIWA, where="x.toml")


def test_the_papers_estimator_belongs_to_robots_that_have_its_set():
    assert scenario("staubli_tx60").identification.estimators == ("whitened", "paper")
    assert scenario("universal_ur10").identification.estimators == ("whitened",)
    wanted = scenario("universal_ur10", identification={"estimators": ["paper"]})
    with pytest.raises(InputError, match=r'"paper", but universal_ur10 has no free set "wen2022"'):
        check_robot(wanted, UR10, where="x.toml")


def test_an_arm_that_lies_level_at_zero_sags_by_cosines():
    """Torques of two weights by statics lie in the span of the closed form's waves, droop positive.

    Weights on the upper arm and the forearm, in the plane that gravity turns.
    """
    assert gravity_quarters(UR10.model.chain) == (1, 1)
    assert gravity_quarters(TX60.model.chain) == (0, 0)
    assert gravity_quarters(IIWA.model.chain) is None
    masses = np.array([0.0, 3.0, 2.0, 0.0, 0.0, 0.0])
    centers = np.zeros((6, 3))
    centers[1, 0], centers[2, 0] = -0.3, -0.25
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (50, 6))
    load = gravity_loads(UR10.model.chain, masses, centers, q)
    upper, fore = np.cos(q[:, 1]), np.cos(q[:, 1] + q[:, 2])
    for joint, waves in ((1, [upper, fore]), (2, [fore])):
        A = np.stack(waves, axis=1)
        size, residual, *_ = np.linalg.lstsq(A, load[:, joint])
        assert residual.item() < 1e-20
        assert (size > 0).all()  # it gives way where the weight pulls
    terms = {term.name: term.wave for term in gravity_terms(6, (1, 1))}
    assert set(terms.values()) == {"cos"}
    added = extended_model(UR10.model).joint_errors
    assert added.names[:3] == ("gravity2.upper", "gravity2.fore", "gravity3.fore")
    # hung from the ceiling the same arm droops the other way
    hanging = replace(UR10.model.chain, T_world_base=rot_x(np.pi))
    assert gravity_quarters(hanging) == (3, 3)


def test_sag_lowers_the_arm_whatever_its_zero_pose():
    for robot in (TX60, UR10):
        for base in (np.eye(4), rot_x(np.pi)):
            chain = replace(robot.model.chain, T_world_base=base)
            turned = replace(robot, model=RobotModel(chain))
            truth = scenario(robot.name, truth={"preset": "rigid"}).truth.model_copy(
                update={"angle_sd_deg": 0.0, "length_sd_mm": 0.0, "gravity_mdeg": (10.0, 0.0, 0.0)}
            )
            true = draw_truth(turned, truth, 0)
            q = np.random.default_rng(4).uniform(-np.pi, np.pi, (30, 6))
            dq = true.model.joint_errors.offsets(q)
            assert not dq[:, [0, 2, 3, 4, 5]].any()
            elbow = Chain(chain.links[:2], T_world_base=base)
            drop = RobotModel(elbow).poses((q + dq)[:, :2]) - RobotModel(elbow).poses(q[:, :2])
            # second order of 10 mdeg on 0.6 m: 2e-8 m
            assert (drop[:, 2, 3] < 2e-8).all()
            # a level upper arm drops by its length times 10 mdeg
            length = np.abs(chain.links[1, 2])
            assert drop[:, 2, 3].min() == pytest.approx(-length * np.radians(0.01), rel=0.05)


@pytest.mark.slow
def test_a_campaign_on_another_arm_is_played_told_and_recorded(tmp_path):
    small = scenario(
        UR10.name,
        seed=2,
        tracker={"preset": "at960"},
        pool={"size": 60},
        test={"poses": 20},
        uncertainty={"repeats": 2, "replications": 0, "draws": 2000},
        studies={"random_sets": 0},
        truth={"preset": "rigid"},
    )
    campaign = play_run(small).campaign
    estimate = campaign.trials[0].estimates[0]
    assert estimate.identification.rank == 30
    found = estimate.comparison
    assert found.accuracy_after.mean < 0.15 * found.accuracy_before.mean
    assert UR10.name in render(page_of(campaign, {}))
    assert len(recording_bytes(campaign, UR10)) > 1e5

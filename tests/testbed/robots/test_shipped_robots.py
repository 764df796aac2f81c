"""Every shipped robot: its numbers, bodies and drawing, and kinematics that agree three ways."""

import mujoco
import numpy as np
import pytest
from yourdfpy import URDF

from calib.geometry.chain import forward
from calib.geometry.parameters import parameters_of
from calib.information.reduction import reduce
from testbed.cli.doctor import check_kinematics
from testbed.laboratory.pool import joint_ranges
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot, robot_names
from testbed.robots.meshes.files import load_mesh
from testbed.robots.placements import link_poses
from testbed.scenario.tables import PoolSettings
from tests.testbed.robots.robot_cases import AGREE, joint_vectors

ROBOTS = {name: load_robot(name) for name in robot_names()}
UR10, IIWA = ROBOTS["universal_ur10"], ROBOTS["kuka_iiwa7"]
DEG = np.pi / 180
every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


def test_three_robots_ship():
    assert robot_names() == ["kuka_iiwa7", "staubli_tx60", "universal_ur10"]


def test_the_ur10_has_its_makers_numbers():
    # shared data ipa_ur10/README.md: d, a in mm, alpha in deg; theta and beta are 0
    table = [
        (127.3, 0, 90),
        (0, -612, 0),
        (0, -572.3, 0),
        (163.941, 0, 90),
        (115.7, 0, -90),
        (92.2, 0, 0),
    ]
    links = [(0, d / 1e3, a / 1e3, alpha * DEG, 0) for d, a, alpha in table]
    np.testing.assert_allclose(UR10.model.chain.links, links, rtol=1e-15)
    # lying along -x: worked out by hand from the table
    T = forward(UR10.model.chain, np.zeros((1, 6)))[0]
    where = [-0.612 - 0.5723, -0.163941 - 0.0922, 0.1273 - 0.1157]
    np.testing.assert_allclose(T[:3, 3], where, rtol=0, atol=1e-15)
    np.testing.assert_allclose(T[:3, 2], [0, -1, 0], rtol=0, atol=1e-15)


def test_the_iiwa_has_its_makers_numbers():
    links = IIWA.model.chain.links
    np.testing.assert_allclose(links[:, 1], [0.34, 0, 0.4, 0, 0.4, 0, 0.126], rtol=1e-15)
    np.testing.assert_allclose(links[:, 3], np.array([-90, 90, 90, -90, -90, 90, 0]) * DEG)
    assert not links[:, [0, 2, 4]].any()
    T = forward(IIWA.model.chain, np.zeros((1, 7)))[0]
    np.testing.assert_allclose(T[:3, 3], [0, 0, 1.266], rtol=0, atol=1e-15)
    np.testing.assert_allclose(T[:3, :3], np.eye(3), rtol=0, atol=1e-15)
    # its elbow turns on a circle about the line from shoulder to wrist while the hand stays
    q = np.array([[0.3, 0.5, 0.0, -1.2, 0.0, 0.7, 0.0]])
    shoulder, wrist = (link_poses(IIWA.model.chain, q)[0, k, :3, 3] for k in (2, 6))
    assert np.linalg.norm(wrist - shoulder) == pytest.approx(2 * 0.4 * np.cos(0.6), abs=1e-15)


@every_robot
def test_its_files_and_its_chain_agree_in_mujoco_and_yourdfpy(robot):
    chain, name = robot.model.chain, robot.name
    q = joint_vectors(100, robot=robot)
    own = forward(chain, q)
    model = mujoco.MjModel.from_xml_path(str(robot.folder / f"{name}.xml"))
    assert model.nmesh == len(robot.visuals)
    np.testing.assert_array_equal(model.jnt_range, robot.limits)
    data, tool = mujoco.MjData(model), model.site("tool").id
    urdf = URDF.load(str(robot.folder / f"{name}.urdf"), load_meshes=False)
    for values, T in zip(q, own, strict=True):
        data.qpos[:] = values
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site_xpos[tool], T[:3, 3], rtol=0, atol=AGREE)
        np.testing.assert_allclose(
            data.site_xmat[tool].reshape(3, 3), T[:3, :3], rtol=0, atol=AGREE
        )
        urdf.update_cfg(values)
        np.testing.assert_allclose(urdf.get_transform("tool0"), T, rtol=0, atol=AGREE)


def test_the_doctor_looks_at_every_robot():
    found = check_kinematics(poses=20)
    assert {one.robot for one in found} == set(ROBOTS)
    assert all(one.good for one in found)


@every_robot
def test_masses_lie_inside_the_bodies_they_belong_to(robot):
    for link in range(1, robot.model.chain.n_joints + 1):
        points = np.vstack([load_mesh(v.file).vertices for v in robot.visuals if v.link == link])
        center = robot.centers[link - 1]
        assert (points.min(axis=0) < center).all(), link
        assert (center < points.max(axis=0)).all(), link
    # a body of that mass and these moments exists
    moments = np.sort(robot.inertias, axis=1)
    assert (moments[:, 2] <= moments[:, :2].sum(axis=1)).all()


@every_robot
def test_it_stands_on_its_floor_and_carries_the_probe_on_its_flange(robot):
    frames = link_poses(robot.model.chain, np.zeros((1, len(robot.limits))))[0]
    flange = forward(robot.model.chain, np.zeros((1, len(robot.limits))))[0]
    heights = [
        (load_mesh(v.file).vertices @ frames[v.link][:3, :3].T + frames[v.link][:3, 3])[:, 2].min()
        for v in robot.visuals
    ]
    # to the 10 um grid of the files
    assert min(heights) == pytest.approx(robot.base_offset, abs=1e-5)
    (mount,) = (v for v in robot.visuals if v.name == "probe_mount")
    places = load_mesh(mount.file).vertices @ frames[mount.link][:3, :3].T
    on_flange = (places + frames[mount.link][:3, 3] - flange[:3, 3]) @ flange[:3, :3]
    assert on_flange[:, 2].min() == pytest.approx(0, abs=2e-5)


@every_robot
def test_every_body_can_hit_others_and_zero_touches_nothing(robot):
    n = robot.model.chain.n_joints
    assert {v.link for v in robot.visuals if v.collides} == set(range(n + 1))
    simulator = Simulator(robot, robot.model.chain)
    assert not simulator.collides(np.zeros((1, n)))[0]
    ranges = joint_ranges(robot, PoolSettings())
    q = np.random.default_rng(0).uniform(*ranges.T, (400, n))
    assert simulator.contacts(q).itself.any()


@every_robot
def test_the_joint_repeatability_gives_the_stated_iso_repeatability(robot):
    """ISO 9283 RP = mean + 3 sd of the distance from the barycenter."""
    stated_mm = "0.02" if robot.name == "staubli_tx60" else "0.10"
    rng = np.random.default_rng(2)
    center, size = (
        np.array(value) / 1e3
        for value in (robot.workspace.box_center_mm, robot.workspace.box_size_mm)
    )
    q = joint_vectors(4000, seed=2, robot=robot)
    q = q[(np.abs(forward(robot.model.chain, q)[:, :3, 3] - center) < size / 2).all(axis=1)][:200]
    n = q.shape[1]
    repeats = q[:, None] + rng.normal(size=(len(q), 30, n)) * robot.repeatability
    p = forward(robot.model.chain, repeats.reshape(-1, n))[:, :3, 3].reshape(len(q), 30, 3)
    distance = np.linalg.norm(p - p.mean(axis=1, keepdims=True), axis=-1)
    rp = distance.mean(axis=1) + 3 * distance.std(axis=1, ddof=1)
    # 200 postures x 30 repeats know the average to about 2 %
    assert f"{rp.mean() * 1e3:.2f}" == stated_mm


@pytest.mark.parametrize(
    ("name", "expected"), [("staubli_tx60", 30), ("universal_ur10", 30), ("kuka_iiwa7", 34)]
)
def test_full_poses_tell_four_numbers_per_turning_joint_and_six_apart(name, expected):
    robot = ROBOTS[name]
    q = joint_vectors(60, robot=robot)
    _, J = robot.model.poses_and_jacobian(q)
    table = parameters_of(robot.model).freeing(robot.model.names)
    A = (J * table.free_scale).reshape(-1, table.n_free)
    singular = np.linalg.svd(A, compute_uv=False)
    # a gap of many decades: the number is not a matter of tolerance
    assert singular[expected - 1] / singular[0] > 1e-3
    assert singular[expected] / singular[0] < 1e-12
    found = reduce(A, table, model=robot.model, q=q)
    assert found.rank == expected == 4 * robot.model.chain.n_joints + 6
    # between parallel axes beta is the number, elsewhere d
    parallel = {"staubli_tx60": (2,), "universal_ur10": (2, 3), "kuka_iiwa7": ()}[name]
    for i in range(1, robot.model.chain.n_joints):
        assert (f"beta{i}" in found.kept) is (i in parallel)


def test_a_set_of_all_links_can_be_freed_by_name():
    for robot in (UR10, IIWA):
        assert robot.free_sets["links"] == robot.model.names[6:-6]

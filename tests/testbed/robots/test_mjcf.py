"""Chains in MuJoCo against the chain's own kinematics; what collides and what does not."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from calib.geometry.chain import forward
from calib.geometry.frames import rot_z
from calib.geometry.jacobian import pose_and_jacobian
from calib.geometry.model import RobotModel
from testbed.robots.placements import link_poses, placements
from testbed.robots.write.mjcf import build_spec, compile_spec, mjcf_text, set_geometry
from tests.testbed.robots.robot_cases import AGREE, TX60, joint_vectors, perturbed, slider

CHAINS = [TX60.model.chain, *perturbed()]


def site_poses(model, q, site="tool"):
    """Poses (m, 4, 4) of a site by MuJoCo."""
    data, k = mujoco.MjData(model), model.site(site).id
    T = np.zeros((len(q), 4, 4))
    T[:, 3, 3] = 1
    for row, values in zip(T, q, strict=True):
        data.qpos[:] = values
        mujoco.mj_kinematics(model, data)
        row[:3, :3], row[:3, 3] = data.site_xmat[k].reshape(3, 3), data.site_xpos[k]
    return T


@pytest.fixture(scope="module")
def tx60():
    return compile_spec(build_spec(TX60.model.chain, TX60))


@pytest.mark.parametrize("chain", CHAINS, ids=["nominal", *map(str, range(20))])
def test_a_compiled_chain_puts_the_tool_where_the_chain_says(chain):
    q = joint_vectors()
    model = compile_spec(build_spec(chain))
    # position and rotation both: a wrong site rotation hides behind a right position
    np.testing.assert_allclose(site_poses(model, q), forward(chain, q), rtol=0, atol=AGREE)


def test_editing_in_place_equals_compiling_afresh():
    q = joint_vectors(1000, seed=5)
    model = compile_spec(build_spec(TX60.model.chain))
    for chain in (*CHAINS[1:], CHAINS[0]):
        set_geometry(model, chain)
        np.testing.assert_allclose(site_poses(model, q), forward(chain, q), rtol=0, atol=AGREE)
        on_flange = replace(chain, T_flange_tool=np.eye(4))
        np.testing.assert_allclose(
            site_poses(model, q[:50], "flange"), forward(on_flange, q[:50]), rtol=0, atol=AGREE
        )


def test_a_site_that_began_on_its_body_still_follows_an_edit():
    """MuJoCo marks such a site when compiling and would then ignore its new rotation."""
    chain = TX60.model.chain
    moved = replace(chain, T_flange_tool=rot_z(0.3))
    plain = build_spec(chain).compile()
    assert plain.site_sameframe.any()  # the trap is there
    set_geometry(plain, moved)
    q = joint_vectors(20)
    np.testing.assert_allclose(site_poses(plain, q), forward(moved, q), rtol=0, atol=AGREE)


def test_prismatic_joints_slide_by_the_commanded_value():
    chain, robot = slider()
    q = np.random.default_rng(6).uniform(-2, 2, (500, 4))
    for model in (compile_spec(build_spec(chain)), compile_spec(build_spec(chain, robot))):
        np.testing.assert_allclose(site_poses(model, q), forward(chain, q), rtol=0, atol=AGREE)


def test_bodies_are_where_the_drawings_are_put(tx60):
    q = joint_vectors(50)
    data = mujoco.MjData(tx60)
    expected = link_poses(TX60.model.chain, q)
    for values, poses in zip(q, expected, strict=True):
        data.qpos[:] = values
        mujoco.mj_kinematics(tx60, data)
        for link, T in enumerate(poses):
            k = tx60.body(f"link{link}" if link else "base").id
            np.testing.assert_allclose(data.xpos[k], T[:3, 3], atol=AGREE)
            np.testing.assert_allclose(data.xmat[k].reshape(3, 3), T[:3, :3], atol=AGREE)


def test_the_base_body_moves_with_the_base_frame():
    chain = CHAINS[1]
    model = compile_spec(build_spec(TX60.model.chain))
    set_geometry(model, chain)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    k = model.body("base").id
    np.testing.assert_allclose(data.xpos[k], chain.T_world_base[:3, 3], atol=AGREE)
    np.testing.assert_allclose(data.xmat[k].reshape(3, 3), chain.T_world_base[:3, :3], atol=AGREE)


def test_mujocos_site_jacobian_equals_the_joint_columns():
    chain = CHAINS[3]
    model = compile_spec(build_spec(chain))
    data, q = mujoco.MjData(model), joint_vectors(50)
    _, J = pose_and_jacobian(chain, q)
    theta = 6 + 5 * np.arange(6)
    linear, angular = np.zeros((3, 6)), np.zeros((3, 6))
    for values, rows in zip(q, J, strict=True):
        data.qpos[:] = values
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, linear, angular, model.site("tool").id)
        np.testing.assert_allclose(np.vstack([linear, angular]), rows[:, theta], atol=1e-10)


@pytest.mark.parametrize("chain", CHAINS[:4])
def test_the_written_file_keeps_every_digit(chain, tmp_path):
    robot = replace(TX60, model=RobotModel(chain), visuals=(), exclusions=())
    (tmp_path / "robot.xml").write_text(mjcf_text(robot), "utf-8")
    again = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    direct = compile_spec(build_spec(chain, robot))
    for field in ("body_pos", "body_quat", "site_pos", "site_quat", "jnt_range", "body_mass"):
        np.testing.assert_array_equal(getattr(again, field), getattr(direct, field))
    q = joint_vectors(200)
    np.testing.assert_allclose(site_poses(again, q), forward(chain, q), rtol=0, atol=AGREE)


def test_mesh_paths_in_the_file_are_relative():
    text = mjcf_text(TX60)
    assert 'file="meshes/forearm.obj"' in text
    assert str(TX60.folder) not in text


def test_limits_masses_and_parts_come_from_the_robot(tx60):
    np.testing.assert_array_equal(tx60.jnt_range, TX60.limits)
    assert tx60.jnt_limited.all()
    links = [tx60.body(f"link{i}").id for i in range(1, 7)]
    np.testing.assert_array_equal(tx60.body_mass[links], TX60.masses)
    np.testing.assert_array_equal(tx60.body_ipos[links], TX60.centers)
    # the drawing weighs nothing
    assert tx60.body_mass.sum() == pytest.approx(TX60.masses.sum(), abs=1e-12)


def collides(model, q):
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return {
        tuple(sorted(model.body(model.geom_bodyid[g]).name for g in contact.geom))
        for contact in data.contact
    }


def test_plain_postures_touch_nothing(tx60):
    for q in ([0, 0, 0, 0, 0, 0], [0, 0.6, 0.9, 0, 0.5, 0], [1, -0.5, 1.5, 2, -0.8, 3]):
        assert collides(tx60, q) == set()


@pytest.mark.parametrize(
    ("q_deg", "pair"),
    [
        # forearm down along the column, probe bent inward
        ([0, 100, 142, 0, 0, 0], ("base", "link6")),
        ([0, 0, 142, 0, 120, 0], ("link1", "link6")),
    ],
)
def test_a_folded_arm_hits_itself(tx60, q_deg, pair):
    assert pair in collides(tx60, np.radians(q_deg))


def test_neighbors_are_never_reported(tx60):
    q = joint_vectors(300)
    order = ["base", *(f"link{i}" for i in range(1, 7))]
    found = set().union(*(collides(tx60, row) for row in q))
    assert found  # some random postures do collide
    assert all(abs(order.index(a) - order.index(b)) > 1 for a, b in found)


def test_the_exclusions_are_what_keeps_neighbors_out():
    """MuJoCo's own parent filter is switched off, so that only the exclusions are left."""
    found = []
    for robot in (TX60, replace(TX60, exclusions=())):
        model = compile_spec(build_spec(TX60.model.chain, robot))
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
        found.append(collides(model, np.zeros(6)))
    assert found[0] == set()
    assert ("link4", "link5") in found[1]  # the wrist sits between the ears of the fork


def test_the_flange_site_is_the_end_of_the_last_link():
    model = compile_spec(build_spec(CHAINS[2]))
    np.testing.assert_allclose(
        model.site_pos[model.site("flange").id], placements(CHAINS[2]).flange[:3, 3], atol=1e-15
    )


def test_compiling_leaves_no_warning_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    compile_spec(build_spec(TX60.model.chain, TX60))
    assert not list(Path(tmp_path).iterdir())

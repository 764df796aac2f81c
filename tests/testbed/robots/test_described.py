"""Robots read from URDF and MJCF: poses of other readers, masses, meshes, what is assumed."""

import re
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.inverse import spread
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot
from testbed.robots.describe import description
from testbed.robots.describe.axes import chain_from_axes, reach, regauged
from testbed.robots.meshes.files import part_mesh
from testbed.robots.parts import IN_PLACE
from testbed.robots.placements import difference, link_poses
from testbed.robots.write.folder import write_robot_folder
from tests.testbed.robots.described_cases import (
    ARMS,
    CORNERS,
    IIWA_LIKE,
    MJCF,
    SIDES,
    UR_LIKE,
    bench_arm,
    block,
    urdf,
)
from tests.testbed.robots.robot_cases import AGREE, TX60, joint_vectors, yourdfpy_poses


def written(text, folder, name="arm.urdf"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


TIPS = {"ur": "tool0_link", "iiwa": "ee_link", "scara": "spin_link", "gantry": "tip_link"}


@pytest.mark.parametrize("arm", ARMS)
def test_an_arm_of_any_build_has_the_poses_of_its_urdf(arm, tmp_path):
    path = written(ARMS[arm], tmp_path)
    robot = load_robot(path)
    q = joint_vectors(50, robot=robot)
    np.testing.assert_allclose(
        robot.model.poses(q), yourdfpy_poses(path, q, TIPS[arm]), rtol=0, atol=AGREE
    )
    assert robot.agreement < AGREE
    assert f"{robot.agreement:.1g}" in robot.sources["geometry"]
    # no number of the chain is longer than the way from the base to the tip
    assert np.abs(robot.model.chain.links[:, 1:3]).max() <= reach(robot.model.chain) + AGREE


def test_three_parallel_axes_get_d_zero_and_beta(tmp_path):
    robot = load_robot(written(UR_LIKE, tmp_path))
    links = robot.model.chain.links
    np.testing.assert_allclose(np.abs(links[:3, 1]), [0.131, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.abs(links[1:3, 2]), [0.605, 0.57], atol=1e-12)
    np.testing.assert_allclose(np.sin(links[1:3, 3:]), 0, atol=1e-12)


def test_a_seven_axis_arm_has_alternating_alphas_and_four_lengths(tmp_path):
    links = load_robot(written(IIWA_LIKE, tmp_path)).model.chain.links
    np.testing.assert_allclose(np.abs(np.degrees(links[:6, 3])), 90, atol=1e-9)
    np.testing.assert_allclose(links[[1, 3, 5], 1], 0, atol=1e-12)
    np.testing.assert_allclose(np.abs(links[[0, 2, 4], 1]), [0.34, 0.4, 0.4], atol=1e-12)


def test_limits_speeds_and_masses_come_from_the_file_or_are_told(tmp_path):
    robot = load_robot(written(UR_LIKE, tmp_path))
    np.testing.assert_allclose(robot.limits[:5], [(-6.2, 6.2), *[(-3.1, 3.1)] * 4])
    np.testing.assert_allclose(robot.limits[5], [-2 * np.pi, 2 * np.pi])
    np.testing.assert_allclose(robot.speeds, [2.5] * 5 + [np.pi])
    np.testing.assert_allclose(robot.masses, 2.0)
    told = " | ".join(robot.notes)
    for word in ("joint wrist_3 without limits", "wrist_3 without a speed", "repeatability"):
        assert word in told
    assert robot.name == "collaborative_six"
    assert robot.joint_names == ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    assert not robot.limits.flags.writeable


def test_centers_of_mass_stay_where_the_urdf_has_them(tmp_path):
    """In the world at random postures: yourdfpy's link pose times the center in the link."""
    path = written(UR_LIKE, tmp_path)
    robot = load_robot(path)
    q = joint_vectors(10, robot=robot)
    bodies = link_poses(robot.model.chain, q)
    for i, name in enumerate(robot.joint_names):
        own = bodies[:, i + 1, :3, :3] @ robot.centers[i] + bodies[:, i + 1, :3, 3]
        T = yourdfpy_poses(path, q, f"{name}_link")
        np.testing.assert_allclose(own, (T @ [0, 0, 0.1, 1])[:, :3], rtol=0, atol=AGREE)


def test_links_fixed_to_each_other_weigh_together(tmp_path):
    """Two blocks of 2 kg at x = 0 and 1 (fixed): 4 kg at the middle, and Steiner's share."""
    text = urdf("pair", [("turn", "revolute", "0 0 0", "0 0 0", "0 0 1", (-1, 1))])
    more = (
        '<link name="far"><inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia ixx="0.02" '
        'ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>'
        '<joint name="fix" type="fixed"><parent link="turn_link"/><child link="far"/>'
        '<origin xyz="1 0 0"/></joint></robot>'
    )
    robot = load_robot(written(text.replace("</robot>", more), tmp_path))
    np.testing.assert_allclose(robot.masses, [4.0])
    T = link_poses(robot.model.chain, [[0.0]])[0, 1]
    np.testing.assert_allclose(T[:3, :3] @ robot.centers[0] + T[:3, 3], [0.5, 0, 0.1], atol=1e-12)
    moments = np.sort(robot.inertias[0])
    np.testing.assert_allclose(moments, [0.04, 1.02, 1.04], atol=1e-12)


def test_bodies_without_mass_are_rods_and_impossible_inertias_are_replaced(tmp_path):
    text = urdf("bare", [("a", "revolute", "0 0 1", "0 0 0", "0 1 0", (-1, 1))], bare=["a"])
    text = text.replace("</robot>", '<link name="t"/><joint name="f" type="fixed">'
                        '<parent link="a_link"/><child link="t"/><origin xyz="0 0 0.4"/></joint>'
                        "</robot>")  # fmt: skip
    robot = load_robot(written(text, tmp_path))
    np.testing.assert_allclose(robot.masses, [15 * 0.4])
    assert "no mass is given for what a moves" in " ".join(robot.notes)
    thin = UR_LIKE.replace('izz="0.01"', 'izz="0.09"', 1)
    robot = load_robot(written(thin, tmp_path))
    assert "no body has the inertia given for pan" in " ".join(robot.notes)
    moments = np.sort(robot.inertias, axis=1)
    assert (moments[:, 2] <= moments[:, :2].sum(axis=1)).all()


VISUAL = (
    '<visual><origin xyz="0.1 0 0" rpy="0 0 1"/><geometry><mesh filename="{}" '
    'scale="0.001 0.001 {}"/></geometry><material name="m"><color rgba="0.2 0.4 0.6 1"/>'
    "</material></visual>"
)


@pytest.mark.parametrize("height", [0.001, -0.001])
def test_meshes_are_drawn_where_the_urdf_puts_them(height, tmp_path):
    """Scaled, turned, mirrored: against yourdfpy's link pose times origin times scale."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.stl").write_bytes(block((100.0, 50.0, 200.0)))
    part = VISUAL.format("package://some_arm/meshes/part.stl", height)
    path = written(UR_LIKE.replace('<link name="tool0_link">', f'<link name="tool0_link">{part}'),
                   tmp_path)  # fmt: skip
    robot = load_robot(path)
    (visual,) = robot.visuals
    assert (visual.link, visual.rgb, visual.collides) == (6, (0.2, 0.4, 0.6), True)
    q = joint_vectors(3, robot=robot)
    T = link_poses(robot.model.chain, q)[:, 6]
    found = part_mesh(visual)
    c, s = np.cos(1.0), np.sin(1.0)
    corners = np.unique(np.array([[x, y, z] for x in (0, 0.1) for y in (0, 0.05)
                                  for z in (0, 200 * height)]), axis=0)  # fmt: skip
    placed = corners @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [0.1, 0, 0]
    theirs = yourdfpy_poses(path, q, "tool0_link")
    for own, other in zip(T, theirs, strict=True):
        mine = found.vertices @ own[:3, :3].T + own[:3, 3]
        want = placed @ other[:3, :3].T + other[:3, 3]
        apart = np.linalg.norm(mine[:, None] - want[None], axis=-1)
        # STL holds single precision of 200 mm
        assert apart.min(axis=0).max() < 1e-7
        assert apart.min(axis=1).max() < 1e-7
    # seen from outside: the volume by the divergence theorem is that of the block
    a, b, c = (found.vertices[found.faces[:, k]] for k in range(3))
    assert np.einsum("fx,fx->", a, np.cross(b, c)) / 6 == pytest.approx(1e-3, rel=1e-6)


def test_mujoco_draws_a_described_robot_where_the_viewer_does(tmp_path):
    robot = load_robot(bench_arm(tmp_path))
    model, q = Simulator(robot, robot.model.chain), joint_vectors(20, robot=robot)
    np.testing.assert_allclose(model.poses(q), robot.model.poses(q), rtol=0, atol=AGREE)


def test_mujoco_takes_an_obj_of_a_package_beside_the_folder_of_the_urdf(tmp_path):
    """As packages of ROS have it; the mesh stands in the frame of its link, so no number moves."""
    (package := tmp_path / "some_arm" / "urdf").mkdir(parents=True)
    (mesh := tmp_path / "some_arm" / "meshes" / "part.obj").parent.mkdir()
    corners = [f"v {x} {y} {z}" for x, y, z in 0.1 * CORNERS]
    sides = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in SIDES]
    mesh.write_text("\n".join(corners + sides), encoding="utf-8")
    shape = '<geometry><mesh filename="package://some_arm/meshes/part.obj"/></geometry>'
    base = f'<link name="base_link"><visual>{shape}</visual></link>'
    text = urdf("c", [("a", "revolute", "0 0 1", "0 0 0", "0 0 1", (-1, 1))])
    robot = load_robot(written(text.replace('<link name="base_link"/>', base), package))
    (visual,) = robot.visuals
    assert visual.file == mesh
    assert visual.affine == IN_PLACE
    q = joint_vectors(3, robot=robot)
    poses = Simulator(robot, robot.model.chain).poses(q)
    np.testing.assert_allclose(poses, robot.model.poses(q), rtol=0, atol=AGREE)


def test_collision_meshes_stand_in_where_nothing_is_drawn(tmp_path):
    (tmp_path / "hull.stl").write_bytes(block((0.1, 0.1, 0.1)))
    part = '<collision><geometry><mesh filename="hull.stl"/></geometry></collision>'
    text = urdf("c", [("a", "revolute", "0 0 1", "0 0 0", "0 1 0", (-1, 1))], parts={"a": part})
    (visual,) = load_robot(written(text, tmp_path)).visuals
    assert visual.collides


def test_a_dae_is_read_in_its_own_unit(tmp_path):
    """A block of 100 mm in a file that says millimetres, as modelling programs write it."""
    from trimesh import creation

    data = creation.box((100.0, 50.0, 20.0)).export(file_type="dae")
    unit = b'<unit name="millimeter" meter="0.001"/><up_axis>Z_UP'
    (tmp_path / "part.dae").write_bytes(data.replace(b"<up_axis>Y_UP", unit))
    part = '<visual><geometry><mesh filename="part.dae"/></geometry></visual>'
    text = urdf("d", [("a", "revolute", "0 0 1", "0 0 0", "0 1 0", (-1, 1))], parts={"a": part})
    (visual,) = load_robot(written(text, tmp_path)).visuals
    np.testing.assert_allclose(
        np.sort(np.ptp(part_mesh(visual).vertices, axis=0)), [0.02, 0.05, 0.1], atol=1e-12
    )


def test_hulls_that_always_touch_are_never_tested(tmp_path):
    """Links 1 and 3 sit in one block at every posture: no pose would be free otherwise."""
    (tmp_path / "big.stl").write_bytes(block((0.4, 0.4, 0.4), (-0.2, -0.2, -0.2)))
    part = '<visual><geometry><mesh filename="big.stl"/></geometry></visual>'
    joints = [(f"j{i}", "revolute", "0 0 0.01", "0 0 0", a, (-1, 1))
              for i, a in enumerate(("0 0 1", "0 1 0", "1 0 0"))]  # fmt: skip
    robot = load_robot(written(urdf("w", joints, parts={"j0": part, "j2": part}), tmp_path))
    assert ("link1", "link3") in robot.exclusions
    assert any("link1 and link3" in note for note in robot.notes)
    assert not Simulator(robot, robot.model.chain).contacts(np.zeros((1, 3))).itself.any()


def test_the_shipped_files_come_back_as_the_shipped_robot():
    for ending in ("urdf", "xml"):
        robot = load_robot(TX60.folder / f"{TX60.name}.{ending}")
        np.testing.assert_allclose(
            robot.model.chain.links, TX60.model.chain.links, rtol=0, atol=1e-14
        )
        for field in ("limits", "masses", "centers", "inertias"):
            np.testing.assert_allclose(
                getattr(robot, field), getattr(TX60, field), rtol=0, atol=1e-14
            )
        parts = {(v.file.name, v.rgb, v.collides, v.link) for v in robot.visuals}
        assert parts == {(v.file.name, v.rgb, v.collides, v.link) for v in TX60.visuals}
        assert robot.base_offset == pytest.approx(TX60.base_offset, abs=1e-9)


# --- ends, branches ---

HAND = """  <link name="left"/><link name="right"/>
  <joint name="open" type="prismatic"><parent link="ee_link"/><child link="left"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><parent link="ee_link"/><child link="right"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.04" effort="1" velocity="1"/>
    <mimic joint="open"/></joint>
</robot>"""


def test_several_ends_are_listed_and_one_can_be_chosen(tmp_path):
    path = written(IIWA_LIKE.replace("</robot>", HAND), tmp_path)
    with pytest.raises(InputError, match="the arm has 2 ends: left, right") as caught:
        load_robot(path)
    assert caught.value.code == "R16"
    robot = load_robot(path, tip="ee_link")
    assert robot.model.chain.n_joints == 7
    assert any("left out: left, right" in note for note in robot.notes)
    with pytest.raises(InputError, match="end the arm before it: --tip ee_link") as caught:
        load_robot(path, tip="right")
    assert str(caught.value).count("joint follow is a mimic joint of open") == 1
    assert load_robot(path, tip="left").model.chain.kinds[-1] == "prismatic"


def test_a_joint_that_follows_another_on_the_way_is_told_by_its_line_of_robot_toml(tmp_path):
    """Which is taken as it stands, and moves the arm as the URDF says."""
    tag = '<mimic joint="a2" multiplier="-0.5" offset="0.1"/>'
    head = 'name="a3" type="revolute">'
    path = written(IIWA_LIKE.replace(head, head + tag), tmp_path)
    with pytest.raises(InputError, match="joint a3 is a mimic joint of a2") as caught:
        load_robot(path)
    line = re.search(r"joints = \[.*\]", caught.value.fix)[0]
    assert "add its offset, 5.72957795 deg, to theta_deg of joint 3" in caught.value.fix
    arm = load_robot(written(IIWA_LIKE, tmp_path))
    write_robot_folder(arm, tmp_path / "arm")
    toml = tmp_path / "arm" / "robot.toml"
    toml.write_text(f"{toml.read_text()}\n[controller]\n{line}\n")
    held = load_robot(toml)
    q = held.controller.read(np.array([0.1, 0.2, 0.4, 0.5, 0.6, 0.7]), 7)
    np.testing.assert_allclose(q, [0.1, 0.2, -0.1, 0.4, 0.5, 0.6, 0.7], rtol=0, atol=1e-15)


def test_an_end_called_tool_is_the_tool_and_that_is_told(tmp_path):
    text = UR_LIKE.replace("tool0_link", "tool0")
    sensor = '<link name="ft"/><joint name="s" type="fixed"><parent link="wrist_3_link"/>' \
             '<child link="ft"/></joint></robot>'  # fmt: skip
    robot = load_robot(written(text.replace("</robot>", sensor), tmp_path))
    assert "the arm is taken to end at tool0; it also has ft" in robot.notes


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_several_freedoms_are_refused(kind, tmp_path):
    text = IIWA_LIKE.replace('name="a3" type="revolute"', f'name="a3" type="{kind}"')
    with pytest.raises(InputError, match=f"joint a3 is {kind}"):
        load_robot(written(text, tmp_path))


def test_a_robot_toml_has_no_tip():
    with pytest.raises(InputError, match="says itself where its tool is"):
        load_robot("staubli_tx60", tip="tool0")


def test_the_poses_are_compared_with_the_other_reader(tmp_path, monkeypatch):
    """Break the conversion by a micrometre: the file is refused."""
    right = chain_from_axes

    def wrong(points, axes, kinds, T):
        chain = right(points, axes, kinds, T)
        return Chain(chain.links + np.array([0, 1e-6, 0, 0, 0]), chain.kinds, chain.T_world_base,
                     chain.T_flange_tool)  # fmt: skip

    monkeypatch.setattr(description, "chain_from_axes", wrong)
    with pytest.raises(InputError, match="differ from those of yourdfpy by 1e-06 m") as caught:
        load_robot(written(urdf("o", [("a", "revolute", "0 0 1", "0 0 0", "0 1 0", (-1, 1))]),
                           tmp_path))  # fmt: skip
    assert caught.value.code == "R20"


def test_an_axis_of_another_length_is_taken_as_one_and_told(tmp_path):
    path = written(ARMS["scara"].replace("0 0 -1", "0 0 -2", 1), tmp_path)
    robot = load_robot(path)
    assert "the axis of joint quill has length 2; 1 is taken" in robot.notes
    q = np.array([[0.0, 0, 0.1, 0]])
    drop = robot.model.poses(q)[0, 2, 3] - robot.model.poses(0 * q)[0, 2, 3]
    assert drop == pytest.approx(-0.1, abs=1e-12)


# --- human-sized numbers ---


@settings(max_examples=40)
@example(17473, 0.01)  # 2.5 times the robot, if one link's frame may leave its joint too far
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-4, 1e-2, 0.1, 1.5]))
def test_skew_axes_give_no_length_beyond_the_robot(seed, size):
    """Axes that lean from each other by any angle, the small ones too: near-parallel is worst."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    kinds = tuple(rng.choice(["revolute", "prismatic"], n))
    points = np.cumsum(rng.normal(size=(n, 3)) * 0.3, axis=0)
    axes = [0, 0, 1] + rng.normal(size=(n, 3)) * size
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    T = np.eye(4)
    T[:3, 3] = points[-1] + [0.1, 0, 0.1]
    chain = chain_from_axes(points, axes, kinds, T)
    way = np.linalg.norm(points[0]) + sum(
        np.linalg.norm(b - a) for a, b in pairwise([*points, T[:3, 3]])
    )
    assert np.abs(chain.links[:, 1:3]).max() <= way * (1 + 1e-12)
    assert np.linalg.norm(chain.T_flange_tool[:3, 3]) <= way * (1 + 1e-12)
    # and it is the same arm: the product of exponentials
    q = rng.uniform(-2, 2, (5, n))
    np.testing.assert_allclose(
        forward(chain, q), exponentials(points, axes, kinds, T, q), rtol=0, atol=AGREE
    )


def exponentials(points, axes, kinds, T, q):
    """Poses by the product of exponentials of the screws of the axes at zero."""
    out = []
    for row in q:
        M = np.eye(4)
        for point, axis, kind, value in zip(points, axes, kinds, row, strict=True):
            step = np.eye(4)
            if kind == "prismatic":
                step[:3, 3] = axis * value
            else:
                K = np.cross(np.eye(3), axis).T * -1
                K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]],
                              [-axis[1], axis[0], 0]])  # fmt: skip
                R = np.eye(3) + np.sin(value) * K + (1 - np.cos(value)) * K @ K
                step[:3, :3], step[:3, 3] = R, point - R @ point
            M = M @ step
        out.append(M @ T)
    return np.array(out)


def test_a_chain_with_a_wild_gauge_is_given_sane_numbers_for_the_same_poses(tmp_path):
    """d2 = +439 m and d3 = -439 m between parallel axes: legal, and no length of any robot."""
    nominal = load_robot(written(UR_LIKE, tmp_path)).model.chain
    links = nominal.links.copy()
    links[1, 1] += 439.0
    links[2, 1] -= 439.0
    wild = Chain(links, nominal.kinds, nominal.T_world_base, nominal.T_flange_tool)
    sane = regauged(wild)
    assert np.abs(sane.links[:, 1:3]).max() < reach(nominal)
    q = np.random.default_rng(1).uniform(-3, 3, (50, 6))
    # 439 m lose three digits of 1e-16
    np.testing.assert_allclose(forward(sane, q), forward(wild, q), rtol=0, atol=1e-11)


# --- MJCF ---


def test_an_mjcf_has_the_poses_of_mujoco_at_every_joint_value(tmp_path):
    """Degrees, defaults, two joints in one body, a reference angle, a slide, a site as tool."""
    path = bench_arm(tmp_path)
    robot = load_robot(path)
    assert robot.model.chain.kinds == ("revolute",) * 3 + ("prismatic", "revolute")
    assert robot.joint_names == ("pan", "lift", "elbow", "reach", "twist")
    np.testing.assert_allclose(np.degrees(robot.limits[:2]), [(-170, 170), (-120, 120)])
    np.testing.assert_allclose(robot.limits[3], [0, 0.3])
    np.testing.assert_allclose(robot.limits[4], [-2 * np.pi, 2 * np.pi])
    model = mujoco.MjModel.from_xml_path(str(path))
    data, q = mujoco.MjData(model), joint_vectors(50, robot=robot)
    for row, T in zip(q, robot.model.poses(q), strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("grip").xpos, T[:3, 3], rtol=0, atol=AGREE)
        np.testing.assert_allclose(
            data.site("grip").xmat.reshape(3, 3), T[:3, :3], rtol=0, atol=AGREE
        )
    assert robot.agreement < AGREE
    np.testing.assert_allclose(robot.masses[1:], [4, 2, 1, 0.5])
    assert any("no mass is given for what pan moves" in note for note in robot.notes)
    assert robot.name == "bench_arm"


def test_meshes_of_an_mjcf_lie_where_mujoco_has_them(tmp_path):
    """MuJoCo moves a mesh into its own axes; against the block in the file, placed by hand."""
    robot = load_robot(bench_arm(tmp_path))
    base, upper = robot.visuals
    assert (base.link, upper.link) == (0, 2)
    assert base.rgb == (0.1, 0.2, 0.8)
    assert not base.collides  # its hull is another geom of the body
    (hull,) = robot.primitives
    assert (hull.link, hull.form.kind, hull.drawn, hull.collides) == (0, "box", False, True)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    mujoco.mj_kinematics(model, data)
    frames = link_poses(robot.model.chain, np.zeros((1, 5)))[0]
    for visual, geom in ((base, 1), (upper, 3)):
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        want = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        want = want @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        T = frames[visual.link]
        mine = part_mesh(visual).vertices @ T[:3, :3].T + T[:3, 3]
        apart = np.linalg.norm(mine[:, None] - want[None], axis=-1)
        # MuJoCo keeps vertices in single precision
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-6


def test_radians_and_includes_are_read_too(tmp_path):
    """The same arm in radians, its upper half in a file of its own."""
    want = load_robot(bench_arm(tmp_path))
    start, end = (
        MJCF.index('        <body name="fore"'),
        MJCF.index("      </body>\n    </body>\n  </w"),
    )
    (tmp_path / "fore.xml").write_text(f"<mujocoinclude>{MJCF[start:end]}</mujocoinclude>")
    text = MJCF[:start] + '<include file="fore.xml"/>' + MJCF[end:]
    robot = load_robot(bench_arm(tmp_path, text))
    q = joint_vectors(10, robot=robot)
    np.testing.assert_array_equal(robot.model.poses(q), want.model.poses(q))


def test_the_spread_of_joint_values_is_even_and_inside():
    """Each joint's values fall into every eighth of its range."""
    limits = np.array([[-1.0, 1], [0, 3], [2, 2.5]])
    q = spread(limits, 64)
    share = (q - limits[:, 0]) / np.ptp(limits, axis=1)
    assert ((share >= 0) & (share < 1)).all()
    for column in share.T:
        assert set((column * 8).astype(int)) == set(range(8))


def test_differences_of_poses_are_distances_and_angles():
    T = np.eye(4)[None].repeat(2, axis=0)
    other = T.copy()
    other[1, :3, 3] = [3e-9, 4e-9, 0]
    c, s = np.cos(1e-7), np.sin(1e-7)
    other[0, :2, :2] = [[c, -s], [s, c]]
    assert difference(T, other) == pytest.approx((5e-9, 1e-7), rel=1e-6)

"""URDF written and read through yourdfpy; bad descriptions are refused with file and line."""

import warnings
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yourdfpy

from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.model import RobotModel
from testbed.robots.describe.urdf import describe_urdf
from testbed.robots.describe.xml_gate import FileOptions
from testbed.robots.write.urdf import urdf_bytes
from tests.testbed.robots.described_cases import block
from tests.testbed.robots.robot_cases import (
    AGREE,
    TX60,
    joint_vectors,
    perturbed,
    slider,
    yourdfpy_poses,
)

SHIPPED = TX60.folder / "staubli_tx60.urdf"


def bare(chain):
    """The TX60 without drawings, on another chain."""
    return replace(TX60, model=RobotModel(chain), visuals=())


@pytest.mark.parametrize("chain", perturbed(), ids=range(20))
def test_yourdfpy_agrees_with_every_perturbed_chain(chain, tmp_path):
    (tmp_path / "r.urdf").write_bytes(urdf_bytes(bare(chain)))
    q = joint_vectors(100)  # what could differ does at any
    np.testing.assert_allclose(
        yourdfpy_poses(tmp_path / "r.urdf", q), forward(chain, q), rtol=0, atol=AGREE
    )


def test_prismatic_joints_slide_in_the_urdf_too(tmp_path):
    chain, robot = slider()
    (tmp_path / "r.urdf").write_bytes(urdf_bytes(robot))
    q = np.random.default_rng(6).uniform(-2, 2, (100, 4))
    np.testing.assert_allclose(
        yourdfpy_poses(tmp_path / "r.urdf", q), forward(chain, q), rtol=0, atol=AGREE
    )
    again = describe_urdf(tmp_path / "r.urdf", FileOptions())
    assert again.chain.kinds == chain.kinds
    np.testing.assert_allclose(forward(again.chain, q), forward(chain, q), rtol=0, atol=AGREE)


def test_reading_the_shipped_urdf_gives_the_papers_numbers_back():
    arm = describe_urdf(SHIPPED, FileOptions())
    np.testing.assert_allclose(arm.chain.links, TX60.model.chain.links, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(arm.chain.T_world_base, np.eye(4))
    np.testing.assert_allclose(arm.chain.T_flange_tool, np.eye(4), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(arm.limits, TX60.limits)
    np.testing.assert_array_equal(arm.speeds, TX60.speeds)
    assert arm.joint_names == tuple(f"joint_{i}" for i in range(1, 7))
    assert arm.notes == ()


@pytest.mark.parametrize("chain", perturbed(5, size=0.3) + perturbed(5, seed=9, size=1e-3))
def test_poses_survive_writing_and_reading(chain, tmp_path):
    """The link numbers may come back in another gauge; poses may not."""
    (tmp_path / "r.urdf").write_bytes(urdf_bytes(bare(chain)))
    q = joint_vectors(200)
    again = describe_urdf(tmp_path / "r.urdf", FileOptions()).chain
    # lengths in the other gauge reach 1 / sin(1 deg), so a dozen roundings of 60 m * 2e-16
    np.testing.assert_allclose(forward(again, q), forward(chain, q), rtol=0, atol=AGREE)


def random_urdf(rng, n=6):
    """A URDF whose joints sit and point anywhere, with fixed joints between."""
    lines = ['<robot name="any">', '<link name="l0"/>']
    for i in range(n):
        xyz, rpy = rng.normal(size=3) * 0.3, rng.uniform(-3, 3, 3)
        kind = rng.choice(["revolute", "continuous", "prismatic", "fixed"], p=[0.5, 0.2, 0.2, 0.1])
        axis = rng.choice([-1, 0, 1], 3) if rng.random() < 0.5 else rng.normal(size=3)
        axis = axis if np.abs(axis).sum() else np.array([0, 0, -1])
        if kind == "prismatic":  # yourdfpy slides by the length of the axis; URDF wants it 1
            axis = axis / np.linalg.norm(axis)
        lines += [
            f'<link name="l{i + 1}"/><joint name="j{i}" type="{kind}"><parent link="l{i}"/>',
            f'<child link="l{i + 1}"/><origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/>',
            f'<axis xyz="{_text(axis)}"/>',
            '<limit lower="-3" upper="3" effort="1" velocity="2"/></joint>',
        ]
    return "\n".join([*lines, "</robot>"])


def _text(values):
    return " ".join(repr(float(v)) for v in values)


@pytest.mark.parametrize("seed", range(12))
def test_any_axes_become_a_chain_with_the_same_poses(seed, tmp_path):
    rng = np.random.default_rng(seed)
    path = tmp_path / "any.urdf"
    path.write_text(random_urdf(rng))
    arm = describe_urdf(path, FileOptions(tip="l6"))
    q = rng.uniform(-2, 2, (100, arm.chain.n_joints))
    expected = yourdfpy_poses(path, q, "l6")
    np.testing.assert_allclose(forward(arm.chain, q), expected, rtol=0, atol=AGREE)


def test_parallel_and_opposite_axes_get_betas_and_no_huge_numbers(tmp_path):
    """Axes 0.1 degree from parallel: a common normal would lie hundreds of metres away."""
    path = tmp_path / "p.urdf"
    tilt = np.radians(0.1)
    text = ['<robot name="p"><link name="l0"/>']
    for i, rpy in enumerate(("0 0 0", f"{tilt} {tilt} 0", f"{np.pi + tilt} 0 0", "0 0 1")):
        text.append(
            f'<link name="l{i + 1}"/><joint name="j{i}" type="revolute"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><origin xyz="0.3 0.1 0.2" rpy="{rpy}"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="2"/></joint>'
        )
    path.write_text("".join([*text, "</robot>"]))
    chain = describe_urdf(path, FileOptions(tip="l4")).chain
    assert np.abs(chain.links[:, 1:3]).max() < 1
    # the tilt is split between alpha and beta by the direction of the common normal
    tilts = np.hypot(np.sin(chain.links[:2, 3]), np.sin(chain.links[:2, 4]))
    np.testing.assert_allclose(tilts, [np.sqrt(2) * tilt, tilt], rtol=1e-5)
    assert np.abs(chain.links[:2, 4]).min() > 0.1 * tilt
    q = np.random.default_rng(1).uniform(-2, 2, (100, 4))
    np.testing.assert_allclose(forward(chain, q), yourdfpy_poses(path, q, "l4"), rtol=0, atol=AGREE)


def test_mujoco_reads_the_shipped_urdf_to_the_same_poses():
    """Its compiler drops visuals and fuses fixed links unless told otherwise inside the file."""
    text = SHIPPED.read_text()
    told = '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco>'
    text = text.replace('<robot name="staubli_tx60">', f'<robot name="staubli_tx60">{told}')
    files = {visual.file.name: visual.file.read_bytes() for visual in TX60.visuals}
    model = mujoco.MjModel.from_xml_string(text, files)
    data, q, k = mujoco.MjData(model), joint_vectors(100), model.body("tool0").id
    for row, T in zip(q, forward(TX60.model.chain, q), strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.xpos[k], T[:3, 3], rtol=0, atol=AGREE)


def test_all_parts_are_in_the_urdf_with_relative_paths():
    model = yourdfpy.URDF.load(str(SHIPPED), load_meshes=False, build_scene_graph=False)
    for link, name in [(0, "base"), *((i, f"link_{i}") for i in range(1, 7))]:
        drawn = {visual.name for visual in model.link_map[name].visuals}
        assert drawn == {visual.name for visual in TX60.visuals if visual.link == link}
        hulls = {shape.name for shape in model.link_map[name].collisions}
        assert hulls == {v.name for v in TX60.visuals if v.link == link and v.collides}
    assert str(TX60.folder) not in SHIPPED.read_text()


# --- what is refused ---

GOOD = """<robot name="two">
  <link name="base"/>
  <link name="arm"/>
  <link name="tool0"/>
  <joint name="turn" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <origin xyz="0 0 0.1" rpy="0 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="fix" type="fixed"><parent link="arm"/><child link="tool0"/></joint>
</robot>
"""


def read_text(text, folder, **options):
    path = folder / "two.urdf"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return describe_urdf(path, FileOptions(**options))


def test_the_sample_itself_is_good(tmp_path):
    assert read_text(GOOD, tmp_path).chain.n_joints == 1


MESH = '<link name="arm"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'


def test_a_ring_of_links_beside_the_tree_is_named(tmp_path):
    joint = '<joint name="{0}{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    ring = '<link name="x"/><link name="y"/>' + joint.format("x", "y") + joint.format("y", "x")
    with pytest.raises(InputError, match=r"links .*x.* form a ring") as caught:
        read_text(GOOD.replace("</robot>", ring + "</robot>"), tmp_path)
    assert caught.value.code == "R15"


def test_a_symlink_out_of_the_folder_is_refused_and_a_wider_root_admits_it(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "secret.stl").write_bytes(b"")
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    text = GOOD.replace('<link name="arm"/>', MESH.format("link.stl"))
    with pytest.raises(InputError, match="lies outside") as caught:
        read_text(text, folder)
    assert caught.value.code == "R6"
    wider = GOOD.replace('<link name="arm"/>', MESH.format("model/link.stl"))
    assert read_text(wider, folder, mesh_root=tmp_path).chain.n_joints == 1


def test_zeros_that_an_exporter_rounded_state_no_inertia(tmp_path):
    moments = 'ixx="-5.42101e-20" iyy="-5.42101e-20" izz="0" ixy="0" ixz="0" iyz="0"'
    body = f'<link name="arm"><inertial><mass value="2"/><inertia {moments}/></inertial></link>'
    read = read_text(GOOD.replace('<link name="arm"/>', body), tmp_path)
    assert read.bodies[1].mass == 2
    assert not read.bodies[1].inertia.any()
    (note,) = (note for note in read.notes if "inertia" in note)
    assert "in link arm" in note
    assert "not used" in note


def test_a_package_is_any_folder_of_its_name_around_the_file(tmp_path):
    (package := tmp_path / "some_arm" / "urdf").mkdir(parents=True)
    (tmp_path / "some_arm" / "meshes").mkdir()
    mesh = tmp_path / "some_arm" / "meshes" / "part.stl"
    mesh.write_bytes(block())

    def arm_in(name):
        return GOOD.replace('<link name="arm"/>', MESH.format(f"package://{name}"))

    body = read_text(arm_in("some_arm/meshes/part.stl"), package).bodies[1]
    assert [shape.source for shape in body.shapes] == [mesh]
    with pytest.raises(InputError, match="is missing") as caught:
        read_text(arm_in("other_arm/meshes/part.stl"), package)
    assert caught.value.code == "R7"
    (tmp_path / "secret.stl").write_bytes(block())
    with pytest.raises(InputError, match="lies outside") as caught:
        read_text(arm_in("some_arm/../secret.stl"), package)
    assert caught.value.code == "R6"


@pytest.mark.parametrize(
    "shape",
    [
        'box size="1 1 1e300"',
        'cylinder radius="1e9" length="1"',
        'capsule radius="-1e4" length="1"',
    ],
)
def test_shapes_beyond_sense_are_refused(shape, tmp_path):
    link = f'<link name="arm"><visual><geometry><{shape}/></geometry></visual></link>'
    with pytest.raises(InputError, match="a length of a robot is at most 1000 m") as caught:
        read_text(GOOD.replace('<link name="arm"/>', link), tmp_path)
    assert caught.value.code == "R11"


SHAPES = {
    'box size="1 0 1"': "<box> in link arm with size=",
    'box size="-1 -1 -1"': "<box> in link arm with size=",
    'cylinder radius="1e-300" length="1"': 'with radius="1e-300"; a size of a shape is 1e-09 to 1',
    'cylinder radius="1" length="-0.1"': 'with length="-0.1"',
    'sphere radius="0"': '<sphere> in link arm with radius="0"',
    'capsule radius="0.1" length="-1"': '<capsule> in link arm with length="-1"',
    "cone": "known, and left out: <cone> in link arm",
    'capsule radius="0.1" length="0.2"': "",
    'sphere radius="1e-9"': "",
}


@pytest.mark.parametrize("where", ["visual", "collision"])
@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_that_are_not_drawn_never_keep_an_arm_from_being_read(shape, where, tmp_path):
    link = f'<link name="arm"><{where}><geometry><{shape}/></geometry></{where}></link>'
    arm = read_text(GOOD.replace('<link name="arm"/>', link), tmp_path)
    assert SHAPES[shape] in " | ".join(arm.notes)
    assert bool(arm.notes) == bool(SHAPES[shape])


OTHERS = (
    '<gazebo reference="arm"><visual><geometry><mesh><uri>model://a.dae</uri></mesh></geometry>'
    '</visual><limit lower="none"/></gazebo>',
    '<mujoco><compiler meshdir="m"/><asset><mesh name="a" file="a.stl"/></asset></mujoco>',
    '<ros2_control name="a"><joint name="turn"><axis xyz="z"/></joint></ros2_control>',
)


@pytest.mark.parametrize("other", OTHERS)
def test_words_for_simulators_and_drivers_play_no_part(other, tmp_path):
    arm = read_text(GOOD.replace("</robot>", f"{other}</robot>"), tmp_path)
    assert arm.joint_names == read_text(GOOD, tmp_path).joint_names


COLLIDING = {'box size="1 1 1"': True, 'capsule radius="1" length="1"': True, "cone": False}
"""Whether it is read."""


@pytest.mark.parametrize("shape", COLLIDING)
def test_a_link_collides_by_its_own_shape_and_by_its_mesh_where_that_is_not_read(shape, tmp_path):
    (tmp_path / "a.stl").write_bytes(block())
    mesh = MESH.format("a.stl").removesuffix("</link>")
    link = f"{mesh}<collision><geometry><{shape}/></geometry></collision></link>"
    arm = read_text(GOOD.replace('<link name="arm"/>', link), tmp_path)
    parts = [(part.drawn, part.collides) for body in arm.bodies for part in body.shapes]
    assert parts == ([(True, False), (False, True)] if COLLIDING[shape] else [(True, True)])
    assert not any(body.unread for body in arm.bodies)
    other = GOOD.replace('<link name="arm"/>', MESH.format("a.stl")).replace(
        '<link name="base"/>',
        f'<link name="base"><collision><geometry><{shape}/></geometry></collision></link>',
    )
    base, upper = read_text(other, tmp_path).bodies
    assert [part.collides for part in upper.shapes] == [False]
    assert base.unread == (not COLLIDING[shape])


def test_many_odd_things_are_told_in_few_words(tmp_path):
    link = "<visual><geometry><cone/></geometry></visual>" * 9000
    arm = read_text(GOOD.replace('<link name="arm"/>', f'<link name="arm">{link}</link>'), tmp_path)
    (note,) = arm.notes
    assert note.endswith("and 8988 more")


@pytest.mark.parametrize("size", ["1e16", "1.7976931348623157e308"])
def test_limits_that_a_continuous_joint_does_not_use_may_stand_for_none(size, tmp_path):
    text = GOOD.replace('lower="-1" upper="1"', f'lower="-{size}" upper="{size}"')
    arm = read_text(text.replace("revolute", "continuous"), tmp_path)
    np.testing.assert_array_equal(arm.limits, [[-np.inf, np.inf]])
    with pytest.raises(InputError, match="at most 1000000"):
        read_text(text, tmp_path)


def test_an_unknown_tip_is_answered_with_the_likely_one(tmp_path):
    with pytest.raises(InputError, match='did you mean "tool0"'):
        read_text(GOOD, tmp_path, tip="tool")


def test_encodings_and_line_ends_do_not_change_the_robot(tmp_path):
    path = tmp_path / "r.urdf"
    for data in (
        GOOD.encode("utf-8-sig"),
        GOOD.replace("\n", "\r\n").encode(),
        ('<?xml version="1.0" encoding="UTF-16"?>' + GOOD).encode("utf-16"),
        ('<?xml version="1.0" encoding="ISO-8859-1"?>' + GOOD.replace("two", "\u00e4")).encode(
            "latin-1"
        ),
    ):
        path.write_bytes(data)
        arm = describe_urdf(path, FileOptions())
        np.testing.assert_allclose(arm.chain.links[0], [0, 0.1, 0, 0, 0], atol=1e-15)
        np.testing.assert_allclose(forward(arm.chain, [[0.0]])[0, :3, 3], [0, 0, 0.1], atol=1e-15)


def test_writing_twice_gives_the_same_bytes(tmp_path):
    (tmp_path / "a.urdf").write_bytes(urdf_bytes(TX60))
    (tmp_path / "b.urdf").write_bytes(urdf_bytes(TX60))
    assert (tmp_path / "a.urdf").read_bytes() == (tmp_path / "b.urdf").read_bytes()

"""A URDF with corrected origins: its poses by another reader, and what is left as it was."""

import re
from dataclasses import replace

import numpy as np
import pytest
from lxml import etree
from scipy.spatial.transform import Rotation

from calib.geometry.chain import forward
from calib.geometry.frames import inverse, slide, step_transform
from testbed.robots.catalog import load_robot
from testbed.robots.placements import difference
from testbed.robots.source import UrdfText
from testbed.robots.write.own import urdf as own_urdf
from testbed.robots.write.own.places import NotCorrectableError
from testbed.robots.write.own.urdf import JointOrigin, corrected_urdf, near_rpy, with_origins
from tests.testbed.robots.described_cases import ARMS, GANTRY, TURN, UR_LIKE, urdf
from tests.testbed.robots.robot_cases import joint_vectors

SAME = 1e-11
"""Agreement with the other reader [m, 1]: numbers have 13 decimals, and arms a few joints."""
SIZES = np.array([2e-3, 4e-4, 4e-4, 2e-3, 2e-3])
"""By what the numbers of links are off [rad, m]."""
ODD = """<?xml version='1.0' encoding='ISO-8859-1'?>
<!-- <origin xyz="9 9 9"/> of nobody: Gr\u00f6\u00dfe > 1 -->
<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name='odd "arm"'>
  <link name="world"/><link name="column"><visual><origin xyz="1 2 3" rpy="0 0 1"/>
    <geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="upper"/><link   name = "fore" /><link name="bracket"/><link name="sled"/>
  <link name="hand"/><link name="finger"/><link name="camera"/><link name="tcp"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="column"/>
    <origin rpy="0 0.3 0.2" xyz=".1 0 0"/></joint>
  <joint name="pan" type="continuous">
    <parent link="column"/><child link="upper"/>
    <axis xyz="0 0 -2"/>
  </joint>
  <joint name='lift' type='revolute'><origin
      rpy='0.4 1.5707963267948966 0'
      xyz='0 0.1 0.4' tag=' rpy="1 1 1"'  ></origin><parent link='upper'/><child link='fore'/>
    <axis xyz='-1 0 0'/><limit lower='-2' upper='2.5' effort='1' velocity='1'/></joint>
  <joint name="mount" type="fixed"><parent link="fore"/><child link="bracket"/>
    <origin xyz="0.3 0 0.02" rpy="3.141592653589793 0 0"/></joint>
  <joint name="reach" type="prismatic"><origin xyz="0 0 .1"/>
    <parent link="bracket"/><child link="sled"/><axis xyz="0 3 4"/>
    <limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
  <joint name="twist" type="revolute"><origin rpy="0 3.1 0"/><parent link="sled"/>
    <child link="hand"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="grip" type="prismatic"><origin xyz="0.1 0 0"/><parent link="hand"/>
    <child link="finger"/><axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/>
  </joint>
  <joint name="eye" type="fixed"><origin xyz="0 0 .05"/><parent link="fore"/>
    <child link="camera"/></joint>
  <joint name="tip" type="fixed"><parent link="hand"/><child link="tcp"/></joint>
  <transmission name="t"><joint name="pan"><origin xyz="7 7 7"/></joint></transmission>
  <gazebo><![CDATA[<joint name="pan"><origin xyz="8 8 8"/>]]><?php <x> ?></gazebo>
</robot>
"""
PAIR = urdf(
    "\u6a5f\u68b0 \u30bd",
    [
        ("a", "revolute", "0 0 1", "0 0 0", "0 0 1", TURN),
        ("b", "fixed", "0 1 0", "0 0 0", "1 0 0", None),
    ],
)
ORIGIN = re.compile(r"\s*<origin\b(?:[^'\">]|'[^']*'|\"[^\"]*\")*>(?:</origin>)?")


def written(text, folder, encoding="utf-8"):
    path = folder / "arm.urdf"
    path.write_bytes(text.encode(encoding))
    return path


def off(chain, seed=1, last=True, sizes=SIZES):
    """A chain with other links, the last one as well or not."""
    by = sizes * np.random.default_rng(seed).standard_normal(chain.links.shape)
    by[-1] *= last
    return replace(chain, links=chain.links + by)


def poses(data, tip, names, q):
    """Poses (m, 4, 4) of a link in the root link, by lxml and scipy alone."""
    joints = {joint.find("child").get("link"): joint for joint in etree.fromstring(data)
              .findall("joint")}  # fmt: skip
    way = []
    while tip in joints:
        way.insert(0, joints[tip])
        tip = way[0].find("parent").get("link")
    out = np.tile(np.eye(4), (len(q), 1, 1))
    for joint in way:
        out = out @ origin_of(joint)
        if joint.get("type") == "fixed":
            continue
        at = joint.find("axis")
        axis = np.array([1.0, 0, 0] if at is None else at.get("xyz").split(), dtype=float)
        axis /= np.linalg.norm(axis)
        by = q[:, list(names).index(joint.get("name"))][:, None] * axis
        T = np.tile(np.eye(4), (len(q), 1, 1))
        if joint.get("type") == "prismatic":
            T[:, :3, 3] = by
        else:
            T[:, :3, :3] = Rotation.from_rotvec(by).as_matrix()
        out = out @ T
    return out


def origin_of(joint):
    """Frame (4, 4) of an lxml joint in its parent link."""
    own = joint.find("origin")
    x, a = (np.array(("0 0 0" if own is None else own.get(name, "0 0 0")).split(), dtype=float)
            for name in ("xyz", "rpy"))  # fmt: skip
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("xyz", a).as_matrix(), x
    return T


def origins(data):
    """Frame of every joint by its name."""
    return {joint.get("name"): origin_of(joint) for joint in etree.fromstring(data)
            .findall("joint")}  # fmt: skip


def changed(old, new):
    """Shift and turn of each origin that differs, by the name of its joint."""
    pairs = {name: (T, origins(new)[name]) for name, T in origins(old).items()}
    return {
        name: difference(inverse(T)[None] @ other, np.eye(4)[None])
        for name, (T, other) in pairs.items()
        if not np.array_equal(T, other)
    }


def elements(data):
    """Everything in a document, comments and text included, but the origins of its joints."""
    root = etree.fromstring(data)
    own = set(root.findall("joint/origin"))
    return [
        (one.tag, dict(one.attrib), (one.text or "").strip()) for one in root.iter()
        if one not in own
    ]  # fmt: skip


@pytest.mark.parametrize("arm", [*ARMS, "odd"])
def test_other_readers_find_the_identified_poses_and_only_origins_are_changed(arm, tmp_path):
    path = written(*((ODD, tmp_path, "latin-1") if arm == "odd" else (ARMS[arm], tmp_path)))
    robot = load_robot(path, tip="tcp" if arm == "odd" else None)
    # a scara's last link moves with its own joint: see below
    nominal, chain = robot.model.chain, off(robot.model.chain, last=arm != "scara")
    found = corrected_urdf(robot.own_text, nominal, chain, robot.limits)
    q = joint_vectors(20, robot=robot)
    T = poses(found.data, robot.own_text.tip, robot.joint_names, q)
    assert np.abs(T - forward(chain, q)).max() < SAME
    assert max(found.left) < SAME
    old = path.read_bytes()
    assert elements(found.data) == elements(old)
    one, two = (ORIGIN.sub("", data.decode("latin-1")) for data in (old, found.data))
    assert one == two  # to the last blank and line end
    moves = changed(old, found.data)
    assert tuple(moves) == found.changed
    assert set(moves) <= {*robot.joint_names, "tip", "tool0", "ee"}
    np.testing.assert_allclose(np.max(list(moves.values()), axis=0), found.moved, atol=1e-12)
    # nothing slides or turns far to gain little: a few times what numbers of links are off
    assert (np.array(found.moved) < 6 * SIZES[[1, 0]]).all()
    assert load_robot(
        written(found.data.decode("latin-1"), tmp_path, "latin-1"), tip=robot.own_text.tip
    )


@pytest.mark.parametrize("joint", [0, 2, 5])
def test_a_wrong_zero_turns_the_link_of_its_joint_and_leaves_every_other_origin(joint, tmp_path):
    robot = load_robot(written(UR_LIKE, tmp_path))
    links = robot.model.chain.links.copy()
    links[joint, 0] += np.radians(1.0)
    chain = replace(robot.model.chain, links=links)
    found = corrected_urdf(robot.own_text, robot.model.chain, chain, robot.limits)
    assert changed(UR_LIKE.encode(), found.data) == {
        robot.joint_names[joint]: pytest.approx((0, np.radians(1.0)), abs=1e-9)
    }


def test_slides_take_the_zeros_that_an_axis_behind_them_shows(tmp_path):
    """What lies behind the slides is 1 mm and 2 mm away along the first two of them."""
    robot = load_robot(written(GANTRY, tmp_path))
    away = GANTRY.replace('xyz="0 0 -0.4"', 'xyz="0.001 0.002 -0.4"')
    chain = load_robot(written(away, tmp_path)).model.chain
    found = corrected_urdf(robot.own_text, robot.model.chain, chain, robot.limits)
    assert changed(GANTRY.encode(), found.data) == {
        "x": pytest.approx((1e-3, 0), abs=1e-9), "y": pytest.approx((2e-3, 0), abs=1e-9)
    }  # fmt: skip


def test_a_tip_that_moves_with_its_own_joint_is_as_near_as_its_axis_lets_it(tmp_path):
    path = written(ARMS["scara"], tmp_path)
    robot = load_robot(path)
    nominal = robot.model.chain
    T_flange_tool = nominal.T_flange_tool @ step_transform(np.array([3e-4, 4e-4, 0.1, 0, 2e-3, 0]))
    links = off(nominal, last=False).links
    chain = replace(nominal, links=links, T_flange_tool=T_flange_tool)
    found = corrected_urdf(robot.own_text, nominal, chain, robot.limits)
    assert found.last == "spin"
    shift = np.linalg.norm([3e-4, 4e-4, 0.1])
    assert found.left == pytest.approx((shift, 2e-3), rel=1e-6)
    # the arm is right, with the tool that the file has
    q = joint_vectors(20, robot=robot)
    T = poses(found.data, "spin_link", robot.joint_names, q)
    own = replace(chain, T_flange_tool=nominal.T_flange_tool)
    assert np.abs(T - forward(own, q)).max() < SAME


def test_another_tool_moves_the_last_fixed_joint_and_another_base_the_first_moving_one(tmp_path):
    path = written(UR_LIKE, tmp_path)
    robot = load_robot(path)
    nominal = robot.model.chain
    tool = nominal.T_flange_tool @ step_transform(np.array([0.1, 0, 0.2, 0, 0, 1.5]))
    base = step_transform(np.array([0.01, 0, 0.02, 0.1, 0, 0])) @ nominal.T_world_base
    chain = replace(nominal, T_world_base=base, T_flange_tool=tool)
    found = corrected_urdf(robot.own_text, nominal, chain, robot.limits)
    assert found.changed == ("pan", "tool0")
    q = joint_vectors(5, robot=robot)
    T = poses(found.data, "tool0_link", robot.joint_names, q)
    assert np.abs(T - forward(chain, q)).max() < SAME


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8-sig", "shift_jis"])
def test_a_file_keeps_its_encoding_and_its_line_ends(encoding, tmp_path):
    named = encoding.removesuffix("-sig").removesuffix("-be")
    head = f'<?xml version="1.0" encoding="{named}"?>'
    text = PAIR.replace('<?xml version="1.0"?>', head).replace("\n", "\r\n")
    robot = load_robot(written(text, tmp_path, encoding))
    nominal, chain = robot.model.chain, off(robot.model.chain)
    found = corrected_urdf(robot.own_text, nominal, chain, robot.limits)
    plain = UrdfText(robot.own_text.path, PAIR.encode(), robot.own_text.tip)
    expected = corrected_urdf(plain, nominal, chain, robot.limits).data.decode()
    assert len(found.changed) == 2
    expected = expected.replace('<?xml version="1.0"?>', head).replace("\n", "\r\n")
    assert found.data == expected.encode(encoding)  # no mark more or less than there was


def test_a_text_that_cannot_be_taken_apart_is_left_alone(tmp_path):
    head = '<?xml version="1.0" encoding="UTF-7"?>'
    text = PAIR.replace('<?xml version="1.0"?>', head).encode("utf-7").decode()
    robot = load_robot(written(text.replace("<joint", "+ADw-joint"), tmp_path))
    chain = off(robot.model.chain)
    with pytest.raises(NotCorrectableError, match="save it as UTF-8"):
        corrected_urdf(robot.own_text, robot.model.chain, chain, robot.limits)


def test_new_numbers_stand_where_the_old_ones_stood_and_as_they_were_written():
    text = """<robot><joint name="a">\n\t<child/></joint><joint name='b'><origin rpy = '0 3.1 0' />
        </joint><joint name="c"><origin xyz="1 2 3" rpy=\"0 0 1\"/></joint></robot>"""
    turned = [np.eye(4), np.eye(4)]
    for T, pitch in zip(turned, (3.1, 3.2), strict=True):
        T[:3, :3] = Rotation.from_euler("y", pitch).as_matrix()
    new = with_origins(
        text.encode(),
        {"a": JointOrigin(np.eye(4), slide(0.1, 0, 0)),
         "b": JointOrigin(turned[0], slide(0, 0.25, 0) @ turned[1])},
        where="",
    )  # fmt: skip
    expected = text.replace("\n\t<child/>", '\n\t<origin xyz="0.1 0 0"/>\n\t<child/>')
    expected = expected.replace("'0 3.1 0' ", "'0 3.2 0' xyz=\"0 0.25 0\" ")
    assert new == expected.encode()


def test_angles_near_a_half_turn_keep_their_signs():
    T = step_transform(np.zeros(6))
    for angles in ([3.1, 0.2, -3.0], [0.1, 3.1, 0.2], [-7.0, 0.1, 0.0]):
        T[:3, :3] = Rotation.from_euler("xyz", np.array(angles) + 0.1).as_matrix()
        np.testing.assert_allclose(near_rpy(T, tuple(angles)), np.array(angles) + 0.1, atol=1e-12)


def test_a_file_with_other_poses_or_other_changes_is_a_defect(tmp_path, monkeypatch):
    robot = load_robot(written(PAIR, tmp_path))
    nominal, chain = robot.model.chain, off(robot.model.chain)
    right = own_urdf.with_origins
    for wrong, told in (
        (lambda data, *_, **__: data, "differs from the robot by"),
        (
            lambda *a, **k: right(*a, **k).replace(b'velocity="2.5"', b'velocity="2"'),
            "in more than",
        ),
    ):
        monkeypatch.setattr(own_urdf, "with_origins", wrong)
        with pytest.raises(RuntimeError, match=told):
            corrected_urdf(robot.own_text, nominal, chain, robot.limits)

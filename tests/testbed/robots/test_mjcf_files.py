"""MJCF files in the manner of others: what MuJoCo allows is read as MuJoCo means it."""

import mujoco
import numpy as np
import pytest

from calib.errors import InputError
from testbed.robots.catalog import load_robot
from testbed.robots.meshes.files import part_mesh
from testbed.robots.placements import link_poses
from tests.testbed.robots.described_cases import block

ARM = """<body name="one"><joint name="a" axis="0 0 1" {a}/><geom size=".05"/>
<body name="two" pos="0 0 .3"><joint name="b" axis="0 1 0" {b}/><geom size=".05"/>
<body name="three" pos="0 0 .3"><joint name="c" axis="0 1 0"/><geom size=".05"/>
{hand}<body name="plate"><site name="tip" pos="0 0 .1"/></body></body></body></body>"""
FINGER = '<body name="finger"><joint name="f" type="slide"/><geom size=".01"/></body>'
EYE = '<site name="eye" pos="0 0 .7"/>'


def arm(folder, *, top="", world="", a="", b="", hand="", tip="tip"):
    path = folder / "arm.xml"
    body = ARM.format(a=a, b=b, hand=hand)
    path.write_text(f"<mujoco>{top}<worldbody>{world}{body}</worldbody></mujoco>")
    return load_robot(path, tip=tip)


TENDON = '<tendon><fixed name="t">{}</fixed></tendon><equality><tendon tendon1="t"/></equality>'
COEFFICIENTS = '<joint joint="{}" coef="1"/><joint joint="{}" coef="1"/>'


@pytest.mark.parametrize(
    ("top", "says"),
    [
        ('<equality><connect site1="eye" site2="tip"/></equality>', "<connect> closes a ring"),
        ('<equality><weld body1="plate"/></equality>', "<weld> closes a ring at body plate, world"),
        ('<equality><connect body1="plate" body2="one" anchor="0 0 0"/></equality>', "a ring"),
        ('<equality><joint joint1="b" joint2="c"/></equality>', "b is a mimic joint of c"),
        ('<equality><joint joint1="b"/></equality>', "joint b is held by <equality>"),
        (TENDON.format(COEFFICIENTS.format("a", "b")), "joint b is tied by tendon t"),
    ],
)
def test_an_arm_whose_joints_do_not_move_alone_is_refused(top, says, tmp_path):
    with pytest.raises(InputError, match=says):
        arm(tmp_path, top=top, world=EYE, hand=FINGER)


@pytest.mark.parametrize(
    "top",
    [
        # what hangs on a link may be tied to it: no joint of the arm lies between
        '<equality><connect body1="finger" body2="three" anchor="0 0 0"/></equality>',
        '<equality><joint joint1="f" joint2="c"/></equality>',
        TENDON.format(COEFFICIENTS.format("c", "f")),
        # a body that a user drags about is not the world
        '<equality><weld body1="pointer" body2="three"/></equality>',
        '<equality><weld body1="three" active="false"/></equality>',
        '<default><default class="off"><equality active="false"/></default></default>'
        '<equality><joint class="off" joint1="b" joint2="c"/></equality>',
    ],
)
def test_constraints_that_leave_the_arm_alone_do_not_keep_it_from_being_read(top, tmp_path):
    robot = arm(tmp_path, top=top, world='<body name="pointer" mocap="true"/>', hand=FINGER)
    assert robot.joint_names == ("a", "b", "c")


@pytest.mark.parametrize(
    ("words", "limits"),
    [
        ('range="0 0"', (-360, 360)),  # what MuJoCo has for none
        ('range="40 -40" limited="false"', (-360, 360)),
        ('range="-40 40"', (-40, 40)),
    ],
)
def test_a_joint_has_the_limits_that_mujoco_gives_it(words, limits, tmp_path):
    robot = arm(tmp_path, top='<default><joint range="-90 90"/></default>', b=words)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert model.jnt_limited.tolist() == [1, limits[1] < 360, 1]
    np.testing.assert_allclose(robot.limits[1], np.radians(limits), rtol=1e-12)
    assert ("joint b without limits" in " | ".join(robot.notes)) == (limits[1] == 360)


def test_the_scene_around_an_arm_does_not_keep_it_from_being_read(tmp_path):
    top = """<asset><texture type="skybox" builtin="gradient" width="8" height="48"/>
    <texture name="g" type="2d" builtin="checker" width="8" height="8"/>
    <material name="ground" texture="g"/><hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/>
    </asset><custom><text name="load" data="50%"/></custom>"""
    world = (
        '<geom type="plane" size="1 1 1" material="ground"/><geom type="hfield" hfield="hills"/>'
    )
    assert arm(tmp_path, top=top, world=world).joint_names == ("a", "b", "c")


@pytest.mark.parametrize("own", ["", 'scale="1 -2 .5"', 'inertia="shell"'])
def test_a_mesh_lies_where_mujoco_has_it_whatever_frame_of_its_file_it_is_taken_in(own, tmp_path):
    (tmp_path / "block.stl").write_bytes(block())
    mesh = f'<asset><mesh file="block.stl" refpos=".1 .2 -.3" refquat="2 1 0 -1" {own}/></asset>'
    robot = arm(tmp_path, top=mesh, hand='<geom type="mesh" mesh="block" pos=".1 0 0"/>')
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data, q = mujoco.MjData(model), np.array([[0.3, -0.4, 0.5]])
    data.qpos[:] = q[0]
    mujoco.mj_kinematics(model, data)
    (geom,) = np.flatnonzero(model.geom_dataid >= 0)
    theirs = model.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    (visual,) = robot.visuals
    T = link_poses(robot.model.chain, q)[0, visual.link]
    ours = part_mesh(visual).vertices @ T[:3, :3].T + T[:3, 3]
    apart = np.linalg.norm(ours[:, None] - theirs, axis=2)
    # MuJoCo keeps vertices in single precision
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-6

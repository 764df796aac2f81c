"""MJCF files in the manner of others: what MuJoCo allows is read as MuJoCo means it."""

import pytest

from calib.errors import InputError
from testbed.robots.catalog import load_robot

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

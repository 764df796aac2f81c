"""An MJCF with corrected bodies: its poses by MuJoCo's own reader, and what is left as it was."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from lxml import etree

from calib.errors import refuse
from calib.geometry.chain import forward
from calib.geometry.frames import step_transform
from testbed.robots.catalog import load_robot
from testbed.robots.source import MjcfText
from testbed.robots.write.own import mjcf as own_mjcf
from testbed.robots.write.own.mjcf import corrected_mjcf
from testbed.robots.write.own.places import NotCorrectableError
from tests.testbed.robots.robot_cases import joint_vectors

SAME = 1e-11
"""Agreement with MuJoCo's reader [m, 1]: numbers have 13 decimals, and arms a few joints."""
SIZES = np.array([2e-3, 4e-4, 4e-4, 2e-3, 2e-3])
"""By what the numbers of links are off [rad, m]."""
PLACED = ("pos", "quat", "euler", "axisangle", "xyaxes", "zaxis")
PLAIN = """<?xml version="1.0"?>
<mujoco model="six">
  <!-- a pos="9 9 9" of nobody -->
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="base">
      <geom type="box" size=".1 .1 .1"/>
      <body name="one" pos="0 0 0.3">
        <joint name="j1" axis="0 0 1" range="-3 3"/><geom size=".05"/>
        <body name="two" pos="0.1 0 0.1" quat="1 1 0 0">
          <joint name="j2" axis="0 0 1" range="-2 2"/><geom size=".05"/>
          <body name="three" pos="0.5 0 0">
            <joint name="j3" axis="0 0 1" range="-2 2"/><geom size=".05"/>
            <body name="four" pos="0.1 0.2 0" quat="1 -1 0 0">
              <joint name="j4" axis="0 0 1" range="-3 3"/><geom size=".05"/>
              <body name="five" pos="0 0 0.3" quat="1 1 0 0">
                <joint name="j5" axis="0 0 1" range="-2 2"/><geom size=".05"/>
                <body name="six" pos="0 0.1 0" quat="1 -1 0 0">
                  <joint name="j6" axis="0 0 1" range="-3 3"/><geom size=".05"/>
                  <site name="tool" pos="0 0 0.1"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="j1" kp="10"/><position joint="j2"/><position joint="j3"/>
    <position joint="j4"/><position joint="j5"/><position joint="j6"/></actuator>
  <keyframe><key name="home" qpos="0 0 0 0 0 0"/></keyframe>
</mujoco>
"""
ODD = """<mujoco model='odd'>
  <compiler angle='degree' eulerseq='ZYX'/>
  <default>
    <joint axis='0 1 0' pos='.01 .02 .03' armature='.1'/>
    <geom size='.04' type='sphere' material='gray'/> <site material='gray'/>
    <default class='turned'><joint axis='0 0 -2' ref='20' range='-170 170'/></default>
    <default class='sled'><joint type='slide' axis='1 0 .2' ref='.1' range='-.3 .5'/></default>
  </default>
  <asset><material name='gray' rgba='.5 .5 .5 1'/></asset>
  <worldbody>
    <geom type='plane' size='1 1 1' pos='0 0 -1'/>
    <body
       name='column' pos='.1 0 0' euler='10 20 30'>
      <geom/>
      <body childclass='turned' pos='0 .1 .2' axisangle='0 1 0 35'>
        <joint name='pan'/><geom/>
        <body name = 'camera' pos='.1 .1 0'><geom/></body>
        <body name='bracket' xyaxes='0 1 0 -1 0 0'><geom/>
          <body name='sled' zaxis='0 1 1'><joint name='along' class='sled'/><geom/>
            <body name='fore' pos='0 0 .4' euler='0 0 90' childclass='turned'>
              <joint name='lift' axis='0 1 0' pos='0 0 .05'/><geom/>
              <body name='hand' pos='.3 0 0'>
                <joint name='spin' axis='1 0 0' pos='0 0 0'/><geom/>
                <body name='finger' pos='0 .1 0'><joint name='grip' type='slide'/><geom/></body>
                <body name='flange' pos='.1 0 0' ><geom/>
                  <site name='tcp' euler='0 90 0' material='gray'/></body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
FILES = {"plain": (PLAIN, "tool"), "odd": (ODD, "tcp"), "odd, body": (ODD, "flange")}


def written(text, folder, name="arm.xml", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def off(chain, seed=1, last=True):
    """A chain with other links, the last one as well or not."""
    by = SIZES * np.random.default_rng(seed).standard_normal(chain.links.shape)
    by[-1] *= last
    return replace(chain, links=chain.links + by)


def poses(text, tip, names, q):
    """Poses (m, 4, 4) of a body or site in the world, by MuJoCo from the whole text."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    out = np.tile(np.eye(4), (len(q), 1, 1))
    for k, row in enumerate(q):
        for name, value in zip(names, row, strict=True):
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        is_site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip) >= 0
        at = data.site(tip) if is_site else data.body(tip)
        out[k, :3, :3], out[k, :3, 3] = at.xmat.reshape(3, 3), at.xpos
    return out


def without_places(data):
    """A text without what says where elements are, to the last blank, but for these of others."""
    found = re.sub(r"\s+(?:" + "|".join(PLACED) + r")\s*=\s*(\"[^\"]*\"|'[^']*')", "", data)
    return re.sub(r"\s+(?=/?>)", "", found)


def changed(old, new):
    """Tags and names of the elements whose attributes differ, and which attributes."""
    pairs = zip(etree.fromstring(old).iter(), etree.fromstring(new).iter(), strict=True)
    out = {}
    for one, other in pairs:
        assert (one.tag, one.text, one.tail) == (other.tag, other.text, other.tail)
        keys = {k for k in {*one.attrib, *other.attrib} if one.get(k) != other.get(k)}
        if keys:
            out[one.get("name")] = keys
    return out


@pytest.mark.parametrize("name", FILES)
def test_mujoco_finds_the_identified_poses_and_only_places_are_changed(name, tmp_path):
    text, tip = FILES[name]
    path = written(text, tmp_path)
    robot = load_robot(path, tip=tip)
    nominal, chain = robot.model.chain, off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    q, new = joint_vectors(20, robot=robot), found.data.decode()
    assert np.abs(poses(new, tip, robot.joint_names, q) - forward(chain, q)).max() < SAME
    assert np.abs(poses(text, tip, robot.joint_names, q) - forward(nominal, q)).max() < SAME
    assert max(found.left) < SAME
    assert found.agreement < (1e-10, 1e-10)
    moves = changed(text.encode(), found.data)
    assert all(keys <= {*PLACED} for keys in moves.values())
    assert without_places(new) == without_places(text)
    here = {"tool", "one", "two", "three", "four", "five", "six"}
    there = {None, "sled", "fore", "hand", tip}  # the one that pan moves has no name
    assert set(moves) <= (here if name == "plain" else there)
    assert len(moves) == len(found.changed)
    # nothing slides or turns far to gain little: a few times what numbers of links are off
    assert (np.array(found.moved) < 6 * SIZES[[1, 0]]).all()
    again = load_robot(written(new, tmp_path, "again.xml"), tip=tip)
    assert np.abs(forward(again.model.chain, q) - forward(chain, q)).max() < SAME


def test_a_body_without_a_name_may_be_the_tip(tmp_path):
    text = ODD.replace("name='flange' ", "").replace("<site name='tcp'", "<site")
    robot = load_robot(written(text, tmp_path), tip="#9")
    chain = off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, robot.model.chain, chain, robot.limits)
    assert found.changed == ("#2", "sled", "fore", "hand", "#9")
    q = joint_vectors(20, robot=robot)
    model = load_robot(written(found.data.decode(), tmp_path), tip="#9").model
    assert np.abs(model.poses(q) - forward(chain, q)).max() < SAME


@pytest.mark.parametrize("joint", [0, 2, 4])
def test_a_wrong_zero_turns_the_body_of_its_joint_alone(joint, tmp_path):
    robot = load_robot(written(PLAIN, tmp_path))
    links = robot.model.chain.links.copy()
    links[joint, 0] += np.radians(1.0)
    chain = replace(robot.model.chain, links=links)
    found = corrected_mjcf(robot.own_text, robot.model.chain, chain, robot.limits)
    name = ("one", "two", "three", "four", "five", "six")[joint]
    assert changed(PLAIN.encode(), found.data) == {name: {"quat"}}
    assert found.what == "the places of 1 body"
    assert found.moved == pytest.approx((0, np.radians(1.0)), abs=1e-9)


def test_another_tool_moves_the_site_and_another_base_the_first_moving_body(tmp_path):
    robot = load_robot(written(PLAIN, tmp_path))
    nominal = robot.model.chain
    chain = replace(
        nominal,
        T_world_base=step_transform(np.array([0.01, 0, 0.02, 0.1, 0, 0])) @ nominal.T_world_base,
        T_flange_tool=nominal.T_flange_tool @ step_transform(np.array([0.1, 0, 0.2, 0, 0, 1.5])),
    )
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    assert changed(PLAIN.encode(), found.data) == {"one": {"pos", "quat"}, "tool": {"pos", "quat"}}
    assert found.what == "the places of 1 body and 1 site"


def test_a_tip_that_moves_with_its_own_joint_is_as_near_as_its_axis_lets_it(tmp_path):
    robot = load_robot(written(PLAIN, tmp_path), tip="six")
    nominal = robot.model.chain
    tool = nominal.T_flange_tool @ step_transform(np.array([3e-4, 4e-4, 0, 0, 2e-3, 0]))
    chain = replace(nominal, links=off(nominal, last=False).links, T_flange_tool=tool)
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    assert found.last == "j6"
    assert found.left == pytest.approx((5e-4, 2e-3), rel=1e-6)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "shift_jis"])
def test_a_file_keeps_its_encoding_and_its_line_ends(encoding, tmp_path):
    named = encoding.removesuffix("-sig")
    head = f'<?xml version="1.0" encoding="{named}"?>'
    text = PLAIN.replace('<?xml version="1.0"?>', head).replace("six", "\u6a5f\u68b0")
    robot = load_robot(written(text.replace("\n", "\r\n"), tmp_path, encoding=encoding))
    nominal, chain = robot.model.chain, off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    expected = load_robot(written(PLAIN, tmp_path))
    plain = corrected_mjcf(expected.own_text, nominal, chain, robot.limits).data.decode()
    plain = plain.replace('<?xml version="1.0"?>', head).replace("six", "\u6a5f\u68b0")
    assert found.data == plain.replace("\n", "\r\n").encode(encoding)


def included(folder, arm):
    """A scene that includes an arm, and classes that another file states."""
    classes = ODD[ODD.index("<default>") : ODD.index("</default>\n  <asset") + len("</default>")]
    written(f"<mujocoinclude>{classes}</mujocoinclude>", folder, "classes.xml")
    arm = arm.replace(classes, "<include file='classes.xml'/>")
    written(arm, folder, "arm.xml")
    written("<mujoco><include file='arm.xml'/></mujoco>", folder, "scene.xml")
    return arm


def test_classes_of_an_included_file_count_and_an_included_arm_is_named(tmp_path):
    text = included(tmp_path, ODD)
    robot = load_robot(tmp_path / "arm.xml", tip="tcp")
    nominal, chain = robot.model.chain, off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    path = written(found.data.decode(), tmp_path, "new.xml")
    q = joint_vectors(20, robot=robot)
    model = load_robot(path, tip="tcp").model
    assert np.abs(model.poses(q) - forward(chain, q)).max() < SAME
    assert changed(text.encode(), found.data)
    scene = load_robot(tmp_path / "scene.xml", tip="tcp")
    with pytest.raises(NotCorrectableError, match=r"stands in arm\.xml: pass that file"):
        corrected_mjcf(scene.own_text, nominal, chain, robot.limits)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('<body name="three"', '<frame pos="0 0 .1"><body name="three"', "stands in a <frame>"),
        ("<joint name='along' class='sled'/>", "<joint name='along' class='sled'/>"
         "<joint name='more' type='slide' axis='0 0 1' range='0 .1'/>", "has 2 joints"),
        ("<site material='gray'/>", "<site euler='1 0 0'/>", "a class turns its sites"),
        ("<default class='turned'>", "<default class='turned'><site zaxis='0 1 1'/>",
         "a class turns its sites, of which tcp is one"),
        ('"tool" pos="0 0 0.1"', '"tool" size=".01" type="capsule" fromto="0 0 0 0 0 .2"',
         "site tool is placed by fromto"),
        ("<site material='gray'/>", "<site type='capsule' size='.1' fromto='0 0 0 0 0 .2'/>",
         "site tcp is placed by fromto"),
    ],
)  # fmt: skip
def test_numbers_that_do_not_stand_in_bodies_alone_are_named(old, new, told, tmp_path):
    text = (PLAIN if old in PLAIN else ODD).replace(old, new, 1)
    if "<frame" in new:
        end = text.index("</worldbody>")
        for _ in range(4):  # behind the bodies four to six, and this one
            end = (
                text.index("</body>", text.index("tool")) if _ == 0 else text.index("</body>", end)
            )
            end += len("</body>")
        text = f"{text[:end]}</frame>{text[end:]}"
    robot = load_robot(written(text, tmp_path), tip="tool" if "tool" in text else "tcp")
    chain = off(robot.model.chain)
    with pytest.raises(NotCorrectableError, match=told):
        corrected_mjcf(robot.own_text, robot.model.chain, chain, robot.limits)


@pytest.mark.parametrize("name", ["sled", "other"])
def test_a_class_that_turns_the_sites_of_other_bodies_matters_to_none_of_this_one(name, tmp_path):
    text = ODD.replace("<default class='turned'>", f"<default class='{name}'><site zaxis='0 1 1'/>"
                       "</default><default class='turned'>")  # fmt: skip
    text = (
        text if name == "other" else text.replace("'sled' zaxis", "'sled' childclass='sled' zaxis")
    )
    text = text.replace("<default class='sled'><joint", "<default class='slide'><joint")
    text = text.replace("class='sled'/>", "class='slide'/>")
    robot = load_robot(written(text, tmp_path), tip="tcp")
    chain = off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, robot.model.chain, chain, robot.limits)
    q = joint_vectors(20, robot=robot)
    got = poses(found.data.decode(), "tcp", robot.joint_names, q)
    assert np.abs(got - forward(chain, q)).max() < SAME


def test_what_stands_in_an_include_is_none_of_the_file(tmp_path):
    """Elements within an <include> are read by nobody, and were counted."""
    written("<mujocoinclude><option timestep='.1'/></mujocoinclude>", tmp_path, "option.xml")
    inside = "<include file='option.xml'><body pos='1 2 3'/></include>"
    text = PLAIN.replace("<worldbody>", f"{inside}<worldbody>")
    robot = load_robot(written(text, tmp_path))
    nominal, chain = robot.model.chain, off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, nominal, chain, robot.limits)
    plain = load_robot(written(PLAIN, tmp_path))
    same = corrected_mjcf(plain.own_text, nominal, chain, plain.limits).data.decode()
    assert found.data.decode() == same.replace("<worldbody>", f"{inside}<worldbody>")


def test_an_included_file_that_is_gone_does_not_end_a_calibration(tmp_path):
    included(tmp_path, ODD)
    robot = load_robot(tmp_path / "arm.xml", tip="tcp")
    (tmp_path / "classes.xml").unlink()
    chain = robot.model.chain
    with pytest.raises(NotCorrectableError, match=r"read again: include classes\.xml is missing"):
        corrected_mjcf(robot.own_text, chain, off(chain), robot.limits)


def test_how_a_file_is_compiled_plays_no_part(tmp_path):
    """Folders, weights that follow from shapes, merged bodies, and a name that is none."""
    more = "meshdir='no' inertiafromgeom='true' balanceinertia='true' fusestatic='true'"
    text = ODD.replace("eulerseq='ZYX'/>", f"eulerseq='ZYX' {more}><lengthrange/></compiler>")
    text = text.replace("<body childclass", "<body name='' childclass")
    robot = load_robot(written(text, tmp_path), tip="tcp")
    chain = off(robot.model.chain)
    found = corrected_mjcf(robot.own_text, robot.model.chain, chain, robot.limits)
    assert found.changed == ("#2", "sled", "fore", "hand", "tcp")
    q = joint_vectors(20, robot=robot)
    got = poses(found.data.decode(), "tcp", robot.joint_names, q)
    assert np.abs(got - forward(chain, q)).max() < SAME


def test_bodies_that_mujoco_does_not_read_alone_do_not_end_a_calibration(tmp_path, monkeypatch):
    robot = load_robot(written(PLAIN, tmp_path))

    def fail(*_):
        raise refuse("file", code="R16", message="no such thing")

    monkeypatch.setattr(own_mjcf, "compiled", fail)
    chain = robot.model.chain
    with pytest.raises(NotCorrectableError, match="its bodies alone are no model: no such thing"):
        corrected_mjcf(robot.own_text, chain, off(chain), robot.limits)


def test_a_text_that_cannot_be_taken_apart_is_left_alone(tmp_path):
    head = '<?xml version="1.0" encoding="UTF-7"?>'
    text = PLAIN.replace('<?xml version="1.0"?>', head).encode("utf-7").decode()
    robot = load_robot(written(text.replace('<body name="one"', '+ADw-body name="one"'), tmp_path))
    chain = robot.model.chain
    with pytest.raises(NotCorrectableError, match="save it as UTF-8"):
        corrected_mjcf(robot.own_text, chain, off(chain), robot.limits)


def test_a_file_with_other_poses_or_other_changes_is_a_defect(tmp_path, monkeypatch):
    robot = load_robot(written(PLAIN, tmp_path))
    nominal, chain = robot.model.chain, off(robot.model.chain)
    right = own_mjcf.XmlText.changed
    for wrong, told in (
        (lambda text: text.text.encode(), "differs from the robot by"),
        (lambda text: right(text).replace(b'kp="10"', b'kp="1"'), "in more than"),
    ):
        monkeypatch.setattr(own_mjcf.XmlText, "changed", wrong)
        with pytest.raises(RuntimeError, match=told):
            corrected_mjcf(robot.own_text, nominal, chain, robot.limits)


def test_the_text_is_that_of_the_file_as_it_was_read(tmp_path):
    path = written(PLAIN, tmp_path)
    robot = load_robot(path)
    assert robot.own_text == MjcfText(path, PLAIN.encode(), "tool", tmp_path.resolve())

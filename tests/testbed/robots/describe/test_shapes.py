"""Boxes, cylinders, capsules and balls of a robot's file: read, placed, written, drawn."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import transform
from calib.geometry.model import RobotModel
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot
from testbed.robots.describe.floor import floor_of
from testbed.robots.meshes.files import part_mesh
from testbed.robots.meshes.forms import form_mesh
from testbed.robots.meshes.solids import is_closed
from testbed.robots.parts import Form
from testbed.robots.placements import link_poses
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot
from tests.testbed.robots.described_cases import UR_LIKE, block
from tests.testbed.robots.robot_cases import joint_vectors
from tests.testbed.robots.test_minimal import robot_file

ORIGIN = '<origin xyz="0.01 -0.02 {}" rpy="0.3 {} -0.5"/>'
SHAPES = {
    "base_link": '<cylinder radius="0.09" length="0.12"/>',
    "pan_link": '<box size="0.12 0.14 0.16"/>',
    "lift_link": '<cylinder radius="0.06" length="0.5"/>',
    "elbow_link": '<capsule radius="0.05" length="0.4"/>',
    "wrist_1_link": '<sphere radius="0.055"/>',
    "wrist_2_link": '<mesh filename="block.stl" scale="0.08 0.09 0.1"/>',
    "wrist_3_link": '<sphere radius="0.03"/>',
    "tool0_link": '<box size="0.02 0.02 0.1"/>',
}


def arm(folder, *tags, shapes=SHAPES, text=UR_LIKE):
    """The UR-like arm with shapes of links as <collision> or <visual>, or both."""
    (folder / "block.stl").write_bytes(block())
    for k, (link, shape) in enumerate(shapes.items()):
        origin = ORIGIN.format(0.05 * k, 1.5707963267948966 if k == 3 else 0.2 * k)
        parts = "".join(f"<{tag}>{origin}<geometry>{shape}</geometry></{tag}>" for tag in tags)
        head = f'<link name="{link}"'
        assert text.count(head + ">") + text.count(head + "/>") == 1
        text = text.replace(head + "/>", head + "></link>").replace(head + ">", head + ">" + parts)
    (folder / "arm.urdf").write_text(text)
    return folder / "arm.urdf"


def places(robot, q):
    """Poses (m, parts, 4, 4) of all plain shapes of a robot, by its own chain."""
    T = link_poses(robot.model.chain, q)
    return np.stack([T[:, one.link] @ np.array(one.affine) for one in robot.primitives], axis=1)


KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: lambda s: Form("box", tuple(2 * s)),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda s: Form("cylinder", (s[0], 2 * s[1])),
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda s: Form("capsule", (s[0], 2 * s[1])),
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda s: Form("sphere", (s[0],)),
}


def by_mujoco(model, q):
    """Forms and places (m, parts, 4, 4) of the plain shapes of a model, by MuJoCo alone."""
    data, geoms = (
        mujoco.MjData(model),
        np.flatnonzero(np.isin(model.geom_type, [int(kind) for kind in KINDS])),
    )
    out = []
    for row in q:
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        out.append(transform(data.geom_xmat[geoms].reshape(-1, 3, 3), data.geom_xpos[geoms]))
    return [
        KINDS[mujoco.mjtGeom(int(model.geom_type[k]))](model.geom_size[k]) for k in geoms
    ], np.array(out)


def same(ours, at, theirs, there):
    """Whether the same shapes lie at the same places: each of ours has its own of theirs."""
    assert len(ours) == len(theirs)
    left = list(range(len(theirs)))
    for k, form in enumerate(ours):
        near = [
            i for i in left
            if theirs[i].kind == form.kind
            and np.allclose(theirs[i].size, form.size, rtol=1e-12)
            and np.allclose(there[:, i], at[:, k], rtol=0, atol=1e-9)
        ]  # fmt: skip
        assert near, f"{form} is nowhere"
        left.remove(near[0])


@pytest.mark.parametrize("tag", ["collision", "visual"])
def test_plain_shapes_of_a_urdf_lie_where_mujoco_puts_them(tag, tmp_path):
    """MuJoCo's own reader of URDF, at many postures; it has no capsule, which is asked apart."""
    path = arm(tmp_path, tag)
    robot = load_robot(path)
    assert {one.link for one in robot.parts} == set(range(7))
    # what is drawn collides where nothing else does, and what collides is drawn
    assert all(one.collides and one.drawn for one in robot.parts)
    assert robot.shapeless == robot.partly == ()
    text = (
        path.read_text()
        .replace("<capsule", "<cylinder")
        .replace(
            "</robot>",
            '<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco></robot>',
        )
    )
    model = mujoco.MjModel.from_xml_string(text, {"block.stl": block()})
    q = joint_vectors(20, robot=robot)
    theirs, there = by_mujoco(model, q)
    ours = [
        Form("cylinder", one.form.size) if one.form.kind == "capsule" else one.form
        for one in robot.primitives
    ]
    assert [one.form.kind for one in robot.primitives].count("capsule") == 1
    same(ours, places(robot, q), theirs, there)


def test_what_collides_is_tested_as_the_file_has_it_and_what_is_drawn_is_drawn(tmp_path):
    """A hull of its own beside the drawing; the same shape twice is one part."""
    path = arm(tmp_path, "visual", "collision")
    both = load_robot(path)
    assert len(both.parts) == len(SHAPES)
    text = path.read_text()
    path.write_text(text.replace('<sphere radius="0.055"/>', '<sphere radius="0.06"/>', 1))
    apart = load_robot(path)
    found = {(one.form.size, one.drawn, one.collides) for one in apart.primitives if one.link == 4}
    assert found == {((0.06,), True, False), ((0.055,), False, True)}
    assert apart.shapeless == ()


def test_only_what_is_drawn_hides_a_target(tmp_path):
    """A wide shape that only collides stands for the arm; it is not what a beam meets."""
    wide = {**SHAPES, "wrist_1_link": '<sphere radius="0.4"/>'}
    path = arm(tmp_path, "collision", shapes=wide)
    drawn = load_robot(path)
    ball = '<visual><geometry><sphere radius="0.01"/></geometry></visual>'
    head = '<link name="wrist_1_link">'
    path.write_text(path.read_text().replace(head, head + ball))
    hidden = load_robot(path)
    q = joint_vectors(60, robot=drawn)
    sees = [
        Simulator(one, one.model.chain).sees(q, np.array([3.0, 0.0, 1.0]), np.zeros(3))
        for one in (drawn, hidden)
    ]
    assert sees[1].sum() > sees[0].sum() + 10
    hits = [Simulator(one, one.model.chain).contacts(q).itself for one in (drawn, hidden)]
    np.testing.assert_array_equal(*hits)


def test_a_shape_that_is_not_read_is_named_with_its_link(tmp_path):
    whole = load_robot(arm(tmp_path, "collision"))
    cone = arm(tmp_path, "collision", shapes={**SHAPES, "elbow_link": "<cone/>"})
    bare = load_robot(cone)
    assert bare.shapeless == (3,)
    assert "no shape that collides is given for what elbow moves" in " ".join(bare.notes)
    extra = "<collision><geometry><cone/></geometry></collision>"
    text = arm(tmp_path, "collision").read_text()
    head = '<link name="elbow_link">'
    cone.write_text(text.replace(head, head + extra))
    partly = load_robot(cone)
    assert (partly.shapeless, partly.partly) == ((), (3,))
    assert "a shape that collides is not read of what elbow moves" in " ".join(partly.notes)
    # what is drawn stands for it
    drawn = '<visual><geometry><box size="0.2 0.2 0.5"/></geometry></visual>'
    cone.write_text(text.replace(head, head + extra + drawn))
    stands = load_robot(cone)
    assert (stands.shapeless, stands.partly) == ((), ())
    assert Form("box", (0.2, 0.2, 0.5)) in [p.form for p in stands.primitives if p.collides]
    assert whole.partly == ()


MJCF = """<mujoco><compiler angle="radian"/><worldbody>
<geom type="plane" size="2 2 .1"/><geom type="box" size=".2 .2 .05" pos="0 0 .05"/>
<body name="one" pos="0 0 .3"><joint name="a" axis="0 0 1" range="-3 3"/>
<geom type="capsule" fromto="0 0 -.1 .05 .02 .2" size=".04"/>
<body name="two" pos="0 .1 .3"><joint name="b" axis="0 1 0" range="-2 2"/>
<geom type="cylinder" size=".05 .1" pos="0 0 .1" euler=".1 .2 .3" group="4"/>
<geom type="sphere" size=".06" contype="0" conaffinity="0"/>
<body name="three" pos="0 0 .3"><joint name="c" axis="1 0 0" range="-2 2"/>
<geom type="box" size=".03 .04 .05"/>{more}
<site name="tip" pos="0 0 .1"/></body></body></body></worldbody></mujoco>"""


def test_plain_geoms_of_an_mjcf_lie_where_mujoco_has_them(tmp_path):
    (tmp_path / "arm.xml").write_text(MJCF.format(more=""))
    robot = load_robot(tmp_path / "arm.xml", tip="tip")
    q = joint_vectors(20, robot=robot)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    same([p.form for p in robot.primitives], places(robot, q), *by_mujoco(model, q))
    two = {one.form.kind: (one.drawn, one.collides) for one in robot.primitives if one.link == 2}
    assert two == {"cylinder": (False, True), "sphere": (True, False)}
    assert robot.base_offset == pytest.approx(0.0, abs=1e-12)
    (tmp_path / "arm.xml").write_text(MJCF.format(more='<geom type="ellipsoid" size=".1 .2 .3"/>'))
    # the box that is drawn there stands for it
    assert load_robot(tmp_path / "arm.xml", tip="tip").partly == ()
    hidden = MJCF.replace('size=".03 .04 .05"', 'type="ellipsoid" size=".1 .2 .3"').replace(
        'type="box" type="ellipsoid"', 'type="ellipsoid"'
    )
    (tmp_path / "arm.xml").write_text(hidden.format(more=""))
    assert load_robot(tmp_path / "arm.xml", tip="tip").shapeless == (3,)


def test_a_robot_of_plain_shapes_is_written_and_read_again(tmp_path):
    """robot.toml has them to the last digit; URDF and MJCF hit the same things."""
    robot = load_robot(arm(tmp_path, "collision"))
    write_robot_folder(robot, tmp_path / "out")
    back = load_robot(tmp_path / "out")
    assert [(p.name, p.link, p.collides, p.drawn) for p in back.primitives] == [
        (p.name, p.link, p.collides, p.drawn) for p in robot.primitives
    ]
    for own, other in zip(back.primitives, robot.primitives, strict=True):
        assert (own.form.kind, own.rgb) == (other.form.kind, other.rgb)
        assert own.form.size == pytest.approx(other.form.size, rel=1e-12)
        # twelve digits of a rotation that is read, all of the one that is written
        np.testing.assert_allclose(own.affine, other.affine, rtol=0, atol=2e-11)
    q = joint_vectors(300, robot=robot)
    hit = Simulator(robot, robot.model.chain).contacts(q)
    assert 10 < hit.itself.sum() < 290
    name = robot.name
    for file in ("robot.toml", f"{name}.urdf", f"{name}.xml"):
        again = load_robot(tmp_path / "out" / file)
        found = Simulator(again, again.model.chain).contacts(q)
        np.testing.assert_array_equal(found.itself, hit.itself)
        np.testing.assert_array_equal(found.floor, hit.floor)


def test_shapes_stay_where_they_are_when_links_count_from_elsewhere(tmp_path):
    """Between parallel axes an offset may move to the next link: other frames, same arm."""
    robot = load_robot(arm(tmp_path, "collision"))
    chain = robot.model.chain
    links = chain.links.copy()
    links[1:3, 1] += 0.05, -0.05
    other = RobotModel(replace(chain, links=links))
    q = joint_vectors(20, robot=robot)
    np.testing.assert_allclose(other.poses(q), robot.model.poses(q), rtol=0, atol=1e-14)
    mine = identified_robot(robot, other, name="mine")
    np.testing.assert_allclose(places(mine, q), places(robot, q), rtol=0, atol=1e-14)


def test_the_floor_is_where_the_lowest_shape_of_the_base_ends(tmp_path):
    robot = load_robot(arm(tmp_path, "collision"))
    (base,) = (one for one in robot.primitives if one.link == 0)
    drawn = part_mesh(base).vertices[:, 2].min()
    # corners of a drawn circle lie on it, its lowest point between two of them
    assert -1e-3 < robot.base_offset - drawn <= 1e-12
    floor, above = floor_of((), robot.model.chain, robot.limits)
    assert floor == pytest.approx(0.0, abs=1e-12)
    assert above is None


@pytest.mark.parametrize(
    ("form", "volume"),
    [
        (Form("box", (0.1, 0.2, 0.3)), 0.006),
        (Form("cylinder", (0.1, 0.3)), np.pi * 0.003),
        (Form("capsule", (0.1, 0.3)), np.pi * (0.003 + 4e-3 / 3)),
        (Form("sphere", (0.1,)), np.pi * 4e-3 / 3),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_a_plain_shape_is_drawn_closed_with_its_volume_and_its_normals_outward(form, volume):
    vertices, faces, normals = form_mesh(form)
    places, index = np.unique(vertices.round(12), axis=0, return_inverse=True)
    assert is_closed(index.reshape(-1)[faces])
    a, b, c = vertices[faces].transpose(1, 0, 2)
    found = np.einsum("fx,fx->", a, np.cross(b, c)) / 6
    # 48 corners on a circle, 16 rings of a ball: drawn from inside, a little too small
    assert 0.97 * volume < found <= volume * (1 + 1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
    across = np.cross(b - a, c - a)
    assert (np.einsum("fx,fkx->fk", across, normals[faces]) > 0).all()
    rng = np.random.default_rng(1)
    for d in rng.normal(size=(50, 3)):
        d /= np.linalg.norm(d)
        assert form.support(d) == pytest.approx((places @ d).max(), rel=0.01)
        assert form.support(d) >= (places @ d).max() - 1e-12


SHAPE = """[[shapes]]
name = "rod"
link = 1
kind = "capsule"
radius_mm = 50
length_mm = 300
position_mm = [0, 0, 150]
"""


def test_a_robot_toml_states_plain_shapes(tmp_path):
    file = robot_file(tmp_path, (200, 300, 0), (0, 400, 90))
    text = file.read_text()
    file.write_text(text + SHAPE)
    (rod,) = load_robot(file).primitives
    assert rod.form == Form("capsule", (0.05, 0.3))
    np.testing.assert_allclose(np.array(rod.affine)[:3, 3], [0, 0, 0.15])
    assert load_robot(file).shapeless == (2,)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("radius_mm = 50", "radius_mm = 0", "radius_mm"),
        ("radius_mm = 50", "", "radius_mm"),
        ("radius_mm = 50", "radius_mm = nan", "radius_mm"),
        ("length_mm = 300", "length_mm = 1e9", "length_mm"),
        ("capsule", "cone", "kind"),
        ("link = 1", "link = 3", "part rod is on link 3; the last is 2"),
        ("link = 1", 'link = 1\ncolor = "blue"', 'part rod: no color "blue"'),
        ("link = 1", "link = 1\ncollides = false\ndrawn = false", "neither drawn nor collides"),
        ("[[shapes]]", SHAPE + "[[shapes]]", "part rod appears twice"),
        ("length_mm = 300", "size_mm = [1, 2, 3]", "size_mm"),
    ],
)
def test_a_plain_shape_that_cannot_be_is_refused(old, new, says, tmp_path):
    file = robot_file(tmp_path, (200, 300, 0), (0, 400, 90))
    file.write_text(file.read_text() + SHAPE.replace(old, new))
    with pytest.raises(InputError, match=says):
        load_robot(file)


def test_more_shapes_than_any_arm_has_are_refused(tmp_path):
    ball = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    file, bare = tmp_path / "arm.urdf", '<link name="base_link"/>'
    link = '<link name="base_link">{}</link>'
    file.write_text(UR_LIKE.replace(bare, link.format(ball * 2001)))
    # the same ball is there once
    assert len(load_robot(file).primitives) == 1
    many = "".join(ball.replace("0.01", f"0.{k:04}1") for k in range(2001))
    file.write_text(UR_LIKE.replace(bare, link.format(many)))
    with pytest.raises(InputError, match="has 2001 shapes"):
        load_robot(file)

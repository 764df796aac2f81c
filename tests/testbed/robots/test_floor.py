"""Where an arm's base does not stand upright: no floor across its way, a tracker on its level."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import inverse, transform
from testbed.laboratory.simulator import Simulator
from testbed.recording.story import floor_height
from testbed.robots.catalog import load_robot
from testbed.robots.meshes.files import part_mesh
from testbed.robots.placements import link_poses
from testbed.robots.robot import STAND, Robot, workspace_of_reach
from testbed.robots.room import BESIDE, from_arm, reach
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.toml import robot_toml
from testbed.scenario.hashes import robot_hash
from tests.testbed.robots.described_cases import ARMS, block, urdf
from tests.testbed.robots.robot_cases import TX60
from tests.testbed.robots.test_minimal import robot_file

PART = (
    '<visual><geometry><mesh filename="block.stl"/></geometry></visual>'
    '<collision><geometry><mesh filename="block.stl"/></geometry></collision>'
)
ON_A_RAIL = urdf(
    "railed",
    [
        ("rail", "prismatic", "0 0 0.2", "0 0 0", "0 1 0", (-1, 1)),
        ("pan", "revolute", "0 0 0.3", "0 0 0", "0 0 1", (-2.9, 2.9)),
        ("lift", "revolute", "0 0 0.2", "0 0 0", "0 1 0", (-1.5, 1.5)),
        ("elbow", "revolute", "0 0 0.4", "0 0 0", "0 1 0", (-2, 2)),
        ("tip", "fixed", "0 0 0.4", "0 0 0", "1 0 0", None),
    ],
    parts=dict.fromkeys(("rail", "pan", "lift", "elbow"), PART),
).replace('<link name="base_link"/>', f'<link name="base_link">{PART}</link>')


@pytest.fixture
def railed(tmp_path) -> Robot:
    """An arm on a rail along y of the room, with bodies of 80 mm, its base's drawing too."""
    (tmp_path / "block.stl").write_bytes(block((0.08, 0.08, 0.08), (-0.04, -0.04, 0.0)))
    (tmp_path / "arm.urdf").write_text(ON_A_RAIL)
    return load_robot(tmp_path / "arm.urdf")


def test_no_floor_stands_across_a_rail(railed):
    """The base's z lies along the rail: a plane across it where the base ends cuts it in two."""
    assert railed.shapeless == ()
    q = np.zeros((5, 4))
    q[:, 0] = np.linspace(*railed.limits[0], 5)
    assert not Simulator(railed, railed.model.chain).contacts(q).floor.any()


def on_a_wall():
    """An upright arm's chain, turned so that its base's z is the room's x, 1.5 m above it."""
    robot = load_robot("staubli_tx60")
    wall = transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.0, 0.0, 1.5]))
    chain = replace(robot.model.chain, T_world_base=wall)
    return replace(robot, model=replace(robot.model, chain=chain), workspace=None)


def in_the_room(robot, place_mm):
    """A place of the base frame in the room [m]."""
    return (robot.model.chain.T_world_base @ [*np.array(place_mm) / 1e3, 1.0])[:3]


def test_a_tracker_is_proposed_on_the_level_of_an_arm_on_a_rail_or_a_wall(railed):
    for robot in (railed, on_a_wall()):
        place = workspace_of_reach(robot)
        station, center = (in_the_room(robot, at) for at in (place.station_mm, place.box_center_mm))
        assert station[2] == pytest.approx(center[2], abs=0.02)  # both rounded to 10 mm
        chain = robot.model.chain
        beam = (inverse(chain.T_world_base) @ [*station, 1.0])[:3]
        assert from_arm(chain, robot.limits, beam) >= reach(chain, robot.limits) + BESIDE
    # before the wall, not behind it
    assert station[0] > 1.0


def test_a_tracker_of_an_arm_that_hangs_stands_on_the_level_of_its_box_too():
    robot = on_a_wall()
    down = transform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))
    chain = replace(robot.model.chain, T_world_base=down)
    hung = replace(robot, model=replace(robot.model, chain=chain))
    place = workspace_of_reach(hung)
    station, center = (in_the_room(hung, at) for at in (place.station_mm, place.box_center_mm))
    assert station[2] == pytest.approx(center[2], abs=0.02)
    assert np.linalg.norm((station - center)[:2]) > 1.9  # 2 m, and roundings


def test_a_gantry_has_no_floor_where_its_beam_begins(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARMS["gantry"])
    robot = load_robot(tmp_path / "arm.urdf")
    at_zero = robot.model.poses(np.zeros((1, 6)))[0, :3, 3]
    assert Simulator(robot, robot.model.chain).above_floor(at_zero) > 1.0


HUNG = """mounting_height_mm = 1500.0

[base]
position_mm = [0.0, 0.0, 2100.0]
rotation_vector_deg = {}
"""
ON_WALL, DOWN = [0.0, 90.0, 0.0], [180.0, 0.0, 0.0]


def mounted(folder, turn=ON_WALL, head=HUNG):
    """The TX60 as a robot.toml whose base hangs 1.5 m above a floor at 0.6 m in the world."""
    text = (TX60.folder / "robot.toml").read_text()
    for name in {part.file.name for part in TX60.visuals}:
        (folder / "meshes").mkdir(exist_ok=True)
        (folder / "meshes" / name).write_bytes((TX60.folder / "meshes" / name).read_bytes())
    start, _, rest = text.partition("[sources]")
    start = start.replace('drawing = "staubli_tx60"\n', "")
    head, table, base = head.format(turn).partition("[base]")
    rest = rest.replace("[workspace]", "[forgotten]")
    rest = rest[: rest.index("[forgotten]")] + rest[rest.index("# center_mm") :]
    (folder / "robot.toml").write_text(f"{start}{head}[sources]{rest}\n{table}{base}")
    return load_robot(folder / "robot.toml")


def lowest_points(robot, q):
    """Height (m,) in the world of the lowest corner of all that collides and moves [m]."""
    T = link_poses(robot.model.chain, q)
    heights = [
        (T[:, part.link, 2, :3] @ part_mesh(part).vertices.T).min(axis=1) + T[:, part.link, 2, 3]
        for part in robot.parts
        if part.collides and part.link
    ]
    return np.min(heights, axis=0)


@pytest.mark.parametrize("turn", [ON_WALL, DOWN], ids=["wall", "ceiling"])
def test_a_base_that_hangs_has_the_level_floor_of_the_room_below_it(turn, tmp_path):
    """And the surface that it hangs on: against the corners of all moving parts, by hand."""
    robot = replace(mounted(tmp_path, turn), mounting_height=0.4)
    chain, floor = robot.model.chain, 2.1 - 0.4
    assert chain.T_world_base[2, 2] < 0.1
    assert mounted(tmp_path, turn).mounting_height == 1.5
    q = np.random.default_rng(3).uniform(*robot.limits.T, (300, 6))
    without = replace(robot, mounting_height=None)
    bare, both = (Simulator(one, chain) for one in (without, robot))
    low = lowest_points(robot, q)
    sure = np.abs(low - floor) > 1e-6  # MuJoCo keeps vertices in single precision
    assert 30 < (low < floor).sum() < 270
    before, found = bare.contacts(q), both.contacts(q)
    np.testing.assert_array_equal(found.floor[sure], (before.floor | (low < floor))[sure])
    np.testing.assert_array_equal(found.itself, before.itself)
    near = Simulator(robot, chain, clearance=0.05).contacts(q).floor
    wide = Simulator(without, chain, clearance=0.05).contacts(q).floor
    sure = np.abs(low - floor - 0.05) > 1e-6
    np.testing.assert_array_equal(near[sure], (wide | (low < floor + 0.05))[sure])
    apart = np.minimum(bare.clearances(q, most=3.0), low - floor)
    free = apart > 0
    np.testing.assert_allclose(both.clearances(q, most=3.0)[free], apart[free], atol=1e-6)
    # what lies below it is seen by no tracker
    point = np.array([0.5, 0.0, floor - 0.01])
    assert both.above_floor(point) == pytest.approx(-0.01, abs=1e-12)
    assert not both.sees(q[:20], point, np.zeros(3)).any()


def test_a_tracker_below_a_base_that_hangs_stands_on_the_floor_that_is_stated(tmp_path):
    robot = mounted(tmp_path)
    place = workspace_of_reach(robot)
    station = in_the_room(robot, place.station_mm)
    assert station[2] == pytest.approx(0.6 + STAND, abs=0.02)  # rounded to 10 mm
    chain = robot.model.chain
    beam = (inverse(chain.T_world_base) @ [*station, 1.0])[:3]
    assert from_arm(chain, robot.limits, beam) >= reach(chain, robot.limits) + BESIDE
    assert floor_height(chain, robot) == pytest.approx(0.6)
    # what would lie below the floor is no place to work at
    low = workspace_of_reach(replace(robot, mounting_height=0.3))
    center, half = np.array(low.box_center_mm) / 1e3, np.array(low.box_size_mm) / 2e3
    up = robot.model.chain.T_world_base[2, :3]
    assert center @ up - half @ np.abs(up) > -0.3


def test_how_a_base_is_mounted_is_written_and_read_again(tmp_path):
    robot = mounted(tmp_path)
    (tmp_path / "out").mkdir()
    write_robot_folder(robot, tmp_path / "out")
    back = load_robot(tmp_path / "out")
    assert back.mounting_height == robot.mounting_height == 1.5
    assert robot_hash(back) == robot_hash(robot)
    assert robot_hash(replace(robot, mounting_height=1.6)) != robot_hash(robot)
    assert "mounting_height" not in robot_toml(TX60)


@pytest.mark.parametrize("height", ["0.0", "-1500.0", "nan", "1e9", '"high"', "true"])
def test_a_height_that_no_base_has_is_refused(height, tmp_path):
    with pytest.raises(InputError, match="mounting_height_mm") as caught:
        mounted(tmp_path, head=HUNG.replace("1500.0", height))
    assert "\n" not in str(caught.value)


def test_a_rail_of_a_robot_toml_has_no_floor_across_it_unless_one_is_stated(tmp_path):
    slide = '[[joints]]\nkind = "prismatic"\ntheta_deg = 0\nd_mm = 0\na_mm = 0\nalpha_deg = -90\n'
    slide += "lower_mm = -2000\nupper_mm = 2000\n"
    base = "[base]\nrotation_vector_deg = [-90.0, 0.0, 0.0]\n"
    file = robot_file(tmp_path, (200, 300, 0), (0, 400, 90))
    head, links = file.read_text().split("[[joints]]", 1)
    text = f"{head}{{}}{base}{slide}[[joints]]{links}"
    file.write_text(text.format(""))
    assert load_robot(file).base_offset < -2.7
    file.write_text(text.format("floor_mm = -100.0\n"))
    assert load_robot(file).base_offset == -0.1
    assert load_robot(robot_file(tmp_path, (200, 300, 0))).base_offset == 0.0


def kuka(axis="0 0 -1", base=""):
    """An arm that stands on the floor, the sense of its first joint given."""
    joints = [
        ("a1", "revolute", "0 0 0.6", "0 0 0", axis, (-3, 3)),
        ("a2", "revolute", "0.2 0 0", "0 0 0", "0 1 0", (-2.7, 0.6)),
        ("a3", "revolute", "0.6 0 0", "0 0 0", "0 1 0", (-2.2, 2.6)),
        ("a4", "revolute", "0 0 0", "0 0 0", "-1 0 0", (-3, 3)),
        ("a5", "revolute", "0.6 0 0", "0 0 0", "0 1 0", (-2.2, 2.2)),
        ("tip", "fixed", "0.15 0 0", "0 0 0", "1 0 0", None),
    ]
    return urdf("k", joints).replace(
        '<link name="base_link"/>', f'<link name="base_link">{base}</link>'
    )


@pytest.mark.parametrize("axis", ["0 0 -1", "0 1 0"])
@pytest.mark.parametrize("base", ["", PART], ids=["bare", "drawn"])
def test_an_arm_whose_first_axis_does_not_point_up_stands_on_the_floor_all_the_same(
    base, axis, tmp_path
):
    """As those of KUKA: against heights in the world, and the arm that turns the other way."""
    (tmp_path / "block.stl").write_bytes(block((0.2, 0.2, 0.6), (-0.1, -0.1, 0.0)))
    (tmp_path / "arm.urdf").write_text(kuka(axis, base))
    (tmp_path / "up.urdf").write_text(kuka("0 0 1", base))
    robot, other = load_robot(tmp_path / "arm.urdf"), load_robot(tmp_path / "up.urdf")
    assert robot.model.chain.T_world_base[2, 2] < 0.1
    assert robot.mounting_height == pytest.approx(0.6)
    simulator = Simulator(robot, robot.model.chain)
    for height in (-0.3, 0.2, 1.5):
        assert simulator.above_floor([0.9, -0.4, height]) == pytest.approx(height)
    place, known = workspace_of_reach(robot), workspace_of_reach(other)
    station = in_the_room(robot, place.station_mm)
    assert station[2] == pytest.approx(STAND, abs=0.011)  # rounded to 10 mm
    assert simulator.above_floor(station) > 0
    low, size = np.array(place.box_center_mm), np.array(place.box_size_mm)
    center = in_the_room(robot, low)
    if axis == "0 0 -1":
        assert center[2] == pytest.approx(in_the_room(other, known.box_center_mm)[2], abs=0.05)
        assert size[2] == pytest.approx(known.box_size_mm[2], rel=0.1)
    up = robot.model.chain.T_world_base[2, :3]
    assert center[2] - np.abs(up) @ size / 2e3 > 0

"""The robot that a calibration hands out, read by others: base, tool, reflectors and mesh paths."""

import csv
import re
import tomllib
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
import yourdfpy

from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from testbed.files.read import read_session
from testbed.identify.calibrate import Options
from testbed.identify.folder import load_calibration, play_calibration, rederive_calibration
from testbed.identify.handback.deliver import delivered_robot
from testbed.identify.handback.states import handed_robot
from testbed.identify.recording.story import calibration_story
from testbed.robots.catalog import load_robot
from testbed.robots.describe.axes import reach
from testbed.robots.robot import Reflector, reflector_frames
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot
from testbed.robots.write.mjcf import mjcf_text
from tests import viewed
from tests.calibrated import robot, session_of, sound, sound_session, true_model
from tests.command import call
from tests.recorded import column, store, structure
from tests.reference import SIGMA_POSITION, pool_r
from tests.testbed.identify.test_kinds import PLACES, points

NAMES = ("A", "base", "SMR 1.5 in")
FRAMES = ("A", "reflector_base", "SMR 1.5 in")
"""What they are called in URDF and MJCF: one of the names is that of a link."""
GIVEN = Reflector("given", (0.01, 0.02, 0.03))
PROVEN = 1e-9
"""What is promised of every file [m, 1]."""


@cache
def reflectors_session():
    """Three reflectors of unknown place seen at sixty poses, and one whose place is stated."""
    table = points(true_model(), pool_r(60), np.random.default_rng(1))
    return session_of(
        table,
        fixtures=Fixtures(reflectors=np.zeros((3, 3))),
        reflector_names=NAMES,
        stated_reflectors=(GIVEN,),
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a calibration by poses, and that of one by reflectors."""
    root = tmp_path_factory.mktemp("delivered")
    play_calibration(robot(), sound_session(), root / "poses", Options(seed=1))
    play_calibration(robot(), reflectors_session(), root / "points", package="cell_2_robot")
    return root


def by_yourdfpy(file, frames, q):
    """Poses (k, m, 4, 4) of links as yourdfpy finds them."""
    read = yourdfpy.URDF.load(str(file), load_meshes=False)
    out = np.empty((len(frames), len(q), 4, 4))
    for m, row in enumerate(q):
        read.update_cfg(row)
        for k, frame in enumerate(frames):
            out[k, m] = read.get_transform(frame)
    return out


def by_mujoco(file, frames, q):
    """Poses (k, m, 4, 4) of bodies of a URDF or sites of an MJCF as MuJoCo finds them."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    out = np.tile(np.eye(4), (len(frames), len(q), 1, 1))
    for m, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        for k, frame in enumerate(frames):
            there = data.site(frame) if file.suffix == ".xml" else data.body(frame)
            out[k, m, :3, :3], out[k, m, :3, 3] = there.xmat.reshape(3, 3), there.xpos
    return out


def by_all(folder, frames, q):
    """The same by every reader; of the MJCF the tool frame is called tool."""
    urdf, xml = folder / "staubli_tx60_identified.urdf", folder / "staubli_tx60_identified.xml"
    sites = ["tool" if frame == "tool0" else frame for frame in frames]
    return by_yourdfpy(urdf, frames, q), by_mujoco(urdf, frames, q), by_mujoco(xml, sites, q)


def test_base_and_tool_found_from_nothing_are_handed_out_in_all_three_files(made):
    model, q = handed_robot(sound()).model, pool_r(30, seed=9)
    toml = load_robot(made / "poses" / "robot").model
    for name in ("T_world_base", "T_flange_tool"):
        found = getattr(model.chain, name)
        # rotation vectors in degrees: back to some 1e-16
        np.testing.assert_allclose(getattr(toml.chain, name), found, atol=1e-14)
    expected = model.poses(q)
    for poses in by_all(made / "poses" / "robot", ["tool0"], q):
        assert np.abs(poses[0] - expected).max() < PROVEN
    # and the truth is there: base, tool and links of a robot that nobody told where it stands
    true = true_model().poses(q)
    away = np.linalg.norm(expected[:, :3, 3] - true[:, :3, 3], axis=1)
    assert away.max() < 3 * SIGMA_POSITION
    own = robot().model.poses(q)
    assert np.linalg.norm(own[:, :3, 3] - true[:, :3, 3], axis=1).min() > 1


def test_who_wants_the_robot_alone_finds_base_and_flange_in_the_urdf(made):
    model, q = handed_robot(sound()).model, pool_r(5, seed=9)
    file = made / "poses" / "robot" / "staubli_tx60_identified.urdf"
    base, flange = by_yourdfpy(file, ["base", "flange"], q)
    bare = replace(model.chain, T_world_base=np.eye(4), T_flange_tool=np.eye(4))
    assert np.abs(inverse(base[0]) @ flange - forward(bare, q)).max() < PROVEN


def test_reflectors_keep_their_names_and_stand_where_they_were_found(made):
    calibration, _ = load_calibration(made / "points")
    model, q = calibration.fit.identification.model, pool_r(30, seed=9)
    arm = load_robot(made / "points" / "robot")
    places = np.array([GIVEN.place, *model.fixtures.reflectors])
    assert tuple(one.name for one in arm.reflectors) == (GIVEN.name, *NAMES)
    # millimeters in the file
    np.testing.assert_allclose([one.place for one in arm.reflectors], places, atol=1e-15)
    T = model.poses(q)
    expected = np.array([[A[:3, :3] @ place + A[:3, 3] for A in T] for place in places])
    for poses in by_all(made / "points" / "robot", [GIVEN.name, *FRAMES], q):
        assert np.abs(poses[:, :, :3, 3] - expected).max() < PROVEN
    # where the tracker would see them on the true robot; the stated one is on none
    T = true_model().poses(q)
    true = np.array([[A[:3, :3] @ place + A[:3, 3] for A in T] for place in PLACES])
    assert np.linalg.norm(expected[1:] - true, axis=-1).max() < 5 * SIGMA_POSITION
    text = (made / "points" / "report.html").read_text()
    assert "reflector2.x (base)" in text
    assert f"on its tool are the reflectors given, {', '.join(NAMES)}" in text


def test_points_give_the_tool_no_uncertainty_of_how_it_is_turned(made):
    with (made / "points" / "dh_table.csv").open() as file:
        told = {row["number"]: (row["U_k2"], row["held_by"]) for row in csv.DictReader(file)}
    assert {told[f"tool.{turn}"] for turn in ("rx", "ry", "rz")} == {("", "nominal")}
    assert told["base.rx"][1] == "measurements"
    assert told["beta1"] == told["theta1"] == ("", "nominal")  # the base takes them up


def test_the_robot_can_be_read_again_from_each_of_its_files(made):
    folder, q = made / "points" / "robot", pool_r(20, seed=4)
    toml = load_robot(folder)
    for ending in ("urdf", "xml"):
        again = load_robot(folder / f"staubli_tx60_identified.{ending}")
        assert np.abs(again.model.poses(q) - toml.model.poses(q)).max() < PROVEN
        assert len(again.visuals) == len(toml.visuals) == len(robot().visuals)
    write_robot_folder(toml, made / "twice")
    assert load_robot(made / "twice").reflectors == toml.reflectors


def test_names_that_are_taken_give_way():
    names = ("tool0", "link3", "reflector_base", "base", "link_12")
    arm = replace(robot(), reflectors=tuple(Reflector(name, (0, 0, 0)) for name in names))
    assert reflector_frames(arm) == (
        "reflector_tool0",
        "reflector_link3",
        "reflector_base",
        "reflector_reflector_base",
        "link_12",
    )


def test_a_name_that_means_a_value_to_mujoco_is_written_so_that_it_is_read_again(tmp_path):
    reflectors = tuple(Reflector(name, (0, 0, 0)) for name in ("50%", "50_", "SMR %n"))
    arm = replace(robot(), reflectors=reflectors, visuals=())
    (tmp_path / "arm.xml").write_text(mjcf_text(arm))
    assert load_robot(tmp_path / "arm.xml").model.chain.n_joints == 6
    assert len({*reflector_frames(arm)}) == 3


def test_a_name_with_signs_that_no_file_can_hold_is_written_without_them():
    calibration = replace(
        sound(), stated_reflectors=tuple(replace(GIVEN, name=name) for name in ("a\x07b", "ab", ""))
    )
    arm = delivered_robot(calibration, robot(), sound().fit)
    assert [one.name for one in arm.reflectors] == ["ab", "ab_", "reflector"]


def mesh_names(file):
    return set(re.findall(r'<mesh filename="([^"]+)"', file.read_text()))


def test_a_package_stands_in_the_mesh_paths_of_the_urdf_and_nowhere_else(made):
    plain, ros = (made / name / "robot" for name in ("poses", "points"))
    file = "staubli_tx60_identified.urdf"
    relative = {f"meshes/{visual.name}.obj" for visual in robot().visuals}
    assert mesh_names(plain / file) == relative
    assert mesh_names(ros / file) == {f"package://cell_2_robot/{name}" for name in relative}
    for name in ("staubli_tx60_identified.xml", "robot.toml"):
        assert "cell_2_robot" not in (ros / name).read_text()
    # a reader that knows where the package is finds every mesh, and so does MuJoCo in the folder
    found = yourdfpy.URDF.load(
        str(ros / file),
        filename_handler=lambda fname: str(ros / fname.removeprefix("package://cell_2_robot/")),
    )
    assert len(found.scene.geometry) == len(relative)
    with_meshes, bare = (mujoco.MjModel.from_xml_path(str(f / file)) for f in (ros, plain))
    assert with_meshes.nmesh == bare.nmesh == len(relative)
    said = load_calibration(made / "points")[1].robot
    assert "its URDF finds the meshes where robot/ is the root of cell_2_robot" in said


@pytest.mark.parametrize(
    "name", ["My_robot", "my-robot", "2robots", "r", "a__b", "robot_", "_robot", "a b", "ä_b", ""]
)
def test_a_name_that_no_package_may_have_is_refused_before_anything_is_computed(name, tmp_path):
    with pytest.raises(InputError) as caught:
        play_calibration(robot(), sound_session(), tmp_path / "out", package=name)
    assert str(caught.value) == (
        f'ROS takes no package called "{name}"; two or more small letters, digits and single '
        "underscores between them, a letter first. [C41]"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["my_robot", "r2", "tx60_cell_4_description"])
def test_names_of_packages_are_taken(name, tmp_path):
    write_robot_folder(replace(robot(), visuals=()), tmp_path / "out", package=name)
    assert (tmp_path / "out" / "robot.toml").is_file()


def test_the_command_takes_the_package_and_refuses_it_before_it_reads(tmp_path):
    words = ["identify", "staubli_tx60", tmp_path / "none.csv", "--package", "my-robot"]
    result = call(*words)
    assert result.exit_code == 2
    assert result.stderr.startswith('ROS takes no package called "my-robot"')


def test_a_session_hands_on_the_places_it_states(tmp_path):
    rows = ["pose_id,target,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"]
    rows += [f"{k},{name},{k},2,3,4,5,6,7,8,{k}{ord(name)}" for k in range(3) for name in "AB"]
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "s.toml").write_text(
        '[points]\nreflectors_mm = { A = [10, 20, 30], B = "free" }\n'
        "[uncertainty]\nposition_um = 20\n"
    )
    session = read_session(tmp_path / "a.csv", robot(), config=tmp_path / "s.toml")
    assert session.stated_reflectors == (Reflector("A", (0.01, 0.02, 0.03)),)
    assert session.reflector_names == ("B",)


def test_a_recording_made_again_equals_the_first_one(made, tmp_path):
    """Both draw the identified robot, as its folder holds it."""
    for name in ("poses", "points"):
        out = made / name
        first = tmp_path / f"{name}.rrd"
        first.write_bytes((out / "campaign.rrd").read_bytes())
        rederive_calibration(out, ("campaign.rrd",))
        again = out / "campaign.rrd"
        assert viewed.compare(first, again)
        one, two = store(first), store(again)
        assert structure(one) == structure(two)
        link = "/world/robot"
        for k in range(1, 7):
            link += f"/link{k}"
            for component in ("translation", "quaternion"):
                both = [column(s, link, f"Transform3D:{component}")[1] for s in (one, two)]
                assert both[0] == both[1]  # bit for bit: comparing files lets 1e-8 pass


def test_the_drawn_robot_is_the_identified_one_whatever_numbers_it_was_given():
    """Seen from the base of the identification, also where another gauge has another base."""
    found, q = sound(), pool_r(10, seed=2)
    model = found.fit.identification.model
    links = model.chain.links.copy()
    links[1:3, 1] += [5.0, -5.0]  # joints 2 and 3 are nearly parallel: five meters nearly cancel
    long = replace(model.chain, links=links)
    other = identified_robot(robot(), RobotModel(long), name="other")
    assert np.abs(other.model.chain.links[:, 1:3]).max() <= reach(long) * 1.01  # chosen anew
    for arm, chain in ((delivered_robot(found, robot(), found.fit), model.chain), (other, long)):
        drawn = forward(calibration_story(found, arm).chain, q)
        expected = inverse(model.chain.T_world_base) @ forward(chain, q)
        assert np.abs(drawn - expected).max() < 1e-12


def test_robot_toml_says_reflectors_in_millimeters(made):
    document = tomllib.loads((made / "points" / "robot" / "robot.toml").read_text())
    assert document["reflectors"][0] == {"name": "given", "position_mm": [10.0, 20.0, 30.0]}

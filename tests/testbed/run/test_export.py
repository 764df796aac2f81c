"""Identified robots as folders: every file proven, every digit back, nothing of others lost."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import yourdfpy
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.frames import step_transform
from calib.geometry.joint_errors import JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.joint_models import extended_model
from testbed.robots.catalog import load_robot
from testbed.robots.describe.axes import reach
from testbed.robots.meshes.files import part_mesh
from testbed.robots.placements import link_poses
from testbed.robots.units import degrees, millimeters
from testbed.robots.write import folder as export
from testbed.robots.write.dh_table import dh_rows
from testbed.robots.write.folder import write_robot_folder
from testbed.robots.write.identified import identified_robot
from testbed.scenario.hashes import robot_hash
from tests.testbed.robots.described_cases import ARMS, UR_LIKE, bench_arm
from tests.testbed.robots.robot_cases import AGREE, TX60, joint_vectors, slider

PLAIN = replace(TX60, visuals=())
"""The TX60 without drawings: quicker to write."""


def identified(robot, size=1e-3, seed=0, *, terms=True):
    """A model as a calibration might find it: all numbers moved, joint terms added."""
    model = extended_model(robot.model) if terms else robot.model
    return model.moved(np.random.default_rng(seed).normal(size=model.n_numbers) * size)


def arm(name, folder):
    path = folder / "arm.urdf"
    path.write_text(ARMS[name])
    return load_robot(path)


@pytest.mark.parametrize("name", ARMS)
def test_an_identified_robot_of_any_build_survives_its_folder(name, tmp_path):
    """robot.toml with all terms, URDF and MJCF with the geometry: by load_robot and by others."""
    robot = arm(name, tmp_path)
    model = identified(robot)
    done = write_robot_folder(identified_robot(robot, model, name="mine"), tmp_path / "out")
    q = joint_vectors(40, seed=3, robot=robot)
    back = load_robot(tmp_path / "out")
    np.testing.assert_allclose(back.model.poses(q), model.poses(q), rtol=0, atol=1e-14)
    assert back.model.names == model.names
    geometry = forward(model.chain, q)
    read = yourdfpy.URDF.load(str(tmp_path / "out" / "mine.urdf"), load_meshes=False)
    files = {ending: tmp_path / "out" / f"mine.{ending}" for ending in ("urdf", "xml")}
    models = {ending: mujoco.MjModel.from_xml_path(str(f)) for ending, f in files.items()}
    for row, T in zip(q, geometry, strict=True):
        read.update_cfg(row)
        np.testing.assert_allclose(read.get_transform("tool0"), T, rtol=0, atol=AGREE)
        for ending, one in models.items():
            data = mujoco.MjData(one)
            data.qpos[:] = row
            mujoco.mj_kinematics(one, data)
            at = data.site("tool").xpos if ending == "xml" else data.body("tool0").xpos
            np.testing.assert_allclose(at, T[:3, 3], rtol=0, atol=AGREE)
    for ending, tip in (("urdf", None), ("xml", "tool")):
        again = load_robot(files[ending], tip=tip)
        np.testing.assert_allclose(again.model.poses(q), geometry, rtol=0, atol=AGREE)
    said = [re.fullmatch(r"(.+) has the robot's poses to (.+) m and (.+) rad", s) for s in done[:4]]
    assert {one[1] for one in said} == {
        "robot.toml", "mine.urdf (yourdfpy)", "mine.urdf (MuJoCo)", "mine.xml (MuJoCo)"
    }  # fmt: skip
    assert max(float(one[k].removeprefix("< ")) for one in said for k in (2, 3)) <= AGREE
    assert np.abs(back.model.chain.links[:, 1:3]).max() <= reach(robot.model.chain) * 1.01


def test_every_number_comes_back_to_the_last_bit_or_its_neighbor(tmp_path):
    chain, robot = slider()
    chain = replace(chain, T_flange_tool=step_transform(np.array([0.1, 0, 0.3, np.pi, 0, 0])))
    terms = (
        JointTerm("gear1.sin1", 0, "sin", (3, 0, 0, 0)),
        JointTerm("gear2.cos1", 1, "cos", (0, 1, 0, -2)),
    )
    model = RobotModel(chain, JointErrors(terms, np.array([1.23456789e-5, -9.87654321e-4])))
    robot = replace(robot, model=model, free_sets={})
    write_robot_folder(robot, tmp_path / "r")
    back = load_robot(tmp_path / "r")
    assert back.model.joint_errors.terms == terms
    for own, other in (
        (back.model.chain.links, chain.links),
        (back.model.joint_errors.coefficients, model.joint_errors.coefficients),
        (back.limits, robot.limits),
        (back.centers, robot.centers),
        (back.repeatability, robot.repeatability),
    ):
        # one unit in the last place: degrees and millimetres have gaps there
        assert (np.abs(own - other) <= np.spacing(np.abs(other))).all()
    np.testing.assert_array_equal(back.masses, robot.masses)
    np.testing.assert_array_equal(back.inertias, robot.inertias)
    np.testing.assert_allclose(back.model.chain.T_world_base, chain.T_world_base, atol=1e-15)
    np.testing.assert_allclose(back.model.chain.T_flange_tool, chain.T_flange_tool, atol=1e-15)


def test_units_are_undone_exactly_wherever_a_number_is_read_as_that_value():
    rng = np.random.default_rng(1)
    values = rng.normal(size=2000)
    back = np.radians([degrees(v) for v in values])
    assert (np.abs(back - values) <= np.spacing(np.abs(values))).all()
    assert (back == values).mean() > 0.8
    assert [millimeters(x) for x in (0.29, -0.375, 0.0)] == [290.0, -375.0, 0.0]
    assert [degrees(np.radians(x)) for x in (-127.5, 90, 1e-3)] == [-127.5, 90.0, 1e-3]


def test_what_is_drawn_and_weighed_survives_too(tmp_path):
    write_robot_folder(TX60, tmp_path / "r")
    back = load_robot(tmp_path / "r")
    for field in ("limits", "speeds", "masses", "centers", "inertias", "repeatability"):
        np.testing.assert_array_equal(getattr(back, field), getattr(TX60, field))
    for field in ("title", "base_offset", "exclusions", "free_sets", "workspace"):
        assert getattr(back, field) == getattr(TX60, field)
    assert [(v.name, v.link, v.rgb, v.collides) for v in back.visuals] == [
        (v.name, v.link, v.rgb, v.collides) for v in TX60.visuals
    ]
    for own, other in zip(back.visuals, TX60.visuals, strict=True):
        assert own.file.read_bytes() == other.file.read_bytes()


def test_scaled_and_turned_meshes_are_written_in_the_frame_of_their_link(tmp_path):
    robot = load_robot(bench_arm(tmp_path))
    write_robot_folder(robot, tmp_path / "out")
    back = load_robot(tmp_path / "out")
    assert back.notes == robot.notes
    for own, other in zip(back.visuals, robot.visuals, strict=True):
        mine, want = part_mesh(own), part_mesh(other)
        # nine digits are written
        np.testing.assert_allclose(mine.vertices, want.vertices, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(mine.faces, want.faces)


def test_the_files_say_what_urdf_and_mjcf_leave_out(tmp_path):
    model = identified(PLAIN, 2e-4)
    robot = identified_robot(PLAIN, model, name="mine")
    done = write_robot_folder(robot, tmp_path / "r")
    q = joint_vectors(20_000, seed=5)
    away = np.linalg.norm((model.poses(q) - forward(model.chain, q))[:, :3, 3], axis=1)
    # 1000 even poses against 20000 random ones: the rms to its sampling error, the largest below
    words = done[-1]
    largest, rms = (1e-3 * float(number) for number in re.findall(r"([0-9.]+) mm", words))
    assert rms == pytest.approx(np.sqrt(np.mean(away**2)), rel=0.05)
    assert 0.7 * away.max() < largest <= away.max() * 1.02
    assert "27 joint terms" in words
    for name in ("mine.urdf", "mine.xml"):
        assert words in (tmp_path / "r" / name).read_text()
    rigid = write_robot_folder(PLAIN, tmp_path / "plain")
    assert len(rigid) == 5


def test_no_length_leaves_larger_than_the_robot(tmp_path):
    """A fit that let d2 and d3 of parallel axes run away: +439 m and -439 m, the same poses."""
    path = tmp_path / "ur.urdf"
    path.write_text(UR_LIKE)
    robot = load_robot(path)
    chain = robot.model.chain
    links = chain.links + np.random.default_rng(2).normal(size=(6, 5)) * 1e-4
    links[1, 3:] = chain.links[1, 3:]  # axes 2 and 3 stay exactly parallel: a shift is no change
    links[1:3, 1] += [439.0, -439.0]
    model = RobotModel(Chain(links, chain.kinds, chain.T_world_base, chain.T_flange_tool))
    found = identified_robot(robot, model, name="mine")
    assert np.abs(found.model.chain.links[:, 1:3]).max() < reach(chain) < 2
    assert "439 m long" in found.notes[-1]
    q = joint_vectors(30, robot=robot)
    np.testing.assert_allclose(found.model.poses(q), model.poses(q), rtol=0, atol=1e-11)
    # what has mass stays where it was: 0.5 m of arm times the changes of 1e-4
    before, after = (
        link_poses(one.model.chain, q)[:, 1:] @ np.c_[one.centers, np.ones(6)][:, :, None]
        for one in (robot, found)
    )
    np.testing.assert_allclose(after, before, rtol=0, atol=2e-3)
    np.testing.assert_allclose(found.inertias.sum(axis=1), robot.inertias.sum(axis=1), rtol=1e-9)
    write_robot_folder(found, tmp_path / "out")
    # a model whose lengths are sane keeps its numbers
    same = identified_robot(robot, robot.model, name="mine")
    assert same.model.chain is robot.model.chain


def test_a_file_that_says_something_else_is_never_left_behind(tmp_path, monkeypatch):
    """Write the MJCF of another robot: nothing appears."""
    other = replace(PLAIN, model=identified(PLAIN, 1e-6, terms=False))
    text = export.mjcf_text(other)
    monkeypatch.setattr(export, "mjcf_text", lambda *_, **__: text)
    with pytest.raises(
        RuntimeError, match=r"xml \(MuJoCo\) differs from the robot by .*e-0[567] m"
    ):
        write_robot_folder(PLAIN, tmp_path / "r")
    assert list(tmp_path.iterdir()) == []


def test_files_of_the_user_are_replaced_only_when_told_and_others_stay(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "notes.txt").write_text("keep me")
    (folder / "robot.toml").write_text("mine")
    with pytest.raises(InputError, match=r"has robot\.toml already") as caught:
        write_robot_folder(PLAIN, folder)
    assert caught.value.code == "C40"
    assert (folder / "robot.toml").read_text() == "mine"
    assert sorted(p.name for p in folder.iterdir()) == ["notes.txt", "robot.toml"]
    write_robot_folder(PLAIN, folder, overwrite=True)
    assert load_robot(folder).name == "staubli_tx60"
    assert (folder / "notes.txt").read_text() == "keep me"
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


def test_writing_twice_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_robot_folder(PLAIN, tmp_path / name)
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_a_model_of_other_joints_is_refused():
    with pytest.raises(InputError, match="the model has joints"):
        identified_robot(PLAIN, RobotModel(slider()[0]), name="mine")


def test_joint_terms_change_the_hash_of_a_robot():
    model = identified(PLAIN)
    hashes = {
        robot_hash(replace(PLAIN, model=one))
        for one in (PLAIN.model, RobotModel(model.chain), model)
    }
    assert len(hashes) == 3


# --- the table ---


def test_rows_are_old_new_and_uncertainty_in_millimeters_and_degrees():
    nominal, model = TX60.model, identified(TX60)
    free = ("theta1", "d1", "a2", "harmonic1.sin1")
    table = parameters_of(model, free)
    C = np.diag(np.array([1e-5, 2e-5, 3e-5, 4e-5]) ** 2)
    rows = {row.name: row for row in dh_rows(nominal, model, table, C)}
    assert tuple(rows) == model.names
    d1 = rows["d1"]
    assert (d1.unit, d1.expanded) == ("mm", pytest.approx(0.04, rel=1e-12))
    assert d1.delta == pytest.approx(1e3 * model.chain.links[0, 1], rel=1e-9)
    assert rows["theta1"].expanded == pytest.approx(np.degrees(2e-5), rel=1e-12)
    term = rows["harmonic1.sin1"]
    assert (term.unit, term.old) == ("deg", 0.0)
    assert term.expanded == pytest.approx(np.degrees(8e-5), rel=1e-12)
    held = [name for name, row in rows.items() if row.expanded is None]
    assert set(held) == set(model.names) - set(free)
    for row in rows.values():
        assert row.new - row.old == pytest.approx(row.delta, abs=1e-9)


def test_the_uncertainty_of_a_frame_is_that_of_its_printed_numbers():
    """Draw steps with the covariance, print each drawn frame by scipy, compare the scatter."""
    rng = np.random.default_rng(4)
    base = step_transform(np.array([1.0, -2, 0.5, 0.4, -1.1, 2.0]))
    model = RobotModel(replace(TX60.model.chain, T_world_base=base))
    names = [f"base.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]
    A = rng.normal(size=(6, 6)) * 1e-5
    rows = dh_rows(model, model, parameters_of(model, names), A @ A.T)
    step = rng.normal(size=(40_000, 6)) @ A.T
    turned = Rotation.from_matrix(base[:3, :3]) * Rotation.from_rotvec(step[:, 3:])
    printed = np.hstack([1e3 * step[:, :3] @ base[:3, :3].T, turned.as_rotvec(degrees=True)])
    # 40,000 draws know a standard deviation to 0.35 %; four times that
    np.testing.assert_allclose([row.expanded for row in rows[:6]], 2 * printed.std(0), rtol=0.014)
    assert all(row.expanded is None for row in rows[6:])


def test_a_frame_near_half_a_turn_keeps_the_side_of_its_old_numbers():
    turned = [step_transform(np.array([0, 0, 0, angle, 0, 0])) for angle in (3.1415, 3.1417)]
    models = [RobotModel(replace(TX60.model.chain, T_flange_tool=T)) for T in turned]
    rows = dh_rows(*models, parameters_of(models[1], []), np.zeros((0, 0)))
    row = next(row for row in rows if row.name == "tool.rx")
    assert row.delta == pytest.approx(np.degrees(2e-4), rel=1e-6)

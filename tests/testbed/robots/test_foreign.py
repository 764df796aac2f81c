"""What libraries of others raise, and how long and how much a hostile file of a robot takes."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.errors import InputError
from testbed.laboratory.simulator import Simulator
from testbed.robots.catalog import load_robot
from testbed.robots.describe import urdf as urdf_reader
from testbed.robots.describe.xml_gate import LARGEST, parse_xml
from testbed.robots.foreign import foreign
from testbed.robots.meshes import files
from testbed.robots.robot import Visual
from tests.hangs import no_hang
from tests.testbed.robots.described_cases import MJCF, bench_arm, block, urdf
from tests.testbed.robots.robot_cases import TX60
from tests.testbed.robots.sound_files import OBJ, SOUND


def refused(case):
    """The error of a case."""
    with no_hang(), pytest.raises(InputError) as caught:
        case()
    return caught.value


@pytest.mark.parametrize(
    "error", [KeyError("name"), RuntimeError(), RecursionError("deep"), OSError()]
)
def test_whatever_a_library_raises_is_our_error_and_its_warnings_stay_inside(error, recwarn):
    def reads():
        with foreign("reader", where="x.urdf"):
            warnings.warn("odd", stacklevel=1)
            raise error

    with pytest.raises(InputError, match=r"x\.urdf: reader cannot read it \(") as caught:
        reads()
    assert caught.value.__cause__ is error
    assert not recwarn


@pytest.mark.parametrize("error", [MemoryError(), KeyboardInterrupt(), ImportError("lxml")])
def test_the_machine_s_own_trouble_passes_the_door(error):
    with pytest.raises(type(error)), foreign("reader", where="x.urdf"):
        raise error


def test_a_reader_that_fails_in_spite_of_our_checks_names_the_file(tmp_path, monkeypatch):
    def fails(_):
        raise KeyError("something new")

    path = tmp_path / "arm.urdf"
    path.write_text(urdf("one", [("a", "revolute", "0 0 1", "0 0 0", "0 1 0", (-1, 1))]))
    monkeypatch.setattr(urdf_reader, "load_urdf", fails)
    assert refused(lambda: load_robot(path)).where == str(path)


# --- sizes ---


def test_meshes_are_measured_before_they_are_opened(tmp_path, monkeypatch):
    path = tmp_path / "big.stl"
    with path.open("wb") as file:
        file.truncate(files.LARGEST + 1)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", None)
        error = refused(lambda: files.load_mesh(path))
    assert error.code == "R9"
    assert "at most 20 MB" in str(error)
    # many that are allowed one by one
    bench_arm(tmp_path)
    monkeypatch.setattr(files, "ALL", 1000)
    (tmp_path / "assets" / "other.stl").write_bytes(block())
    text = MJCF.replace("<material", '<mesh name="other" file="other.stl"/><material', 1)
    error = refused(lambda: load_robot(bench_arm(tmp_path, text)))
    assert error.code == "R9"
    assert error.where.endswith("other.stl")


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"<robot>" + b"<a/>" * (LARGEST // 4 - 10) + b"</robot>", "R2"),
        (b"<robot>" + b"<a>" * (LARGEST // 3 - 10), "R17"),
        (b"<robot name='" + b"a" * (LARGEST - 30) + b"'/>", "R2"),
        (b"<robot " + b" ".join(b'a%d=""' % i for i in range(600_000)) + b"/>", "R2"),
        (b"<robot>" + b"<!---->" * (LARGEST // 7 - 10) + b"</robot>", ""),
    ],
    ids=["wide", "deep", "long", "attributes", "comments"],
)
def test_endless_xml_is_refused_while_it_is_read(data, code):
    """As large as a file may be; what is harmless may pass, at once too."""
    if code:
        assert refused(lambda: parse_xml(data, "robot", where="x")).code == code
        return
    with no_hang():
        parse_xml(data, "robot", where="x")


@pytest.mark.slow
def test_a_long_row_of_links_is_refused_or_read_at_once(tmp_path):
    """1,999 links: joint by joint refused, fixed to each other read."""
    path = tmp_path / "row.urdf"
    row = [(f"j{i}", "revolute", "0 0 0.01", "0 0 0", "0 1 0", (-1, 1)) for i in range(1998)]
    path.write_text(urdf("row", row))
    error = refused(lambda: load_robot(path))
    assert error.code == "R16"
    assert "1998 joints move" in str(error)
    fixed = [(name, "fixed", *rest) for name, _, *rest in row[:-1]]
    path.write_text(urdf("row", [*fixed, row[-1]]))
    with no_hang():
        robot = load_robot(path)
    assert robot.model.chain.n_joints == 1


@pytest.mark.parametrize(("bodies", "allowed"), [(16_000, False), (1990, True)])
def test_an_mjcf_of_many_bodies_is_refused_or_read_at_once(bodies, allowed, tmp_path):
    one = '<body name="b{}"><geom size="0.1"/><joint/></body>'
    text = "".join(map(one.format, range(bodies)))
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    if not allowed:
        assert refused(lambda: load_robot(path)).code == "R2"
        return
    with no_hang():
        assert load_robot(path, tip="b7").model.chain.n_joints == 1


# --- meshes of a robot.toml ---

FLAT = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n"
LEAPS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"


@pytest.mark.parametrize("text", ["", "v a b c\n", LEAPS, FLAT, OBJ.replace("v 1.0", "v 1e10", 1)])
def test_a_mesh_of_a_robot_toml_that_nobody_can_draw_is_named(text, tmp_path):
    """MuJoCo opens it first; the file is told, not an element of a model nobody has seen."""
    path = tmp_path / "part.obj"
    path.write_text(text)
    part = Visual((0.5, 0.5, 0.5), True, 1, "part", file=path)
    robot = replace(TX60, folder=tmp_path, visuals=(part,))
    error = refused(lambda: Simulator(robot, robot.model.chain))
    assert error.where == str(path)
    assert error.code in ("R9", "R10")


def test_a_mesh_whose_faces_leap_out_of_it_is_refused(tmp_path):
    path = tmp_path / "part.obj"
    path.write_text(LEAPS)
    assert refused(lambda: files.load_mesh(path)).where == str(path)


def test_coordinates_of_meshes_are_bounded(tmp_path):
    path = tmp_path / "part.stl"
    path.write_bytes(block((1e20, 1.0, 1.0)))
    assert refused(lambda: files.load_mesh(path)).code == "R10"
    path.write_bytes(block())
    assert np.ptp(files.load_mesh(path).vertices) == 1.0


def test_what_the_changes_start_from_is_sound(tmp_path):
    (tmp_path / "assets").mkdir()
    for name, data in SOUND.items():
        (tmp_path / name).write_bytes(data)
    for name in ("arm.urdf", "arm.xml", "meshes.xml", "robot.toml"):
        assert load_robot(tmp_path / name).visuals

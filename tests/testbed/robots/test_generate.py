"""What is committed equals what robot.toml makes today."""

import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from testbed import assets
from testbed.robots.catalog import load_robot, robot_names
from testbed.robots.write.generate import generate_robot, main, model_names
from tests.fresh import python
from tests.testbed.robots.robot_cases import TX60

pytestmark = pytest.mark.slow  # meshes of every robot are made


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """All shipped models made afresh."""
    out = tmp_path_factory.mktemp("models")
    assert main(["--out", str(out)]) == 0
    return out


def relative_files(folder, suffixes):
    return sorted(
        file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.suffix in suffixes
    )


def test_the_same_files_are_made(made):
    shipped = assets.models()
    for name in model_names():
        suffixes = {".obj", ".urdf", ".xml", ".toml"}
        assert relative_files(made / name, suffixes) == relative_files(shipped / name, suffixes)


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
@pytest.mark.parametrize("name", robot_names())
def test_the_committed_description_equals_its_regeneration_byte_for_byte(made, name, suffix):
    file = f"{name}/{name}.{suffix}"
    assert (made / file).read_bytes() == (assets.models() / file).read_bytes()


@pytest.mark.parametrize("name", model_names())
def test_the_committed_meshes_equal_their_regeneration(made, name):
    """Same text, or the same solid: the Boolean kernel may cut faces differently on another CPU.

    Its sums differ there in the last bits, which can move a vertex by one step of the 10 um grid
    and choose another diagonal; volume and bounds then still agree.
    """
    shipped = assets.models() / name
    for file in relative_files(shipped, {".obj"}):
        old, new = shipped / file, made / name / file
        if old.read_bytes() == new.read_bytes():
            continue
        a, b = (trimesh.load(path, process=False) for path in (old, new))
        np.testing.assert_allclose(a.bounds, b.bounds, atol=1.1e-5, err_msg=file)
        # a step of the grid over the whole surface
        assert abs(a.volume - b.volume) <= 1e-5 * a.area, file


def test_making_twice_gives_the_same_bytes(made, tmp_path):
    assert main(["laser_tracker", "--out", str(tmp_path)]) == 0
    for file in relative_files(tmp_path, {".obj"}):
        assert (tmp_path / file).read_bytes() == (made / file).read_bytes()


def test_a_made_robot_loads_like_the_shipped_one(made):
    robot = load_robot(made / "staubli_tx60")
    np.testing.assert_array_equal(robot.model.chain.links, TX60.model.chain.links)
    assert [v.name for v in robot.visuals] == [v.name for v in TX60.visuals]


def test_an_unknown_model_is_one_line_and_exit_code_2(capsys, tmp_path):
    assert main(["staubli", "--out", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert 'did you mean "staubli_tx60"' in told


def test_parts_and_drawing_must_name_the_same_things(tmp_path):
    text = (TX60.folder / "robot.toml").read_text()
    at = text.index('[[parts]]\nname = "wrist_caps"')
    (tmp_path / "robot.toml").write_text(text[:at] + text[text.index("[[parts]]", at + 1) :])
    with pytest.raises(InputError, match="differ in wrist_caps"):
        generate_robot(tmp_path / "robot.toml", tmp_path)
    (tmp_path / "robot.toml").write_text(text.replace('drawing = "staubli_tx60"', 'drawing = "x"'))
    with pytest.raises(InputError, match="there is kuka_iiwa7, staubli_tx60, universal_ur10"):
        generate_robot(tmp_path / "robot.toml", tmp_path)


def test_the_command_can_be_asked_for_help():
    assert "robot.toml" in python("-m", "testbed.robots.write.generate", "--help").stdout

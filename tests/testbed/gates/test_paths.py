"""Paths that no file system can hold are refused in our words, wherever they are named."""

import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.gates.paths import near, real
from testbed.robots.catalog import load_robot
from testbed.robots.meshes.files import load_mesh
from testbed.studies import parse_scenario

LETTERS = "n" * 300


def test_a_path_is_followed_whether_or_not_something_is_there(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path)
    assert real(tmp_path / "link" / "none.stl", field="mesh") == tmp_path.resolve() / "none.stl"
    (tmp_path / "file").write_text("")
    below = tmp_path / "file" / "below"
    assert real(below, field="mesh") == below.resolve()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (LETTERS, "too long for a path"),
        ("n/" * 3000, "too long for a path"),
        ("a\0b", "a character that no path has"),
        ("\udc00", "a character that no path has|not UTF-8"),
        ("ring", "a ring of links"),
    ],
)
def test_what_no_path_can_be_is_one_sentence_everywhere(name, says, tmp_path):
    """As a robot, as the root of meshes, as a mesh, and as the robot of a scenario."""
    (tmp_path / "ring").symlink_to("gnir")
    (tmp_path / "gnir").symlink_to("ring")
    path = tmp_path / name
    text = f'format = 1\nname = "a"\nrobot = "./{name}"\n'
    (tmp_path / "arm.urdf").write_text("<robot name='a'><link name='b'/></robot>")
    cases = [
        lambda: load_robot(path),
        lambda: load_robot(str(path)),
        lambda: load_mesh(path),
        lambda: load_robot(tmp_path / "arm.urdf", mesh_root=path),
    ]
    if name.isprintable():
        cases.append(lambda: parse_scenario(text, where="mine.toml", folder=tmp_path))
    for case in cases:
        with pytest.raises(InputError, match=says) as caught:
            case()
        assert len(str(caught.value)) < 400


def test_a_nul_in_the_robot_of_a_scenario_is_told_with_the_scenario(tmp_path):
    text = 'format = 1\nname = "a"\nrobot = "a/\\u0000"\n'
    with pytest.raises(InputError, match="a character that no path has") as caught:
        parse_scenario(text, where="mine.toml", folder=tmp_path)
    assert caught.value.where == "mine.toml"


@pytest.mark.parametrize(
    ("file", "says"),
    [
        (r"a\u0000b", r"\[points\] file .* a character that no path has"),
        ("ring/points.csv", r"\[points\] file .* is a ring of links"),
        ("../points.csv", "leads out of the folder"),
    ],
)
def test_a_file_of_a_session_is_told_with_the_session(file, says, tmp_path):
    (tmp_path / "ring").symlink_to("ring")
    session = tmp_path / "mine.toml"
    session.write_text(f'[points]\nfile = "{file}"\n')
    with pytest.raises(InputError, match=says) as caught:
        read_session(session, load_robot("staubli_tx60"))
    assert caught.value.where == str(session)


@pytest.mark.parametrize(
    ("name", "meant"),
    [("measured2.csv", "measured.csv"), ("MEASURED.csv", "measured.csv"), ("plan.jsn", "plan.json"),
     ("none.csv", ""), ("measured.toml", "measured.csv"), ("dat", "data"), ("hidden", "")],
)  # fmt: skip
def test_the_name_that_was_meant_is_one_beside_it(name, meant, tmp_path):
    """Not any file of the same ending, nor a hidden one."""
    for one in ("measured.csv", "sent.csv", "plan.json", ".hidden"):
        (tmp_path / one).write_text("")
    (tmp_path / "data").mkdir()
    told = f'did you mean "{tmp_path / meant}"?' if meant else "check the path"
    assert near(tmp_path / name) == told
    assert near(tmp_path / "nowhere" / name) == f"there is no folder {tmp_path / 'nowhere'}"

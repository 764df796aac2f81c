"""Model folders into robots: the numbers in SI, and each mistake told with its fix."""

import tomllib

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import chain_names, forward
from testbed.robots.catalog import load_robot, load_tracker_visuals, robot_names
from testbed.robots.meshes.files import load_mesh
from tests.testbed.robots.robot_cases import TX60

TOML = (TX60.folder / "robot.toml").read_text()


def load_text(text, folder, file="robot.toml"):
    """Load a robot file written into `folder`, its meshes those of the TX60."""
    if not (folder / "meshes").exists():
        (folder / "meshes").mkdir()
        for visual in TX60.visuals:
            (folder / "meshes" / visual.file.name).write_bytes(visual.file.read_bytes())
    (folder / file).write_text(text, encoding="utf-8")
    return load_robot(folder / file)


def test_the_tx60_has_the_papers_numbers_in_si():
    # Wen et al. 2022, table 3: theta deg, d mm, a mm, alpha deg, beta deg
    table = [
        (0, 0, 0, -90, 0),
        (-90, 0, 290, 0, 0),
        (90, 20, 0, 90, 0),
        (0, 310, 0, -90, 0),
        (0, 0, 0, 90, 0),
        (0, 70, 0, 0, 0),
    ]
    units = np.array([np.pi / 180, 1e-3, 1e-3, np.pi / 180, np.pi / 180])
    np.testing.assert_allclose(TX60.model.chain.links, table * units, rtol=1e-15)
    np.testing.assert_array_equal(TX60.model.chain.T_world_base, np.eye(4))
    np.testing.assert_array_equal(TX60.model.chain.T_flange_tool, np.eye(4))
    degrees = [[-180, 180], [-127.5, 127.5], [-142.5, 142.5], [-270, 270], [-122.5, 132.5]]
    np.testing.assert_allclose(np.degrees(TX60.limits[:5]), degrees, rtol=1e-15)
    np.testing.assert_allclose(np.degrees(TX60.speeds), [435, 410, 540, 995, 1065, 1445])
    assert TX60.base_offset == -0.375
    assert not TX60.model.joint_errors.terms


def test_the_free_set_is_the_papers_24():
    left_out = {"d2", "beta1", "beta3", "beta4", "beta5", "beta6"}
    links = chain_names(6)[6:-6]
    assert TX60.free_sets["wen2022"] == tuple(name for name in links if name not in left_out)


def test_every_group_of_numbers_has_a_source():
    assert {"geometry", "limits", "speeds", "repeatability", "masses", "meshes"} <= set(
        TX60.sources
    )
    assert all(len(sentence) > 15 for sentence in TX60.sources.values())


def test_main_parts_collide_and_trim_does_not():
    colliding = {v.name for v in TX60.visuals if v.collides}
    assert colliding == {
        "base", "shoulder", "upper_arm", "elbow", "forearm", "wrist", "probe"
    }  # fmt: skip
    assert {v.link for v in TX60.visuals if v.collides} == set(range(7))


def test_the_tracker_stands_on_the_robots_floor_at_station_height():
    visuals = load_tracker_visuals()
    assert {v.link for v in visuals} == {0, 1, 2}
    low = min(load_mesh(v.file).vertices[:, 2].min() for v in visuals)
    # station z = 0.3 m above the base frame; to the grid of the files
    assert 0.3 + low == pytest.approx(TX60.base_offset, abs=1e-5)
    aperture = next(v for v in visuals if v.name == "head_aperture")
    assert load_mesh(aperture.file).vertices[:, 0].min() > 0.04  # the beam leaves along x


def test_the_tracker_can_turn_and_tilt_without_touching_itself():
    """Yoke and head are told apart by where they may sweep."""
    by_name = {v.name: load_mesh(v.file).vertices for v in load_tracker_visuals()}
    head = np.vstack([by_name[n] for n in by_name if n.startswith("head")])
    # the head, tilting about y between the cheeks, stays above the yoke's body at z = -0.1
    swept = np.hypot(head[:, 0], head[:, 2])
    low = np.abs(head[:, 1]) < 0.06
    assert low.all()
    assert swept[head[:, 2] < 0.05].max() < 0.0965


def test_robots_are_found_by_name_folder_and_file():
    assert robot_names() == ["kuka_iiwa7", "staubli_tx60", "universal_ur10"]
    for way in ("staubli_tx60", TX60.folder, str(TX60.folder / "robot.toml")):
        assert load_robot(way).name == "staubli_tx60"


def test_results_cannot_be_changed():
    for field in ("limits", "speeds", "masses", "centers", "inertias", "repeatability"):
        assert not getattr(TX60, field).flags.writeable
    with pytest.raises(TypeError):
        TX60.free_sets["mine"] = ()  # type: ignore[index]  # that is the point
    with pytest.raises(AttributeError):
        TX60.name = "other"  # type: ignore[misc]  # that is the point


def test_an_unknown_robot_is_answered_with_the_likely_one():
    with pytest.raises(InputError, match='did you mean "staubli_tx60"'):
        load_robot("staubli_tx6")
    with pytest.raises(InputError, match="there is kuka_iiwa7, staubli_tx60, universal_ur10"):
        load_robot("qwertyuiop")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("floor_mm = ", "flor_mm = ", 'the file has no key "flor_mm"; did you mean "floor_mm"'),
        (
            "theta_deg = -90.0",
            "theta = -90.0",
            r'\[joints 2\] has no key "theta"; did you mean "th',
        ),
        ("theta_deg = -90.0\n", "", r'\[joints 2\] needs the key "theta_deg"'),
        (
            "theta_deg = -90.0",
            'theta_deg = "x"',
            r"\[joints 2\] theta_deg is .x.; it must be a num",
        ),
        ("theta_deg = -90.0", "theta_deg = true", r"\[joints 2\] theta_deg is true; it must be"),
        ("theta_deg = -90.0", "theta_deg = nan", r"\[joints 2\] theta_deg is nan"),
        ("theta_deg = -90.0", "theta_deg = 12:30:45", r"\[joints 2\] theta_deg is .12:30:45"),
        (
            "mass_kg = 11.0",
            "mass_kg = -1",
            r"\[joints 2\] mass_kg is -1; it must be 1e-09 kg or larger",
        ),
        ("lower_deg = -127.5", "lower_deg = 127.5", "lower_deg 127.5 is not below upper_deg 127.5"),
        ("[0.04, 0.16, 0.16]", "[0.04, 0.16, 0.5]", "largest moment exceeds the sum"),
        ("[135.0, 0.0, 178.0]", "[135.0, 0.0]", "center_mm"),
        ("[[0, 1], [1, 2]", "[[0, 7], [1, 2]", r"never_collide has \[0, 7\]"),
        ('"theta1", "d1"', '"theta1", "d11"', r'\[free_sets\] wen2022: "d11" is not a parameter'),
        ('"theta1", "d1"', '"theta1", "theta1"', '"theta1" is there twice'),
        ("yellow = [0.955", "yelow = [0.955", 'no color "yellow"; did you mean "yelow"'),
        ("yellow = [0.955", "yellow = [1.955", "colors"),
        (
            'name = "wrist"\nlink = 5',
            'name = "wrist"\nlink = 9',
            "wrist is on link 9; the last is 6",
        ),
        ('name = "wrist_caps"', 'name = "wrist"', "part wrist appears twice"),
        ('"meshes/wrist.obj"', '"../wrist.obj"', "must stay inside the model's folder"),
        ('"meshes/wrist.obj"', '"/etc/passwd"', "must stay inside the model's folder"),
        ('"meshes/wrist.obj"', '"meshes/none.obj"', "no mesh meshes/none.obj; python -m testbed"),
        (
            "[workspace]",
            "[tolerances]\njoints = [{ joint = 7, length_mm = 0.1 }]\n[workspace]",
            "tolerances: joint 7 is not there; the last is 6",
        ),
        (
            "[workspace]",
            "[tolerances]\nlength_mm = 0\n[workspace]",
            r"\[tolerances\] length_mm is 0; it must be 1e-09 mm or larger",
        ),
        ("format = 1", "format = 2", "format is 2; this version reads format 1"),
        ("format = 1", "format = [", "is not TOML"),
        ('name = "staubli_tx60"', 'name = "../x"', "name is .../x"),
    ],
)
def test_a_mistake_names_file_table_key_and_fix(old, new, says, tmp_path):
    assert old in TOML
    with pytest.raises(InputError, match=says) as caught:
        load_text(TOML.replace(old, new, 1), tmp_path)
    assert caught.value.where == str(tmp_path / "robot.toml")


def test_a_robot_copied_without_its_meshes_is_told_what_to_do(tmp_path):
    text = TOML.replace('drawing = "staubli_tx60"', "")
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"no mesh .*; copy the meshes along with the file, or"):
        load_robot(tmp_path / "robot.toml")


def test_a_table_that_is_missing_is_called_so(tmp_path):
    with pytest.raises(InputError, match=r"\[joints\] is missing"):
        load_text("format = 1", tmp_path)


def test_a_wrong_joint_kind_lists_the_right_ones(tmp_path):
    with pytest.raises(InputError, match=r"revolute.*prismatic"):
        load_text(TOML.replace('kind = "revolute"', 'kind = "rotary"', 1), tmp_path)


def test_all_mistakes_are_told_at_once(tmp_path):
    text = TOML.replace("theta_deg = -90.0", "tetha_deg = -90.0").replace(
        "mass_kg = 8.0", "mass = 8.0"
    )
    with pytest.raises(InputError) as caught:
        load_text(text, tmp_path)
    for word in ("tetha_deg", "[joints 2]", '"mass"', "[joints 3]"):
        assert word in str(caught.value)


def test_a_mesh_link_out_of_the_folder_is_refused(tmp_path):
    folder = tmp_path / "model"
    folder.mkdir()
    load_text(TOML, folder)
    (tmp_path / "outside.obj").write_text("v 0 0 0\n")
    (folder / "meshes" / "wrist.obj").unlink()
    (folder / "meshes" / "wrist.obj").symlink_to(tmp_path / "outside.obj")
    with pytest.raises(InputError, match="leads out of the model's folder") as caught:
        load_robot(folder)
    assert caught.value.code == "R6"


def test_a_sliding_joint_is_given_in_millimeters(tmp_path):
    tables = tomllib.loads(TOML)["joints"][0]
    assert tables["kind"] == "revolute"
    text = """format = 1
name = "slider"
title = "One rail"
[sources]
all = "invented"
[base]
position_mm = [100, 0, 0]
rotation_vector_deg = [0, 0, 90]
[tool]
position_mm = [0, 0, 50]
[[joints]]
kind = "prismatic"
theta_deg = 0
d_mm = 10
a_mm = 0
alpha_deg = 0
lower_mm = -500
upper_mm = 500
max_speed_mm_s = 1000
repeatability_um = 5
mass_kg = 1
center_mm = [0, 0, 0]
inertia_kg_m2 = [0.1, 0.1, 0.1]
"""
    robot = load_text("\ufeff" + text, tmp_path)
    assert robot.model.chain.kinds == ("prismatic",)
    np.testing.assert_array_equal(robot.limits, [[-0.5, 0.5]])
    np.testing.assert_array_equal(robot.speeds, [1.0])
    np.testing.assert_allclose(robot.repeatability, [5e-6], rtol=1e-15)
    T = forward(robot.model.chain, [[0.2]])[0]
    np.testing.assert_allclose(T[:3, 3], [0.1, 0, 0.26], atol=1e-15)
    np.testing.assert_allclose(T[:3, 0], [0, 1, 0], atol=1e-15)
    assert robot.visuals == ()

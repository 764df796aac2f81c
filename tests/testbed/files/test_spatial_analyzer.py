"""Exports of Spatial Analyzer in their variants: one set of points, many ways to write it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.geometry.frames import inverse
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, columns, csv, made

DATA = made(7, 12)
HEAD = "// Points Relative to Coordinate Frame 'A::WORLD'\n"
AXES = {
    "cartesian": "// AXES = CARTESIAN: X,  Y,  Z (mm)\n",
    "cylindrical": "// AXES = CYLINDRICAL: R, Theta, Z (mm) (deg)\n",
    "spherical": "// AXES = SPHERICAL: R, Theta, Phi (mm) (deg)\n",
}


def coordinates(system):
    x, y, z = p = DATA.T[:, :3, 3].T * 1e3
    if system == "cartesian":
        return p.T
    theta = np.degrees(np.arctan2(y, x))
    if system == "cylindrical":
        return np.column_stack([np.hypot(x, y), theta, z])
    r = np.linalg.norm(p, axis=0)
    return np.column_stack([r, theta, np.degrees(np.arccos(z / r))])


def text(system="cartesian", names=3, separator=",  ", head=None, tail="", target="{}", digits=6):
    head = HEAD + AXES[system] if head is None else head
    before = ["Coll", "Main", target][3 - names :] if names else []
    lines = [
        separator.join([f.format(k + 1) for f in before] + [f"{c:.{digits}f}" for c in row])
        + (separator + tail if tail else "")
        for k, row in enumerate(coordinates(system))
    ]
    return head + "\n".join(lines) + "\n"


def session(folder, content, more="", match=""):
    joints = {k: v for k, v in columns(DATA).items() if k[0] in "pq"}
    (folder / "joints.csv").write_text(csv(joints))
    (folder / "smr.txt").write_text(content)
    (folder / "session.toml").write_text(
        f'{match}\n[joints]\nfile = "joints.csv"\n'
        f'[points]\nfile = "smr.txt"\nformat = "sa"\n{more}\n'
        "[uncertainty]\nposition_um = 20\n"
    )
    return read_session(folder, ROBOT)


def agrees(read, atol=1e-9):
    """Six decimals of a millimeter are printed."""
    np.testing.assert_allclose(read.measurements.position, DATA.T[:, :3, 3], atol=atol)
    np.testing.assert_allclose(read.measurements.q, DATA.q, atol=1e-12)
    return True


@pytest.mark.parametrize("system", ["cartesian", "cylindrical", "spherical"])
@pytest.mark.parametrize("names", [1, 2, 3])
@pytest.mark.parametrize("separator", [",  ", " ", ","])
def test_systems_names_and_separators(tmp_path, system, names, separator):
    # 1e-6 deg over 4 m is 7e-8 m
    assert agrees(
        session(tmp_path, text(system, names, separator)), 1e-9 if system[0] == "ca" else 1e-7
    )


@pytest.mark.parametrize("separator", [";", " ", "\t", ",  "])
def test_commas_before_decimals_are_read_where_something_else_separates(tmp_path, separator):
    head, *rows = text("cartesian", 3, separator).rstrip("\n").rsplit("\n", len(DATA.q))
    read = session(tmp_path, "\n".join([head, *(row.replace(".", ",") for row in rows)]))
    assert agrees(read)
    assert any("decimal commas" in note for note in read.notes)


def test_a_semicolon_inside_a_comment_separates_nothing(tmp_path):
    assert agrees(session(tmp_path, text(separator=", ", tail="0.01; 0.02 mm")))


@pytest.mark.parametrize("names", [2, 3])
def test_names_with_colons_between_their_parts_go_by_pose(tmp_path, names):
    head, *rows = text("cartesian", names, ", ").rstrip("\n").rsplit("\n", len(DATA.q))
    parted = [row.split(", ") for row in rows]
    glued = [", ".join(["::".join(row[:names]), *row[names:]]) for row in parted]
    assert "::" in glued[0]
    assert agrees(session(tmp_path, "\n".join([head, *glued])))


def test_points_without_names_go_by_order(tmp_path):
    assert agrees(session(tmp_path, text(names=0), match='match = "order"'))


def test_what_follows_the_coordinates_is_not_read_unless_named(tmp_path):
    tail = "0.010000,  0.020000,  0.030000,  02/12/25 16:38:29"
    assert agrees(session(tmp_path, text(tail=tail)))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "joints.csv"\n[points]\nfile = "smr.txt"\nformat = "sa"\n'
        'after = ["ux_mm", "uy_mm", "uz_mm"]\n'
    )
    read = read_session(tmp_path, ROBOT)
    u = np.sqrt(np.diagonal(read.measurements.covariance[0])[:3])
    np.testing.assert_allclose(u, [10e-6, 20e-6, 30e-6], rtol=1e-12)


def test_a_unit_that_nobody_states_is_refused_and_a_stated_one_is_used(tmp_path):
    with pytest.raises(InputError, match=r"does not say its unit.*length = \"mm\""):
        session(tmp_path, text(head=""))
    assert agrees(session(tmp_path, text(head=""), 'length = "mm"'))
    with pytest.raises(InputError, match=r"the file says mm, session.toml says"):
        session(tmp_path, text(), 'length = "m"')


def test_names_that_could_be_coordinates_are_refused_unless_stated(tmp_path):
    # whole millimeters: nothing tells a name from a number
    doubtful = text(names=1, digits=0, tail="7")
    with pytest.raises(InputError, match="0 or 1 or 2 names"):
        session(tmp_path, doubtful)
    assert agrees(session(tmp_path, doubtful, "names = 1"), 1e-3)


def test_cycling_names_count_poses(tmp_path):
    rows = [f"A, S, {'SMR'}, {x:.6f}, {y:.6f}, {z:.6f}" for x, y, z in coordinates("cartesian")]
    body = HEAD + AXES["cartesian"]
    assert agrees(session(tmp_path, body + "\n".join(rows)))
    with pytest.raises(InputError, match=r"SMR 11 times for 12 joint vectors"):
        session(tmp_path, body + "\n".join(rows[1:]))


def test_a_group_per_pose_holds_several_reflectors(tmp_path):
    rows = [
        f"A, {k + 1}, {name}, {x + dx:.6f}, {y:.6f}, {z:.6f}"
        for k, (x, y, z) in enumerate(coordinates("cartesian"))
        for name, dx in (("R1", 0), ("R2", 30))
    ]
    read = session(tmp_path, HEAD + AXES["cartesian"] + "\n".join(rows))
    assert read.reflector_names == ("R1", "R2")
    assert read.measurements.pose_id.tolist() == [k for k in range(1, 13) for _ in "12"]


def frames(form):
    p, R = DATA.T[:, :3, 3] * 1e3, Rotation.from_matrix(DATA.T[:, :3, :3])
    if form == "matrix":
        T = DATA.T.copy()
        T[:, :3, 3] *= 1e3
        return T.reshape(-1, 16)
    quaternion = R.as_quat()
    last = {
        "quaternion_scalar_first": quaternion[:, [3, 0, 1, 2]],
        "quaternion_scalar_last": quaternion,
    }.get(form)
    return np.column_stack([p, R.as_euler(form, degrees=True) if last is None else last])


@pytest.mark.parametrize(
    "form",
    [
        "xyz",
        "XYZ",
        "ZYX",
        "ZYZ",
        "ZXZ",
        "matrix",
        "quaternion_scalar_first",
        "quaternion_scalar_last",
    ],
)
def test_frames_in_every_stated_form(tmp_path, form):
    joints = {k: v for k, v in columns(DATA).items() if k[0] in "pq"}
    (tmp_path / "joints.csv").write_text(csv(joints))
    rows = [
        ", ".join([f"{k + 1}", *(f"{v:.12f}" for v in row)]) for k, row in enumerate(frames(form))
    ]
    (tmp_path / "tmac.csv").write_text("\n".join(rows))
    said = f'euler = "{form}"\nangle = "deg"' if len(form) == 3 else f'rotation = "{form}"'
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "joints.csv"\n[frames]\nfile = "tmac.csv"\nformat = "sa"\nlength = "mm"\n'
        f"{said}\n[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    )
    read = read_session(tmp_path, ROBOT).measurements
    np.testing.assert_allclose(read.position, DATA.T[:, :3, 3], atol=1e-12)
    # 1e-12 deg and 1e-12 of a matrix entry are printed
    np.testing.assert_allclose(read.rotation, DATA.T[:, :3, :3], atol=3e-12)


def test_frames_do_not_say_how_they_turn(tmp_path):
    (tmp_path / "tmac.csv").write_text("1, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0\n")
    (tmp_path / "session.toml").write_text('[frames]\nfile = "tmac.csv"\nformat = "sa"\n')
    with pytest.raises(InputError, match="M24"):
        read_session(tmp_path, ROBOT)


@pytest.mark.parametrize("gives", ["T_tracker_tool", "T_tool_tracker"])
def test_frames_either_way_round_are_the_same_poses(tmp_path, gives):
    """As a camera on the flange sees a board, or as a tracker sees the tool."""
    T = DATA.T if gives == "T_tracker_tool" else inverse(DATA.T)
    place, turn = 1e3 * T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3]).as_quat()
    rows = [f"P{k}," + ",".join(f"{v:.12f}" for v in row)
            for k, row in enumerate(np.column_stack([place, turn]))]  # fmt: skip
    (tmp_path / "f.txt").write_text("\n".join(rows))
    joints = {k: v for k, v in columns(DATA).items() if k[0] == "q"}
    (tmp_path / "joints.csv").write_text(csv(joints | {"pose_id": [f"P{k}" for k in range(12)]}))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "joints.csv"\n[frames]\nfile = "f.txt"\nformat = "sa"\nlength = "mm"\n'
        f'rotation = "quaternion_scalar_last"\ngives = "{gives}"\n'
        "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    )
    table = read_session(tmp_path, ROBOT).measurements
    # twelve decimals, of the rotation times meters
    np.testing.assert_allclose(table.position, DATA.T[:, :3, 3], rtol=0, atol=1e-11)
    np.testing.assert_allclose(table.rotation, DATA.T[:, :3, :3], rtol=0, atol=1e-11)
    # what an angle of the camera does at the tool, three meters away, is noise of the place
    sd = np.sqrt(np.trace(table.covariance[:, :3, :3], axis1=1, axis2=2))
    arm = np.linalg.norm(T[:, :3, 3], axis=1) * (gives != "T_tracker_tool")
    np.testing.assert_allclose(
        sd, np.sqrt(3 * 20e-6**2 + 2 * (np.radians(0.01) * arm) ** 2), rtol=1e-9
    )

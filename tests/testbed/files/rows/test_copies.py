"""Rows with the digits of an earlier one: copies are left out, good readings of few digits stay."""

import numpy as np
import pytest

from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

JOINTS = tuple(f"q{k}_deg" for k in range(1, 7))
LENGTHS = ("x_mm", "y_mm", "z_mm")


def visited(decimals, *, poses=40, times=5):
    """Points of a tracker that scatters by 4 um, printed with some decimals of a millimeter."""
    own = columns(made(0, poses))
    rng = np.random.default_rng(0)
    table = {k: np.repeat(own[k], times) for k in ("pose_id", *JOINTS, *LENGTHS)}
    scatter = rng.normal(0, 4e-3, (3, poses * times))
    return table | {
        k: np.round(table[k] + scatter[i], decimals) for i, k in enumerate(LENGTHS)
    }  # fmt: skip


def read(folder, table, toml="[points]\n", decimal="."):
    (folder / "a.csv").write_text(csv(table, decimal=decimal))
    (folder / "session.toml").write_text(
        f'{toml}file = "a.csv"\n[uncertainty]\nposition_um = 10\ndistance_um = 50\n'
    )
    return read_session(folder, ROBOT)


def repeated(table, *names):
    """How many rows have the numbers of an earlier one in some columns."""
    rows = list(zip(*(table[name] for name in names), strict=True))
    return len(rows) - len(set(rows))


def test_visits_that_a_coarse_file_prints_alike_are_kept_and_said(tmp_path):
    table = visited(3)
    table["y_mm"][1::5], table["x_mm"][1::5] = table["y_mm"][::5], table["x_mm"][::5]
    table["z_mm"][1::5] = table["z_mm"][::5]
    alike = repeated(table, *LENGTHS)
    assert alike >= 40
    session = read(tmp_path, table)
    assert len(session.measurements) == 200
    assert not session.masked
    assert any(text.startswith(f"a.csv: {alike} rows (lines 3, ") for text in session.warnings)


def test_visits_that_a_coarse_file_prints_alike_by_chance_are_not_spoken_of(tmp_path):
    """Six of 105 such rows of a small arm (scatter 1.5 um, digits of 1 um) were called odd.

    At other joints such a row is still left out.
    """
    table = visited(2)
    assert repeated(table, "pose_id", *LENGTHS) >= 10
    session = read(tmp_path, table)
    assert not any("earlier readings" in text for text in session.warnings)
    apart = visited(2)
    for name in LENGTHS:
        apart[name][8] = apart[name][0]
    (said,) = read(tmp_path, apart).masked
    assert said.startswith("a.csv: 1 row left out (line 10): digit for digit")


@pytest.mark.parametrize("share", [0.9, 1.0])
def test_visits_of_which_most_are_copies_are_not_taken_for_chance(share, tmp_path):
    """Their axes agree that often because of the copies; nothing was said."""
    table = visited(3)
    row = np.arange(len(table["x_mm"]))
    for name in LENGTHS:
        copies = table[name][row // 5 * 5]
        table[name] = np.where(row < share * len(row), copies, table[name])
    session = read(tmp_path, table)
    assert any("the digits of earlier readings" in text for text in session.warnings)


@pytest.mark.parametrize("at", [0, 4])
def test_means_beside_the_shots_that_they_are_made_of_do_not_count(at, tmp_path):
    table = visited(4, poses=12)
    shots = np.setdiff1d(np.arange(5), at)
    for name in LENGTHS:
        cells = table[name].reshape(12, 5)
        cells[:, at] = np.round(cells[:, shots].mean(axis=1), 4)
    session = read(tmp_path, table)
    assert len(session.measurements) == 48
    assert session.masked[0].startswith(f"a.csv: 12 rows left out (lines {at + 2}, {at + 7}, ")
    assert session.masked[0].endswith("the mean of the other readings of their pose")


def test_copies_at_full_precision_are_left_out_with_their_joints(tmp_path):
    table = visited(4)
    assert repeated(table, *LENGTHS) == 0
    for name in LENGTHS:
        table[name][[7, 13]] = table[name][[5, 14]]  # of the same pose each
    session = read(tmp_path, table)
    said = "copies of earlier readings, digit for digit; each counts once"
    assert session.masked == (f"a.csv: 2 rows left out (lines 9, 16): {said}",)


def test_coarse_ranges_are_coarse_whatever_their_angles(tmp_path):
    table = visited(4)
    x, y, z = (np.repeat(table[name][::5], 5) for name in LENGTHS)
    reach = np.sqrt(x**2 + y**2 + z**2)
    polar = {k: table[k] for k in ("pose_id", *JOINTS)} | {
        "range_mm": np.round(reach, 2),
        "azimuth_deg": np.round(np.degrees(np.arctan2(y, x)), 4),
        "elevation_deg": np.round(np.degrees(np.arcsin(z / reach)), 4),
    }
    session = read(tmp_path, polar)
    assert len(session.measurements) == 200
    assert not session.masked


def distances():
    """300 distances from one point, with a tenth of a millimeter."""
    data = made(3, 300)
    own = columns(data)
    away = 1e3 * np.linalg.norm(data.T[:, :3, 3] - [1.0, -2.0, 0.5], axis=1)
    table = {k: own[k] for k in ("pose_id", *JOINTS)} | {"distance_mm": np.round(away, 1)}
    assert repeated(table, "distance_mm") == 2
    return table | {"anchor": ["a"] * 300}


def test_equal_distances_of_different_poses_are_kept(tmp_path):
    session = read(tmp_path, distances(), '[ranges]\nanchors_mm = {a = "free"}\n')
    assert len(session.measurements) == 300
    assert not session.masked


def test_nothing_is_left_out_before_rows_are_matched_by_order(tmp_path):
    table = distances()
    (tmp_path / "j.csv").write_text(csv({k: table[k] for k in JOINTS}))
    seen = {k: v for k, v in table.items() if k in ("distance_mm", "anchor")}
    toml = 'match = "order"\n[joints]\nfile = "j.csv"\n[ranges]\nanchors_mm = {a = "free"}\n'
    session = read(tmp_path, seen, toml)
    np.testing.assert_allclose(session.measurements.q, made(3, 300).q, rtol=0, atol=1e-13)
    # nor are copies of poses: the row belongs to its joints, and is then left out with them
    own = with_spread(columns(made(), ids=False)) | {"euler": ["XYZ"] * 29}
    rows = [*range(29), 4]
    twice = {k: [v[row] for row in rows] for k, v in own.items()}
    (tmp_path / "j.csv").write_text(csv({k: twice[k] for k in JOINTS}))
    (tmp_path / "a.csv").write_text(csv({k: v for k, v in twice.items() if k not in JOINTS}))
    (tmp_path / "session.toml").write_text(
        'match = "order"\n[joints]\nfile = "j.csv"\n[frames]\nfile = "a.csv"\n'
    )
    session = read_session(tmp_path, ROBOT)
    # digits of a degree, and no more than rounding in float64
    joints = np.column_stack([np.radians(twice[k]) for k in JOINTS])
    np.testing.assert_allclose(session.measurements.q, joints[:29], rtol=0, atol=1e-13)
    assert session.masked[0].startswith("a.csv: 1 row left out (line 31): copies of earlier")


@pytest.mark.parametrize(("decimals", "left"), [(5, 1), (2, 0)])
def test_a_pose_that_was_not_taken_again_at_other_joints_is_left_out(decimals, left, tmp_path):
    """Its six numbers are an old reading, if they are fine enough to tell."""
    table = with_spread(columns(made())) | {"euler": ["XYZ"] * 29}
    for name in (*LENGTHS, "rx_deg", "ry_deg", "rz_deg"):
        table[name] = np.round(table[name], decimals)
    table |= {k: np.append(v, v[-1]) for k, v in table.items()}
    table["q6_deg"][-1] += 0.002
    table["pose_id"][-1] = 30
    (tmp_path / "a.csv").write_text(csv(table))
    session = read_session(tmp_path / "a.csv", ROBOT)
    assert len(session.measurements) == 30 - left
    assert sum("line 31" in text for text in session.masked) == left
    assert sum("line 31" in text for text in session.warnings) == 1 - left

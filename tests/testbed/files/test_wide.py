"""Tables with several targets in a row: the same as one row for each, or refused by name."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.robots.catalog import load_robot
from tests.testbed.files.made import csv, made
from tests.testbed.proposal.test_session import proposed

ROBOT = load_robot("staubli_tx60")
DATA = made(3, 12)
ARMS = {"A": np.array([0.05, 0.0, 0.0]), "B": np.array([0.0, 0.04, 0.02])}
MM = {k: 1e3 * (DATA.T[:, :3, 3] + DATA.T[:, :3, :3] @ arm) for k, arm in ARMS.items()}
JOINTS = {"pose_id": np.arange(12)} | {f"q{j + 1}_rad": DATA.q[:, j] for j in range(6)}
WIDE = JOINTS | {f"{k}{axis}": MM[k][:, i] for k in ARMS for i, axis in enumerate("xyz")}
TARGETS = '[points.targets]\nA = ["Ax", "Ay", "Az"]\nB = ["Bx", "By", "Bz"]\n'


def session(folder, table, more=TARGETS, length=""):
    (folder / "m.csv").write_text(table if isinstance(table, str) else csv(table))
    (folder / "session.toml").write_text(
        f'[joints]\nfile = "m.csv"\n[points]\nfile = "m.csv"\n{length}\n{more}'
        "[uncertainty]\nposition_um = 20\n"
    )
    return read_session(folder, ROBOT)


def one_row_each():
    """The same readings as tables with a column target have them."""
    order = [(j, k) for j in range(12) for k in ARMS]
    table = {name: [column[j] for j, _ in order] for name, column in JOINTS.items()}
    table["target"] = [k for _, k in order]
    return table | {f"{axis}_mm": [MM[k][j, i] for j, k in order] for i, axis in enumerate("xyz")}


def test_they_are_read_as_one_row_for_each_target(tmp_path):
    wide, long = session(tmp_path, WIDE), session(tmp_path, one_row_each(), "")
    assert wide.reflector_names == long.reflector_names == ("A", "B")
    assert wide.pose_names == long.pose_names
    for name in ("q", "position", "covariance", "reflector", "pose_id"):
        np.testing.assert_array_equal(
            getattr(wide.measurements, name), getattr(long.measurements, name)
        )


@pytest.mark.parametrize("how", ["pose_id", "order"])
def test_joints_of_another_file_belong_to_all_targets_of_their_pose(how, tmp_path):
    (tmp_path / "joints.csv").write_text(csv(JOINTS))
    left = "qp" if how == "order" else "q"
    seen = {name: column for name, column in WIDE.items() if name[0] not in left}
    (tmp_path / "seen.csv").write_text(csv(seen))
    (tmp_path / "session.toml").write_text(
        f'match = "{how}"\n[joints]\nfile = "joints.csv"\n[points]\nfile = "seen.csv"\n{TARGETS}'
        "[uncertainty]\nposition_um = 20\n"
    )
    apart, together = read_session(tmp_path, ROBOT), session(tmp_path, WIDE)
    for name in ("q", "position", "reflector", "pose_id"):
        np.testing.assert_array_equal(
            getattr(apart.measurements, name), getattr(together.measurements, name)
        )


ROWS = np.hstack([MM["A"], MM["B"]]).tolist()
EXPORTS = {
    "Qualisys": ["NO_OF_FRAMES\t12", "NO_OF_MARKERS\t2", "DESCRIPTION\t--", "MARKER_NAMES\tA\tB",
                 "TRAJECTORY_TYPES\tMeasured\tMeasured", *("\t".join(map(repr, r)) for r in ROWS)],
    "Qualisys with times": ["MARKER_NAMES\tA\tB", *("\t".join(map(repr, [k, k / 100, *row])) + "\t"
                                                   for k, row in enumerate(ROWS, 1))],
    "Motive": ["Format Version,1.23,Length Units,Millimeters", "", ",,Marker" + ",Marker" * 5,
               ",,T:1,T:1,T:1,T:2,T:2,T:2", ",,A,A,A,B,B,B", ",,Position" + ",Position" * 5,
               "Frame,Time (Seconds),X,Y,Z,X,Y,Z",
               *(f"{k},{k / 120},{','.join(map(repr, row))}" for k, row in enumerate(ROWS))],
}  # fmt: skip


@pytest.mark.parametrize("lines", EXPORTS.values(), ids=EXPORTS)
def test_markers_of_motion_capture_are_targets_of_one_pose(lines, tmp_path):
    (tmp_path / "seen.tsv").write_text("\n".join([*lines, ""]))
    (tmp_path / "joints.csv").write_text(csv({k: v for k, v in JOINTS.items() if k[0] == "q"}))
    proposed(tmp_path, [tmp_path / "seen.tsv", tmp_path / "joints.csv"], "--robot", ROBOT.name)
    found = read_session(tmp_path / "session.toml", ROBOT).measurements
    np.testing.assert_allclose(found.q, np.repeat(DATA.q, 2, axis=0), rtol=0, atol=1e-12)
    both = np.stack([MM["A"], MM["B"]], axis=1).reshape(-1, 3) / 1e3
    np.testing.assert_allclose(found.position, both, rtol=0, atol=1e-12)
    assert found.reflector.tolist() == [0, 1] * 12


def test_coordinates_are_in_the_stated_unit(tmp_path):
    meters = {name: column / 1e3 if name[0] in "AB" else column for name, column in WIDE.items()}
    np.testing.assert_allclose(
        session(tmp_path, meters, length='length = "m"').measurements.position,
        session(tmp_path, WIDE).measurements.position, rtol=0, atol=1e-15,
    )  # fmt: skip


UNITS = ",".join(["", *["rad"] * 6, *["m"] * 6])
WRONG = {
    "a column that is not there": (WIDE, TARGETS.replace("By", "Cy"), 'no column "Cy"'),
    "a column twice": (WIDE, TARGETS.replace("By", "Ay"), '"Ay" is that of two'),
    "a name besides": (WIDE | {"target": ["A"] * 12}, TARGETS, "has a column target"),
    "another unit": (
        csv(WIDE).replace("\n", f"\n{UNITS}\n", 1), TARGETS, "line below the names says m",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("table", "more", "said"), WRONG.values(), ids=WRONG)
def test_what_does_not_fit_is_refused_by_name(table, more, said, tmp_path):
    with pytest.raises(InputError, match=said):
        session(tmp_path, table, more)

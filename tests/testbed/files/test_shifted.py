"""Joints beside the readings, or the names, of other rows: said before anything else is."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.identify.calibrate import calibrate
from testbed.identify.visits.split import split_of_session
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread

JOINTS = tuple(f"q{k}_deg" for k in range(1, 7))


def visits(m=12, times=3):
    """Poses that were visited several times, in rounds of another order each; no shot is alike."""
    rng = np.random.default_rng(0)
    order = np.concatenate([rng.permutation(m) for _ in range(times)])
    own = with_spread(columns(made(3, m), form="quaternion"))
    own = {k: v[order] for k, v in own.items()}
    return own | {k: own[k] + rng.normal(0, 0.01, len(order)) for k in ("x_mm", "y_mm", "z_mm")}


def session(folder, table):
    (folder / "a.csv").write_text(csv(table))
    return read_session(folder / "a.csv", ROBOT)


@pytest.mark.parametrize("shift", [1, -1, 2, -2])
def test_joints_beside_the_names_of_other_poses_are_said_to_be_shifted(shift, tmp_path):
    table = visits()
    session(tmp_path, table)
    moved = table | {k: np.roll(table[k], shift) for k in JOINTS}
    rows = "one row" if abs(shift) == 1 else "2 rows"
    way, back = ("down", "up") if shift > 0 else ("up", "down")
    with pytest.raises(InputError) as caught:
        session(tmp_path, moved)
    assert f"taken from {rows} further {way}, the joints of every pose are the same" in str(
        caught.value
    )
    assert f"move the joints {rows} {back}, beside their pose_id. [M31]" in str(caught.value)


def test_joints_that_are_wrong_in_one_row_are_not_said_to_be_shifted(tmp_path):
    table = visits()
    table["q3_deg"] = table["q3_deg"].copy()
    table["q3_deg"][20] += 1.0
    with pytest.raises(InputError, match=r"has other joints than in line \d+; give it a pose_id"):
        session(tmp_path, table)


def test_shifted_joints_are_named_though_held_out_poses_seem_to_identify(tmp_path):
    """The first held-out row has the joints of the last one that identifies."""
    own = with_spread(columns(made(3, 24), form="quaternion"))
    # visited twice, so that the last pose that identifies has a row that is not held out
    order = np.concatenate([np.arange(12), np.arange(12), np.arange(12, 24)])
    table = {k: v[order] for k, v in own.items()}
    table["x_mm"] = table["x_mm"] + np.random.default_rng(0).normal(0, 0.01, len(order))
    table["pose_id"] = np.arange(len(order))
    moved = {k: (v[:-1] if k in JOINTS else v[1:]) for k, v in table.items()}
    read = session(tmp_path, moved | {"split": ["identify"] * 23 + ["test"] * 12})
    with pytest.raises(InputError, match="at the same joints as a training pose"):
        split_of_session(read, train=None, held_out=None, seed=0)
    with pytest.raises(InputError, match=r"row k-1 belongs to pose k"):
        calibrate(ROBOT, read)


def test_a_value_beyond_a_limit_is_warned_of_and_many_are_refused(tmp_path):
    table = {k: v for k, v in visits().items() if k != "pose_id"}
    table["q3_deg"] = table["q3_deg"].copy()
    table["q3_deg"][[4, 16, 27]] = 500.0
    said = [text for text in session(tmp_path, table).warnings if "limits" in text]
    assert said == [
        f"{tmp_path}/a.csv: 3 joint values lie outside the limits of staubli_tx60, the first is in "
        'line 6: q3_deg = "500"; its limits are -142.5 to 142.5 deg'
    ]
    table["q3_deg"][:] = 500.0
    with pytest.raises(InputError, match=r"17 % of .*; correct these cells, or check the robot"):
        session(tmp_path, table)
    rad = {k.replace("deg", "rad") if k in JOINTS[3:5] else k: v for k, v in visits().items()}
    with pytest.raises(InputError, match=r"if q4, q5 are deg, name the columns q4_deg \.\.\."):
        session(tmp_path, rad)


def test_joints_read_back_far_apart_are_no_visits_of_one_pose(tmp_path):
    data = made(m=60)
    table = with_spread(columns(data)) | {"euler": ["XYZ"] * 60}
    read = {name.replace("_deg", "_read_deg") if name[0] == "q" else name: column
            for name, column in table.items()}  # fmt: skip
    again = read | {"pose_id": np.arange(60) % 10 + 1}
    (tmp_path / "a.csv").write_text(csv(again))
    told = r"a\.csv:12: pose 1 has other joints than in line 2; give it a pose_id of its own"
    with pytest.raises(InputError, match=told):
        read_session(tmp_path / "a.csv", ROBOT)
    # 0.3 deg is what play and a controller may leave, 0.6 deg is not
    for apart, refused in ((0.3, False), (0.6, True)):
        twice = {name: np.repeat(column, 2) for name, column in read.items()}
        twice["q2_read_deg"] = twice["q2_read_deg"] + apart * (np.arange(120) % 2)
        twice["x_mm"] = twice["x_mm"] + 1e-3 * (np.arange(120) % 2)
        (tmp_path / "a.csv").write_text(csv(twice))
        if refused:
            with pytest.raises(InputError, match="pose 1 has other joints than in line 2"):
                read_session(tmp_path / "a.csv", ROBOT)
        else:
            session = read_session(tmp_path / "a.csv", ROBOT)
            assert len(np.unique(session.measurements.pose_id)) == 60

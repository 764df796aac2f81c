"""Tables from arrays at the front door: deviations in every form, visits numbered, poses split."""

from dataclasses import replace

import numpy as np
import pytest

import calib
from calib.errors import InputError

Q = np.arange(12.0).reshape(6, 2)[[0, 1, 2, 0, 1, 0]]
"""Three distinct postures, visited three, two and one times."""


def test_one_deviation_three_or_a_covariance_say_the_same():
    xyz = np.ones((6, 3))
    forms = [2e-5, [2e-5] * 3, np.eye(3) * 4e-10, np.tile(np.eye(3) * 4e-10, (6, 1, 1))]
    tables = [calib.points(Q, xyz, sd=form) for form in forms]
    for table in tables:
        assert table.covariance[:, :3, :3] == pytest.approx(tables[0].covariance[:, :3, :3])
    T = np.tile(np.eye(4), (6, 1, 1))
    full = np.diag([4e-10] * 3 + [9e-10] * 3)
    for form in ([2e-5, 3e-5], [2e-5] * 3 + [3e-5] * 3, full, np.tile(full, (6, 1, 1))):
        assert calib.poses(Q, T, sd=form).covariance == pytest.approx(np.tile(full, (6, 1, 1)))
    each = np.linspace(1e-5, 2e-5, 6)
    assert calib.distances(Q, np.ones(6), sd=each).covariance[:, 0, 0] == pytest.approx(each**2)


def test_rows_at_the_same_joints_are_visits_of_one_pose():
    table = calib.points(Q, np.ones((6, 3)), sd=1e-5)
    assert table.pose_id.tolist() == [0, 1, 2, 0, 1, 0]
    assert table.repeat.tolist() == [0, 0, 0, 1, 1, 2]
    # another reflector seen in the same visit is no further visit
    two = calib.points(Q, np.ones((6, 3)), sd=1e-5, reflector=[0, 0, 0, 1, 1, 1])
    assert two.repeat.tolist() == [0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize("seed", range(5))
def test_a_split_keeps_the_rows_of_a_pose_together(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(30, 3))[rng.integers(0, 30, 90)]
    table = calib.points(q, rng.normal(size=(90, 3)), sd=1e-5)
    # rows that the plan calls one pose stay together too, whatever the encoders read
    table = calib.joined([table, calib.points(q[:9] + 1e-6, np.ones((9, 3)), sd=1e-5,
                                              pose_id=table.pose_id[:9])])  # fmt: skip
    train, test = table.split(held_out=7, seed=seed)
    assert len(train) + len(test) == len(table)
    assert not {row.tobytes() for row in train.q} & {row.tobytes() for row in test.q}
    assert not set(train.pose_id.tolist()) & set(test.pose_id.tolist())
    assert test.n_poses == 7
    again = table.split(held_out=7, seed=seed)[1]
    assert np.array_equal(again.position, test.position)


ONES = np.ones((6, 3))
PLACE = (0.0, 0.0, 0.1)


@pytest.mark.parametrize("name", ["pose_id", "repeat", "reflector", "station", "anchor", "tool"])
@pytest.mark.parametrize(
    ("value", "said"),
    [
        (1.5, r" is 1\.5; every value must be a whole number"),
        ([0, 1, 2, 3, 4, 5.5], r"\[5\] is 5\.5"),
        ([0, 1, np.nan, 3, 4, 5], r"\[2\] is nan"),
        ([0, 1, 2, 3, 4, 1e300], r"\[5\] is 1e\+300"),
        (list("abcdef"), " is not an array of whole numbers"),
        ([0, 1, 2], r" has shape \(3,\); expected one number, or 6|has shape \(3,\)"),
    ],
)
def test_numbers_of_rows_are_whole_or_refused(name, value, said):
    make, seen = (calib.distances, np.ones(6)) if name == "anchor" else (calib.points, ONES)
    with pytest.raises(InputError, match=name + said):
        make(Q, seen, sd=1e-5, **{name: value})
    table = calib.points(Q, ONES, sd=1e-5)
    if np.ndim(value):
        with pytest.raises(InputError, match=name):
            replace(table, **{name: np.array(value)})
    whole = make(Q, seen, sd=1e-5, **{name: np.arange(6.0)})
    assert getattr(whole, name).tolist() == list(range(6))


def test_a_reflector_of_the_fixtures_has_no_second_place():
    for call in (calib.points, calib.distances):
        seen = ONES if call is calib.points else np.ones(6)
        with pytest.raises(InputError, match=r"offset\[0\] of a .* row is \[0.0, 0.0, 0.1\]"):
            call(Q, seen, sd=1e-5, reflector=0, offset=PLACE)
        some = call(Q, seen, sd=1e-5, reflector=[-1] * 5 + [2],
                    offset=[PLACE] * 5 + [(0, 0, 0)])  # fmt: skip
        assert some.reflector.tolist() == [-1] * 5 + [2]
        with pytest.raises(InputError, match=r"offset has shape \(2,\)"):
            call(Q, seen, sd=1e-5, offset=[0.0, 0.1])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: calib.distances(Q, np.ones(6), sd=[1e-5] * 2), r"sd has shape \(2,\)"),
        (lambda: calib.points(Q, np.ones((6, 3)), sd=[1e-5, 1e-5]), r"sd has shape \(2,\)"),
        (lambda: calib.points(Q, np.ones((6, 3)), sd=0.0), "sd is 0.0"),
        (
            lambda: calib.points(Q, np.ones((5, 3)), sd=1e-5),
            r"q has shape \(6, \d\); expected one row for each of 5 readings; give joints and",
        ),
        (
            lambda: calib.points(np.ones((3, 6)), np.ones((6, 3)), sd=1e-5),
            r"q has shape \(3, 6\); expected one row for each of 6 readings; transpose it",
        ),
        (lambda: calib.poses(Q, np.tile(np.eye(4), (6, 1, 1)), sd=1e-5), "two numbers"),
        (lambda: calib.distances(Q, np.ones(6), sd=-1.0), "sd is -1.0"),
        (lambda: calib.points(Q, np.ones((6, 3)), sd=1e-5).split(held_out=3), "1 to 2, of 3 poses"),
        (
            lambda: calib.points(Q, np.ones((6, 3)), sd=1e-5).split(held_out=0.2),
            "held_out is 0.2; expected 1 to 2, of 3 poses; give a number of poses, not",
        ),
    ],
)
def test_what_cannot_be_a_table_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_name_that_is_not_at_the_door_is_missed():
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        calib.calibrat  # noqa: B018 - it raises
    with pytest.raises(AttributeError, match=r"'Robot'; it has RobotModel and CalibratedRobot$"):
        calib.Robot  # noqa: B018 - it raises
    with pytest.raises(AttributeError, match=r"no attribute 'at'$"):
        calib.at  # noqa: B018 - it raises

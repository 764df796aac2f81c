"""Which poses judge: repeats stay together, the draw is repeatable, contradictions are refused."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.measurement.observations import joined
from testbed.identify.splitting import groups, split_of
from tests.calibrated import table_of, true_model
from tests.reference import pool_r

Q = pool_r(40)


def repeated():
    """Forty poses visited twice, not quite alike, and one joint vector that goes by two names."""
    model = true_model()
    first, again = (table_of(model, Q + 1e-3 * k, repeat=k, seed=k) for k in range(2))
    alias = table_of(model, Q[:1], pose_id=np.array([40]))
    return joined([first, again, alias])


def test_rows_of_one_pose_or_one_joint_vector_stay_on_one_side():
    table = repeated()
    split = split_of(table, None, seed=3)
    for own in (table.pose_id, np.unique(table.q, axis=0, return_inverse=True)[1].ravel()):
        for k in np.unique(own):
            assert len(set(split.is_test[own == k])) == 1
    # a pose with another name at the same joints is the same pose: 40 of them, not 41
    assert groups(table).max() == 39
    assert np.array_equal(split.is_train, ~split.is_test)


def test_a_third_is_held_out_or_what_a_radius_needs_and_fifteen_poses_stay():
    """Where too few are left for that, a third at most: 15 of 30 cost accuracy."""
    model = true_model()
    for count, out in ((90, 30), (40, 19), (34, 19), (33, 11), (30, 10), (27, 9), (20, 5), (8, 0)):
        split = split_of(table_of(model, pool_r(count)), None)
        assert int(split.is_test.sum()) == out, count
    assert "nothing tests the result" in split.sentence


def test_the_draw_hangs_on_the_seed_alone_and_is_counted_as_asked():
    table = repeated()
    one, same, other = (split_of(table, None, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.is_test, same.is_test)
    assert not np.array_equal(one.is_test, other.is_test)
    assert len(np.unique(groups(table)[~split_of(table, None, train=25).is_test])) == 25
    assert len(np.unique(groups(table)[split_of(table, None, held_out=7).is_test])) == 7


def test_all_poses_identify_where_that_is_asked_and_nothing_is_proven():
    split = split_of(repeated(), None, held_out=0)
    assert split.is_train.all()
    told = "all 40 poses identify, as --held-out 0 asks: none is held out, so nothing tests the"
    assert split.sentence == f"{told} result"


def test_data_that_hold_out_every_row_are_refused_in_words_of_the_data():
    table = repeated()
    with pytest.raises(InputError, match=r"no row is left to identify from: .* write identify in"):
        split_of(table, np.ones(len(table), dtype=np.bool_))


def test_first_visits_only_leave_later_ones_to_neither_side():
    table = repeated()
    split = split_of(table, None, first_visits=True)
    assert not split.is_train[table.repeat > 0].any()
    assert (~split.is_test & ~split.is_train).sum() == (~split.is_test & (table.repeat > 0)).sum()


def test_a_stated_split_is_kept_as_it_is():
    table = repeated()
    stated = (table.pose_id >= 30) & (table.pose_id < 40)
    split = split_of(table, stated)
    assert split.stated
    assert np.array_equal(split.is_test, stated)


@pytest.mark.parametrize(
    ("options", "stated", "message"),
    [
        ({"train": 40}, False, "--train is 40; expected 1 to 39: the data hold 40 poses. [C41]"),
        (
            {"held_out": -1},
            False,
            "--held-out is -1; expected 0 to 39: the data hold 40 poses. [C41]",
        ),
        (
            {"train": 5, "held_out": 5},
            False,
            "--train and --held-out are both given; give one of them: all other poses go to the "
            "other side. [C41]",
        ),
        ({"seed": -1}, True, "seed is -1; expected a whole number, 0 or larger. [C41]"),
        (
            {"train": 5},
            True,
            "--train is given, but the data say which poses are held out; leave --train out, or "
            "take the split out of the data. [C41]",
        ),
    ],
)
def test_what_does_not_fit_is_refused(options, stated, message):
    table = repeated()
    with pytest.raises(InputError) as caught:
        split_of(table, table.pose_id > 30 if stated else None, **options)
    assert str(caught.value) == message

"""Bad shots against poses that a model misses: virtual arms richer than geometry, and refits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import chdtri
from scipy.stats import ncx2

from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.ladders import NOTHING, Ladder, Level, ladders_of
from calib.identification.levels import joined, prior_of, with_errors
from calib.identification.outliers.bad_shots import bad_shots, foretold, left_out_misses
from calib.identification.outliers.search import search_outliers
from calib.identification.prior import weak_prior
from calib.measurement.prediction import predict
from tests.calib import kinds
from tests.calib.slopes import slopes, twist

TX60 = RobotModel(kinds.ARMS["tx60"])
MDEG = np.radians(1e-3)
SPREAD = np.repeat([kinds.NOISE, kinds.TURN_NOISE], 3)
ROBOTS = 10


def waves(orders):
    """Waves of joints 2 and 3."""
    return tuple(t for t in harmonic_terms(6, orders) if t.joint in (1, 2))


def ladders():
    """Two waves a turn, or eight: what is offered here."""
    few, many = (JointErrors(waves(orders)) for orders in ((1, 2), tuple(range(1, 9))))
    levels = (
        Level(f"{len(each.names)}", each, np.full(len(each.names), 20 * MDEG))
        for each in (few, many)
    )
    return (Ladder("waves", (NOTHING, *levels)),)


def bumpy(rng, size=60 * MDEG, wide=0.25):
    """A TX60 whose joints 2 and 3 err in a narrow range: rounded bumps, as their eight waves."""
    terms, at = waves(tuple(range(1, 9))), rng.uniform(-1, 1, 6)
    order = np.array([max(map(abs, t.weights)) for t in terms])
    share = size * wide * np.sqrt(2 / np.pi) * np.exp(-((order * wide) ** 2) / 2)
    phase = np.array([at[t.joint] for t in terms]) * order
    turned = np.array([t.wave == "sin" for t in terms])
    return RobotModel(
        TX60.chain, JointErrors(terms, share * np.where(turned, np.sin(phase), np.cos(phase)))
    )


@cache
def campaign(seed, planted=0, count=90):
    """Poses of such a robot, some of them shifted by ten standard deviations along every axis."""
    rng = np.random.default_rng([seed, 11])
    table = kinds.poses(bumpy(rng), kinds.joints("tx60", rng, count), rng)
    rows = np.sort(rng.permutation(count)[:planted])
    position = table.position.copy()
    position[rows] += 10 * kinds.NOISE * rng.choice([-1.0, 1.0], (planted, 3))
    return replace(table, position=position), rows


def asked(table):
    """What is called bad, from a fit of geometry that nothing pulls."""
    parameters = parameters_of(TX60)
    near = identify(TX60, table, parameters, loss="cauchy").model
    return bad_shots(TX60, near, table, parameters, ladders=ladders())


def test_good_shots_where_a_joint_errs_are_the_models_fault():
    table, _ = campaign(6)
    first = identify(TX60, table, parameters_of(TX60))
    assert len(search_outliers(TX60, first, table, noise_is_known=False).rows)  # of geometry alone
    found = asked(table)
    assert (len(found.bad), found.too_many) == (0, False)
    assert found.asked == "32"


def test_where_few_poses_confirm_no_model_the_richest_one_speaks_for_a_good_shot():
    found = asked(campaign(1, count=19)[0])
    assert found.asked == ""
    assert (len(found.bad), len(found.sound)) == (0, 1)


def test_bad_shots_are_named_and_nothing_else_is():
    table, rows = campaign(2, 3)
    found = asked(table)
    # 17 standard deviations in all, of which the leverage of 90 poses leaves half at the worst
    assert set(found.bad) == set(rows)
    assert "3 bad" in repr(found)


def test_a_few_wrong_shots_among_several_of_a_pose_are_not_too_many_poses():
    """Four of 90 readings, three of each of 30 poses: more than a tenth of the poses has one."""
    rng = np.random.default_rng(3)
    q = np.repeat(kinds.joints("tx60", rng, 30), 3, axis=0)
    table = kinds.poses(RobotModel(TX60.chain), q, rng)
    rows, position = np.array([4, 20, 47, 81]), table.position.copy()
    position[rows] += 100 * kinds.NOISE
    found = asked(replace(table, position=position, pose_id=np.repeat(np.arange(30), 3)))
    assert (set(found.bad), found.too_many) == (set(rows), False)
    whole = np.arange(12)  # all that is seen of four poses
    position = table.position.copy()
    position[whole] += 100 * kinds.NOISE * rng.normal(size=(12, 3))
    assert asked(replace(table, position=position, pose_id=np.repeat(np.arange(30), 3))).too_many


def test_sound_shots_that_bad_ones_draw_beyond_their_limits_do_not_make_them_too_many():
    """Two of 21 poses: a third one seems to be off as well, until the fit does without them."""
    rng = np.random.default_rng([2, 11])
    table = kinds.poses(bumpy(rng, size=20 * MDEG), kinds.joints("tx60", rng, 21), rng)
    rows, position = np.sort(rng.permutation(21)[:2]), table.position.copy()
    position[rows] += 30 * kinds.NOISE * rng.choice([-1.0, 1.0], (2, 3))
    found = asked(replace(table, position=position))
    assert (set(found.bad), found.too_many) == (set(rows), False)


def test_misses_without_a_row_are_those_of_a_refit_without_it():
    """Every tenth row left out and all identified again, with a prior on all numbers."""
    table, _ = campaign(2)
    table, parameters = table.rows(np.arange(40)), parameters_of(TX60)
    prior = weak_prior(parameters)
    fit = identify(TX60, table, parameters, prior=prior)
    misses, turns = left_out_misses(TX60, fit, table, np.ones(40, dtype=bool))
    for row in range(0, 40, 10):
        used = np.arange(40) != row
        without = identify(TX60, table.rows(used), parameters, prior=prior)
        seen = predict(without.model, table.rows(~used))
        # steps of 0.3 mm and 0.1 deg bend what is linear by 1e-3 of themselves at most
        assert misses[row] == pytest.approx(seen.misses[0], rel=0.01)
        assert turns[row] == pytest.approx(seen.turns[0], rel=0.01)
        _, out = left_out_misses(TX60, without, table, used)
        assert out[row] == pytest.approx(seen.turns[0], rel=1e-12)


def test_what_a_fit_never_saw_is_chi_square():
    rng = np.random.default_rng(5)
    true = bumpy(rng, size=0.0)
    squares = []
    for _ in range(8):
        table = kinds.poses(true, kinds.joints("tx60", rng, 60), rng)
        fit = identify(TX60, table.rows(np.arange(20)), parameters_of(TX60))
        squares.append(foretold(fit, table.rows(np.arange(20, 60))))
    # mean of chi-square with six degrees; rows of one fit share its error: a third of them counts
    spread = np.sqrt(12 / (8 * 40 / 3))
    assert np.mean(squares) == pytest.approx(6.0, abs=3 * spread)
    assert (np.array(squares) > chdtri(6, 0.5)).mean() == pytest.approx(0.5, abs=0.12)


@pytest.mark.study
@pytest.mark.parametrize("bump", [30, 60, 120])
def test_good_shots_are_called_bad_no_more_often_than_promised(bump):
    """With the ladders that are shipped, up to whole joint maps; half a minute for each size.

    Found on 20 robots each: one at 30 mdeg, none at 15, 60 and 120.
    """
    called = 0
    for robot in range(20):
        rng = np.random.default_rng([robot, bump, 12])
        table = kinds.poses(bumpy(rng, bump * MDEG), kinds.joints("tx60", rng, 100), rng)
        parameters = parameters_of(TX60)
        near = identify(TX60, table, parameters, loss="cauchy").model
        called += bool(len(bad_shots(TX60, near, table, parameters, ladders=ladders_of(TX60)).bad))
    # one table in a hundred may have one: three of twenty do once in a thousand studies
    assert called <= 2


def left_open(model, prior, table, rows, others):
    """Whitened covariance (k, 6, 6) of readings at some rows, given all at others.

    A second way: the numbers as a Gaussian process, its columns by differences of poses.
    """
    columns = slopes(
        lambda step: model.moved(step).poses(table.q), np.zeros(model.n_numbers),
        by=[model.names.index(name) for name in prior.names], minus=twist,
    )  # fmt: skip
    A = (columns / np.reshape(SPREAD, (-1, 1))).reshape(-1, columns.shape[2])
    K = A @ np.linalg.inv(prior.precision) @ A.T + np.eye(len(A))
    at, to = (np.ravel(6 * each[:, None] + np.arange(6)) for each in (rows, others))
    V = K[np.ix_(at, at)] - K[np.ix_(at, to)] @ np.linalg.solve(
        K[np.ix_(to, to)], K[np.ix_(to, at)]
    )
    return [V[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(len(rows))]


@pytest.mark.study
@pytest.mark.parametrize(("bump", "size"), [(60, 10), (60, 14), (0, 10)])
def test_bad_shots_are_named_as_often_as_their_leverage_allows(bump, size):
    """Three of 70 poses, shifted by so many standard deviations in all, whole joint maps offered.

    Named, and foretold, in %, ten robots each, a share scatters by 8: bumps of 60 mdeg, 10 sd, 73
    and 81, ten robots more 63 and 70; 14 sd, 90 and 95; none, 10 sd, 63 and 75. No other is named.
    A limit that 1 % of sound tables pass is at 29 for six numbers; where a map of each joint
    follows a single pose, 10 sd leave less than that. What is missing below the foretold share was
    hidden by its neighbors: the foretold one knows which rows are sound.
    """
    planted, named, power, ladders = 0, 0, 0.0, ladders_of(TX60)
    for robot in range(ROBOTS):
        rng = np.random.default_rng([robot, bump, size, 13])
        table = kinds.poses(bumpy(rng, bump * MDEG), kinds.joints("tx60", rng, 70), rng)
        rows, way = np.sort(rng.permutation(70)[:3]), rng.normal(size=(3, 3))
        shift = size * way / np.linalg.norm(way, axis=1)[:, None]
        position = table.position.copy()
        position[rows] += kinds.NOISE * shift
        parameters, table = parameters_of(TX60), replace(table, position=position)
        near = identify(TX60, table, parameters, loss="cauchy").model
        found = bad_shots(TX60, near, table, parameters, ladders=ladders)
        assert set(found.bad) <= set(rows), robot
        named, planted = named + len(found.bad), planted + 3
        others = np.setdiff1d(np.arange(70), rows)
        richest = [ladder.levels[-1] for ladder in ladders]
        prior = weak_prior(parameters).joined(prior_of(richest))
        wide = with_errors(TX60, joined(richest))
        V = left_open(wide, prior, table, rows, others)
        of_all = np.column_stack([shift, np.zeros((3, 3))])
        far = [d @ np.linalg.solve(v, d) for d, v in zip(of_all, V, strict=True)]
        power += ncx2.sf(chdtri(6, 0.01 / 70), 6, far).sum()
    print(f"\nbumps {bump}, {size} sd: {named / planted:.3f} named, {power / planted:.3f} foretold")  # noqa: T201  # figures of a study
    assert abs(named - power) < 3 * np.sqrt(planted) / 2

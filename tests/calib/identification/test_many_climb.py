"""The climb of many robots at once, held to each one's own and to densities written out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from calib.errors import InputError
from calib.geometry.frames import log_so3, right_jacobian_inverse
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climb import climb
from calib.identification.evidence.spring_products import ModelSprings, settled
from calib.identification.folds import parts_of
from calib.identification.ladders import ladders_of
from calib.identification.levels import NOTHING, with_errors
from calib.identification.many import climb as many_climb
from calib.identification.many import climber
from calib.identification.many.climb import climb_many
from calib.identification.many.climb_plan import plan_of
from calib.identification.many.settle import settled_many
from calib.identification.many.single import identify_many
from calib.identification.prior import Prior, weak_prior
from calib.kernels.loops import MANY_SPRUNG
from calib.measurement.residual import linearize, table_whiteners
from tests.calib import kinds
from tests.reference import rigid_truth, tx60

TX60 = tx60()
FREE = parameters_of(TX60)
PRIOR = weak_prior(FREE)
ALL = ladders_of(TX60)
SHORT = ("springs and bearings", "sag and bearings on", "springs on", "waves 1 to 4")
LADDERS = tuple(
    replace(one, levels=tuple(level for level in one.levels if not level.name.startswith(SHORT)))
    for one in ALL
)
"""Without the levels of most numbers."""
POSES = 21


def bent(rng, ladder, name, size):
    """A robot with the joint errors of a level, `size` times as large as they are believed."""
    level = next(one for one in ALL[ladder].levels if one.name == name)
    wide = with_errors(rigid_truth(rng), level.errors)
    step = np.zeros(wide.n_numbers)
    step[42:] = size * level.sd * rng.normal(size=len(level.sd))
    return wide.moved(step)


def visits(noise=1.0, seed=5):
    """Tables of one plan: of a rigid arm, of one with waves, on springs, and of any turns."""
    rng = np.random.default_rng(seed)
    q, fast = kinds.joints("tx60", rng, POSES), harmonic_terms(6, tuple(range(3, 20)))
    true = [
        rigid_truth(rng),
        bent(rng, 1, "small waves", 3.0),
        bent(rng, 0, "springs", 1.0),
        RobotModel(rigid_truth(rng).chain, JointErrors(fast, rng.normal(size=len(fast)) * 5e-5)),
    ]
    tables = [kinds.poses(one, q, rng) for one in true]
    return [replace(table, covariance=table.covariance / noise**2) for table in tables]


def fitted(tables):
    return [one.model for one in identify_many(TX60, tables, FREE, prior=PRIOR)]


@cache
def seen(noise, first, last):
    """Some of the visits, the fits of their geometry, and the climb of each made alone."""
    tables = visits(noise)[first:last]
    near = fitted(tables)
    return tables, near, one_by_one(near, tables)


def one_by_one(near, tables, ladders=LADDERS):
    return [
        climb(
            TX60, model, table, FREE, ladders, parts_of(table, np.random.default_rng(0)),
            prior=PRIOR,
        )
        for model, table in zip(near, tables, strict=True)
    ]  # fmt: skip


def held_to(one, alone, q):
    """Every figure of a climb against that of the climb made alone.

    Both leave springs where a step promises less than 1e-6 of the loss, after the same steps; what
    rounding leaves of evidences of some thousands is 1e-8.
    """
    assert [level.name for level in one.levels] == [level.name for level in alone.levels]
    for step, other in zip(one.steps, alone.steps, strict=True):
        assert (step.ladder, step.level, step.taken) == (other.ladder, other.level, other.taken)
        assert step.gain == pytest.approx(other.gain, rel=1e-9, abs=1e-8)
        assert [step.before, step.after] == pytest.approx([other.before, other.after], rel=1e-9)
    assert one.gain == pytest.approx(alone.gain, rel=1e-9, abs=1e-8)
    assert one.best[0] == alone.best[0]
    assert one.best[1] == pytest.approx(alone.best[1], rel=1e-9, abs=1e-8)
    assert one.noise_factor == pytest.approx(alone.noise_factor, rel=1e-9)
    assert [one.before, one.after] == pytest.approx([alone.before, alone.after], rel=1e-9)
    assert one.poses == alone.poses
    # a thousandth of a standard deviation at most, of micrometers
    gap = one.near.poses(q) - alone.near.poses(q)
    assert np.abs(gap).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "some", "robots"), [(1.0, (0, 4), 4), (3.0, (1, 3), 2), (1.0, (0, 4), MANY_SPRUNG)]
)
def test_each_climbs_as_it_does_alone(noise, some, robots, monkeypatch):
    """Of four arms; where the noise is larger than stated and has to be found; by loops of many."""
    monkeypatch.setattr(many_climb, "FEW_PRODUCTS", 60)  # springs with free moments by rows
    tables, near, alone = seen(noise, *some)
    found = climb_many(TX60, near, tables, FREE, LADDERS, prior=PRIOR, robots=robots)
    for one, other in zip(found, alone, strict=True):
        held_to(one, other, tables[0].q)
    assert len({level.name for one in found for level in one.taken}) > 1
    assert max(one.noise_factor for one in found) > (1.5 if noise > 1 else 0.9)
    # what a report says of levels that nobody asked for
    for offer, other in zip(found[0].offered, alone[0].offered, strict=True):
        assert replace(offer, gain=0.0) == replace(other, gain=0.0)
        assert offer.gain == pytest.approx(other.gain, rel=1e-9, abs=1e-8, nan_ok=True)


def test_what_only_a_report_asks_for_is_worked_out_when_it_does():
    tables = visits()[1:2]
    near = fitted(tables)
    (found,) = climb_many(TX60, near, tables, FREE, LADDERS, prior=PRIOR)
    (alone,) = one_by_one(near, tables)
    assert found.taken
    assert [offer.outcome for offer in found.offered] == [one.outcome for one in alone.offered]
    gains = [[offer.gain for offer in one.offered] for one in (found, alone)]
    np.testing.assert_allclose(*gains, rtol=1e-9, atol=1e-8)
    q = tables[0].q
    np.testing.assert_array_equal(found.richest().poses(q), alone.richest().poses(q))


def test_an_arm_with_a_slide_climbs_as_well():
    rng = np.random.default_rng(8)
    nominal = RobotModel(kinds.ARMS["scara"])
    free, ladders = parameters_of(nominal), ladders_of(nominal)
    prior, q = weak_prior(free, nominal), kinds.joints("scara", rng, POSES)
    level = ladders[0].levels[2]
    wide = with_errors(nominal, level.errors)
    step = np.append(prior.sd * rng.normal(size=free.n_free) / 10, 3 * level.sd)
    tables = [kinds.poses(true, q, rng) for true in (nominal, wide.moved(step))]
    near = [one.model for one in identify_many(nominal, tables, free, prior=prior)]
    found = climb_many(nominal, near, tables, free, ladders, prior=prior)
    assert any(level.errors.springs for level in found[1].taken)
    for one, model, table in zip(found, near, tables, strict=True):
        part = parts_of(table, np.random.default_rng(0))
        held_to(one, climb(nominal, model, table, free, ladders, part, prior=prior), q)


def test_with_too_few_poses_to_confirm_anything_nothing_is_taken():
    tables = [table.rows(np.arange(16)) for table in visits()[1:3]]
    near = fitted(tables)
    found = climb_many(TX60, near, tables, FREE, LADDERS, prior=PRIOR)
    for one, other in zip(found, one_by_one(near, tables), strict=True):
        assert one.steps
        assert not one.taken
        assert [step.level for step in one.steps] == [step.level for step in other.steps]
        assert [offer.outcome for offer in one.offered] == [each.outcome for each in other.offered]
        gains = [[offer.gain for offer in each.offered] for each in (one, other)]
        np.testing.assert_allclose(*gains, rtol=1e-9, atol=1e-8)


def test_no_bit_hangs_on_who_climbs_beside():
    tables = visits()[:3]
    near = fitted(tables)
    every = climb_many(TX60, near, tables, FREE, LADDERS, prior=PRIOR)
    some = climb_many(TX60, near[1:3], tables[1:3], FREE, LADDERS, prior=PRIOR)
    for one, again in zip(every[1:3], some, strict=True):
        assert (one.gain, one.after, one.steps) == (again.gain, again.after, again.steps)
        np.testing.assert_array_equal(one.near.poses(tables[0].q), again.near.poses(tables[0].q))


def test_where_rounding_may_decide_a_robot_climbs_by_itself(monkeypatch):
    tables = visits()[1:2]
    near = fitted(tables)
    alone = one_by_one(near, tables)
    monkeypatch.setattr(many_climb, "SURE", np.inf)
    for one, other in zip(
        climb_many(TX60, near, tables, FREE, LADDERS, prior=PRIOR), alone, strict=True
    ):
        assert (one.gain, one.steps) == (other.gain, other.steps)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["mean", "joints", "payload", "visits"])
def test_what_arrays_do_not_know_is_left_to_each(what):
    tables, ladders = visits()[:2], LADDERS[1:]
    if what == "mean":
        waves = ladders[0]
        levels = [replace(one, mean=np.full(len(one.sd), 1e-5)) for one in waves.levels[1:3]]
        ladders = (replace(waves, levels=(NOTHING, *levels)),)
    elif what == "joints":
        tables[1] = replace(tables[1], q=tables[1].q + 1e-3)
    elif what == "visits":  # rows that are one pose are left out together
        tables[1] = replace(tables[1], pose_id=np.maximum(tables[1].pose_id, 1))
    else:
        said = replace(tables[0].conditions, payload=np.ones(POSES))
        tables = [replace(table, conditions=said) for table in tables]
    near = fitted(tables)
    found = climb_many(TX60, near, tables, FREE, ladders, prior=PRIOR)
    for one, other in zip(found, one_by_one(near, tables, ladders), strict=True):
        assert (one.gain, one.steps) == (other.gain, other.steps)


def test_two_ladders_of_springs_are_refused_as_for_one():
    tables, ladder = visits()[:1], LADDERS[0]
    with pytest.raises(InputError, match="both joint errors have springs"):
        climb_many(TX60, fitted(tables), tables, FREE, (ladder, ladder), prior=PRIOR)


def test_numbers_of_springs_that_are_learned_count_for_the_noise():
    """With many rows and few numbers their number tells: here seven of 360 less 49."""
    rng = np.random.default_rng(6)
    level = next(one for one in ALL[0].levels if one.name == "sag by torques on a tilted base")
    q, wide = kinds.joints("tx60", rng, 60), with_errors(rigid_truth(rng), level.errors)
    step = np.zeros(wide.n_numbers)
    step[42:] = level.sd * rng.normal(size=len(level.sd))
    table = kinds.poses(wide.moved(step), q, rng)
    table = replace(table, covariance=table.covariance / 4)
    near = fitted([table])
    ladder = replace(ALL[0], levels=(NOTHING, ALL[0].levels[2], level))
    (found,) = climb_many(TX60, near, [table], FREE, [ladder], prior=PRIOR)
    (alone,) = one_by_one(near, [table], [ladder])
    # two times, to 4 % in a standard deviation of 310 rows
    assert found.noise_factor == pytest.approx(2.0, rel=0.15)
    held_to(found, alone, q)


@pytest.mark.parametrize("arm", ["tx60", "iiwa", "scara"])
def test_rows_and_bends_of_many_are_those_of_each(arm):
    """Of robots that stand anywhere, some with slides, against the derivatives of one robot."""
    rng = np.random.default_rng(3)
    nominal = RobotModel(kinds.ARMS[arm])
    free = parameters_of(nominal)
    true = [replace(kinds.true_robot(arm, rng), fixtures=nominal.fixtures) for _ in range(2)]
    q = kinds.joints(arm, rng, 5)
    tables = [kinds.poses(one, q, rng) for one in true]
    models = many_climb.ManyModels.each(nominal, true)
    rows = many_climb.ClimbRows.of(models, many_climb.ManyTables.of(tables), free.free_index)
    for k, (one, table) in enumerate(zip(true, tables, strict=True)):
        own = linearize(one, table)
        np.testing.assert_allclose(rows.r[k], own.r, rtol=0, atol=1e-8)
        size = np.abs(own.A).max()
        np.testing.assert_allclose(rows.geometry[k].T, own.A, rtol=0, atol=1e-12 * size)
        T, _, bends = one.poses_and_bends(q)
        e = log_so3(table.rotation @ np.swapaxes(T[:, :3, :3], 1, 2))
        bends[:, 3:] = right_jacobian_inverse(e) @ bends[:, 3:]
        wide = (table_whiteners(table) @ bends).reshape(len(own.r), -1)
        np.testing.assert_allclose(rows.bends[k].T, wide, rtol=0, atol=1e-12 * size)


def tight(table):
    """A climber near the nominal arm with beliefs so narrow that densities can be written out."""
    prior = Prior(PRIOR.mean, 1e-2 * PRIOR.sd, PRIOR.names)
    ladders = tuple(
        replace(one, levels=tuple(replace(level, sd=0.05 * level.sd) for level in one.levels))
        for one in ALL
    )
    plan = plan_of(TX60, [table], FREE, ladders, prior)
    rows = many_climb.ClimbRows.of(
        many_climb.ManyModels.of(TX60, 1), many_climb.ManyTables.of([table]), FREE.free_index
    )
    (robot,) = many_climb.robots_of(plan, rows, np.zeros((1, 42)))
    return robot, prior, {level.name: level for one in ladders for level in one.levels}


def test_springs_are_cut_short_only_where_no_noise_beyond_the_stated_one_can_be_found(monkeypatch):
    """From a noise that is too large the way back is followed to its end."""
    tables = visits(3.0)[2:3]
    plan = plan_of(TX60, tables, FREE, ALL, PRIOR)
    models = many_climb.ManyModels.each(TX60, fitted(tables))
    rows = many_climb.ClimbRows.of(models, many_climb.ManyTables.of(tables), FREE.free_index)
    (robot,) = many_climb.robots_of(plan, rows, models.steps())
    levels = tuple(ladder.levels[-1] for ladder in ALL)
    found = robot.at_noise(6.0).noise(levels)
    monkeypatch.setattr(climber, "FAR_BELOW", 0.0)
    assert found == robot.at_noise(6.0).noise(levels) > 1.0


def columns(level, table):
    """Whitened columns (6 m, k) of the numbers of a level at the nominal arm."""
    return linearize(with_errors(TX60, level.errors), table).A[:, 42:]


@pytest.mark.parametrize(
    "names",
    [("none", "small waves"), ("sag", "waves 1 to 4"), ("none", "joint map"),
     ("sag and bearings", "joint map with small waves")],
)  # fmt: skip
def test_evidence_and_misses_are_those_of_normal_densities(names):
    """All written out: one covariance of all rows, with noise and prior of every number."""
    table = kinds.poses(TX60, kinds.joints("tx60", np.random.default_rng(2), POSES),
                        np.random.default_rng(3))  # fmt: skip
    robot, prior, known = tight(table)
    levels = tuple(known[name] for name in names)
    J = linearize(TX60, table)
    B = [J.A[:, FREE.free_index] * prior.sd]
    plain = np.eye(len(J.r)) + B[0] @ B[0].T
    B += [columns(level, table) * level.sd for level in levels if level.names]
    C = np.eye(len(J.r)) + sum(b @ b.T for b in B)
    many_climb.fit_all(robot.tasks(levels, False))
    many_climb.fit_all(robot.tasks(levels, True))
    bare = (known["none"], known["none"])
    gain = robot.evidence(levels) - robot.evidence(bare)
    zero = np.zeros(len(C))
    density = [multivariate_normal.logpdf(J.r, zero, each) for each in (C, plain)]
    assert gain == pytest.approx(density[0] - density[1], abs=1e-7)
    # what the other poses say of those left out
    part = parts_of(table, np.random.default_rng(0))
    away = np.zeros(POSES)
    for k in range(4):
        out = np.repeat(part == k, 6)
        said = C[np.ix_(out, ~out)] @ np.linalg.solve(C[np.ix_(~out, ~out)], J.r[~out])
        W = table_whiteners(table)[part == k]
        left = np.linalg.solve(W, (J.r[out] - said).reshape(-1, 6, 1))[:, :3, 0]
        away[part == k] = np.linalg.norm(left, axis=1)
    np.testing.assert_allclose(robot.missed(levels), away, rtol=1e-8)


@pytest.mark.parametrize(("p", "f"), [(1, 0), (3, 2), (4, 7)])
def test_springs_of_many_end_where_each_ends(p, f):
    rng = np.random.default_rng(p)
    springs = ModelSprings(
        np.arange(p * (1 + f)), rng.uniform(1, 3, p), f, rng.uniform(0.5, 2, p + f)
    )
    A = rng.normal(size=(9, 3 * p * (1 + f), p * (1 + f)))
    normal = A.swapaxes(1, 2) @ A * np.geomspace(0.01, 10, 9)[:, None, None]
    pull = 30 * rng.normal(size=(9, p * (1 + f)))
    found = settled_many(springs, normal, pull)
    for k in range(9):
        one = settled(springs, normal[k], pull[k])
        np.testing.assert_allclose(found.numbers[k], one.numbers, rtol=1e-7, atol=1e-9)
        assert [found.loss[k], found.spread[k]] == pytest.approx([one.loss, one.spread], rel=1e-10)
    some = settled_many(springs, normal[4:6], pull[4:6])
    np.testing.assert_array_equal(some.numbers, found.numbers[4:6])

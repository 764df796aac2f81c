"""Poses that no free way leads to: the plan is made anew without them."""

from types import SimpleNamespace

import numpy as np
import pytest

from calib.errors import refuse
from testbed.laboratory.route import moves
from testbed.laboratory.route.moves import Mover
from testbed.plan.plan import plan
from testbed.plan.reached import ANEW, CUT_OFF, Made, elsewhere, reached
from testbed.plan.report import plan_report_html
from testbed.plan.results import plan_numbers
from tests.planned import QUICK, ROBOT, few_rehearsals, quick_plan, scenario


@pytest.fixture
def wall(monkeypatch):
    """Where a wall stands that no move of joint 1 gets past: few poses lie behind it [rad]."""
    wall = float(np.quantile(quick_plan().tour.q[:, 0], 0.8))
    is_free = Mover.is_free

    def not_past(self, here, there):
        return (here[0] < wall) == (there[0] < wall) and is_free(self, here, there)

    monkeypatch.setattr(Mover, "is_free", not_past)
    monkeypatch.setattr(moves, "NODES", 50)
    return wall


@pytest.mark.slow
def test_no_pose_of_a_plan_lies_where_no_way_leads(wall):
    with few_rehearsals():
        made = plan(scenario(QUICK))
    tour, pool = made.tour, made.pool
    assert (quick_plan().tour.q[:, 0] > wall).any()
    assert (np.append(tour.q[:, 0], tour.start[0]) < wall).all()
    assert (quick_plan().pool.q[:, 0] > wall).sum() > 2
    assert not tour.blocked
    assert len(tour) == len(quick_plan().tour)
    refused = int(pool.rejection_counts[pool.rejection_names.index(CUT_OFF)])
    assert refused > 0
    assert len(pool.q) == len(pool.T) == QUICK["pool.size"] - refused
    assert pool.n_drawn == len(pool.q) + pool.rejection_counts.sum()
    np.testing.assert_allclose(ROBOT.model.poses(pool.q), pool.T, atol=1e-12)
    chosen = tour.pool_place >= 0
    np.testing.assert_array_equal(tour.q[chosen], pool.q[tour.pool_place[chosen]])
    assert plan_numbers(made, ROBOT)["candidates"]["rejected"][CUT_OFF] == refused
    assert f"{refused} {CUT_OFF}" in plan_report_html(made, ROBOT, versions={})


def nothing(q, known):
    """No posture lies beside another."""
    return np.zeros(len(q), dtype=bool)


def tried(cut_off, refused=False):
    """A first plan and its last one, poses of tours being cut off by turns, and how many were."""
    plans = []

    def made(pool, lost):
        if plans and refused:
            raise refuse("pool", code="M27", message="too few")
        cut = cut_off(len(plans))
        tour = Six(q=pool.q[:6], pool_place=np.arange(6), cut_off=cut)
        plans.append(Made(pool, lost, None, None, "", None, tour))
        return plans[-1]

    return reached(made, quick_plan().pool, nothing), plans


class Six(SimpleNamespace):
    """A tour of six poses, the first ones of its pool."""

    def __len__(self):
        return 6


def test_it_ends_where_there_is_no_end_of_such_poses_and_as_it_began():
    found, plans = tried(lambda _: (0,))
    assert len(plans) == ANEW + 1
    assert found is plans[0]
    # of each plan one pose more was lost
    assert [len(one.apart) for one in plans] == [*range(ANEW + 1)]


def test_where_most_poses_are_cut_off_it_is_the_start():
    found, plans = tried(lambda _: (0, 1, 2, 3))
    assert len(plans) == 1
    assert found is plans[0]


def test_where_too_few_others_are_left_the_first_plan_stays():
    found, plans = tried(lambda _: (0,), refused=True)
    assert len(plans) == 1
    assert found is plans[0]


def test_the_first_plan_that_is_reached_is_taken():
    found, plans = tried(lambda k: (2, 5) if k < 2 else ())
    assert found is plans[-1]
    assert len(plans) == 3
    assert len(found.pool.q) == QUICK["pool.size"] - 4
    assert not (found.pool.q[:, None] == found.apart).all(axis=2).any()


def test_held_out_poses_beside_those_that_are_lost_are_drawn_anew():
    pool, told = np.arange(10.0)[:, None], []

    def draw(lost):
        told.append(lost[:, 0].tolist())
        return pool[~np.isin(pool, lost)][:4, None]

    def above_five(q, known):
        assert known.min() >= 0
        return (q[:, 0] < 5) & (q[:, 0] != 1)

    kept = elsewhere(draw, np.array([[0.0]]), above_five)
    assert kept[:, 0].tolist() == [1, 5, 6, 7]
    assert told == [[0], [0, 2, 3, 4]]
    # nobody asks before a pose is lost
    told.clear()
    assert elsewhere(draw, np.zeros((0, 1)), above_five)[:, 0].tolist() == [0, 1, 2, 3]
    assert told == [[]]

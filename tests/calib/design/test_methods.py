"""What all ways of choosing poses share: one problem, checked once, and one kind of result."""

from functools import cache

import numpy as np
import pytest
from scipy import linalg

import calib.design
from calib.design import METHODS, Problem, random_set
from calib.design.blocks import information
from calib.errors import InputError
from calib.information.criteria.named import criterion_named
from tests.calib.design.design_cases import goal_set, small_criterion, small_pool, whitened_pool
from tests.reference import READABLE30, SIGMA_POSITION, SIGMA_ROTATION, pool_r, tx60

ALL = ("D", "A", "V", "G", "E", "O1", "O2", "O3", "O4", "O5")
CONVEX = ("D", "A", "V", "G", "E", "O1", "O3")


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("method", METHODS)
def test_a_selection_is_a_set_its_value_is_fresh_and_its_proof_is_said(method: str, name: str):
    blocks, criterion = small_pool(11, 16), small_criterion(name)
    known = {"prior": np.diag([0.1, 0.2, 0.3, 0.4, 0.5]), "given": (2, 7)}
    found = METHODS[method](
        Problem.of_blocks(blocks, 6, criterion, **known), np.random.default_rng(3)
    )
    assert found.method == method
    assert found.criterion == name
    assert len(set(found.indices.tolist()) - {2, 7}) == 6
    assert found.given.tolist() == [2, 7]
    assert found.prior
    M = known["prior"] + information(blocks[[2, 7]]) + information(blocks[found.indices])
    # indices come from singular values, others from M: condition below 1e4
    assert found.value == pytest.approx(criterion.figure(M, 8), rel=1e-9)
    if name in CONVEX:
        assert 0 < found.certificate.efficiency <= 1
        assert found.certificate.figure == pytest.approx(found.value, rel=1e-9)
        assert "efficiency at least" in found.proof
    else:
        assert found.certificate is None
        assert found.proof.startswith("no certificate: no bound")


@pytest.mark.usefixtures("uncertified")
@pytest.mark.parametrize("name", ["D", "G"])
@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_gives_the_same_set_and_the_order_of_the_pool_is_no_matter(
    method: str, name: str
):
    blocks, criterion, run = small_pool(5, 14), small_criterion(name), METHODS[method]
    first, again = (
        run(Problem.of_blocks(blocks, 5, criterion), np.random.default_rng(8)) for _ in range(2)
    )
    np.testing.assert_array_equal(first.indices, again.indices)
    np.testing.assert_array_equal(first.trace, again.trace)
    if method == "greedy":
        order = np.random.default_rng(0).permutation(14)
        shuffled = run(Problem.of_blocks(blocks[order], 5, criterion), np.random.default_rng(8))
        np.testing.assert_array_equal(order[shuffled.indices], first.indices)


@pytest.mark.usefixtures("uncertified")
@pytest.mark.parametrize("method", METHODS)
def test_a_pose_comes_twice_only_if_asked(method: str):
    blocks, run = small_pool(2, 4), METHODS[method]
    once = run(Problem.of_blocks(blocks, 4, "D"), np.random.default_rng(0))
    assert sorted(once.indices.tolist()) == [0, 1, 2, 3]
    often = run(Problem.of_blocks(blocks, 9, "D", repeats=True), np.random.default_rng(0))
    assert len(often) == 9
    with pytest.raises(InputError, match="9 poses wanted; the pool has 4"):
        run(Problem.of_blocks(blocks, 9, "D"), np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["greedy", "detmax", "fedorov", "exchange"])
@pytest.mark.parametrize("name", ["D", "E"])
def test_every_search_is_far_better_than_a_random_set(method: str, name: str):
    blocks, criterion = whitened_pool(100), small_criterion(name, 24)
    found = METHODS[method](
        Problem.of_blocks(blocks, 12, criterion), np.random.default_rng(0)
    ).certificate
    assert found.efficiency > of_a_random_set(name) + 0.03


@cache
def of_a_random_set(name: str) -> float:
    """What is certain of it."""
    problem = Problem.of_blocks(whitened_pool(100), 12, small_criterion(name, 24))
    return random_set(problem, np.random.default_rng(0)).certificate.efficiency


@pytest.mark.usefixtures("uncertified")
@pytest.mark.parametrize("method", METHODS)
def test_a_prior_too_weak_to_count_beside_one_pose_breaks_nothing(method: str):
    blocks = small_pool(0)
    options = {"prior": 1e-17 * np.eye(5)}
    found = METHODS[method](Problem.of_blocks(blocks, 4, "D", **options), np.random.default_rng(0))
    alone = METHODS[method](Problem.of_blocks(blocks, 4, "D"), np.random.default_rng(0))
    assert found.value == pytest.approx(alone.value, rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_poses_that_see_nothing_do_not_raise_the_number_needed(method: str):
    blocks = np.concatenate([np.zeros((1, 2, 5)), small_pool(0, 8)])
    found = METHODS[method](Problem.of_blocks(blocks, 3, "D"), np.random.default_rng(1))
    assert found.value > 0 or method == "random"


NAMES = ("theta1", "d1", "a1", "alpha1", "theta2")


@pytest.mark.parametrize(
    ("m", "change", "options", "says"),
    [
        (13, None, {}, "13 poses wanted; the pool has 12; enlarge the pool"),
        (0, None, {}, "0 poses wanted; expected a whole number, at least 1"),
        (5.5, None, {}, r"5\.5 poses wanted; expected a whole number"),
        (2, None, {"names": NAMES}, "2 leave at least 1 directions unseen, such as: 5 numbers"),
        (5, "nan", {}, r"blocks\[7, 1, 2\] is nan"),
        (5, "flat", {}, r"blocks has shape \(12, 10\)"),
        (5, "none", {}, r"blocks has shape \(0, 2, 5\)"),
        (5, "blind", {"names": NAMES}, "alpha1 has no effect on anything measured"),
        (5, "linked", {"names": NAMES}, "d1 and alpha1 cannot be told apart"),
        (5, None, {"given": (3, 3)}, "pose 3 is given 2 times"),
        (5, None, {"given": (12,)}, "given is not a list of places"),
        (5, None, {"given": (0.5,)}, "given is not a list of places"),
        (5, None, {"given": ("first",)}, "given is not a list of places"),
        (5, None, {"allowed": [True, False]}, "true or false for each of 12"),
        (5, None, {"allowed": np.zeros(12, dtype=bool)}, "of which 0 may be chosen"),
        (5, None, {"prior": np.diag([1.0, 1, 1, 1, -1])}, "not a precision matrix"),
        (5, None, {"prior": np.eye(4)}, r"prior has shape \(4, 4\)"),
        (5, None, {"prior": np.full((5, 5), np.inf)}, "is inf"),
        (5, None, {"names": ("x", "y")}, "2 names; one for each of 5"),
        (5, "goal", {}, "the goal is made for 4 numbers; the blocks have 5"),
        (5, "name", {}, 'criterion is "Q"'),
        (5, "V", {}, 'criterion "V" needs goal poses'),
    ],
)
def test_what_cannot_be_chosen_is_refused(m, change, options, says: str):
    blocks, criterion = small_pool(0), "D"
    if change == "nan":
        blocks[7, 1, 2] = np.nan
    if change == "flat":
        blocks = blocks.reshape(12, 10)
    if change == "none":
        blocks = blocks[:0]
    if change in ("blind", "linked"):
        blocks[:, :, 3] = 2 * blocks[:, :, 1] if change == "linked" else 0.0
    if change in ("goal", "name", "V"):
        criterion = {"goal": small_criterion("V", 4), "name": "Q", "V": "V"}[change]
    with pytest.raises(InputError, match=says):
        Problem.of_blocks(blocks, m, criterion, **options)


def test_a_problem_of_poses_is_that_of_their_blocks_and_of_what_they_tell_apart():
    model, q, goal_q = tx60(), pool_r()[:150], pool_r(2000, 99)[:50]
    noise = np.diag([SIGMA_POSITION**2] * 3 + [SIGMA_ROTATION**2] * 3)
    one = Problem.of_poses(model, q, poses=12, criterion="V", goals=goal_q, noise=noise)
    assert one.names == READABLE30
    goal = criterion_named("V", goals=goal_set(READABLE30, 50))
    other = Problem.of_blocks(whitened_pool(150, READABLE30), 12, goal)
    np.testing.assert_allclose(one.blocks, other.blocks, rtol=1e-12, atol=1e-9)
    assert one.criterion.figure(one.information(range(12)), 12) == pytest.approx(
        goal.figure(other.information(range(12)), 12), rel=1e-9
    )
    assert repr(one) == "Problem(12 of 150 poses, 30 numbers, by V)"


def test_goals_that_move_with_what_no_pose_of_the_pool_shows_are_refused():
    """A joint that stands still in the pool, and not at the goal: links there would count as known.

    That the tool moves at the goal and at no pose of the pool is seen by moving the model itself.
    """
    model, goal_q = tx60(), pool_r(60)[40:]
    still = np.where(np.arange(6) == 3, 0.3, pool_r(60)[:40])
    # as commanded, and as rounded to a tenth of a millidegree in a log
    rounded = still + 1e-6 * np.outer(np.sin(np.arange(40)), np.eye(6)[3])
    for q in (still, rounded):
        with pytest.raises(InputError, match=r"d5, .* no pose of the pool shows it"):
            Problem.of_poses(model, q, poses=20, criterion="V", goals=goal_q)
    (_, at_pool), (_, at_goal) = (model.poses_and_jacobian(q) for q in (still, goal_q))
    hidden = linalg.null_space(at_pool.reshape(-1, 42))
    step = 1e-6 * hidden @ np.linalg.svd(at_goal[:, :3].reshape(-1, 42) @ hidden)[2][0]
    off_pool, off_goal = (
        np.abs(model.moved(step).poses(q) - model.poses(q))[:, :3, 3].max() for q in (still, goal_q)
    )
    assert off_pool < 1e-4 * off_goal
    # where the goal keeps the joint still as well, or what is free is named, it is no matter
    alike = np.where(np.arange(6) == 3, 0.3, goal_q)
    problem = Problem.of_poses(model, still, poses=20, criterion="V", goals=alike)
    named = Problem.of_poses(
        model, still, poses=20, criterion="V", goals=goal_q, free=problem.names
    )
    assert problem.names == named.names


def test_where_only_points_are_measured_the_turn_of_the_tool_is_no_number():
    problem = Problem.of_poses(tx60(), pool_r()[:60], poses=15, noise=np.eye(3) * 1e-10)
    # two more than the three turns are lost: the tool point lies on the last axis
    assert problem.blocks.shape == (60, 3, 25)
    assert not {"tool.rx", "tool.ry", "tool.rz"} & set(problem.names)
    alike = Problem.of_poses(tx60(), pool_r()[:60], poses=15, noise=1e-5)
    np.testing.assert_allclose(alike.blocks, problem.blocks, rtol=1e-12)
    with pytest.raises(InputError, match=r"noise has shape \(2, 2\)"):
        Problem.of_poses(tx60(), pool_r()[:60], poses=15, noise=np.eye(2))


def test_points_are_designed_for_where_their_reflector_is():
    """The uncertainty promised is that of a fit to points seen there, computed from its rows."""
    place, sd, q, goal_q = np.array([0.06, 0.02, 0.13]), 15e-6, pool_r()[:60], pool_r(80)[60:]
    problem = Problem.of_poses(
        tx60(), q, poses=30, criterion="V", goals=goal_q, noise=sd, target=place
    )
    seen = calib.points(q[:30], tx60().poses(q[:30])[:, :3] @ [*place, 1], sd=sd, offset=place)
    fit = calib.identify(tx60(), seen, calib.parameters_of(tx60(), problem.names))
    u = calib.uncertainty.tool_statement(fit.model, goal_q, fit.full_covariance, target=place).point
    # to first order the same linear algebra, at a fit that moved by nothing
    value = problem.criterion.figure(problem.information(range(30)), 30)
    assert value == pytest.approx(np.sqrt(np.square(u).mean()), rel=1e-6)
    with pytest.raises(InputError, match=r"target has shape \(2,\)"):
        Problem.of_poses(tx60(), q, poses=30, noise=sd, target=(0.1, 0.2))


@pytest.mark.usefixtures("uncertified")
@pytest.mark.parametrize("name", ["D", "O1", "V"])
@pytest.mark.parametrize("method", METHODS)
def test_the_way_to_a_set_goes_by_single_exchanges_and_then_by_better_ends(method: str, name: str):
    # a pool so large that the first search is not the last one to gain
    blocks, criterion = small_pool(12, 60), small_criterion(name)
    found = METHODS[method](Problem.of_blocks(blocks, 6, criterion), np.random.default_rng(3))
    if method in ("greedy", "random", "best_of_random"):
        assert found.way is found.way_figures is None
        return
    figures = [criterion.figure(information(blocks[one]), 6) for one in found.way]
    np.testing.assert_allclose(found.way_figures, figures, rtol=1e-12)
    sign = 1.0 if criterion.larger_is_better else -1.0
    assert (np.diff(sign * found.way_figures) > 0).all()  # every step is better than the one before
    np.testing.assert_array_equal(found.way[-1], found.indices)
    new = [len(set(b) - set(a)) for a, b in zip(found.way[:-1], found.way[1:], strict=True)]
    first = next((k for k, count in enumerate(new) if count > 1), len(new))
    # the first set exchanges until nothing is gained: some exchanges, one pose each
    assert first >= 1 or len(new) == 0
    assert min(new, default=1) >= 1


def test_a_method_bears_the_name_of_its_module():
    assert calib.design.exchange is METHODS["exchange"]
    found = calib.design.exchange(
        Problem.of_blocks(small_pool(0), 5, "D"), np.random.default_rng(0)
    )
    assert repr(found).startswith(f"Selection(5 poses by exchange, D = {found.value:.4g}; D-effic")

"""What is no pool, no number and no generator is refused by name, at every door of the design."""

import numpy as np
import pytest

from calib.design import (
    Problem,
    best_next,
    best_of_random,
    certify,
    detmax,
    exchange,
    fedorov,
    greedy,
    pose_budget,
    pose_count,
    random_selection,
    random_set,
    random_sets,
    relaxation,
)
from calib.design.pose_count import stable_count
from calib.errors import InputError
from calib.information.criteria.named import criterion_named
from calib.information.observability import indices
from tests.calib.design.design_cases import small_goals, small_pool
from tests.reference import pool_r, tx60

BLOCKS = small_pool(0)
PROBLEM = Problem.of_blocks(BLOCKS, 5, "D")
BY_A = Problem.of_blocks(BLOCKS, 5, "A")
KNOWN = Problem.of_blocks(BLOCKS, 5, "D", given=(0, 1, 2))
SEARCHES = (
    random_set, best_of_random, random_sets, detmax, fedorov, exchange, pose_count,
    lambda problem, rng: pose_budget(problem, 1.0, rng),
)  # fmt: skip


def rng():
    return np.random.default_rng(0)


NO_COUNTS = ["3", None, 2.5, np.nan, np.inf, True, [3], 0, -1]
COUNTED = {
    "m": lambda n: Problem.of_blocks(BLOCKS, n, "D"),
    "resized": lambda n: PROBLEM.resize(n),
    "random_selection m": lambda n: random_selection(9, n, rng()),
    "random_selection n_pool": lambda n: random_selection(n, 1, rng()),
    "sets": lambda n: random_sets(PROBLEM, rng(), sets=n),
    "pose_count sets": lambda n: pose_count(PROBLEM, rng(), sets=n),
    "exchange restarts": lambda n: exchange(PROBLEM, rng(), restarts=n),
    "pose_budget restarts": lambda n: pose_budget(BY_A, 1.0, rng(), restarts=n),
    "b": lambda n: detmax(PROBLEM, rng(), b=n),
    "d": lambda n: detmax(PROBLEM, rng(), d=n),
    "shown": lambda n: best_next(KNOWN, shown=n),
    "iterations": lambda n: relaxation(PROBLEM, iterations=n),
    "certify iterations": lambda n: certify(PROBLEM, [0, 1, 2, 3, 4], iterations=n),
    "n_poses": lambda n: indices([2.0, 1.0], n),
    "window": lambda n: stable_count([1, 2, 3], [1, 2, 3], window=n),
    "pose_budget counts": lambda n: pose_budget(BY_A, 1.0, rng(), counts=[n]),
    "pose_count counts": lambda n: pose_count(PROBLEM, rng(), counts=[n]),
}


@pytest.mark.parametrize("value", NO_COUNTS, ids=str)
@pytest.mark.parametrize("name", COUNTED)
def test_what_is_no_number_of_anything_is_refused(name: str, value):
    with pytest.raises(InputError):
        COUNTED[name](value)


def test_a_whole_number_may_be_written_in_any_way():
    for five in (5, 5.0, np.int64(5), np.float64(5.0)):
        assert PROBLEM.resize(five).m == 5


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("wrong", [None, 0, "seed", np.random], ids=str)
def test_a_search_asks_for_a_generator_and_a_problem(search, wrong):
    with pytest.raises(InputError, match=r"rng is of the type .*default_rng"):
        search(BY_A, wrong)
    with pytest.raises(InputError, match=r"problem is of the type .*of_blocks"):
        search(wrong, rng())


@pytest.mark.parametrize("door", [greedy, best_next, relaxation, lambda p: certify(p, [0])])
def test_what_draws_nothing_asks_for_a_problem(door):
    with pytest.raises(InputError, match="problem is of the type ndarray"):
        door(BLOCKS)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"criterion": []}, "criterion is of the type list"),
        ({"criterion": None}, "criterion is of the type NoneType"),
        ({"given": [[1, 2], [3]]}, "given is not a list of places"),
        ({"allowed": [[True], [True, False]]}, "allowed has shape"),
        ({"names": 5}, "1 names"),
        ({"names": list(range(5))}, "5 names"),
        ({"repeats": "no"}, "repeats is of the type str"),
    ],
)
def test_problems_of_no_sense_are_refused(change, says: str):
    with pytest.raises(InputError, match=says):
        Problem.of_blocks(BLOCKS, 5, **{"criterion": "D"} | change)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"model": None}, "model is of the type NoneType"),
        ({"model": tx60().chain}, "model is of the type Chain"),
        ({"noise": "x"}, "noise is not an array of numbers"),
        ({"noise": [[1, 2], [3]]}, "noise is not an array of numbers"),
        ({"free": []}, "free names no number"),
        ({"free": "base.x"}, "free is of the type str"),
        ({"free": 5}, "free is of the type int"),
        ({"free": [5]}, "free.*is of the type int"),
        ({"pool_q": np.zeros((0, 6))}, "q has no poses"),
    ],
)
def test_poses_of_no_sense_are_refused(change, says: str):
    options = {"model": tx60(), "pool_q": pool_r()[:20], "poses": 6} | change
    with pytest.raises(InputError, match=says):
        Problem.of_poses(**options)


@pytest.mark.parametrize("size", [1e-150, 1e-61, 1e61, 1e150])
def test_numbers_whose_squares_of_squares_are_none_are_refused(size: float):
    for unit in (size, np.array([1.0, 1.0, size, 1.0, 1.0])):
        with pytest.raises(InputError, match="blocks holds numbers of the size"):
            Problem.of_blocks(BLOCKS * unit, 5, "A")
    near = BLOCKS * size ** (0.9 * 60 / abs(np.log10(size)))
    for criterion in ("D", "A", "E"):
        figures = [
            exchange(Problem.of_blocks(each, 5, criterion), rng(), restarts=1)
            for each in (BLOCKS, near)
        ]
        assert figures[0].indices.tolist() == figures[1].indices.tolist()


def test_places_targets_and_tolerances_of_no_sense_are_refused():
    for wrong in ("x", None, np.nan, np.inf, -1.0):
        with pytest.raises(InputError, match="tolerance is"):
            relaxation(PROBLEM, tolerance=wrong)
        with pytest.raises(InputError, match="target is"):
            pose_budget(BY_A, wrong, rng())
    with pytest.raises(InputError, match="not a set of places"):
        certify(PROBLEM, [[0, 1], [2]])
    with pytest.raises(InputError, match="counts is not an array of whole numbers"):
        pose_count(PROBLEM, rng(), counts=[[3], [4, 5]])
    for wrong in ("45", 5):
        with pytest.raises(InputError, match="counts is of the type"):
            pose_count(PROBLEM, rng(), counts=wrong)
    with pytest.raises(InputError, match="criterion is of the type dict"):
        criterion_named({})
    with pytest.raises(InputError, match="goals is of the type ndarray"):
        criterion_named("V", goals=np.ones((3, 3, 5)))
    with pytest.raises(InputError, match="inputs is -1"):
        criterion_named("V", goals=small_goals(0), inputs=-1)
    with pytest.raises(InputError, match="prior holds numbers of the size 1e\\+300"):
        Problem.of_blocks(BLOCKS, 5, "A", prior=1e300 * np.eye(5))

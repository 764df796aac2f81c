"""The paper's budget: which contributors are counted, and how they add."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.type_a import best_budget, location_regions, random_budget


def estimates(rows, seed, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(rows, 3))


def both():
    repeats, sets, regions = estimates(10, 0), estimates(7, 1, 2.0), estimates(4, 2, 3.0)
    return (best_budget(repeats), random_budget(repeats, sets, regions), (repeats, sets, regions))


def test_the_best_figure_counts_repeats_only_as_the_environment_is_taken_as_constant():
    best, _, (repeats, _, _) = both()
    np.testing.assert_allclose(best.combined, repeats.std(axis=0, ddof=1), rtol=1e-14)
    assert not best.environment.any()
    assert not best.pose_number.any()
    assert not best.location.any()


def test_the_random_figure_adds_pose_number_and_location():
    _, random, parts = both()
    expected = np.sqrt(sum(part.var(axis=0, ddof=1) for part in parts))
    np.testing.assert_allclose(random.combined, expected, rtol=1e-14)


def test_the_same_repeats_give_random_sets_the_larger_figure_by_construction():
    best, random, _ = both()
    assert (best.combined < random.combined).all()


def test_an_environment_is_added_once_on_either_side():
    _, _, parts = both()
    u_c = np.array([0.3, 0.0, 2.0])
    for with_it, bare in (
        (best_budget(parts[0], u_c), best_budget(parts[0])),
        (random_budget(*parts, u_c), random_budget(*parts)),
    ):
        np.testing.assert_array_equal(with_it.environment, u_c)
        np.testing.assert_allclose(with_it.combined**2, bare.combined**2 + u_c**2, rtol=1e-14)
    np.testing.assert_array_equal(best_budget(parts[0], 0.5).environment, [0.5] * 3)


def test_the_regions_meet_where_the_border_is():
    position = np.random.default_rng(4).uniform(-1, 1, (50, 3))
    x, y = (position[:, :2] > [0.1, -0.3]).T
    np.testing.assert_array_equal(location_regions(position, (0.1, -0.3)), 2 * x + y)


def test_the_four_regions_quarter_the_workspace():
    position = np.array([[0.2, -0.1, 0.0], [0.2, 0.1, 0.0], [0.3, -0.1, 0.0], [0.3, 0.1, 0.0]])
    np.testing.assert_array_equal(location_regions(position), [0, 1, 2, 3])
    # a mirrored pose changes its y region and nothing else
    np.testing.assert_array_equal(location_regions(position * [1, -1, 1]), [1, 0, 3, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: random_budget(*(estimates(4, 0)[:, :k] for k in (3, 2, 3))),
            "pose_numbers has shape",
        ),
        (lambda: best_budget(estimates(4, 0), [1.0, 2.0]), "environment has shape"),
        (lambda: best_budget(estimates(4, 0), [0.0, -1.0, 0.0]), "environment is -1"),
    ],
)
def test_mismatched_budgets_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()

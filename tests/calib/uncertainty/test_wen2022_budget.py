"""The paper's budget: which contributors are counted, and how they add."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.wen2022_budget import (
    best_budget,
    location_regions,
    random_budget,
)


def estimates(rows, seed, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(rows, 3))


def both(environment=0.0):
    repeats, sets, regions = estimates(10, 0), estimates(7, 1, 2.0), estimates(4, 2, 3.0)
    return (
        best_budget(repeats, environment=environment),
        random_budget(repeats, sets, regions, environment=environment),
        (repeats, sets, regions),
    )


def test_the_best_figure_counts_repeats_and_environment_only():
    best, _, (repeats, _, _) = both(environment=0.5)
    expected = np.sqrt(repeats.var(axis=0, ddof=1) + 0.25)
    np.testing.assert_allclose(best.combined, expected, rtol=1e-14)
    assert not best.pose_number.any()
    assert not best.location.any()


def test_the_random_figure_adds_pose_number_and_location():
    _, random, parts = both()
    expected = np.sqrt(sum(part.var(axis=0, ddof=1) for part in parts))
    np.testing.assert_allclose(random.combined, expected, rtol=1e-14)


def test_the_same_repeats_give_random_sets_the_larger_figure_by_construction():
    best, random, _ = both()
    assert (best.combined < random.combined).all()


def test_a_stated_environment_counts_for_each_number():
    budget = best_budget(np.zeros((2, 3)), environment=[1.0, 1.0, 0.0])
    np.testing.assert_array_equal(budget.combined, [1.0, 1.0, 0.0])


def test_the_four_regions_quarter_the_workspace():
    position = np.array([[0.2, -0.1, 0.0], [0.2, 0.1, 0.0], [0.3, -0.1, 0.0], [0.3, 0.1, 0.0]])
    np.testing.assert_array_equal(location_regions(position), [0, 1, 2, 3])
    # a mirrored pose changes its y region and nothing else
    np.testing.assert_array_equal(location_regions(position * [1, -1, 1]), [1, 0, 3, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: best_budget(estimates(10, 0), environment=[1.0, 2.0]), "environment"),
        (lambda: best_budget(estimates(10, 0), environment=-1.0), "negative"),
        (
            lambda: random_budget(*(estimates(4, 0)[:, :k] for k in (3, 2, 3))),
            "pose_numbers has shape",
        ),
    ],
)
def test_mismatched_budgets_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()

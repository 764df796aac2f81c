"""The paper's budget: which contributors are counted, and how they add."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.wen2022_budget import (
    ENVIRONMENT,
    LOCATION,
    POSE_NUMBER,
    POSE_NUMBERS,
    REPEATABILITY,
    best_budget,
    location_regions,
    random_budget,
    uncertainty_ratio,
)

NAMES = ("theta1", "d1", "a1")


def estimates(rows, seed, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(rows, len(NAMES)))


def both(environment=0.0):
    repeats, sets, regions = estimates(10, 0), estimates(7, 1, 2.0), estimates(4, 2, 3.0)
    return (
        best_budget(NAMES, repeats, environment=environment),
        random_budget(NAMES, repeats, sets, regions, environment=environment),
        (repeats, sets, regions),
    )


def test_the_best_figure_counts_repeats_and_environment_only():
    best, _, (repeats, _, _) = both(environment=0.5)
    expected = np.sqrt(repeats.var(axis=0, ddof=1) + 0.25)
    np.testing.assert_allclose(best.combined, expected, rtol=1e-14)
    assert [part.name for part in best.contributors] == [REPEATABILITY, ENVIRONMENT]


def test_the_random_figure_adds_pose_number_and_location():
    _, random, parts = both()
    expected = np.sqrt(sum(part.var(axis=0, ddof=1) for part in parts))
    np.testing.assert_allclose(random.combined, expected, rtol=1e-14)
    assert random.contributor(POSE_NUMBER).degrees_of_freedom == len(POSE_NUMBERS) - 1
    assert random.contributor(LOCATION).degrees_of_freedom == 3


def test_the_same_repeats_give_random_sets_the_larger_figure_by_construction():
    best, random, _ = both()
    assert (uncertainty_ratio(best, random) < 1).all()


def test_variance_shares_add_to_one_and_rank_the_sources():
    _, random, _ = both(environment=0.1)
    shares = random.variance_shares
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-14)
    np.testing.assert_allclose(
        shares[0] * random.combined**2,
        random.contributor(REPEATABILITY).standard ** 2,
        rtol=1e-12,
    )


def test_k_equal_sources_multiply_the_degrees_of_freedom_by_k():
    repeats = estimates(8, 3)
    budget = random_budget(NAMES, repeats, repeats, repeats)
    np.testing.assert_allclose(budget.degrees_of_freedom, 3 * 7, rtol=1e-12)


def test_a_stated_environment_alone_has_unlimited_degrees_of_freedom():
    budget = best_budget(NAMES, np.zeros((2, 3)), environment=[1.0, 1.0, 0.0])
    np.testing.assert_array_equal(budget.degrees_of_freedom, np.inf)
    np.testing.assert_array_equal(budget.combined, [1.0, 1.0, 0.0])


def test_the_four_regions_quarter_the_workspace():
    position = np.array([[0.2, -0.1, 0.0], [0.2, 0.1, 0.0], [0.3, -0.1, 0.0], [0.3, 0.1, 0.0]])
    np.testing.assert_array_equal(location_regions(position), [0, 1, 2, 3])
    # a mirrored pose changes its y region and nothing else
    np.testing.assert_array_equal(location_regions(position * [1, -1, 1]), [1, 0, 3, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: best_budget(NAMES, estimates(10, 0), environment=[1.0, 2.0]), "environment"),
        (lambda: best_budget(NAMES, estimates(10, 0), environment=-1.0), "negative"),
        (lambda: best_budget(NAMES[:2], estimates(10, 0)), "standard"),
        (lambda: both()[0].contributor(LOCATION), "location"),
        (
            lambda: uncertainty_ratio(
                best_budget(NAMES, estimates(10, 0)), best_budget("abc", estimates(10, 0))
            ),
            "different parameters",
        ),
    ],
)
def test_mismatched_budgets_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()

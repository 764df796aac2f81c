"""Several tests asked together: Holm's levels, Fisher's number, and words."""

import numpy as np
import pytest
from scipy.stats import combine_pvalues

from calib.uncertainty.statement.questions import Questions, fisher


def test_fisher_is_that_of_scipy():
    for p in ([0.029, 0.041], [0.5], [1e-8, 0.9, 0.3]):
        assert fisher(p) == pytest.approx(combine_pvalues(p).pvalue, rel=1e-12)
    assert fisher([0.0, 0.5]) == 0.0
    assert fisher([]) == 1.0


def test_two_harmless_p_values_together_are_said():
    """The pair of the specification: .029 and .041 together are .009."""
    assert fisher([0.029, 0.041]) == pytest.approx(0.009, abs=5e-4)
    asked = Questions(("misfit",), (0.2,), fisher([0.029, 0.041]))
    assert not asked.agree


def test_holm_by_hand():
    asked = Questions(("a", "b", "c", "d"), (0.01, 0.04, 0.03, 0.005), 0.5)
    np.testing.assert_allclose(asked.adjusted, [0.03, 0.06, 0.06, 0.02])
    assert asked.said == ()
    assert Questions(("a", "b"), (0.004, 0.2), 0.5).said == ("a",)
    assert Questions((), (), 1.0).agree


def test_what_something_else_answers_is_asked_with_all_others_and_not_said():
    """Its p-value counts in Holm's levels whatever it is: else these would hang on the answer."""
    plain = Questions(("a", "drift"), (0.004, 1e-4), 0.5)
    untold = Questions(("a", "drift"), (0.004, 1e-4), 0.5, ("drift",))
    assert plain.said == ("a", "drift")
    assert untold.said == ("a",)
    assert untold.adjusted == plain.adjusted


def test_the_level_holds_for_all_questions_together():
    """4000 campaigns without fault: one wrong answer or more in at most 1 % of them."""
    rng = np.random.default_rng(1)
    wrong = sum(bool(Questions(("a", "b", "c"), tuple(p), 1.0).said) for p in rng.random((4000, 3)))
    # expected 40 or fewer; three standard deviations more
    assert wrong <= 40 + 3 * np.sqrt(40)
    assert wrong >= 40 - 3 * np.sqrt(40)

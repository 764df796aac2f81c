"""Pass, fail and undecided: the risks of the design page, draws, and regions of any shape."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.uncertainty.statement.conformity import conformity
from calib.uncertainty.statement.distance import distance_radius
from tests.calib.uncertainty.statement.test_distance import turned

S = np.diag([16.0, 9, 4]) * 1e-12  # m^2
T = 50e-6

# specific risk at deviations [um]: reference values
RISKS = [((40, 0, 0), 6.835e-3), ((45, 0, 0), 0.11187), ((50, 0, 0), 0.51299)]


@pytest.mark.parametrize(("um", "risk"), RISKS)
def test_risks_of_the_worked_example(um, risk):
    found = conformity([1e-6 * np.array(um)], S[None], T)
    assert found.risk[0] == pytest.approx(risk, rel=1e-4)


def test_guard_band_of_the_worked_example():
    found = conformity(np.outer([40.9, 41.1, 58.9, 59.1], [1e-6, 0, 0]), np.tile(S, (4, 1, 1)), T)
    assert found.guard[0] == pytest.approx(9.013e-6, abs=1e-9)
    assert found.outcome.tolist() == ["pass", "undecided", "undecided", "fail"]
    assert "1 pass, 2 undecided, 1 fail" in found.sentence
    assert "guard band R95" in found.sentence


def test_a_guarded_decision_is_wrong_in_at_most_one_of_twenty():
    """For any shape, direction and tolerance: ball within ball."""
    rng = np.random.default_rng(4)
    regions = turned(rng, 60)
    R = distance_radius(regions)
    longest = np.linalg.eigh(regions)[1][:, :, 2]
    for tolerance in (1.0, 2.0, 10.0):
        for sign, outcome in ((-1, "pass"), (1, "fail")):
            size = tolerance * R.max() + sign * R
            d = (size * (1 + sign * 1e-9))[:, None] * longest
            found = conformity(d, regions, tolerance * R.max())
            decided = found.outcome == outcome
            assert decided[size > 0].all()
            wrong = found.risk if outcome == "pass" else 1 - found.risk
            assert wrong[decided].max() <= 0.05 + 1e-6


def test_no_pass_where_the_tolerance_is_smaller_than_the_uncertainty():
    found = conformity([[0, 0, 0], [1e-3, 0, 0]], np.array([S, S]), 5e-6)
    assert found.outcome.tolist() == ["undecided", "fail"]
    assert "no pass is possible" in found.sentence
    assert "at 2 of 2 points" in found.sentence


def test_simple_acceptance_says_what_it_is():
    found = conformity([[49.9e-6, 0, 0], [50.1e-6, 0, 0]], np.array([S, S]), T, rule="simple")
    assert found.outcome.tolist() == ["pass", "fail"]
    assert 0.4 < found.risk[0] < 0.52
    assert "simple acceptance" in found.sentence
    assert f"largest risk of a pass {100 * found.risk[0]:.2g} %" in found.sentence
    assert "about 50 %" not in found.sentence
    assert "no pass is possible" not in found.sentence
    assert "guard band R95" not in found.sentence
    assert found.guard.tolist() == [0, 0]
    assert repr(found) == "Conformity(1 pass, 1 fail)"


def test_by_no_rule_a_point_passes_whose_uncertainty_is_larger_than_the_tolerance():
    """Of 20 points 98 % are out of tolerance, as draws say: simple acceptance passed them all."""
    regions = np.tile(np.eye(3) * (25e-6) ** 2, (20, 1, 1))
    found = conformity(np.zeros((20, 3)), regions, 10e-6, rule="simple")
    assert found.counts == {"undecided": 20}
    assert found.largest_risk is None
    drawn = np.random.default_rng(5).normal(scale=25e-6, size=(40_000, 3))
    out = np.mean(np.linalg.norm(drawn, axis=1) > 10e-6)
    assert found.risk[0] == pytest.approx(out, abs=0.004)  # 5 standard deviations of the draws
    guarded = conformity(np.zeros((20, 3)), regions, 10e-6)
    said = "at 20 of 20 points no pass is possible: the tolerance is smaller than the uncertainty"
    for one in (found, guarded):
        assert f"{said}, R95 up to 70 um" in one.sentence
        assert one.hopeless.all()
    # from just below R95 on, and not before
    at_R95 = float(distance_radius(regions[:1])[0])
    for tolerance, words in ((0.999 * at_R95, ["undecided"]), (1.001 * at_R95, ["pass"])):
        near = conformity(np.zeros((1, 3)), regions[:1], tolerance, rule="simple")
        assert near.outcome.tolist() == words
    # what lies out of it by more than that still fails
    far = conformity([[1e-3, 0, 0], [75e-6, 0, 0]], regions[:2], 10e-6, rule="simple")
    assert far.outcome.tolist() == ["fail", "undecided"]


def test_a_pass_at_the_limit_has_a_risk_of_one_half_or_more():
    rng = np.random.default_rng(6)
    regions = turned(rng, 40)
    away = rng.normal(size=(40, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    limit = 1.2 * float(distance_radius(regions).max())
    found = conformity((1 - 1e-9) * limit * away, regions, limit, rule="simple")
    assert found.counts == {"pass": 40}
    assert found.risk.min() >= 0.5 - 1e-6
    assert found.largest_risk == found.risk.max()


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, np.inf])
def test_a_tolerance_must_be_a_length(tolerance):
    with pytest.raises(InputError, match="above zero"):
        conformity([[0, 0, 0]], S[None], tolerance)


def test_a_rule_must_be_known():
    with pytest.raises(InputError, match="guarded"):
        conformity([[0, 0, 0]], S[None], T, rule="strict")

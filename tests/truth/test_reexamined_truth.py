"""The paper's protocol at full size: what its ratio is on robots that are known.

The project's specification (section 11, row 14) expects the ratio 0.33 for O1 and 0.49 for O2 on
robots that sag, 0.72 and 1.08 on rigid ones. These are the figures of O1 sets of 29 poses; the
paper's own O1 set has 61, and gives 0.22 and 0.48.
"""

import numpy as np
import pytest

from testbed.studies import load_scenario
from testbed.studies.wen2022.ratio import over_pools
from testbed.studies.wen2022.summary import reexamination_of
from tests.reported import played

pytestmark = [pytest.mark.truth, pytest.mark.study]


@pytest.fixture(scope="module")
def campaign():
    """The scene, with O1 sets of 29 poses beside those of the paper."""
    trials = [t.model_dump(mode="json") for t in load_scenario("wen2022_reexamined").trial]
    less = next(t for t in trials if t["name"] == "best-61") | {"name": "o1-29", "poses": 29}
    changes = {"uncertainty.replications": 0, "trial": [*trials, less]}
    return played("wen2022_reexamined", changes)


def split(campaign, truth, trial):
    found = reexamination_of(campaign).splits
    return next(one for one in found if (one.truth, one.trial) == (truth, trial))


# 36 robots and 12 pools; half widths of the 95 % intervals are 0.013 to 0.06
@pytest.mark.parametrize(
    ("truth", "trial", "ratio", "tolerance"),
    [
        ("wen2022", "best-61", 0.22, 0.03),
        ("wen2022", "o1-29", 0.33, 0.10),
        ("wen2022", "best-29", 0.49, 0.20),
        ("rigid", "best-61", 0.48, 0.04),
        ("rigid", "o1-29", 0.72, 0.06),
        ("rigid", "best-29", 1.08, 0.15),
    ],
)
def test_the_ratio_of_the_protocol(campaign, truth, trial, ratio, tolerance):
    assert split(campaign, truth, trial).ratio.value == pytest.approx(ratio, abs=tolerance)


def test_number_and_place_of_the_poses_scatter_more_than_repeats_where_joints_sag(campaign):
    soft = split(campaign, "wen2022", "best-61")
    # specification, section 11: 2.4 and 3.6; intervals of 36 robots are +-0.2 and +-0.3
    assert soft.p_over_r.value == pytest.approx(2.4, abs=0.3)
    assert soft.w_over_r.value == pytest.approx(3.6, abs=0.4)
    # and the shares are those that Table 3 has: 13, 34 and 53 %
    shares = [part.value for part in soft.shares]
    np.testing.assert_allclose(shares, [0.13, 0.34, 0.53], atol=0.05)
    rigid = split(campaign, "rigid", "best-61")
    assert rigid.p_over_r.value == pytest.approx(0.87, abs=0.1)
    assert rigid.w_over_r.value == pytest.approx(1.04, abs=0.1)


def test_like_for_like_designed_sets_gain_a_tenth_from_noise(campaign):
    found = {
        (p.trial, p.against, p.estimator): p.numbers for p in reexamination_of(campaign).predictions
    }
    # specification, section 11: .876, .902 +- .02, and 1.18 against 50 random poses
    assert found["d-29", 29, "whitened"].value == pytest.approx(0.876, abs=0.02)
    assert found["d-61", 61, "whitened"].value == pytest.approx(0.902, abs=0.02)
    assert found["d-29", 50, "whitened"].value == pytest.approx(1.18, abs=0.03)
    # the same page has 1.10 and 1.46 for one O2 set; over pools it is 1.05 and 1.20 (+-0.06)
    assert found["best-29", 29, "whitened"].value == pytest.approx(1.05, abs=0.05)
    assert found["best-29", 29, "paper"].value == pytest.approx(1.20, abs=0.1)


def test_sets_of_one_pool_scatter_in_what_noise_makes_of_them(campaign):
    one, other = (
        next(s for s in reexamination_of(campaign).sets.sets if s.trial == name)
        for name in ("best-29", "random-29")
    )
    each = (one.u[:, 0] / other.u[:, 0]).mean(axis=1)
    # the O2 sets of 12 pools reach from about 1.05 to 1.4: one pool proves little
    assert over_pools(each).half_width > 0.03
    assert each.max() - each.min() > 0.15


def test_on_robots_that_sag_optimal_sets_leave_more_error_than_random_ones(campaign):
    found = {(e.truth, e.trial, e.estimator): e for e in reexamination_of(campaign).errors}
    for trial in ("best-61", "best-29", "d-61"):
        assert found["wen2022", trial, "whitened"].ratio.low > 0
    # on rigid ones noise is all there is, and the O1 set gains; O2 sets lose on both
    assert found["rigid", "best-61", "whitened"].ratio.high < 0
    assert found["rigid", "best-29", "whitened"].ratio.low > 0


def test_u_best_holds_on_rigid_robots_and_not_where_joints_sag(campaign):
    found = {(one.truth, one.trial): one for one in reexamination_of(campaign).statements}
    rigid, soft = found["rigid", "best-61"], found["wen2022", "best-61"]
    assert all(part.value > 0.93 for part in rigid.shares)
    assert rigid.numbers.value == pytest.approx(0.95, abs=0.03)
    distance, point, region, fit = (part.value for part in soft.shares)
    # specification, section 11, has 1 to 3 % for the region; 0.3 % is what a fit's own one holds
    assert fit < 0.02
    assert point < 0.1
    assert region < 0.15
    assert distance < 0.45

"""The headline of the shipped plan at full size: what README.md and scenes/README.md say of it."""

import json
from pathlib import Path

import pytest

from testbed.plan.plan import plan
from testbed.studies import load_scenario

GOLDEN = Path(__file__).parents[2] / "golden" / "plan_tx60.json"


@pytest.mark.scene
def test_the_shipped_plan_has_the_headline_that_is_published():
    made = plan(load_scenario("plan_tx60"))
    wanted = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert len(made.places) == wanted["poses"]
    assert made.curve.fewest == wanted["proven_fewest"]
    assert made.stations.best + 1 == wanted["station"]
    # the last digit printed
    assert 2e6 * made.u_mean == pytest.approx(wanted["U_mean_um"], abs=0.005)
    assert 2e6 * made.u_worst == pytest.approx(wanted["U_worst_um"], abs=0.005)
    seen = made.foresight
    assert 1e6 * seen.R95_over == pytest.approx(wanted["R95_over_goal_um"], abs=0.005)
    assert 1e6 * seen.R95_worst == pytest.approx(wanted["R95_worst_um"], abs=0.005)
    assert 1e6 * made.over_goal(seen.shared) == pytest.approx(wanted["u_systematic_um"], abs=0.005)
    assert 1e6 * seen.misfit_seen == pytest.approx(wanted["misfit_seen_um"], abs=0.005)
    assert made.proof.efficiency == pytest.approx(wanted["efficiency"], abs=5e-5)
    assert made.tour.duration == pytest.approx(wanted["duration_s"], abs=0.05)
    assert 1e3 * made.tour.clearance == pytest.approx(wanted["clearance_mm"], abs=0.05)

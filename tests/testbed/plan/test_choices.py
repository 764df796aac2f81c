"""A plan's choices: clearance kept, method and curve of the set kept, the tracker not too near."""

import numpy as np
import pytest

from calib.design import METHODS
from calib.errors import InputError
from calib.identification.identify import identify
from testbed.laboratory.bench import open_bench
from testbed.laboratory.cell import cell_from
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.stations import require_ranges
from testbed.plan import design
from testbed.plan.foresight import planned_rows
from testbed.plan.plan import plan
from testbed.plan.results import plan_csv
from testbed.units import significant
from tests.planned import BARE, QUICK, ROBOT, legs, quick_plan, scenario, small_plan

CHAIN = ROBOT.model.chain
LINKS = BARE | {"plan.stiff_joints": True}
"""Changes for a plan whose target is asked of the links alone."""


@pytest.mark.slow
def test_poses_and_moves_keep_the_clearance_asked_for():
    made = small_plan()
    cell = cell_from(made.scenario.cell, CHAIN)
    simulator = Simulator(ROBOT, CHAIN, cell)
    ways = [a + np.linspace(0, 1, 400)[:, None] * (b - a) for a, b in legs(made)]
    nearest = simulator.clearances(np.vstack(ways), most=0.5).min()
    # tested every 10 mm of the fastest point: half of that may be lost between two tests
    assert nearest > 0.010 - 0.005
    assert made.tour.clearance == pytest.approx(nearest, abs=0.005)
    assert made.tour.clearance >= 0.010
    assert (simulator.clearances(made.pool.q, most=0.5) >= 0.010).all()


def test_the_method_told_is_that_of_the_set_kept(monkeypatch):
    asked = {"plan.poses": 0, "plan.target_um": 25.0, "plan.method": "greedy"}
    # a poor method: the set behind the curve is kept instead of its own
    monkeypatch.setitem(METHODS, "greedy", METHODS["random"])
    made = plan(scenario(LINKS, **asked))
    assert made.method == "exchange"
    assert made.u_mean <= 12.5e-6


def test_the_curve_has_the_plans_own_uncertainty_at_its_own_point(monkeypatch):
    monkeypatch.setattr(design, "CURVE_POINTS", 9)  # one fewer than its own is on the curve
    made = plan(scenario(BARE, **{"plan.method": "random"}))
    at = made.curve.counts == len(made.places)
    assert made.method == "random"
    # fewer designed poses do better than these at random, and still:
    assert made.curve.u[np.flatnonzero(at)[0] - 1] < made.u_mean
    assert made.curve.u[at] == pytest.approx(made.u_mean, rel=1e-12)


def test_a_target_that_comes_too_near_to_the_tracker_is_refused():
    """Arm stretched forward: the probe 0.73 m before the base, the tracker at 1.25 m."""
    bench = open_bench(scenario(QUICK, **{"tracker.station_mm": [1250.0, 0.0, 0.0]}))
    with pytest.raises(InputError, match=r"to 0\.52 m from the tracker; it needs 0\.8 m"):
        require_ranges(bench, np.radians([[0.0, 90.0, 0.0, 0.0, 0.0, 0.0]]), "the plan")


STANDS = [[2600.0, -2000.0, 300.0], [2600.0, 0.0, 300.0]]
FRAMES = [f"{frame}.{axis}" for frame in ("base", "tool") for axis in "xyz"]
LENGTHS = [*FRAMES, *(f"{kind}{k}" for kind in "ad" for k in range(1, 7))]


@pytest.mark.parametrize("method", ["greedy", "exchange"])
def test_a_target_passes_over_numbers_of_poses_that_no_set_can_do_with(method):
    """Two poses have as many equations as these numbers, and always leave one unseen."""
    free = {"identification.free": FRAMES, "plan.method": method}
    made = plan(scenario(LINKS, **free, **{"plan.poses": 0, "plan.target_um": 60.0}))
    assert made.u_mean <= 30e-6
    assert made.curve.counts.min() >= 3
    assert np.isfinite(made.curve.u).all()
    assert len(made.places) == made.curve.reached == 3


def test_stations_that_see_a_part_of_few_candidates_are_compared_by_what_they_see():
    """29 poses are usual, and enough for none here: the plan itself needs six."""
    few = {
        "pool.size": 40,
        "plan.poses": 0,
        "plan.target_um": 80.0,
        "plan.stations.list_mm": STANDS,
    }
    made = plan(scenario(LINKS, **few))
    seen = made.stations
    assert 6 <= seen.visible.max() < 29
    assert [len(design) for design in seen.designs if len(design)] == [seen.visible.max()]
    assert len(made.places) == 6


def test_a_target_that_poses_measured_already_reach_is_said_to_need_no_more(tmp_path):
    first = quick_plan()
    (tmp_path / "measured.csv").write_text(plan_csv(first), encoding="utf-8")
    more = {"plan.poses": 0, "plan.measured": str(tmp_path / "measured.csv")}
    u = 2e6 * first.u_mean
    rich = plan(scenario(LINKS, **more, **{"plan.target_um": 1.001 * u}))
    assert (rich.curve.reached, rich.curve.fewest, len(rich.places)) == (0, 0, 1)
    assert f"The 8 poses measured already reach U = {1.001 * u:g} µm" in rich.curve.sentence
    assert f"they give {significant(u)} µm without another" in rich.curve.sentence
    poor = plan(scenario(LINKS, **more, **{"plan.target_um": 0.999 * u}))
    assert (poor.curve.reached, poor.curve.fewest) == (1, 1)
    assert "no fewer can" in poor.curve.sentence


def test_lengths_alone_are_planned_though_angles_tell_them_nothing():
    """Three of a pose's six rows see lengths: more poses are needed than rows are counted."""
    made = plan(scenario(BARE, **{"identification.free": LENGTHS}))
    p = made.parameters.n_free
    assert made.curve.counts.min() >= -(-p // 3)
    assert len(made.places) == 8


def test_a_calibration_has_an_equation_to_spare_with_the_fewest_poses_of_a_plan():
    """As many equations as numbers may promise anything: `identify` refuses them."""
    made = plan(scenario(LINKS, **{"plan.poses": 0, "plan.target_um": 300.0}))
    bench = open_bench(made.scenario)
    assert len(made.places) == made.curve.fewest == 6
    assert made.parameters.n_free == 30
    enough = planned_rows(bench, made.pool.q[made.places])
    assert identify(ROBOT.model, enough, made.parameters).dof == 6
    with pytest.raises(InputError, match="5 different poses give 30 equations for 30 parameters"):
        identify(ROBOT.model, planned_rows(bench, made.pool.q[made.places[:5]]), made.parameters)

"""Stations compared: what each sees, what its design predicts, and a reason that is true."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array, Index
from calib.design.blocks import scaled_blocks
from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.information.goals import Goals
from calib.measurement.residual import whitened_blocks
from testbed.laboratory.bench import Bench, open_bench
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.tracker.predicted import goal_uncertainty
from testbed.laboratory.tracker.stations import (
    StationComparison,
    compare_stations,
    station_grid,
    visible_from,
)
from testbed.robots.catalog import load_robot
from testbed.scenario.laboratory import At960Tracker, BoxObstacle, CellSettings, PaperTracker
from testbed.scenario.planning import StationSettings
from testbed.studies import scenario_of

ROBOT = load_robot("staubli_tx60")
CHAIN = ROBOT.model.chain
PARAMETERS = parameters_of(ROBOT.model).freeing(ROBOT.free_sets["wen2022"])
SCREEN = CellSettings(
    obstacle=(BoxObstacle(size_mm=(50.0, 2000.0, 1600.0), position_mm=(800.0, -700.0, 300.0)),)
)
STATIONS = [[2.6, -2.0, 0.3], [1.5, 1.5, 0.5], [-2.0, 0.0, 0.3], [5.0, 5.0, 0.0], [0.8, -0.7, 0.3]]


def designer(blocks: Array, _shared: Array) -> Index:
    """Plain greedy D design of 29 poses; nothing here depends on how it chooses."""
    if len(blocks) < 29:
        raise InputError("29 poses wanted", code="M27", allowed=f"the pool has {len(blocks)}")
    G = np.einsum("nri,nrj->nij", blocks, blocks)
    M, left, chosen = 1e-6 * G.mean(axis=0) + 1e-9 * np.eye(G.shape[1]), np.zeros(len(G)), []
    for _ in range(29):
        best = int(np.argmax(np.linalg.slogdet(M + G)[1] + left))
        M, left[best] = M + G[best], -np.inf
        chosen.append(best)
    return np.array(chosen)


def laboratory(settings=None, *, cell=SCREEN, **pool) -> Bench:
    """A bench with one pool size for all; the joints scatter as the robot's maker states."""
    settings = settings or At960Tracker(acceptance_deg=60.0)
    scenario = scenario_of(
        {
            "format": 1,
            "name": "stations",
            "seed": 1,
            "robot": "staubli_tx60",
            "truth": {"preset": "rigid"},
            "tracker": {"preset": "at960"},
            "trial": [{"name": "any", "poses": 20, "method": "random"}],
        }
    )
    pool = scenario.pool.model_copy(update={"size": 300} | pool)
    changes = {"tracker": settings, "cell": cell, "pool": pool}
    return replace(open_bench(scenario.model_copy(update=changes)), sigma_q=ROBOT.repeatability)


@pytest.fixture(scope="module")
def q() -> Array:
    return laboratory().candidates(seen=False).draw(np.random.default_rng(1)).q


@pytest.fixture(scope="module")
def goal(q) -> Array:
    _, J = ROBOT.model.poses_and_jacobian(q[200:260])
    return J[:, :3][:, :, PARAMETERS.free] * PARAMETERS.free_scale


def compared(bench: Bench, q, goal, stations=STATIONS, weights=None) -> StationComparison:
    goals = Goals(goal, np.ones(len(goal)) if weights is None else weights)
    return compare_stations(bench, np.array(stations), q, PARAMETERS, goals, designer)


@pytest.fixture(scope="module")
def found(q, goal) -> StationComparison:
    return compared(laboratory(), q, goal)


def test_every_candidate_is_turned_away_hidden_or_visible(found):
    total = found.turned_away + found.hidden + found.visible
    np.testing.assert_array_equal(total, np.full(5, 300))
    assert (found.turned_away > 0).all()
    # behind the screen: everything that faces the station is hidden
    assert found.visible[0] == 0
    assert found.hidden[0] > 20
    # inside the screen
    assert found.visible[4] == 0


def test_designs_are_made_of_visible_poses_only(q, found):
    for k in (1, 2, 3):
        _, seen = visible_from(laboratory().standing_at(np.array(STATIONS[k])), q)
        assert len(found.designs[k]) == 29
        assert seen[found.designs[k]].all()
        assert seen.sum() == found.visible[k]


def test_the_predicted_uncertainty_is_that_of_the_inverse_information(q, goal, found):
    for k in (1, 2, 3):
        settings = At960Tracker(station_mm=tuple(np.array(STATIONS[k]) * 1e3))
        tracker, chosen = tracker_from(settings, CHAIN), q[found.designs[k]]
        covariance = tracker.covariance(ROBOT.model, chosen, ROBOT.repeatability)
        B = scaled_blocks(whitened_blocks(ROBOT.model, chosen, covariance), PARAMETERS)
        C = np.linalg.inv(np.einsum("mri,mrj->ij", B, B))
        u2 = np.einsum("gai,ij,gaj->g", goal, C, goal)
        # the plain inverse loses as many digits as M has condition: about 1e5
        assert found.u_mean[k] == pytest.approx(np.sqrt(u2.mean()), rel=1e-9)
        assert found.u_worst[k] == pytest.approx(np.sqrt(u2.max()), rel=1e-9)


def test_weights_move_the_mean_but_not_the_worst(q, goal, found):
    weights = np.zeros(len(goal))
    weights[7] = 2.0
    one = compared(laboratory(), q, goal, stations=STATIONS[1:2], weights=weights)
    seventh = compared(laboratory(), q, goal[7:8], stations=STATIONS[1:2])
    assert one.u_mean[0] == pytest.approx(seventh.u_mean[0], rel=1e-12)
    assert one.u_worst[0] == found.u_worst[1]


def test_the_best_station_has_the_smallest_mean_and_its_statement_names_it(found):
    usable = np.isfinite(found.u_mean)
    assert usable.tolist() == [False, True, True, True, False]
    assert found.u_mean[found.best] == found.u_mean[usable].min()
    x, y, z = np.array(STATIONS[found.best]) * 1e3
    assert found.statements[found.best].startswith(
        f"station {found.best + 1} at ({x:.0f}, {y:.0f}, {z:.0f}) mm sees "
        f"{found.visible[found.best]} of 300 candidates"
    )


def test_a_station_that_sees_nothing_says_why(found):
    assert found.statements[0] == (
        "station 1 at (2600, -2000, 300) mm sees nothing: of 300 candidates "
        f"{found.turned_away[0]} with the probe turned away and {found.hidden[0]} "
        "hidden from the beam"
    )


def test_a_nearer_station_wins_where_noise_grows_with_range_and_nowhere_else(q, goal):
    near, far = [2.0, -1.0, 0.3], [12.0, -6.0, 1.8]  # the same direction
    empty = CellSettings()
    found = compared(laboratory(At960Tracker(), cell=empty), q, goal, stations=[far, near])
    assert found.best == 1
    assert found.range_mean[1] < found.range_mean[0]
    # constant noise: to be near is no merit, only what is seen counts
    noise = {"range_um": (3.0, 0.0), "transverse_um": (3.0, 0.0)}
    blind = laboratory(At960Tracker(**noise), cell=empty, line_of_sight=False)
    same = compared(blind, q, goal, stations=[far, near])
    assert same.u_mean[0] == pytest.approx(same.u_mean[1], rel=1e-9)


def test_one_station_is_a_comparison_too(q, goal):
    one = compared(laboratory(PaperTracker()), q, goal, stations=STATIONS[1:2])
    assert one.best == 0
    assert len(one.statements) == 1


def test_too_few_visible_poses_are_told_and_are_no_design(q, goal):
    found = compared(laboratory(), q[:150], goal)
    short = [k for k in range(5) if 0 < found.visible[k] < 29]
    assert short
    for k in short:
        assert "but no design: 29 poses wanted" in found.statements[k]
        assert np.isinf(found.u_mean[k])


def test_if_no_station_sees_anything_that_is_an_error(q, goal):
    with pytest.raises(
        InputError, match=r"none of 2 stations can be used: station 1 at .* nothing"
    ):
        compared(laboratory(), q, goal, stations=[STATIONS[0], STATIONS[4]])


def test_numbers_that_nothing_determines_have_infinite_uncertainty(goal):
    blocks = np.random.default_rng(0).normal(size=(30, 6, PARAMETERS.n_free))
    assert np.isfinite(goal_uncertainty(blocks, goal)).all()
    assert np.isinf(goal_uncertainty(blocks[:2], goal)).all()
    blocks[:, :, 3] = 0.0
    assert np.isinf(goal_uncertainty(blocks, goal)).all()
    blocks[:, :, 3] = blocks[:, :, 4]
    assert np.isinf(goal_uncertainty(blocks, goal)).all()


def test_a_grid_has_its_corners_and_its_middle():
    grid = {"from_mm": (0.0, 10.0, 5.0), "to_mm": (100.0, 30.0, 25.0), "count": (2, 3, 1)}
    found = station_grid(StationSettings.model_validate({"grid": grid}))
    assert found.shape == (6, 3)
    np.testing.assert_allclose(found[[0, -1]] * 1e3, [[0, 10, 15], [100, 30, 15]])
    np.testing.assert_allclose(
        station_grid(StationSettings(list_mm=((1.0, 2.0, 3.0),))), [[0.001, 0.002, 0.003]]
    )
    assert station_grid(StationSettings()).shape == (0, 3)

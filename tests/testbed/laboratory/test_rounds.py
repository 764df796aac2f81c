"""Several targets from several places: readings, noise and visibility against plain numpy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.arrays import frozen
from calib.measurement.observations import DISTANCE, GIVEN
from testbed.laboratory.bench import open_bench
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.tracker.rounds import nominal_fixtures, true_fixtures
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.studies import load_scenario

SMALL = {
    "pool.size": 30,
    "test.poses": 10,
    "trial": [{"name": "random", "poses": 20, "method": "random"}],
}
POSES = {
    "tracker.measures": "pose",
    "fixtures": {
        "stations_mm": [[2200.0, 2400.0, 600.0]],
        "anchors_mm": {"P1": [1500.0, 400.0, -200.0]},
    },
}
EXACT = {
    "tracker.range_um": [1e-6, 0.0],
    "tracker.transverse_um": [1e-6, 0.0],
    "tracker.centering_um": 0.0,
    "tracker.rotation_mdeg": [1e-6] * 3,
    "fixtures.distance_um": [1e-6, 0.0],
    "truth.joint_repeatability_mdeg": 0.0,
}
"""Noise of a picometre: readings are what geometry says to a tenth of a nanometre."""


@cache
def laboratory(*kinds):
    tables = {"exact": EXACT, "poses": POSES, "small": SMALL}
    changes = {key: value for kind in kinds for key, value in tables[kind].items()}
    scenario = changed(load_scenario("stations"), changes)
    return open_laboratory(scenario, make_setting(scenario))


def test_a_scenario_without_fixtures_has_no_rounds():
    for scene in ("quick", "position_only", "plan_tx60"):
        scenario = load_scenario(scene)
        bench = open_bench(scenario)
        assert bench.rounds == ()
        assert bench.robot.model.fixtures.n_numbers == 0
        assert "fixtures" not in scenario.document()


def test_the_rounds_are_every_pair_of_a_place_and_a_target_in_order():
    names = [one.name for one in laboratory("small").rounds]
    assert names == [*(f"station {k}, {name}" for k in "12" for name in "ABC"), "P1, A", "P2, A"]
    poses = [one.name for one in laboratory("small", "poses").rounds]
    assert poses == ["station 1", "station 2", "P1, tool"]


def test_readings_are_what_true_places_say():
    """Each reading by hand, from the true robot, the true places and nothing of the project."""
    lab = laboratory("small", "exact")
    true, places = lab.setting.true, lab.setting.true.fixtures
    table = lab.measure_pool(np.arange(30), "by hand")
    T = true.poses(table.q)
    A = np.array([60.0, 0.0, 90.0]) / 1e3
    for row in range(len(table)):
        k = table.reflector[row]
        assert (k == GIVEN) == (table.offset[row] == A).all()
        c = A if k == GIVEN else places.reflectors[k]
        p = T[row, :3, :3] @ c + T[row, :3, 3]
        if table.kind[row] == DISTANCE:
            d = np.sqrt(((p - places.anchors[table.anchor[row]]) ** 2).sum())
            assert table.distance[row] == pytest.approx(d, abs=1e-10)
            assert not table.position[row].any()
            continue
        if table.station[row]:
            S = places.stations[0]
            p = S[:3, :3].T @ (p - S[:3, 3])
        np.testing.assert_allclose(table.position[row], p, rtol=0, atol=1e-10)
    assert set(table.station) == {0, 1}
    assert set(table.reflector) == {GIVEN, 0, 1}


def test_poses_from_a_second_station_are_in_its_axes():
    lab = laboratory("small", "poses", "exact")
    table = lab.measure_pool(np.arange(30), "by hand")
    T, S = lab.setting.true.poses(table.q), lab.setting.true.fixtures.stations[0]
    assert set(table.kind) == {"pose", "distance"}
    for row in np.flatnonzero(table.station == 1):
        np.testing.assert_allclose(
            table.position[row], S[:3, :3].T @ (T[row, :3, 3] - S[:3, 3]), rtol=0, atol=1e-10
        )
        np.testing.assert_allclose(
            table.rotation[row], S[:3, :3].T @ T[row, :3, :3], rtol=0, atol=1e-9
        )


def test_what_is_found_lies_off_as_the_scenario_says_and_what_is_known_does_not():
    scenario = load_scenario("stations")
    chain = open_bench(scenario).robot.model.chain
    nominal = nominal_fixtures(scenario, chain)
    np.testing.assert_array_equal(nominal.reflectors[0], np.array([-30.0, 52.0, 90.0]) / 1e3)
    np.testing.assert_array_equal(nominal.stations[0][:3, 3], np.array([2.2, 2.4, 0.6]))
    steps = []
    for seed in range(400):
        other = changed(scenario, {"seed": seed})
        steps.append(nominal.step_to(true_fixtures(other, nominal)))
    steps = np.array(steps)
    assert (steps[:, 6:9] == 0).all()  # P1 is known
    sd = np.array([0.5e-3] * 3 + [np.radians(0.05)] * 3)
    wanted = np.concatenate([np.full(6, 0.5e-3), np.full(3, 0.5e-3), sd])
    # 400 draws know a standard deviation to 3.5 %; four times that
    np.testing.assert_allclose(np.delete(steps, [6, 7, 8], 1).std(axis=0), wanted, rtol=0.15)
    fixed = changed(scenario, {"fixtures.place_sd_mm": 0.0, "fixtures.turn_sd_deg": 0.0})
    still = true_fixtures(fixed, nominal)
    np.testing.assert_allclose(nominal.step_to(still), 0.0, atol=1e-15)


def test_a_further_station_moves_no_number_of_the_first_rounds():
    lab = laboratory("small")
    settings = lab.scenario.fixtures
    more = {"stations_mm": [*settings.stations_mm, [0.0, 3000.0, 500.0]]}
    scenario = changed(lab.scenario, {f"fixtures.{key}": value for key, value in more.items()})
    # the pool may differ, as more poses can be measured: the same poses are asked for
    other = open_laboratory(scenario, make_setting(scenario))
    q, ids = lab.pool_q[:12], np.arange(12)
    one, two = (each.measure(q, ids, "visit", "x") for each in (lab, other))
    assert len(two) > len(one)
    for k in range(len(lab.rounds)):
        mine = one.rows(lab.rounds[k].rows_in(one))
        named = next(r for r in other.rounds if r.name == lab.rounds[k].name)
        theirs = two.rows(named.rows_in(two))
        np.testing.assert_array_equal(mine.position, theirs.position)
        np.testing.assert_array_equal(mine.distance, theirs.distance)


def test_rows_exist_where_cone_and_beam_let_them():
    """The cone by its definition, the beam by a simulator of the test's own."""
    lab = laboratory("small")
    chain = lab.robot.model.chain
    rays = Simulator(lab.robot, chain)
    T = lab.robot.model.poses(lab.pool_q)
    seen = lab.visible(lab.pool_q)
    table = lab.measure_pool(np.arange(30), "seen")
    for k, one in enumerate(lab.rounds):
        target = np.einsum("mij,j->mi", T[:, :3, :3], one.tracker.reflector) + T[:, :3, 3]
        beam = one.tracker.station - target
        angle = np.arccos(np.einsum("mi,mi->m", T[:, :3, 2], beam) / np.linalg.norm(beam, axis=1))
        wanted = (angle <= np.radians(60)) & rays.sees(
            lab.pool_q, one.tracker.station, one.tracker.reflector
        )
        np.testing.assert_array_equal(seen[:, k], wanted)
        assert set(table.pose_id[one.rows_in(table)]) == set(np.flatnonzero(wanted))
    optical = [k for k, one in enumerate(lab.rounds) if one.kind != DISTANCE]
    assert seen[:, optical].any(axis=1).all()  # every pose of the pool can be measured
    assert not seen.all()


def test_the_pool_takes_what_any_station_sees():
    """Drawn by hand from the same random numbers: kept if one station sees one reflector."""
    lab = laboratory("small")
    candidates = lab.candidates()
    alone = [
        replace(candidates, station=one.tracker.station, aim=one.tracker.reflector, others=())
        for one in lab.rounds
        if one.kind != DISTANCE
    ]
    lower, upper = lab.robot.limits.T
    q = np.random.default_rng(3).uniform(lower, upper, (3000, 6))
    any_of_them = np.any([one.first_fault(q) < 0 for one in alone], axis=0)
    np.testing.assert_array_equal(candidates.first_fault(q) < 0, any_of_them)
    assert any_of_them.sum() > max((one.first_fault(q) < 0).sum() for one in alone)


def test_the_information_of_a_pose_is_that_of_its_rows():
    """Blocks against finite differences of noise-free readings of moved nominal robots."""
    lab = laboratory("small", "exact")
    q, model = lab.pool_q[:6], lab.robot.model
    blocks, seen = lab.whitened_rows(q), lab.visible(q)
    assert blocks.shape == (6, 6 * 3 + 2, model.n_numbers)
    first = np.concatenate([[0], np.cumsum([one.equations for one in lab.rounds])])

    def readings(moved):
        T, out = moved.poses(q), np.zeros((6, 20))
        places = moved.fixtures
        for k, one in enumerate(lab.rounds):
            c = one.tracker.reflector
            c = c if one.reflector == GIVEN else places.reflectors[one.reflector]
            p = T[:, :3, :3] @ c + T[:, :3, 3]
            if one.kind == DISTANCE:
                d = np.linalg.norm(p - places.anchors[one.anchor], axis=1)
                out[:, first[k]] = d / np.sqrt(one.covariance(model, q, lab.sigma_q)[:, 0, 0])
                continue
            if one.station:
                S = places.stations[0]
                p = (p - S[:3, 3]) @ S[:3, :3]
            sigma = one.covariance(model, q, lab.sigma_q)[:, :3, :3]
            white = np.linalg.solve(np.linalg.cholesky(sigma), p[:, :, None])[:, :, 0]
            out[:, first[k] : first[k] + 3] = white
        return out

    h = 1e-6
    for number in range(model.n_numbers):
        step = np.zeros(model.n_numbers)
        step[number] = h
        slope = (readings(model.moved(step)) - readings(model.moved(-step))) / (2 * h)
        for k in range(len(lab.rounds)):
            own = slice(first[k], first[k + 1])
            wanted = slope[:, own] * seen[:, k, None]
            # rows are 1e12 per metre here; differences leave 1e-9 of that, and rounding as much
            np.testing.assert_allclose(blocks[:, own, number], wanted, rtol=1e-5, atol=2e5)


@pytest.mark.parametrize("kinds", [("small",), ("small", "poses")])
def test_stated_covariances_are_how_readings_scatter(kinds):
    """Whitened by what is stated, repeats of every round have unit variance."""
    lab = laboratory(*kinds)
    still = replace(lab.setting, true=replace(lab.setting.nominal))
    lab = open_laboratory(lab.scenario, still)
    q, ids, visits = lab.pool_q[:8], np.arange(8), 50
    tables = [lab.measure(q, ids, "scatter", repeat=k) for k in range(visits)]
    for one in lab.rounds:
        rows = one.rows_in(tables[0])
        if not len(rows):
            continue
        if one.kind == DISTANCE:
            seen = np.array([table.distance[rows] for table in tables])[:, :, None]
        else:
            seen = np.array([table.position[rows] for table in tables])
        size = seen.shape[-1]
        sigma = tables[0].covariance[rows][:, :size, :size]
        root = np.linalg.cholesky(sigma)
        white = np.linalg.solve(root, (seen - seen.mean(axis=0))[..., None])[..., 0]
        ratio = (white**2).sum() / (visits - 1) / (len(rows) * size)
        # chi-square of (visits - 1) * rows * size numbers: five of its standard deviations
        assert abs(ratio - 1) < 5 * np.sqrt(2 / ((visits - 1) * len(rows) * size)), one.name


def test_missed_shots_leave_no_row_in_any_round_of_the_tracker():
    lab = laboratory("small")
    scenario = changed(lab.scenario, {"tracker.missed": 1})
    other = open_laboratory(scenario, lab.setting)
    one, two = (each.measure_pool(np.arange(20), "missed") for each in (lab, other))
    for mine, theirs in zip(lab.rounds, other.rounds, strict=True):
        lost = len(mine.rows_in(one)) - len(theirs.rows_in(two))
        assert lost == (mine.kind != DISTANCE)


def test_time_goes_on_from_round_to_round():
    """A robot that warms up is longer in later rounds: by hand from the formula of the growth."""
    warm = {"truth.thermal_k": 10.0, "truth.thermal_h": 1.0, "truth.thermal_um_per_m_k": 23.0}
    lab = laboratory("small", "exact")
    scenario = changed(lab.scenario, warm)
    other = open_laboratory(scenario, lab.setting)
    q = frozen(np.tile(lab.pool_q[0], (1, 1)))
    table = other.measure(q, np.arange(1), "warm")
    cold = lab.measure(q, np.arange(1), "warm")
    moved = np.linalg.norm(table.position - cold.position, axis=1)
    moved[table.is_distance] = np.abs(table.distance - cold.distance)[table.is_distance]
    rounds = [k for k, one in enumerate(other.rounds) if len(one.rows_in(table))]
    share = 1 - np.exp(-np.array(rounds) * 10.0 / 3600)
    optical = ~table.is_distance
    # proportional to the growth: links of about a metre grow by 230 um at the end
    np.testing.assert_allclose(
        (moved / np.maximum(share, 1e-12))[optical & (share > 0)],
        (moved[optical][-1] / share[optical][-1]),
        rtol=0.25,
    )
    assert moved[0] < 1e-9

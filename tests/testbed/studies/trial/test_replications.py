"""Replications over one axis of arrays, held to the same ones made one after the other."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.identification.identify import identify
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import make_setting
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.estimator import Estimator
from testbed.studies.trial.play import repeats
from testbed.studies.trial.replications import all_at_once, one_by_one, replicate

COUNT, POSES = 4, 12


@cache
def laboratory(preset: str = "wen2022", **more: object) -> Laboratory:
    """A small laboratory whose trials are replicated a few times."""
    small = {"pool.size": 40, "test.poses": 20, "uncertainty.replications": COUNT}
    keys = {
        "truth": {"preset": preset},
        **small,
        **{k.replace("__", "."): v for k, v in more.items()},
    }
    scenario = changed(load_scenario("quick"), keys)
    return open_laboratory(scenario, make_setting(scenario))


def begun(of: Laboratory, mode: str = "whitened", *, loss: str = "squared"):
    """An estimator, what it found at a first visit, that visit, and the truth in its numbers."""
    visit = of.measure_pool(np.arange(POSES), "visit", "x")
    estimator = Estimator(mode, of.setting.nominal, of.free(mode), loss=loss)
    first = estimator.fit(visit)
    return estimator, first, visit, true_step(of.setting, first, visit)


@pytest.mark.parametrize("mode", ["whitened", "paper"])
def test_each_replication_is_the_one_made_alone(mode):
    of = laboratory()
    estimator, first, visit, truth = begun(of, mode)
    many, alone = (
        way(of, estimator, first, visit, truth, "x") for way in (all_at_once, one_by_one)
    )
    # fits end within 1e-10 standard deviations, of their own units
    assert (many.steps - alone.steps) / alone.stated == pytest.approx(0, abs=1e-9)
    assert many.stated == pytest.approx(alone.stated, rel=1e-9)
    assert many.nees == pytest.approx(alone.nees, rel=1e-9)
    assert many.point == pytest.approx(alone.point, abs=1e-13)
    assert np.array_equal(many.held, alone.held)
    assert repeats(estimator, first, visits(of)) == pytest.approx(
        np.array([estimator.fit(table).step for table in visits(of)]), abs=1e-12
    )


@pytest.mark.parametrize("held", ["tool.z", "base.y"])
def test_numbers_of_a_frame_that_are_held_stay_as_they_are(held):
    """As tool.z of a SCARA: else another number takes up what the product of two moves leaves."""
    of = laboratory()
    estimator, _, visit, _ = begun(of)
    free = estimator.parameters.free & (np.array(estimator.parameters.names) != held)
    estimator = replace(estimator, parameters=replace(estimator.parameters, free=free))
    first = estimator.fit(visit)
    given = of, estimator, first, visit, np.zeros(len(first.names)), "x"
    many, alone = all_at_once(*given), one_by_one(*given)
    # 1e-10 of their units, which the misfit that is left makes some ten times larger
    assert (many.steps - alone.steps) / alone.stated == pytest.approx(0, abs=1e-8)
    again = repeats(estimator, first, visits(of))
    assert again == pytest.approx(
        np.array([estimator.fit(table).step for table in visits(of)]), abs=1e-12
    )


def visits(of):
    return [of.measure_pool(np.arange(POSES), "visit", "x", repeat=k) for k in (1, 2)]


def test_what_arrays_do_not_know_is_replicated_one_by_one():
    of = laboratory()
    estimator, first, visit, truth = begun(of, loss="huber")
    assert all_at_once(of, estimator, first, visit, truth, "x") is None
    found = replicate(of, estimator, first, visit, truth, "x")
    assert found is not None
    alone = one_by_one(of, estimator, first, visit, truth, "x")
    assert np.array_equal(found.nees, alone.nees)
    assert found.mean_error == pytest.approx(
        [np.linalg.norm(of.setting.test_true[:, :3, 3] - p, axis=1).mean() for p in alone.point]
    )
    points = replace(of, tracker=replace(of.tracker, measures="point"))
    assert points.visits(visit.q[None], "replication", "x", count=2) is None
    assert estimator.fit_many(of.visits(visit.q[None], "x", count=2), first) is None


@pytest.mark.parametrize("preset", ["wen2022", "elastic"])
@pytest.mark.parametrize("scatter", [0.0, 1.0])
@pytest.mark.parametrize("own", [False, True])
def test_visits_together_read_what_each_reads(preset, scatter, own):
    """Bit for bit: the same body tree and the same streams, with scatter, sag and own poses."""
    of = laboratory(preset, truth__joint_repeatability_mdeg=scatter)
    at = np.arange(2 * POSES).reshape(2, POSES) if own else np.arange(POSES)[None]
    tables = of.visits(of.pool_q[at], "visit", "x", count=2)
    for k in range(2):
        one = of.measure_pool(at[k if own else 0], "visit", "x", repeat=k)
        for name in ("q", "position", "rotation", "covariance"):
            np.testing.assert_array_equal(getattr(tables.one(k), name), getattr(one, name))
        assert np.array_equal(tables.one(k).kind, one.kind)


def test_a_region_of_one_size_covers_what_it_holds_when_it_is_moved():
    from calib.uncertainty.tool_point import tool_statement

    of = laboratory()
    nominal, q = of.setting.nominal, of.setting.test_q[:5]
    fit = identify(nominal, begun(of)[2], of.free("whitened"))
    stated = tool_statement(fit.model, q, fit.full_covariance)
    rng, true = np.random.default_rng(0), stated.position
    centers = true + 2e-5 * rng.standard_normal((3, 5, 3))
    held = [replace(stated, position=one).holds(true) for one in centers]
    assert np.array_equal(stated.covers(true - centers), held)
    assert 0 < np.mean(held) < 1

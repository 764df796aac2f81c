"""Records of a campaign: order, streams, and trials that leave each other alone."""

from dataclasses import replace

import numpy as np
import pytest

from testbed.laboratory.truth.robot import TrueRobot
from testbed.scenario.read import changed
from testbed.store.codec import pack
from testbed.studies import load_scenario
from testbed.studies.wen2022.records import paper_budget_of, tool_point_of
from tests import campaign


@pytest.fixture(scope="module")
def small():
    """Quick, but smaller."""
    return changed(
        load_scenario("quick"),
        {
            "pool.size": 80,
            "test.poses": 12,
            "uncertainty.repeats": 2,
            "uncertainty.replications": 3,
            "studies.random_sets": 5,
            "studies.pose_count": True,
            "studies.pose_count_max": 40,
            "studies.paper_budget": True,
            "studies.tool_point": True,
            "uncertainty.draws": 2000,
        },
    )


@pytest.fixture(scope="module")
def records(small):
    """All its records, made once for tests that look at some."""
    return campaign.made(small)


def same(a, b):
    """Bit for bit."""
    a, b = pack(a), pack(b)
    return a.keys() == b.keys() and all(equal(a[k], b[k]) for k in a)


def equal(a, b):
    """One packed value; an undefined figure (nan) equals itself."""
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    return a == b


def test_another_seed_is_another_robot(small, records):
    one = records["setting"]
    other = campaign.compute(changed(small, {"seed": 2}), "setting", None)
    assert not np.array_equal(one.true.chain.links, other.true.chain.links)
    assert not np.array_equal(one.pool_q, other.pool_q)


def test_held_out_poses_are_not_in_the_pool(records):
    setting = records["setting"]
    pool = {row.tobytes() for row in setting.pool_q}
    assert not any(row.tobytes() in pool for row in setting.test_q)


def test_planning_and_identification_never_see_the_truth(small, records, monkeypatch):
    """The same readings under a falsified truth: same selection, same estimate, other judgment."""
    honest = records["designed-29"]
    setting, visit = records["setting"], records["validation"]
    shifted = setting.test_true.copy()
    shifted[:, 0, 3] += 0.01
    lie = replace(
        setting,
        true=replace(setting.true, chain=setting.true.chain.moved(np.full(42, 1e-4))),
        test_true=shifted,
    )
    monkeypatch.setattr(
        "testbed.laboratory.truth.laboratory.TrueRobot",
        lambda *_: TrueRobot(setting.true, np.zeros(6)),
    )
    judges = replace(visit, judge_true=visit.judge_true + 0.01)
    false = {"setting": lie, "validation": judges}
    told = campaign.compute(small, "designed-29", false.__getitem__)
    assert np.array_equal(honest.selection.indices, told.selection.indices)
    for one, other in zip(honest.estimates, told.estimates, strict=True):
        assert same(one.identification, other.identification)
        assert np.array_equal(one.repeated, other.repeated)
        assert other.comparison.accuracy_after.mean > 0.009
    one, other = (trial.estimates[0].statement for trial in (honest, told))
    assert one.trust == other.trust
    assert np.array_equal(one.radius, other.radius)
    assert one.attained[0] > 0.5 > other.attained[0] == 0


def test_the_campaign_gathers_what_was_asked_for(small, records):
    whole = campaign.gather(small, records.__getitem__)
    assert [trial.name for trial in whole.trials] == ["designed-29", "random-29"]
    assert whole.pose_count is not None
    assert paper_budget_of(whole) is not None
    assert tool_point_of(whole).source == (
        "table 3 best",
        "table 3 random",
        "ours best",
        "ours random",
    )
    without = changed(small, {"studies.pose_count": False, "studies.tool_point": False})
    bare = campaign.gather(without, records.__getitem__)
    assert bare.pose_count is None
    assert tool_point_of(bare) is None

"""Tables of a scenario that do not fit together, and what a scenario asks of its robot."""

import pytest

from calib.errors import InputError
from testbed.robots.catalog import load_robot
from testbed.scenario.checks import check_robot
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from tests import campaign

RANDOM = [{"name": "a", "poses": 20, "method": "random"}]
DESIGNED = {"name": "a", "poses": 20, "method": "exchange"}


def test_indices_alone_may_be_computed_of_as_many_random_sets_as_wanted():
    changes = {"studies.random_sets": 10_000, "studies.paper_budget": False}
    assert changed(load_scenario("wen2022"), changes).studies.random_sets == 10_000
    assert changed(load_scenario("wen2022"), {"studies.random_sets": 1000})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"identification.free": []}, "frees nothing"),
        (
            {"identification.free": ["theta1", "tool.x"], "identification.tool": "fixed"},
            'free has "tool.x", and tool is "fixed"',
        ),
    ],
)
def test_what_is_free_must_be_free(changes, message):
    scenario = changed(load_scenario("quick"), changes)
    with pytest.raises(InputError, match=message):
        check_robot(scenario, load_robot(scenario.robot), where="x.toml")


@pytest.mark.parametrize("method", ["greedy", "fedorov", "detmax", "best_of_random"])
@pytest.mark.parametrize("criterion", ["A", "E", "O2", "O5"])
def test_every_method_takes_every_index_in_both_kinds_of_rows(method, criterion):
    for rows in ("paper", "whitened"):
        trial = [DESIGNED | {"method": method, "criterion": criterion, "rows": rows}]
        assert changed(load_scenario("quick"), {"trial": trial}).trial[0].method == method


def test_one_reflector_and_a_goal_for_another_point_of_the_tool_are_refused():
    changes = {
        "trial": [DESIGNED | {"poses": 40, "criterion": "V"}],
        "plan.point_mm": [0.0, 0.0, 50.0],
        "pool.size": 60,
        "test.poses": 5,
    }
    scenario = changed(load_scenario("position_only"), changes)
    with pytest.raises(InputError, match="a point that the tracker sees"):
        campaign.compute(scenario, "setting", None)


def test_a_frame_held_fixed_leaves_the_rest_of_a_named_set():
    scenario = changed(load_scenario("wen2022"), {"identification.free": "identifiable"})
    check_robot(scenario, load_robot(scenario.robot), where="x.toml")


@pytest.mark.parametrize(("poses", "needed"), [(3, 6), (5, 6)])
def test_too_few_poses_are_refused_with_the_setting_before_any_trial(poses, needed):
    trial = [{"name": "few", "poses": poses, "method": "random"}]
    scenario = changed(load_scenario("quick"), {"trial": trial, "pool.size": 30, "test.poses": 5})
    with pytest.raises(InputError, match=f"equations for 30 parameters; write poses = {needed}"):
        campaign.compute(scenario, "setting", None)

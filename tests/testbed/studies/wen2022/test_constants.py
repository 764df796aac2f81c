"""The paper's constants as keys: each does what it says, and nothing else."""

import numpy as np
import pytest

from calib.design import Problem, detmax
from calib.errors import InputError
from testbed.laboratory.truth.laboratory import open_laboratory
from testbed.scenario.read import changed
from testbed.studies.trial.play import criterion_of, select
from testbed.studies.wen2022.budget import fewer_than_usual, location_sets, paper_budget_study
from testbed.studies.wen2022.claims import examine
from testbed.studies.wen2022.records import paper_budget_of
from testbed.studies.wen2022.report_paper import paper_section
from tests.reported import assert_same, paper_campaign

QUARTERS = ((False, False), (False, True), (True, False), (True, True))


def budget_with(**keys):
    """The budget of the campaign's robot with other constants; setting and trials are the same."""
    campaign = paper_campaign()
    scenario = changed(campaign.scenario, {f"budget.{key}": value for key, value in keys.items()})
    return paper_budget_study(scenario, campaign.setting, campaign.records)


def test_the_budget_with_the_papers_constants_is_the_one_of_the_campaign():
    assert_same(budget_with(poses=50, location_border_mm=[250.0, 0.0]), usual())


def usual():
    return paper_budget_of(paper_campaign())


def test_an_environment_is_part_of_every_combined_uncertainty_and_of_no_contributor():
    bare, known = usual(), budget_with(environment_mm=0.02, environment_deg=0.003)
    lengths = [name[0] in "da" and not name.startswith("alpha") for name in bare.names]
    u_c = np.where(lengths, 2e-5, np.radians(0.003))
    np.testing.assert_allclose(known.environment, u_c, rtol=1e-14)
    assert not bare.environment.any()
    for part in ("best_repeatability", "repeatability", "pose_number", "location"):
        np.testing.assert_array_equal(getattr(known, part), getattr(bare, part))
    np.testing.assert_allclose(known.best**2, bare.best**2 + u_c**2, rtol=1e-12)
    np.testing.assert_allclose(known.random**2, bare.random**2 + u_c**2, rtol=1e-12)


def test_sizes_of_random_sets_move_the_number_of_poses_alone():
    bare, other = usual(), budget_with(pose_numbers=[20, 40, 60])
    for part in ("best", "repeatability", "location"):
        np.testing.assert_array_equal(getattr(other, part), getattr(bare, part))
    assert (other.pose_number != bare.pose_number).all()
    assert (budget_with(poses=20).repeatability != bare.repeatability).all()


def test_regions_meet_at_the_border_and_have_the_poses_that_are_asked_for():
    campaign = paper_campaign()
    scenario = changed(
        campaign.scenario, {"budget.location_border_mm": [300.0, 50.0], "budget.location_poses": 8}
    )
    sets = location_sets(campaign.setting, scenario.budget, np.random.default_rng(1))
    x, y = campaign.setting.pool_nominal[:, :2, 3].T
    assert [len(places) for places in sets] == [8] * 4
    for places, right, left in zip(sets, (0, 0, 1, 1), (0, 1, 0, 1), strict=True):
        assert len(set(places)) == 8
        assert ((x[places] > 0.3) == right).all()
        assert ((y[places] > 0.05) == left).all()


def test_a_region_with_too_few_poses_is_refused_with_its_border():
    with pytest.raises(InputError, match=r"region 3 of the pool has \d poses.*x = 690 mm"):
        budget_with(location_border_mm=[690.0, 0.0])


def test_a_region_with_fewer_poses_than_asked_for_is_refused_or_told():
    """The paper's own number shrinks with the region, and the report says so; another does not."""
    campaign = paper_campaign()
    setting, budget = campaign.setting, campaign.scenario.budget
    x, y = setting.pool_nominal[:, :2, 3].T
    counts = [int((((x > 0.25) == a) & ((y > 0.0) == b)).sum()) for a, b in QUARTERS]

    def sizes(wanted):
        own, rng = budget.model_copy(update={"location_poses": wanted}), np.random.default_rng(1)
        return [len(places) for places in location_sets(setting, own, rng)]

    found = sizes(50)
    assert found == [min(50, count) for count in counts]
    least, k = min(counts), counts.index(min(counts)) + 1
    assert least < 50
    assert sizes(least) == [least] * 4
    told = rf"region {k} of the pool has {least} poses, and .* asks for {least + 1}; choose fewer, "
    with pytest.raises(InputError, match=told):
        sizes(least + 1)
    a, b, c, d = found
    n = len(setting.pool_q)
    (note,) = [
        block.note
        for block in paper_section(campaign, examine(campaign)).blocks
        if "Table 3" in getattr(block, "caption", "")
    ]
    large = [size for size in budget.pose_numbers if size > n]
    assert f"the regions have {a}, {b}, {c} and {d} poses instead of 50." in note
    assert ("are all" in note) == bool(large)
    one = budget.model_copy(update={"location_poses": least, "pose_numbers": (30, n + 1, n + 2)})
    assert fewer_than_usual(setting, one) == (
        f"The pool is small: sets of {n + 1} and {n + 2} poses are all {n} of it."
    )
    assert not fewer_than_usual(setting, one.model_copy(update={"pose_numbers": (30, n)}))


def test_the_constants_of_detmax_are_those_of_the_trial():
    campaign = paper_campaign()
    bench = open_laboratory(campaign.scenario, campaign.setting)
    settings = campaign.scenario.trial_named("best-29")
    blocks, criterion = bench.design_blocks("paper"), criterion_of(bench, settings)
    problem = Problem.of_blocks(blocks, 29, criterion)

    def chosen(constants):
        own = settings.model_copy(update={"detmax": constants})
        return select(blocks, own, np.random.default_rng(2), criterion)

    assert settings.detmax == (40, 2, 1, 80)
    searches = {}
    for a, b, c, d in ((40, 2, 1, 80), (0, 3, 5, 2), (1, 4, 2, 2)):
        direct = detmax(problem, np.random.default_rng(2), a=a, b=b, c=c, d=d)
        np.testing.assert_array_equal(chosen((a, b, c, d)).indices, direct.indices)
        searches[a, b, c, d] = chosen((a, b, c, d)).trace
        # it ends after d searches in a row that brought nothing
        assert len(set(searches[a, b, c, d][-d - 1 :])) == 1
    assert len(searches[40, 2, 1, 80]) > 80 > len(searches[0, 3, 5, 2])
    assert len(searches[0, 3, 5, 2]) != len(searches[1, 4, 2, 2])

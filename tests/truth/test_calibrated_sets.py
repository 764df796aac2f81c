"""What is said of the paper's sets among a hundred random ones holds at other seeds too."""

import re

import pytest

from testbed.assets import scenes
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.wen2022.calibrated_sets.summary import rank_of
from tests.campaign import compute

pytestmark = [pytest.mark.truth, pytest.mark.study]
SEEDS = range(1, 6)


def ranks(seed):
    """Ranks of the scene's designed sets at one seed, paper's estimator; no other record is made.

    A trial's sets and first visit depend neither on the other trials nor on its repeats.
    """
    scene = load_scenario("wen2022")
    designed = [trial for trial in scene.document()["trial"] if trial["method"] != "random"]
    shorter = {"seed": seed, "uncertainty.replications": 0, "uncertainty.repeats": 2}
    scenario, records = changed(scene, {**shorter, "trial": designed}), {}

    def get(key):
        if key not in records:
            records[key] = compute(scenario, key, get)
        return records[key]

    return [rank_of(one, "paper") for one in get("random_calibrations").sets]


@pytest.fixture(scope="module")
def found():
    """Ranks (seed, trial)."""
    return [ranks(seed) for seed in SEEDS]


def test_the_readme_of_the_scenes_states_the_ranks_at_five_other_seeds(found):
    text = (scenes() / "README.md").read_text(encoding="utf-8")
    for k, name in enumerate(("best-61", "best-29")):
        better = [one[k].better_than for one in found]
        said = re.search(rf"{name} is better than \d+[^0-9]*(?:1 to 5 )?than (\d+) to (\d+)", text)
        assert said is not None, name
        assert tuple(map(int, said.groups())) == (min(better), max(better))


def test_at_no_seed_is_half_of_the_printed_gain_found(found):
    for one in found:
        for rank in one:
            assert rank.sets == 100
            assert rank.designed > (1 - 0.12) * rank.random.mean


def test_at_every_seed_the_o1_set_ends_above_all_random_ones_on_its_own_poses(found):
    """And the O2 set below all: what is left on fitted poses says little of a calibration."""
    for first, second in found:
        assert (first.own_lower_than, second.own_lower_than) == (0, 100)

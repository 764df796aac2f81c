"""Campaigns one after the other in one process: neither memory nor threads nor files pile up."""

import gc
import shutil

import pytest

from testbed.recording.timeline import visit
from testbed.recording.write import story_bytes
from testbed.run.play import play_run
from testbed.scenario.read import changed
from testbed.store import layout
from testbed.studies import load_scenario
from tests.recorded import SMALL
from tests.testbed.studies.trial.fake_campaign import Fake, scenario
from tests.toy_story import STOPS, chapter, held, story

FIRST = 10
"""Campaigns until everything that is kept for the next one is there."""


class Recorded(Fake):
    """A fake whose recording is Rerun's."""

    def derive(self, name, played):
        if name == layout.RECORDING:
            return story_bytes(story(chapter("first", visit(STOPS))))
        return super().derive(name, played)


def test_ten_folders_in_one_process_leave_nothing_behind(tmp_path):
    def play(k):
        fake = Recorded()
        play_run(scenario(), tmp_path / str(k), studies=(fake,), derive=fake.derive)

    for k in range(2):
        play(k)
    before = held()
    for k in range(2, 2 + FIRST):
        play(k)
    after = held()
    assert after["Threads"] <= before["Threads"]
    assert after["files"] <= before["files"]
    assert after["VmRSS"] - before["VmRSS"] < 10e3  # kB; one recording alone kept 22e3


@pytest.mark.study
def test_two_hundred_campaigns_in_one_process_stay_flat(tmp_path):
    """About twenty minutes."""
    base, out, seen = load_scenario("quick"), tmp_path / "run", []
    for seed in range(200):
        play_run(changed(base, {**SMALL, "seed": seed}), out)
        shutil.rmtree(out)
        gc.collect()
        seen.append(held())
    after_ten, last = seen[FIRST - 1], seen[-1]
    assert last["Threads"] <= after_ten["Threads"]
    assert last["VmRSS"] - after_ten["VmRSS"] < 50e3  # kB

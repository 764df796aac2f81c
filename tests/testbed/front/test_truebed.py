"""The product's front: what it hands out is what the rooms make, in memory and on disk."""

import json
from dataclasses import fields
from inspect import getmembers

import numpy as np
import pytest
from matplotlib.figure import Figure

import truebed
from calib.errors import InputError
from testbed.run.export import export_campaign
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from testbed.studies.protocol import Records
from tests import planned
from tests.fresh import printed
from tests.testbed.front.conftest import SMALL
from truebed import plots


@pytest.fixture(scope="module")
def folders(tmp_path_factory, campaign):
    """The folders of a run, of its files, and of what was identified from these."""
    folder = tmp_path_factory.mktemp("front")
    scenario = changed(load_scenario("quick"), SMALL)
    again = truebed.run(scenario, folder / "run")
    assert again.trials[0].name == campaign.trials[0].name
    robot = truebed.robot("staubli_tx60")
    export_campaign(campaign, robot, folder / "files")
    written = truebed.identify(robot, folder / "files" / "session.toml", folder / "identified")
    return folder, written


def test_a_campaign_runs_in_memory_and_comes_back_from_its_folder(folders, campaign):
    folder, written = folders
    loaded = truebed.load(folder / "run")
    one, other = (c.trials[0].estimates[0].identification for c in (campaign, loaded))
    assert np.array_equal(one.step, other.step)

    inside = truebed.identify("staubli_tx60", folder / "files" / "session.toml")
    again = truebed.load(str(folder / "identified"))
    for found in (written, again):
        assert np.array_equal(found.fits[0].identification.step, inside.fits[0].identification.step)
        assert repr(found) == repr(inside)

    session = truebed.load(folder / "files")
    assert again.tables()["errors"].rows == len(session.measurements)
    (_, after) = plots.errors(Figure().add_subplot(), again).lines
    missed = 1e3 * again.fit.misses.position[again.split.is_test]
    np.testing.assert_allclose(after.get_xdata(), np.sort(missed))
    assert truebed.load(folder / "identified" / "robot").name.startswith("staubli_tx60")


def one_level_down(loaded):
    """What hangs on an object that was loaded, by name; members of tuples one by one."""
    names = [field.name for field in fields(loaded)]
    names += [name for name, _ in getmembers(type(loaded), lambda one: isinstance(one, property))]
    for name in dict.fromkeys(names):
        value = getattr(loaded, name)
        parts = value if isinstance(value, tuple) else (value,)
        yield from ((f"{type(loaded).__name__}.{name}", part) for part in parts)


def test_whatever_hangs_on_what_is_loaded_says_what_it_is_in_a_line_or_two(folders):
    """An object of ours that a notebook shows: arrays and mappings of names are Python's own."""
    folder, _ = folders
    seen = set()
    for place in ("run", "files", "identified", "identified/robot"):
        loaded = truebed.load(folder / place)
        for name, part in [(place, loaded), *one_level_down(loaded)]:
            if not type(part).__module__.startswith(("calib", "testbed")):
                continue
            seen.add(type(part).__name__)
            assert len(repr(part)) < 200, (name, repr(part))
            assert "\n" not in repr(part), name
    assert {"Scenario", "Records", "Trial", "SetUp", "Fixtures", "HandBack", "Visual"} <= seen
    shown = repr(truebed.load(folder / "run").scenario)
    assert shown == "Scenario('quick', seed 1, staubli_tx60, 2 trials)"
    assert repr(Records({"setting": 1, "one": 2}, {"other": "no"})) == (
        "Records(setting, one; 1 failed)"
    )


@pytest.mark.slow
def test_a_plan_is_made_and_its_numbers_come_back(tmp_path):
    with planned.few_rehearsals():
        made = truebed.plan(planned.scenario(planned.QUICK), tmp_path / "plan")
        alone = truebed.plan(planned.scenario(planned.BARE))
    numbers = truebed.load(tmp_path / "plan")
    assert numbers["poses"] == len(made.places)
    assert "a plan's folder" in repr(numbers)
    assert dict(numbers) == json.loads((tmp_path / "plan" / "plan.json").read_bytes())
    assert len(numbers) == len([*numbers])
    stops = numbers.tables()["plan"]["role"].tolist()
    assert made.tables()["stops"]["role"].tolist() == [
        role for role in stops if role in ("identify", "test")
    ]
    np.testing.assert_allclose(made.tables()["goal"]["u_um"], 1e6 * made.u)
    assert len(alone.places) == len(made.places)


def test_what_is_no_folder_is_not_loaded(tmp_path):
    with pytest.raises(InputError, match="nosuch: does not exist; give a folder that truebed wr"):
        truebed.load(tmp_path / "nosuch")
    (tmp_path / "robot.toml").write_text("")
    with pytest.raises(InputError, match=r"robot.toml: is a file; give a folder that truebed wr"):
        truebed.load(tmp_path / "robot.toml")


def test_the_front_shows_its_verbs_and_plots_and_nothing_else():
    code = (
        "import sys, truebed; print(*dir(truebed)); print('matplotlib' in sys.modules);"
        "print(callable(truebed.plots.errors)); print(hasattr(truebed, 'plot'))"
    )
    assert printed(code) == [
        "Calibration", "Campaign", "CycleResult", "Plan", "Robot", "Scenario", "Session",
        "VirtualLaboratory", "export", "identify", "iso9283", "laboratory", "lesson", "load",
        "plan", "plots", "robot", "run", "save", "scene", "write_robot", "False", "True", "False",
    ]  # fmt: skip

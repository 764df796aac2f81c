"""The register: shipped studies are walled off from the rest, and others join without a line."""

import re
from importlib.metadata import EntryPoint
from itertools import chain
from pathlib import Path

import pytest

from calib.errors import InputError
from testbed import studies
from testbed.run.play import load_run, play_run
from testbed.run.result import read_result
from testbed.scenario.hashes import scenario_hash
from testbed.store import layout, npz
from testbed.studies.protocol import Study
from tests import toy_study
from tests.recorded import column, store
from tests.testbed.studies.trial.fake_campaign import content

ROOT = Path(__file__).parents[3]
SMALL = {
    "format": 1,
    "name": "toys",
    "seed": 3,
    "robot": "staubli_tx60",
    "pool": {"size": 40},
    "test": {"poses": 8},
    "uncertainty": {"repeats": 2, "replications": 0, "draws": 2000},
    "identification": {"estimators": ["whitened"]},
    "studies": {"random_sets": 0},
    "trial": [{"name": "best", "poses": 16, "method": "greedy"}],
}
TOYS = SMALL | {"toy": {"robots": 7, "shots": 6}}


@pytest.fixture
def toys(monkeypatch):
    """The toy study, as if its distribution were installed."""
    entry = EntryPoint("toy", "tests.toy_study:STUDY", studies.GROUP)
    offered = {"toy": [entry]}
    monkeypatch.setattr(studies, "_entries", lambda: [*chain.from_iterable(offered.values())])
    studies.study_named.cache_clear()
    monkeypatch.setattr(toy_study.STUDY, "played", [])
    monkeypatch.setattr(toy_study.STUDY, "interrupted_at", None)
    yield offered
    studies.study_named.cache_clear()


@pytest.mark.parametrize("name", studies.SHIPPED)
def test_every_shipped_study_keeps_the_protocol_and_its_folder_s_name(name):
    study = studies.study_named(name)
    assert isinstance(study, Study)
    assert study.name == name
    assert study.settings is None or set(study.settings.keys) <= set(study.keys)


def test_no_two_studies_share_a_record_key():
    keys = [key for name in studies.SHIPPED for key in studies.study_named(name).keys]
    assert len(set(keys)) == len(keys)


def test_a_toy_study_runs_reports_and_records_without_a_line_changed_elsewhere(toys, tmp_path):
    outcome = play_run(studies.scenario_of(TOYS), tmp_path / "toys")
    assert toy_study.STUDY.played == [0, 1, 2, 3]
    sd = outcome.records.get(toy_study.KEY, toy_study.Spread).sd
    assert len(sd) == 7
    result = read_result(tmp_path / "toys")
    assert result["toy"] == {"mean_um": float(sd.mean()) * 1e6}
    assert result["verdict"]["sentence"].startswith("Shots lie ")
    _, arrays = npz.from_bytes((tmp_path / "toys" / layout.ARRAYS).read_bytes())
    assert arrays["toy/sd_m"].tolist() == sd.tolist()
    html = (tmp_path / "toys" / layout.REPORT).read_text(encoding="utf-8")
    assert "toys agree" in html
    assert "Toys come first." in html
    assert "Buy more toys." in html
    assert html.index('id="toy"') < html.index('id="accuracy"')
    opened = store(tmp_path / "toys" / layout.RECORDING)
    assert ["toy"] in column(opened, "/phase", "StateChange:state")[1]
    assert len(list((tmp_path / "toys" / layout.PARTS).iterdir())) == 4
    again = load_run(tmp_path / "toys")
    assert again.records.get(toy_study.KEY, toy_study.Spread).sd.tolist() == sd.tolist()


def test_a_toy_study_goes_on_between_its_pieces(toys, tmp_path):
    scenario, whole, cut = studies.scenario_of(TOYS), tmp_path / "whole", tmp_path / "cut"
    play_run(scenario, whole)
    toy_study.STUDY.played.clear()
    toy_study.STUDY.interrupted_at = 2
    with pytest.raises(KeyboardInterrupt):
        play_run(scenario, cut)
    assert sorted(path.name for path in (cut / layout.PARTS).iterdir()) == [
        "toy.000000.npz", "toy.000001.npz"
    ]  # fmt: skip
    toy_study.STUDY.interrupted_at = None
    play_run(scenario, cut, resume=True)
    assert toy_study.STUDY.played == [0, 1, 2, 3]
    names = [name for name in content(whole) if name != layout.RECORDING]
    assert [content(cut)[name] for name in names] == [content(whole)[name] for name in names]


def test_a_damaged_piece_is_played_again(toys, tmp_path):
    scenario = studies.scenario_of(TOYS)
    toy_study.STUDY.interrupted_at = 3
    with pytest.raises(KeyboardInterrupt):
        play_run(scenario, tmp_path)
    (tmp_path / layout.PARTS / "toy.000001.npz").write_bytes(b"PK")
    toy_study.STUDY.interrupted_at = None
    toy_study.STUDY.played.clear()
    play_run(scenario, tmp_path, resume=True, derive=lambda *_: b"{}")
    assert toy_study.STUDY.played == [1, 3]


def test_installing_a_study_moves_no_hash_and_its_table_is_checked_like_any_other(toys):
    from testbed.robots.catalog import load_robot

    robot = load_robot("staubli_tx60")
    without = scenario_hash(studies.scenario_of(SMALL), robot)
    toys.clear()
    assert scenario_hash(studies.scenario_of(SMALL), robot) == without
    with pytest.raises(InputError, match=r'the file has no key "toy"'):
        studies.scenario_of(TOYS)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"robts": 3}, r'\[toy\] has no key "robts"; did you mean "robots"\?'),
        ({"robots": 1.5}, r"\[toy\] robots is 1\.5; it must be a whole number"),
        ({"robots": 2, "shots": 21}, r"\[toy\] shots is 21; at most ten per robot"),
    ],
)
def test_faults_of_a_foreign_table_are_told_in_the_words_of_the_file(toys, table, message):
    with pytest.raises(InputError, match=message):
        studies.scenario_of(SMALL | {"toy": table})


def test_a_trial_may_not_take_the_name_of_a_toy_record(toys):
    taken = TOYS | {"trial": [SMALL["trial"][0] | {"name": toy_study.KEY}]}
    with pytest.raises(InputError, match=r"has a reserved name.*toy\.\*"):
        studies.scenario_of(taken)


def test_a_name_brought_twice_and_something_that_is_no_study_are_refused(toys):
    toys["toy"] = toys["toy"] * 2
    with pytest.raises(InputError, match='the study "toy" is brought by'):
        studies.scenario_of(TOYS)
    toys["toy"] = [EntryPoint("toy", "tests.toy_study:KEY", studies.GROUP)]
    with pytest.raises(InputError, match='brings as "toy" is no study'):
        studies.scenario_of(TOYS)


@pytest.mark.parametrize("name", ["coverage", "compensation"])
def test_a_study_is_named_in_no_file_outside_its_folder_but_the_register(name):
    own = ROOT / "testbed" / "studies" / name
    words = [rf"studies[./]{name}\b", rf'"{name}[".]']
    words += [rf"\b{word}\b" for word in names_in(own)]
    found = re.compile("|".join(words))
    for path in (ROOT / "testbed").rglob("*.py"):
        if own in path.parents or path == ROOT / "testbed" / "studies" / "__init__.py":
            continue
        hits = found.findall(path.read_text(encoding="utf-8"))
        assert not hits, f"{path.relative_to(ROOT)}: {hits}"


def names_in(folder):
    """Settings and record types of a study."""
    text = "".join((folder / f"{name}.py").read_text("utf-8") for name in ("settings", "study"))
    return set(re.findall(r"^class (\w+)", text, re.MULTILINE))

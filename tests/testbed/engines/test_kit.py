"""A kit: pieces are played from its bytes alone, as they are where it was packed."""

import shutil
from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from calib.errors import CalibError, InputError
from testbed import studies
from testbed.assets import models
from testbed.engines import kit as kits
from testbed.engines.engine import Alone
from testbed.engines.kit import Kit, play_piece
from testbed.engines.piece import pieces_of, played
from testbed.robots.catalog import load_robot
from testbed.store.npz import Failure
from testbed.store.pieces import piece_from
from testbed.studies.protocol import Records, Task
from tests import toy_study
from tests.testbed.studies.test_register import TOYS

BOX = """o box
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 1 4 3
"""


@pytest.fixture
def toys(monkeypatch):
    """The toy study, as if its distribution were installed."""
    entry = EntryPoint("toy", "tests.toy_study:STUDY", studies.GROUP)
    monkeypatch.setattr(studies, "_entries", lambda: [entry])
    studies.study_named.cache_clear()
    monkeypatch.setattr(toy_study.STUDY, "interrupted_at", None)
    yield
    studies.study_named.cache_clear()


def packed(scenario):
    """A kit for the toys of a scenario, with the setting they need, and their pieces."""
    robot, ground = load_robot(scenario.robot), studies.study_named("trial")
    setting = ground.play(scenario, Task("trial", ("setting",)), Records({}, {}))
    records = {record.key: record for record in toy_study.STUDY.records(scenario)}
    kit = Kit(scenario, robot, toy_study.STUDY, Records({"setting": setting}, {"best": "no luck"}))
    return kit, pieces_of(toy_study.STUDY, records, robot)


def test_pieces_from_a_kit_are_those_played_at_home_and_own_files_go_with_it(toys, tmp_path):
    """A robot, its meshes and an obstacle of one's own, none of which is there any more."""
    home = tmp_path / "home"
    shutil.copytree(models() / "staubli_tx60", home / "arm")
    (home / "rack.obj").write_text(BOX)
    rack = {"kind": "mesh", "file": str(home / "rack.obj"), "position_mm": [-2000.0, 0.0, 0.0]}
    own = {"robot": str(home / "arm" / "robot.toml"), "cell": {"obstacle": [rack]}}
    kit, pieces = packed(studies.scenario_of(TOYS | own))
    at_home = {piece.name: data for piece, data in Alone().play(kit, pieces)}
    data = kit.data
    shutil.rmtree(home)
    assert {piece.name: play_piece(data, piece) for piece in reversed(pieces)} == at_home
    assert str(home).encode() not in b"".join(at_home.values())
    assert [piece.name for piece in pieces] == [f"toy.{k:06d}" for k in range(4)]
    assert len({piece.spec for piece in pieces}) == 4


def test_more_robots_keep_the_full_pieces(toys):
    few, more = ({piece.name: piece.spec for piece in packed_pieces(robots)} for robots in (7, 20))
    same = [name for name, spec in few.items() if more[name] == spec]
    assert same == ["toy.000000", "toy.000001", "toy.000002"]  # the last one had one robot
    assert len(more) == 10


def packed_pieces(robots):
    scenario = studies.scenario_of(TOYS | {"toy": {"robots": robots, "shots": 6}})
    records = {record.key: record for record in toy_study.STUDY.records(scenario)}
    return pieces_of(toy_study.STUDY, records, load_robot(scenario.robot))


def test_a_record_that_fails_leaves_the_others_of_its_piece_as_they_are(toys, monkeypatch):
    """Both would fail together; alone, only one of them does."""
    scenario = studies.scenario_of(TOYS)
    (piece, *_) = packed_pieces(7)
    piece = replace(piece, task=replace(piece.task, keys=("toy.good", "toy.bad")))

    class Two(toy_study.ToyStudy):
        def play(self, scenario, task, needed):
            if "toy.bad" in task.keys:
                raise CalibError(f"{len(task.keys)} of them", code="T1")
            return {key: toy_study.Spread(toy_study.np.ones(2)) for key in task.keys}

    stored = piece_from(played(Two(), scenario, piece, Records({}, {})), piece.name, piece.spec)
    assert stored.failures == {"toy.bad": "1 of them. [T1]"}
    assert stored.part("toy.good", toy_study.Spread).sd.tolist() == [1.0, 1.0]
    assert stored.part("toy.bad", toy_study.Spread) == Failure("1 of them. [T1]")


def test_a_worker_of_another_version_refuses(toys, monkeypatch):
    kit, (piece, *_) = packed(studies.scenario_of(TOYS))
    data = kit.data
    monkeypatch.setattr(kits, "sources_hash", lambda: "0" * 64)
    kits._opened.cache_clear()
    with pytest.raises(InputError, match="source code is 000000000000, not "):
        play_piece(data, piece)

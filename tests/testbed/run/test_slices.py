"""Slices and merged folders: the bytes of a run that one process played, whoever played what."""

import json
import re
import shutil
from dataclasses import dataclass
from functools import cache
from typing import Annotated

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import CalibError, InputError, MachineError
from testbed.engines import piece as played_by
from testbed.engines.engine import Alone
from testbed.robots import catalog
from testbed.run.play import play_run
from testbed.run.slices import merge_runs, play_slice
from testbed.scenario.hashes import shared_part
from testbed.store import layout, npz
from testbed.store.pieces import piece_from
from testbed.streams import stream
from testbed.studies.protocol import Cut, Record
from tests.testbed.studies.trial.fake_campaign import Fake, FakeSetting
from tests.testbed.studies.trial.fake_campaign import content as all_content
from tests.testbed.studies.trial.fake_campaign import scenario as fake_scenario

KINDS = ("many.a", "many.b")
REFUSED = """\
HERE/wrong: its parts/many.000000.npz is another one than that of HERE/a; play all slices on one \
kind of processor, or remove the folder that is wrong. [D42]
HERE/seed: holds a run of another scenario, seed or robot than HERE/a; merge folders of one run \
only. [D42]
HERE/versions: was begun with other versions: NUMPY; merge folders of one run only. [D42]
HERE/foreign: its 5 pieces under parts/ are of another scenario; leave it out, or play its slice \
again. [D42]
merge was given one folder; it needs two or more; to continue that run, type: truebed run FOLDER \
--out FOLDER --resume. [C41]"""
NO_SLICES = (
    "x.toml: --slice is given, and no study of many robots is on; studies of many robots are "
    "played in slices; leave --slice out. [C41]"
)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """One number a robot."""

    value: Annotated[Array, "R"]


class Many(Fake):
    """Robots of two kinds, three a piece, as many as the scenario has random sets."""

    name = "many"
    stopped_at: int | None = None
    wrong: float = 0.0
    single: bool = False

    def records(self, scenario):
        shared, robots = shared_part(scenario), scenario.studies.population
        cut = Cut("many", robots, 3, shared, self.single)
        reads = shared | {"robots": robots}
        cuts = [Record(key, Found, reads, ("pools",), cut) for key in KINDS]
        pools = Record("pools", Found, shared, ("setting",), Cut("pools", 2, 1, shared))
        return (*super().records(scenario)[:2], pools, *cuts)

    def play(self, scenario, task, needed):
        if not task.block:
            return super().play(scenario, task, needed)
        self.computed.append(f"{task.keys[0]} {task.piece}")
        if task.keys[0] == "pools":
            return {"pools": Found(needed.get("setting", FakeSetting).pool[: len(task.block), 0])}
        if task.piece == self.stopped_at:
            raise KeyboardInterrupt
        more = needed.get("pools", Found).value.sum()
        if task.piece in self.failing and "many.b" in task.keys:
            raise CalibError(f"piece {task.piece} did not work", code="T0")
        return {
            key: Found(
                np.array([stream(5, key, k).normal() + more + self.wrong for k in task.block])
            )
            for key in task.keys
        }

    def gather(self, scenario, key, parts):
        return Found(np.concatenate([part.value for part in parts]))

    def derive(self, name, played):
        values = [played.records.find(key, Found) for key in KINDS]
        return npz.pretty_json({"many": [None if v is None else v.value.tolist() for v in values]})


def scenario(robots=14, **changes):
    studies = {"population": robots, "random_sets": 0, "pose_count": False}
    return fake_scenario(studies=studies, **changes)


def run(out, many=None, *, what=None, **options):
    many = many or Many()
    return play_run(what or scenario(), out, studies=(many,), derive=many.derive, **options)


def part(out, number, count, many=None, *, what=None):
    return play_slice(what or scenario(), out, number, count, studies=(many or Many(),))


def merge(folders, out, many=None):
    many = many or Many()
    return merge_runs(folders, out, studies=(many,), derive=many.derive)


@pytest.fixture(autouse=True)
def _one_robot(monkeypatch):
    """The same robot is read and hashed once for all runs."""
    loaded = cache(catalog.load_robot)
    monkeypatch.setattr(catalog, "load_robot", loaded)


def content(folder):
    return all_content(folder) | {
        path.name: path.read_bytes() for path in (folder / layout.PARTS).iterdir()
    }


@pytest.fixture
def whole(tmp_path):
    run(tmp_path / "whole")
    return content(tmp_path / "whole")


def test_pieces_are_played_once_and_reported_one_by_one(tmp_path):
    many, told = Many(), []
    run(tmp_path / "a", many, progress=lambda *now: told.append(now))
    assert many.computed == [
        "setting", "trial-a", "pools 0", "pools 1", *(f"many.a {k}" for k in range(5))
    ]  # fmt: skip
    assert [done for _, done, _ in told] == list(range(14))
    assert {steps for *_, steps in told} == {13}
    assert [name for name, *_ in told] == [
        "setting", "trial-a", "pools", "pools", *["many"] * 5, *layout.DERIVED, ""
    ]  # fmt: skip
    in_memory = run(None).records
    for key in KINDS:
        kept = npz.record_from((tmp_path / f"a/trials/{key}.npz").read_bytes(), key, Found, spec(
            tmp_path / f"a/trials/{key}.npz"))  # fmt: skip
        assert in_memory.get(key, Found).value.tobytes() == kept.value.tobytes()


def spec(path):
    return npz.from_bytes(path.read_bytes())[0]["spec_sha256"]


@pytest.mark.parametrize("count", [1, 3, 7])
def test_slices_in_any_order_and_a_run_that_goes_on_give_the_bytes_of_one_run(
    tmp_path, whole, count
):
    out = tmp_path / "shared"
    order = np.random.default_rng(count).permutation(count) + 1
    played = [part(out, int(number), count).pieces for number in order]
    assert sorted(played) == sorted(len(range(k, 5, count)) for k in range(count))
    assert not (out / "trials" / "trial-a.npz").exists()  # no piece needs it
    assert not (out / layout.RESULT).exists()
    many = Many()
    run(out, many, resume=True)
    assert many.computed == ["trial-a"]
    assert content(out) == whole


def test_folders_that_share_no_disk_are_merged_and_what_is_missing_is_played(tmp_path, whole):
    """One of three slices was killed after its first piece, and one piece was damaged."""
    folders = [tmp_path / name for name in "abc"]
    part(folders[0], 1, 3)
    part(folders[2], 3, 3)
    killed = Many()
    killed.stopped_at = 4
    with pytest.raises(KeyboardInterrupt):
        part(folders[1], 2, 3, killed)
    (folders[2] / layout.PARTS / "many.000002.npz").write_bytes(b"PK")
    for k, order in enumerate([folders, folders[::-1]]):
        many = Many()
        merge(order, tmp_path / f"{k}", many)
        assert many.computed == ["trial-a", "many.a 2", "many.a 4"]
        assert content(tmp_path / f"{k}") == whole


def test_slices_share_a_folder_and_keep_a_whole_run_out(tmp_path, monkeypatch):
    class Meanwhile(Many):
        def play(self, scenario, task, needed):
            if task.keys[0] == "many.a" and task.piece == 0:
                part(tmp_path / "a", 2, 2)
                with pytest.raises(MachineError, match="in use by process"):
                    run(tmp_path / "a", resume=True)
            return super().play(scenario, task, needed)

    part(tmp_path / "a", 1, 2, Meanwhile())
    assert len(list((tmp_path / "a" / layout.PARTS).glob("many.*"))) == 5


def test_a_slice_that_two_processes_play_at_once_is_played_twice_and_the_same(tmp_path, whole):
    class Meanwhile(Many):
        def play(self, scenario, task, needed):
            if task.keys[0] == "many.a" and task.piece == 0:
                many = Many()
                part(tmp_path / "a", 1, 1, many)
                assert [one for one in many.computed if one.startswith("many.a")] == [
                    f"many.a {k}" for k in range(5)
                ]
            return super().play(scenario, task, needed)

    part(tmp_path / "a", 1, 1, Meanwhile())
    run(tmp_path / "a", resume=True)
    assert content(tmp_path / "a") == whole


def test_more_robots_keep_the_full_pieces_and_fewer_keep_them_too(tmp_path):
    out = tmp_path / "grown"
    run(out)
    for robots, fresh in ((20, [4, 5, 6]), (14, [4]), (20, [4])):
        many = Many()
        assert (out / layout.RESULT).exists()
        run(out, many, what=scenario(robots), resume=True)
        assert many.computed == [f"many.a {k}" for k in fresh]
    run(tmp_path / "whole", what=scenario(20))
    assert content(out) == content(tmp_path / "whole")
    with pytest.raises(InputError, match="another scenario, seed or robot"):
        run(out, what=scenario(20, seed=6), resume=True)


def test_slices_with_more_robots_keep_the_full_pieces_of_the_folder(tmp_path):
    out, many = tmp_path / "grown", Many()
    run(out)
    for number in (2, 1):
        part(out, number, 2, many, what=scenario(20))
    assert sorted(many.computed) == [f"many.a {k}" for k in (4, 5, 6)]
    assert not (out / layout.RESULT).exists()
    assert (out / layout.UNFINISHED).exists()
    run(out, what=scenario(20), resume=True)
    run(tmp_path / "whole", what=scenario(20))
    assert content(out) == content(tmp_path / "whole")


def test_a_stop_after_more_robots_were_asked_for_leaves_no_old_result(tmp_path):
    run(tmp_path)
    many = Many()
    many.stopped_at = 5
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, many, what=scenario(20), resume=True)
    assert not (tmp_path / layout.RESULT).exists()
    assert (tmp_path / layout.UNFINISHED).exists()


def test_a_piece_that_fails_is_a_result_of_its_kind_alone(tmp_path):
    many = Many(failing=(3, 1))
    many.single = True
    outcome = run(tmp_path / "single", many)
    assert outcome.failed == {"many.b": "piece 1 did not work. [T0]"}
    outcome = run(tmp_path / "whole", Many(failing=(3, 1)))
    assert outcome.failed == {"many.b": "piece 1 did not work. [T0]"}
    assert len(outcome.records.get("many.a", Found).value) == 14
    out = tmp_path / "slices"
    failed = [part(out, k, 2, Many(failing=(3, 1))).failed for k in (1, 2)]
    assert failed == [
        {},
        {f"many.00000{k} many.b": f"piece {k} did not work. [T0]" for k in (1, 3)},
    ]
    run(out, resume=True)
    assert content(out) == content(tmp_path / "whole")


class Mortal(Alone):
    """Other processes, all of which die over one piece."""

    def play(self, kit, pieces):
        for piece, found in super().play(kit, pieces):
            died = piece.name == "many.000001"
            yield piece, "3 processes died while they played many.000001" if died else found


def test_a_piece_that_no_process_survived_is_tried_again_by_a_run_that_goes_on(tmp_path, whole):
    out, fine = tmp_path / "out", tmp_path / "fine"
    died = "3 processes died while they played many.000001"
    assert run(out, engine=Mortal()).failed == {"many.a": died, "many.b": died}
    assert run(out, resume=True, engine=Mortal()).failed == {"many.a": died, "many.b": died}
    assert sum(json.loads((out / layout.MANIFEST).read_text())["processors"].values()) == 6
    shutil.copytree(out, fine)
    many = Many()
    assert run(out, many, resume=True).failed == {}
    assert many.computed == ["many.a 1"]
    assert content(out) == whole
    # what another folder has played stands for it, whichever is named first
    slices = tmp_path / "slices"
    part(slices, 1, 1)
    for k, folders in enumerate(([fine, slices], [slices, fine])):
        assert merge(folders, tmp_path / f"merged{k}").failed == {}
        assert content(tmp_path / f"merged{k}") == whole


def test_a_part_that_fails_by_itself_fails_again_without_being_played(tmp_path):
    out = tmp_path / "out"
    failed = run(out, Many(failing=(3,))).failed
    many = Many(failing=(3,))
    before = content(out)
    assert run(out, many, resume=True).failed == failed
    assert many.computed == []
    assert content(out) == before


def test_figures_of_very_many_robots_are_kept_in_half_the_bytes(tmp_path):
    """Rounded once, to float32, whoever plays; the largest numbers stay finite."""
    many = Many()
    many.single, many.wrong = True, 1e300
    in_memory = run(None, many).records
    one = run(tmp_path / "a", many).records.get("many.a", Found)
    assert isinstance(one, Found)
    assert type(one) is not Found  # its figures stay in the file
    assert one.value.tolist() == in_memory.get("many.a", Found).value.tolist()
    assert type(run(tmp_path / "a", many, resume=True).records.get("many.a", Found)) is type(one)
    for k in (2, 1):
        part(tmp_path / "b", k, 2, many)
    run(tmp_path / "b", many, resume=True)
    assert content(tmp_path / "a") == content(tmp_path / "b")
    path = tmp_path / "a" / layout.TRIALS / "many.a.npz"
    assert npz.from_bytes(path.read_bytes())[1]["value"].dtype == np.float32
    most = float(np.finfo(np.float32).max)
    assert in_memory.get("many.a", Found).value.tolist() == [most] * 14
    many.wrong = 0.0
    exact = run(None).records.get("many.a", Found).value
    rounded = run(None, many).records.get("many.a", Found).value
    assert rounded.tolist() == exact.astype(np.float32).astype(np.float64).tolist()


def test_each_piece_says_which_processor_played_it(tmp_path):
    from testbed.versions import processor

    run(tmp_path)
    path = tmp_path / layout.PARTS / "many.000000.npz"
    assert piece_from(path.read_bytes(), path.stem, spec(path)).processor == processor()
    manifest = json.loads((tmp_path / layout.MANIFEST).read_bytes())
    assert manifest["processors"] == {processor(): 7}


def test_of_two_kinds_of_processors_the_order_of_folders_decides_nothing(tmp_path, monkeypatch):
    for name, wrong in (("a", 0.0), ("b", 1e-15)):
        monkeypatch.setattr(played_by, "processor", lambda name=name: f"kind {name}")
        many = Many()
        many.wrong = wrong
        part(tmp_path / name, 1, 1, many)
    folders = [tmp_path / "a", tmp_path / "b"]
    merge(folders, tmp_path / "one")
    merge(folders[::-1], tmp_path / "other")
    found = content(tmp_path / "one")
    assert found == content(tmp_path / "other")
    both = [(folder / layout.PARTS / "many.000001.npz").read_bytes() for folder in folders]
    assert both[0] != both[1]
    assert found["many.000001.npz"] == both[0]


def test_loops_compiled_and_not_count_as_two_kinds_of_processors(monkeypatch):
    from testbed import versions

    told = []
    for numba in ("0.63.1", versions.NOT_INSTALLED):
        monkeypatch.setattr(versions, "compiler_version", lambda numba=numba: numba)
        told.append(versions.processor.__wrapped__())
    assert told[0] == f"{told[1]}, numba 0.63.1"


@pytest.mark.parametrize("way", ["a", "link", "b/../a"])
def test_a_folder_that_is_merged_is_not_written_to(tmp_path, way):
    """By any way to it: it would be renamed, and then not be found."""
    for k, name in enumerate("ab"):
        part(tmp_path / name, k + 1, 2)
    (tmp_path / "link").symlink_to(tmp_path / "a")
    folders = [tmp_path / "a", tmp_path / "b"]
    before = {path: path.read_bytes() for path in folders[0].rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="is one of the folders that are merged; choose another"):
        merge_runs(folders, tmp_path / way, overwrite=True, studies=(Many(),))
    if way != "a":
        with pytest.raises(InputError, match="is given twice"):
            merge([*folders, tmp_path / way], tmp_path / "out")
    assert {path: path.read_bytes() for path in before} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "link"]


def test_a_run_whose_folder_is_removed_ends_as_one_that_cannot_be_written(tmp_path):
    class Removing(Many):
        def play(self, scenario, task, needed):
            found = super().play(scenario, task, needed)
            if len(self.computed) == 6:
                shutil.rmtree(tmp_path / "run")
            return found

    with pytest.raises(MachineError, match=r"many.00000\d.npz cannot be written: No such file"):
        run(tmp_path / "run", Removing())
    assert not (tmp_path / "run").exists()


def test_folders_that_disagree_are_refused_and_nothing_is_written(tmp_path):
    part(tmp_path / "a", 1, 2)
    part(tmp_path / "b", 2, 2)
    other = Many()
    other.wrong = 1e-15
    part(tmp_path / "wrong", 1, 2, other)
    many = Many()
    play_slice(scenario(seed=6), tmp_path / "seed", 1, 2, studies=(many,))
    shutil.copytree(tmp_path / "b", tmp_path / "versions")
    manifest = tmp_path / "versions" / layout.MANIFEST
    manifest.write_bytes(manifest.read_bytes().replace(b'"numpy": "', b'"numpy": "9'))
    shutil.copytree(tmp_path / "b", tmp_path / "foreign")
    shutil.rmtree(tmp_path / "foreign" / layout.PARTS)
    shutil.copytree(tmp_path / "seed" / layout.PARTS, tmp_path / "foreign" / layout.PARTS)
    cases = [[tmp_path / "a", tmp_path / name] for name in ("wrong", "seed", "versions", "foreign")]
    shown = []
    for folders in (*cases, [tmp_path / "a"]):
        with pytest.raises(InputError) as caught:
            merge(folders, tmp_path / "out")
        shown.append(str(caught.value).replace(str(tmp_path), "HERE"))
    with pytest.raises(InputError, match="another scenario, seed or robot"):
        play_slice(scenario(), tmp_path / "seed", 2, 2, studies=(many,))
    with pytest.raises(InputError) as caught:
        play_slice(scenario(), tmp_path / "out", 1, 2, studies=(Fake(),), where="x.toml")
    assert "\n".join([re.sub("numpy 9[^,]*, [^;]*;", "NUMPY;", one) for one in shown]) == REFUSED
    assert str(caught.value) == NO_SLICES
    assert not (tmp_path / "out").exists()

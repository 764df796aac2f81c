"""The runner: same bytes in any order, after any stop; failures are results; nothing is lost."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import CalibError, InputError, MachineError
from testbed.run.derive import derived_file
from testbed.run.play import load_run, play_run, recording_of, rederive
from testbed.run.result import equal_runs, read_result
from testbed.run.work import LOST
from testbed.store import layout, npz
from testbed.studies import scenario_of
from tests import campaign
from tests.testbed.studies.trial.fake_campaign import SCENARIO, Fake, campaign_of, content, scenario


def play(out, fake=None, *, what=None, **options):
    fake = fake or Fake()
    return play_run(what or scenario(), out, studies=(fake,), derive=fake.derive, **options)


def test_the_same_scenario_gives_the_same_bytes_in_any_order(tmp_path):
    keys = Fake().record_keys(scenario())
    play(tmp_path / "usual")
    expected = content(tmp_path / "usual")
    orders = [list(reversed(keys)), *np.random.default_rng(0).permuted([keys] * 6, axis=1).tolist()]
    for i, order in enumerate(orders):
        play(tmp_path / f"{i}", order=order)
        assert content(tmp_path / f"{i}") == expected
    assert equal_runs([tmp_path / "usual", tmp_path / "0"]) == [
        [tmp_path / "usual", tmp_path / "0"]
    ]


def test_adding_a_trial_leaves_every_other_trial_byte_identical(tmp_path):
    play(tmp_path / "three")
    more = [*SCENARIO["trial"], {"name": "more", "poses": 9, "method": "random"}]
    studies = {"random_sets": 99, "pose_count": False}
    play(tmp_path / "four", what=scenario(trial=more[::-1], studies=studies))
    three, four = content(tmp_path / "three"), content(tmp_path / "four")
    for name in ("setting", "trial-a", "trial-b", "trial-c"):
        assert three[f"trials/{name}.npz"] == four[f"trials/{name}.npz"]
    assert "trials/more.npz" in four


@pytest.mark.parametrize(
    "changes",
    [{"seed": 6}, {"pool": {"size": 999}}, {"truth": {"preset": "rigid"}}, {"test": {"poses": 9}}],
    ids=str,
)
def test_a_change_that_matters_gives_other_records(tmp_path, changes):
    play(tmp_path / "a")
    with pytest.raises(InputError, match="another scenario, seed or robot"):
        play(tmp_path / "a", what=scenario(**changes), resume=True)


def test_resume_keeps_what_is_whole_and_recomputes_what_is_damaged(tmp_path):
    play(tmp_path)
    expected = content(tmp_path)
    (tmp_path / "trials" / "trial-b.npz").write_bytes(b"PK")
    (tmp_path / "trials" / "trial-c.npz").unlink()
    (tmp_path / "campaign.rrd").unlink()
    times = {p.name: p.stat().st_mtime_ns for p in (tmp_path / "trials").iterdir()}
    fake = Fake()
    outcome = play(tmp_path, fake, resume=True)
    assert fake.computed == ["trial-b", "trial-c"]
    assert outcome.kept == ("setting", "trial-a", "pose_count", "random_sets")
    assert content(tmp_path) == expected
    for name in ("setting.npz", "trial-a.npz"):
        assert (tmp_path / "trials" / name).stat().st_mtime_ns == times[name]


def test_a_finished_run_can_be_resumed_and_computes_nothing(tmp_path):
    play(tmp_path)
    fake = Fake()
    play(tmp_path, fake, resume=True)
    assert fake.computed == []


def test_resume_without_a_run_begins_one(tmp_path):
    play(tmp_path / "new", resume=True)
    assert (tmp_path / "new" / layout.RESULT).is_file()


def test_a_trial_that_fails_is_counted_with_its_reason_and_stops_nothing_else(tmp_path):
    outcome = play(tmp_path, Fake(failing=("trial-b",)))
    assert outcome.failed == {
        "trial-b": "trial-b did not work. [T0]",
        "random_sets": "trial-b failed (trial-b did not work. [T0]). [T1]",
    }
    assert [t.name for t in campaign_of(outcome.scenario, outcome.records).trials] == [
        "trial-a",
        "trial-c",
    ]
    assert read_result(tmp_path)["failed"] == dict(outcome.failed)
    again = play(tmp_path, Fake(), resume=True)  # a failure is a finished record too
    assert again.failed == outcome.failed


def test_failures_give_the_same_bytes_in_any_order(tmp_path):
    def failing():
        return Fake(failing=("trial-c", "trial-b"))

    play(tmp_path / "a", failing())
    play(tmp_path / "b", failing(), order=reversed(Fake().record_keys(scenario())))
    assert content(tmp_path / "a") == content(tmp_path / "b")


def test_if_every_trial_fails_the_reasons_are_told(tmp_path):
    names = tuple(trial["name"] for trial in SCENARIO["trial"])
    with pytest.raises(CalibError, match=r"every trial failed: trial-a: trial-a did not work"):
        play(tmp_path, Fake(failing=names))


def test_a_setting_that_cannot_be_made_leaves_nothing_behind(tmp_path):
    class Empty(Fake):
        def compute(self, *_):
            raise InputError("[pool] only 3 of 1000 poses are feasible", code="S37")

    with pytest.raises(InputError, match=r"^scenes/x\.toml: \[pool\] only 3 of 1000"):
        play(tmp_path / "run", Empty(), where="scenes/x.toml")
    assert list(tmp_path.iterdir()) == []


def test_too_little_memory_is_the_machine_s_fault(tmp_path):
    class Greedy(Fake):
        def compute(self, scenario, key, needed):
            if key == "trial-b":
                raise MemoryError
            return super().compute(scenario, key, needed)

    with pytest.raises(MachineError, match="trial-b needs more memory"):
        play(tmp_path / "a", Greedy())
    play(tmp_path / "a", resume=True)
    play(tmp_path / "b")
    assert content(tmp_path / "a") == content(tmp_path / "b")


def test_a_defect_is_not_mistaken_for_a_result(tmp_path):
    class Broken(Fake):
        def compute(self, *_):
            return {}["missing"]

    with pytest.raises(KeyError):
        play(tmp_path, Broken())


def test_records_that_ask_for_each_other_are_a_defect(tmp_path):
    class Circle(Fake):
        def records(self, scenario):
            return tuple(
                replace(one, needs=("trial-b" if one.key == "trial-a" else "trial-a",))
                for one in super().records(scenario)
            )

    with pytest.raises(RuntimeError, match=r"asks for itself: .*trial-a -> trial-b -> trial-a"):
        play(None, Circle(), order=["trial-a", "setting", "trial-b", "trial-c", "pose_count",
                                    "random_sets"])  # fmt: skip


def test_an_order_must_name_each_record_once():
    with pytest.raises(InputError, match="order is setting; each of setting, trial-a"):
        play(None, order=["setting"])


def test_a_campaign_played_in_memory_equals_the_one_on_disk(tmp_path):
    memory, disk = (campaign_of(one.scenario, one.records) for one in (play(None), play(tmp_path)))
    assert memory.setting.pool.tobytes() == disk.setting.pool.tobytes()
    assert [t.mean for t in memory.trials] == [t.mean for t in disk.trials]


def test_progress_counts_every_step_once(tmp_path):
    told = []
    play(tmp_path, progress=lambda *now: told.append(now))
    assert [done for _, done, _ in told] == list(range(11))
    assert {steps for _, _, steps in told} == {10}
    assert told[0][0] == "setting"
    assert told[-1][0] == ""


def test_an_unfinished_run_says_so_and_how_to_go_on(tmp_path):
    class Stopped(Fake):
        def compute(self, scenario, key, needed):
            if key == "trial-b":
                raise KeyboardInterrupt
            return super().compute(scenario, key, needed)

    with pytest.raises(KeyboardInterrupt):
        play(tmp_path, Stopped())
    note = (tmp_path / layout.UNFINISHED).read_text()
    assert "not finished" in note
    assert "--resume" in note
    assert not (tmp_path / layout.RESULT).exists()
    with pytest.raises(InputError, match=r"has no result\.json: the run is not finished"):
        read_result(tmp_path)
    told = "the run is not finished; give the `truebed run` .* --resume"
    with pytest.raises(InputError, match=told):
        load_run(tmp_path, studies=(Fake(),))
    with pytest.raises(InputError, match=told):
        recording_of(tmp_path)
    play(tmp_path, resume=True)
    assert not (tmp_path / layout.UNFINISHED).exists()


def test_a_record_that_cannot_be_used_is_told_by_what_is_wrong_with_it(tmp_path):
    """Missing, damaged, or whole and of a version with other fields, hashes or formats."""
    play(tmp_path)
    file = tmp_path / layout.TRIALS / "trial-b.npz"
    whole = file.read_bytes()
    meta, arrays = npz.from_bytes(whole)
    others = (
        meta | {"values": meta["values"] | {"new": 1.0}},
        meta | {"values": {k: v for k, v in meta["values"].items() if k != "mean"}},
        meta | {"spec_sha256": "0" * 64},
        meta | {"format": 2},
    )
    again = "give the command that wrote this folder again, with another --out"
    cases = [
        *((npz.to_bytes(one, arrays), "was written by another version of truebed", again)
          for one in others),
        (npz.to_bytes(meta | {"key": "trial-a"}, arrays), "is damaged", LOST),
        (whole[:-1], "is damaged", LOST),
        (None, "is missing", LOST),
    ]  # fmt: skip
    for data, told, fix in cases:
        if data is None:
            file.unlink()
        else:
            file.write_bytes(data)
        with pytest.raises(InputError) as caught:
            load_run(tmp_path, studies=(Fake(),))
        assert str(caught.value) == f"{tmp_path}: the record trial-b {told}; {fix}. [D42]"
    # what the sentences advise helps, also where another version wrote it
    file.write_bytes(npz.to_bytes(others[0], arrays))
    assert "trial-b" not in play(tmp_path, resume=True).kept
    assert file.read_bytes() == whole


def test_derived_files_are_made_again_from_the_records(tmp_path):
    play(tmp_path)
    expected = content(tmp_path)
    for name in layout.DERIVED:
        (tmp_path / name).unlink()
    rederive(tmp_path, studies=(Fake(),), derive=Fake().derive)
    assert content(tmp_path) == expected
    (tmp_path / "campaign.rrd").unlink()
    with pytest.raises(InputError, match=r"has no campaign\.rrd; write it by `truebed record"):
        recording_of(tmp_path)


def test_a_scenario_changed_behind_the_records_is_refused(tmp_path):
    play(tmp_path)
    file = tmp_path / layout.SCENARIO
    file.write_text(file.read_text().replace("seed = 5", "seed = 6"))
    with pytest.raises(InputError, match=r"was changed since the run, or the robot's files were; "):
        load_run(tmp_path, studies=(Fake(),))
    manifest = json.loads((tmp_path / layout.MANIFEST).read_text())
    manifest["versions"]["truebed"] = "0.0.1"
    (tmp_path / layout.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"files were, or truebed 0\.0\.1 read it otherwise than "):
        load_run(tmp_path, studies=(Fake(),))


def test_timing_and_log_tell_what_took_how_long_and_how_much_memory(tmp_path):
    play(tmp_path, Fake(pause=0.02))
    timing = json.loads((tmp_path / layout.TIMING).read_bytes())
    assert set(timing["wall_s"]) == {*Fake().record_keys(scenario()), *layout.DERIVED}
    assert timing["total_s"] >= 11 * 0.02  # ten steps, the recording pauses twice
    assert all(mb > 10 for mb in timing["peak_memory_mb"].values())
    events = [json.loads(line) for line in (tmp_path / layout.LOG).read_text().splitlines()]
    assert [e["event"] for e in events] == ["begin", *["record"] * 6, *["wrote"] * 4, "end"]


def test_a_step_s_time_does_not_count_the_steps_nested_in_it(monkeypatch):
    from testbed import progress as clock

    ticks = iter([0.0, 1.0, 11.0, 20.0])  # outer begins, inner begins, inner ends, outer ends
    monkeypatch.setattr(clock.time, "perf_counter", lambda: next(ticks))
    watch = clock.Clock()
    with watch.step("outer"), watch.step("inner"):
        pass
    assert watch.seconds == {"inner": 10.0, "outer": 10.0}


def test_no_hashed_file_knows_time_process_or_place(tmp_path, monkeypatch):
    process = 4_294_967_291  # a number that does not come up by itself
    monkeypatch.setattr(os, "getpid", lambda: process)
    play(tmp_path / "somewhere")
    for name, data in content(tmp_path / "somewhere").items():
        assert b"somewhere" not in data, name
        assert str(process).encode() not in data, name


def test_a_robot_the_scenario_does_not_fit_is_refused_before_anything_is_written(tmp_path):
    bad = {
        "robot": "staubli_tx06",
        "truth": {"perturb": ["theta9"]},
        "identification": {"free": "wen2002"},
    }
    with pytest.raises(InputError, match=r'x\.toml: there is no robot "staubli_tx06"') as caught:
        play(tmp_path / "run", what=scenario(**bad), where="x.toml")
    assert 'did you mean "staubli_tx60"?' in str(caught.value)
    with pytest.raises(InputError) as caught:
        play(tmp_path / "run", what=scenario(**bad | {"robot": "staubli_tx60"}), where="x.toml")
    first, second = str(caught.value).splitlines()
    assert first.startswith('x.toml: [truth] perturb has "theta9", which staubli_tx60 does not')
    assert second.startswith('x.toml: [identification] free has "wen2002"')
    assert 'did you mean "wen2022"?' in second
    assert list(tmp_path.iterdir()) == []


def test_the_real_campaign_names_each_record_once_and_none_twice():
    from testbed.scenario.scenario import RESERVED
    from testbed.studies import all_studies, load_scenario
    from tests import campaign

    for name in ("quick", "wen2022", "position_only"):
        keys = campaign.record_keys(load_scenario(name))
        assert len(set(keys)) == len(keys)
        trials = {trial.name for trial in load_scenario(name).trial}
        studies = all_studies(load_scenario(name))
        assert set(keys) - trials <= {key for study in studies for key in study.keys}
        assert set(RESERVED) <= {key for study in studies for key in study.keys}


REAL = {
    "format": 1,
    "name": "real",
    "seed": 11,
    "robot": "staubli_tx60",
    "pool": {"size": 80},
    "test": {"poses": 8},
    "uncertainty": {"repeats": 2, "replications": 2, "draws": 2000},
    "studies": {
        "pose_count": True,
        "pose_count_max": 30,
        "random_sets": 2,
        "tool_point": True,
        "paper_budget": True,
    },
    "trial": [
        {"name": "best", "poses": 16, "method": "detmax"},
        {"name": "random", "poses": 16, "method": "random"},
    ],
}


def light(name, played):
    """The real derived files but report and recording, which take long."""
    if name in (layout.RESULT, layout.ARRAYS):
        return derived_file(name, played)
    return b""


def play_light(out, what, **options):
    return play_run(what, out, derive=light, **options)


@pytest.mark.slow
def test_the_real_campaign_has_the_same_bytes_in_any_order_and_after_a_stop(tmp_path):
    what = scenario_of(REAL)
    keys = campaign.record_keys(what)
    play_light(tmp_path / "usual", what)
    expected = content(tmp_path / "usual")
    play_light(tmp_path / "backwards", what, order=keys[::-1])
    assert content(tmp_path / "backwards") == expected
    for name in ("best", "pose_count", "tool_point"):
        (tmp_path / "usual" / "trials" / f"{name}.npz").unlink()
    (tmp_path / "usual" / layout.ARRAYS).unlink()
    outcome = play_light(tmp_path / "usual", what, resume=True)
    assert set(keys) - set(outcome.kept) == {"best", "pose_count", "tool_point"}
    assert content(tmp_path / "usual") == expected
    more = [{"name": "more", "poses": 16, "method": "random"}, REAL["trial"][0]]
    fewer = {"random_sets": 0}
    play_light(tmp_path / "more", scenario_of(REAL | {"trial": more, "studies": fewer}))
    for name in ("setting", "best"):
        key = f"trials/{name}.npz"
        assert content(tmp_path / "more")[key] == expected[key]

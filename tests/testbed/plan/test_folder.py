"""The folder of a plan: the same bytes each time, numbers as in the plan, whole or not at all."""

import csv
import io
import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import MachineError, one_line, visible
from calib.uncertainty.statement.applicability import WARNED
from testbed.plan import folder as plan_files
from testbed.plan.folder import play_plan, programs
from testbed.plan.promises import minutes
from testbed.plan.results import goal_csv, plan_numbers, stops_of
from testbed.plan.words import next_step, promise, reasons, terminal_text
from testbed.scenario.read import dump_scenario
from testbed.store import layout
from testbed.studies import load_scenario
from tests.command import call
from tests.planned import (
    BARE,
    QUICK,
    ROBOT,
    few_rehearsals,
    joints,
    legs,
    rows_of,
    scenario,
    small_plan,
    with_blocked_move,
)

FILES = {
    "goal.csv", "plan.csv", "plan.json", "plan_report.html", "plan.rrd", "scenario.toml",
    "program.val3.txt", "program.rapid.txt", "program.krl.txt", "program.urscript.txt",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "out"
    with few_rehearsals():
        play_plan(scenario(QUICK), path)
    return path


def content(path):
    """Bytes of every file but the recording, whose row ids are never the same."""
    return {file.name: file.read_bytes() for file in path.iterdir() if file.suffix != ".rrd"}


@pytest.mark.slow
def test_a_plan_has_its_files_and_a_second_one_the_same_bytes(folder, tmp_path):
    assert {file.name for file in folder.iterdir()} == FILES
    again = tmp_path / "again"
    file = tmp_path / "mine.toml"
    file.write_text(dump_scenario(scenario(QUICK)), encoding="utf-8")
    with few_rehearsals():
        result = call("plan", file, "--out", again, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    assert content(again) == content(folder)
    assert load_scenario(again / "scenario.toml") == scenario(QUICK)
    assert not [path for path in tmp_path.iterdir() if path.name not in ("again", "mine.toml")]


def test_the_table_read_back_is_the_plan():
    made = small_plan()
    rows = rows_of(made)
    assert [rows[0][key] for key in ("role", "order", "move", "approach_s")] == [
        "start",
        "",
        "",
        "",
    ]
    measured = [row for row in rows if row["role"] not in ("via", "start")]
    # nine decimals of a degree
    assert joints(measured) == pytest.approx(made.tour.q, abs=1e-11)
    assert [row["role"] for row in measured] == list(made.tour.roles)
    assert [row["order"] for row in measured] == [str(k + 1) for k in range(len(made.tour))]
    path = joints(rows)
    ends = legs(made)
    assert path[0] == pytest.approx(made.tour.start, abs=1e-11)
    assert path[1:] == pytest.approx(ends[:, 1], abs=1e-11)
    around = [bool(len(via)) for via in made.tour.vias]
    assert [row["move"] == "around" for row in measured] == around
    seconds = sum(float(row["approach_s"]) for row in rows[1:])
    assert seconds == pytest.approx(made.tour.move.sum(), abs=0.0005 * len(rows))
    for target in ("tool", "probe"):
        x, y, z, r = (
            np.array([float(row[f"{target}_{name}_mm"]) for row in measured])
            for name in ("x", "y", "z", "range")
        )
        azimuth, elevation = (
            np.array([float(row[f"{target}_{name}_deg"]) for row in measured])
            for name in ("azimuth", "elevation")
        )
        # printed to 0.1 um and 1e-6 deg
        assert np.abs(np.sqrt(x * x + y * y + z * z) - r).max() < 2e-4
        assert np.abs(np.degrees(np.arctan2(y, x)) - azimuth).max() < 1e-5
        assert np.abs(np.degrees(np.arctan2(z, np.hypot(x, y))) - elevation).max() < 1e-5
    ids = [row["pose_id"] for row in rows]
    assert len(set(ids)) == len(ids)
    assert sum(name.startswith("T") for name in ids if "via" not in name) == 6


def test_each_posture_of_the_goal_has_its_u_and_its_place():
    made = small_plan()
    rows = list(csv.DictReader(io.StringIO(goal_csv(made))))
    reach = made.foresight.applies
    assert joints(rows) == pytest.approx(made.goal.q, abs=1e-11)
    u = np.array([float(row["U_um"]) for row in rows]) * 1e-6  # four digits
    assert u == pytest.approx(made.coverage * made.u, rel=1e-3)
    assert [row["place"] for row in rows] == reach.place.tolist()
    for k, row in enumerate(rows):
        asked = max(reach.transfer[k], reach.leverage[k]) > WARNED or reach.beyond[k].any()
        assert bool(row["why"]) == bool(asked)
        assert (row["place"] == "inside") == (not asked)
    alone = replace(made, foresight=replace(made.foresight, applies=None, why=()))
    assert "place" not in goal_csv(alone)


def test_json_holds_the_plans_numbers_in_the_units_of_its_keys():
    made = small_plan()
    document = json.loads(json.dumps(plan_numbers(made, ROBOT), allow_nan=False))
    u = np.sqrt((made.goal.weights * made.u**2).sum())
    said = document["predicted"]
    assert said["u_mean_um"] == pytest.approx(u * 1e6, rel=1e-12)
    assert said["U_mean_um"] == pytest.approx(2 * u * 1e6, rel=1e-12)
    assert said["U_worst_um"] == pytest.approx(2e6 * made.u.max(), rel=1e-12)
    assert document["station_mm"] == pytest.approx(made.station_mm)
    assert np.radians(document["start_joints_deg"]) == pytest.approx(made.tour.start)
    assert document["blocked"] == document["untested"] == []
    budget = document["budget"]
    assert budget["smallest_reaching"] == document["poses"] == len(made.places)
    assert budget["proven_fewest"] <= document["poses"]
    at = budget["poses"].index(document["poses"])
    # the curve, the promise and the certificate speak of one set
    assert budget["U_um"][at] == pytest.approx(said["U_mean_um"], rel=1e-12)
    assert document["certificate"]["efficiency"] == pytest.approx(
        budget["U_bound_um"][at] / budget["U_um"][at], rel=1e-9
    )
    assert [one["pose_id"] for one in document["order"]][:1] == ["P1"]
    assert document["duration_s"] == pytest.approx(
        document["moving_s"] + 4.0 * (document["poses"] + document["held_out_poses"])
    )
    best = document["stations"]["compared"][document["stations"]["best"] - 1]
    assert best["U_mean_um"] == min(one["U_mean_um"] for one in document["stations"]["compared"])
    kept = document["candidates"]["drawn"] - sum(document["candidates"]["rejected"].values())
    assert kept == document["candidates"]["feasible"] == 200


def targets(text, pattern):
    """Joint targets (s, 6) of a program."""
    return np.array([[float(n) for n in re.findall(r"-?\d+\.\d+", hit)]
                     for hit in re.findall(pattern, text)])  # fmt: skip


PATTERNS = {
    "program.val3.txt": (r"jPose\[\d+\]=\{(.*?)\}", np.degrees, 1e-6),
    "program.rapid.txt": (r"MoveAbsJ \[\[(.*?)\]", np.degrees, 1e-6),
    "program.krl.txt": (r"PTP \{(.*?)\}", np.degrees, 1e-6),
    "program.urscript.txt": (r"movej\(\[(.*?)\]", np.asarray, 1e-9),
}
"""Where each program has its joint targets, in which unit, to which decimal."""
WAITS = {"val3": "delay(4)", "rapid": "WaitTime 4;", "krl": "WAIT SEC 4", "urscript": "sleep(4)"}


@pytest.mark.parametrize("name", PATTERNS)
def test_a_program_goes_to_every_target_in_order_and_waits_at_the_measured_ones(name):
    made = small_plan()
    text, (pattern, unit, decimal) = programs(made)[name], PATTERNS[name]
    stops = stops_of(made)
    assert len(stops) > len(made.tour)  # some stops are only passed
    expected = unit(np.array([stop.q for stop in stops]))
    assert np.abs(targets(text, pattern) - expected).max() <= decimal
    assert text.count(WAITS[name.split(".")[1]]) == len(made.tour)
    lines = [line for line in text.splitlines() if re.search(r" ([PT]\d+(via\d+)?|start)$", line)]
    assert [line.split()[-1] for line in lines] == [stop.name for stop in stops]
    assert "PLANNED" in text
    assert "SIMULATED" not in text
    comments = [
        line.split(maxsplit=1)[1] for line in text.splitlines() if line.strip()[0] in "/!;#"
    ]
    assert comments[0] == (
        "Joint values are those of robot staubli_tx60, not of this controller: "
        "check signs and zeros."
    )
    assert "First bring the robot by hand to the start" in text
    assert lines[0].endswith("start")
    assert text.isascii()


@pytest.mark.parametrize("one", "\n\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029\x1b\u202e")
def test_what_breaks_a_line_is_written_out_in_the_comments_of_a_program(one):
    made = small_plan()
    ours = made.scenario.model_copy(update={"robot": f"/models/arm{one}MOVE/robot.toml"})
    for name, text in programs(replace(made, scenario=ours)).items():
        assert len(text.splitlines()) == len(programs(made)[name].splitlines())
        assert f"robot {one_line(f'arm{one}MOVE')}, not of this controller" in text
        assert text == visible(text)


def test_urscript_moves_keep_every_joint_at_or_below_its_share_and_the_slowest_at_it():
    made = small_plan()
    text = programs(made)["program.urscript.txt"]
    assert "t=" not in text
    v = np.array([float(t) for t in re.findall(r"a=1\.4, v=(\d+\.\d+)", text)])
    turns = np.abs(np.diff(np.array([stop.q for stop in stops_of(made)]), axis=0))
    # v is that of the joint that turns farthest; the others keep step with it
    share = turns * (v[1:] / turns.max(axis=1))[:, None] / (0.3 * ROBOT.speeds)
    assert share.max(axis=1) == pytest.approx(np.ones(len(turns)), abs=1e-5)
    assert v[0] == pytest.approx(0.3 * ROBOT.speeds.min(), abs=1e-6)


def test_with_a_blocked_move_there_is_no_program_and_that_is_said(monkeypatch, tmp_path):
    made = with_blocked_move()
    assert programs(made) == {}
    row = rows_of(made)[3]
    assert (row["order"], row["move"], row["approach_s"]) == ("3", "blocked", "")
    assert plan_numbers(made, ROBOT)["blocked"] == [row["pose_id"]]
    assert "no robot programs" in next_step(made)
    assert "No free way was found to pose 3" in terminal_text(made)
    monkeypatch.setattr(plan_files, "make_plan", lambda *_, **__: made)
    result = call("plan", "plan_tx60", "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert {file.name for file in (tmp_path / "out").iterdir()} == {
        name for name in FILES if not name.startswith("program")
    }


def test_the_words_name_poses_uncertainty_time_and_station():
    made = small_plan()
    assert promise(made).startswith(f"{len(made.places)} poses will locate the mean tool point")
    # the time is that of the whole tour, which the held-out poses are part of
    assert made.tour.roles.count("test") == 6
    assert (
        f" All {len(made.places) + 6} poses, 6 of them held out, take about "
        f"{minutes(made.tour.duration)} to measure."
    ) in promise(made)
    over = f"{1e6 * made.foresight.R95_over:.1f} µm"
    assert (
        f"tool point within {over} (3-D radius, 95\u202f%). This counts noise alone, over all "
        "postures of the goal. "
    ) in promise(made)
    # a line for each thought, the first one of one line everywhere
    said = [line for line in terminal_text(made).split("\n") if line.startswith(("Verdict", "  "))]
    first = next(k for k, line in enumerate(said) if line.startswith("Verdict: "))
    assert len(said[first]) <= 100
    assert said[first].endswith("um (3-D radius, 95 %).")
    assert said[first + 1].startswith("  This counts noise alone, over all postures of the goal.")
    assert said[first + 2].startswith("  Errors outside the model may stay hidden below ")
    assert said[first + 3].startswith(f"  All {len(made.places) + 6} poses, 6 of them held out")
    assert (
        f"may stay hidden below {1e6 * made.foresight.misfit_seen:.2g} µm per axis: "
    ) in promise(made)
    reach, guard, proof, count, route, order, clearance, station = reasons(made)
    assert "of the goal's 60 postures lie inside what will be proven" in reach
    assert guard == "6 held-out poses cannot guard the factor of the statement; 19 are needed."
    assert "drift of the station cannot be distinguished from misfit of the model" in order
    assert "measure the first 12 poses once more at the end" in order
    assert f"tested moves is {1e3 * made.tour.clearance:.1f} mm" in clearance
    assert "V-efficiency at least" in proof
    assert count == (
        f"{len(made.places)} poses reach U = 20 µm (k = 2, 3-D, at least 95\u202f%, RMS over the "
        f"goal); it is proven that fewer than {made.curve.fewest} from this pool do not."
    )
    assert "stop on the way around" in route
    best = made.stations.best
    assert f"station {best + 1} at" in station
    # the comparison says for how many poses it holds: they are not those of the plan
    assert f"{len(made.stations.designs[best])} poses designed from there give U = " in station
    assert f"U = {2e6 * made.stations.u_mean[best]:.1f} µm" in station


def test_json_on_the_terminal_is_the_file_and_a_second_plan_is_refused(folder):
    before = content(folder)
    again = call("plan", "plan_tx60", "--out", folder, "--json")
    assert again.exit_code == 2
    assert "exists already" in json.loads(again.stdout)["error"]["message"]
    assert content(folder) == before


@pytest.mark.slow
def test_overwrite_renames_the_old_plan_and_another_seed_gives_another(folder, tmp_path):
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text(dump_scenario(scenario(BARE)), encoding="utf-8")
    out.mkdir()
    for path in folder.iterdir():
        (out / path.name).write_bytes(path.read_bytes())
    with few_rehearsals():
        result = call("plan", file, "--out", out, "--overwrite", "--seed", 8, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json.loads((out / "plan.json").read_bytes())
    assert content(tmp_path / "out.old-1") == content(folder)
    assert (out / "plan.csv").read_bytes() != (folder / "plan.csv").read_bytes()
    assert tomllib.loads((out / "scenario.toml").read_text())["seed"] == 8


@pytest.mark.parametrize("stage", ["plan_report_html", "story_bytes"])
def test_nothing_is_left_when_a_file_cannot_be_written(monkeypatch, tmp_path, stage):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(plan_files, "make_plan", lambda *_, **__: small_plan())
    monkeypatch.setattr(plan_files, stage, full)
    with pytest.raises(MachineError, match="No space left"):
        play_plan(scenario(QUICK), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_foreign_folder_is_never_renamed(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    result = call("plan", "plan_tx60", "--out", tmp_path, "--overwrite")
    assert result.exit_code == 2
    assert "is not a plan's folder" in result.stderr
    assert layout.PLAN not in {file.name for file in tmp_path.iterdir()}

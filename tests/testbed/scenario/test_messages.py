"""Every message a user may meet beside those on files and robots, word for word."""

import os
from contextlib import ExitStack
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pytest

from calib.errors import CalibError
from calib.geometry.frames import rot_x
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.prior import Prior
from calib.measurement import tables
from calib.measurement.residual import table_whiteners
from calib.uncertainty.adaptive import adaptive
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.conformal import conformal
from calib.uncertainty.discrepancy import discrepancy
from calib.uncertainty.held_out import HeldOut, held_out
from testbed.files.programs.correct import correct_program
from testbed.laboratory import pool
from testbed.laboratory.joint_lists import read_joints
from testbed.laboratory.simulator import Simulator
from testbed.laboratory.truth.robot import draw_truth
from testbed.laboratory.truth.setting import make_setting
from testbed.plan.plan import plan
from testbed.robots.catalog import load_robot
from testbed.robots.robot import NO_MASS
from testbed.robots.write.identified import identified_robot
from testbed.run.play import play_run, recording_of
from testbed.run.result import read_result
from testbed.scenario.checks import check_robot
from testbed.scenario.origin import COMMENT
from testbed.scenario.read import changed, dump_scenario
from testbed.store import layout
from testbed.store.run_folder import RunFolder
from testbed.store.whole_folder import check_free
from testbed.streams import stream
from testbed.studies import load_scenario, parse_scenario, scenario_of
from testbed.studies.compensation.cube import cube_joints, cube_poses
from testbed.studies.compensation.settings import CompensationSettings
from tests.golden.words import assert_as_written
from tests.planned import QUICK, ROBOT, scenario
from tests.testbed.laboratory.outcomes import settings as outcome_settings
from tests.testbed.robots.test_springs import tx60_at_rest
from tests.testbed.studies.trial.fake_campaign import SCENARIO, Fake

POINT = {"tracker.measures": "point", "identification.estimators": ["whitened"]}
WHITENED = {"identification": {"estimators": ["whitened"]}}
ONLY_WHITENED = {"identification.estimators": ["whitened"]}
FIXTURES = {"reflectors_mm": {"A": [60, 0, 90], "B": [-30, 52, 90]}}
NO_SIZE = {
    "preset": "at960",
    "systematic": True,
    **dict.fromkeys(("range_offset_um", "scale_um_per_m", "target_offset_um"), 0),
    "target_turn_mdeg": 0,
    "encoder_um": [0, 0],
}
HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
INSIDE = [2600.0, 0.0, 300.0]
"""A place of the tracker from which it sees the robot."""
HIT = [0.0, 120.0, 140.0, 0.0, 0.0, 0.0]
"""A pose in which the robot hits itself."""
FEWER_DRAWS = patch.object(pool, "PATIENCE", ((20_000, 1e-3), (4_000, 1e-2)))
"""A tenth of the draws shows what is a hundred times too rare."""
TRIAL = {"name": "best", "poses": 29, "method": "detmax"}
GRID = {"from_mm": [0, 0, 0], "to_mm": [1, 1, 1]}


def with_table(**tables):
    return lambda _: scenario_of(deepcopy(SCENARIO) | tables, where="scenes/mine.toml")


def box_at(*place):
    """An obstacle around a place [mm]."""
    return {"kind": "box", "size_mm": [200.0] * 3, "position_mm": [float(x) for x in place]}


def seen_by(fixtures, **more):
    """A laboratory set up with these fixtures, points measured."""
    small = POINT | {"pool.size": 40, "fixtures": fixtures} | more
    return lambda _: make_setting(scenario(**small))


def without(key):
    document = {name: value for name, value in SCENARIO.items() if name != key}
    return lambda _: scenario_of(document, where="scenes/mine.toml")


def text(content):
    return lambda _: parse_scenario(content, where="scenes/mine.toml")


def edited(before, after, *, old=False, **tables):
    """A written scenario, edited by hand; an old one says nothing of which keys were given."""
    content = dump_scenario(scenario_of(deepcopy(SCENARIO) | tables)).replace(before, after, 1)
    return text(content.split(COMMENT)[0] if old else content)


def begun(path):
    folder = RunFolder.create(path)
    folder.begin("x = 1\n", {"scenario_sha256": "0" * 64})
    return folder


def folder(act, *, manifest=None):
    """Do something with a finished run folder."""

    def case(path):
        with begun(path):
            pass
        if manifest is not None:
            (path / layout.MANIFEST).write_text(manifest)
        act(path)

    return case


def used(act):
    """Do something with a run folder another process is writing."""

    def case(path):
        with ExitStack() as stack:
            stack.enter_context(begun(path))
            act(path)

    return case


def played(**tables):
    scenario = scenario_of(deepcopy(SCENARIO) | tables)
    return lambda _: play_run(scenario, studies=(Fake(),), where="scenes/mine.toml")


def without_memory(path):
    class Greedy(Fake):
        def compute(self, *_):
            raise MemoryError

    play_run(scenario_of(SCENARIO), studies=(Greedy(),))


def on_a_wall():
    robot = load_robot("staubli_tx60")
    lying = replace(robot.model.chain, T_world_base=rot_x(np.pi / 2))
    return replace(robot, model=RobotModel(lying))


def sliding():
    robot = load_robot("staubli_tx60")
    kinds = ("prismatic", *["revolute"] * 5)
    return replace(robot, model=RobotModel(replace(robot.model.chain, kinds=kinds)))


def file_in_the_way(path):
    path.write_text("")
    RunFolder.create(path)


def foreign_folder(path):
    path.mkdir()
    (path / "thesis.tex").write_text("")
    RunFolder.create(path, overwrite=True)


def cube_of(**compensation):
    """Joints for the five poses of a test."""
    chain, settings = ROBOT.model.chain, CompensationSettings(**compensation)
    return cube_joints(ROBOT, Simulator(ROBOT, chain), cube_poses(settings, chain.T_world_base))


def program(content, out="corrected.csv"):
    """A program of the shipped robot, corrected by its own model."""

    def act(path):
        path.mkdir(parents=True, exist_ok=True)
        (path / "program.csv").write_text(content, encoding="utf-8")
        correct_program(path / "program.csv", ROBOT, ROBOT.model, path / out)

    return act


def planned(**changes):
    return lambda _: plan(scenario(QUICK, **changes), where="scenes/mine.toml")


def measured(rows, head=HEAD):
    """Read a CSV of measured poses with these rows."""

    def case(path):
        path.write_text(f"{head}\n{rows}\n")
        read_joints(ROBOT, path)

    return case


def planned_after(rows, **changes):
    """A plan after poses measured already."""

    def case(path):
        path.write_text(f"{HEAD}\n{rows}\n")
        planned(**{"plan.measured": str(path)} | changes)(path)

    return case


def plan_like(path):
    path.mkdir()
    (path / "plan.json").write_text("{}")


def with_prior(**prior):
    return with_table(identification={"prior": prior})


def paper_budget(**budget):
    return with_table(studies={"paper_budget": True}, budget=budget, trial=[TRIAL])


def checked(**tables):
    """A scenario asked of its robot."""
    scenario = scenario_of(deepcopy(SCENARIO) | tables)
    return lambda _: check_robot(scenario, ROBOT, where="scenes/mine.toml")


def shots(count, covariance=1e-10):
    """So many noise-free poses of the nominal robot, all different."""
    q = np.linspace(0.1, 0.9, 6 * count).reshape(count, 6)
    stated = np.broadcast_to(covariance * np.eye(6), (count, 6, 6))
    return tables.poses(q, ROBOT.model.poses(q), sd=stated)


def compared(validation, used):
    """The nominal robot at validation poses."""
    return lambda _: held_out(ROBOT.model, np.zeros((42, 42)), validation, used.q)


CASES = {
    "unknown key": with_table(tracker={"positoin_um": 3}),
    "key of another preset": with_table(tracker={"range_um": [1, 2]}),
    "key of another table": with_table(truth={"size": 3}),
    "key nobody knows": with_table(test={"colour": 3}),
    "key of the whole file": with_table(pool={"seed": 3}),
    "key of a trial by a slip": with_table(trial=[TRIAL | {"pose": 3}]),
    "key of stations by a slip": with_table(plan={"stations": {"lst_mm": []}}),
    "other unit": with_table(tracker={"position_mm": 0.0175}),
    "other unit and word": with_table(tracker={"noise_m": 2e-5}),
    "other unit in a list": with_table(tracker={"station_m": [2.6, -2, 0.3]}),
    "missing key": without("robot"),
    "missing table": without("trial"),
    "missing format": without("format"),
    "missing name": without("name"),
    "missing all": text(b""),
    "missing name of the second trial": with_table(
        trial=[TRIAL, {"poses": 3, "method": "random"}]
    ),
    "missing method of a trial": with_table(trial=[{"name": "a", "poses": 3}]),
    "missing count of a grid": with_table(plan={"stations": {"grid": GRID}}),
    "wrong type": with_table(pool={"size": "many"}),
    "true as a number": with_table(pool={"size": True}),
    "number as true": with_table(pool={"self_collision": 1}),
    "fraction": with_table(pool={"size": 1000.0}),
    "table wanted": with_table(pool=3),
    "table with a preset wanted": with_table(truth=5),
    "table of one of two kinds wanted": with_table(tracker=5),
    "table of a trial wanted": with_table(trial=[3]),
    "table of an obstacle wanted": with_table(cell={"obstacle": [3]}),
    "table in a table wanted": with_table(plan={"goal": 5}),
    "list wanted": with_table(pool={"box_size_mm": 900}),
    "list too short": with_table(pool={"box_size_mm": [900, 1200]}),
    "list too long": with_table(pool={"box_size_mm": [1, 2, 3, 4]}),
    "one bracket": with_table(trial=TRIAL),
    "one bracket in a table": with_table(cell={"obstacle": box_at(0, 0, 0)}),
    "empty list": with_table(identification={"estimators": []}),
    "empty list of tables": with_table(trial=[]),
    "too small": with_table(pool={"size": 3}),
    "too few draws": with_table(uncertainty={"draws": 500}),
    "too large": with_table(uncertainty={"draws": 10**9}),
    "negative": with_table(seed=-1),
    "negative in a list in a list of tables": with_table(
        cell={"obstacle": [box_at(0, 0, 0) | {"size_mm": [1, 2, -3]}]}
    ),
    "an angle of nothing": with_table(tracker={"acceptance_deg": 0}),
    "more than 63 bits": with_table(seed=2**63),
    "infinite in a list": with_table(pool={"box_size_mm": [1.0, float("inf"), 1.0]}),
    "larger than any number": text("[tracker]\nposition_um = 1e400"),
    "wrong word": with_table(truth={"preset": "stiff"}),
    "wrong word, close to a preset": with_table(truth={"preset": "wen2002"}),
    "wrong word, close": with_table(trial=[TRIAL | {"method": "detmx"}]),
    "wrong preset": with_table(tracker={"preset": "at690"}),
    "preset that is no word": with_table(tracker={"preset": 3}),
    "wrong criterion": with_table(trial=[TRIAL | {"criterion": "T"}]),
    "wrong name": with_table(name="My Scene"),
    "wrong name of a trial": with_table(trial=[TRIAL | {"name": "con/../x"}]),
    "wrong title": with_table(title="two\nlines"),
    "wrong repeatability": with_table(truth={"joint_repeatability_mdeg": "robots"}),
    "text or list": with_table(truth={"perturb": 3}),
    "amplitude below zero": with_table(truth={"encoder_mdeg": -1}),
    "amplitude below zero in a list": with_table(truth={"harmonic_mdeg": [1, -2]}),
    "amplitude in words": with_table(truth={"backlash_mdeg": "much"}),
    "empty list of amplitudes": with_table(truth={"harmonic_mdeg": []}),
    "spring without stiffness": with_table(truth={"drive_nm_per_mrad": [90, 0]}),
    "payload below zero": with_table(truth={"preset": "elastic", "payload_kg": -1}),
    "no time to warm up": with_table(truth={"thermal_h": 0}),
    "no such side": with_table(truth={"backlash_side": "loads"}),
    "play the closed form does not know": with_table(
        truth={"preset": "unmodelled", "backlash_mdeg": [8, 0, 8, 0, 8, 8]}
    ),
    "play everywhere by the closed form": with_table(
        truth={"preset": "unmodelled", "backlash_mdeg": 8}
    ),
    "droop twice": with_table(truth={"preset": "elastic", "gravity_mdeg": [10, 6, 8]}),
    "payload on a stiff arm": with_table(truth={"payload_kg": 2}),
    "bearings without drives": with_table(truth={"bearing_nm_per_mrad": [1, 2, 3, 4, 5, 6]}),
    "friction below zero": with_table(truth={"preset": "moving", "friction_nm": -1}),
    "friction below zero in a list": with_table(
        truth={"preset": "moving", "friction_nm": [3, 3, 1.5, 0.5, -0.35, 0.2]}
    ),
    "friction of five joints": played(truth={"preset": "moving", "friction_nm": [3, 3, 1, 1, 1]}),
    "friction of an arm at rest": with_table(truth={"preset": "elastic", "friction_nm": 1}),
    "a motion in words": with_table(truth={"preset": "elastic", "motion": "slow"}),
    "a motion without springs": with_table(truth={"preset": "rigid", "motion": True}),
    "a wait before the arm is there": with_table(truth={"preset": "moving", "dwell_s": -0.5}),
    "a wait longer than from shot to shot": with_table(
        truth={"preset": "moving", "dwell_s": 12, "speed_deg_s": 30}
    ),
    "no speed": with_table(truth={"preset": "moving", "speed_deg_s": 0}),
    "a speed in m/s": with_table(truth={"preset": "moving", "speed_m_s": 0.0625}),
    "no way to a pose": with_table(truth={"preset": "moving", "approach_deg": 0}),
    "damping below zero": with_table(truth={"preset": "moving", "damping": -0.1}),
    "waves from many to few": with_table(
        truth={"preset": "drives", "transmission_waves": [40, 10]}
    ),
    "a gear ratio of zero": with_table(truth={"preset": "gears", "gear_ratio": 0}),
    "a gear ratio of zero in a list": with_table(
        truth={"preset": "gears", "gear_ratio": [100, 100, 0, 50, 50, 50]}
    ),
    "gear ratios of five joints": played(truth={"preset": "gears", "gear_ratio": [50] * 5}),
    "changing payloads on a stiff arm": with_table(truth={"payloads_kg": [0, 5]}),
    "changing payloads below zero": with_table(truth={"preset": "payloads", "payloads_kg": [-1]}),
    "waves of the harmonics": with_table(truth={"preset": "drives", "transmission_waves": [2, 40]}),
    "a motion of unknown masses": lambda _: draw_truth(
        replace(
            load_robot("staubli_tx60"),
            notes=(f"{NO_MASS} forearm, hand moves: a rod to the next joint of 5 kg/m is assumed",),
        ),
        outcome_settings("moving"),
        0,
    ),
    "springs beside the maker's": lambda _: draw_truth(
        identified_robot(load_robot("staubli_tx60"), tx60_at_rest(), name="mine"),
        outcome_settings("elastic"),
        0,
    ),
    "a motion of a slide": lambda _: draw_truth(
        sliding(), outcome_settings("moving"), 0
    ),
    "a motion that friction holds back": lambda _: draw_truth(
        load_robot("staubli_tx60"), outcome_settings("moving", friction_nm=1e5), 0
    ).poses(np.full((1, 6), 0.5)),
    "an approach without end": lambda _: draw_truth(
        load_robot("staubli_tx60"), outcome_settings("moving", speed_mm_s=1.0), 0
    ).poses(np.full((1, 6), 0.5)),
    "half as many springs": played(truth={"preset": "elastic", "drive_nm_per_mrad": [90, 90, 40]}),
    "amplitudes of five joints": played(truth={"encoder_mdeg": [1, 1, 1, 1, 1]}),
    "play by the posture of a wall robot": lambda _: draw_truth(
        on_a_wall(), outcome_settings("unmodelled", gravity_mdeg=[0, 0, 0]), 0
    ),
    "sag on seven axes": played(
        robot="kuka_iiwa7",
        truth={"preset": "wen2022"},
        identification={"estimators": ["whitened"]},
    ),
    "ranges of six joints for seven": played(
        robot="kuka_iiwa7",
        identification={"estimators": ["whitened"]},
        pool={"joint_ranges_deg": [[-90, 90]] * 6},
    ),
    "a joint beyond its limit": played(
        robot="kuka_iiwa7",
        identification={"estimators": ["whitened"]},
        pool={"joint_ranges_deg": [[-90, 90]] * 6 + [[-90, 180]]},
    ),
    "springs too soft": lambda _: draw_truth(
        load_robot("staubli_tx60"), outcome_settings("elastic", drive_nm_per_mrad=[0.5] * 6), 0
    ).poses(np.full((1, 6), 0.5)),
    "outliers everywhere": with_table(tracker={"preset": "at960", "outliers": 30}),
    "missed below zero": with_table(tracker={"preset": "at960", "missed": -1}),
    "outliers of the paper": with_table(tracker={"outliers": 3}),
    "drift in another unit": with_table(tracker={"preset": "at960", "drift_mm_per_sqrt_h": 0.02}),
    "yes for true": with_table(tracker={"preset": "at960", "systematic": 1}),
    "nan": with_table(tracker={"position_um": float("nan")}),
    "time": text("[tracker]\nposition_um = 12:30:45"),
    "old format": with_table(format=0),
    "newer format, before anything else": with_table(format=2, other=1),
    "two trials of one name": with_table(trial=[TRIAL, TRIAL]),
    "reserved name": with_table(trial=[TRIAL | {"name": "setting"}]),
    "more poses than candidates": with_table(trial=[TRIAL | {"poses": 2000}]),
    "uncertainty in paper rows": with_table(trial=[TRIAL | {"criterion": "V", "rows": "paper"}]),
    "reflector without points": with_table(tracker={"reflector_mm": [1, 2, 3]}),
    "points and the paper": with_table(tracker={"measures": "point"}),
    "points and the paper's budget": with_table(
        tracker={"measures": "point"}, studies={"paper_budget": True}, **WHITENED
    ),
    "paper's budget without its estimator": with_table(studies={"paper_budget": True}, **WHITENED),
    "paper's budget of random trials": with_table(
        studies={"paper_budget": True}, trial=[TRIAL | {"method": "random"}]
    ),
    "more random sets than are calibrated": with_table(
        studies={"paper_budget": True, "random_sets": 1001}
    ),
    "one random set": with_table(studies={"random_sets": 1}),
    "one robot of a population": with_table(studies={"population": 1}),
    "one replication": with_table(uncertainty={"replications": 1}),
    "fixtures that say nothing": with_table(fixtures={}, **WHITENED),
    "fixtures and the paper": with_table(fixtures=FIXTURES),
    "a free reflector nobody knows": with_table(
        fixtures=FIXTURES | {"free": ["C", "A"]}, tracker={"measures": "point"}, **WHITENED
    ),
    "a reflector twice": with_table(
        fixtures=FIXTURES | {"anchors_mm": {"A": [1500, 0, 0]}, "free": ["B", "B"]},
        tracker={"measures": "point"},
        **WHITENED,
    ),
    "a reflector with a comma": with_table(
        fixtures={"reflectors_mm": {"A,B": [0, 0, 60]}}, tracker={"measures": "point"}, **WHITENED
    ),
    "distances from nowhere": with_table(
        fixtures=FIXTURES | {"ranged": ["B"]}, tracker={"measures": "point"}, **WHITENED
    ),
    "distances to nowhere": with_table(
        fixtures=FIXTURES | {"anchors_mm": {"P1": [1500, 0, 0]}, "ranged": ["P1"]},
        tracker={"measures": "point"},
        **WHITENED,
    ),
    "two reflectors at one place": with_table(
        fixtures={"reflectors_mm": {"A": [0, 0, 60], "B": [0, 0, 60]}},
        tracker={"measures": "point"},
        **WHITENED,
    ),
    "too many reflectors": with_table(
        fixtures={"reflectors_mm": {f"R{k}": [k, 0, 60] for k in range(31)}}, **WHITENED
    ),
    "an anchor with one coordinate": with_table(fixtures={"anchors_mm": {"P1": [1]}}, **WHITENED),
    "two anchors at one place": with_table(
        fixtures={"anchors_mm": {"P1": [1500, 0, 0], "P2": [1500, 0, 0.9]}}, **WHITENED
    ),
    "stations where one stands": with_table(
        fixtures={"stations_mm": [[2600, -2000, 300], [3000, 2000, 300], [3000, 2000, 399.9]]},
        **WHITENED,
    ),
    "a trial called like distances": with_table(
        fixtures={"anchors_mm": {"P1": [1500, 0, 0]}},
        trial=[TRIAL, TRIAL | {"name": f"{TRIAL['name']}-ranges"}],
        **WHITENED,
    ),
    "a budget larger than the pool": with_table(
        pool={"size": 100}, budget={"pose_numbers": [50, 3000]}, studies={"paper_budget": True}
    ),
    "reflectors nothing measures": with_table(fixtures=FIXTURES, **WHITENED),
    "reflectors given twice": with_table(
        fixtures=FIXTURES, tracker={"measures": "point", "reflector_mm": [1, 2, 3]}, **WHITENED
    ),
    "two stations wrong the same way": with_table(
        fixtures={"stations_mm": [[3000, 2000, 300]]},
        tracker={"preset": "at960", "systematic": True},
        **WHITENED,
    ),
    "systematic errors of no size": with_table(tracker=NO_SIZE, **WHITENED),
    "systematic errors that no point shows": with_table(
        tracker=NO_SIZE | {"target_turn_mdeg": 5, "measures": "point"}, **WHITENED
    ),
    "studies of one station": with_table(
        fixtures={"stations_mm": [[3000, 2000, 300]]},
        studies={"population": 20, "tool_point": True},
        coverage={"robots": 8},
        trial=[TRIAL | {"rows": "paper"}],
        **WHITENED,
    ),
    "studies of full poses and points from two stations": with_table(
        fixtures={"stations_mm": [[3000, 2000, 300]]},
        tracker={"measures": "point"},
        studies={"tool_point": True},
        coverage={"robots": 8},
        trial=[TRIAL | {"rows": "paper"}],
    ),
    "a plan for two stations": lambda _: plan(
        scenario(fixtures={"stations_mm": [[3000, 2000, 300]]}, **ONLY_WHITENED)
    ),
    "a station that sees nothing": seen_by(
        {"stations_mm": [[2200, 2400, 300]]}, **{"cell.obstacle": [box_at(2200, 2400, 300)]}
    ),
    "a station below the floor": seen_by({"stations_mm": [[2200, 2400, -3000]]}),
    "a station in the work space": seen_by(
        {"stations_mm": [[2200, 2400, 300]]}, **{"tracker.station_mm": [600.0, 0.0, 500.0]}
    ),
    "a station that the target comes too near to": seen_by(
        {"anchors_mm": {"P1": [0, 0, 3000]}},
        **{"tracker.station_mm": [0.0, 0.0, 1200.0], "pool.line_of_sight": False},
    ),
    "an anchor that sees nothing": seen_by({"anchors_mm": {"P1": [0, 0, -3000]}}),
    "a reflector hidden from all stations": seen_by(
        {"reflectors_mm": {"A": [0, 0, 90], "B": [0, 0, -50]}}
    ),
    "an estimator twice": with_table(identification={"estimators": ["whitened", "whitened"]}),
    "obstacle without a kind": with_table(cell={"obstacle": [{"size_mm": [1, 2, 3]}]}),
    "wrong kind": with_table(plan={"goal": {"kind": "lst"}}),
    "key of another kind": with_table(plan={"goal": {"step_mm": 5}}),
    "key of another kind of obstacle": with_table(
        cell={"obstacle": [box_at(0, 0, 0) | {"file": "x"}]}
    ),
    "two weights of one posture": with_table(
        plan={"goal": {"kind": "list", "joints_deg": [[0.0] * 6], "weights": [1.0, 2.0]}}
    ),
    "a path of one corner": with_table(plan={"goal": {"kind": "path", "joints_deg": [[0.0] * 6]}}),
    "neither poses nor a target": with_table(plan={"poses": 0}),
    "a grid of stations and a list": with_table(
        plan={"stations": {"grid": GRID | {"count": [2, 2, 1]}, "list_mm": [[0.0, 0.0, 0.0]]}}
    ),
    "a grid of ten thousand stations": with_table(
        plan={"stations": {"grid": GRID | {"count": [100, 100, 1]}}}
    ),
    "poses and a target": with_table(plan={"poses": 29, "target_um": 30}),
    "target without a goal": with_table(plan={"target_um": 30, "criterion": "D"}),
    "target and random poses": with_table(
        plan={"poses": 0, "target_um": 30, "method": "random"}
    ),
    "measured and stations": with_table(
        plan={"poses": 9, "measured": "a.csv", "stations": {"list_mm": [[3000, 0, 0]]}}
    ),
    "goal without poses": with_table(plan={"goal": {"kind": "path"}}),
    "coverage with few poses": with_table(coverage={"robots": 8, "validation_poses": 18}),
    "coverage of an unknown robot": with_table(coverage={"robots": 8, "truths": ["wen2002"]}),
    "coverage of no robot": with_table(coverage={"robots": 8, "truths": []}),
    "coverage of a kind twice": with_table(coverage={"robots": 8, "truths": ["soft", "soft"]}),
    "coverage of one robot": with_table(coverage={"robots": 1}),
    "coverage of 99 % with few poses": with_table(
        coverage={"robots": 8, "validation_poses": 40, "level": 0.99}
    ),
    "coverage by another loss": with_table(
        coverage={"robots": 8}, identification={"loss": "huber"}
    ),
    "coverage with a prior": with_table(
        coverage={"robots": 8}, identification={"prior": {"angles_deg": 0.2}}
    ),
    "coverage of everything": with_table(coverage={"robots": 8, "level": 1.0}),
    "coverage of points": with_table(
        tracker={"measures": "point"},
        identification={"estimators": ["whitened"]},
        coverage={"robots": 8},
    ),
    "compensation of one robot": with_table(compensation={"robots": 1}),
    "compensation of a kind twice": with_table(
        compensation={"robots": 8, "truths": ["rigid", "rigid"]}
    ),
    "compensation with missed shots": with_table(
        compensation={"robots": 8}, tracker={"preset": "at960", "missed": 1}
    ),
    "compensation by another loss": with_table(
        compensation={"robots": 8}, identification={"loss": "cauchy"}
    ),
    "compensation of points": with_table(
        compensation={"robots": 8}, tracker={"measures": "point"}, **WHITENED
    ),
    "compensation in two cycles": with_table(compensation={"robots": 8, "cycles": 2}),
    "compensation at poses out of reach": lambda _: cube_of(center_mm=(900.0, 0.0, 100.0)),
    "a program without orientations": program("x_mm,y_mm,z_mm\n300,0,200\n"),
    "a program that is corrected already": program("q1_deg,status\n10,reached\n"),
    "a program that would be overwritten": program("q1_deg\n10\n", out="program.csv"),
    "coverage of a wall robot": lambda _: check_robot(
        scenario_of(deepcopy(SCENARIO) | {"coverage": {"robots": 8}}), on_a_wall(), where="x.toml"
    ),
    "budget of too few poses": with_table(budget={"poses": 5}),
    "budget of one size": with_table(budget={"pose_numbers": [30]}),
    "budget of a size too small": with_table(budget={"pose_numbers": [30, 4]}),
    "budget of a size twice": paper_budget(pose_numbers=[30, 50, 30]),
    "budget with regions outside the pool": paper_budget(location_border_mm=[900, 0]),
    "budget with a negative environment": with_table(budget={"environment_mm": -0.1}),
    "budget by a slip": with_table(budget={"location_pose": 50}),
    "DETMAX that never ends": with_table(trial=[TRIAL | {"detmax": [40, 2, 1, 0]}]),
    "DETMAX that never shakes": with_table(trial=[TRIAL | {"detmax": [40, 0, 1, 80]}]),
    "DETMAX that swaps more than the set has": with_table(
        trial=[TRIAL | {"detmax": [40, 30, 1, 80]}]
    ),
    "DETMAX that swaps more than the pool has": with_table(
        pool={"size": 32}, trial=[TRIAL | {"detmax": [40, 2, 4, 80]}]
    ),
    "DETMAX of three constants": with_table(trial=[TRIAL | {"detmax": [40, 2, 80]}]),
    "several at once": with_table(sed=3, pool={"size": 1, "altitude": 2}),
    "not UTF-8": text("name = 'ü'".encode("latin-1")),
    "not TOML": text("seed = one\n"),
    "nested": text("a = " + "[" * 5000),
    "no such scene": lambda _: load_scenario("wen2202"),
    "no such robot": played(robot="staubli_tx06"),
    "no such parameters": played(truth={"perturb": ["theta9"]}, identification={"free": "wen2002"}),
    "negative seed": lambda _: stream(-1),
    "wrong order": lambda _: play_run(scenario_of(SCENARIO), studies=(Fake(),), order=["setting"]),
    "output exists": folder(RunFolder.create),
    "output is a file": file_in_the_way,
    "output below a file": lambda path: (path.write_text(""), RunFolder.create(path / "run")),
    "output is no run": foreign_folder,
    "output in use": used(RunFolder.create),
    "not a run": lambda path: RunFolder.reopen(path),
    "another scenario": folder(lambda path: RunFolder.resume(path, "1" * 64)),
    "newer run": folder(RunFolder.reopen, manifest='{"format": 2}'),
    "damaged manifest": folder(RunFolder.reopen, manifest='{"format": 1, "format": 1}'),
    "unfinished": folder(read_result),
    "no recording yet": folder(recording_of),
    "no recording": folder(
        lambda path: ((path / layout.UNFINISHED).unlink(), recording_of(path))
    ),
    "every trial failed": lambda _: play_run(
        scenario_of(SCENARIO | {"trial": [TRIAL]}), studies=(Fake(failing=("best",)),)
    ).campaign,
    "not enough memory": without_memory,
    "plan with too few poses": planned(**{"plan.poses": 3}),
    "plan with too many poses": planned(**{"plan.poses": 61}),
    "plan for what nobody sees": planned(
        **POINT, **{"tracker.reflector_mm": [0.0, 0.0, 60.0], "plan.point_mm": [0.0, 0.0, 200.0]}
    ),
    "plan for a goal out of reach": planned(
        **{"plan.goal": {"kind": "list", "tool_mm_deg": [[2000.0, 0.0, 0.0, 0.0, 0.0, 0.0]]}}
    ),
    "plan for one goal twice": planned(
        **{"plan.goal": {"kind": "list", "joints_deg": [[0.0] * 6, [0.0] * 6]}}
    ),
    "plan from a blind station": planned(
        **{
            "plan.stations.list_mm": [INSIDE],
            "cell.obstacle": [box_at(*INSIDE)],
        }
    ),
    "plan from below the floor": planned(**{"tracker.station_mm": [0.0, 0.0, -3000.0]}),
    "plan from within the work space": planned(
        **{"plan.stations.list_mm": [INSIDE, [600.0, 0.0, 500.0]]}
    ),
    "plan from one station twice": planned(
        **{"plan.stations.list_mm": [INSIDE, [2600.0, 0.5, 300.0]]}
    ),
    "plan without tests of collision": planned(**{"pool.self_collision": False}),
    "plan for a goal in collision": planned(
        **{"plan.goal": {"kind": "list", "joints_deg": [HIT]}}
    ),
    "plan with an unreachable target": planned(**{"plan.poses": 0, "plan.target_um": 1.0}),
    "plan from a start in collision": planned(
        **{"plan.start_deg": HIT}
    ),
    "measured poses with a gap": measured("1,2,,4,5,6"),
    "measured poses twice": measured("1,2,3,4,5,6\n1,2,3,4,5,6"),
    "measured poses beyond a limit": measured("1,2,300,4,5,6"),
    "measured poses with an endless cell": measured(f"1,2,3,4,5,{'6' * 140_000}"),
    "plan with too few poses at stations compared": planned(
        **{"plan.poses": 3, "plan.stations.list_mm": [INSIDE]}
    ),
    # 30 numbers, six rows a pose: 5 poses leave no equation to judge a calibration by
    "plan without an equation to spare": planned(**{"plan.poses": 5}),
    "plan without an equation to spare beside poses measured": planned_after(
        "1,2,3,4,50,6\n9,8,7,6,60,4", **{"plan.poses": 3}
    ),
    # any two poses leave one direction of these unseen
    "plan at random that tells too little": planned(
        **ONLY_WHITENED,
        **{
            "identification.free": [f"{at}.{axis}" for at in ("base", "tool") for axis in "xyz"],
            "plan.method": "random", "plan.poses": 2,
        },
    ),
    "plan for nothing free": planned(**{"identification.free": []}),
    "plan for a path out of reach": planned(
        **{
            "plan.goal": {
                "kind": "path",
                "tool_mm_deg": [[300.0, 0, 300, 0, 180, 0], [2000.0, 0, 300, 0, 180, 0]],
            }
        }
    ),
    "plan for a box out of reach": planned(
        **{"plan.goal.center_mm": [3000.0, 0.0, 0.0], "plan.goal.size_mm": [100.0] * 3}
    ),
    "plan for a goal beyond a limit": planned(
        **{"plan.goal": {"kind": "list", "joints_deg": [[0.0, 10.0, 300.0, 0.0, 30.0, 0.0]]}}
    ),
    "plan for a path with a corner in collision": planned(
        **{"plan.goal": {"kind": "path", "joints_deg": [[0.0, 10.0, 20.0, 0.0, 30.0, 0.0], HIT]}}
    ),
    # a wall between the tracker and the middle of the robot's work space
    "plan for held-out poses that nobody can measure": planned(
        **{
            "tracker.station_mm": INSIDE,
            "plan.goal.center_mm": [350.0, 0.0, 150.0],
            "plan.goal.size_mm": [120.0] * 3,
            "cell.obstacle": [
                {
                    "kind": "box",
                    "size_mm": [10.0, 280.0, 280.0], "position_mm": [1500.0, 0.0, 230.0],
                }
            ],
        }
    ),
    "plan from a station that sees too little": planned(
        **{"plan.stations.list_mm": [[0.0, 0.0, 3000.0]], "tracker.acceptance_deg": 10.0}
    ),
    "plan from a blind station of one's own": planned(
        **{"tracker.station_mm": INSIDE, "cell.obstacle": [box_at(*INSIDE)]}
    ),
    "plan from a second station below the floor": planned(
        **{"plan.stations.list_mm": [INSIDE, [2600.0, 0.0, -900.0]]}
    ),
    "plan from a station in meters": planned(**{"tracker.station_mm": [2.6, -2.0, 0.3]}),
    "plan from a start of two joints": planned(**{"plan.start_deg": [1.0, 2.0]}),
    "measured poses with a number that is none": measured("1,2,3,4,5,6\n1,2,nan,4,5,6"),
    "measured poses without a joint": measured("1,2,3,4,5,6", HEAD.replace("q4_deg", "q4")),
    "measured poses without a row": measured(""),
    "plan exists": lambda path: (plan_like(path), check_free(path, layout.PLAN, overwrite=False)),
    "plan below a file": lambda path: (
        path.write_text(""), check_free(path / "out", layout.PLAN, overwrite=False)
    ),
    "output is no plan": lambda path: (
        path.mkdir(),
        (path / "thesis.tex").write_text(""),
        check_free(path, layout.PLAN, overwrite=True),
    ),
    "preset beside the numbers of another": edited('"wen2022"', '"rigid"'),
    "preset beside the numbers of another, in an old file": edited(
        '"wen2022"', '"soft"', old=True
    ),
    "tracker beside the numbers of another": edited(
        '"at960"', '"paper"', tracker={"preset": "at960"}
    ),
    "robot beside the numbers of another": edited("staubli_tx60", "universal_ur10"),
    "robot beside the numbers of another, in an old file": edited(
        "staubli_tx60", "kuka_iiwa7", old=True
    ),
    "origin of what there is not": with_table(
        origin={
            "robot": "staubli_tx6",
            "given": ["truth.presett", "trial.0.poses", "trail", "name.x", "plan.goal.nearby"],
        }
    ),
    "origin by a slip": with_table(origin={"givn": ["seed"], "truth": 3}),
    "origin in one word": with_table(origin={"given": "seed"}, pool={"size": 5}),
    "change of a key in a list": lambda _: changed(scenario_of(SCENARIO), {"trial.0.poses": 9}),
    "no noise": with_table(tracker={"position_um": 0}),
    "noise of 1e-12": with_table(tracker={"position_um": 1e-12}),
    "noise of 1e9": with_table(tracker={"position_um": 1e9}),
    "a target at 1e300": with_table(
        plan={"goal": {"kind": "list", "tool_mm_deg": [[1e300, 0, 0, 0, 0, 0]]}}
    ),
    "steps of nothing": with_table(plan={"goal": {"kind": "path", "step_mm": 1e-300}}),
    "a mass of 1e308": with_table(truth={"payload_kg": 1e308}),
    "nests all the time": with_table(
        tracker={"preset": "at960", "nests_s": 1e-3, "pose_s": 86400}
    ),
    "no noise along the beam": with_table(tracker={"preset": "at960", "range_um": [0, 0.15]}),
    "outliers at every held-out pose": with_table(
        tracker={"preset": "at960", "outliers": 3}, test={"poses": 3}
    ),
    "prior of no width": with_prior(angles_deg=0),
    "prior of negative width": with_prior(harmonics_mdeg=[20, -1], sd_mm={"d3": -1}),
    "prior in words": with_prior(lengths_mm="weak"),
    "prior by a slip": with_prior(angels_deg=0.1),
    "prior in another unit": with_prior(angles_mdeg=3),
    "prior of unknown numbers": checked(identification={"prior": {"sd_deg": {"alpha22": 1}}}),
    "prior of a number held fixed": checked(
        identification={"base": "fixed", "prior": {"sd_mm": {"base.x": 5}}}
    ),
    "prior of an angle in mm": checked(identification={"prior": {"sd_mm": {"alpha2": 0.1}}}),
    "prior of the paper": with_table(identification={"estimators": ["paper"], "prior": {}}),
    "tolerance without a rule": with_table(tolerance={"position_um": 100}),
    "tolerance of nothing by a rule of one's own": with_table(
        tolerance={"position_um": 0, "rule": "strict"}
    ),
    "model nobody knows": with_table(identification={"model": "extende"}),
    "loss nobody knows": with_table(identification={"loss": "welsch"}),
    "prior that is not positive definite": lambda _: Prior.of_precision(
        [0, 0], [[1, 2], [2, 1]], ("d1", "d2")
    ),
    "prior without spread": lambda _: Prior([0], [0], ("d1",)),
    "covariance that is not positive definite": lambda _: table_whiteners(shots(3, -1e-10)),
    "validation without noise": compared(shots(20, 0.0), shots(2)),
    "validation that was identified from": compared(shots(20), shots(20)),
    "18 validation poses": lambda _: conformal(np.ones(18)),
    "9 validation poses": lambda _: discrepancy(
        HeldOut(np.zeros((9, 3)), np.zeros((9, 3, 3)), np.zeros((9, 3, 3)), 0.0, 1.0)
    ),
    "draws too few for the coverage": lambda _: adaptive(
        lambda n, rng: rng.standard_normal((n, 1)), np.random.default_rng(0), batch=1999
    ),
    "replicates too few": lambda _: bootstrap(
        ROBOT.model, shots(30), parameters_of(ROBOT.model), np.random.default_rng(0), replicates=99
    ),
}  # fmt: skip


@cache
def message(name):
    """Kind and text of what a case is refused with."""
    with TemporaryDirectory() as made_here:
        path = Path(made_here) / "run"
        with FEWER_DRAWS, pytest.raises(CalibError) as caught:
            CASES[name](path)
    shown = str(caught.value).replace(str(path), "RUN")
    shown = shown.replace(f"process {os.getpid()}", "process PID")
    kind = type(caught.value).__name__.replace("SeveralInput", "Input")
    return kind, shown


def test_messages_are_word_for_word_as_written_down():
    blocks = []
    for name in CASES:
        kind, shown = message(name)
        blocks.append(f"{name} ({kind})\n{shown}\n")
    told = "\n".join(blocks)
    # the clock time of a lock is not part of the wording
    told = "\n".join(
        f"{line.split(' since ')[0]} since HH:MM{line.split(' since ')[1][5:]}"
        if " since " in line and "PID" in line
        else line
        for line in told.split("\n")
    )
    assert_as_written(told, "messages.txt")


@pytest.mark.parametrize("name", CASES)
def test_each_message_is_short_has_a_code_and_knows_no_insides(name):
    _, shown = message(name)
    for line in shown.splitlines():
        assert line.endswith("]")
        assert line[line.rindex("[") + 1 : -1].isalnum()
        assert len(line) < 400
        for word in ("pydantic", "Traceback", "NoneType", "dtype", "object at 0x", "<class"):
            assert word not in line
    assert np.all([ord(c) >= 32 or c == "\n" for c in shown])

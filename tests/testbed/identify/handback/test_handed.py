"""What is handed back, in tables, words and files: numbers with what holds them, a tool in use."""

import csv
import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.compensation import compensate
from calib.geometry.model import RobotModel
from calib.identification.ladders import ladders_of
from calib.identification.levels import with_errors
from calib.identification.prior import Prior
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize
from testbed.files.programs.correct import correct_program
from testbed.identify.applies.targets import statement_at
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.calibration import Calibration
from testbed.identify.conditions import measured
from testbed.identify.handback import states
from testbed.identify.handback.deliver import delivered_robot
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.handed import hand_back
from testbed.identify.handback.links import LinkBelief
from testbed.identify.handback.report import SPRUNG, hand_back_section
from testbed.identify.handback.results import dh_csv, tool_csv
from testbed.identify.handback.states import (
    LOOSE,
    MEASURED,
    NOMINAL,
    PRIOR,
    SHARED,
    TOGETHER,
    hand_back_warnings,
    hand_back_words,
    handed_numbers,
    handed_robot,
    in_own_frames,
    tool_words,
)
from testbed.identify.results import headline
from testbed.report.page import Table, Text
from testbed.robots.catalog import load_robot
from testbed.robots.tolerances import usual_tolerances
from testbed.robots.write.folder import write_robot_folder
from testbed.scenario.tool_in_use import ToolInUse
from testbed.store.codec import pack, unpack
from tests.calibrated import real, robot, session_of, sound, table_of, true_model
from tests.reference import pool_r
from tests.testbed.files.made import ROBOT
from tests.testbed.identify.test_visits import campaign

LEANING = "springs on a tilted base"
GRIPPER = ToolInUse("gripper", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), 1e-4)


@cache
def with_gripper():
    session = session_of(table_of(true_model(), pool_r(80)), in_use=GRIPPER)
    return calibrate(robot(), session, Options(seed=1))


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_the_tip_stands_in_table_result_and_report_and_comes_back():
    found = unpack(Calibration, pack(with_gripper()))
    stated = found.handback.in_use
    rows = rows_of(tool_csv(found))
    assert [row["pose_id"] for row in rows] == [
        found.pose_names[pose]
        for pose in np.unique(found.measurements.pose_id[found.split.is_test])
    ]
    tips = [float(row["R95_tool_in_use_um"]) for row in rows]
    np.testing.assert_allclose(tips, 1e6 * stated.at_poses, rtol=1e-3)
    document = headline(found, Delivered((), (), 0))["handed_back"]
    assert document["tool_in_use"]["R95_mean_um"] == pytest.approx(1e6 * stated.radius_mean)
    assert document["tool_in_use"]["point_mm"] == pytest.approx([0.0, 0.0, 150.0])
    assert document["links_held_because"] == found.handback.why
    section = hand_back_section(found, ())
    (table,) = (block for block in section.blocks if isinstance(block, Table))
    assert [row[0] for row in table.rows] == ["measured target", "gripper"]
    assert tool_words(found)[0].startswith("for gripper, at (0, 0, 150) mm in the flange")
    assert (stated.at_poses > 20 * stated.measured_at_poses).all()


def test_targets_of_a_program_are_those_of_the_tool_in_use(tmp_path):
    program = tmp_path / "jobs.csv"
    program.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,30,40,50,60\n")
    found = with_gripper()
    result = correct_program(
        program, robot(), in_own_frames(found), tmp_path / "out.csv",
        measured=measured(found), set_up=found.set_up,
    )  # fmt: skip
    tip = statement_at(found, result).radius_mean
    assert tip > 0.9 * found.handback.in_use.at_poses.min()
    plain = replace(found, handback=replace(found.handback, in_use=None))
    # the tool of the file is as far behind the flange as the gripper is, and lies nearer
    assert 10 * found.proof.point.radius_mean < statement_at(plain, result).radius_mean < tip


def test_a_corrected_program_brings_the_robot_that_is_handed_out_to_its_targets():
    """Where axes 1 and 2 are apart, beta1 and d3 stand for a turn of the base: 0.3 mm here."""
    chain = robot().model.chain
    links = chain.links.copy()
    links[0, 2] = 0.15
    arm = replace(robot(), model=RobotModel(replace(chain, links=links)))
    links = links + true_model().chain.links - chain.links
    truth = RobotModel(replace(true_model().chain, links=links))
    found = calibrate(arm, session_of(table_of(truth, pool_r(60))), Options(seed=1))
    T = arm.model.poses(pool_r(100)[60:80])
    sent = compensate(arm.model, in_own_frames(found), pool_r(100)[60:80], arm.limits)
    reached = np.array([status == "reached" for status in sent.status])
    assert reached.sum() > 10
    handed = delivered_robot(found, arm, found.fit).model.chain
    own = replace(handed, T_world_base=chain.T_world_base, T_flange_tool=chain.T_flange_tool)
    # what is left of a target counts as none from 1e-9 m on
    np.testing.assert_allclose(RobotModel(own).poses(sent.q)[reached], T[reached], atol=2e-9)


def test_numbers_of_springs_have_no_uncertainty_of_their_own():
    """Each stands for what the model lacks as well; `test_springs_truth` shows how far off."""
    gravity, _ = ladders_of(robot().model, limits=robot().limits)
    springs = next(level.errors for level in gravity.levels if level.name == LEANING)
    arm = replace(robot(), model=with_errors(robot().model, springs))
    session = session_of(table_of(true_model(), pool_r(60)), model="geometric")
    found = calibrate(arm, session, Options(seed=1))
    numbers = {one.row.name: one for one in handed_numbers(found)}
    assert {"tilt1", "tilt2", "spring2.z", "moment3.m"} < set(springs.names)
    told = {row["number"]: (row["U_k2"], row["held_by"]) for row in rows_of(dh_csv(found))}
    for name in springs.names:
        assert numbers[name].row.new != 0.0  # found, all the same
        assert numbers[name].row.expanded is None
        assert told[name] == ("", TOGETHER)
    assert float(told["a2"][0]) > 0
    text = [block.text for block in hand_back_section(found, ()).blocks if isinstance(block, Text)]
    assert SPRUNG in " ".join(text)
    summary = found.fit.identification.summary()
    lines = {line.split()[0]: line for line in summary.splitlines() if line}
    assert "with others" in lines["tilt1"]
    assert "with others" not in lines["a2"]


def test_every_number_says_what_holds_it():
    rows = rows_of(dh_csv(with_gripper()))
    held = {row["number"]: row["held_by"] for row in rows}
    # the last link was taken for the place of the target: nothing but its prior is known
    assert {held[f"{name}6"] for name in ("theta", "d", "a", "alpha", "beta")} == {PRIOR}
    assert held["a2"] == held["alpha1"] == MEASURED
    written = {row["number"]: float(row["new"]) for row in rows}
    arm = delivered_robot(with_gripper(), robot(), with_gripper().fit)
    assert "many sets of numbers give the same tool pose" in arm.sources["geometry"]
    handed = arm.model.chain.links
    for k in range(6):
        assert written[f"d{k + 1}"] == pytest.approx(1e3 * handed[k, 1], abs=1e-6)
        assert written[f"alpha{k + 1}"] == pytest.approx(np.degrees(handed[k, 3]), abs=1e-7)


def test_where_nothing_is_believed_nothing_is_said_of_the_tip():
    session = session_of(table_of(true_model(), pool_r(80)), in_use=GRIPPER)
    links = LinkBelief(usual_tolerances(6), None, "")
    found = hand_back(
        robot(), session, links, np.zeros((6, 5)), None, np.zeros((1, 6)),
        target=(0.0, 0.0, 0.0), repeatability=np.zeros(6),
    )  # fmt: skip
    assert found.in_use is None
    assert found.tool_refused.startswith("nothing is stated of the tip of gripper")


def test_without_a_need_no_prior_is_spoken_of():
    found = sound()
    assert (found.handback.why, found.handback.in_use) == ("", None)
    assert found.fit.identification.prior is None
    assert not hand_back_warnings(found)
    assert len(hand_back_words(found)) == 1  # the rule
    held = {one.row.name: one.held_by for one in handed_numbers(found)}
    assert held["theta1"] == held["d6"] == NOMINAL  # base and tool take them up
    assert held["d2"] == held["d3"] == SHARED  # half of what is known of both
    true = true_model().chain.links
    off, scale = {}, {"mm": 1e3, "deg": float(np.degrees(1.0))}
    for one in handed_numbers(found)[6:36]:
        kind, k = one.row.name[:-1], int(one.row.name[-1]) - 1
        at = true[k, ("theta", "d", "a", "alpha", "beta").index(kind)] * scale[one.row.unit]
        off[one.row.name] = abs(one.row.new - at), one.row.expanded
    # 4 u: of some 15 numbers none is that far off but once in a thousand robots
    assert all(error < 2 * U for error, U in off.values() if U is not None)
    halves = [off[name][0] for name, how in held.items() if how == SHARED]
    # without that word these had the U of the others, which does not hold them
    least = min(U for name, (_, U) in off.items() if U is not None and name[0] in "tb")
    assert max(halves) > 4 * least  # eight u: by no chance


def test_a_number_beyond_its_tolerance_is_told():
    found = sound()
    narrow = replace(found.handback, tolerance=usual_tolerances(6) / 4)
    told = hand_back_warnings(replace(found, handback=narrow))
    moved = {
        one.row.name: abs(one.row.delta)
        for one in handed_numbers(replace(found, handback=narrow))
        if one.tolerance and abs(one.row.delta) > one.tolerance
    }
    assert moved
    sentences = " ".join(text for text in told if "changed by more than the tolerance" in text)
    assert all(f"{name} by " in sentences for name in list(moved)[:6])


def test_a_model_that_tests_refute_confirms_no_number():
    """Fitted without its springs, an arm has numbers that stand for them, far beyond their U."""
    found = sound()
    narrow = replace(found.handback, tolerance=usual_tolerances(6) / 4)
    refuted = replace(found.proof, trust=replace(found.proof.trust, refuted=True))
    for proof, confirmed in ((found.proof, True), (refuted, False)):
        told = " ".join(hand_back_warnings(replace(found, handback=narrow, proof=proof)))
        assert ("confirm it" in told) == confirmed
        assert ("what the model misses may be in it" in told) != confirmed


def test_a_number_beyond_its_tolerance_is_told_though_priors_hold_others(monkeypatch):
    """Waves have priors of their own, and share their mean with the zero of their joint."""
    found = sound()
    given = replace(found.handback, tolerance=usual_tolerances(6) / 4)
    believed = found.fit.identification
    prior = Prior(np.zeros(len(believed.names)), np.ones(len(believed.names)), believed.names)
    fit = replace(found.fit, identification=replace(believed, prior=prior))
    other = replace(found, fits=(fit,), handback=replace(given, by_prior=np.ones(42)))
    far = [one for one in handed_numbers(other) if one.is_far]
    assert PRIOR in {one.held_by for one in far}
    (sentence,) = (text for text in hand_back_warnings(other) if "changed by more than" in text)
    assert "determine them only together with others" in sentence
    monkeypatch.setattr(states, "handed_numbers", lambda _: far[:1])
    (sentence,) = (text for text in hand_back_warnings(other) if "changed by more than" in text)
    assert sentence.startswith("1 number changed")
    assert "determine it only together with others" in sentence


def test_a_joint_term_is_held_by_what_tells_it_and_not_by_its_weak_prior():
    found = real()
    result = found.fit.identification
    terms = result.model.joint_errors.names
    assert set(terms) <= set(result.prior.names)  # all have one
    shares = dict(zip(result.parameters.names, found.handback.by_prior, strict=False))
    # a second way: by how much a variance falls where all priors are a little narrower
    stack = linearize(result.model, found.measurements.rows(found.is_used))
    scale = result.parameters.free_scale
    A = (
        stack.A[:, result.parameters.free_index]
        * scale
        * np.sqrt(result.weights[stack.row_of])[:, None]
    )
    at = [result.names.index(name) for name in result.prior.names]
    believed = np.zeros((len(scale),) * 2)
    believed[np.ix_(at, at)] = np.diag((scale[at] / result.prior.sd) ** 2)
    step = 1e-3
    less, more = (
        np.log(np.diag(np.linalg.inv(A.T @ A + np.exp(d) * believed))) for d in (-step, step)
    )
    for k, name in enumerate(result.names):
        # central differences: the third derivative is below 1, so that 1e-6 and rounding remain
        assert shares.get(name, 0.0) == pytest.approx((less - more)[k] / (2 * step), abs=1e-5)
    held = {one.row.name: one.held_by for one in handed_numbers(found)}
    assert {held[name] for name in terms} == {MEASURED}
    assert max(shares[name] for name in terms) < 0.5
    weak = replace(found.handback, by_prior=np.ones(len(found.handback.by_prior)))
    held = {one.row.name: one.held_by for one in handed_numbers(replace(found, handback=weak))}
    assert {held[name] for name in terms} == {PRIOR}


def test_a_number_that_nothing_holds_is_told():
    found = sound()
    narrow = replace(found.handback, tolerance=usual_tolerances(6) / 1000)
    other = replace(found, handback=narrow)
    loose = [one.row.name for one in handed_numbers(other) if one.held_by == LOOSE]
    assert loose
    assert any("U exceeds the tolerance" in text for text in hand_back_warnings(other))
    assert any(text.startswith("Nothing determines ") for text in hand_back_words(other))


def test_a_chosen_models_links_are_held_by_their_prior_where_they_share():
    held = {one.row.name: one.held_by for one in handed_numbers(real())}
    assert held["d2"] == held["d3"] == PRIOR
    assert held["a2"] == MEASURED


def test_tolerances_of_the_robot_and_the_session_are_the_priors_widths():
    arm = replace(robot(), tolerances=usual_tolerances(6) / 2)
    table = table_of(true_model(), pool_r(60))
    found = calibrate(arm, session_of(table, in_use=GRIPPER), Options(seed=1))
    assert found.handback.stated_by == "as the robot's file states"
    u = dict(
        zip(
            found.fit.identification.names,
            found.fit.identification.standard_uncertainty,
            strict=True,
        )
    )
    assert u["d6"] == pytest.approx(0.3e-3, rel=0.01)
    stated = session_of(table, link_sd=usual_tolerances(6) / 4)
    found = calibrate(arm, stated, Options(seed=1))
    assert (found.handback.why, found.handback.stated_by) == (
        "the session states it", "as the session states",
    )  # fmt: skip
    u = dict(
        zip(
            found.fit.identification.names,
            found.fit.identification.standard_uncertainty,
            strict=True,
        )
    )
    assert u["d6"] == pytest.approx(0.15e-3, rel=0.01)


def test_a_robot_keeps_its_tolerances_through_its_file(tmp_path):
    widths = usual_tolerances(6) * np.arange(1, 7)[:, None]
    write_robot_folder(replace(robot(), tolerances=widths), tmp_path / "arm")
    again = load_robot(tmp_path / "arm")
    np.testing.assert_allclose(again.tolerances, widths, rtol=1e-15)


def test_tools_of_several_visits_keep_their_poses_and_links_lie_nearest(tmp_path):
    """Two visits identify, a third one judges: three tools on one flange, moved by hand-back."""
    read = campaign(tmp_path)
    found = calibrate(ROBOT, read, Options(model="geometric"))
    fit, handed = found.fit.identification, handed_robot(found).model
    one, two = (predict(model, found.measurements).residual for model in (fit.model, handed))
    np.testing.assert_allclose(one, two, atol=1e-13)
    numbers = {one.row.name: one for one in handed_numbers(found)}
    for name in ("theta", "d", "a", "alpha", "beta"):
        assert numbers[f"{name}6"].held_by == NOMINAL
        assert abs(numbers[f"{name}6"].row.delta) < 1e-5
    assert numbers["d2"].row.delta == pytest.approx(numbers["d3"].row.delta, rel=0.02)


def test_links_that_a_session_holds_are_no_better_known_than_their_tolerance():
    session = session_of(
        table_of(true_model(own_frames=True), pool_r(60)), free="frames", in_use=GRIPPER
    )
    found = calibrate(robot(), session, Options(seed=1))
    assert not found.handback.why  # no link is free
    tip = found.handback.in_use
    # 30 numbers of 0.6 mm and 0.1 deg over an arm of half a meter: some millimeters
    assert 3e-3 < tip.radius_mean < 10e-3

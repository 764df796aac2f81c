"""What is stated at the targets of a program, and decided on them, against the true robot."""

import csv
import io
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import testbed.identify.handback.deliver as deliver_module
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import step_transform
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.identification.levels import with_errors
from calib.measurement.observations import joined
from calib.measurement.tables import points
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.conditions import SetUp
from testbed.identify.applies.region import reach_section
from testbed.identify.applies.targets import statement_csv, target_words, tool_point, tool_words
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.decisions import at_held_out, decided_at, decision_line, decision_section
from testbed.identify.handback.deliver import deliver
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.states import in_own_frames
from testbed.identify.results import headline
from testbed.report.text import csv_text
from testbed.robots.tolerances import usual_tolerances
from testbed.scenario.tolerance import Decision
from testbed.store.codec import pack, unpack
from testbed.store.npz import pretty_json
from tests.calibrated import TOOL, robot, session_of, sound, table_of, true_model
from tests.reference import DEG, SIGMA_POSITION, pool_r


@cache
def narrow(rule="guarded", tolerance=100e-6):
    """A calibration from poses on one side, the elbow hardly moved; its base is the robot's own."""
    q = pool_r(400)
    q = q[(np.abs(q[:, 0]) < 60 * DEG) & (q[:, 2] > 30 * DEG)][:80]
    table = table_of(true_model(own_frames=True), q)
    session = session_of(
        table,
        decision=Decision(tolerance, rule),
        conditions=Conditions(payload=np.zeros(len(table))),
        set_up=SetUp(),
    )
    return calibrate(robot(), session, Options(seed=1, held_out=30))


@cache
def of_its_tool():
    """A robot whose file knows the measured target as its tool, and its calibration."""
    own = robot()
    chain = replace(own.model.chain, T_flange_tool=step_transform(TOOL))
    own = replace(own, model=replace(own.model, chain=chain))
    session = session_of(table_of(true_model(), pool_r(80)), tool="fixed")
    return own, calibrate(own, session, Options(seed=1))


def delivered(found, joints, folder, arm=None, **texts):
    """What comes with a program of joint targets [rad], and the table beside it."""
    columns = {f"q{k + 1}_deg": [f"{x / DEG:.6f}" for x in joints[:, k]] for k in range(6)}
    columns |= texts
    program = folder / "jobs.csv"
    program.write_text(csv_text(tuple(columns), zip(*columns.values(), strict=True)))
    out = folder / "out"
    out.mkdir()
    made = deliver(found, arm or robot(), out, program=program)
    table = list(csv.DictReader(io.StringIO((out / "jobs_statement.csv").read_text())))
    return made, table


@cache
def many():
    """Twenty targets where the poses were, and one the other way round."""
    q = narrow().stated_q
    inside = q[narrow().proof.belief.proven.applies(q).transfer < 3][:20]  # 4 is the edge
    return np.concatenate([inside, [[2.9, *inside[0, 1:]]]])


def test_each_target_has_its_place_its_growth_and_its_radius(tmp_path):
    found = narrow()
    made, table = delivered(found, many(), tmp_path)
    targets, reach = made.targets, found.proof.belief.proven.applies(many())
    assert [row["place"] for row in table] == targets.place.tolist()
    assert (targets.place[:20] == "inside").all()
    assert targets.place[20] != "inside"
    assert "joint 1 was never proven above" in table[20]["why"]
    # the corrected targets are some 10 mdeg from the poses: less than 1 % of what they carry
    np.testing.assert_allclose(targets.transfer, reach.transfer, rtol=0.02)
    stated = [row for row in table if row["R95_mean_um"]]
    assert len(stated) == targets.stated.sum()
    assert all(float(row["R95_move_um"]) > float(row["R95_mean_um"]) for row in stated)
    # the radius of a grown region, written out: half the variance of a round one is 1 / 1.614^2
    region = found.proof.belief.regions(many()[:1])
    u = float(region.point[0]) * region.factor / 2.7955
    assert 1.61 * u < targets.radius_mean[0] < 1.97 * u


def test_the_true_point_of_a_corrected_target_lies_within_the_stated_radius(tmp_path):
    found = narrow()
    q = found.stated_q
    made, _ = delivered(found, q, tmp_path)
    nominal = robot().model.poses(q)[:, :3, 3]
    text = (tmp_path / "out" / "jobs_corrected.csv").read_text()
    rows = csv.DictReader(io.StringIO(text))
    sent = np.array([[float(row[f"q{k}_deg"]) * DEG for k in range(1, 7)] for row in rows])
    true = true_model(own_frames=True).poses(sent)[:, :3, 3]
    # one robot: its error is common to all poses, so that all or few are held
    assert (np.linalg.norm(true - nominal, axis=1) < made.targets.radius_mean).mean() > 0.9


def test_a_program_mostly_outside_keeps_the_regions_of_its_targets_inside(tmp_path):
    """What is stated of a target does not depend on the others: moved away, they change nothing."""
    found = narrow()
    q = np.random.default_rng(2).uniform(*robot().limits.T, (200, 6))
    q = q[np.abs(q[:, 4]) > 0.5]  # a wrist that is not stretched out, so that all are corrected
    away = q[found.proof.belief.proven.applies(q).place == "outside"][:7]
    made, table = delivered(found, np.concatenate([many()[:3], away]), tmp_path)
    (tmp_path / "alone").mkdir()
    alone, _ = delivered(found, many()[:3], tmp_path / "alone")
    assert made.targets.place.tolist() == ["inside"] * 3 + ["outside"] * 7
    assert made.targets.stated.tolist() == [True] * 3 + [False] * 7
    np.testing.assert_allclose(
        made.targets.radius_mean[:3], alone.targets.radius_mean, rtol=1e-12
    )  # to rounding
    assert [bool(row["R95_mean_um"]) for row in table] == made.targets.stated.tolist()
    assert all(row["why"].startswith("no region: ") for row in table[3:])
    assert (made.targets.reaches, alone.targets.reaches) == (False, True)
    told = target_words(made.targets)
    assert told[0].startswith("of 10 targets of the program, 3 lie inside what was proven")
    assert told[1].startswith("no region is stated outside, where 7 of 10 targets lie: measure 20")
    assert told[2].endswith("at 3 of 10 targets") or "at 3 of 10 targets; it grows" in told[2]
    # decided as well: the tolerance is kept or not whatever else the program has
    assert len(made.targets.after.outcome) == 3
    assert [row["decision"] for row in table[3:]] == ["undecided"] * 7


def test_a_target_left_as_written_has_no_radius_but_what_it_misses(tmp_path):
    """With the wrist stretched out no small move of the joints corrects a target."""
    found, q = narrow(), many()[:5].copy()
    q[1, 4] = 0.0
    made, table = delivered(found, q, tmp_path)
    text = (tmp_path / "out" / "jobs_corrected.csv").read_text()
    corrected = list(csv.DictReader(io.StringIO(text)))
    kept = [row["status"] != "reached" for row in corrected]
    assert kept == [False, True, False, False, False]
    assert table[1]["R95_mean_um"] == table[1]["R95_move_um"] == ""
    assert table[1]["place"] == "not corrected"
    # two digits of what the program says is left: by the identified model, in the robot's frame
    left = float(corrected[1]["left_mm"])
    off = in_own_frames(found).poses(q)[1, :3, 3] - robot().model.poses(q)[1, :3, 3]
    assert left == pytest.approx(1e3 * np.linalg.norm(off), rel=1e-5)
    assert table[1]["why"].startswith(f"not corrected: {left:.2g} mm is left")
    # the tolerance of 0.1 mm is still decided on: what it misses is known, with a region
    assert table[1]["decision"] == table[1]["decision_before"] == "fail, guard band R95"
    told = target_words(made.targets)
    assert told[0].startswith("of 4 corrected targets of the program, 4 lie inside")
    assert "no radius is stated at 1 target left as written" in told
    assert "at 4 of 5 targets" in told[-1]
    assert made.targets.radius_mean[1] == 0.0


def test_a_target_under_another_payload_has_no_region_and_no_decision(tmp_path):
    made, table = delivered(narrow(), many()[:3], tmp_path, payload_kg=("5.0", "0.0", "0.0"))
    assert made.targets.stated.tolist() == [False, True, True]
    assert table[0]["why"] == "no region: other payload"
    assert (table[0]["decision"], table[0]["R95_mean_um"]) == ("undecided", "")
    assert decided_at(narrow(), made)[-1].counts["undecided"] >= 1
    # the decisions of the others stand in their own rows
    told = [float(row["deviation_before_um"]) for row in table[1:]]
    np.testing.assert_allclose(told, made.targets.before.distance * 1e6, atol=6e-4)


def test_no_region_is_said_to_grow_where_none_is_stated(tmp_path):
    """Why there is none comes first."""
    q = pool_r(400)
    reach = narrow().proof.belief.proven.applies(q)
    # well between the limits 4 and 9: correcting a target moves both by less than 2 %
    q = q[(reach.place == "edge") & (reach.growth > 4.5) & (reach.growth < 8.0)][:1]
    _, table = delivered(narrow(), np.repeat(q, 2, axis=0), tmp_path, payload_kg=("0.0", "5.0"))
    assert "the region is grown" in table[0]["why"]
    assert table[1]["why"].startswith("no region: other payload; ")
    assert "grown" not in table[1]["why"]


def test_decisions_keep_the_guard_band_and_say_their_rule(tmp_path):
    found = narrow()
    made, table = delivered(found, many()[:20], tmp_path)
    after, before = made.targets.after, made.targets.before
    R = np.array([float(row["R95_mean_um"]) for row in table]) * 1e-6
    off = np.array([float(row["deviation_before_um"]) for row in table]) * 1e-6
    # four digits in the file; the guard of the program as it was is that of its own joints
    for row, radius in zip(table, R, strict=True):
        expected = "pass, guard band R95" if radius <= 100e-6 else "undecided"
        assert row["decision"] == expected
    for row, d, guard in zip(table, off, before.guard, strict=True):
        expected = "fail, guard band R95" if d >= 100e-6 + guard else "undecided"
        expected = "pass, guard band R95" if d <= 100e-6 - guard else expected
        assert row["decision_before"] == expected
    assert (after.risk[after.outcome == "pass"] <= 0.05).all()
    line = decision_line(decided_at(found, made))
    assert line.startswith("Tolerance 100 um: ")
    assert "simple" not in line
    section = decision_section(decided_at(found, made))
    assert section.blocks[0].head[1] == "pass, guard band R95"


def test_a_simple_rule_never_borrows_the_words_of_a_guarded_one(tmp_path):
    found = replace(narrow(), decision=Decision(100e-6, "simple"))
    made, table = delivered(found, many()[:4], tmp_path)
    section = decision_section(decided_at(found, made))
    words = " ".join([*section.blocks[0].head, section.blocks[1].text, *table[0].values()])
    assert "pass, simple acceptance" in words
    assert "guard band R95" not in words.replace("guard band R95 um", "")
    assert "at the limit it is 50 % or more" in words


def test_the_risk_of_held_out_decisions_is_that_of_drawn_robots():
    found = narrow(tolerance=700e-6)
    q = found.stated_q
    before, after = at_held_out(found, q)
    belief = found.proof.belief
    region = belief.regions(q)
    S = region.covariance * (region.factor / 2.795483) ** 2
    d = belief.model.poses(q)[:, :3, 3] - found.before.poses(q)[:, :3, 3]
    rng = np.random.default_rng(4)
    drawn = d[:, :, None] + np.linalg.cholesky(S) @ rng.standard_normal((len(q), 3, 20_000))
    off = (np.linalg.norm(drawn, axis=1) > 700e-6).mean(axis=1)
    # 20,000 draws leave 0.0035 in a share of a half
    np.testing.assert_allclose(before.risk, off, atol=0.015)
    assert (after.distance == 0).all()


def test_nothing_is_decided_where_nothing_is_believed_or_asked():
    found = narrow()
    none = replace(found, proof=replace(found.proof, belief=None, point=None))
    for one in (sound(), none):
        assert at_held_out(one, found.stated_q) is None
        assert decided_at(one, Delivered((), (), 0)) == ()
    assert decision_section(()) is None
    assert decision_line(()) == ""


def test_what_was_stated_and_decided_stands_in_report_and_result_and_comes_back(tmp_path):
    found = narrow()
    made, _ = delivered(found, many()[:5], tmp_path)
    again = unpack(Delivered, pack(made))
    result = json.loads(pretty_json(headline(found, again)))
    radii = result["targets"]["R95_mean_um"]
    np.testing.assert_allclose(radii, made.targets.radius_mean * 1e6)
    assert result["decisions"]["program_after"]["fail"] == 0
    assert result["statements"]["R95_mean_um"] == pytest.approx(
        found.proof.point.radius_mean * 1e6, rel=1e-12
    )
    shown = reach_section(found, again).blocks[4]
    assert [float(row[2]) for row in shown.rows] == pytest.approx(radii, rel=0.01)  # three digits


@pytest.mark.parametrize(
    ("column", "values"), [("tool", "gripper"), ("temperature_degC", "20"), ("payload_kg", "0")]
)
def test_targets_that_state_what_the_measurements_do_not_have_no_radius(tmp_path, column, values):
    """Whether it is the same is unknown: the terminal, the table and the result say so alike."""
    found, kind = narrow(), column.partition("_")[0]
    if kind == "payload":
        found = replace(found, conditions=Conditions())
    made, table = delivered(found, many()[:3], tmp_path, **{column: [values] * 3})
    again, why = unpack(Delivered, pack(made)), f"{kind} of the measurements not stated"
    result = json.loads(pretty_json(headline(found, again)))
    assert [row["why"] for row in table] == [f"no region: {why}"] * 3
    assert not any(row["R95_mean_um"] or row["R95_move_um"] for row in table)
    assert made.targets.before is made.targets.after is None
    assert result["delivered"]["program_conditions"] == result["targets"]["why"] == [why] * 3
    assert result["targets"]["R95_mean_um"] == [None] * 3
    assert any(f"the targets state their {kind} (" in said for said in again.program)
    told = target_words(again.targets)
    assert told[0].endswith("3 outside (1, 2, 3)")
    assert told[1] == (
        "no region is stated at 3 targets under conditions that the measurements did not have, or "
        "do not state"
    )
    assert len(told) == 2  # to measure there would not help
    old = replace(again.targets, departed=None)  # of a record that holds none
    assert len(target_words(old)) == 2


def test_targets_keep_the_names_that_the_program_gives_them(tmp_path):
    """In the table, the result, the report and the sentences; one without a name has its line."""
    q = many()[[0, 1, 20]]
    names = ["pick", "", "=place, left"]
    made, table = delivered(narrow(), q, tmp_path, pose_id=names)
    again = unpack(Delivered, pack(made))
    result = json.loads(pretty_json(headline(narrow(), again)))["targets"]
    places = ["jobs.csv:2", "jobs.csv:3", "jobs.csv:4"]
    assert list(again.targets.names) == result["name"] == names
    assert list(again.targets.places) == result["where"] == places
    # a spreadsheet must not take a name for a formula
    assert [row["name"] for row in table] == ["pick", "", "'=place, left"]
    assert [row["where"] for row in table] == places
    shown = reach_section(narrow(), again).blocks[4]
    assert shown.head[:2] == ("target", "name")
    assert [row[:2] for row in shown.rows] == [
        ("1", "pick"), ("2", "jobs.csv:3"), ("3", "=place, left"),
    ]  # fmt: skip
    assert '(3 "=place, left")' in target_words(again.targets)[0]
    old = replace(again.targets, names=(), places=())  # of a record that holds none
    assert "(3)" in target_words(old)[0]
    assert [row["name"] for row in csv.DictReader(io.StringIO(statement_csv(old)))] == ["", "", ""]


@pytest.mark.parametrize("column", ["pose_id", "target", "name"])
def test_any_column_of_names_names_the_targets_but_no_endless_one(tmp_path, column):
    q = many()[:2]
    _, table = delivered(narrow(), q, tmp_path, **{column: ("weld 7", "weld 8")})
    assert [row["name"] for row in table] == ["weld 7", "weld 8"]
    (tmp_path / "long").mkdir()
    with pytest.raises(InputError, match="201 characters"):
        delivered(narrow(), q, tmp_path / "long", **{column: ("a" * 201, "b")})


def test_a_program_moves_the_tool_that_it_was_written_for():
    """Found from nothing, the target on the flange is not the tool of the program."""
    found = sound()
    assert not found.own_frames
    flange = found.fit.identification.model.chain.T_flange_tool
    own = robot().model.chain.T_flange_tool
    at = flange @ np.append(tool_point(found), 1.0)
    np.testing.assert_allclose(at[:3], own[:3, 3], atol=1e-15)
    assert np.array_equal(tool_point(narrow()), np.zeros(3))


def test_a_guarded_factor_widens_radii_and_guard_bands_alike(tmp_path):
    found = narrow()
    belief = replace(found.proof.belief, factor=2 * found.proof.belief.factor)
    wide = replace(found, proof=replace(found.proof, belief=belief))
    (tmp_path / "wide").mkdir()
    one, two = (
        delivered(each, many()[:3], folder)[0].targets
        for each, folder in ((found, tmp_path), (wide, tmp_path / "wide"))
    )
    # the smallest region is written to 1e-6 of its size
    np.testing.assert_allclose(two.radius_mean, 2 * one.radius_mean, rtol=1e-5)
    np.testing.assert_allclose(two.before.guard, 2 * one.before.guard, rtol=1e-5)


def test_deviation_and_region_are_in_the_same_axes_where_the_base_was_found(tmp_path):
    """A tracker that stands askew: the risk is that of points drawn in its own axes."""
    own, plain = of_its_tool()
    q = plain.stated_q[:8]
    goes = (in_own_frames(plain).poses(q) - own.model.poses(q))[:, :3, 3]
    # near the limit the risk is that of one direction, which another turn would not show
    limit = float(np.linalg.norm(goes[0])) + 15e-6
    found = replace(plain, decision=Decision(limit, "simple"))
    made, _ = delivered(found, q, tmp_path, own)
    region = found.proof.belief.regions(q[:1])
    base, stands = (
        model.chain.T_world_base[:3, :3] for model in (found.fit.identification.model, own.model)
    )
    drawn = np.random.default_rng(4).multivariate_normal(
        base @ stands.T @ goes[0], region.covariance[0] * (region.factor / 2.795483) ** 2, 400_000
    )
    risk = (np.linalg.norm(drawn, axis=1) > limit).mean()
    # 400,000 draws leave 0.0005 in a share of a tenth
    assert made.targets.before.risk[0] == pytest.approx(risk, abs=0.002)
    assert 0.01 < risk < 0.4


def test_a_program_beyond_a_joint_map_is_told_so(tmp_path, monkeypatch):
    """The words reach whoever reads the program's outcome; `test_beyond` proves them."""
    plain = deliver_module.in_own_frames
    waves = JointErrors(harmonic_terms(6, (8,)))
    monkeypatch.setattr(deliver_module, "in_own_frames", lambda c: with_errors(plain(c), waves))
    q = narrow().measurements.q[narrow().is_used]
    joints = q[:2].copy()
    joints[1, 0] = q[:, 0].max() + np.pi / 8 + 0.02
    made, _ = delivered(narrow(), joints, tmp_path)
    told = " ".join(made.program)
    assert "target 2 turns joint 1 up to 24 deg beyond what was measured" in told
    assert told.count("half a wave") == 1


@pytest.mark.parametrize(("robots", "least"), [(2, 1), pytest.param(4, 3, marks=pytest.mark.study)])
@pytest.mark.parametrize("kind", ["frames", "one point", "targets found"])
def test_only_tolerances_tell_the_flange_where_another_target_was_measured(
    kind, robots, least, tmp_path
):
    """Robots whose last link is off as its tolerances say, measured at a target beside the flange.

    Readings take that for the place of the target, and the corrected program moves the flange. Of
    2 robots none is held in one study of 400, of 4 fewer than 3 in one of 70, if 95 % are.
    """
    held, sd, nominal = [], usual_tolerances(6)[-1], robot().model.chain
    for seed in range(robots):
        rng, plain = np.random.default_rng(seed), true_model(seed)
        links = plain.chain.links.copy()
        links[0] = nominal.links[0]  # its errors are those of the base
        links[-1] = nominal.links[-1] + sd * rng.standard_normal(5)
        table = table_of(replace(plain, chain=replace(plain.chain, links=links)), pool_r(60))
        if kind == "one point":
            table = points(table.q, table.position, sd=SIGMA_POSITION)
        session = session_of(table)
        if kind == "targets found":
            corners = 0.08 * np.eye(3)
            T = replace(plain, chain=replace(plain.chain, links=links)).poses(table.q)
            seen = [T[:, :3, 3] + T[:, :3, :3] @ corner for corner in corners]
            seen = rng.normal(seen, SIGMA_POSITION)
            each = (points(table.q, p, sd=SIGMA_POSITION, reflector=k) for k, p in enumerate(seen))
            session = session_of(
                joined(list(each)),
                fixtures=Fixtures(reflectors=np.zeros((3, 3))),
                reflector_names=("A", "B", "C"),
            )
        found = calibrate(robot(), session, Options(seed=1, held_out=20))
        assert not found.own_frames
        folder = tmp_path / str(seed)
        folder.mkdir()
        q = found.stated_q[:1]
        made, _ = delivered(found, q, folder)
        assert any("for the tool of the robot's file" in told for told in made.program)
        (row,) = csv.DictReader(io.StringIO((folder / "out" / "jobs_corrected.csv").read_text()))
        sent = np.array([[float(row[f"q{k}_deg"]) * DEG for k in range(1, 7)]])
        there = RobotModel(replace(nominal, links=links)).poses(sent)
        miss = (there - robot().model.poses(q))[0, :3, 3]
        held.append(np.linalg.norm(miss) < made.targets.radius_mean[0])
        assert made.targets.radius_mean[0] > 20 * found.proof.point.radius_mean
    assert sum(held) >= least


def test_a_tool_that_stays_as_the_file_has_it_is_the_one_that_was_measured():
    free, (_, kept) = sound(), of_its_tool()
    assert np.linalg.norm(tool_point(free)) > 0.01
    assert "for the tool of the robot's file" in tool_words(free)[0]
    assert not kept.own_frames
    assert not tool_point(kept).any()
    assert tool_words(kept) == ()

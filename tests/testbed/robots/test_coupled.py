"""An arm whose controller counts joints its own way gives what the same arm gives by plain ones."""

import csv
import re
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from calib.measurement.accuracy import rotation_errors
from testbed.files.alternatives import Interpretation
from testbed.files.probe import probe
from testbed.files.programs.correct import correct_program
from testbed.files.read import read_session
from testbed.files.rotations import in_form
from testbed.files.rows.ratios import ratios_that_fit
from testbed.files.rows.shifts import as_read, misfit_of
from testbed.laboratory.joint_lists import from_deg, read_joints
from testbed.proposal.data import look_at
from testbed.proposal.missing import columns_of
from testbed.proposal.parts import joint_parts
from testbed.robots.catalog import load_robot
from testbed.robots.coupled import ControllerTable
from testbed.robots.robot import workspace_of_reach
from testbed.robots.write.folder import write_robot_folder
from testbed.run.export import session_csv
from tests.testbed.files import made as made_of
from tests.testbed.files.made import ROBOT, columns, made, with_spread

SIGMAS = '[frames]\neuler = "XYZ"\n[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n'
WIDE = replace(ROBOT, limits=np.tile([-9.0, 9.0], (6, 1)))
"""The arm with limits that let every wrong reading in."""


def with_controller(*statements, robot=ROBOT, **limits):
    table = ControllerTable(joints=statements, **limits)
    return replace(robot, controller=table.controller(robot.model.chain.kinds))


FANUC = with_controller("q3 = J3 + J2")
GEARED = with_controller("J3 = q3 - q2", "q5 = J5 + 1/50 J4", "q6 = -J6 + 0.5 J5")
HELD = with_controller("q3 = J3 - J2", "q4 = -q2 - q3", robot=WIDE)


def counted(robot, table):
    """A table of plain joints [rad] as the robot's controller counts them."""
    names = [name for name in table if name[0] == "q" and name[1].isdigit()]
    J = robot.controller.of_arm(np.column_stack([table[name] for name in names]))
    return table | dict(zip(names, J.T, strict=True))


def in_radians(data):
    """The columns of some poses, joints with every bit."""
    table = {name: values for name, values in columns(data).items() if name[0] != "q"}
    return table | {f"q{k + 1}_rad": values for k, values in enumerate(data.q.T)}


def session(folder, table, robot, more=""):
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_text(made_of.csv(table, form="{:.17g}"))
    (folder / "s.toml").write_text(more + SIGMAS)
    return read_session(folder / "a.csv", robot, config=folder / "s.toml")


def test_a_controller_that_counts_its_joints_without_the_held_one_is_asked_to_say_so(tmp_path):
    J = HELD.controller.of_arm(made().q)
    plain = in_radians(replace_q(made(), J))
    del plain["q4_rad"]
    last = {"q5_rad": "q4_rad", "q6_rad": "q5_rad"}
    theirs = {last.get(name, name): values for name, values in plain.items()}
    with pytest.raises(
        InputError, match=r'write columns = \{ q5_deg = "q4_deg", q6_deg = "q5_deg"'
    ):
        session(tmp_path / "theirs", theirs, HELD)
    named = SIGMAS.replace(
        "[frames]", '[frames]\ncolumns = { q5_rad = "q4_rad", q6_rad = "q5_rad" }'
    )
    (tmp_path / "theirs" / "s.toml").write_text(named)
    told = read_session(tmp_path / "theirs" / "a.csv", HELD, config=tmp_path / "theirs" / "s.toml")
    own = session(tmp_path / "own", plain, HELD)
    assert np.array_equal(told.measurements.q, own.measurements.q)


def test_coupled_joints_are_read_as_the_same_bits_as_plain_ones(tmp_path):
    """All that follows then is the same: identification, statement, files."""
    J = FANUC.controller.of_arm(made().q)
    q = J.copy()
    q[:, 2] = J[:, 2] + J[:, 1]  # once more, so that both files have exactly this sum
    plain = session(tmp_path / "plain", in_radians(replace_q(made(), q)), ROBOT)
    table = in_radians(replace_q(made(), J))
    read_back = {
        name.replace("_rad", "_read_rad"): x for name, x in table.items() if name[0] == "q"
    }
    source = '[joints]\nsource = "commanded"\n'
    found = session(tmp_path / "coupled", table | read_back, FANUC, source)
    for name in ("q", "position", "rotation", "covariance", "pose_id", "repeat"):
        assert_array_equal(getattr(found.measurements, name), getattr(plain.measurements, name))
    assert_array_equal(found.read_back, plain.measurements.q)
    assert "joints are counted as the controller does: q3 = J3 + J2" in found.notes
    assert not any("counted" in note for note in plain.notes)


def replace_q(data, q):
    return made_of.Made(q, data.T, data.truth)


@pytest.mark.parametrize("robot", [FANUC, GEARED], ids=["fanuc", "geared"])
def test_a_table_goes_out_and_comes_back(tmp_path, robot):
    plain = session(tmp_path, in_radians(made()), ROBOT)
    seen = plain.measurements
    text = session_csv(robot, seen, np.zeros(len(seen), dtype=bool), np.arange(len(seen)) * 1.0)
    (tmp_path / "out.csv").write_text(text)
    again = read_session(tmp_path / "out.csv", robot)
    # a sum of three numbers below 2 pi, there and back
    assert_allclose(again.measurements.q, seen.q, rtol=0, atol=1e-14)
    assert_array_equal(again.measurements.position, seen.position)
    rows = list(csv.DictReader(StringIO(text)))
    J = np.array([[float(row[f"q{k}_rad"]) for k in range(1, 7)] for row in rows])
    assert_array_equal(J, robot.controller.of_arm(seen.q))


def program(folder, name, joints, head=range(1, 7)):
    lines = [",".join(f"q{k}_deg" for k in head)]
    lines += [",".join(f"{value!r}" for value in row) for row in np.degrees(joints).tolist()]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder / f"{name}.csv"


def targets(path):
    rows = list(csv.DictReader(path.read_text().splitlines()))
    return np.radians([[float(v) for k, v in row.items() if k[0] == "q"] for row in rows])


Q = np.radians([[10, 20, 70, 15, 40, -30], [-40, 35, 60, 5, 70, 20], [25, -10, 95, -30, 35, 80.0]])


@pytest.mark.parametrize("robot", [FANUC, GEARED], ids=["fanuc", "geared"])
def test_a_corrected_program_is_the_same_in_either_count(tmp_path, robot):
    truth = made().truth
    here = replace(truth, chain=replace(truth.chain, T_world_base=np.eye(4), T_flange_tool=
                   ROBOT.model.chain.T_flange_tool))  # fmt: skip
    plain = correct_program(program(tmp_path, "p", Q), ROBOT, here, tmp_path / "p_out.csv")
    J = robot.controller.of_arm(Q)
    found = correct_program(program(tmp_path, "c", J), robot, here, tmp_path / "c_out.csv")
    assert plain.corrected.all()
    assert found.corrected.all()
    assert_allclose(found.q, plain.q, rtol=0, atol=1e-12)
    out = targets(tmp_path / "c_out.csv")
    assert_allclose(robot.controller.to_arm(out), targets(tmp_path / "p_out.csv"), atol=1e-12)
    assert np.abs(here.poses(robot.controller.to_arm(out)) - ROBOT.model.poses(Q)).max() < 1e-9
    assert robot.controller.sentence in found.sentences
    # what the correction would take beyond a limit of the controller stays as it was
    low, high = np.degrees([J[:, 2].min(), J[:, 2].max()])
    table = ControllerTable(joints=robot.controller.statements, limits_deg={"J3": (low, high)})
    narrow = replace(robot, controller=table.controller(robot.model.chain.kinds))
    kept = correct_program(program(tmp_path, "n", J), narrow, here, tmp_path / "n_out.csv")
    J3 = np.degrees(robot.controller.of_arm(found.q)[:, 2])
    beyond = (low > J3) | (high < J3)
    assert beyond.any()
    assert [one == "limits" for one in kept.status] == beyond.tolist()
    before, after = targets(tmp_path / "n.csv"), targets(tmp_path / "n_out.csv")
    assert_array_equal(after[beyond], before[beyond])


def test_an_arm_with_a_held_joint_is_corrected_by_its_motors_alone(tmp_path):
    rng, nominal = np.random.default_rng(1), HELD.model
    real = replace(nominal, chain=nominal.chain.moved(2e-4 * rng.normal(size=42)))
    q = HELD.controller.holding(Q)
    path = program(tmp_path, "h", HELD.controller.written(q), (1, 2, 3, 5, 6))
    path.write_text(path.read_text().replace("q", "J").replace("_deg", ""))  # by number
    found = correct_program(path, HELD, real, tmp_path / "h_out.csv")
    assert found.corrected.all()
    assert any("as the joints 1, 2, 3, 5, 6 of" in text for text in found.sentences)
    assert any(
        "an arm with 5 free joints cannot orient its tool" in text for text in found.sentences
    )
    rows = list(csv.DictReader((tmp_path / "h_out.csv").read_text().splitlines()))
    motors = np.radians([[float(row[f"J{k}"]) for k in (1, 2, 3, 5, 6)] for row in rows])
    out, T = HELD.controller.read(motors, 6), nominal.poses(q)
    # the point is where it was meant
    assert np.abs((real.poses(out) - T)[:, :3, 3]).max() < 1e-8
    assert_allclose(out[:, 3], -out[:, 1] - out[:, 2], atol=1e-12)
    # and no motors that leave the point turn the tool nearer: the slope of the squared angle along
    # both such ways, by differences that are good to some 1e-6 of it
    for k in range(3):
        step = 1e-5 * np.eye(5)
        moved = np.array(
            [HELD.controller.read(motors[k] + s * d, 6) for d in step for s in (-1, 1)]
        )
        here = real.poses(moved)
        J = (here[1::2, :3, 3] - here[::2, :3, 3]).T / 2e-5
        angle = rotation_errors(np.broadcast_to(T[k], (10, 4, 4)), here) ** 2
        slope = (angle[1::2] - angle[::2]) / 2e-5
        still = np.linalg.svd(J)[2][3:]
        assert np.abs(still @ slope).max() < 1e-5 * np.abs(slope).max()


def test_cartesian_targets_of_an_arm_with_a_held_joint_may_be_rounded(tmp_path):
    """To a micrometer and 1e-5: no posture of the arm has just these poses."""
    rng, nominal = np.random.default_rng(2), HELD.model
    real = replace(nominal, chain=nominal.chain.moved(2e-4 * rng.normal(size=42)))
    q = HELD.controller.holding(Q)
    T = inverse(nominal.chain.T_world_base) @ nominal.poses(q)
    turn = in_form("quaternion", np.zeros((3, 4)), T[:, :3, :3])
    rows = np.hstack([np.round(1e3 * T[:, :3, 3], 3), np.round(turn, 5)]).tolist()
    head = "x_mm,y_mm,z_mm,qw,qx,qy,qz"
    text = "\n".join([head, *(",".join(map(repr, row)) for row in rows), ""])
    (tmp_path / "c.csv").write_text(text)
    found = correct_program(tmp_path / "c.csv", HELD, real, tmp_path / "c_out.csv")
    assert found.corrected.all()
    assert found.left.max() < 1e-8
    for reached in (found.q, found.q_before):
        assert_allclose(reached[:, 3], -reached[:, 1] - reached[:, 2], atol=1e-12)
    assert_allclose(found.q_before, q, atol=1e-4)


def test_a_table_of_an_arm_with_a_held_joint_has_no_column_of_it(tmp_path):
    table = columns(replace_q(made(), HELD.controller.holding(made().q)))
    del table["q4_deg"]
    table = with_spread(counted_held(table))
    found = session(tmp_path, table, HELD).measurements
    assert_allclose(found.q[:, 3], -found.q[:, 1] - found.q[:, 2], atol=1e-15)
    # as new session looks for them
    (look,) = look_at([tmp_path / "a.csv"], tmp_path)
    assert any(joint_parts(look, columns_of(HELD)))
    assert not any(joint_parts(look, columns_of(ROBOT)))


def counted_held(table):
    q = np.column_stack([table[f"q{k}_deg"] for k in (1, 2, 3, 5, 6)])
    J = HELD.controller.written(HELD.controller.read(q, 6))
    return table | {f"q{k}_deg": J[:, i] for i, k in enumerate((1, 2, 3, 5, 6))}


def test_lists_are_read_as_the_controller_counts_and_held_to_both_limits(tmp_path):
    limits = {"J3": (-50.0, 120.0)}
    robot = with_controller("q3 = J3 + J2", limits_deg=limits)
    q = from_deg(robot, [[0, 30, 40, 0, 0, 0]], "[plan] start_deg", single=True)
    assert_allclose(np.degrees(q[0, :3]), [0, 30, 70], atol=1e-13)
    with pytest.raises(InputError, match=r"joint 3 of the controller is -60 deg; its limits are"):
        from_deg(robot, [[0, 30, -60, 0, 0, 0]], "x")
    with pytest.raises(InputError, match=r"joint 3 of the arm is 215 deg; its limits are"):
        from_deg(robot, [[0, 110, 105, 0, 0, 0]], "x")
    path = program(tmp_path, "m", robot.controller.of_arm(Q))
    assert_allclose(read_joints(robot, path), Q, atol=1e-14)


def test_a_table_beyond_a_limit_says_whose(tmp_path):
    data = made()
    table = counted(FANUC, in_radians(data))
    third = np.degrees(table["q3_rad"])
    low, high = float(third.min()) - 1, float(third.max()) - 1
    robot = with_controller("q3 = J3 + J2", limits_deg={"J3": (low, high)})
    found = session(tmp_path, table, robot)
    assert any("J3 of the controller's limits are" in text for text in found.warnings)
    with pytest.raises(InputError, match=r"q3, as the arm turns, is .* there") as caught:
        session(tmp_path, in_radians(data) | {"q3_rad": table["q3_rad"] + 4.0}, FANUC)
    assert caught.value.code == "M20"
    table = columns(replace_q(data, FANUC.controller.of_arm(data.q)))
    with pytest.raises(InputError, match=r"check the robot and its \[controller\]"):
        session(tmp_path, table | {"q3_deg": table["q3_deg"] + 150.0}, FANUC)


def test_the_box_of_an_arm_is_of_what_its_controller_lets_it_reach():
    """As with limits of the arm: of 2000 postures a third are left, of whose tenth 12 mm is one sd.

    Five sd; without any limit the box is 200 mm narrower.
    """
    limits = ROBOT.limits.copy()
    limits[2] = np.radians([0, 90])
    own = workspace_of_reach(with_controller("J3 = q3", limits_deg={"J3": (0.0, 90.0)}))
    other = workspace_of_reach(replace(ROBOT, limits=limits))
    for one, two in ((own.box_center_mm, other.box_center_mm),
                     (own.box_size_mm, other.box_size_mm)):  # fmt: skip
        np.testing.assert_allclose(one, two, rtol=0, atol=60.0)
    assert own.box_size_mm[0] > workspace_of_reach(ROBOT).box_size_mm[0] + 120.0


def test_a_written_robot_keeps_its_controller_and_says_which_file_has_it(tmp_path):
    told = write_robot_folder(replace(FANUC, visuals=()), tmp_path / "out")
    assert told[-1].endswith("those of its controller (q3 = J3 + J2) are in robot.toml alone")
    read = load_robot(tmp_path / "out")
    J = made().q
    assert_array_equal(read.controller.to_arm(J), FANUC.controller.to_arm(J))
    joined = load_robot(tmp_path / "out" / "staubli_tx60.urdf")
    assert joined.controller.plain
    # the arm is the same: sixteen digits are written
    assert_allclose(joined.model.poses(J), read.model.poses(J), rtol=0, atol=1e-12)


def test_a_held_slide_beyond_its_limit_is_told_in_mm_beside_the_turn_that_moves_it(tmp_path):
    chain = ROBOT.model.chain
    slides = replace(chain, kinds=(*chain.kinds[:5], "prismatic"))
    limits = np.vstack([WIDE.limits[:5], [-0.1, 0.1]])
    own = replace(ROBOT, model=replace(ROBOT.model, chain=slides), limits=limits)
    robot = with_controller("q6 = 0.5 mm/deg J5", robot=own)
    table = columns(made())
    del table["q6_deg"]
    table["q5_deg"] = np.array([*table["q5_deg"][:-1] / 2, 210.0])
    (text,) = session(tmp_path, table, robot).warnings
    assert text.endswith(
        'q5_deg = "210"; q6, as the arm moves, is 105 mm there, and its limits are -100 to 100 mm'
    )


@pytest.mark.parametrize(
    ("truly", "stated", "proposed"),
    [
        (["q3 = J3 + J2"], [], 'write joints = ["q3 = J3 + J2"] under [controller] in its robot'),
        (["q3 = J3 - J2"], ["q3 = J3 + J2"], 'write "q3 = J3 - J2" for "q3 = J3 + J2" under'),
        (["q2 = -J2", "q6 = J6 + J5"], ["q2 = -J2"], 'add "q6 = J6 + J5" to joints under'),
    ],
)
def test_what_is_proposed_for_the_robot_file_makes_its_table_pass(
    tmp_path, truly, stated, proposed
):
    right, wrong = (
        with_controller(*each, robot=WIDE) if each else WIDE for each in (truly, stated)
    )
    table = with_spread(counted(right, in_radians(made(m=10))))
    with pytest.raises(InputError) as caught:
        probe(wrong, session(tmp_path, table, wrong)).raise_if_wrong()
    assert caught.value.code == "M20"
    assert proposed in caught.value.fix
    assert left(right, session(tmp_path, table, right)) < 1.0e-3


def left(robot, read):
    """What base and tool leave [m]: no other reading is five times better than so little."""
    return misfit_of(robot.model, as_read(read, np.arange(len(read.measurements)))).position


@pytest.mark.parametrize(
    "truly",
    [["q5 = J5 + 1/50 J4"], ["q5 = J5 - 0.13 J4", "q6 = J6 - 0.03 J5 + 0.01 J4"]],
    ids=["one", "several"],
)
def test_ratios_of_gears_are_found_from_a_table_that_does_not_know_them(tmp_path, truly):
    right = with_controller(*truly, robot=WIDE)
    table = with_spread(counted(right, in_radians(made(m=14))))
    with pytest.raises(InputError, match="with the ratio") as caught:
        probe(WIDE, session(tmp_path, table, WIDE)).raise_if_wrong()
    lines = re.findall(r'"(q[^"]*)"', caught.value.fix)
    found = with_controller(*lines, robot=WIDE)
    assert found.controller.stated == right.controller.stated
    # joints are 0.04 deg off on a range of 5 rad, as the readings of 14 poses show them
    assert np.abs(found.controller.matrix - right.controller.matrix).max() < 1e-3
    assert left(found, session(tmp_path, table, found)) < 1.5e-3


@pytest.mark.parametrize("last", [False, True], ids=["slide before turn", "turn before slide"])
@pytest.mark.parametrize("pitch_mm", [20.0, -16.0])
def test_a_spindle_that_rises_as_it_turns_is_found(tmp_path, pitch_mm, last):
    """The quill of a SCARA on a screw and a spline: what J4 turns also moves it."""
    slide, turn = (3, 2) if last else (2, 3)
    kinds = ["revolute"] * 4
    kinds[slide] = "prismatic"
    links = np.zeros((4, 5))
    links[0, 1:3], links[1, 2:4] = [0.35, 0.2], [0.3, np.pi]  # d and a; a and alpha
    chain = Chain(links, tuple(kinds))
    limits = np.tile([-3.0, 3.0], (4, 1))
    robot = replace(ROBOT, model=RobotModel(chain), limits=limits)
    rng = np.random.default_rng(3)
    q = rng.uniform(-2.2, 2.2, (20, 4))
    q[:, slide] = rng.uniform(0, 0.15, 20)
    real = RobotModel(chain.moved(2e-4 * rng.normal(size=chain.n_numbers)))
    point = (real.poses(q) @ [0.04, 0.02, 0.05, 1.0])[:, :3]
    J = q.copy()
    J[:, slide] -= 1e-3 * pitch_mm * q[:, turn] / (2 * np.pi)
    read = Interpretation(J, point, None)
    stated = misfit_of(robot.model, read)
    found = min(ratios_that_fit(robot, read, stated), key=lambda one: one[1].score)
    assert found[1].score < 0.2 * stated.score
    assert "mm/deg" in found[0].condition
    (line,) = re.findall(r'"(q[^"]*)"', found[0].fix)
    table = ControllerTable(joints=(line,)).controller(chain.kinds)
    # its robot is 0.2 mm and 2e-4 rad off: a few of these on 4 rad of J4
    assert np.abs(table.to_arm(J) - q).max() < 1.5e-3
    assert_allclose(table.to_arm(J), found[0].q, atol=1e-12)


def test_a_joint_that_its_limits_show_to_be_counted_the_other_way_is_named(tmp_path):
    """As the slide of a gantry or the elbow of seven axes, whose range is on one side of zero."""
    limits = WIDE.limits.copy()
    limits[2] = np.radians([-170, 0])
    robot = replace(ROBOT, limits=limits)
    data = made(robot=replace(robot, name="one_sided"))
    assert data.q[:, 2].max() < 0
    table = with_spread(in_radians(data))
    session(tmp_path, table, robot)
    turned = table | {"q3_rad": -table["q3_rad"]}
    with pytest.raises(InputError, match="lie outside the limits") as caught:
        session(tmp_path, turned, robot)
    assert 'if q3 is counted the other way, write joints = ["q3 = -J3"]' in caught.value.fix
    # which is as good as it says
    told = with_controller("q3 = -J3", robot=robot)
    assert_allclose(session(tmp_path, turned, told).measurements.q, data.q, atol=1e-12)
    # a column of other numbers fits neither way
    with pytest.raises(InputError) as caught:
        session(tmp_path, table | {"q3_rad": 2.0 + table["q3_rad"]}, robot)
    assert "the other way" not in caught.value.fix


def test_a_table_without_the_column_of_one_joint_may_be_of_an_arm_whose_rods_hold_it(tmp_path):
    table = with_spread(columns(made()))
    del table["q4_deg"]
    with pytest.raises(InputError, match=r"under \[controller\]: joints = \[\"q4 = ") as caught:
        session(tmp_path, table, ROBOT)
    assert caught.value.code == "M35"
    del table["q5_deg"]
    with pytest.raises(InputError, match="no column for 2") as caught:
        session(tmp_path, table, ROBOT)
    assert "rods" not in caught.value.fix


def test_counts_of_encoders_are_no_joints(tmp_path):
    table = with_spread(columns(made()))
    table |= {f"q{k}_deg": 40_000 * table[f"q{k}_deg"] for k in (1, 2)}
    with pytest.raises(InputError, match="implausible numbers") as caught:
        session(tmp_path, table, ROBOT)
    assert caught.value.fix == "check the unit of q1_deg; counts of an encoder are no angles"

"""Distances that show no frame, beside positions that are held out, from files to tables."""

import csv
import re

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.read import read_session
from testbed.identify.calibrate import calibrate
from testbed.identify.decisions import decision_words
from testbed.identify.handback.delivered import Delivered
from testbed.identify.statements import statements_of
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import UNSHOWN, mark, verdict
from tests.calibrated import robot, true_model
from tests.command import call
from tests.reference import pool_r

ANCHORS = np.array([[3.0, 0.5, -0.3], [2.0, -3.0, 0.4], [3.5, -2.5, 1.2], [0.2, 0.3, 1.5]])
NOISE = 10e-6
USED = 40


def written(folder, held_out, *, read=(), bump=0.0, ranged=(), unseen=None):
    """A session: distances of `USED` poses, and positions of those held out, at known joints.

    `read`: further poses that positions identify; `ranged`: anchors from which held-out poses have
    distances; `unseen`: those from which no other has; `bump`: of joint 2 of held-out poses [deg].
    """
    rng, m = np.random.default_rng(1), USED + held_out
    q = pool_r(m)
    true = q + np.radians(bump) * np.outer(np.arange(m) >= USED, np.eye(6)[1])
    p = true_model().poses(true)[:, :3, 3]
    joints = [("pose_id", *(f"q{j + 1}_deg" for j in range(6)))]
    joints += [(f"P{k}", *(f"{x:.9f}" for x in np.degrees(q[k]))) for k in range(m)]
    far, seen = [("pose_id", "anchor", "distance_mm", "split")], [
        ("pose_id", "x_mm", "y_mm", "z_mm", "split")
    ]  # fmt: skip
    for k in range(m):
        split = "test" if k >= USED else "identify"
        own = range(4) if unseen is None or k < unseen else range(3)
        for a in ranged if k >= USED else own:
            d = np.linalg.norm(p[k] - ANCHORS[a]) + rng.normal() * NOISE
            far.append((f"P{k}", f"A{a}", f"{1e3 * d:.6f}", split))
        if k in read or (k >= USED and not ranged):
            xyz = 1e3 * (p[k] + rng.normal(size=3) * NOISE)
            seen.append((f"P{k}", *(f"{x:.6f}" for x in xyz), split))
    free = ", ".join(f'A{a} = "free"' for a in range(4))
    parts = ['[joints]\nfile = "j.csv"', '[ranges]\nfile = "d.csv"',
             f"anchors_mm = {{ {free} }}",
             '[points]\nfile = "p.csv"' * (len(seen) > 1),
             "[uncertainty]\ndistance_um = 10\nposition_um = 10",
             '[tolerance]\nposition_um = 100\nrule = "guarded"',
             '[identification]\nmodel = "geometric"']  # fmt: skip
    for name, rows in (("j", joints), ("d", far), ("p", seen)):
        (folder / f"{name}.csv").write_text("\n".join(map(",".join, rows)))
    (folder / "session.toml").write_text("\n".join(parts))
    return folder


def calibrated(folder, *args, **more):
    return calibrate(robot(), read_session(written(folder, *args, **more), robot()))


@pytest.mark.parametrize("held_out", [4, 20])
def test_held_out_positions_say_what_shows_their_frame_and_what_is_left_in_the_best(
    tmp_path, held_out
):
    """They were "off as a whole by 2.6 m", and a session of their own is refused of distances."""
    found = calibrated(tmp_path, held_out)
    said = verdict(found)
    assert "no reading identified from shows in which frame" in said
    assert found.elsewhere
    assert "off as a whole" not in said + next_step(found)
    assert "session of their own" not in said
    left = re.search(r"best they are off by ([\d.]+) um \(rms\), no more than is believed", said)
    # noise of 17 um, less what a motion of six numbers takes, and what the links have wrong
    assert 5 < float(left[1]) < 30
    assert "positions at three of the held-out poses or more, not on one line" in next_step(found)
    assert mark(found) == UNSHOWN
    assert found.proof.held_out is found.proof.conformal is found.proof.discrepancy is None
    assert not found.refuted
    assert "would guard it" not in found.proof.trust.sentence
    assert "stand in no frame that is shown" in statements_of(found)[0].use
    (decided,) = decision_words(found, Delivered((), (), 0))
    assert decided.endswith("UNDECIDED: the readings do not show where the robot stands.")


def test_the_advice_can_be_followed(tmp_path):
    found = calibrated(tmp_path, 20, read=(1, 2, 3))
    assert found.proof.belief.n_guards == 20
    assert not found.relative
    assert found.fit.test.position.mean < 1e-4


def test_one_held_out_position_is_said_to_show_nothing(tmp_path):
    said = verdict(calibrated(tmp_path, 1))
    assert "no reading identified from shows in which frame" in said
    assert "in the frame that fits them best" not in said


def test_a_joint_that_changed_before_the_held_out_poses_is_seen_in_the_best_frame(tmp_path):
    said = verdict(calibrated(tmp_path, 20, bump=0.2))
    left = re.search(r"off by ([\d.]+) mm \(rms\), more than is believed", said)
    assert float(left[1]) > 0.1


@pytest.mark.parametrize("others", [0, 2], ids=["none", "two"])
def test_a_point_of_unknown_place_that_held_out_rows_alone_see_is_refused(tmp_path, others):
    """Its place was left where it began: errors of 1.2 m, and R95 of 3 m or nothing believed."""
    folder = written(tmp_path, 20, ranged=range(4), unseen=others)
    with pytest.raises(InputError) as refused:
        calibrate(robot(), read_session(folder, robot()))
    assert str(refused.value).startswith(
        f'{folder}/session.toml: the place of the anchor "A3" is to be found, and of '
        f"{20 + others} poses with a distance from it {others} identify; it takes 3; "
    )


def test_tables_say_which_radii_are_of_tool_points_to_each_other(tmp_path):
    """Their numbers looked like radii in the base."""
    with_tool = '\n[tool_in_use]\nname = "gripper"\npoint_mm = [0, 0, 150]\nposition_um = 100\n'
    program = "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nT1,10,20,60,10,50,0\n"
    for name, read, told in (("none", (), "yes"), ("three", (1, 2, 3), "no")):
        folder = tmp_path / name
        folder.mkdir()
        written(folder, 19, read=read, ranged=range(4))
        with (folder / "session.toml").open("a") as file:
            file.write(with_tool)
        (folder / "p_program.csv").write_text(program)
        out = folder / "out"
        said = call("identify", "staubli_tx60", folder / "session.toml", "--out", out, "--quiet",
                    "--program", folder / "p_program.csv")  # fmt: skip
        assert said.exit_code == 0, said.output
        for table in ("split", "tool_in_use", "p_program_statement"):
            with (out / f"{table}.csv").open() as file:
                rows = list(csv.DictReader(file))
            radius = next(key for key in rows[0] if key.startswith("R95_") and "um" in key)
            cells = {row["R95_relative"] for row in rows if row[radius]}
            assert cells == {told}, table
            assert {row["R95_relative"] for row in rows if not row[radius]} <= {""}

"""Statements judged by a simulator of another kind, some through measurement files.

The figures of 200 robots a cell stand beside the bars, by kind of robot; fewer of them are judged
here against bars that hold for so few.
"""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbed.files.programs.correct import correct_program
from testbed.robots.catalog import load_robot
from tests.reference import TX60_LINKS
from tests.truth import foreign, foreign_tracker, wen2022_arm
from tests.truth.foreign import KINDS, TX60, UR5, ForeignArm, candidates, true_arm
from tests.truth.foreign_cells import NOISE, UR5_LINKS, Cell, from_files, left_by_constants, played
from tests.truth.foreign_tracker import ForeignTracker, shared_columns, write_program

pytestmark = pytest.mark.truth
FEW = 16


@pytest.mark.parametrize("module", [foreign, foreign_tracker])
def test_the_judge_knows_nothing_of_the_project(module):
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    found = {
        name.name if isinstance(node, ast.Import) else node.module
        for node in ast.walk(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in node.names
    }
    assert found <= {"dataclasses", "functools", "numpy", "tests.truth.foreign"}


@pytest.mark.parametrize(("body", "links"), [(TX60, TX60_LINKS), (UR5, UR5_LINKS)])
def test_its_kinematics_are_those_of_the_links(body, links):
    q = candidates(np.random.default_rng(1), 200, body)
    arm = ForeignArm(body)
    p, R = arm.poses(q)
    frame_p, frame_R = wen2022_arm.forward(links, q)
    home = wen2022_arm.forward(links, np.zeros((1, 6)))[1][0]
    # two dozen products of numbers below one: some 1e-15
    np.testing.assert_allclose(R @ home, frame_R, atol=5e-15)
    np.testing.assert_allclose(p, frame_p + R @ arm.tool, atol=5e-15)


@pytest.mark.parametrize("body", [TX60, UR5])
def test_its_torques_are_slopes_of_the_potential_energy(body):
    rng = np.random.default_rng(2)
    arm = true_arm(rng, payload=2.0, body=body)
    q, step, still = candidates(rng, 20, body), 1e-5, np.zeros((20, 6, 3))

    def energy(q):
        """Potential energy (m,) of all masses [J]."""
        T = arm._frames(q, still)[1]
        centers = [*body.centers, body.flange + arm.tool]
        heights = [(T[:, k] @ np.append(c, 1.0))[:, 2] for k, c in enumerate(centers)]
        return 9.81 * np.stack(heights, axis=1) @ np.append(body.masses, arm.payload)

    torque = arm._moments(q, still)[0]
    for i in range(6):
        e = step * np.eye(6)[i]
        slope = (energy(q + e) - energy(q - e)) / (2 * step)
        # central differences: truncation 1e-10 of 100 J, rounding 1e-14 * 100 J / 1e-5
        np.testing.assert_allclose(-slope, torque[:, i], atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_its_misfits_have_the_size_that_was_asked_for(kind):
    arm = true_arm(np.random.default_rng(3), kind, 5e-6)
    plain = ForeignArm(**{**vars(arm), "wrong": np.zeros((8, 6))})
    q = candidates(np.random.default_rng(4), 300)
    # the rms of one robot's misfit scatters by some 4 % over 200 poses, 3 % over 300: 3 sd
    assert foreign.unheld(plain, q) == pytest.approx(5e-6, rel=0.15)


def test_its_noise_has_the_stated_size_whether_it_remembers_or_not():
    arm, q = ForeignArm(), candidates(np.random.default_rng(6), 1000)
    for memory, rel in ((0.0, 0.05), (15.0, 0.25)):
        tracker = ForeignTracker(memory=memory)
        p, R = arm.poses(q)
        e = tracker._noise(len(q), np.random.default_rng(7))
        # rms of 3000 numbers, or of some 100 independent ones: three sd
        assert e.std() == pytest.approx(1.0, rel=rel)
        follows = (e[:-1] * e[1:]).mean()
        assert follows == pytest.approx(np.exp(-1 / memory) if memory else 0.0, abs=0.1 + rel)
        seen, turned = tracker.shown(p, R)
        frame = tracker.frame
        np.testing.assert_allclose(seen @ frame[:3, :3].T + frame[:3, 3], p, atol=1e-14)
        np.testing.assert_allclose(frame[:3, :3] @ turned, R, atol=1e-14)


def error_of_mean(shares):
    """Standard error of the mean share; robots are the unit."""
    return shares.std(ddof=1) / np.sqrt(len(shares))


def judged(cell, robots):
    """Shares of the robots of a cell that have a believed region, and all figures."""
    found = played(cell, robots)
    return found.believed[np.isfinite(found.believed)], found


def test_rigid_arms_lie_in_the_believed_region_and_parameters_alone_hold_them():
    """Noise stated alike in all directions, which lies across the beam: alone they hold 94 %."""
    believed, found = judged(Cell(), FEW)
    assert abs(found.alone.mean() - 0.94) < 3 * error_of_mean(found.alone)
    assert believed.mean() >= 0.95
    assert found.move.mean() >= 0.95


def test_the_believed_region_holds_what_hides_behind_the_noise():
    """With a misfit below the noise, parameters alone hold half of the points."""
    believed, found = judged(Cell("slight"), 2 * len(KINDS))
    assert found.alone.mean() < 0.75
    assert believed.mean() >= 0.95
    assert found.move.mean() >= 0.95
    # a test for a misfit with an error of 1 % may see the largest of these
    assert np.mean(found.seen < 0.01) < 0.5


def test_a_model_that_the_readings_choose_keeps_the_promise():
    """Sag and slow waves are found, fast ones stay: of the noise's size, a third of the variance.

    A prior that widened with the noise took them for noise, and held 78 %.
    """
    believed, found = judged(Cell("mixture", 1.0, 60, 40, chosen=True), 5)
    assert found.alone.mean() < 0.7
    assert believed.mean() >= 0.95


def test_what_all_readings_share_is_in_the_region_where_it_is_stated():
    """Through files: constants drawn from the stated sd, the same in both sets."""
    believed, found = judged(Cell(constants=True, through_files=True), FEW // 4)
    assert found.alone.mean() < 0.6
    assert believed.mean() >= 0.95


def test_what_constants_leave_is_what_finite_differences_of_the_tracker_say():
    rng = np.random.default_rng(12)
    arm, tracker, q = true_arm(rng), ForeignTracker(), candidates(rng, 60)
    found = from_files(arm, tracker, rng, q[:40], q[40:], constants=True)
    fit, train = found.fit.identification, found.measurements.rows(found.is_used)
    turned = np.kron(np.eye(2), tracker.frame[:3, :3].T)  # to the axes of the station
    own = left_by_constants(fit, train, turned @ shared_columns(tracker, arm, train.q))
    sd = np.sqrt(np.diag(own))
    # steps of a hundredth of a constant, of poses that noise and calibration move by 1e-5 of a turn
    np.testing.assert_allclose(
        found.shared.covariance / np.outer(sd, sd).clip(1e-30), own / np.outer(sd, sd).clip(1e-30),
        atol=2e-3,
    )  # fmt: skip


@pytest.mark.parametrize(
    "cell",
    [Cell("mixture", 4.0), Cell("sag", 2.0, 60, 40, "low"), Cell("mixture", 0.5, off_axis=0.04)],
    ids=["large", "used above where it was measured", "one reflector of a UR5"],
)
def test_the_believed_region_holds_elsewhere_too(cell):
    believed, found = judged(cell, 6)
    assert found.alone.mean() < 0.85
    assert believed.mean() >= 0.95


def test_noise_that_remembers_is_seen_and_in_the_region():
    """Of 16 robots at least 10 are seen where 80 % are: the binomial tail below is under 3 %."""
    believed, found = judged(Cell(train=40, memory=15.0), FEW)
    assert (found.remembers < 0.05).sum() >= 10
    assert found.alone.mean() < 0.85
    assert believed.mean() >= 0.90


def test_a_load_that_no_row_carried_has_no_region_and_would_miss_it(tmp_path):
    """The kinematics do not see a load: what a row says of it does."""
    rng = np.random.default_rng(11)
    arm = true_arm(rng, "bearings", 2 * NOISE)
    tracker, q = ForeignTracker(), candidates(rng, 40 + 20 + 25)
    found = from_files(arm, tracker, rng, q[:40], q[40:60])
    frame, tx60 = tracker.frame, load_robot("staubli_tx60")
    for load, words, low, high in ((0.0, "as measured", 0.9, 1.0), (9.0, "other payload", 0, 0.6)):
        program = write_program(tmp_path, q[60:], load)
        out = tmp_path / f"{load}.csv"
        told = correct_program(
            program, tx60, found.fit.identification.model, out, measured=found.conditions
        )
        assert set(told.conditions) == {words}
        p = (replace(arm, payload=load).poses(q[60:])[0] - frame[:3, 3]) @ frame[:3, :3]
        assert low <= found.proof.belief.regions(q[60:]).holds(p).mean() <= high

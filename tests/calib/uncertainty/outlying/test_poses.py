"""Held-out poses that stand out: named, not explained, and nothing else is blamed for them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.measurement.prediction import predict, predicted_positions
from calib.uncertainty.frames.rigid import rest_of
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.outlying.poses import Strays, strays_beside, strays_of
from calib.uncertainty.statement.believe import believe
from tests.calib import kinds
from tests.calib.uncertainty.frames.test_other_frame import shifted
from tests.calib.uncertainty.statement.test_belief import TX60, campaign

BLAMED = "joints, payload or the model changed"


def hit(table, rng, count, size=1e-3):
    """The table with some shots off by `size` [m] in any direction, and the poses of these."""
    rows = rng.choice(len(table), count, replace=False)
    away = rng.normal(size=(count, 3))
    seen = table.position.copy()
    seen[rows] += size * away / np.linalg.norm(away, axis=1, keepdims=True)
    return replace(table, position=seen), set(table.pose_id[rows].tolist())


@pytest.mark.parametrize(("m", "n", "count"), [(130, 20, 1), (130, 20, 3), (60, 100, 5)])
@pytest.mark.parametrize("misfit", [0.0, 15e-6])
def test_wrong_shots_are_named_and_no_change_of_the_robot_is_claimed(m, n, count, misfit):
    """The motion of a frame explains 1 to 5 % of these errors, and a change was claimed for it."""
    rng = np.random.default_rng([0, n, m, 77])
    _, fit, train, held_out = campaign(rng, misfit, m=m, n=n)
    shot, wrong = hit(held_out, rng, count)
    found = judge(fit, shot, train=train)
    assert set(found.strays.poses.tolist()) == wrong
    assert not found.frame.found
    assert not found.frame.in_part
    assert found.frame.n_poses == found.strays.n_others == n - count
    first, *others = found.trust.sentences
    assert first == f"H{found.strays.sentence[1:]}"
    assert f"the other {n - count} agree with the calibration" in first
    assert BLAMED not in found.trust.sentence
    assert not any("frame" in text or "motion" in text for text in others)
    # the errors, sorted by another way
    far = np.sort(np.linalg.norm(shot.position - fit.model.poses(shot.q)[:, :3, 3], axis=1))
    assert found.strays.largest == pytest.approx(far[-1], rel=1e-9)
    assert found.strays.usual == pytest.approx(np.median(far[:-count]), rel=1e-9)
    # they are evidence all the same
    assert found.belief.n_guards == n
    assert f"held-out poses ({count} that stand" in found.trust.sentence
    assert found.tails is None


def test_nothing_stands_out_where_nothing_is_wrong_or_everything():
    rng = np.random.default_rng(3)
    true, fit, train, held_out = campaign(rng, 15e-6, m=60)
    assert judge(fit, held_out, train=train).strays is None
    # a payload that lets the arm sag by half a millimetre at all of them
    sag = np.zeros(len(true.joint_errors.terms))
    sag[: len(gravity_terms(6))] = np.radians(0.03)
    loaded = RobotModel(
        true.chain, JointErrors(true.joint_errors.terms, true.joint_errors.coefficients + sag)
    )
    seen = replace(kinds.poses(loaded, held_out.q, rng), pose_id=held_out.pose_id)
    found = judge(fit, seen, train=train)
    assert found.strays is None
    assert found.frame.in_part
    assert found.trust.sentences[0].endswith(BLAMED)
    # of a quarter of the poses nobody can say that the others are the rule
    many, _ = hit(held_out, rng, 5)
    assert judge(fit, many, train=train).strays is None


@pytest.mark.parametrize("louder", [0.0, 1.5])
def test_one_stands_out_only_where_the_others_agree(louder):
    """Noise of 1.8 times what is stated at all held-out poses: chi-square of 19 is three times."""
    rng = np.random.default_rng([1, 20, 130, 77])
    _, fit, train, held_out = campaign(rng, 0.0, m=130)
    shot, _ = hit(held_out, rng, 1)
    away = louder * kinds.NOISE * rng.normal(size=(20, 3))
    shot = replace(shot, position=shot.position + away)
    assert (judge(fit, shot, train=train).strays is None) == (louder > 0)


def test_a_visit_in_another_frame_does_not_stand_out_pose_by_pose():
    """Six of 40 held-out poses are of a second visit, half a millimetre away."""
    rng = np.random.default_rng(46)
    _, _, train, held_out = campaign(rng, 0.0, m=60, n=40)
    visited = replace(TX60, fixtures=Fixtures(stations=np.tile(np.eye(4), (1, 1, 1))))
    fit = identify(visited, train, parameters_of(visited, TX60.names))
    second = np.arange(40) >= 34
    moved = held_out.position + second[:, None] * [5e-4, 0.0, 0.0]
    seen = replace(held_out, position=moved, station=second.astype(np.int64))
    known = Circumstances(stations_are_visits=True)
    found = judge(fit, seen, train=train, circumstances=known)
    assert found.strays is None
    assert found.frame.found
    assert found.frame.station == 1
    # a wrong shot stands out, whichever visit it is of
    calm = replace(seen, position=held_out.position)
    shot, wrong = hit(calm, rng, 1)
    assert set(judge(fit, shot, train=train, circumstances=known).strays.poses.tolist()) == wrong


def test_a_base_that_moved_is_found_beside_a_wrong_shot():
    """By 0.3 mm, and one shot by 1 mm more, which hid it: rows of both were called a change."""
    rng = np.random.default_rng(5)
    _, fit, train, held_out = campaign(rng, 0.0, m=60)
    away = np.array([2e-4, -1e-4, 2e-4])
    shot, wrong = hit(shifted(held_out, away), rng, 1)
    found = judge(fit, shot, train=train)
    assert found.frame.found
    # noise of 20 um an axis over 19 poses, and the fit's own of some 10 um
    np.testing.assert_allclose(found.frame.shift, away, atol=4e-5)
    assert set(found.strays.poses.tolist()) == wrong
    assert found.strays.moved
    assert found.strays.largest == pytest.approx(1e-3, abs=2e-4)
    first, second = found.trust.sentences[:2]
    assert "they prove nothing" in first
    assert second.startswith(
        f"Held-out pose {wrong.pop()} stands out beside that motion: its error"
    )
    assert "counts in every figure" not in second
    assert found.belief.n_guards == 0


def test_a_motion_that_is_found_after_a_stray_is_not_in_its_error():
    """Errors beside a motion do not depend on it, whether it hides the stray or not."""
    largest = []
    for step in (2e-5, 4e-5):
        rng = np.random.default_rng(2)
        _, fit, train, held_out = campaign(rng, 0.0, m=60, n=40)
        shot, _ = hit(shifted(held_out, step * np.array([1.0, -1.0, 1.0])), rng, 1, size=3e-4)
        found = judge(fit, shot, train=train)
        assert found.frame.found
        assert found.strays.moved
        largest.append(found.strays.largest)
    # both fits of the motion agree to rounding; the shift alone is 35 um
    assert largest[0] == pytest.approx(largest[1], abs=1e-7)


def test_the_others_agree_by_the_whole_covariance_written_out():
    rng = np.random.default_rng(6)
    _, fit, train, held_out = campaign(rng, 15e-6)
    alone = believe(fit, train)
    shot, wrong = hit(held_out, rng, 2)
    found = strays_of(alone, shot, fit, train)
    assert set(found.poses.tolist()) == wrong
    rest = shot.rows(~np.isin(shot.pose_id, found.poses))
    rows = predict(alone.model, rest).rows[:, :3]
    growth = np.maximum(alone.proven.applies(shot.q).growth, 1.0).mean()
    G, own = rows.reshape(3 * len(rest), -1), alone.misfit.shape.rows(rows)
    V = alone.misfit.upper**2 * growth * (G @ alone.misfit_covariance @ G.T)
    V += G @ alone.covariance @ G.T
    for k, N in enumerate(rest.covariance[:, :3, :3]):
        part = slice(3 * k, 3 * k + 3)
        V[part, part] += alone.misfit.upper**2 * growth * (own[k] @ own[k].T) + N
    e = (rest.position - predicted_positions(fit.model, rest)).ravel()
    # the estimate follows every motion to what the model bends: 1e-5 of the chance
    assert found.p_others == pytest.approx(chi2.sf(e @ np.linalg.solve(V, e), e.size), rel=1e-5)


def test_only_rows_that_are_used_tell_the_motion():
    """Of eight poses one is a meter off: the motion of the others is exact, to rounding."""
    rng = np.random.default_rng(2)
    p, R = rng.normal(size=(8, 3)), np.tile(np.eye(3), (8, 1, 1))
    seen = p + np.array([0.1, 0.0, -0.2])
    seen[3, 0] += 1.0
    used = np.arange(8) != 3
    left = rest_of(seen, p, R, station=True, target=False, used=used)
    assert np.abs(left[used]).max() < 2e-8  # the nudge of degenerate turns
    np.testing.assert_allclose(left[3], [1.0, 0.0, 0.0], atol=1e-7)
    assert np.abs(rest_of(seen, p, R, station=True, target=False)[used]).max() > 0.05


def test_few_poses_and_training_rows_that_bound_nothing_name_no_stray():
    rng = np.random.default_rng(4)
    _, fit, train, held_out = campaign(rng, 0.0, n=6)
    shot, _ = hit(held_out, rng, 1)
    alone = believe(fit, train)
    assert judge(fit, shot, train=train).strays is None
    assert strays_beside(alone, shot, fit, train, station=True, target=False) is None
    blind = replace(alone, misfit=replace(alone.misfit, upper=np.inf))
    assert strays_of(blind, shot, fit, train) is None


def test_poses_are_called_by_their_names_where_they_have_some():
    rng = np.random.default_rng([0, 20, 130, 77])
    _, fit, train, held_out = campaign(rng, 0.0, m=130)
    shot, wrong = hit(held_out, rng, 1)
    names = tuple(f"P{k + 1}" for k in range(150))
    known = Circumstances(pose_names=names)
    said = judge(fit, shot, train=train, circumstances=known).trust.sentences[0]
    assert said.startswith(f"Held-out pose P{wrong.pop() + 1} stands out: ")
    with pytest.raises(InputError, match="pose_names are 149, and held-out poses have numbers"):
        judge(fit, shot, train=train, circumstances=Circumstances(pose_names=names[:149]))


def test_the_sentence_names_ten_poses_at_most_and_agrees_in_number():
    found = Strays(np.arange(12), 1.04e-3, 29e-6, 88, 0.4)
    assert repr(found) == "Strays(12 of 100 held-out poses)"
    assert found.counted_words == "12 that stand out"
    assert found.sentence == (
        "held-out poses 0, 1, 2, 3, 4, 5, 6, 7, 8, 9 and 2 more stand out: their errors are up to "
        "1.04 mm, where 29 um is usual, and the other 88 agree with the calibration; either their "
        "readings are wrong, or the model fails there: measure these poses again; they count in "
        "every figure"
    )
    one = replace(found, poses=np.array([7]), largest=151e-6, n_others=19)
    assert one.counted_words == "1 that stands out"
    assert one.said_of(["P8"]) == (
        "held-out pose P8 stands out: its error is 151 um, where 29 um is usual, and the other 19 "
        "agree with the calibration; either its reading is wrong, or the model fails there: "
        "measure this pose again; it counts in every figure"
    )

"""What a rigid motion leaves of held-out errors decides whether it is another frame."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from calib.measurement.prediction import predict, predicted_positions
from calib.uncertainty.frames.other_frame import after_the_motion, other_frame
from calib.uncertainty.frames.rigid import rest_of, rms_length
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.believe import believe
from tests.calib import kinds
from tests.calib.uncertainty.frames.test_other_frame import shifted
from tests.calib.uncertainty.statement.test_belief import campaign


def bumped(true, held_out, joint, degrees, rng):
    """The same commanded poses of a robot whose joint has moved on its shaft."""
    bump = np.zeros(6)
    bump[joint - 1] = np.radians(degrees)
    seen = kinds.poses(true, held_out.q + bump, rng)
    return replace(seen, q=held_out.q, pose_id=held_out.pose_id)


def left_by_station(seen, p):
    """Errors that the best motion of the station leaves, in its axes, by another library."""
    there, here = seen - seen.mean(axis=0), p - p.mean(axis=0)
    R = Rotation.align_vectors(here, there)[0].as_matrix()
    return there @ R.T - here


@pytest.mark.parametrize(("joint", "degrees"), [(2, 0.05), (3, 0.05), (5, 0.15)])
def test_a_bumped_joint_is_no_other_frame(joint, degrees):
    """Half a millimetre or less: the rows guard the region, which grows, and are not sent away."""
    rng = np.random.default_rng([joint, 47])
    true, fit, train, held_out = campaign(rng, 0.0)
    seen = bumped(true, held_out, joint, degrees, rng)
    found = judge(fit, seen, train=train)
    assert not found.frame.found
    assert found.frame.in_part
    assert found.belief.n_guards == len(held_out)
    p = predicted_positions(fit.model, seen)
    all_of_it = rms_length(seen.position - p)
    said = found.trust.sentences[0]
    assert found.point.radius_mean > all_of_it
    assert f" of the held-out errors of {1e6 * all_of_it:.0f} um (rms), but not the rem" in said
    assert said.endswith(": joints, payload or the model changed")
    assert not any("another frame" in text for text in found.trust.sentences)
    if not found.frame.at_tool:
        rest = rms_length(left_by_station(seen.position, p))
        assert found.frame.rest == pytest.approx(rest, rel=1e-9)
        # a joint does move the base, but not only
        assert 3 * 20e-6 < rest < all_of_it


def test_the_chance_of_the_rest_is_that_of_the_whole_covariance_written_out():
    rng = np.random.default_rng(6)
    _, fit, train, held_out = campaign(rng, 15e-6)
    seen = shifted(held_out, [3e-4, 0.0, 0.0], [0.0, 0.3, 0.0])
    alone = believe(fit, train)
    asked = other_frame(believe(fit, train, seen), seen, fit, train)
    found = after_the_motion(asked, alone, seen, fit, train)
    assert found.found
    p = predicted_positions(fit.model, seen)
    rest = left_by_station(seen.position, p)
    rows = predict(alone.model, seen).rows[:, :3]
    growth = np.maximum(alone.proven.applies(seen.q).growth, 1.0).mean()
    G, own = rows.reshape(rest.size, -1), alone.misfit.shape.rows(rows)
    V = alone.misfit.upper**2 * growth * (G @ alone.misfit_covariance @ G.T)
    V += G @ alone.covariance @ G.T
    for k, N in enumerate(seen.covariance[:, :3, :3]):
        part = slice(3 * k, 3 * k + 3)
        V[part, part] += alone.misfit.upper**2 * growth * (own[k] @ own[k].T)
        V[part, part] += alone.misfit.larger_noise**2 * N
    turn = np.stack([np.cross(axis, p - p.mean(axis=0)) for axis in np.eye(3)], axis=2)
    M = np.concatenate([np.tile(np.eye(3), (len(p), 1, 1)), turn], axis=2).reshape(rest.size, 6)
    W = np.linalg.inv(V)
    left = rest.ravel() - M @ np.linalg.solve(M.T @ W @ M, M.T @ W @ rest.ravel())
    assert found.p_rest == pytest.approx(chi2.sf(left @ W @ left, rest.size - 6), rel=1e-5)
    assert found.rest == pytest.approx(rms_length(rest), rel=1e-9)


@pytest.mark.parametrize("shift", [3e-4, 0.5])
def test_station_and_target_that_both_moved_are_one_piece(shift):
    """Neither alone explains the rows; both leave the noise of 20 um an axis."""
    rng = np.random.default_rng(8)
    true, fit, train, held_out = campaign(rng, 15e-6)
    R = true.poses(held_out.q)[:, :3, :3]
    there = replace(held_out, position=held_out.position + R @ (shift * np.array([0.5, -0.3, 0.2])))
    seen = shifted(there, [shift, 0.0, -shift], [0.0, shift, 0.0])
    found = judge(fit, seen, train=train).frame
    assert found.found
    assert found.both
    assert "moved, too; they prove nothing" in found.sentence
    # the fit's own errors of some 20 um add to the noise of 35 um a point
    assert 15e-6 < found.rest < 60e-6


def test_the_best_motion_of_both_leaves_nothing_of_one():
    """Meters, and a turn of 100 deg, to what the nudge of degenerate turns costs: 4 nm."""
    rng = np.random.default_rng(9)
    R = Rotation.random(12, random_state=3).as_matrix()
    p, offset = rng.normal(size=(12, 3)), np.array([0.3, -0.2, 0.1])
    turned = Rotation.from_rotvec([1.0, 1.0, -1.0]).apply(p + R @ offset)
    left = rest_of(turned + np.array([2.0, -1.0, 0.3]), p, R, station=True, target=True)
    assert np.abs(left).max() < 2e-8
    aside = rest_of(p + R @ offset, p, R, station=False, target=True)
    assert np.abs(aside).max() < 1e-12

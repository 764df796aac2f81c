"""Another frame: false alarms, shifts that are seen, what the sentence says of a moved station."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.prior import weak_prior
from calib.measurement.observations import joined
from calib.measurement.prediction import predict, predicted_positions
from calib.uncertainty.frames.other_frame import other_frame
from calib.uncertainty.judgement import Circumstances, judge
from calib.uncertainty.statement.believe import believe
from tests.calib import kinds
from tests.calib.uncertainty.statement.test_belief import TX60, bent, campaign, visit
from tests.memory import peak_below


def shifted(table, shift, turn=(0.0, 0.0, 0.0)):
    """The table seen from a station that moved by `shift` [m] and turned by `turn` [rad]."""
    R = kinds.exp_so3(np.asarray(turn))
    return replace(table, position=table.position @ R.T + shift, rotation=R @ table.rotation)


@pytest.mark.slow
def test_false_alarms_are_rare():
    """Of 30 robots, rigid and bent, at p < .001 for the base and for the tool."""
    found = 0
    for robot in range(30):
        rng = np.random.default_rng([robot, 41])
        _, fit, train, held_out = campaign(rng, [0.0, 15e-6, 60e-6][robot % 3])
        found += other_frame(believe(fit, train, held_out), held_out, fit, train).found
    assert found <= binom.ppf(0.999, 30, 0.002)


def test_a_frame_that_was_held_fixed_and_does_not_fit_is_no_other_frame():
    """Base and tool held at nominal where they are half a millimetre off: all readings show it."""
    alarms = seen = 0
    for robot in range(6):
        rng = np.random.default_rng([robot, 44])
        true = bent(rng, 15e-6 * (robot % 2))
        away = np.zeros(true.n_numbers)
        away[[0, 2, 4]] = 5e-4, -3e-4, 1e-3
        moved = true.moved(away)
        train, held_out = visit(moved, rng, 40), visit(moved, rng, 20, first=40)
        names = [name for name in TX60.names if not name.startswith(("base", "tool"))]
        fit = identify(TX60, train, parameters_of(TX60, names))
        alarms += other_frame(believe(fit, train, held_out), held_out, fit, train).found
        again = shifted(held_out, [2e-3, 0.0, 0.0])
        seen += other_frame(believe(fit, train, again), again, fit, train).found
    assert alarms == 0
    assert seen == 6


@pytest.mark.slow
def test_twice_the_believed_radius_is_seen():
    seen = 0
    for robot in range(12):
        rng = np.random.default_rng([robot, 42])
        _, fit, train, held_out = campaign(rng, 15e-6)
        U = believe(fit, train, held_out).regions(held_out.q).mean_radius
        way = rng.normal(size=3)
        moved = shifted(held_out, 2 * U * way / np.linalg.norm(way))
        seen += other_frame(believe(fit, train, moved), moved, fit, train).found
    # bar: 99 % of robots
    assert seen >= binom.ppf(0.001, 12, 0.99)


def test_motion_is_the_one_that_was_made():
    rng = np.random.default_rng(1)
    _, fit, train, held_out = campaign(rng, 0.0)
    shift, turn = np.array([300e-6, -100e-6, 50e-6]), np.array([0.0, 1e-3, -2e-3])
    moved = shifted(held_out, shift, turn)
    found = other_frame(believe(fit, train, moved), moved, fit, train)
    assert found.found
    # noise of 20 um over 20 poses and the fit's own: within 30 um and .1 mrad
    np.testing.assert_allclose(found.turn, turn, atol=1e-4)
    middle = held_out.position.mean(axis=0)
    np.testing.assert_allclose(found.shift, np.cross(turn, middle) + shift, atol=4e-5)
    assert "another base, or the station moved" in found.sentence
    assert f"{np.degrees(np.linalg.norm(found.turn)):.3g} deg" in found.sentence
    assert "another" in repr(found)


def test_another_target_is_told_from_another_station():
    rng = np.random.default_rng(2)
    _, fit, train, held_out = campaign(rng, 0.0)
    offset = np.array([200e-6, 0.0, 100e-6])
    moved = replace(held_out, position=held_out.position + held_out.rotation @ offset)
    found = other_frame(believe(fit, train, moved), moved, fit, train)
    assert found.p_tool < found.p_base
    np.testing.assert_allclose(found.tool, offset, atol=4e-5)
    assert "another target" in found.sentence


def test_half_a_metre_is_said_in_millimetres():
    rng = np.random.default_rng(3)
    _, fit, train, held_out = campaign(rng, 0.0)
    moved = shifted(held_out, [0.6, 0.1, 0.1], [0.0, 0.0, 0.3])
    found = other_frame(believe(fit, train, moved), moved, fit, train)
    assert " mm and 17.2 deg (another base" in found.sentence
    # no derivative describes a turn of 17 deg: noise of 20 um over the poses and the fit's own
    np.testing.assert_allclose(found.turn, [0.0, 0.0, 0.3], atol=1e-4)
    went = np.sqrt(((moved.position - held_out.position) ** 2).sum(axis=1).mean())
    assert abs(found.size - went) < 4e-5


@pytest.mark.parametrize("count", [6, 20])
@pytest.mark.parametrize("tool", [False, True], ids=["station", "target"])
def test_gross_motions_are_found_with_few_poses_and_told_apart(count, tool):
    """A turn of 100 deg and meters, a target 0.6 m away: both chances may be nothing at all."""
    rng = np.random.default_rng(7)
    _, fit, train, held_out = campaign(rng, 15e-6, n=count)
    moved = shifted(held_out, [2.0, -1.0, 0.3], [1.0, 1.0, -1.0])
    if tool:
        offset = np.array([0.5, -0.3, 0.2])
        moved = replace(held_out, position=held_out.position + held_out.rotation @ offset)
    found = judge(fit, moved, train=train).frame
    assert found is not None
    assert found.found
    assert found.at_tool == tool
    angle = np.degrees(np.sqrt(3))
    assert ("616 mm" if tool else f"{angle:.3g} deg") in found.sentence


@pytest.mark.parametrize("tool", [False, True], ids=["station", "target"])
def test_one_point_whose_numbers_are_hardly_known_tells_a_moved_station_from_another_target(tool):
    """A misfit as large as the errors explains them by numbers that the rows hardly determine."""
    rng = np.random.default_rng(9)
    true = bent(rng, 60e-6)
    q = kinds.joints("tx60", rng, 60)
    table = replace(kinds.points(true, q, rng), pose_id=np.arange(60))
    train, held_out = table.rows(np.arange(40)), table.rows(np.arange(40, 60))
    fit = identify(TX60, train, parameters_of(TX60), prior=weak_prior(parameters_of(TX60)))
    turn = np.radians(17.7) * np.array([0.6, 0.0, 0.8])
    moved = held_out.position @ kinds.exp_so3(turn).T + [0.4, -0.3, 0.36]
    if tool:
        R = true.poses(held_out.q)[:, :3, :3]
        moved = held_out.position + R @ [0.4, -0.3, 0.36]
    found = judge(fit, replace(held_out, position=moved), train=train).frame
    assert found.found
    assert found.at_tool == tool
    assert ("616" if tool else "17.7 deg") in found.sentence


@pytest.mark.study
@pytest.mark.parametrize("n", [6, 20, 40])
def test_small_motions_are_found_and_false_alarms_are_rare_at_full_size(n):
    """0.05 mm and 0.01 deg about the middle of 40 poses; 300 robots, half of them bent.

    Found with 6, 20 and 40 poses: 297, 300, 300; false alarms: none.
    """
    alarms = seen = 0
    for robot in range(300):
        rng = np.random.default_rng([robot, 45, n])
        true = bent(rng, 15e-6 * (robot % 2))
        train, held_out = visit(true, rng, 60), visit(true, rng, n, first=60)
        fit = identify(TX60, train, parameters_of(TX60))
        ways = rng.normal(size=(2, 3))
        shift, turn = ways / np.linalg.norm(ways, axis=1)[:, None] * [[50e-6], [np.radians(0.01)]]
        middle = held_out.position.mean(axis=0)
        R = kinds.exp_so3(turn)
        moved = shifted(held_out, middle - R @ middle + shift, turn)
        alarms += judge(fit, held_out, train=train).frame.found
        seen += judge(fit, moved, train=train).frame.found
    print(f"\n{n} poses: {seen} of 300 found, {alarms} false alarms")  # noqa: T201  # figures of a study
    assert alarms <= binom.ppf(0.999, 300, 0.01)
    if n == 40:
        assert seen >= 0.95 * 300


def test_rows_of_one_pose_share_their_misfit():
    """Ten readings of each pose prove no frame: they show one draw of the misfit again."""
    found = 0
    for robot in range(8):
        rng = np.random.default_rng([robot, 43])
        true, fit, train, held_out = campaign(rng, 60e-6)
        again = [
            replace(
                kinds.poses(true, held_out.q, rng),
                pose_id=held_out.pose_id, repeat=np.full(len(held_out), k),
            )
            for k in range(8)
        ]  # fmt: skip
        table = joined(again)
        found += other_frame(believe(fit, train, table), table, fit, train).found
    assert found == 0


def test_too_few_poses_cannot_tell():
    rng = np.random.default_rng(4)
    _, fit, train, held_out = campaign(rng, 0.0)
    few = held_out.rows(np.arange(5))
    with pytest.raises(InputError, match="6 poses or more"):
        other_frame(believe(fit, train, few), few, fit, train)


def test_motion_and_chance_are_those_of_the_whole_covariance_written_out():
    """Two rows of each pose: they share its misfit; parameters are shared by all."""
    rng = np.random.default_rng(6)
    _, fit, train, held_out = campaign(rng, 15e-6)
    twice = joined([held_out, replace(held_out, position=held_out.position + 1e-5)])
    belief = believe(fit, train, twice)
    found = other_frame(belief, twice, fit, train)
    seen = predict(belief.model, twice)
    rows, e = seen.rows[:, :3], seen.residual[:, :3]
    size = min(belief.misfit.upper, np.sqrt((e**2).mean()))
    G, own = rows.reshape(e.size, -1), belief.misfit.shape.rows(rows).reshape(e.size, -1)
    V = G @ (belief.covariance + size**2 * belief.misfit_covariance) @ G.T
    same = np.kron(twice.pose_id[:, None] == twice.pose_id, np.ones((3, 3)))
    V += size**2 * same * (own @ own.T)
    for k, N in enumerate(twice.covariance[:, :3, :3]):
        V[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += belief.misfit.larger_noise**2 * N
    p = predicted_positions(belief.model, twice)
    about = p - p.mean(axis=0)
    turn = np.stack([np.cross(axis, about) for axis in np.eye(3)], axis=2)
    M = np.concatenate([np.tile(np.eye(3), (len(p), 1, 1)), turn], axis=2).reshape(e.size, 6)
    W = np.linalg.solve(V, np.eye(e.size))
    numbers = np.linalg.solve(M.T @ W @ M, M.T @ W @ e.ravel())
    np.testing.assert_allclose([*found.shift, *found.turn], numbers, rtol=1e-6, atol=1e-12)
    left = e.ravel() - M @ numbers
    fall = e.ravel() @ W @ e.ravel() - left @ W @ left
    assert found.p_base == pytest.approx(chi2.sf(fall, 6), rel=1e-6)


def test_a_thousand_poses_are_asked_block_by_block():
    """One block for each pose: a covariance of all would have 9 million entries, 72 MB."""
    rng = np.random.default_rng(7)
    _, fit, train, held_out = campaign(rng, 15e-6)
    many = joined([replace(held_out, pose_id=held_out.pose_id + 1000 * k) for k in range(50)])
    belief = believe(fit, train, held_out)
    with peak_below(40e6):  # 13 MB
        assert other_frame(belief, many, fit, train).n_poses == 50 * held_out.n_poses


@pytest.mark.slow
def test_a_motion_that_the_region_holds_is_no_other_frame():
    """A third of the believed radius may be more than chance: the region has it, rows go on to
    prove; three radii are another frame."""
    small = far = 0
    for robot in range(6):
        rng = np.random.default_rng([robot, 45])
        _, fit, train, held_out = campaign(rng, 5e-6, m=40, n=60)
        radius = believe(fit, train).regions(held_out.q).mean_radius
        near, away = (shifted(held_out, [k * radius, 0.0, 0.0]) for k in (0.35, 3.0))
        judged, again = judge(fit, near, train=train), judge(fit, away, train=train)
        assert not judged.frame.found
        assert judged.belief.n_guards == 60
        small += judged.frame.p_base < 1e-3
        far += again.frame.found
        assert again.belief.n_guards == 0
        assert 0 < again.frame.within < radius
    assert small > 0  # else a limit by size would prove nothing
    assert far == 6


def test_the_likeliest_of_several_visits_has_a_chance_as_of_all_of_them():
    """Three visits are three chances of a false alarm: Bonferroni."""
    rng = np.random.default_rng(46)
    _, _, train, held_out = campaign(rng, 5e-6, m=40, n=60)
    visited = replace(TX60, fixtures=Fixtures(stations=np.tile(np.eye(4), (2, 1, 1))))
    fit = identify(visited, train, parameters_of(visited, TX60.names))
    parts = [np.arange(60) % 3 == k for k in range(3)]
    near = shifted(held_out, [4e-6, 0.0, 0.0])
    near = replace(near, station=np.arange(60, dtype=np.int64) % 3)
    judged = judge(fit, near, train=train, circumstances=Circumstances(stations_are_visits=True))
    each = [other_frame(judged.belief, near.rows(part), fit, train) for part in parts]
    likeliest = min(each, key=lambda one: min(one.p_base, one.p_tool))
    assert not judged.frame.found
    assert judged.frame.station == likeliest.station
    assert 0 < min(likeliest.p_base, likeliest.p_tool) < 1 / 3
    assert judged.frame.p_base == pytest.approx(min(1.0, 3 * likeliest.p_base), rel=1e-9)
    assert judged.frame.p_tool == pytest.approx(min(1.0, 3 * likeliest.p_tool), rel=1e-9)

"""The straight line of a calibration against truth: frames from nothing, proof, honest words."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.parameters import parameters_of
from calib.identification.fit_statistics import RED
from calib.identification.identify import identify
from calib.measurement import tables
from calib.measurement.prediction import predict
from calib.measurement.residual import linearize
from calib.uncertainty.trust import trust
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.fit import scatter_covariance
from testbed.robots.tolerances import usual_tolerances
from tests.calibrated import real, robot, session_of, sound, sound_session, table_of, true_model
from tests.reference import SIGMA_POSITION, pool_r


def test_a_robot_meters_away_is_found_to_the_noise_of_the_tracker():
    found = sound()
    model = found.fit.identification.model
    q = pool_r(200, seed=99)
    missed = np.linalg.norm(model.poses(q)[:, :3, 3] - true_model().poses(q)[:, :3, 3], axis=1)
    # 53 poses, 17.5 um per axis, 30 numbers: MATH 8.4 expects 11 to 17 um, the pool is another
    assert missed.mean() < 30e-6
    assert found.before_test.position.mean > 10 * missed.mean()
    assert found.fit.identification.rank == 30
    assert found.believable
    assert not found.refuted
    assert not found.gross.left_out.any()


def test_before_is_the_best_that_nominal_links_can_do():
    found = sound()
    train = found.measurements.rows(found.is_used)
    links = robot().model.chain.links
    assert np.array_equal(found.before.chain.links, links)

    def cost(model):
        return float(np.square(linearize(model, train).r).sum())

    best = cost(found.before)
    names = found.before.names
    for frame in ("base", "tool"):
        for axis in ("x", "y", "z", "rx", "ry", "rz"):
            for sign in (1, -1):
                step = np.zeros(len(names))
                step[names.index(f"{frame}.{axis}")] = sign * 1e-5
                assert cost(found.before.moved(step)) > best


def test_held_out_rows_take_no_part_in_anything_but_the_proof():
    session = sound_session()
    one = sound()
    moved = session.measurements.position.copy()
    moved[one.split.is_test] += 1e-4
    other = calibrate(
        robot(),
        replace(session, measurements=replace(session.measurements, position=moved)),
        Options(seed=1),
    )
    pairs = (
        (one.before, other.before),
        (one.fit.identification.model, other.fit.identification.model),
    )
    for mine, theirs in pairs:
        assert np.array_equal(mine.chain.links, theirs.chain.links)
        assert np.array_equal(mine.chain.T_world_base, theirs.chain.T_world_base)
        assert np.array_equal(mine.chain.T_flange_tool, theirs.chain.T_flange_tool)
    assert np.array_equal(one.gross.left_out, other.gross.left_out)
    assert other.fit.test.position.mean > one.fit.test.position.mean


def test_the_misses_are_what_the_model_and_the_table_say():
    found = real()
    table, fit = found.measurements, found.fit
    T = fit.identification.model.poses(table.q)
    away = table.position - T[:, :3, 3]
    np.testing.assert_allclose(fit.misses.vector, away, atol=1e-15)
    cosine = (np.einsum("kij,kij->k", table.rotation, T[:, :3, :3]) - 1) / 2
    # arccos loses half the digits near zero
    np.testing.assert_allclose(fit.misses.rotation, np.arccos(np.minimum(cosine, 1)), atol=1e-7)
    test = np.linalg.norm(away[found.split.is_test], axis=1)
    assert fit.test.position.mean == pytest.approx(test.mean(), rel=1e-12)
    assert fit.test.median == pytest.approx(np.median(test), rel=1e-12)


def test_understated_noise_becomes_a_misfit_that_is_in_the_region():
    found = real()
    assert found.refuted
    assert found.believable
    assert found.fit.identification.p_value < RED
    # the extended model leaves noise only, 60 medians of it
    assert found.fit.noise_factor == pytest.approx(5.0, rel=0.15)
    # no more than noise of 17.5 um, which is stated, is left to the noise: 5 times that hides there
    assert found.proof.belief.misfit.upper > 4 * SIGMA_POSITION
    q = pool_r(300, seed=97)
    true, regions = true_model(harmonics=0.02).poses(q)[:, :3, 3], found.proof.belief.regions(q)
    assert regions.holds(true).mean() > 0.95
    test = np.sort(found.fit.misses.position[found.split.is_test])
    n = len(test)
    assert found.proof.conformal.radius == test[int(np.ceil(0.95 * (n + 1))) - 1]
    assert np.array_equal(found.covariance, found.fit.scatter)
    assert np.array_equal(sound().covariance, sound().fit.identification.covariance)


def test_scatter_between_poses_shows_the_noise_that_is_there():
    q = pool_r(300)
    table = table_of(true_model(own_frames=True), q, noise=3.0)
    nominal = robot().model
    found = identify(nominal, table, parameters_of(nominal))
    scatter = scatter_covariance(nominal, found, table, 1.0)
    ratio = np.sqrt(np.diag(scatter)) / found.standard_uncertainty
    # 300 poses leave some 5 % in each of 30 standard deviations
    assert ratio.mean() == pytest.approx(3.0, rel=0.05)
    assert np.abs(ratio / 3 - 1).max() < 0.3
    # the same, written out pose by pose
    stack = linearize(found.model, table)
    A, r = stack.A[:, found.parameters.free_index], stack.r
    H = np.linalg.solve(A.T @ A, np.eye(A.shape[1]))
    meat = sum(
        np.outer(A[6 * k : 6 * k + 6].T @ r[6 * k : 6 * k + 6],
                 A[6 * k : 6 * k + 6].T @ r[6 * k : 6 * k + 6])
        for k in range(300)
    )  # fmt: skip
    m, n, f = 300, len(r), A.shape[1]
    expected = H @ meat @ H * (m / (m - 1)) * (n / (n - f))
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(scatter / size, expected / size, atol=1e-9)


def test_frames_of_the_robot_file_stand_where_they_fit():
    session = session_of(table_of(true_model(own_frames=True), pool_r(60)))
    found = calibrate(robot(), session)
    assert found.own_frames
    assert not sound().own_frames
    # then the fit is the one of a campaign: from the nominal robot, on the same rows
    direct = identify(
        robot().model, session.measurements.rows(found.is_used), parameters_of(robot().model)
    )
    assert np.array_equal(found.fit.identification.step, direct.step)


def test_a_fixed_frame_stays_and_a_free_set_is_honored():
    session = session_of(
        table_of(true_model(own_frames=True), pool_r(60)),
        base="fixed",
        tool="fixed",
        free="wen2022",
    )
    found = calibrate(robot(), session)
    kept = set(found.fit.identification.names)
    assert kept == set(robot().free_sets["wen2022"])
    assert np.array_equal(found.before.chain.T_world_base, np.eye(4))


def test_poses_alike_are_warned_of_and_the_prior_of_the_links_holds_the_number_that_suffers():
    q = np.tile(pool_r(1), (60, 1)) + np.random.default_rng(0).normal(0, 0.02, (60, 6))
    session = session_of(table_of(true_model(), q))
    found = calibrate(robot(), session)
    assert any("the poses are too much alike (condition" in text for text in found.warnings)
    assert found.converged
    train = session.measurements.rows(found.is_used)
    fit = identify(found.before, train, parameters_of(found.before))
    u = dict(zip(fit.names, fit.standard_uncertainty, strict=True))
    widths = dict(zip(fit.parameters.names[6:36], usual_tolerances(6).ravel(), strict=True))
    worst = max(set(u) & set(widths), key=lambda name: u[name] / widths[name])
    assert f"without it, {worst} is known no better than U = " in found.handback.why


def test_joints_that_were_not_moved_are_named_first_of_all_warnings():
    q = pool_r(40).copy()
    q[:, 3] = 0.4
    found = calibrate(robot(), session_of(table_of(true_model(), q)))
    assert found.warnings[0].startswith("joint 4 moved by less than 10 deg")
    assert found.fit.identification.rank == 26
    assert sound().warnings == ()


def test_who_told_the_noise_that_is_too_large_is_said():
    """A scatter of the joints that no file states was called one that somebody stated."""
    session = session_of(table_of(true_model(), pool_r(40), noise=0.5))
    scatter, sources = np.full(6, 1e-5), {"repeatability": "assumed: 10 urad"}
    for arm, joints, said in (
        (robot(), np.zeros(6), "stated noise of readings: they allow for"),
        (robot(), scatter, "stated noise of readings and joints together: they allow for"),
        (replace(robot(), sources=sources), scatter, "(that of the joints is assumed, as the "),
    ):
        found = calibrate(arm, replace(session, joint_scatter=joints))
        (told,) = (text for text in found.warnings if "residuals are smaller" in text)
        assert said in told


@pytest.mark.parametrize("source", ["commanded", "read-back"])
def test_joints_with_two_decimals_are_said_to_move_the_tool_by_more_than_the_noise(source):
    """What they left was called a misfit, and no sentence named the digits."""
    rng, q = np.random.default_rng(5), pool_r(60)
    shown = np.radians(np.round(np.degrees(q), 2))
    xyz = true_model().poses(q)[:, :3, 3] + rng.normal(scale=10e-6, size=(60, 3))
    session = session_of(tables.points(shown, xyz, sd=10e-6), joint_source=source)
    found = calibrate(robot(), session)
    (told,) = (text for text in found.warnings if "write more decimals" in text)
    assert told.startswith("the joints stand in steps of 0.01 deg in the file: ")
    assert ("if they were rounded" in told) == (source == "commanded")
    size = float(told.partition("moves the tool by ")[2].split()[0])
    # readings at joints that were written, less those at joints as they stood: 180 numbers;
    # their root mean square scatters by 6 % over drawn roundings, of which 20 % are three and more
    left = true_model().poses(shown)[:, :3, 3] - true_model().poses(q)[:, :3, 3]
    assert size == pytest.approx(1e6 * np.sqrt((left**2).mean()), rel=0.2)
    # sent as they are written, they are exact
    exact = true_model().poses(shown)[:, :3, 3] + rng.normal(scale=10e-6, size=(60, 3))
    sent = calibrate(robot(), session_of(tables.points(shown, exact, sd=10e-6)))
    assert not any("decimals" in text for text in sent.warnings)


def test_where_only_linearity_fails_the_numbers_are_those_of_the_virtual_calibrations():
    found = sound()
    bent = replace(found.proof.bootstrap, estimates=2 * found.proof.bootstrap.estimates)
    other = _with(found, bent)
    assert (other.proof.trust.believe, other.refuted, other.not_linear) == ("region", True, True)
    np.testing.assert_array_equal(other.covariance, np.cov(bent.estimates, rowvar=False))
    # replicates that never arrived say nothing of how far numbers scatter
    lost = _with(found, replace(bent, unconverged=400))
    assert np.array_equal(lost.covariance, found.fit.identification.covariance)


def _with(found, bootstrap):
    proof = found.proof
    judged = trust(
        found.fit.identification,
        belief=proof.belief,
        point=proof.point,
        questions=proof.questions,
        held_out=proof.held_out,
        bootstrap=bootstrap,
    )
    return replace(found, proof=replace(proof, bootstrap=bootstrap, trust=judged))


@pytest.mark.parametrize(
    ("options", "changes", "message"),
    [
        (
            {"model": "elastic"},
            {},
            '--model is "elastic"; it takes geometric, extended or choose. [C41]',
        ),
        ({"loss": "l1"}, {}, '--loss is "l1"; it takes auto, squared, huber or cauchy. [C41]'),
        (
            {},
            {"free": "wen2021"},
            'bench: [identification] free is "wen2021"; it must be identifiable, frames, wen2022, '
            'or a list of names of numbers; did you mean "wen2022"? [S37]',
        ),
        ({}, {"free": ("theta2", "gamma")}, 'bench: no parameter is called "gamma"'),
    ],
)
def test_what_cannot_be_meant_is_refused(options, changes, message):
    sound = sound_session()
    session = replace(sound, wanted=sound.wanted.model_copy(update=changes))
    with pytest.raises(InputError) as caught:
        calibrate(robot(), session, Options(**options))
    assert str(caught.value).startswith(message.split("; geo")[0])


def test_too_few_poses_say_how_many_are_needed():
    session = session_of(table_of(true_model(), pool_r(4)))
    with pytest.raises(InputError, match="measure at least") as caught:
        calibrate(robot(), session)
    assert caught.value.code == "M27"


def test_a_second_file_is_held_out_whole():
    from testbed.identify.session import with_test

    apart = table_of(true_model(), pool_r(30, seed=99), seed=9)
    both = with_test(sound_session(), session_of(apart))
    found = calibrate(robot(), both)
    assert found.split.stated
    assert int(found.split.is_test.sum()) == 30
    assert found.pose_names[80] == "P1 (test)"
    error = predict(found.fit.identification.model, apart).misses
    assert found.fit.test.position.mean == pytest.approx(error.mean(), rel=1e-12)
    # a pose used for both is no test
    with pytest.raises(InputError, match="80 of 80 held-out poses stand at the same joints"):
        calibrate(robot(), with_test(sound_session(), sound_session()))


def test_the_joints_own_scatter_is_added_to_the_covariances():
    scatter = np.full(6, 14.5e-6)
    found = calibrate(robot(), replace(sound_session(), joint_scatter=scatter), Options(seed=1))
    J = found.before.poses_and_jacobian(found.measurements.q)[1]
    theta = [found.before.names.index(f"theta{k}") for k in range(1, 7)]
    added = J[:, :, theta] @ np.diag(scatter**2) @ np.swapaxes(J[:, :, theta], 1, 2)
    expected = sound_session().measurements.covariance + added
    np.testing.assert_allclose(found.measurements.covariance, expected, rtol=1e-9, atol=1e-18)
    assert found.fit.identification.chi_square < sound().fit.identification.chi_square

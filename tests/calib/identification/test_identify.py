"""Identification against known robots, against scipy, and against what least squares must obey."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, Status, identify
from calib.identification.outliers.scores import outliers
from calib.identification.sufficiency import independent_equations, require_equations
from calib.measurement.grouping import count_distinct
from calib.measurement.observations import POINT, POSE, Measurements
from calib.measurement.residual import linearize, paper_stack
from tests.reference import (
    DEG,
    READABLE30,
    SIGMA_POSITION,
    SIGMA_ROTATION,
    TX60_LINKS,
    WEN24,
    pool_r,
    rigid_truth,
    tx60,
)
from tests.truth.measuring import measured

POOL = pool_r()
HELD_OUT = POOL[500:800]
WEN_INDEX = [tx60().names.index(name) for name in WEN24]


def moved_everywhere(rng: np.random.Generator, model: RobotModel | None = None) -> RobotModel:
    """A true robot with all its numbers off: 0.02 deg, 0.12 mm."""
    model = model or tx60()
    size = np.where(model.is_length, 0.12e-3, 0.02 * DEG)
    return model.moved(rng.normal(size=model.n_numbers) * size)


def reflectors(truth: RobotModel, q: Array, offsets: Array, *, poses: bool = False) -> Measurements:
    """Every reflector (k, 3) at every joint vector, seen perfectly, and the poses too if asked."""
    at = np.repeat(q, len(offsets), axis=0)
    table = measured(truth, at)
    offset = np.tile(offsets, (len(q), 1))
    T = truth.poses(at)
    seen = (T[:, :3, :3] @ offset[:, :, None])[:, :, 0] + T[:, :3, 3]
    points = replace(
        table,
        kind=np.full(len(at), POINT),
        offset=offset,
        position=seen,
        rotation=np.tile(np.eye(3), (len(at), 1, 1)),
    )
    if not poses:
        return points
    whole = measured(truth, q)
    return Measurements(
        *(
            np.concatenate([getattr(whole, name), getattr(points, name)])
            for name in (
                "q",
                "position",
                "rotation",
                "covariance",
                "kind",
                "offset",
                "pose_id",
                "repeat",
            )
        )
    )


def largest_difference(one: RobotModel, other: RobotModel) -> tuple[float, float]:
    """Largest tool distance [m] and rotation entry on held-out poses."""
    A, B = one.poses(HELD_OUT), other.poses(HELD_OUT)
    return (
        float(np.linalg.norm(A[:, :3, 3] - B[:, :3, 3], axis=1).max()),
        float(np.abs(A[:, :3, :3] - B[:, :3, :3]).max()),
    )


@pytest.mark.parametrize("seen", [1, 4, 5, 6, 29])
def test_poses_alone_never_promise_more_equations_than_all_rows(seen):
    """What a quick look lets pass, the full count lets pass as well."""
    parameters, offsets = parameters_of(tx60()), np.array([[0.1, 0, 0], [0, 0.1, 0.0]])
    q = np.concatenate([POOL[:seen], POOL[:2], -0.0 * POOL[:3]])
    for table in (measured(tx60(), q), reflectors(tx60(), q, offsets, poses=True)):
        different = count_distinct(table.q[table.is_pose])
        assert different == seen + (1 if seen > 1 else 2)
        assert 6 * different <= independent_equations(table, parameters)[1]
    require_equations(tx60(), measured(tx60(), POOL[:6]), parameters_of(tx60(), READABLE30))
    with pytest.raises(InputError, match="5 different poses"):  # one more is asked for
        require_equations(tx60(), measured(tx60(), POOL[:5]), parameters_of(tx60(), READABLE30))


@pytest.mark.parametrize("mode", ["whitened", "paper"])
def test_perfect_measurements_give_every_number_of_the_papers_set_back(mode):
    truth = rigid_truth(np.random.default_rng(1))
    result = identify(tx60(), measured(truth, POOL[:29]), parameters_of(tx60(), WEN24), mode=mode)
    assert result.status is Status.CONVERGED
    # asked for are 1e-9 mm or rad; float64 poses of a meter hold 1e-16
    assert np.abs(result.step - tx60().step_to(truth)[WEN_INDEX]).max() < 1e-12


def test_perfect_measurements_of_a_robot_wrong_in_all_42_numbers_predict_every_other_pose():
    truth = moved_everywhere(np.random.default_rng(2))
    result = identify(tx60(), measured(truth, POOL[:29]), parameters_of(tx60()))
    assert result.names == READABLE30
    assert max(largest_difference(result.model, truth)) < 1e-12


@pytest.mark.parametrize("with_poses", [False, True], ids=["three reflectors", "and poses"])
def test_reflectors_calibrate_as_poses_do(with_poses):
    truth = moved_everywhere(np.random.default_rng(3))
    offsets = np.array([[0.05, 0.03, 0.08], [-0.06, 0.02, 0.04], [0.0, -0.07, 0.1]])
    table = reflectors(truth, POOL[:20], offsets, poses=with_poses)
    result = identify(tx60(), table, parameters_of(tx60()))
    assert result.rank == 30
    assert max(largest_difference(result.model, truth)) < 1e-12


def test_one_reflector_finds_what_moves_it():
    truth = moved_everywhere(np.random.default_rng(4))
    offset = np.array([[0.05, 0.03, 0.08]])
    result = identify(tx60(), reflectors(truth, POOL[:29], offset), parameters_of(tx60()))
    assert result.rank == 27  # one reflector off axis 6
    here, there = (
        (T[:, :3, :3] @ offset[0]) + T[:, :3, 3]
        for T in (result.model.poses(HELD_OUT), truth.poses(HELD_OUT))
    )
    assert np.abs(here - there).max() < 1e-12


def test_gravity_terms_are_identified_with_the_geometry():
    errors = JointErrors(gravity_terms(6), np.zeros(3))
    nominal = RobotModel(tx60().chain, errors)
    truth = moved_everywhere(np.random.default_rng(5), nominal)
    result = identify(nominal, measured(truth, POOL[:40]), parameters_of(nominal))
    assert max(largest_difference(result.model, truth)) < 1e-12


def test_a_rail_and_an_arm_calibrate_together():
    links = np.vstack([[0.0, 0, 0.1, -90 * DEG, 0.01], TX60_LINKS])
    nominal = RobotModel(Chain(links, kinds=("prismatic", *["revolute"] * 6)))
    truth = moved_everywhere(np.random.default_rng(6), nominal)
    rng = np.random.default_rng(7)
    q = np.column_stack([rng.uniform(-1, 1, 40), POOL[:40]])
    result = identify(nominal, measured(truth, q), parameters_of(nominal))
    T = np.abs(result.model.poses(q[::-1]) - truth.poses(q[::-1]))
    assert (
        result.rank == 6 * 4 + 2 * 1 + 6
    )  # 4 per revolute, 2 per prismatic joint, 6 (Everett 1988)
    assert T.max() < 1e-12


def minimum_norm_fit(table: Measurements) -> RobotModel:
    """All 42 numbers by Gauss-Newton with the shortest scaled step: another gauge and method."""
    model, scale = tx60(), parameters_of(tx60()).scale
    for _ in range(8):
        stack = linearize(model, table)
        model = model.moved(scale * np.linalg.lstsq(stack.A * scale, stack.r, rcond=1e-9)[0])
    return model


def pivoted_names(table: Measurements) -> list[str]:
    """Thirty columns that QR with pivoting picks."""
    from scipy.linalg import qr

    model = tx60()
    order = qr(linearize(model, table).A * parameters_of(model).scale, pivoting=True, mode="r")[1]
    return [model.names[k] for k in order[:30]]


def test_predictions_do_not_depend_on_which_of_the_redundant_numbers_are_free():
    """Readable 30, QR-pivoted 30 and minimum-norm 42 agree to 1e-9 mm."""
    table = measured(
        moved_everywhere(np.random.default_rng(8)), POOL[:29], np.random.default_rng(9)
    )
    readable = identify(tx60(), table, parameters_of(tx60())).model
    names = pivoted_names(table)
    assert set(names) != set(READABLE30)
    pivoted = identify(tx60(), table, parameters_of(tx60(), names))
    assert pivoted.rank == 30
    for other in (pivoted.model, minimum_norm_fit(table)):
        assert largest_difference(readable, other)[0] < 1e-12


def scipy_fit(table: Measurements, rows, system) -> Array:
    """The paper's 24 by scipy's own Levenberg-Marquardt, from rotation vectors of its own."""
    size = 1e-4 * np.ones(24)  # unknowns in 0.1 mm and 1e-4 rad

    def model(x):
        links = TX60_LINKS.copy()
        links.ravel()[np.array(WEN_INDEX) - 6] += x * size
        return RobotModel(Chain(links))

    found = least_squares(
        lambda x: rows(table, forward(model(x).chain, table.q)),
        np.zeros(24),
        # difference quotients are too coarse: 1e-6 sd shows the derivative's own error
        lambda x: -system(model(x), table).A[:, WEN_INDEX] * size,
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return found.x * size


def whitened_rows(table: Measurements, T: Array) -> Array:
    turn = Rotation.from_matrix(table.rotation @ np.swapaxes(T[:, :3, :3], 1, 2)).as_rotvec()
    parts = [(table.position - T[:, :3, 3]) / SIGMA_POSITION, turn / SIGMA_ROTATION]
    return np.concatenate(parts, axis=1).ravel()


def paper_rows(table: Measurements, T: Array) -> Array:
    columns = np.swapaxes(table.rotation - T[:, :3, :3], 1, 2).reshape(-1, 9)
    return np.hstack([columns, 1e3 * (table.position - T[:, :3, 3])]).ravel()


@pytest.mark.parametrize(
    ("mode", "rows", "system"),
    [("whitened", whitened_rows, linearize), ("paper", paper_rows, paper_stack)],
    ids=["6 rows", "12 rows"],
)
def test_estimates_are_those_of_scipy(mode, rows, system):
    table = measured(rigid_truth(np.random.default_rng(10)), POOL[:29], np.random.default_rng(11))
    ours = identify(tx60(), table, parameters_of(tx60(), WEN24), mode=mode)
    theirs = scipy_fit(table, rows, system)
    assert np.abs((ours.step - theirs) / ours.standard_uncertainty).max() < 1e-6


def test_covariance_is_the_inverse_of_the_curvature_at_the_answer():
    table = measured(rigid_truth(np.random.default_rng(12)), POOL[:29], np.random.default_rng(13))
    result = identify(tx60(), table, parameters_of(tx60(), WEN24))
    A = linearize(result.model, table).A[:, WEN_INDEX] * parameters_of(tx60(), WEN24).free_scale
    scale = parameters_of(tx60(), WEN24).free_scale
    product = (result.covariance / scale / scale[:, None]) @ (A.T @ A)
    np.testing.assert_allclose(product, np.eye(24), atol=1e-10)
    assert (result.full_covariance[np.ix_(WEN_INDEX, WEN_INDEX)] == result.covariance).all()
    assert np.count_nonzero(result.full_covariance) <= 24**2


def test_chi_square_and_its_p_value_are_those_of_the_residuals():
    table = measured(rigid_truth(np.random.default_rng(14)), POOL[:29], np.random.default_rng(15))
    result = identify(tx60(), table, parameters_of(tx60(), WEN24))
    r = whitened_rows(table, result.model.poses(table.q))
    assert result.dof == 6 * 29 - 24
    assert result.chi_square == pytest.approx(r @ r, rel=1e-10)
    assert result.p_value == pytest.approx(chi2.sf(r @ r, 150), rel=1e-9)
    assert result.certificate < 1e-6
    assert not result.notes


def test_paper_mode_claims_what_ordinary_least_squares_claims():
    table = measured(rigid_truth(np.random.default_rng(16)), POOL[:29], np.random.default_rng(17))
    result = identify(tx60(), table, parameters_of(tx60(), WEN24), mode="paper")
    H = paper_stack(result.model, table).A[:, WEN_INDEX]
    r = paper_rows(table, result.model.poses(table.q))
    assert result.dof == 12 * 29 - 24
    assert result.variance == pytest.approx(r @ r / 324, rel=1e-9)
    claimed = np.sqrt(result.variance * np.diag(np.linalg.inv(H.T @ H)))
    np.testing.assert_allclose(result.standard_uncertainty, claimed, rtol=1e-8)
    assert np.isnan(result.p_value)
    assert "six degrees of freedom" in result.notes[-1]


def in_millimeters(model: RobotModel) -> RobotModel:
    """The same robot with the millimeter as unit of length."""
    links = model.chain.links * [1, 1e3, 1e3, 1, 1]
    base, tool = (T.copy() for T in (model.chain.T_world_base, model.chain.T_flange_tool))
    base[:3, 3] *= 1e3
    tool[:3, 3] *= 1e3
    return RobotModel(Chain(links, T_world_base=base, T_flange_tool=tool))


def test_estimates_do_not_depend_on_the_unit_of_length():
    table = measured(
        moved_everywhere(np.random.default_rng(18)), POOL[:29], np.random.default_rng(19)
    )
    unit = np.repeat([1e3, 1.0], 3)
    other = replace(
        table, position=1e3 * table.position, covariance=table.covariance * unit[:, None] * unit
    )
    one = identify(tx60(), table, parameters_of(tx60()))
    two = identify(in_millimeters(tx60()), other, parameters_of(in_millimeters(tx60()), length=300))
    factor = np.where(np.array(one.parameters.is_length)[one.parameters.free], 1e3, 1.0)
    assert one.names == two.names
    sd = one.standard_uncertainty
    # relative to the sd: the smallest numbers are zero in truth
    np.testing.assert_allclose(two.step / factor / sd, one.step / sd, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(two.standard_uncertainty / factor, sd, rtol=1e-9)
    assert two.chi_square == pytest.approx(one.chi_square, rel=1e-9)


def test_estimates_do_not_depend_on_column_scales():
    """mm for meters, degrees for radians: scales steer only the reduction."""
    table = measured(rigid_truth(np.random.default_rng(20)), POOL[:29], np.random.default_rng(21))
    plain = parameters_of(tx60(), WEN24)
    odd = replace(plain, scale=np.where(plain.is_length, 1e-3, DEG))
    one, two = (identify(tx60(), table, parameters) for parameters in (plain, odd))
    np.testing.assert_allclose(two.step, one.step, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(two.covariance, one.covariance, rtol=1e-9)


def test_order_of_poses_does_not_matter():
    table = measured(rigid_truth(np.random.default_rng(22)), POOL[:29], np.random.default_rng(23))
    shuffled = table.rows(np.random.default_rng(24).permutation(29))
    one, two = (identify(tx60(), t, parameters_of(tx60(), WEN24)) for t in (table, shuffled))
    np.testing.assert_allclose(two.step, one.step, atol=1e-9 * one.standard_uncertainty.max())


def refused(q: Array, free: tuple[str, ...] | None, **more: str) -> str:
    with pytest.raises(InputError) as caught:
        identify(tx60(), measured(tx60(), q), parameters_of(tx60(), free), **more)
    assert caught.value.code == "M27"
    return str(caught.value)


@pytest.mark.parametrize("mode", ["whitened", "paper"])
def test_too_few_poses_are_refused_with_what_is_there_and_what_is_needed(mode):
    """18 equations from 3 poses, not 36, and one more pose for a residual."""
    said = refused(POOL[:3], WEN24, mode=mode)
    assert "3 different poses give 18 equations for 24 parameters; measure at least 5" in said


def test_the_need_counts_what_can_be_told_apart_not_what_is_free():
    assert "5 different poses give 30 equations for 30 parameters; measure at least 6" in refused(
        POOL[:5], None
    )
    assert identify(tx60(), measured(tx60(), POOL[:6]), parameters_of(tx60())).dof == 6


def test_one_reflector_needs_ten_poses():
    offset = np.array([[0.05, 0.03, 0.08]])
    with pytest.raises(
        InputError, match=r"9 different poses give 27 .* 27 .*; measure at least 10"
    ):
        identify(tx60(), reflectors(tx60(), POOL[:9], offset), parameters_of(tx60()))
    table = reflectors(tx60(), POOL[:10], offset)
    assert identify(tx60(), table, parameters_of(tx60())).dof == 3


def test_repeats_are_not_counted_as_new_poses():
    said = refused(np.repeat(POOL[:3], 10, axis=0), WEN24)
    assert said.startswith("3 different poses give 18")


def test_several_reflectors_at_one_pose_give_no_more_than_its_six_equations():
    offsets = np.array([[0.05, 0.03, 0.08], [-0.06, 0.02, 0.04], [0.0, -0.07, 0.1]])
    with pytest.raises(InputError, match="4 different poses give 24"):
        identify(tx60(), reflectors(tx60(), POOL[:4], offsets), parameters_of(tx60()))


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_never_moves_is_named_and_its_numbers_are_not_invented(joint):
    q = POOL[:40].copy()
    q[:, joint] = 0.3
    result = identify(tx60(), measured(tx60(), q), parameters_of(tx60()))
    assert result.rank == 26
    assert any(f"joint {joint + 1} never moves" in note for note in result.notes)
    assert len(result.step) == 26
    assert np.isfinite(result.covariance).all()


def test_numbers_that_are_not_estimated_stay_nominal_to_the_last_bit():
    truth = moved_everywhere(np.random.default_rng(25))
    result = identify(tx60(), measured(truth, POOL[:29]), parameters_of(tx60()))
    dropped = [result.parameters.names.index(name) - 6 for name in result.reduction.dropped]
    links = result.model.chain.links.ravel()
    assert len(dropped) == 12
    assert (links[dropped] == TX60_LINKS.ravel()[dropped]).all()


def test_paper_mode_refuses_numbers_it_cannot_tell_apart_by_name():
    free, says = (
        (*WEN24, "d2", "beta3"),
        "26 numbers are free, .* 24 apart: .* hold d2, beta3 fixed",
    )
    with pytest.raises(InputError, match=says) as caught:
        identify(tx60(), measured(tx60(), POOL[:29]), parameters_of(tx60(), free), mode="paper")
    assert caught.value.code == "M30"


def test_nothing_free_a_foreign_table_and_an_unknown_mode_are_refused():
    table = measured(tx60(), POOL[:29])
    foreign = parameters_of(RobotModel(tx60().chain, JointErrors(gravity_terms(6), np.zeros(3))))
    for parameters, mode, says in (
        (parameters_of(tx60(), ()), "whitened", "no number is free"),
        (foreign, "whitened", "45 numbers, the model has 42"),
        (parameters_of(tx60()), "robust", 'mode is "robust"'),
    ):
        with pytest.raises(InputError, match=says):
            identify(tx60(), table, parameters, mode=mode)


def test_a_robot_that_sags_raises_the_alarm_and_too_small_residuals_do_too():
    sag = JointErrors(gravity_terms(6), np.array([10, 6, 8]) * 1e-3 * DEG)
    truth = RobotModel(tx60().chain, sag)
    table = measured(truth, POOL[:40], np.random.default_rng(26))
    result = identify(tx60(), table, parameters_of(tx60(), WEN24))
    assert result.p_value < 1e-3
    assert "do not believe the intervals" in result.notes[-1]
    quiet = identify(tx60(), measured(tx60(), POOL[:40]), parameters_of(tx60(), WEN24))
    assert quiet.p_value > 0.999
    assert "too wide" in quiet.notes[-1]


@pytest.mark.parametrize("points", [False, True], ids=["poses", "poses and points"])
def test_outlier_score_is_what_chi_square_loses_without_the_observation(points):
    """Leave one out for real: the linear fit redone without it."""
    rng = np.random.default_rng(27)
    table = measured(tx60(), POOL[:14], rng)
    if points:
        table = replace(table, kind=np.where(np.arange(14) % 2 == 0, POSE, POINT))
    stack = linearize(tx60(), table)
    A, r = stack.A[:, WEN_INDEX] * parameters_of(tx60(), WEN24).free_scale, stack.r

    def cost(keep: Array) -> float:
        x = np.linalg.lstsq(A[keep], r[keep])[0]
        return float(np.sum((r[keep] - A[keep] @ x) ** 2))

    everything = np.ones(len(r), dtype=bool)
    at_end = r - A @ np.linalg.lstsq(A, r)[0]
    lost = [cost(everything) - cost(stack.row_of != j) for j in range(14)]
    np.testing.assert_allclose(outliers(at_end, A, stack.row_of).score, lost, rtol=1e-7)


def spoiled(table: Measurements, row: int) -> Measurements:
    """The same table with one position off by 0.3 mm."""
    position = table.position.copy()
    position[row] += 3e-4
    return replace(table, position=position)


def judged(table: Measurements) -> tuple[Identification, list[int]]:
    result = identify(tx60(), table, parameters_of(tx60(), WEN24))
    stack = linearize(result.model, table)
    found = outliers(result.residual, stack.A[:, WEN_INDEX], stack.row_of)
    return result, np.flatnonzero(found.suspect).tolist()


def test_a_position_off_by_three_tenths_of_a_millimeter_is_the_worst_suspect():
    table = measured(tx60(), POOL[:61], np.random.default_rng(28))
    assert judged(table)[1] == []
    result, suspects = judged(spoiled(table, 17))
    stack = linearize(result.model, table)
    score = outliers(result.residual, stack.A[:, WEN_INDEX], stack.row_of).score
    assert 17 in suspects
    assert int(np.argmax(score)) == 17


def test_an_observation_that_nothing_checks_is_not_accused():
    """Four poses for 24 numbers: each is its own explanation."""
    table = measured(tx60(), POOL[:4], np.random.default_rng(29))
    stack = linearize(tx60(), table)
    found = outliers(np.zeros(24), stack.A[:, WEN_INDEX], stack.row_of)
    assert not found.suspect.any()
    assert np.isinf(found.limit).all()


def test_progress_is_told_once_per_step():
    told: list[int] = []
    table = measured(rigid_truth(np.random.default_rng(30)), POOL[:29])
    result = identify(tx60(), table, parameters_of(tx60()), report=lambda k, _cost: told.append(k))
    assert told == list(range(1, result.iterations + 1))

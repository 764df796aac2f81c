"""Reflectors, anchors and stations: numbers of the model, and rows that name them."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import forward
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import inverse
from calib.geometry.joint_errors import JointErrors, gravity_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.joint_models import extended_model, extended_parameters
from calib.identification.prior import step_derivative
from calib.information.propagation import tool_covariance
from calib.information.sizes import weak_prior_sd
from calib.measurement.observations import DISTANCE, POINT, joined
from calib.measurement.prediction import perfect, predict, predicted_positions
from calib.measurement.residual import linearize, padded_covariance, paper_stack
from calib.uncertainty.budget import RowNoise, budget
from calib.uncertainty.held_out import held_out
from calib.uncertainty.one_by_one import fitted_one_by_one, with_noise
from calib.uncertainty.refit import freeze, refit
from calib.uncertainty.tool_point import propagate
from tests.calib.kinds import (
    NOISE,
    distances,
    everything,
    places,
    points,
    poses,
    require_derivatives,
    true_robot,
)
from tests.reference import BASE6, pool_r, tx60


def full_model(seed: int = 0) -> RobotModel:
    rng = np.random.default_rng(seed)
    true = true_robot("tx60", rng)
    return replace(true, joint_errors=JointErrors(gravity_terms(6), rng.normal(size=3) * 1e-3))


def test_fixtures_come_last_and_are_named_as_people_count():
    model = full_model()
    assert model.names[:45] == replace(model, fixtures=Fixtures()).names
    assert model.names[45:54:4] == ("reflector1.x", "reflector2.y", "reflector3.z")
    assert model.names[54:57] == ("anchor1.x", "anchor1.y", "anchor1.z")
    assert model.names[-6:] == tuple(
        f"station2.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")
    )
    assert len(model.names) == len(model.is_length) == model.n_numbers == 45 + 9 + 12 + 6
    assert model.is_length[45:] == (True,) * 24 + (False,) * 3


def test_a_model_without_fixtures_is_what_it_was():
    assert tx60().fixtures.n_numbers == 0
    assert tx60().n_numbers == tx60().first_fixture == 42


def test_moved_and_step_to_undo_each_other_for_every_number():
    rng, model = np.random.default_rng(1), full_model()
    step = rng.normal(size=model.n_numbers) * 0.1
    # rounding of rotations up to pi away, a few parts in 1e16 of meters
    np.testing.assert_allclose(model.step_to(model.moved(step)), step, atol=1e-12)


def test_a_station_moves_in_its_own_axes_and_points_move_in_their_frame():
    fixtures = full_model().fixtures
    step = np.zeros(fixtures.n_numbers)
    step[[0, 9, -6]] = 0.1, 0.2, 0.3
    moved = fixtures.moved(step)
    np.testing.assert_allclose(
        moved.reflectors[0] - fixtures.reflectors[0], [0.1, 0, 0], atol=1e-15
    )
    np.testing.assert_allclose(moved.anchors[0] - fixtures.anchors[0], [0.2, 0, 0], atol=1e-15)
    seen = inverse(fixtures.stations[0]) @ moved.stations[0]
    np.testing.assert_allclose(seen[:3, 3], [0.3, 0, 0], atol=1e-14)


def test_no_fixture_moves_the_tool():
    model, q = full_model(), pool_r(20)
    T, J = model.poses_and_jacobian(q)
    assert J.shape == (20, 6, model.n_numbers)
    assert not J[:, :, 45:].any()
    assert np.array_equal(T, forward(model.chain, q + model.joint_errors.offsets(q)))
    covariance = np.eye(model.n_numbers)
    covariance[:45, :45] = 0
    assert not tool_covariance(model, q, covariance).any()
    step = np.zeros((2, model.n_numbers))
    step[:, 45:] = 0.1
    np.testing.assert_allclose(propagate(model, q, step)[1], T[:, :3, 3], atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 0.3], ids=["no error", "a third of a meter"])
def test_every_kind_of_row_has_the_derivative_of_its_residual_in_every_number(size: float):
    rng, true = np.random.default_rng(2), full_model()
    table = everything(true, pool_r(3), rng)
    model = true.moved(rng.normal(size=true.n_numbers) * size)
    require_derivatives(model, table)


def test_rows_of_the_truth_differ_from_what_it_predicts_by_noise_alone():
    rng, true = np.random.default_rng(3), true_robot("tx60", np.random.default_rng(3))
    table = everything(true, pool_r(200), rng)
    stack = linearize(true, table)
    # 200 x (6 + 6 + 3 + 3 + 3 + 1 + 1) equations; chi-square within four standard deviations
    assert len(stack.r) == table.n_equations == 200 * 23
    assert abs(stack.r @ stack.r - len(stack.r)) < 4 * np.sqrt(2 * len(stack.r))


def test_a_table_seen_from_elsewhere_says_the_same():
    """Seen, covariance and station turned together leave chi-square as it was."""
    rng, true = np.random.default_rng(4), full_model()
    q = pool_r(5)
    world = joined([poses(true, q, rng), points(true, q, rng, reflector=1)])
    root = rng.normal(size=(len(world), 6, 8)) * np.repeat([NOISE, 1e-4], 3)[:, None]
    world = replace(world, covariance=root @ np.swapaxes(root, 1, 2))
    S = true.fixtures.stations[0]
    R = S[:3, :3].T
    turn = np.kron(np.eye(2), R)
    away = replace(
        world,
        position=(world.position - S[:3, 3]) @ S[:3, :3],
        rotation=np.where(world.is_pose[:, None, None], R @ world.rotation, np.eye(3)),
        covariance=turn @ world.covariance @ turn.T,
        station=np.ones(len(world), dtype=int),
    )
    one, other = linearize(true, world), linearize(true, away)
    np.testing.assert_allclose(
        np.bincount(one.row_of, one.r**2), np.bincount(other.row_of, other.r**2), rtol=1e-6
    )
    np.testing.assert_allclose(one.A.T @ one.r, (other.A.T @ other.r) * _held(true), rtol=1e-5)


def _held(true: RobotModel):
    """One for every number but those of the station, whose columns the world does not have."""
    names = np.array([not name.startswith("station") for name in true.names])
    return np.where(names, 1.0, 0.0)


def test_seen_positions_are_where_the_reflectors_are():
    rng, true = np.random.default_rng(5), full_model()
    q = pool_r(4)
    for table in (points(true, q, rng, reflector=2), distances(true, q, rng)):
        np.testing.assert_allclose(
            predicted_positions(true, table), places(true, table), atol=1e-14
        )
    away = points(true, q, rng, reflector=2, station=1)
    # noise of 20 um, five standard deviations
    np.testing.assert_allclose(predicted_positions(true, away), away.position, atol=5 * NOISE)


def test_a_step_of_a_step_follows_the_chain_rule_for_stations_too():
    rng, model = np.random.default_rng(6), full_model()
    step, small = rng.normal(size=model.n_numbers) * 0.3, rng.normal(size=model.n_numbers) * 1e-6
    there = model.moved(step)
    change = model.step_to(there.moved(small)) - model.step_to(there)
    # second order, 1e-12, and rounding of the logarithm
    np.testing.assert_allclose(change, step_derivative(step, there) @ small, atol=2e-11)


def test_the_extended_model_keeps_the_fixtures_and_puts_its_terms_before_them():
    nominal = replace(tx60(), fixtures=Fixtures(anchors=[[1, 2, 3]]))
    extended = extended_model(nominal)
    assert extended.fixtures is nominal.fixtures
    assert extended.names[-3:] == nominal.names[-3:]
    free = (*BASE6, "anchor1.z")
    table = extended_parameters(nominal, extended, parameters_of(nominal, free))
    assert table.names == extended.names
    assert set(free) <= set(table.free_names)
    assert len(table.free_names) == len(free) + len(extended.joint_errors.terms)
    assert parameters_of(extended).scale.tolist() == table.scale.tolist()


def test_what_is_set_up_is_known_beforehand_as_well_as_frames_are():
    model = replace(tx60(), fixtures=Fixtures([[0, 0, 0]], [[1, 0, 0]], [np.eye(4)]))
    sd = dict(zip(model.names, weak_prior_sd(parameters_of(model)), strict=True))
    assert sd["reflector1.x"] == sd["anchor1.y"] == sd["station2.z"] == sd["base.x"] == 1e-3
    assert sd["station2.rz"] == sd["base.rz"]


def test_the_table_can_be_cut_and_joined_without_losing_a_column():
    rng, true = np.random.default_rng(7), full_model()
    table = everything(true, pool_r(2), rng)
    again = joined([table.rows([k]) for k in range(len(table))])
    for name in table.__slots__:
        assert np.array_equal(getattr(table, name), getattr(again, name)), name
    assert table.n_equations == 2 * 23


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("reflector", -2, "reflector"),
        ("station", -1, "station"),
        ("anchor", 0, "no distance"),
        ("distance", 1.0, "no distance"),
    ],
)
def test_rows_that_contradict_their_kind_are_refused_with_their_number(column, value, said):
    table = points(full_model(), pool_r(3), np.random.default_rng(8))
    changed = np.array(getattr(table, column))
    changed[1] = value
    with pytest.raises(InputError, match=rf"{column}\[1\].*{said}"):
        replace(table, **{column: changed})


@pytest.mark.parametrize(
    ("column", "value"), [("distance", 0.0), ("distance", -1.0), ("anchor", -1), ("station", 1)]
)
def test_a_distance_needs_an_anchor_and_a_length_and_no_station(column, value):
    table = distances(full_model(), pool_r(3), np.random.default_rng(9))
    changed = np.array(getattr(table, column))
    changed[2] = value
    with pytest.raises(InputError, match=rf"{column}\[2\] of a distance row"):
        replace(table, **{column: changed})


def test_a_pose_sees_no_reflector():
    table = poses(full_model(), pool_r(2), np.random.default_rng(10))
    with pytest.raises(InputError, match="a pose sees no reflector"):
        replace(table, reflector=[0, 0])


def test_a_column_of_the_wrong_length_is_refused():
    table = poses(full_model(), pool_r(2), np.random.default_rng(10))
    with pytest.raises(InputError, match="station has shape"):
        replace(table, station=[0, 0, 0])


@pytest.mark.parametrize("column", ["reflector", "anchor", "station"])
def test_a_row_that_names_what_the_model_does_not_have_is_refused(column):
    true = full_model()
    table = everything(true, pool_r(2), np.random.default_rng(11))
    with pytest.raises(InputError, match=rf"{column}\[\d+\] is \d, and the model has"):
        linearize(replace(true, fixtures=_without(true.fixtures, column)), table)


def _without(fixtures: Fixtures, column: str) -> Fixtures:
    empty = {"reflector": (0, 3), "anchor": (0, 3), "station": (0, 4, 4)}[column]
    return replace(fixtures, **{f"{column}s": np.zeros(empty)})


def test_fixtures_that_are_no_frames_or_differ_in_number_are_refused():
    with pytest.raises(InputError, match=r"stations\[0\] is not a rigid"):
        Fixtures(stations=[2 * np.eye(4)])
    with pytest.raises(InputError, match="differ in number"):
        full_model().step_to(replace(full_model(), fixtures=Fixtures()))


def test_the_papers_rows_know_poses_from_one_station_only():
    rng, true = np.random.default_rng(12), full_model()
    for table, said in (
        (distances(true, pool_r(2), rng), "distance"),
        (poses(true, pool_r(2), rng, station=1), "station"),
    ):
        with pytest.raises(InputError, match=said):
            paper_stack(true, table)


def test_virtual_calibrations_take_known_reflectors_and_refuse_the_rest_in_words():
    rng, true = np.random.default_rng(13), full_model()
    q = pool_r(20)
    free = parameters_of(true, ("theta2", "a2"))
    named = freeze(true, points(true, q, rng, reflector=0), free)
    given = replace(points(true, q, rng), offset=np.tile(true.fixtures.reflectors[0], (20, 1)))
    np.testing.assert_allclose(named.covariance, freeze(true, given, free).covariance, rtol=1e-9)
    for table, names, said in (
        (distances(true, q, rng), ("theta2",), "distances"),
        (points(true, q, rng, station=1), ("theta2",), "stations"),
        (points(true, q, rng, reflector=0), ("theta2", "reflector1.x"), "reflector1.x"),
    ):
        start = freeze(true, table, parameters_of(true, names))
        with pytest.raises(InputError, match=f"virtual calibrations know no .*{said}"):
            refit(start, table.position[None], table.rotation[None])
        normal = rng.standard_normal((1, len(table), 6))
        found = fitted_one_by_one(start, normal, np.zeros((1, len(names))))
        again = identify(true, with_noise(start, normal[0]), parameters_of(true, names))
        np.testing.assert_allclose(found.steps[0], again.step, rtol=1e-6, atol=1e-12)
        assert found.chi_square[0] == pytest.approx(again.chi_square, rel=1e-9)


def test_budgets_take_rows_of_every_kind():
    """The covariance that `identify` states, and the sum over sources, for mixed rows."""
    rng, true = np.random.default_rng(21), full_model()
    q = pool_r(60)
    table = joined(
        [
            poses(true, q, rng),
            points(true, q, rng, reflector=0, station=1),
            points(true, q, rng, reflector=1),
            distances(true, q, rng),
        ]
    )
    found = identify(true, table, parameters_of(true))
    start = freeze(found.model, table, found.parameters)
    # one is the curvature where the fit ended, the other that of perfect readings there
    np.testing.assert_allclose(start.covariance, found.covariance, rtol=1e-3, atol=1e-16)
    half = RowNoise("half", 0.5 * padded_covariance(table))
    whole = budget(start, [half, RowNoise("other half", half.covariance)])
    # F Sigma F' = inv(A'A) A'N Sigma N'A inv(A'A) = inv(A'A)
    np.testing.assert_allclose(whole.covariance, start.covariance, rtol=1e-8, atol=1e-20)


def test_a_perfect_table_leaves_no_residual():
    rng, true = np.random.default_rng(22), full_model()
    table = joined(
        [
            poses(true, pool_r(4), rng, station=1),
            points(true, pool_r(4), rng, reflector=1, station=1),
            distances(true, pool_r(4), rng),
        ]
    )
    seen = perfect(true, table)
    assert np.abs(predict(true, seen).residual).max() < 1e-14
    for name in ("q", "kind", "station", "reflector", "anchor", "covariance", "pose_id"):
        np.testing.assert_array_equal(getattr(seen, name), getattr(table, name))


def test_held_out_positions_may_come_from_any_station_but_distances_are_refused():
    rng, true = np.random.default_rng(14), full_model()
    q, nothing = pool_r(60), np.zeros((true.n_numbers,) * 2)
    for station in (0, 1):
        table = points(true, q, rng, reflector=1, station=station)
        found = held_out(true, nothing, table, pool_r(5, seed=99))
        # 180 errors of known size: four standard deviations
        assert abs(found.chi_square - 180) < 4 * np.sqrt(360)
    with pytest.raises(InputError, match="distance"):
        held_out(true, nothing, distances(true, q, rng), pool_r(5, seed=99))


def test_kinds_are_told_apart():
    table = everything(full_model(), pool_r(2), np.random.default_rng(15))
    assert set(table.kind) == {"pose", POINT, DISTANCE}
    assert table.equations[table.kind == DISTANCE].tolist() == [1] * 4

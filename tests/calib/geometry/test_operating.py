"""What poses say beside their joints, and the terms of a model that follow it."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain, forward
from calib.geometry.felt_springs import Felt
from calib.geometry.gravity import Weight, guessed_moments
from calib.geometry.inverse_search import joint_jacobian
from calib.geometry.joint_errors import NO_JOINT, JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions, approaches, joined_conditions
from calib.measurement.observations import joined
from calib.measurement.tables import points, poses
from tests.calib.geometry.bent import random_arm
from tests.calib.slopes import slopes


def one_of_each(chain):
    """Terms of every kind on a chain, no coefficient zero."""
    n = chain.n_joints
    of = [tuple(float(k == i) for k in range(n)) for i in range(n)]
    terms = (
        JointTerm("harmonic1.sin1", 0, "sin", of[0]),
        JointTerm("gear2.cos", 1, "cos", (0.0, 30.5, *[0.0] * (n - 2))),
        JointTerm("approach1", 0, "approach", of[0]),
        JointTerm("torque2", 1, "torque", of[1], 3.0),
        JointTerm("lengths", NO_JOINT, "lengths", (0,) * n, 20.0),
    )
    return terms, np.array([2e-4, 1e-4, 3e-4, 1e-5, 40e-6])


def conditions(rng, m, n):
    return OperatingConditions(
        payload=rng.uniform(0, 5, m),
        center=rng.normal(0, 0.1, (m, 3)),
        approach=rng.integers(-1, 2, (m, n)),
        torque=rng.normal(0, 30, (m, n)),
        temperature=rng.uniform(15, 35, m),
    )


def arms(rng):
    """A stiff and a sprung arm, each with a slide."""
    chain = random_arm(rng)
    terms, coefficients = one_of_each(chain)
    yield RobotModel(chain, JointErrors(terms, coefficients))
    weight = Weight(chain, guessed_moments(chain))
    springs, _ = Felt.of(weight, rng.uniform(-1, 1, (50, 6))).springs(free_moments=True, passes=2)
    numbers = np.concatenate([coefficients, rng.normal(0, 1e-3, len(springs.names))])
    yield RobotModel(chain, JointErrors(terms, numbers, springs))


@pytest.mark.parametrize("which", [0, 1])
def test_columns_of_terms_that_follow_the_rows_are_derivatives(which):
    rng = np.random.default_rng(3)
    model = list(arms(rng))[which]
    n = model.chain.n_joints
    q, at = rng.uniform(-1, 1, (20, n)), conditions(rng, 20, n)
    T, J = model.poses_and_jacobian(q, at)
    # the sweep of the Jacobian adds what `forward` adds, in another order
    assert np.abs(T - model.poses(q, at)).max() < 1e-14
    numeric = slopes(
        lambda step: model.moved(step).poses(q, at)[:, :3, 3], np.zeros(model.n_numbers), 1e-5
    )
    # rounding 1e-16 / h and curvature h^2 of the order of the reach; torques are up to 100 N m
    size = np.maximum(1.0, np.abs(numeric).max(axis=(0, 1))) ** 2
    assert (np.abs(J[:, :3] - numeric).max(axis=(0, 1)) < 1e-9 * size).all()


@pytest.mark.parametrize("passes", [1, 3])
def test_a_payload_of_each_row_bends_the_arm_as_one_of_the_whole_arm_does(passes):
    rng = np.random.default_rng(7)
    chain = random_arm(rng)
    weight = Weight(chain, guessed_moments(chain), [1.0, 0.1, 0.0, 0.2])
    springs, _ = Felt.of(weight, rng.uniform(-1, 1, (50, 6)), tilt=0.1).springs(
        free_moments=True, passes=passes
    )
    numbers = rng.normal(0, 1e-3, len(springs.names))
    model = RobotModel(chain, JointErrors((), numbers, springs))
    q, at = rng.uniform(-1, 1, (1003, 6)), conditions(rng, 1003, 6)  # more than one batch
    T = model.poses(q, at)
    for k in (0, 500, 1002):
        own = replace(springs, weight=replace(weight, payload=at.moments[k]))
        alone = replace(model, joint_errors=JointErrors((), numbers, own))
        # two orders of the same sums
        assert np.abs(alone.poses(q[[k]]) - T[k]).max() < 1e-14
    # who says nothing has the payload of the arm
    usual = OperatingConditions(payload=np.ones(3), center=np.tile([0.1, 0.0, 0.2], (3, 1)))
    assert np.abs(model.poses(q[:3], usual) - model.poses(q[:3])).max() < 1e-15
    few = at.rows(np.arange(20))
    _, J = joint_jacobian(model, q[:20], few)
    # rounding 1e-15 / 1e-6
    assert np.abs(slopes(lambda q: model.poses(q, few)[:, :3, 3], q[:20]) - J[:, :3]).max() < 1e-8


def test_values_are_the_closed_forms_written_out():
    rng = np.random.default_rng(4)
    chain = random_arm(rng, ("revolute",) * 4)
    terms, c = one_of_each(chain)
    model, q = RobotModel(chain, JointErrors(terms, c)), rng.uniform(-1, 1, (6, 4))
    at = conditions(rng, 6, 4)
    dq = np.zeros_like(q)
    dq[:, 0] = c[0] * np.sin(q[:, 0]) + c[2] * at.approach[:, 0]
    dq[:, 1] = c[1] * np.cos(30.5 * q[:, 1]) + c[3] * (at.torque[:, 1] - 3.0)
    for k in range(6):
        links = chain.links.copy()
        links[:, 1:3] *= 1 + c[4] * (at.temperature[k] - 20.0)
        warm = forward(replace(chain, links=links), (q + dq)[[k]])
        # two orders of the same sums
        assert np.abs(warm - model.poses(q[[k]], at.rows([k]))).max() < 1e-15


def test_what_is_not_said_is_as_it_was_on_average_and_waves_keep_their_bits():
    rng = np.random.default_rng(5)
    chain = random_arm(rng, ("revolute",) * 4)
    terms, c = one_of_each(chain)
    q = rng.uniform(-1, 1, (6, 4))
    usual = OperatingConditions(
        approach=np.zeros((6, 4)), torque=np.full((6, 4), 3.0), temperature=np.full(6, 20.0)
    )
    model = RobotModel(chain, JointErrors(terms, c))
    waves = RobotModel(chain, JointErrors(terms[:2], c[:2]))
    assert np.array_equal(model.poses(q), waves.poses(q))
    assert np.array_equal(waves.poses(q), waves.poses(q, conditions(rng, 6, 4)))
    assert np.abs(model.poses(q) - model.poses(q, usual)).max() < 1e-15


def test_directions_follow_the_order_and_a_joint_that_stays_keeps_its_side():
    q = [[0.0, 0.0], [0.1, 0.0], [0.1, -0.2], [0.0, -0.2]]
    found = approaches(q)
    assert found.tolist() == [[0, 0], [1, 0], [1, -1], [-1, -1]]
    order = [3, 2, 1, 0]  # backwards in time
    assert approaches(q, order).tolist() == [[-1, 1], [1, 1], [1, 0], [0, 0]]


def test_conditions_go_with_their_rows():
    rng = np.random.default_rng(6)
    one = poses(np.zeros((3, 2)), np.tile(np.eye(4), (3, 1, 1)), sd=(1e-5, 1e-5))
    two = points(np.ones((2, 2)), np.zeros((2, 3)), sd=1e-5)
    said = OperatingConditions(payload=[1.0, 2.0, 6.0], approach=rng.integers(-1, 2, (3, 2)))
    both = joined([replace(one, conditions=said), two])
    # the mean of what is stated, and no direction
    assert both.conditions.payload.tolist() == [1.0, 2.0, 6.0, 3.0, 3.0]
    assert not both.conditions.approach[3:].any()
    assert both.rows([2, 4]).conditions.payload.tolist() == [6.0, 3.0]
    assert joined([one, two]).conditions is AS_USUAL
    assert joined_conditions([AS_USUAL], [4]) is AS_USUAL
    moments = OperatingConditions(payload=[2.0], center=[[0.0, 0.1, 0.2]]).moments
    assert moments.tolist() == [[2.0, 0.0, 0.2, 0.4]]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"center": [[0.0, 0.0, 0.0]]}, "center is given, and payload is not"),
        ({"payload": [-1.0]}, "payload is -1"),
        ({"approach": [[0.5]]}, "other values than directions"),
        ({"temperature": [np.nan]}, "nan"),
        ({"payload": [1.0], "temperature": [1.0, 2.0]}, "temperature"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        OperatingConditions(**wrong)


def test_conditions_of_other_poses_are_refused():
    model = RobotModel(Chain([[0, 0.3, 0.1, 0, 0]]))
    with pytest.raises(InputError, match="temperature"):
        model.poses([[0.0], [1.0]], OperatingConditions(temperature=[20.0]))

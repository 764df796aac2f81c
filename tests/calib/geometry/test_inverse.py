"""Inverse kinematics: back to the pose, by the shortest way, inside the limits, or said why not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from calib.errors import InputError
from calib.geometry import inverse, inverse_search
from calib.geometry.chain import Chain
from calib.geometry.frames import log_so3, rot_y, slide
from calib.geometry.inverse import inverse_kinematics, joint_jacobian, spread
from calib.geometry.joint_errors import JointErrors, gravity_terms, harmonic_terms
from calib.geometry.model import RobotModel
from tests.calib.slopes import slopes, twist
from tests.reference import TX60_LIMITS

QUARTER = np.pi / 2
TX60 = Chain(
    [
        [0, 0, 0, -QUARTER, 0], [-QUARTER, 0, 0.29, 0, 0], [QUARTER, 0.02, 0, QUARTER, 0],
        [0, 0.31, 0, -QUARTER, 0], [0, 0, 0, QUARTER, 0], [0, 0.07, 0, 0, 0],
    ]
)  # fmt: skip
SEVEN = Chain(
    [[0, d, 0, s * QUARTER, 0] for d, s in zip(
        (0.34, 0, 0.4, 0, 0.4, 0, 0.126), (-1, 1, 1, -1, -1, 1, 0), strict=True
    )]
)  # fmt: skip
GANTRY = Chain(
    [
        [0, 0, 0, -QUARTER, 0], [QUARTER, 0, 0, QUARTER, 0], [0, 0, 0, 0, 0],
        [0, 0.1, 0, -QUARTER, 0], [0, 0, 0, QUARTER, 0], [0, 0.07, 0, 0, 0],
    ],
    ("prismatic",) * 3 + ("revolute",) * 3,
)  # fmt: skip
ARMS = {"six turns": TX60, "seven turns": SEVEN, "three slides": GANTRY}
WIDE = np.radians(170)
ROUNDING = 1e-12
"""Poses of arms of one metre carry 1e-15; singular postures of the sample multiply it by 100."""


def limits_of(chain):
    return np.where(chain.prismatic[:, None] > 0, [-0.5, 0.5], [-WIDE, WIDE])


def wrong(chain, rng):
    """A model of the arm with errors of its geometry and, large ones, of its joints."""
    step = rng.normal(size=chain.n_numbers) * 3e-4
    terms = (*gravity_terms(chain.n_joints), *harmonic_terms(chain.n_joints))
    errors = JointErrors(terms, rng.normal(size=len(terms)) * 5e-3)
    return RobotModel(chain.moved(step), errors)


def apart(T, other):
    turn = log_so3(np.swapaxes(T[:, :3, :3], 1, 2) @ other[:, :3, :3])
    return max(np.abs(T[:, :3, 3] - other[:, :3, 3]).max(), np.abs(turn).max())


@pytest.mark.parametrize("name", ARMS)
def test_the_pose_comes_back_to_rounding_with_joint_errors_too(name):
    chain, rng = ARMS[name], np.random.default_rng(4)
    model, limits = wrong(chain, rng), limits_of(ARMS[name])
    q = spread(0.9 * limits, 100)
    found = inverse_kinematics(model, model.poses(q), q + rng.normal(size=q.shape) * 0.02, limits)
    reached = found.reached
    assert reached.mean() > 0.95  # the rest stand where the arm folds or stretches
    assert apart(model.poses(found.q)[reached], model.poses(q)[reached]) < ROUNDING
    assert {one for one, ok in zip(found.status, reached, strict=True) if ok} <= {
        "reached", "singular",
    }  # fmt: skip


@pytest.mark.parametrize("name", ARMS)
def test_the_derivative_by_the_joints_is_that_of_central_differences(name):
    chain = ARMS[name]
    model, q = wrong(chain, np.random.default_rng(5)), spread(limits_of(chain), 20)
    expected = slopes(model.poses, q, 1e-5, minus=twist)
    # h^2 / 6 of the third derivative
    np.testing.assert_allclose(joint_jacobian(model, q)[1], expected, atol=1e-9)


def test_any_pose_of_the_arm_is_found_from_evenly_spread_starts():
    model, limits = RobotModel(TX60), limits_of(TX60)
    q = spread(limits, 130)[100:]
    starts = np.broadcast_to(spread(limits, 24), (len(q), 24, 6))
    found = inverse_kinematics(model, model.poses(q), starts, limits)
    assert found.reached.all()
    assert apart(model.poses(found.q), model.poses(q)) < ROUNDING
    # of several postures the one nearest to the first start: more starts never give a farther one
    few = inverse_kinematics(model, model.poses(q), starts[:, :12], limits)
    away, before = (np.linalg.norm(one.q - starts[:, 0], axis=1) for one in (found, few))
    plain = np.array([one == "reached" for one in few.status])
    assert plain.sum() > 20
    assert (away[plain] <= before[plain] + 1e-9).all()
    assert (away[plain] < before[plain] - 0.1).any()


def test_a_seven_axis_arm_moves_as_little_as_a_constrained_optimizer_finds():
    model, limits, rng = RobotModel(SEVEN), limits_of(SEVEN), np.random.default_rng(6)
    seeds = np.array([[0.3, 0.7, -0.4, 1.2, 0.5, -0.8, 0.2], [-1, 0.5, 0.3, -1.1, 0.2, 0.9, 1]])
    T = model.poses(seeds + rng.normal(size=seeds.shape) * 0.1)
    found = inverse_kinematics(model, T, seeds, limits)
    assert found.status == ("reached", "reached")
    _, J = joint_jacobian(model, found.q)
    for k, seed in enumerate(seeds):
        free = np.linalg.svd(J[k])[2][6]
        assert abs(free @ (found.q[k] - seed)) < 1e-10  # nothing is moved that need not

        def off(x, k=k):
            here = model.poses(x[None])[0]
            turn = log_so3(T[k, :3, :3] @ here[:3, :3].T)
            return np.concatenate([T[k, :3, 3] - here[:3, 3], turn])

        least = optimize.minimize(
            lambda x, s=seed: ((x - s) ** 2).sum(), seed, constraints={"type": "eq", "fun": off},
            method="SLSQP", options={"ftol": 1e-15, "maxiter": 300},
        )  # fmt: skip
        np.testing.assert_allclose(found.q[k], least.x, atol=1e-5)


def test_limits_hold_and_a_pose_beyond_them_is_said_to_be_beyond_them():
    model, q = RobotModel(TX60), np.array([[0.5, 0.4, 0.9, 0.3, 0.8, 1.2]])
    T = model.poses(q)
    tight = q[0, :, None] + [-0.2, 0.2]
    tight[2] = q[0, 2] + np.array([-0.3, -0.1])
    found = inverse_kinematics(model, T, q, tight)
    assert found.status == ("limits",)
    assert ((found.q >= tight[:, 0]) & (found.q <= tight[:, 1])).all()
    assert found.q[0, 2] == pytest.approx(tight[2, 1])

    def off(x):
        here = model.poses(x[None])[0]
        turn = log_so3(T[0, :3, :3] @ here[:3, :3].T)
        return np.concatenate([T[0, :3, 3] - here[:3, 3], 0.3 * turn])

    nearest = optimize.least_squares(off, found.q[0] - 1e-3, bounds=tight.T)
    cost = found.position_error[0] ** 2 + (0.3 * found.rotation_error[0]) ** 2
    assert cost == pytest.approx(2 * nearest.cost, rel=1e-5)


def test_a_joint_may_come_back_by_a_whole_turn_only_if_it_is_allowed_to():
    model = RobotModel(TX60)
    limits = np.array([[-4.0, 4.0]] * 6)
    q = np.array([[0.2, 0.4, 0.9, 0.3, 0.8, 4.1 - 2 * np.pi]])
    seed = q + np.array([0, 0, 0, 0, 0, 2 * np.pi - 0.2])
    found = inverse_kinematics(model, model.poses(q), seed, limits)
    assert found.status == ("reached",)
    np.testing.assert_allclose(found.q, q, atol=1e-9)
    held = inverse_kinematics(model, model.poses(q), seed, limits, whole_turns=False)
    assert held.status == ("limits",)


def test_a_seed_a_hair_beyond_its_limit_is_taken_there_and_not_at_the_other_end():
    """Ranges of less than a turn, of a whole one, and of one and a half."""
    model, hair = RobotModel(TX60), 1e-3
    q = np.concatenate([spread(0.8 * TX60_LIMITS, 12)] * 6)
    joint, side = np.repeat(np.arange(6), 12), np.tile([0, 1], 36)
    rows, end = np.arange(72), TX60_LIMITS[joint, side]
    outward = 2 * side - 1
    q[rows, joint] = end - hair * outward
    seeds = q.copy()
    seeds[rows, joint] = end + hair * outward
    found = inverse_kinematics(model, model.poses(q), seeds, TX60_LIMITS)
    assert found.reached.all()
    np.testing.assert_allclose(found.q, q, atol=1e-6)  # some stand where the arm is stretched
    # and where the target lies beyond the limit itself, as far as that goes
    short = joint == 2
    held = inverse_kinematics(model, model.poses(seeds[short]), seeds[short], TX60_LIMITS)
    assert set(held.status) == {"limits"}
    np.testing.assert_allclose(held.q[:, 2], end[short])


def test_a_seed_beyond_its_limits_is_compared_without_its_whole_turns():
    """Of all postures that several starts find the one that the seed means, not its mirror."""
    model = RobotModel(TX60)
    q = np.radians([[-175.0, 30, 60, 20, 50, 0]])
    seed = q + 2 * np.pi * np.eye(6)[0]
    starts = np.concatenate([seed, spread(TX60_LIMITS, 24)])[None]
    found = inverse_kinematics(model, model.poses(q), starts, TX60_LIMITS)
    np.testing.assert_allclose(found.q, q, atol=1e-9)


def test_a_target_out_of_reach_says_how_near_the_tool_came():
    model, limits = RobotModel(TX60), limits_of(TX60)
    T = (slide(0, 0.02, 0.9))[None]  # the candle is 0.67 m high, and looks up like this
    found = inverse_kinematics(model, T, [[0, 0.1, 0.1, 0, 0.1, 0]], limits)
    assert found.status == ("out of reach",)
    assert found.position_error[0] == pytest.approx(0.23, abs=2e-4)  # singular: slow at the end


def test_what_no_stretched_arm_reaches_is_searched_for_once_and_ends_as_if_it_were_again(
    monkeypatch,
):
    """Its first target is within reach; each further search takes a hundred steps to say no."""
    searched, search = [], inverse.search

    def counted(task, *further, **named):
        searched.append(len(task.T))
        return search(task, *further, **named)

    monkeypatch.setattr(inverse, "search", counted)
    monkeypatch.setattr(inverse_search, "search", counted)
    model = RobotModel(TX60)
    T = np.concatenate([model.poses([[0.2, 0.3, 1.0, 0, 0.5, 0]]), slide(0.3, 0.2, 1.5)[None]])
    seeds = np.tile([0, 0.1, 0.1, 0, 0.1, 0], (2, 1))
    found = inverse_kinematics(model, T, seeds, TX60_LIMITS)
    assert found.status == ("reached", "out of reach")
    assert searched == [2]
    monkeypatch.setattr(inverse, "SPARE", 100.0)
    again = inverse_kinematics(model, T, seeds, TX60_LIMITS)
    assert len(searched) > 2
    assert again.status == found.status
    np.testing.assert_array_equal(again.q, found.q)


def test_no_posture_lies_too_far_and_a_tenth_beyond_a_stretched_arm_everything_does():
    """Two links of 0.4 and 0.3 m and a tool of 0.2 m, on a base that stands elsewhere."""
    links = np.array([[0, 0, 0.4, 0, 0], [0, 0, 0.3, 0, 0]])
    chain = Chain(links, T_world_base=slide(5, -3, 1), T_flange_tool=slide(0.2, 0, 0))
    away = np.array([0.9, 0.98, 1.0])
    T = np.stack([slide(5 + far, -3, 1) for far in away])
    np.testing.assert_array_equal(inverse._too_far(RobotModel(chain), T), away > 1.1 * 0.9)
    driven = replace(chain, kinds=("prismatic", "revolute"))
    assert not inverse._too_far(RobotModel(driven), T).any()


def test_singular_postures_are_reached_and_named():
    model, limits = RobotModel(TX60), limits_of(TX60)
    q = np.array([[0.4, 0.6, 0.8, 0.3, 0.0, -0.2]])  # axes 4 and 6 in line
    found = inverse_kinematics(model, model.poses(q), q + 1e-3, limits)
    assert found.status == ("singular",)
    assert found.reached.all()
    assert found.condition[0] > 1e4


def test_an_arm_of_few_joints_ends_at_the_nearest_of_its_poses():
    model = RobotModel(Chain([[0, 0, 0.3, 0, 0], [0, 0, 0.2, 0, 0]]))
    limits = [[-3, 3], [-3, 3]]
    T = model.poses([[0.4, 0.8]])
    found = inverse_kinematics(model, T, [[0.2, 0.9]], limits)
    np.testing.assert_allclose(found.q, [[0.4, 0.8]], atol=1e-12)
    tilted = inverse_kinematics(model, T @ rot_y(0.01), [[0.2, 0.9]], limits)
    assert tilted.status == ("out of reach",)
    assert tilted.rotation_error[0] == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize(
    ("seeds", "limits", "said"),
    [
        (np.zeros((2, 6)), limits_of(TX60), "seeds has shape"),
        (np.zeros((1, 5)), limits_of(TX60), "seeds has shape"),
        (np.zeros((1, 6)), np.tile([1, -1], (6, 1)), "lower limit above its upper one"),
        (np.full((1, 6), np.nan), limits_of(TX60), "is nan"),
        (np.zeros((1, 0, 6)), limits_of(TX60), "at least one for each target"),
    ],
)
def test_bad_input_is_named(seeds, limits, said):
    with pytest.raises(InputError, match=said):
        inverse_kinematics(RobotModel(TX60), np.eye(4)[None], seeds, limits)


@pytest.mark.parametrize("spoiled", ["transposed", "scaled", "mirrored"])
def test_a_target_that_is_no_transform_is_refused_instead_of_out_of_reach(spoiled):
    model, q = RobotModel(TX60), np.full((1, 6), 0.3)
    T = model.poses(q)
    if spoiled == "transposed":
        T = T.swapaxes(1, 2)
    elif spoiled == "scaled":
        T = np.concatenate([2 * T[:, :3], T[:, 3:]], axis=1)
    else:
        T = T * [1, 1, -1, 1]
    with pytest.raises(InputError, match=r"T\[0\]"):
        inverse_kinematics(model, T, q, limits_of(TX60))


def test_a_target_with_few_digits_is_reached_at_the_rotation_that_they_mean():
    model, q = RobotModel(TX60), np.full((1, 6), 0.3)
    found = inverse_kinematics(model, model.poses(q).round(5), q, limits_of(TX60))
    assert found.status == ("reached",)
    # half of the last digit, in some directions more
    np.testing.assert_allclose(found.q, q, atol=2e-4)

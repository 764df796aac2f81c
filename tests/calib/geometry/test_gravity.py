"""Torques of gravity of any chain: slopes of the potential energy, and what they can tell."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import InputError
from calib.geometry.bodies import bodies
from calib.geometry.chain import BATCH, Chain, forward
from calib.geometry.gravity import Weight, gravity_regressor, guessed_moments, moments_of
from tests.calib.geometry.bent import composed_bodies, random_arm
from tests.calib.kinds import ARMS
from tests.reference import TX60_LIMITS, tx60

TX60 = tx60().chain
ANYWHERE = np.random.default_rng(0).uniform(-3, 3, (100, 7))


def random_moments(rng: np.random.Generator, n: int) -> Array:
    return moments_of(rng.uniform(1, 10, n), rng.normal(0, 0.2, (n, 3)))


def energy(chain: Chain, q: Array, bends: Array, moments: Array, gravity: Array) -> Array:
    """Potential energy of all bodies at one pose, payload last [J]; also if bends are complex."""
    down = chain.T_world_base[:3, :3] @ gravity
    frames = composed_bodies(chain, q, bends)
    places = moments[:, :1] * frames[:, :3, 3]
    places = places + (frames[:, :3, :3] @ moments[:, 1:, None])[..., 0]
    return -(places @ down).sum()


@pytest.mark.parametrize("seed", range(4))
def test_torques_are_slopes_of_the_potential_energy(seed):
    """By complex step: no subtraction, so the two agree to rounding."""
    rng = np.random.default_rng(seed)
    chain, gravity, h = random_arm(rng), rng.normal(size=3) * 5, 1e-30
    moments, payload = random_moments(rng, 6), random_moments(rng, 1)[0]
    q, bends = rng.uniform(-2, 2, (5, 6)), rng.normal(0, 0.2, (5, 6, 3))
    weight = Weight(chain, moments, payload, gravity)
    for bent in (np.zeros_like(bends), bends):
        found = weight.torques(q, bends=bent)
        judge = np.empty_like(found)
        for row in range(5):
            for k in range(18):
                step = 1j * h * np.eye(18)[k].reshape(6, 3)
                up = energy(chain, q[row], bent[row] + step, np.vstack([moments, payload]), gravity)
                judge[row].ravel()[k] = -up.imag / h
        # two dozen products of numbers of order ten: some tens of rounding errors
        assert np.abs(found - judge).max() <= 1e-13 * np.abs(judge).max()
    assert np.array_equal(weight.torques(q), weight.torques(q, bends=np.zeros_like(bends)))


def test_bodies_are_the_composed_ones_and_the_flange_is_that_of_forward_to_the_bit():
    rng = np.random.default_rng(1)
    chain = random_arm(rng)
    q, bends = rng.uniform(-2, 2, (20, 6)), rng.normal(0, 0.3, (20, 6, 3))
    at = bodies(chain, q, bends)
    for row in range(20):
        judge = composed_bodies(chain, q[row], bends[row])
        assert np.abs(at.rotation[row] - judge[:, :3, :3]).max() < 1e-14
        assert np.abs(at.origin[row] - judge[:, :3, 3]).max() < 1e-13
    bare = replace(chain, T_flange_tool=np.eye(4))
    for still in (None, np.zeros_like(bends)):
        flange, T = bodies(chain, q, still), forward(bare, q)
        assert np.array_equal(flange.rotation[:, -1], T[:, :3, :3])
        assert np.array_equal(flange.origin[:, -1], T[:, :3, 3])


def test_where_the_base_stands_and_what_tool_it_carries_play_no_part():
    rng = np.random.default_rng(2)
    chain, q = random_arm(rng), rng.uniform(-2, 2, (10, 6))
    bare = replace(chain, T_world_base=np.eye(4), T_flange_tool=np.eye(4))
    here, there = gravity_regressor(chain, q), gravity_regressor(bare, q)
    assert np.abs(here - there).max() < 1e-13 * np.abs(here).max()


def test_a_link_hanging_level_pulls_by_its_weight_times_its_reach():
    level = Chain([[0, 0, 0, np.pi / 2, 0], [0, 0, 0.5, 0, 0]])
    weight = Weight(level, moments_of([3.0, 2.0], [[0, 0, 0], [0.25, 0, 0]]), [1, 0, 0, 0])
    tau = weight.torques([[0.3, 0.0], [0.3, np.pi / 2]])
    # about z of joint 2: 2 kg at 0.25 m and 1 kg at 0.5 m, droop is against the turn; up: nothing
    assert tau[:, 1, 2] == pytest.approx([-9.81, 0.0], abs=1e-14)
    # joint 1 stands upright: gravity never turns it, but bends it across
    assert tau[:, 0, 2] == pytest.approx([0.0, 0.0], abs=1e-14)
    assert np.abs(tau[0, 0]).max() == pytest.approx(9.81)


def test_a_slide_feels_the_weight_beyond_it_along_its_axis():
    lift = Chain([[0, 0, 0, 0, 0], [0, 0, 0.4, 0, 0]], ("prismatic", "revolute"))
    tau = Weight(lift, moments_of([3.0, 2.0], np.zeros((2, 3)))).torques([[0.2, 0.1]])
    assert tau[0, 0, 2] == pytest.approx(-5 * 9.81)


def test_a_payload_per_pose_is_that_payload_of_an_arm():
    rng = np.random.default_rng(3)
    chain, q, loads = random_arm(rng), rng.uniform(-2, 2, (4, 6)), random_moments(rng, 4)
    weight = Weight(chain, random_moments(rng, 6))
    together = weight.torques(q, payload=loads)
    for k, load in enumerate(loads):
        alone = replace(weight, payload=load).torques(q[k : k + 1])[0]
        assert together[k] == pytest.approx(alone, abs=1e-13)


def test_batches_do_not_change_the_numbers():
    q = np.random.default_rng(4).uniform(*TX60_LIMITS.T, (BATCH, 6))
    twice = gravity_regressor(TX60, np.vstack([q, q[:7]]), bends=np.full((BATCH + 7, 6, 3), 1e-3))
    assert np.array_equal(twice[BATCH:], twice[:7])


@pytest.mark.parametrize(
    ("arm", "joints", "everything"), [("tx60", 10, 17), ("ur10", 10, 17), ("iiwa", 12, 20)]
)
def test_as_many_combinations_of_moments_are_felt_as_is_known_of_the_arm(arm, joints, everything):
    chain = ARMS[arm]
    q = ANYWHERE[:, : chain.n_joints]
    G = gravity_regressor(chain, q)[..., :-1, :]
    for part, rank in ((G[:, :, 2:], joints), (G, everything)):
        columns = part.reshape(-1, 4 * chain.n_joints)
        size = np.linalg.norm(columns, axis=0)
        live = size > 1e-9 * size.max()
        sigma = np.linalg.svd(columns[:, live] / size[live], compute_uv=False)
        # the weakest direction is 1e-2 of the strongest, rounding 1e-15
        assert rank == (sigma > 1e-9 * sigma[0]).sum()


def test_guessed_moments_weigh_by_the_reach_beyond_and_lie_halfway():
    guess = guessed_moments(TX60)
    assert guess.shape == (6, 4)
    assert (np.diff(guess[:, 0]) < 0).all()
    # link 2 reaches 290 mm along x, link 4 310 mm along z
    assert guess[1, 1] / guess[1, 0] == pytest.approx(0.145)
    assert guess[3, 3] / guess[3, 0] == pytest.approx(0.155)
    assert guess[-1, 0] == pytest.approx(10 * (0.07 + 0.05))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Weight(TX60, np.zeros((5, 4))), r"moments has shape \(5, 4\)"),
        (lambda: Weight(TX60, -np.ones((6, 4))), "moments has a mass of -1; .*0 kg or more"),
        (lambda: Weight(TX60, np.zeros((6, 4)), [-2, 0, 0, 0]), "payload has a mass of -2"),
        (lambda: Weight(TX60, np.zeros((6, 4)), gravity=[0, 0]), r"gravity has shape \(2,\)"),
        (lambda: moments_of([1.0], np.zeros((2, 3))), r"centers has shape \(2, 3\)"),
        (lambda: gravity_regressor(TX60, np.zeros((1, 5))), "the joints of the chain"),
    ],
)
def test_weights_that_make_no_sense_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()

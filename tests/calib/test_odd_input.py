"""What people hand in that is odd: it is read as they mean it, or refused in a sentence."""

from dataclasses import replace

import numpy as np
import pytest

import calib
from calib.design import Problem, best_next, detmax
from calib.design.pose_count import stable_count
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.operating import OperatingConditions, joined_conditions
from calib.geometry.parameters import parameters_of
from calib.identification.joint_models import extended_parameters
from calib.identification.prior import Prior, weak_prior
from calib.measurement.iso_memory import cycle_memory
from calib.measurement.iso_straying import long_tails
from calib.measurement.noise import whiteners
from calib.uncertainty.parallel import in_batches
from calib.uncertainty.regions import inside
from calib.uncertainty.validation import first_order
from tests.calib import kinds
from tests.calib.design.design_cases import turned_pool

NOISE = (20e-6, 1e-4)


def arm(reflector=(0.1, 0.02, 0.05)):
    return calib.RobotModel(kinds.ARMS["tx60"], fixtures=Fixtures(reflectors=[reflector]))


def joints(rows, seed=0):
    return kinds.joints("tx60", np.random.default_rng(seed), rows)


def test_a_prior_is_about_the_model_that_was_handed_in_not_about_what_was_found():
    """The reflector is 2 mm off; a belief of 1 um in its drawing holds it where that says."""
    q, rng = joints(60), np.random.default_rng(1)
    T = arm().poses(q)
    seen = T[:, :3, 3] + T[:, :3, :3] @ [0.102, 0.02, 0.05]
    table = calib.points(q, seen + 20e-6 * rng.normal(size=seen.shape), sd=20e-6, reflector=0)
    names = ("reflector1.x", "reflector1.y", "reflector1.z")
    held = calib.calibrate(arm(), table, prior=Prior(np.zeros(3), np.full(3, 1e-6), names))
    assert np.abs(held.model.fixtures.reflectors[0] - [0.1, 0.02, 0.05]).max() < 5e-6
    right = Prior([2e-3, 0.0, 0.0], np.full(3, 1e-6), names)
    told = calib.calibrate(arm(), table, prior=right)
    assert np.abs(told.model.fixtures.reflectors[0] - [0.102, 0.02, 0.05]).max() < 5e-6
    # the link of the last joint takes up what either leaves: both explain the readings
    assert 1e-3 < told.identification.p_value < 0.999
    assert 1e-3 < held.identification.p_value < 0.999


def test_a_prior_of_a_frame_that_stands_elsewhere_is_refused():
    turned = kinds.ARMS["tx60"]
    base = np.eye(4)
    base[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    there = calib.RobotModel(replace(turned, T_world_base=base))
    q = joints(40)
    table = calib.poses(q, there.poses(q), sd=NOISE)
    belief = Prior(np.zeros(1), np.full(1, 1e-3), ("base.x",))
    with pytest.raises(
        InputError, match=r"the prior names base\.x, and the measurements show that"
    ):
        calib.calibrate(calib.RobotModel(turned), table, prior=belief)


def test_a_start_moves_no_number_that_is_held():
    nominal = calib.RobotModel(kinds.ARMS["tx60"])
    q = joints(40)
    table = calib.poses(q, nominal.poses(q), sd=NOISE)
    step = np.zeros(nominal.n_numbers)
    step[nominal.names.index("theta4")] = 5e-3
    found = calib.identify(
        nominal, table, parameters_of(nominal, ["a3"]), start=nominal.moved(step)
    )
    assert found.model.chain.links[3, 0] == nominal.chain.links[3, 0]
    assert found.p_value > 0.99


def test_tables_that_were_numbered_each_by_itself_are_joined_pose_by_pose():
    nominal = calib.RobotModel(kinds.ARMS["tx60"])
    q, other = joints(30), joints(30, seed=1)
    order = np.random.default_rng(2).permutation(30)
    one, again = (calib.poses(each, nominal.poses(each), sd=NOISE) for each in (q, q[order]))
    both = calib.joined([one, again])
    assert both.n_poses == 30
    assert len(np.unique(both.together)) == 30
    train, test = both.split(held_out=10)
    assert (len(train), len(test)) == (40, 20)
    apart = calib.joined([one, calib.poses(other, nominal.poses(other), sd=NOISE)])
    assert apart.n_poses == 60
    # numbers that were given and fit, those of joints read back among them, stay as they are
    numbered = replace(one, pose_id=100 + np.arange(30))
    back = replace(numbered, q=q + 1e-4, repeat=np.ones(30, dtype=int))
    assert calib.joined([numbered, back]).pose_id.tolist() == 2 * list(range(100, 130))


@pytest.mark.parametrize("free", [["tool.rx"], ["tool.rx", "tool.ry"]])
def test_free_numbers_that_nothing_tells_are_refused(free):
    nominal = calib.RobotModel(kinds.ARMS["tx60"])
    q = joints(40)
    table = calib.points(q, nominal.poses(q)[:, :3, 3], sd=20e-6)
    with pytest.raises(InputError, match="the measurements tell none of the free numbers: tool"):
        calib.identify(nominal, table, parameters_of(nominal, free))


def test_a_summary_of_fewer_rows_than_a_degree_of_freedom_is_written():
    nominal = calib.RobotModel(kinds.ARMS["tx60"])
    q = joints(1)
    table = calib.poses(q, nominal.poses(q), sd=NOISE)
    free = parameters_of(nominal)
    found = calib.identify(nominal, table, free, prior=weak_prior(free, nominal))
    assert found.dof == 0
    assert "for 0 degrees of freedom, p = " in found.summary()


def test_a_payload_without_a_center_hangs_at_the_flange_whatever_others_state():
    plain = OperatingConditions(payload=np.full(2, 3.0))
    stated = OperatingConditions(payload=np.full(2, 2.0), center=np.full((2, 3), 0.1))
    both = joined_conditions([plain, stated, OperatingConditions()], [2, 2, 1])
    np.testing.assert_array_equal(both.rows(slice(0, 2)).moments, plain.moments)
    np.testing.assert_array_equal(both.rows(slice(2, 4)).moments, stated.moments)
    assert both.payload[4] == 2.5  # who says nothing carries what is usual


def singular():
    """Two directions that scatter as one, to rounding."""
    C = np.tile(1e-10 * np.eye(6), (1, 1, 1))
    C[0, 0, 1] = C[0, 1, 0] = 1e-10 * (1 - 1e-14)
    return C


def unspawned():
    """Numbers of the kind that numpy drew before it had independent streams."""
    return np.random.Generator(np.random.RandomState(0)._bit_generator)


POSES = calib.poses(joints(4), calib.RobotModel(kinds.ARMS["tx60"]).poses(joints(4)), sd=NOISE)
FREE = parameters_of(calib.RobotModel(kinds.ARMS["tx60"]))
REFUSED = {
    "a prior of a number that there is not": (
        lambda: calib.calibrate(arm(), POSES, prior=Prior([0.0], [1.0], ["a9"])), "A4",
        'the prior names "a9", which the model does not have',
    ),
    "a step to another arm": (
        lambda: arm().step_to(calib.RobotModel(kinds.ARMS["scara"])), "A3",
        "chains differ in their joints",
    ),
    "a kind of row that there is not": (
        lambda: replace(POSES, kind=np.full(4, "line")), "A3", "expected 4 entries, each",
    ),
    "a mode that there is not": (
        lambda: calib.identify(arm(), POSES, FREE, mode="weighted"), "A3", "whitened, paper",
    ),
    "a loss that there is not": (
        lambda: calib.identify(arm(), POSES, FREE, loss="l1"), "A3", "squared, huber, cauchy",
    ),
    "one name for several": (lambda: FREE.freeing("a1"), "A3", "give a list: ['a1']"),
    "a scale below zero": (lambda: replace(FREE, scale=-FREE.scale), "A3", "must be positive"),
    "a covariance that is singular to rounding": (
        lambda: whiteners(singular()), "M34", "covariance[0] is not positive definite",
    ),
    "fewer covariances than errors": (
        lambda: inside(np.zeros((3, 2)), np.tile(np.eye(2), (2, 1, 1))), "A1", "one for each error",
    ),
    "a function of no inputs": (
        lambda: first_order(lambda x: x, [], np.zeros((0, 0))), "A1", "there are no inputs",
    ),
    "a function that loses rows": (
        lambda: first_order(lambda x: x[:1], [1.0], np.eye(1)), "A1", "each of 5 rows",
    ),
    "one pose for several": (lambda: cycle_memory(np.zeros((9, 3))), "A3", "(e, n, 3) positions"),
    "one pose for several, of tails": (
        lambda: long_tails(np.zeros((9, 3))), "A3", "(e, n, 3) positions",
    ),
    "fewer means than counts": (lambda: stable_count([3, 4], [1.0]), "A1", "one for each of count"),
    "streams that depend on each other": (
        lambda: in_batches(np.random.Generator.random, unspawned(), 9, size=3), "A3",
        "make it with numpy.random.default_rng(seed)",
    ),
    "a next pose where some are missing": (
        lambda: best_next(Problem.of_blocks(turned_pool(), 3, "D", given=[0])), "M28",
        "each next pose is as good as any; choose several poses at once",
    ),
    "a start that leaves a direction unseen": (
        lambda: detmax(
            Problem.of_blocks(turned_pool(), 2, "D"), np.random.default_rng(0), start=[0, 1]
        ), "M28", "start leaves a direction unseen; start elsewhere",
    ),
    "a model without terms to add": (
        lambda: extended_parameters(arm(), arm(), parameters_of(arm())), "A3",
        "no joint term to add",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("call", "code", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_used_is_refused_in_a_sentence(call, code, said):
    with pytest.raises(InputError) as caught:
        call()
    assert caught.value.code == code
    assert said in str(caught.value)


def test_measured_rotations_are_rotations():
    nominal = calib.RobotModel(kinds.ARMS["tx60"])
    q = joints(5)
    T = nominal.poses(q)
    rounded = calib.poses(q, np.round(T, 4), sd=NOISE)
    R = rounded.rotation
    assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < 1e-14
    assert np.abs(R - T[:, :3, :3]).max() < 1e-4
    assert calib.poses(q, T, sd=NOISE).rotation.tobytes() == T[:, :3, :3].tobytes()
    scaled, dropped, mirrored = T.copy(), T.copy(), T.copy()
    scaled[2, :3, :3] *= 1.03
    dropped[3, :3, :3] = 0.0
    mirrored[1, :3, 0] *= -1.0
    for wrong, sentence in (
        (scaled, r"T\[2\] has no rotation in it"),
        (dropped, r"T\[3\] has no rotation in it"),
        (mirrored, r"T\[1\] is left-handed"),
        (np.swapaxes(T, 1, 2), r"T\[0\] does not end in 0, 0, 0, 1"),
    ):
        with pytest.raises(InputError, match=sentence):
            calib.poses(q, wrong, sd=NOISE)

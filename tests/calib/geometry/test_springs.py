"""Springs under load: columns, rest as the lowest energy, and what a model with them answers."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.chain import Chain
from calib.geometry.felt_springs import Felt
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import exp_so3
from calib.geometry.gravity import DOWN, Weight, guessed_moments, moments_of
from calib.geometry.inverse import inverse_kinematics
from calib.geometry.inverse_search import joint_jacobian
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.geometry.springs import SprungJoints, across
from calib.identification.identify import Status, identify
from calib.measurement.tables import poses
from tests.calib.geometry.bent import random_arm
from tests.calib.geometry.test_gravity import energy, random_moments
from tests.calib.slopes import slopes, twist
from tests.reference import TX60_LIMITS, pool_r, tx60

TX60 = tx60().chain
ALL = np.random.default_rng(0).uniform(*TX60_LIMITS.T, (500, 6))
LEAN = (0.06, -0.04)
"""How the base leans [rad]."""
LEANING = Weight(
    TX60,
    guessed_moments(TX60),
    gravity=exp_so3(np.array([LEAN[0], 0, 0])) @ exp_so3(np.array([0, LEAN[1], 0])) @ DOWN,
)
PASSES = pytest.mark.parametrize("passes", [1, 3])


def sprung(
    rng: np.random.Generator, passes: int, *, bend: float = 0.02, free_moments: bool = True
) -> RobotModel:
    """A random arm with slides, waves, springs everywhere, tilts and a reflector."""
    chain = random_arm(rng)
    weight = Weight(
        chain.moved(rng.normal(size=42) * 1e-3),  # as a rule the springs know the nominal arm
        random_moments(rng, 6),
        random_moments(rng, 1)[0],
        rng.normal(size=3) * 5,
    )
    q = rng.uniform(-2, 2, (50, 6))
    springs, silent = Felt.of(weight, q, tilt=0.2).springs(free_moments=free_moments, passes=passes)
    assert not silent
    terms = harmonic_terms(6, (1,))
    numbers = rng.normal(0, bend, len(terms) + len(springs.names))
    errors = JointErrors(terms, numbers, springs)
    return RobotModel(chain, errors, Fixtures(rng.normal(size=(1, 3))))


@PASSES
def test_of_no_posture_there_is_no_pose(passes):
    """A table of distances alone has no row that is a point."""
    model = sprung(np.random.default_rng(0), passes)
    T, J = model.poses_and_jacobian(np.zeros((0, 6)))
    assert T.shape == (0, 4, 4)
    assert J.shape == (0, 6, model.n_numbers)


@PASSES
def test_every_column_is_the_derivative_of_the_pose(passes):
    rng = np.random.default_rng(passes)
    model, q = sprung(rng, passes), rng.uniform(-2, 2, (3, 6))
    T, J = model.poses_and_jacobian(q)
    assert np.array_equal(T, model.poses(q))
    assert J.shape == (3, 6, model.n_numbers) == (3, 6, len(model.names))
    some = range(0 if passes == 1 else 54, model.n_numbers)  # those of the chain once
    numeric = slopes(
        lambda step: model.moved(step).poses(q), np.zeros(model.n_numbers), 1e-5,
        by=some, minus=twist,
    )  # fmt: skip
    # differences: third derivatives of order 100 times h^2 / 6, rounding of 1e-14 m / h
    assert np.abs(J[:, :, some] - numeric).max() < 5e-9


@PASSES
def test_joint_columns_are_the_derivative_by_the_commanded_joint(passes):
    rng = np.random.default_rng(10 + passes)
    model, q = sprung(rng, passes), rng.uniform(-2, 2, (5, 6))
    bare = replace(model, joint_errors=replace(model.joint_errors, terms=(), coefficients=()))
    for one in (model, bare):
        numeric = slopes(one.poses, q, 1e-5, minus=twist)
        assert np.abs(joint_jacobian(one, q)[1] - numeric).max() < 5e-9  # as above


def test_at_rest_springs_carry_the_slope_of_the_potential_energy():
    """After many passes, by complex step: no other forces are left."""
    rng, h = np.random.default_rng(3), 1e-30
    model, q = sprung(rng, 40, bend=3e-3, free_moments=False), rng.uniform(-2, 2, (3, 6))
    springs = model.joint_errors.springs
    moments = np.vstack([springs.weight.moments, springs.weight.payload])
    numbers = model.joint_errors.of_springs
    bends, axes = springs.bends(q, numbers), across(springs.weight.gravity)
    gravity = springs.weight.gravity
    for axis, tilt in zip(axes[::-1], numbers[:-3:-1], strict=True):
        gravity = exp_so3(tilt * axis) @ gravity
    for row in range(3):
        for k in range(len(springs.load)):
            step = np.zeros((6, 3), dtype=complex)
            step[springs.joint[k], springs.axis[k]] = 1j * h
            pulled = energy(springs.weight.chain, q[row], bends[row] + step, moments, gravity)
            load = -pulled.imag / h
            here = bends[row, springs.joint[k], springs.axis[k]]
            # rounding of loads that are larger than the one of the spring
            assert here == pytest.approx(numbers[k] * load / springs.load[k], abs=1e-14)


@PASSES
def test_springs_that_give_nothing_leave_the_stiff_arm_to_the_bit(passes):
    rng = np.random.default_rng(4)
    model, q = sprung(rng, passes, bend=0.0), rng.uniform(-2, 2, (9, 6))
    stiff = replace(model, joint_errors=JointErrors(model.joint_errors.terms))
    assert np.array_equal(model.poses(q), stiff.poses(q))
    J, J0 = (one.poses_and_jacobian(q)[1] for one in (model, stiff))
    # rounding of some tens of products
    assert np.abs(J[:, :, :54] - J0[:, :, :54]).max() < 1e-12


def test_one_product_of_compliances_and_moments_is_free():
    rng = np.random.default_rng(5)
    model, q = sprung(rng, 1), rng.uniform(-2, 2, (5, 6))
    springs, numbers = model.joint_errors.springs, model.joint_errors.of_springs
    bare = replace(springs, weight=replace(springs.weight, payload=np.zeros(4)))
    twice, own = numbers.copy(), springs.weight.moments[springs.free]
    twice[:18] /= 2
    twice[18:-2] = 2 * (own + numbers[18:-2]) - own
    assert bare.bends(q, twice) == pytest.approx(bare.bends(q, numbers), abs=1e-15)


def test_numbers_are_named_and_come_back():
    rng = np.random.default_rng(6)
    model = sprung(rng, 1)
    names = model.names
    assert names[54:72] == tuple(f"spring{i + 1}.{axis}" for i in range(6) for axis in "xyz")
    assert "moment6.m" in names
    assert names[-5:-3] == ("tilt1", "tilt2")
    assert names[-3:] == ("reflector1.x", "reflector1.y", "reflector1.z")
    lengths = dict(zip(names, model.is_length, strict=True))
    assert len(names) == len(model.is_length) == model.n_numbers
    assert lengths["spring2.z"]  # a slide
    assert not lengths["spring2.x"]
    assert not lengths["spring1.z"]
    other = model.moved(rng.normal(size=model.n_numbers) * 1e-3)
    q = rng.uniform(-2, 2, (5, 6))
    assert model.moved(model.step_to(other)).poses(q) == pytest.approx(other.poses(q), abs=1e-13)


def tx60_springs(passes: int = 1) -> SprungJoints:
    return Felt.of(Weight(TX60, guessed_moments(TX60)), ALL).springs(passes=passes)[0]


def test_what_gravity_never_bends_is_said():
    weight = Weight(TX60, guessed_moments(TX60))
    springs, silent = Felt.of(weight, ALL).springs()
    # guessed centers of the wrist lie on axis 6, which is y of body 5
    wrist = ("joint 5 y: gravity never bends it", "joint 6 z: gravity never turns it")
    assert silent == ("joint 1 z: gravity never turns it", *wrist)
    assert len(springs.load) == 15
    assert springs.load == pytest.approx(
        np.abs(weight.torques(ALL)).max(axis=0)[springs.joint, springs.axis]
    )
    assert Felt.of(weight, ALL).springs(("z",))[0].names == tuple(
        f"spring{i}.z" for i in range(2, 6)
    )
    loaded = replace(weight, payload=(2.0, 0.04, 0.04, 0.1))
    assert Felt.of(loaded, ALL).springs()[1] == silent[:1]
    tilted = replace(weight, gravity=(3.0, 0.0, -9.0))
    assert Felt.of(tilted, ALL).springs()[1] == wrist
    leaning, silent = Felt.of(weight, ALL, tilt=0.02).springs()
    assert silent == wrist
    assert leaning.names[2] == "spring1.z"
    assert leaning.names[-2:] == ("tilt1", "tilt2")
    # a level slide, and a mast on it: nothing pulls along, everything bends
    level = Chain([[0, 0, 0, np.pi / 2, 0], [0, 0, 0.5, 0, 0]], ("revolute", "prismatic"))
    pulled = Weight(level, moments_of([1.0, 2.0], np.zeros((2, 3))))
    _, silent = Felt.of(pulled, np.random.default_rng(1).normal(size=(20, 2))).springs()
    assert "joint 1 z: gravity never turns it" in silent
    assert "joint 2 z: gravity never pulls along it" in silent


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (-9.81, 0, 0), (3.0, -4.0, 5.0), (0, 0, 0)])
def test_tilts_turn_gravity_about_two_axes_across_it(gravity):
    weight, tilt = Weight(TX60, guessed_moments(TX60), gravity=gravity), np.array([0.03, -0.05])
    axes = across(weight.gravity)
    assert axes @ axes.T == pytest.approx(np.eye(2), abs=1e-15)
    assert axes @ weight.gravity == pytest.approx([0, 0], abs=1e-14)
    if gravity == (0, 0, -9.81):
        assert axes == pytest.approx(np.eye(3)[:2], abs=1e-15)
    springs = SprungJoints(weight, [1, 3], [2, 0], [50.0, 9.0], np.zeros((6, 4)), 2, tilts=True)
    numbers, q = np.array([0.01, 0.02, *tilt]), pool_r(4)
    turned = exp_so3(tilt[0] * axes[0]) @ exp_so3(tilt[1] * axes[1]) @ gravity
    stated = replace(springs, weight=replace(weight, gravity=turned), tilts=False)
    assert springs.bends(q, numbers) == pytest.approx(stated.bends(q, numbers[:2]), abs=1e-15)


@PASSES
def test_a_pose_comes_back_through_the_springs(passes):
    springs, q = tx60_springs(passes), pool_r(20)
    numbers = np.random.default_rng(7).uniform(1e-4, 2e-3, len(springs.names))
    model = RobotModel(TX60, JointErrors(springs=springs, coefficients=numbers))
    T = model.poses(q)
    assert np.abs(T - tx60().poses(q)).max() > 1e-4
    found = inverse_kinematics(model, T, q + 1e-2, TX60_LIMITS)
    assert found.reached.all()
    assert found.q == pytest.approx(q, abs=1e-8)


def test_identification_finds_the_springs_and_says_which_act_alike():
    """Nothing else is needed: a model with springs is identified like any other."""
    springs, q, rng = tx60_springs(), pool_r(40), np.random.default_rng(8)
    nominal = RobotModel(TX60, JointErrors(springs=springs))
    alike = ("spring1.y", "spring2.y", "spring6.y")
    numbers = rng.uniform(1e-4, 1e-3, len(springs.names))
    numbers[[name in alike for name in springs.names]] = 0.0
    true = RobotModel(TX60, JointErrors(springs=springs, coefficients=numbers))
    table = poses(q, true.poses(q), sd=(1e-5, 1e-4))
    telling = parameters_of(nominal, [name for name in springs.names if name not in alike])
    found = identify(nominal, table, telling)
    assert found.status is Status.CONVERGED
    assert found.names == telling.free_names
    # poses are rounded to 1e-16 m of 0.5 m; the least telling spring is 260 times weaker
    assert found.model.joint_errors.coefficients == pytest.approx(numbers, abs=1e-12)
    # nor need it be known how the arm stands
    leaning = replace(true.joint_errors, springs=replace(springs, weight=LEANING))
    table = poses(q, replace(true, joint_errors=leaning).poses(q), sd=(1e-5, 1e-4))
    errors = JointErrors((), [*numbers / 2, 0.0, 0.0], replace(springs, tilts=True))
    free = RobotModel(TX60, errors)  # a stiff arm would not tell: its tilts have no columns yet
    found = identify(free, table, parameters_of(free, [*telling.free_names, "tilt1", "tilt2"]))
    # what a tilt moves is a twentieth of what a spring does
    assert found.model.joint_errors.coefficients == pytest.approx([*numbers, *LEAN], abs=1e-9)
    # about one point and one axis: the drive of joint 2 and the bearing of joint 1
    said = identify(nominal, table, parameters_of(nominal, springs.names)).reduction.sentences
    assert len(said) == len(alike)
    assert "any change of spring2.z looks like the same change of spring1.y" in " ".join(said)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axis": [3]}, r"axis is \[3\]; each 0 to 2"),
        ({"joint": [-1]}, r"joint is \[-1\]; each 0 to 5"),
        ({"joint": [1.5]}, r"joint\[0\] is 1\.5"),
        ({"joint": [1, 2]}, r"joint has shape \(2,\); one per load, 1"),
        ({"load": [0.0]}, "load must be positive; leave out springs that nothing loads"),
        ({"free": np.zeros((5, 4), bool)}, r"free has shape \(5, 4\)"),
        ({"joint": [1, 1], "axis": [2, 2], "load": [1.0, 1.0]}, "two springs about one axis"),
        ({"passes": 0}, "passes is 0; expected 1 or more"),
    ],
)
def test_springs_that_make_no_sense_are_refused(change, message):
    values = {"joint": [1], "axis": [2], "load": [10.0], "free": np.zeros((6, 4), bool)}
    with pytest.raises(InputError, match=message):
        SprungJoints(Weight(TX60, guessed_moments(TX60)), **(values | change))


def test_an_arm_that_nothing_bends_has_no_springs():
    weight = Weight(TX60, np.zeros((6, 4)))
    springs, silent = Felt.of(weight, ALL).springs(free_moments=True)
    assert len(silent) == 18
    assert springs.names == ()
    model, q = RobotModel(TX60, JointErrors(springs=springs)), pool_r(3)
    assert np.array_equal(model.poses(q), tx60().poses(q))
    assert model.poses_and_jacobian(q)[1].shape == (3, 6, 42)
    with pytest.raises(InputError, match='axes names "w"; x, y and z'):
        Felt.of(weight, ALL).springs(("w",))
    with pytest.raises(InputError, match="tilt is -1; expected 0 rad or more"):
        Felt.of(weight, ALL, tilt=-1.0).springs()


def test_who_asks_for_offsets_alone_is_told_of_the_springs():
    errors = JointErrors(springs=tx60_springs())
    with pytest.raises(InputError, match=r"have springs, .*take the poses from the robot model"):
        errors.offsets(pool_r(2))
    with pytest.raises(InputError, match="coefficients has 2 entries; one per term, 15"):
        replace(errors, coefficients=np.zeros(2))

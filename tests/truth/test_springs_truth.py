"""Springs of a robot model against arms that MuJoCo brings to rest: their shape, and their fit."""

from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array
from calib.geometry.felt_springs import Felt
from calib.geometry.frames import exp_so3
from calib.geometry.gravity import DOWN, Weight, guessed_moments, moments_of
from calib.geometry.joint_errors import JointErrors, harmonic_terms
from calib.geometry.model import RobotModel
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.geometry.springs import SprungJoints
from calib.identification.identify import Status, identify
from calib.identification.ladders import ladders_of
from calib.identification.levels import Ladder
from calib.identification.model_choice import ModelChoice, choose
from calib.identification.prior import Prior
from calib.information.sizes import weak_prior_sd
from calib.measurement.tables import poses as poses_of
from testbed.laboratory.truth.robot import TrueRobot, draw_truth
from testbed.laboratory.truth.springs import ElasticArm
from testbed.laboratory.truth.terms import Springs
from testbed.robots.catalog import load_robot
from testbed.store.codec import pack, unpack
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, tx60
from tests.testbed.laboratory.outcomes import HELD_OUT, POOL, best_set, robots, seen_of, settings

pytestmark = pytest.mark.truth
DRIVE = np.array([9e4, 9e4, 4e4, 1.2e4, 1e4, 6e3])
BEARING = np.array([6e5, 5e5, 3e5, 1e5, 8e4, 5e4])
"""Of the preset `elastic`, from base to tip [N m/rad]."""
ROUNDING = 1e-15
"""Of tool positions of arms of a meter [m]."""


def droops(arm: str, poses: int, share: float) -> tuple[Array, Array]:
    """Truth (m, 3), and by linear columns, one, two, three passes (4, m, 3) [m]."""
    robot, place = load_robot(arm), [0.0, 0.0, 0.05]
    n = len(robot.masses)
    along = (np.arange(n) * 5) // (n - 1)
    drive, bearing = DRIVE[along] / share, BEARING[along] / share
    q = np.random.default_rng(0).uniform(*robot.limits.T, (poses, n))
    sprung = Springs(
        robot.masses, robot.centers, robot.inertias, drive, bearing, 2.0, np.array(place)
    )
    true = ElasticArm(robot.model.chain, sprung).poses(q)[:, :3, 3]
    weight = Weight(
        robot.model.chain, moments_of(robot.masses, robot.centers), moments_of([2.0], [place])[0]
    )
    # all of them, also those that feel gravity only once others have bent
    joint, axis, every = np.repeat(range(n), 3), np.tile(range(3), n), np.ones(3 * n)
    springs = SprungJoints(weight, joint, axis, every, np.zeros((n, 4), dtype=bool))
    stiff, found = RobotModel(robot.model.chain, JointErrors(springs=springs)), []
    step = np.zeros(stiff.n_numbers)
    step[stiff.chain.n_numbers :] = 1 / np.stack([bearing, bearing, drive], axis=1).ravel()
    T, J = stiff.poses_and_jacobian(q)
    found.append(T[:, :3, 3] + J[:, :3] @ step)
    for passes in (1, 2, 3):
        errors = JointErrors(springs=replace(springs, passes=passes))
        found.append(replace(stiff, joint_errors=errors).moved(step).poses(q)[:, :3, 3])
    return true, np.array(found)


@pytest.mark.parametrize("poses", [25, pytest.param(150, marks=pytest.mark.study)])
@pytest.mark.parametrize("arm", ["staubli_tx60", "universal_ur10", "kuka_iiwa7"])
def test_each_pass_misses_by_one_more_power_of_the_compliance(arm, poses):
    """Halved compliance: a quarter by columns and one pass, then an eighth, then a sixteenth."""
    misses = []
    for share in (1.0, 0.5, 0.25, 0.125):
        true, found = droops(arm, poses, share)
        misses.append(np.linalg.norm(found - true, axis=2).max(axis=1))
    misses = np.array(misses)
    ratios = misses[:-1] / misses[1:]
    seen = misses[1:] > 100 * ROUNDING / 3  # rounding is then less than three parts in a hundred
    expected = np.broadcast_to([4.0, 4.0, 8.0, 16.0], ratios.shape)
    assert seen[:, :3].all()
    assert seen[0, 3]
    assert ratios[seen] == pytest.approx(expected[seen], rel=0.03)


def test_a_record_of_a_stiff_model_has_no_place_for_springs_and_of_others_keeps_them():
    robot = load_robot("staubli_tx60")
    flat = pack(robot.model)
    assert not [path for path in flat if "springs" in path]
    assert unpack(RobotModel, flat).joint_errors.springs is None
    weight = Weight(robot.model.chain, moments_of(robot.masses, robot.centers))
    drawn = np.random.default_rng(1).uniform(*robot.limits.T, (50, 6))
    springs, _ = Felt.of(weight, drawn).springs()
    numbers = np.linspace(1e-4, 1e-3, len(springs.names))
    sprung = RobotModel(robot.model.chain, JointErrors((), numbers, springs))
    back, q = unpack(RobotModel, pack(sprung)), HELD_OUT[:20]
    np.testing.assert_array_equal(back.poses(q), sprung.poses(q))
    assert back.names == sprung.names


ROBOT = load_robot("staubli_tx60")
EVERYWHERE = np.random.default_rng(0).uniform(*ROBOT.limits.T, (500, 6))
TARGETS = HELD_OUT[::3]
SAG, BEND = 50e-3 * DEG, 25e-3 * DEG
"""Prior sd of the bends at the largest torque [rad]."""


def arm(axes: str, masses: str, tilt: float = 0.0) -> tuple[RobotModel, Prior]:
    """Two waves a joint and springs: on stated masses, or with guessed moments that are free."""
    guessed = masses == "guessed"
    if not guessed:
        load = moments_of([2.0], [[0, 0, 0.05]])[0]
        weight = Weight(tx60().chain, moments_of(ROBOT.masses, ROBOT.centers), load)
    else:
        weight = Weight(tx60().chain, guessed_moments(tx60().chain))
    springs, _ = Felt.of(weight, EVERYWHERE, tilt=tilt).springs(tuple(axes), free_moments=guessed)
    model = RobotModel(tx60().chain, JointErrors(harmonic_terms(6), springs=springs))
    sd = weak_prior_sd(parameters_of(model), model)
    of_springs = sd[-len(springs.names) :]
    of_springs[: len(springs.load)] = np.where(springs.axis == 2, SAG, BEND)
    # half of each mass, at half the length of its link; on the last one also 2 kg of payload
    reach = np.maximum(np.hypot(*tx60().chain.links[:, 1:3].T), 0.1)[:, None]
    unsure = weight.moments[:, :1] * np.hstack([np.full((6, 1), 0.5), np.tile(reach, (1, 3)) / 4])
    unsure[-1] = np.hypot(unsure[-1], 2 * np.array([1, 0.1, 0.1, reach[-1, 0] + 0.1]))
    of_springs[len(springs.load) :] = [*unsure[springs.free], *(tilt,) * 2 * springs.tilts]
    return model, Prior(np.zeros(len(sd)), sd, model.names)


@pytest.mark.parametrize(
    ("axes", "masses", "poses", "count", "most"),
    [
        ("z", "guessed", 61, 1, 23.0),  # one robot: 19 um and more than twice the scatter
        pytest.param("z", "stated", 61, 20, 17.0, marks=pytest.mark.study),
        pytest.param("xyz", "stated", 61, 20, 17.0, marks=pytest.mark.study),
        pytest.param("z", "guessed", 61, 20, 19.0, marks=pytest.mark.study),
        pytest.param("xyz", "guessed", 61, 20, 19.0, marks=pytest.mark.study),
        pytest.param("z", "guessed", 150, 10, 12.3, marks=pytest.mark.study),
        pytest.param("xyz", "guessed", 150, 10, 11.5, marks=pytest.mark.study),
    ],
)
def test_springs_find_a_sprung_robot_without_knowing_its_masses(axes, masses, poses, count, most):
    """Mean error on held-out poses [um]: the geometric model leaves 260, two waves and sag 35."""
    model, prior = arm(axes, masses)
    errors = []
    for seed, true in robots("elastic", count):
        q = POOL[np.random.default_rng([seed, poses]).choice(len(POOL), poses, replace=False)]
        found = identify(model, seen_of(true, q, seed), parameters_of(model), prior=prior)
        # one product is held by the prior alone: some fits end at rounding, some 1e-6 sd away
        assert found.status in (Status.CONVERGED, Status.STALLED)
        off = found.model.poses(TARGETS)[:, :3, 3] - true.poses(TARGETS)[:, :3, 3]
        errors.append(1e6 * np.linalg.norm(off, axis=1).mean())
    assert np.mean(errors) <= most


@pytest.mark.parametrize("count", [1, pytest.param(5, marks=pytest.mark.study)])
def test_a_compliance_alone_stands_for_bearings_that_the_model_lacks(count):
    """Why none is told with a U: masses and payload as they are, one robot misses by 9 u.

    With bearings as well the larger of five robots is 3 u, all compliances together 0.7 u; with
    moments that are free single ones are 3 to 20 u off, and tilts of a base up to 5.
    """
    for axes, least, most in (("z", 5.0, 15.0), ("xyz", 0.0, 4.0)):
        model, prior = arm(axes, "stated")
        springs, farthest = model.joint_errors.springs, 0.0
        at = [model.names.index(name) for name in springs.names]
        for seed, true in robots("elastic", count):
            q = POOL[np.random.default_rng([seed, 61]).choice(len(POOL), 61, replace=False)]
            found = identify(model, seen_of(true, q, seed), parameters_of(model), prior=prior)
            of = true.unmodelled.springs
            stiff = np.where(springs.axis == 2, of.drive[springs.joint], of.bearing[springs.joint])
            off = found.model.joint_errors.of_springs - springs.load / stiff
            u = np.sqrt(np.diag(found.full_covariance))[at]
            farthest = max(farthest, np.abs(off / u).max())
        assert least <= farthest <= most


def test_how_an_arm_stands_is_found_from_how_it_sags():
    """A base that leans by six degrees nobody has told of: held upright, the fit leaves 31 um."""
    lean, (x, y) = np.radians([5.0, -3.5]), np.eye(3)[:2]
    gravity = exp_so3(lean[0] * x) @ exp_so3(lean[1] * y) @ DOWN
    sprung = draw_truth(ROBOT, settings("elastic"), 0).unmodelled.springs
    true = ElasticArm(tx60().chain, replace(sprung, gravity=gravity))
    model, prior = arm("xyz", "guessed", tilt=30 * DEG)
    rng = np.random.default_rng(1)
    q = POOL[rng.choice(len(POOL), 61, replace=False)]
    T = true.poses(q)
    T[:, :3, 3] += rng.normal(size=(61, 3)) * SIGMA_POSITION
    T[:, :3, :3] = exp_so3(rng.normal(size=(61, 3)) * SIGMA_ROTATION) @ T[:, :3, :3]
    table = poses_of(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))
    found = identify(model, table, parameters_of(model), prior=prior)
    off = found.model.poses(TARGETS)[:, :3, 3] - true.poses(TARGETS)[:, :3, 3]
    assert np.linalg.norm(off, axis=1).mean() < 23e-6  # as above
    tilts = [found.names.index(f"tilt{k}") for k in (1, 2)]
    u = found.standard_uncertainty[tilts]
    away = (found.model.joint_errors.of_springs[-2:] - lean) / u
    assert u.max() < 2 * DEG
    assert np.abs(away).max() < 3.3  # the larger of two normal numbers, once in a thousand


@pytest.mark.study
def test_payloads_that_rows_say_load_the_springs():
    """Half of 61 poses with 5 kg, judged at 2.5 kg, no mass of the arm known: mean error [um].

    Measured: 15.4 um; where no row says it 125.
    """
    errors = []
    for seed, true in robots("elastic", 10):
        q = POOL[np.random.default_rng([seed, 61]).choice(len(POOL), 61, replace=False)]
        load, center = np.resize([0.0, 5.0], 61), [0.0, 0.0, 0.05]
        T, rng = true.poses(q, payload=load), np.random.default_rng([seed, 5])
        T[:, :3, 3] += rng.normal(size=(61, 3)) * SIGMA_POSITION
        T[:, :3, :3] = exp_so3(rng.normal(size=(61, 3)) * SIGMA_ROTATION) @ T[:, :3, :3]
        silent = poses_of(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))
        there = true.poses(TARGETS, payload=np.full(len(TARGETS), 2.5))[:, :3, 3]
        for at in (OperatingConditions(load, np.tile(center, (61, 1))), AS_USUAL):
            ladders = ladders_of(tx60(), limits=ROBOT.limits, payload=at.usual_payload)
            table = replace(silent, conditions=at)
            model = choose(tx60(), table, ladders=ladders).identification.model
            off = model.poses(TARGETS)[:, :3, 3] - there  # unsaid there: the mean of 2.5 kg
            errors.append(1e6 * np.linalg.norm(off, axis=1).mean())
    said, unsaid = np.reshape(errors, (-1, 2)).mean(axis=0)
    assert said <= 19.0
    assert unsaid > 50


def leaning(seed: int, lean: float) -> TrueRobot:
    """A robot of the preset `elastic` on a base that leans in a direction of its own [rad]."""
    turn = np.random.default_rng([9, seed]).uniform(0, 2 * np.pi)
    gravity = exp_so3(lean * np.array([np.cos(turn), np.sin(turn), 0.0])) @ DOWN
    true = draw_truth(ROBOT, settings("elastic"), seed)
    sprung = replace(true.unmodelled.springs, gravity=gravity)
    return replace(true, unmodelled=replace(true.unmodelled, springs=sprung))


@pytest.mark.parametrize(
    ("lean", "seeds"), [(2.0, [0]), pytest.param(2.0, range(8), marks=pytest.mark.study)]
)
def test_a_base_that_leans_is_told_where_it_matters(lean, seeds):
    """Two degrees that nobody told of, no mass known, 150 poses: MuJoCo's arm, mean error [um].

    Measured on eight robots: 13.4 held upright, 12.1 with the tilts that are offered.
    """
    errors, taken = [], []
    for seed in seeds:
        true, both = leaning(seed, lean * DEG), ladders_of(tx60(), limits=ROBOT.limits)
        upright = tuple(level for level in both[0].levels if "tilted" not in level.name)
        for ladders in ((replace(both[0], levels=upright), both[1]), both):
            found = chosen(true, 150, seed, ladders)
            off = (
                found.identification.model.poses(TARGETS)[:, :3, 3] - true.poses(TARGETS)[:, :3, 3]
            )
            errors.append(1e6 * np.linalg.norm(off, axis=1).mean())
        taken.append("tilted" in found.climb.taken[0].name)
    held, told = np.reshape(errors, (-1, 2)).mean(axis=0)
    assert sum(taken) > 0.7 * len(seeds)
    assert told < 0.95 * held


@pytest.mark.study
def test_an_upright_arm_is_given_no_tilt():
    """Measured on none of twelve; a level that only refines one must be asked for beside it."""
    taken = [chosen(true, 61, seed).climb.taken[0].name for seed, true in robots("elastic", 12)]
    assert sum("tilted" in name for name in taken) <= 1


@pytest.mark.parametrize(
    ("preset", "poses", "count", "most"),
    [
        ("elastic", 61, 1, 23.0),  # one robot: 19 um and more than twice the scatter
        pytest.param("elastic", 61, 20, 19.0, marks=pytest.mark.study),
        pytest.param("elastic", 29, 20, 36.0, marks=pytest.mark.study),
        pytest.param("elastic", 150, 10, 11.5, marks=pytest.mark.study),
        pytest.param("wen2022", 61, 20, 15.0, marks=pytest.mark.study),
    ],
)
def test_the_model_that_is_chosen_bends_as_the_robot_does(preset, poses, count, most):
    """Mean error on held-out poses [um], no mass known; geometry leaves 260, and 75 of wen2022.

    Measured: 16.7, 29.8, 11.0 and 13.4 um.
    """
    errors = []
    for seed, true in robots(preset, count):
        choice = chosen(true, poses, seed)
        assert choice.chosen == "extended"
        off = choice.identification.model.poses(TARGETS)[:, :3, 3] - true.poses(TARGETS)[:, :3, 3]
        errors.append(1e6 * np.linalg.norm(off, axis=1).mean())
    assert np.mean(errors) <= most


@pytest.mark.parametrize(
    ("poses", "count"),
    [
        (61, 2),
        pytest.param(29, 24, marks=pytest.mark.study),
        pytest.param(61, 24, marks=pytest.mark.study),
    ],
)
def test_a_rigid_robot_is_given_no_springs(poses, count):
    """On less than a tenth of the robots anything beyond geometry, and nothing is lost by it [um].

    Measured: on none of 24, poses drawn at random or designed: 15.6 and 14.3 at 29, 10.2 and 9.0
    at 61.
    """
    for designed in (False, True)[: 1 + (count > 2)]:
        taken, errors = [], []
        for seed, true in robots("rigid", count):
            choice = chosen(true, poses, seed, designed=designed)
            taken.append(choice.chosen == "extended")
            there = true.poses(TARGETS)[:, :3, 3]
            errors.append(
                [
                    1e6 * np.linalg.norm(one.model.poses(TARGETS)[:, :3, 3] - there, axis=1).mean()
                    for one in (choice.identifications[0], choice.identification)
                ]
            )
        geometric, reached = np.mean(errors, axis=0)
        assert sum(taken) < 0.1 * count
        assert reached == pytest.approx(geometric, abs=1.0)


def chosen(
    true: TrueRobot,
    poses: int,
    seed: int,
    ladders: tuple[Ladder, ...] | None = None,
    *,
    designed: bool = False,
) -> ModelChoice:
    """The choice from so many poses of a robot, without a word of its masses."""
    rows = np.random.default_rng([seed, poses]).choice(len(POOL), poses, replace=False)
    q = POOL[best_set(poses) if designed else rows]
    ladders = ladders_of(tx60(), limits=ROBOT.limits) if ladders is None else ladders
    return choose(tx60(), seen_of(true, q, seed), parameters_of(tx60()), ladders=ladders)

"""The ladder of gravity: what it offers to which arm, and its springs against whole fits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from calib.geometry.chain import Chain
from calib.geometry.gravity import Weight, guessed_moments, moments_of
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climb import climb
from calib.identification.evidence.normal_equations import normal_equations
from calib.identification.evidence.spring_products import ModelSprings, settled
from calib.identification.identify import Status, identify
from calib.identification.joint_models import against_gravity
from calib.identification.ladders import ladders_of
from calib.identification.least_squares import solve
from calib.identification.levels import Level, joined, with_errors
from calib.identification.model_choice import choose, extended_by
from calib.identification.prior import weak_prior
from calib.information.sizes import SAG
from calib.measurement.tables import poses
from tests.calib import kinds
from tests.calib.slopes import slopes
from tests.reference import DEG, SIGMA_POSITION, SIGMA_ROTATION, TX60_LIMITS, pool_r, tx60

NOMINAL = tx60()
PARAMETERS = parameters_of(NOMINAL)
PRIOR = weak_prior(PARAMETERS)
POOL = pool_r(400)
SCARA = Chain(
    [[0, 0.4, 0.3, 0, 0], [0, 0, 0.25, np.pi, 0], [0, 0, 0, 0, 0], [0, 0.1, 0, 0, 0]],
    kinds=("revolute", "revolute", "prismatic", "revolute"),
)
POLAR = Chain(
    [[0, 0.4, 0, np.pi / 2, 0], [0, 0, 0, np.pi / 2, 0], [0, 0.5, 0, 0, 0]],
    kinds=("revolute", "revolute", "prismatic"),
)

IIWA = RobotModel(kinds.ARMS["iiwa"])
IIWA_LIMITS = np.outer([170, 120, 170, 120, 170, 120, 175], [-1.0, 1.0]) * DEG
IIWA_WEIGHT = moments_of(
    np.array([4.0, 4.0, 3.0, 2.8, 2.1, 1.8, 0.8]),
    np.array(
        [
            [0, -0.02, 0.245], [0, -0.095, 0.025], [0, 0.025, 0.31], [0, 0.09, 0.025],
            [0, -0.02, 0.3], [0, -0.02, 0.02], [0, 0, 0.14],
        ]
    ),
)  # fmt: skip


def turned(chain: Chain, angle: float) -> Chain:
    """The arm mounted on a base that is turned about x."""
    c, s = np.cos(angle), np.sin(angle)
    base = np.eye(4)
    base[1:3, 1:3] = [[c, -s], [s, c]]
    return replace(chain, T_world_base=base)


def names(chain: Chain, **more: object) -> tuple[str, ...]:
    return tuple(level.name for level in ladders_of(RobotModel(chain), **more)[0].levels)


TILTED = tuple(
    f"{name} on a tilted base"
    for name in ("sag by torques", "sag and bearings", "springs", "springs and bearings")
)
ALL = (
    "sag by torques", "sag and small bearings", "sag and bearings", "springs",
    "springs and bearings", *TILTED,
)  # fmt: skip


CLOSED = "sag: waves of joints 2 and 3 are not what gravity does to this arm"


def test_every_arm_is_offered_what_gravity_bends_and_told_what_it_does_not():
    assert names(NOMINAL.chain) == ("none", "sag", *ALL)
    never = "joint {} z: gravity never turns it".format
    assert ladders_of(NOMINAL)[0].why_not == (
        never(1), "joint 5 y: gravity never bends it", never(6)
    )  # fmt: skip
    ladder, _ = ladders_of(IIWA, moments=IIWA_WEIGHT, limits=IIWA_LIMITS)
    assert tuple(level.name for level in ladder.levels) == ("none", *ALL)
    assert ladder.why_not == (never(1), never(7), CLOSED)
    # on a wall gravity turns joint 1 as well, and the closed form holds no more
    ladder, _ = ladders_of(RobotModel(turned(NOMINAL.chain, 90 * DEG)))
    assert tuple(level.name for level in ladder.levels) == ("none", *ALL)
    assert "spring1.z" in ladder.levels[1].names
    assert never(1) not in ladder.why_not
    # hanging from a ceiling it is as upright
    assert names(turned(NOMINAL.chain, 180 * DEG)) == ("none", "sag", *ALL)


def test_an_arm_whose_joints_stand_upright_has_bearings_alone():
    ladder, _ = ladders_of(RobotModel(SCARA))
    assert tuple(level.name for level in ladder.levels) == (
        "none", "small bearings", "bearings", "springs and bearings",
        "bearings on a tilted base", "springs and bearings on a tilted base",
    )  # fmt: skip
    assert ladder.why_not[0] == "joint 1 z: gravity never turns it"
    assert "joint 3 z: gravity always pulls along it alike, as an offset would" in ladder.why_not
    assert set(ladder.levels[1].names) == {"spring1.x", "spring1.y"}
    # on its side gravity turns it, and pulls across the slide, never along it
    lying, _ = ladders_of(RobotModel(turned(SCARA, 90 * DEG)))
    assert lying.levels[1].names == ("spring1.z", "spring2.z")
    assert "joint 3 z: gravity never pulls along it" in lying.why_not
    # a slide that another joint raises and lowers gives way along itself
    raised, _ = ladders_of(RobotModel(POLAR))
    assert raised.levels[1].names == ("spring2.z", "spring3.z")
    assert raised.levels[1].errors.springs.is_length == (False, True)


def test_a_model_that_knows_gravity_is_offered_no_more_of_it():
    ladder = ladders_of(NOMINAL)[0]
    for level in (ladder.levels[1], ladder.levels[2]):
        again = ladders_of(with_errors(NOMINAL, level.errors))[0]
        assert [one.name for one in again.levels] == ["none"]
        assert again.why_not == ("sag: the model has it already",)


def test_a_number_is_the_bend_at_the_largest_torque_within_the_limits():
    """By torques of a pool of its own; priors by the formulas written out."""
    ladder, _ = ladders_of(NOMINAL, limits=TX60_LIMITS)
    level = next(level for level in ladder.levels if level.name == "springs and bearings")
    springs = level.errors.springs
    q = np.random.default_rng(9).uniform(*TX60_LIMITS.T, (4000, 6))
    largest = np.abs(springs.weight.torques(q)).max(axis=0)[springs.joint, springs.axis]
    # 500 postures come near the largest of all
    assert springs.load == pytest.approx(largest, rel=0.08)
    assert (springs.load <= largest * 1.02).all()
    sd = dict(zip(level.names, level.sd, strict=True))
    assert sd["spring2.z"] == pytest.approx(0.050 * DEG)
    assert sd["spring2.x"] == pytest.approx(0.025 * DEG)
    small = dict(zip(ladder.levels[3].names, ladder.levels[3].sd, strict=True))
    assert small["spring2.x"] == pytest.approx(0.025 * DEG / 4)
    moments = guessed_moments(NOMINAL.chain)
    assert sd["moment3.m"] == pytest.approx(moments[2, 0] / 2)
    assert sd["moment2.hx"] == pytest.approx(moments[1, 0] * 0.29 / 4)
    # 2 kg that nobody told of may hang on the last link
    assert sd["moment6.m"] == pytest.approx(np.hypot(moments[5, 0] / 2, 2.0))
    assert sd["moment6.hz"] == pytest.approx(np.hypot(moments[5, 0] * 0.1 / 4, 2 * 0.2))
    with_slide, _ = ladders_of(RobotModel(POLAR))
    size = dict(zip(with_slide.levels[1].names, with_slide.levels[1].sd, strict=True))
    assert size["spring3.z"] == pytest.approx(SAG * 0.3)


def test_a_tilted_base_is_two_numbers_and_the_springs_that_it_loads():
    """The compliances that it shares with the upright arm are believed as there."""
    levels = {level.name: level for level in ladders_of(NOMINAL, limits=TX60_LIMITS)[0].levels}
    for name in ("sag by torques", "springs and bearings"):
        upright, tilted = levels[name], levels[f"{name} on a tilted base"]
        assert tilted.names[-2:] == ("tilt1", "tilt2")
        assert tilted.sd[-2:] == pytest.approx(1.0 * DEG)
        # joint 1 stands upright: nothing but a tilt loads it, joint 6 hardly reaches anywhere
        assert set(tilted.names) - set(upright.names) == {"spring1.z", "tilt1", "tilt2"}
        own, lying = (
            dict(zip(level.names, level.errors.springs.load, strict=False))
            for level in (upright, tilted)
        )
        assert {each: lying[each] for each in own} == own
        sd = dict(zip(tilted.names, tilted.sd, strict=True))
        assert {each: sd[each] for each in upright.names} == dict(
            zip(upright.names, upright.sd, strict=True)
        )
    # on its side joint 1 carries the whole arm, as joint 2 does where it stands
    turn = Weight(NOMINAL.chain, guessed_moments(NOMINAL.chain), gravity=(9.81, 0.0, 0.0))
    q = np.random.default_rng(9).uniform(*TX60_LIMITS.T, (4000, 6))
    largest = np.abs(turn.torques(q)[:, 0, 2]).max()
    assert lying["spring1.z"] == pytest.approx(largest, rel=0.08)


def test_springs_settle_where_no_other_numbers_are_better():
    """Against a minimizer that knows no products, on random systems."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        springs = ModelSprings(np.arange(12), rng.uniform(1, 3, 4), 2, rng.uniform(0.5, 2, 6))
        A = rng.normal(size=(30, 12)) * 3
        true, _ = springs.at(rng.normal(size=6))
        pull = A.T @ (A @ true + rng.normal(size=30))
        found = settled(springs, A.T @ A, pull)

        def loss(x, springs=springs, N=A.T @ A, pull=pull):
            y, _ = springs.at(x)
            return y @ N @ y - 2 * pull @ y + x @ x

        other = minimize(loss, found.numbers, method="Nelder-Mead", options={"maxfev": 4000})
        assert found.loss == pytest.approx(loss(found.numbers), rel=1e-9)
        assert found.loss <= other.fun + 1e-5
        np.testing.assert_allclose(springs.at(found.numbers)[0], found.products, rtol=1e-12)
        numeric = slopes(lambda x, springs=springs: springs.at(x)[0], found.numbers)
        np.testing.assert_allclose(found.slopes, numeric, atol=1e-8)


def test_springs_settle_in_few_steps_where_compliance_and_weight_stand_for_each_other(monkeypatch):
    """Twice the one, half the other: along that valley steps by slopes alone take 46."""
    monkeypatch.setattr("calib.identification.evidence.spring_products.STEPS", 12)
    rng = np.random.default_rng(1)
    springs = ModelSprings(np.arange(12), np.ones(4), 2, np.ones(6))
    A = rng.normal(size=(30, 12)) * np.tile([0.05, 1.0, 1.0], 4)
    true, _ = springs.at(rng.normal(size=6) / 2 + 0.3)
    pull = A.T @ (A @ true + rng.normal(size=30))
    x = settled(springs, A.T @ A, pull).numbers

    def loss(x):
        y, _ = springs.at(x)
        return y @ A.T @ A @ y - 2 * pull @ y + x @ x

    def force_at(x):
        return -slopes(loss, x, 1e-4) / 2

    bowl, bend, force = springs.bowl(x, A.T @ A, pull)
    np.testing.assert_allclose(force, force_at(x), atol=1e-7)
    # differences of differences of a loss of some 10
    np.testing.assert_allclose(bowl + bend, -slopes(force_at, x, 1e-4), atol=1e-5)
    assert force @ np.linalg.solve(bowl + bend, force) < 1e-6


def sagging(seed: int, level: Level) -> RobotModel:
    """A robot near the nominal one that bends by springs of a level, moments off as believed."""
    rng = np.random.default_rng(seed)
    wide = with_errors(NOMINAL, level.errors)
    step = rng.normal(size=wide.n_numbers) * 1e-4
    step[-len(level.sd) :] = 0.3 * level.sd * rng.normal(size=len(level.sd))
    return wide.moved(step)


def seen(true: RobotModel, m: int, seed: int):
    rng = np.random.default_rng([seed, m])
    q = POOL[rng.choice(len(POOL), m, replace=False)]
    T = true.poses(q)
    T[:, :3, 3] += rng.normal(size=(m, 3)) * SIGMA_POSITION
    return poses(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))


@pytest.mark.slow
@pytest.mark.parametrize(
    "which",
    [pytest.param(k, marks=[pytest.mark.study] * (k in (2, 5, 8))) for k in (2, 4, 5, 6, 8, 9)],
)
def test_the_climb_has_the_numbers_and_the_evidence_of_whole_fits(which):
    """Products are exact in it; what is not linear are frames and links, by micrometers."""
    ladder, waves = ladders_of(NOMINAL)
    level = ladder.levels[which]
    table = seen(sagging(which, level), 61, which)
    near = identify(NOMINAL, table, PARAMETERS, prior=PRIOR)
    levels = [level, waves.levels[1]]
    system = normal_equations(
        NOMINAL, near.model, table, PARAMETERS,
        [one.errors for one in (*ladder.levels, *waves.levels[:2])], PRIOR,
    )  # fmt: skip
    errors = joined(levels)
    sd = {name: sd for one in levels for name, sd in zip(one.names, one.sd, strict=True)}
    sizes = np.array([sd[name] for name in errors.names])
    solved, learned = system.solved(errors, sizes), system.learned(errors, sizes)
    wide, whole = extended_by(NOMINAL, table, PARAMETERS, levels, prior=PRIOR)
    assert whole.status is Status.CONVERGED
    reached = with_errors(near.model, errors).moved(solved.step)
    gap = reached.poses(POOL)[:, :3, 3] - whole.model.poses(POOL)[:, :3, 3]
    # lost beside a noise of 17.5 um
    assert np.linalg.norm(gap, axis=1).mean() < 2e-6
    gain = solved.evidence - system.solved(JointErrors(), np.zeros(0)).evidence
    assert gain == pytest.approx(whole.log_evidence - near.log_evidence, abs=0.5)
    assert learned == pytest.approx(len(whole.residual) - whole.dof_effective, abs=0.5)
    assert wide.n_numbers == len(solved.step)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("m", "misfit", "seed"),
    [pytest.param(31, 4e-4, 0, marks=pytest.mark.study), (31, 5e-5, 2), (45, 4e-4, 2)],
)
def test_springs_of_an_arm_that_misses_more_than_noise_converge(m, misfit, seed):
    """Compliance times weight, and residuals of that misfit: plain steps leave 99 % of the way."""
    ladder, waves = ladders_of(NOMINAL)
    level = ladder.levels[6]
    assert level.name == "springs and bearings"
    rng = np.random.default_rng([seed, m, 5])
    true, q = sagging(seed, level), POOL[rng.choice(len(POOL), m, replace=False)]
    T = true.poses(q)
    T[:, :3, 3] += misfit * rng.normal(size=(m, 3)) + SIGMA_POSITION * rng.normal(size=(m, 3))
    table = poses(q, T, sd=(SIGMA_POSITION, SIGMA_ROTATION))
    _, found = extended_by(NOMINAL, table, PARAMETERS, [level, waves.levels[1]], prior=PRIOR)
    assert found.status is Status.CONVERGED
    assert found.iterations < 150


def test_springs_of_an_arm_without_closed_form_are_found_and_serve_it():
    """Seven axes, nobody states a mass, one robot: most of what its sag leaves is gone."""
    nominal, rng = IIWA, np.random.default_rng(3)
    truth = ladders_of(nominal, moments=IIWA_WEIGHT, limits=IIWA_LIMITS)
    sag = truth[0].levels[1]
    wide = with_errors(nominal, sag.errors)
    step = np.zeros(wide.n_numbers)
    step[-len(sag.sd) :] = 0.5 * sag.sd
    true, q = wide.moved(step), rng.uniform(*IIWA_LIMITS.T, (300, 7))
    T = true.poses(q)
    T[:, :3, 3] += rng.normal(size=(300, 3)) * SIGMA_POSITION
    table = poses(q[:80], T[:80], sd=(SIGMA_POSITION, SIGMA_ROTATION))
    choice = choose(nominal, table, ladders=ladders_of(nominal, limits=IIWA_LIMITS))
    assert choice.climb.taken[0].errors.springs is not None
    gap = [
        np.linalg.norm(one.model.poses(q[80:])[:, :3, 3] - true.poses(q[80:])[:, :3, 3], axis=1)
        for one in choice.identifications
    ]
    assert gap[1].mean() < 0.3 * gap[0].mean()
    offered = {offer.level: offer.outcome for offer in choice.climb.offered}
    assert offered["joint 1 z"] == "not offered: gravity never turns it"


def test_rows_of_further_tools_climb_like_those_of_the_chain():
    """The same poses, once as those of a further tool that stands where the chain's is."""
    table = seen(sagging(3, ladders_of(NOMINAL)[0].levels[2]), 40, 3)
    fixtures = replace(NOMINAL.fixtures, tools=NOMINAL.chain.T_flange_tool[None])
    other, part = replace(NOMINAL, fixtures=fixtures), np.arange(40) % 4
    evidence = []
    for model, rows, free in (
        (NOMINAL, table, NOMINAL.names),
        (other, replace(table, tool=np.ones(40, dtype=np.int64)),
         [name for name in other.names if not name.startswith("tool.")]),
    ):  # fmt: skip
        parameters = parameters_of(model, free)
        prior = weak_prior(parameters)
        near = identify(model, rows, parameters, prior=prior).model
        found = climb(model, near, rows, parameters, ladders_of(model), part, prior=prior)
        evidence.append([offer.gain for offer in found.offered])
    np.testing.assert_allclose(evidence[0], evidence[1], rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("up", [False, True])
def test_springs_that_bend_against_their_load_are_told_aloud(up):
    """A base that hangs, and the model is told that it stands: torques of the other sign."""
    level = ladders_of(NOMINAL)[0].levels[2]
    wide = with_errors(NOMINAL, level.errors)
    step = np.zeros(wide.n_numbers)
    step[-len(level.sd) :] = (-1 if up else 1) * level.sd
    table = seen(wide.moved(step), 40, 7)
    _, found = extended_by(NOMINAL, table, PARAMETERS, [level], prior=PRIOR)
    told = [note for note in found.notes if note.startswith("bends against gravity")]
    if not up:
        assert not told
        return
    k = found.names.index("spring2.z")
    value, u = (1e3 * np.degrees(x[k]) for x in (found.step, found.standard_uncertainty))
    load = level.errors.springs.load[list(level.names).index("spring2.z")]
    assert f"spring2.z by {-value:.1f} mdeg (U = {2 * u:.1f}) at {load:.3g} N m" in told[0]
    assert "gravity points elsewhere than stated" in told[0]
    assert told[0] in found.summary()


@pytest.mark.parametrize(("bend", "named"), [(-2.1, True), (-1.9, False), (1.0, False)])
def test_a_spring_bends_against_its_load_from_two_standard_uncertainties_on(bend, named):
    wide = with_errors(NOMINAL, ladders_of(NOMINAL)[0].levels[2].errors)
    own, sd = wide.joint_errors.springs.names[:1], 1e-5
    step = np.zeros(wide.n_numbers)
    step[wide.names.index(own[0])] = bend * sd
    errors = wide.moved(step).joint_errors
    assert bool(against_gravity(errors, own, np.diag([sd**2]))) is named


def test_a_slow_approach_ends_where_scipy_ends_and_sooner(monkeypatch):
    """Products of numbers beside large residuals: each undamped step leaves part of the way."""
    rng = np.random.default_rng(2)
    A, r0 = rng.normal(size=(40, 9)), 3 * rng.normal(size=40)

    def evaluate(x):
        y, slopes = np.outer(x[:3], x[3:]).ravel(), np.zeros((9, 6))
        slopes[range(9), np.repeat(range(3), 3)] = np.tile(x[3:], 3)
        slopes[range(9), 3 + np.tile(range(3), 3)] = np.repeat(x[:3], 3)
        r, J = r0 - A @ y, A @ slopes
        return np.concatenate([r, 1.0 - x]), np.vstack([J, np.eye(6)])

    start = np.ones(6)
    mixed = solve(evaluate, start, move=lambda x, step: x + step)
    other = least_squares(lambda x: evaluate(x)[0], mixed.x, xtol=1e-15, gtol=1e-15, ftol=1e-15)
    assert mixed.status is Status.CONVERGED
    assert mixed.trace[-1] <= 2 * other.cost * (1 + 1e-12)
    np.testing.assert_allclose(mixed.x, other.x, atol=1e-6)
    monkeypatch.setattr("calib.identification.least_squares.SLOW", np.inf)  # none is remembered
    plain = solve(evaluate, start, move=lambda x, step: x + step)
    assert mixed.iterations < 0.8 * plain.iterations
    np.testing.assert_allclose(mixed.x, plain.x, atol=1e-6)


def test_a_valley_that_is_level_to_rounding_is_an_end():
    """(1 - xy)^2 + x^2 + y^2 rises as the fourth power along x = y: no step ever ends there."""

    def evaluate(x):
        r = np.array([1.0 - x[0] * x[1], -x[0], -x[1]])
        return r, np.array([[x[1], x[0]], [1.0, 0.0], [0.0, 1.0]])

    found = solve(evaluate, np.array([0.5, 0.4]), move=lambda x, step: x + step)
    assert found.status is Status.CONVERGED
    assert found.trace[-1] - 1.0 < 1e-6

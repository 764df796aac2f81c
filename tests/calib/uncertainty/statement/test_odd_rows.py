"""Gross errors, coarse instruments, distances, still joints: what is stated, or refused."""

from dataclasses import replace

import numpy as np
import pytest

from calib.calibration import calibrate
from calib.errors import InputError
from calib.geometry.fixtures import Fixtures
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.fit_statistics import RED
from calib.identification.identify import identify
from calib.identification.prior import Prior
from calib.measurement.observations import joined
from calib.uncertainty.circumstances import Circumstances
from calib.uncertainty.judgement import judge
from calib.uncertainty.many.judgements import judge_many
from tests.calib import kinds

ARM = RobotModel(kinds.ARMS["tx60"])
TRAIN, TEST, TARGETS = 60, 20, 200


def misfit(q):
    """15 um of waves that no link number explains [m]."""
    return 15e-6 * np.sqrt(2) * np.cos(3 * q[:, :3] + 1)


def campaign(seed):
    """Rows to identify from and held out, targets and where the tool truly is there."""
    rng = np.random.default_rng(seed)
    true = ARM.moved(3e-4 * rng.normal(size=ARM.n_numbers))
    table = kinds.poses(true, kinds.joints("tx60", rng, TRAIN + TEST), rng)
    table = replace(table, position=table.position + misfit(table.q))
    q = kinds.joints("tx60", rng, TARGETS)
    coarse = kinds.poses(true, kinds.joints("tx60", rng, 12), rng)
    size = np.where(np.arange(6) < 3, 1e2, 1.0)  # 2 mm beside 20 um, and it says so
    coarse = replace(
        coarse,
        position=coarse.position + 2e-3 * rng.normal(size=(12, 3)),
        covariance=coarse.covariance * size * size[:, None],
        pose_id=coarse.pose_id + 1000,
    )
    train, test = table.rows(np.arange(TRAIN)), table.rows(np.arange(TRAIN, TRAIN + TEST))
    return train, test, q, true.poses(q)[:, :3, 3] + misfit(q), coarse


def with_wrong_shot(train, size):
    wrong = np.where(np.arange(len(train))[:, None] == 7, size, 0.0) * np.array([1.0, 0.0, 0.0])
    return replace(train, position=train.position + wrong)


def stated(train, test, q, p, loss="squared"):
    """Upper limit of the misfit, R95, share of true points inside."""
    found = judge(calibrate(ARM, train, loss=loss).identification, test, train=train)
    return np.array(
        [
            found.belief.misfit.upper,
            found.point.radius_mean,
            found.belief.regions(q).holds(p).mean(),
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("size", [5e-3, 20e-3])
def test_a_gross_error_under_a_robust_loss_hides_no_misfit(size):
    """Its weight of 1e-5 made it a row of millimeters of noise, and the misfit passed for that."""
    clean, wrong = [], []
    for seed in range(3):
        train, test, q, p, _ = campaign(seed)
        clean.append(stated(train, test, q, p, "cauchy"))
        wrong.append(stated(with_wrong_shot(train, size), test, q, p, "cauchy"))
    clean, wrong = np.mean(clean, axis=0), np.mean(wrong, axis=0)
    # one pose of sixty less is evidence: sizes scatter by its part, far less than a tenth
    assert wrong[:2] == pytest.approx(clean[:2], rel=0.1)
    assert min(clean[2], wrong[2]) > 0.93  # 600 true points, most of them inside: 97 %


def test_rows_of_a_coarse_instrument_take_nothing_from_the_statement():
    alone, beside = [], []
    for seed in range(3):
        train, test, q, p, coarse = campaign(seed)
        alone.append(stated(train, test, q, p))
        beside.append(stated(joined([train, coarse]), test, q, p))
    alone, beside = np.mean(alone, axis=0), np.mean(beside, axis=0)
    # sizes are tried at 7 % and the unit of the grid may change: no more than that, both ways
    assert beside[:2] == pytest.approx(alone[:2], rel=0.15)
    assert min(alone[2], beside[2]) > 0.93


def test_a_gross_error_under_a_robust_loss_is_no_drift():
    train, test, *_ = campaign(1)
    known = Circumstances(
        order=(np.arange(TRAIN), TRAIN + np.arange(TEST)), unmodelled=("warm-up",)
    )
    sizes = []
    for rows in (train, with_wrong_shot(train, 50e-3)):
        fit = calibrate(ARM, rows, loss="cauchy").identification
        found = judge(fit, test, train=rows, circumstances=known)
        sizes.append(found.drifting.drift.sd)
    assert sizes[1] == pytest.approx(sizes[0], rel=0.5)  # neighbors on the grid of sizes


def test_a_distance_among_the_held_out_rows_switches_nothing_off():
    """It shows no position; the poses beside it are judged, and none may have identified."""
    arm = RobotModel(kinds.ARMS["tx60"], fixtures=Fixtures(anchors=[[2.0, 1.0, 0.5]]))
    rng = np.random.default_rng(1)
    links = np.arange(arm.n_numbers) < 42
    true = arm.moved(3e-4 * rng.normal(size=arm.n_numbers) * links)
    table = kinds.poses(true, kinds.joints("tx60", rng, 60), rng)
    train, test = table.rows(np.arange(35)), table.rows(np.arange(35, 60))
    fit = identify(arm, train, parameters_of(arm))
    far = replace(kinds.distances(true, kinds.joints("tx60", rng, 1), rng), pose_id=[999])
    alone, beside = judge(fit, test, train=train), judge(fit, joined([test, far]), train=train)
    assert beside.held_out.p_value == alone.held_out.p_value
    wrong = replace(test, position=test.position + 1e-4 * rng.normal(size=test.position.shape))
    assert judge(fit, joined([wrong, far]), train=train).trust.refuted
    for rows in (train, joined([train, far]), replace(train, q=train.q + 1e-6)):
        with pytest.raises(InputError, match="validation pose 0 is pose 0 of the identification"):
            judge(fit, rows, train=train)


def test_residuals_of_a_prior_on_all_numbers_are_judged_by_what_it_leaves():
    """Five poses under a prior leave a sixth of a degree of freedom, which rounds to none."""
    rng = np.random.default_rng(0)
    free = parameters_of(ARM)
    sd = np.where(free.is_length[free.free_index], 3e-3, 5e-3)
    prior = Prior(np.zeros(free.n_free), sd, free.free_names)
    judged = refuted = 0
    for poses in (2, 3, 4, 5, 6):
        table = kinds.poses(ARM, kinds.joints("tx60", rng, poses), rng)
        far = replace(table, position=table.position + 0.1 * rng.normal(size=(poses, 3)))
        fit = identify(ARM, far, free, prior=prior)
        found = judge(fit, far.rows(np.zeros(0, dtype=int)), train=far)
        judged += fit.dof == 0
        said = "larger than the stated noise" in " ".join(found.trust.sentences)
        assert said == (fit.p_value < RED)
        refuted += said
    assert judged
    assert refuted


@pytest.mark.parametrize(
    ("known", "sentence"),
    [
        ({"order": (np.arange(59), np.arange(20))}, "train_order has shape (59,)"),
        ({"order": (np.arange(60), np.arange(21))}, "test_order has shape (21,)"),
        ({"repeatability": np.full(6, -1e-5)}, "repeatability is -1e-05; expected zero or more"),
        ({"repeatability": np.zeros(5)}, "repeatability has shape (5,)"),
        ({"doubted": "all"}, "doubted is all of the noise of a row, or more"),
    ],
)
def test_what_is_known_of_other_rows_is_refused(known, sentence):
    train, test, *_ = campaign(0)
    fit = calibrate(ARM, train).identification
    if "doubted" in known:
        known = {"doubted": (train.covariance, test.covariance)}
    with pytest.raises(InputError) as caught:
        judge(fit, test, train=train, circumstances=Circumstances(**known))
    assert sentence in str(caught.value)
    with pytest.raises(InputError, match="train has 10 rows, and the identification is from 60"):
        judge(fit, test, train=train.rows(np.arange(10)))


def test_many_robots_whose_joint_stood_still_or_kept_a_step_are_judged_one_by_one():
    fits, trains, tests, targets = [], [], [], []
    for kind in ("free", "still", "stepped"):
        rng = np.random.default_rng(5)
        q = kinds.joints("tx60", rng, 60)
        if kind == "still":
            q[:, 3] = 0.3
        if kind == "stepped":
            q[:, 1] = np.deg2rad(15) * rng.integers(-6, 7, 60)
        table = kinds.poses(ARM.moved(3e-4 * rng.normal(size=ARM.n_numbers)), q, rng)
        trains.append(table.rows(np.arange(36)))
        tests.append(table.rows(np.arange(36, 60)))
        free = parameters_of(ARM).freeing(["base.x", "base.y", "base.z", "theta2", "theta3"])
        fits.append(identify(ARM, trains[-1], free))
        targets.append(kinds.joints("tx60", rng, 3))
    assert judge_many(fits, trains, tests, targets).alone.tolist()[1:] == [True, True]
    calm = [[part[0]] for part in (fits, trains, tests, targets)]
    one = judge(fits[0], tests[0], train=trains[0]).belief.proven.applies(targets[0])
    assert judge_many(*calm).applies[0].place.tolist() == one.place.tolist()
    with pytest.raises(InputError, match="pose 0 of the identification"):
        judge_many(fits, trains, trains, targets)

"""What rows of one pose share in the evidence: against covariances written out, and true arms."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.fixtures import Fixtures
from calib.geometry.joint_errors import JointErrors
from calib.geometry.model import RobotModel
from calib.geometry.parameters import parameters_of
from calib.identification.climb import best_alone
from calib.identification.evidence.normal_equations import NormalEquations, normal_equations
from calib.identification.evidence.shared_misfit import SharedMisfit
from calib.identification.identify import identify
from calib.identification.ladders import ladders_of
from calib.identification.model_choice import choose
from calib.identification.prior import weak_prior
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.measurement.tables import points
from tests.calib.identification.test_joint_models import bent
from tests.reference import DEG, rigid_truth, tx60
from tests.truth.measuring import measured

FREE = parameters_of(tx60())
PRIOR = weak_prior(FREE)
WAVES = next(level for level in ladders_of(tx60())[1].levels if level.usual)
POSES, VISITS = 40, 5
NOISE = 10e-6
"""Of reflectors [m]."""


def visited(truth, q, off, visits, rng) -> Measurements:
    """Poses that the joints miss by the same each time (m, 6) [rad], visited so many times."""
    tables = [
        replace(measured(truth, q + off, rng), q=q, repeat=np.full(len(q), k))
        for k in range(visits)
    ]
    return joined(tables)


def campaign(seed: int, size: float = 3e-3, truth=None) -> tuple[Measurements, Measurements]:
    """40 poses visited five times, and 100 others once; joints miss each by `size` [deg]."""
    rng = np.random.default_rng([seed, 77])
    truth = rigid_truth(rng) if truth is None else truth
    q, other = (rng.uniform(-2, 2, (m, 6)) for m in (POSES, 100))
    off, more = (size * DEG * rng.choice([-1.0, 1.0], each.shape) for each in (q, other))
    return visited(truth, q, off, VISITS, rng), visited(truth, other, more, 1, rng)


def about_its_fit(table: Measurements) -> NormalEquations:
    near = identify(tx60(), table, FREE, prior=PRIOR).model
    return normal_equations(tx60(), near, table, FREE, [WAVES.errors], PRIOR)


def uneven(seed: int = 3) -> Measurements:
    """Poses visited once, twice and three times, rows in no order."""
    table = visited(bent(seed), np.random.default_rng(seed).uniform(-2, 2, (15, 6)),
                    np.zeros((15, 6)), 3, np.random.default_rng(seed))  # fmt: skip
    rng = np.random.default_rng(1)
    kept = np.flatnonzero((table.repeat == 0) | (table.pose_id % 3 >= table.repeat))
    return table.rows(rng.permutation(kept))


@pytest.mark.parametrize("v", [0.0, 0.3, 20.0])
def test_the_evidence_is_that_of_rows_with_the_covariance_of_a_shared_misfit(v):
    """Normal densities of all rows, written out: geometry against waves."""
    table, s = uneven(), 1.7
    system = replace(about_its_fit(table), scale=s)
    shared = SharedMisfit.of(system, table)
    assert sorted(set(shared.count.tolist())) == [1.0, 2.0, 3.0]
    same = table.together[:, None] == table.together
    alone = (same.sum(axis=1) == 1)[:, None] & same
    own = s**2 * (np.eye(len(table)) + v * (same & ~alone))
    noise, A, r = np.kron(own, np.eye(6)), system.A.reshape(-1, 42 + 24), system.r.ravel()
    r = r + A[:, :42] @ system.offset  # about what is believed
    density = []
    for k, sd in ((42, PRIOR.sd), (66, np.append(PRIOR.sd, WAVES.sd))):
        B = A[:, :k] * sd
        C = noise + B @ B.T
        density.append(-(r @ np.linalg.solve(C, r) + np.linalg.slogdet(C)[1]) / 2)
    models = ((JointErrors(), np.zeros(0), np.zeros(0)), (WAVES.errors, WAVES.sd, WAVES.mean))
    found = [shared.at(v).solved(*asked).evidence - shared._spread(v) for asked in models]
    assert found[1] - found[0] == pytest.approx(density[1] - density[0], abs=1e-5)
    none = [shared.at(0.0).solved(*asked).evidence for asked in models]
    # between misfits the densities differ by the number of rows times log s alone
    bare = np.kron(s**2 * np.eye(len(table)), np.eye(6)) + B @ B.T
    least = -(r @ np.linalg.solve(bare, r) + np.linalg.slogdet(bare)[1]) / 2
    assert found[1] - none[1] == pytest.approx(density[1] - least, abs=1e-5)


def test_rows_add_up_to_the_normal_equations_with_some_left_out_or_not():
    table = uneven()
    shared = SharedMisfit.of(about_its_fit(table), table)
    rows, sums = shared.rows_at(2.0), shared.at(2.0)
    A = rows.A.reshape(-1, rows.A.shape[2])
    np.testing.assert_allclose(
        A.T @ A, sums.normal, rtol=1e-9, atol=1e-9 * np.abs(sums.normal).max()
    )
    np.testing.assert_allclose(A.T @ rows.r.ravel(), sums.pull, atol=1e-9 * np.abs(sums.pull).max())
    assert (rows.r**2).sum() == pytest.approx(sums.square, rel=1e-12)
    out = table.pose_id < 5
    rest = SharedMisfit.of(about_its_fit(table).without(out), table)
    part = table.rows(~out)
    near = identify(tx60(), table, FREE, prior=PRIOR).model
    alone = normal_equations(tx60(), near, part, FREE, [WAVES.errors], PRIOR)
    asked = (WAVES.errors, WAVES.sd)
    step = SharedMisfit.of(alone, part).at(2.0).solved(*asked).step
    np.testing.assert_allclose(rows.without(out).solved(*asked).step, step, atol=1e-9)
    assert len(rest.group) == len(table)


def test_each_pose_visited_once_shares_nothing_and_moves_no_bit():
    table = measured(bent(2), np.random.default_rng(0).uniform(-2, 2, (30, 6)),
                     np.random.default_rng(1))  # fmt: skip
    system = about_its_fit(table)
    shared = SharedMisfit.of(system, table)
    asked = (WAVES.errors, WAVES.sd, WAVES.mean)
    found, v = shared.at_noise_of(asked)[0].solved(asked)
    assert v == 0.0
    assert found.evidence == system.at_noise_of(*asked).solved(*asked).evidence
    assert shared.rows_at(3.0) is shared.at(3.0) is system
    assert shared.noise_factor(3.0) == 1.0


def test_a_misfit_is_found_at_its_size_and_no_more_noise_than_there_is():
    """Joints 3 mdeg off: some .8 of the noise, the misfit that poses of the same kind show."""
    found = []
    for seed in range(3):
        table, _ = campaign(seed)
        asked = (JointErrors(), np.zeros(0), np.zeros(0))
        bare = SharedMisfit.of(about_its_fit(table), table)
        shared, v = bare.at_noise_of(asked)
        assert v == shared.solved(asked)[1]
        # from elsewhere: to twice the tolerance of the variance
        from_there, w = bare.at_noise_of(asked, near=1.1 * v)
        assert w == pytest.approx(v, rel=0.04)
        assert from_there.bare.scale == pytest.approx(shared.bare.scale, rel=0.04)
        found.append((shared.bare.scale, shared.bare.scale**2 * v))
        # by hand: means of five scatter by a fifth of the noise, and by the misfit
        near = identify(tx60(), table, FREE, prior=PRIOR)
        r = near.residual.reshape(VISITS, POSES, 6)
        within = ((r - r.mean(axis=0)) ** 2).sum() / ((VISITS - 1) * POSES * 6)
        between = (r.mean(axis=0) ** 2).sum() / (POSES * 6 - 30)
        assert found[-1][0] ** 2 == pytest.approx(max(within, 1.0), rel=0.02)
        # 210 degrees of freedom: 10 %; thirty of 42 numbers are told by more than their prior
        assert found[-1][1] == pytest.approx(between - within / VISITS, rel=0.2)


def test_ladders_one_after_the_other_find_what_each_finds_by_itself():
    """Each search for the noise begins at the misfit of the ladder before."""
    table, _ = campaign(1, truth=bent(1))
    near = identify(tx60(), table, FREE, prior=PRIOR).model
    gravity, waves = ladders_of(tx60())
    both = best_alone(tx60(), near, table, FREE, [gravity, waves], prior=PRIOR)
    each = [best_alone(tx60(), near, table, FREE, [k], prior=PRIOR)[0] for k in (gravity, waves)]
    assert both[0] == each[0]
    assert both[1] is not None
    assert each[1] is not None
    assert both[1][0] == each[1][0]
    # the noise to 4 %: a gain goes with its square
    assert both[1][1] == pytest.approx(each[1][1], rel=0.08)


@pytest.mark.slow
def test_a_misfit_that_visits_share_asks_for_no_model_of_its_poses():
    """Play on one side at each pose: five visits made waves and springs of it, 2 to 6 % worse."""
    table, other = campaign(2)
    choice = choose(tx60(), table)
    geometric, chosen = (
        predict(each.model, other).misses.mean()
        for each in (choice.identifications[0], choice.identification)
    )
    assert chosen <= 1.005 * geometric


REFLECTORS = [[0.1, 0.0, 0.05], [-0.05, 0.09, 0.05], [-0.05, -0.09, 0.08]]


def of_reflectors(seed: int) -> tuple[Measurements, Measurements]:
    """The places of three reflectors at 40 poses with play on one side, and at 100 others."""
    rng = np.random.default_rng([seed, 78])
    truth = rigid_truth(rng)

    def table(poses: int) -> Measurements:
        q = rng.uniform(-2, 2, (poses, 6))
        T = truth.poses(q + 3e-3 * DEG * rng.choice([-1.0, 1.0], q.shape))
        places = [T[:, :3, 3] + T[:, :3, :3] @ np.array(c) for c in REFLECTORS]
        return joined(
            [
                points(q, p + NOISE * rng.normal(size=p.shape), sd=NOISE, reflector=k)
                for k, p in enumerate(places)
            ]
        )

    return table(POSES), table(100)


@pytest.mark.slow
def test_a_misfit_that_reflectors_share_asks_for_no_model_of_its_poses():
    """Three reflectors of one pose made terms of its misfit, as visits did: 12 to 46 % worse."""
    nominal = RobotModel(tx60().chain, fixtures=Fixtures(reflectors=REFLECTORS))
    table, other = of_reflectors(19)
    choice = choose(nominal, table)
    geometric, chosen = (
        predict(each.model, other).misses.mean()
        for each in (choice.identifications[0], choice.identification)
    )
    assert chosen <= 1.005 * geometric


@pytest.mark.slow
def test_waves_are_found_beside_a_misfit_that_visits_share():
    table, other = campaign(1, 1e-3, bent(1))
    choice = choose(tx60(), table)
    assert choice.chosen == "extended"
    geometric, chosen = (
        predict(each.model, other).misses.mean() for each in choice.identifications
    )
    assert chosen < 0.5 * geometric

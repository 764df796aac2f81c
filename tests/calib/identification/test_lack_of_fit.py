"""Misfit against the scatter of repeats: by hand, blind to the noise level, quiet when sound."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher

from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.identification.identify import Identification, identify
from calib.identification.prior import weak_prior
from calib.measurement.grouping import count_distinct
from calib.measurement.observations import POINT, POSE, Measurements, joined
from calib.measurement.residual import linearize, table_whiteners
from tests.reference import DEG, WEN24, pool_r, rigid_truth, tx60
from tests.truth.measuring import measured

POOL = pool_r()


def repeated(seed: int, visits: int = 3, *, noise: float = 1.0, sag: float = 0.0) -> Measurements:
    """Twelve poses visited several times, the noise `noise` times what is stated."""
    rng = np.random.default_rng(seed)
    q = np.tile(POOL[:12], (visits, 1))
    bent = q + sag * np.sin(q[:, 1:2]) * [0, 1, 0, 0, 0, 0]
    table = measured(rigid_truth(rng), bent, rng)
    return replace(
        table,
        q=q,
        covariance=table.covariance / noise**2,
        pose_id=np.tile(np.arange(12), visits),
        repeat=np.repeat(np.arange(visits), 12),
    )


def test_joint_values_are_counted_as_numbers_not_as_bits():
    rng = np.random.default_rng(0)
    for _ in range(20):
        rows = rng.integers(-1, 2, (rng.integers(0, 12), 2)) * 1.0
        rows *= rng.choice([-1.0, 1.0], rows.shape)  # zeros of either sign
        assert count_distinct(rows) == len(np.unique(rows, axis=0))


def fitted(table: Measurements) -> Identification:
    return identify(tx60(), table, parameters_of(tx60(), WEN24))


@pytest.mark.parametrize("points", [False, True], ids=["poses", "poses and points"])
def test_ratio_is_that_of_group_means_taken_one_by_one(points):
    table = repeated(1)
    # one visit far less certain than the others: means must be weighted
    covariance = table.covariance.copy()
    covariance[:12] *= 9
    table = replace(table, covariance=covariance)
    if points:
        table = replace(table, kind=np.where(table.pose_id % 2 == 0, POSE, POINT))
    found = fitted(table)
    N = table_whiteners(table)
    stack, pure, dof = linearize(found.model, table), 0.0, 0
    for pose in range(12):
        rows = np.flatnonzero(table.pose_id == pose)
        k = 6 if table.is_pose[rows[0]] else 3
        seen = np.concatenate([stack.r[stack.row_of == j] for j in rows])
        design = np.concatenate([N[j, :k, :k] for j in rows])
        mean = np.linalg.lstsq(design, seen)[0]
        pure += float(np.sum((seen - design @ mean) ** 2))
        dof += k * (len(rows) - 1)
    left = found.residual @ found.residual - pure
    distinct = 6 * 12 if not points else 6 * 6 + 3 * 6
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.dof_error == dof
    assert found.lack_of_fit.dof_model == distinct - 24
    ratio = left / (distinct - 24) / (pure / dof)
    assert found.lack_of_fit.ratio == pytest.approx(ratio, rel=1e-7)
    assert found.lack_of_fit.p_value == pytest.approx(
        fisher.sf(ratio, distinct - 24, dof), rel=1e-6
    )


def test_ratio_does_not_depend_on_the_stated_noise():
    plain, wider = (fitted(replace(repeated(2), covariance=s * repeated(2).covariance)).lack_of_fit
                    for s in (1.0, 25.0))  # fmt: skip
    assert plain is not None
    assert wider is not None
    assert wider.ratio == pytest.approx(plain.ratio, rel=1e-6)


@pytest.mark.slow
def test_a_sound_model_is_seldom_accused():
    """p-values of 60 sound campaigns: 5 % of them below 5 %, by chance up to 9 (99.9 %)."""
    p = [fitted(repeated(seed)).lack_of_fit.p_value for seed in range(100, 160)]
    assert sum(x < 0.05 for x in p) <= 9
    assert 0.3 < np.mean(p) < 0.7


def test_sag_that_the_model_lacks_is_seen_whatever_the_noise_is_called():
    found = fitted(repeated(3, sag=0.02 * DEG))
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.p_value < 1e-6
    assert "the errors of the model exceed the scatter of the measurements" in found.notes[-1]


def test_noise_stated_too_small_is_not_the_models_fault():
    found = fitted(repeated(4, noise=2.0))
    assert found.p_value < 1e-3
    assert found.lack_of_fit is not None
    assert found.lack_of_fit.p_value > 0.01
    assert "the stated noise too small" in found.notes[-1]
    assert found.covariance == pytest.approx(
        fitted(repeated(4, noise=1.0)).covariance / 4, rel=0.01
    )


def test_nothing_is_said_without_repeats_or_where_they_are_copies():
    assert fitted(repeated(5, 1)).lack_of_fit is None
    table = repeated(6, 1)
    assert fitted(table.rows(np.tile(np.arange(12), 2))).lack_of_fit is None


def test_with_a_prior_only_numbers_learned_are_counted():
    table, parameters = repeated(7), parameters_of(tx60())
    found = identify(tx60(), table, parameters, prior=weak_prior(parameters))
    plain = identify(tx60(), table, parameters)
    assert found.lack_of_fit is not None
    assert plain.lack_of_fit is not None
    assert found.lack_of_fit.dof_model == pytest.approx(72 - (216 - found.dof_effective), abs=1e-9)
    assert found.lack_of_fit.ratio == pytest.approx(plain.lack_of_fit.ratio, rel=0.01)


def test_rows_under_another_payload_are_no_repeats():
    """What the model misses between loads would pass for scatter, and hide that it misses."""
    light, heavy = repeated(3, visits=2), repeated(3, visits=2, noise=1.0)
    sag = np.array([0.0, 0.0, -150e-6])
    heavy = replace(heavy, position=heavy.position + sag, pose_id=heavy.pose_id + 1000)
    loads = np.repeat([0.0, 5.0], [len(light), len(heavy)])
    both = joined([light, heavy])
    unsaid = fitted(both).lack_of_fit
    said = fitted(replace(both, conditions=OperatingConditions(payload=loads))).lack_of_fit
    assert said.dof_error < unsaid.dof_error
    # scatter within a load is noise alone; between them 150 um at each pose
    assert said.ratio > 3 * unsaid.ratio

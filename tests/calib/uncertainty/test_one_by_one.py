"""Virtual calibrations fitted one by one: against the loops, and the scatter that is stated."""

from dataclasses import replace

import numpy as np
import pytest

from calib.geometry.felt_springs import Felt
from calib.geometry.gravity import weight_of
from calib.geometry.joint_errors import NO_JOINT, JointErrors, JointTerm
from calib.geometry.model import RobotModel
from calib.geometry.operating import OperatingConditions
from calib.geometry.parameters import parameters_of
from calib.measurement.tables import poses
from calib.uncertainty.bootstrap import bootstrap
from calib.uncertainty.covariance import standard_uncertainty
from calib.uncertainty.one_by_one import fitted_one_by_one, with_noise
from calib.uncertainty.refit import freeze, refit
from tests.calib.geometry.test_springs import ALL
from tests.reference import SIGMA_POSITION, SIGMA_ROTATION, WEN24, pool_r, tx60

SD = SIGMA_POSITION, SIGMA_ROTATION
WARM = JointTerm("lengths", NO_JOINT, "lengths", (0,) * 6, 20.0)


def soft() -> JointErrors:
    """Springs in the joints, 0.5 mrad at the largest torque, and links that grow when warm."""
    springs, _ = Felt.of(weight_of(tx60().chain), ALL).springs(("z",))
    bends = np.full(len(springs.names), 5e-4)
    return JointErrors((WARM,), np.append(1e-5, bends), springs)


def test_the_fits_are_those_of_the_loops():
    q, rng = pool_r(15), np.random.default_rng(1)
    free = parameters_of(tx60(), WEN24)
    prior = np.diag(rng.uniform(0.1, 2.0, 24) / free.free_scale**2)
    start = freeze(tx60(), poses(q, tx60().poses(q), sd=SD), free, prior_precision=prior)
    normal, center = rng.standard_normal((3, 15, 6)), 1e-4 * rng.standard_normal((3, 24))
    alone = fitted_one_by_one(start, normal, center)
    tables = [with_noise(start, one) for one in normal]
    whole = refit(
        start, [one.position for one in tables], [one.rotation for one in tables],
        prior_mean=center, steps=4,
    )  # fmt: skip
    # four steps with one Hessian leave less; a prior of frames is turned in the one, not the other
    off = np.abs(alone.steps - whole.steps) / standard_uncertainty(start.covariance)
    assert off.max() < 1e-4
    np.testing.assert_allclose(alone.chi_square, whole.chi_square, rtol=1e-6)
    assert alone.converged.all()


@pytest.mark.slow
def test_lengths_and_springs_scatter_as_stated():
    """Numbers that the poses tell apart: linear, so that the covariance must be the scatter."""
    model, q = RobotModel(tx60().chain, soft()), pool_r(6)
    warm = OperatingConditions(temperature=np.linspace(10, 30, 6))
    table = replace(poses(q, model.poses(q, warm), sd=SD), conditions=warm)
    free = parameters_of(model, ("theta2", "lengths", "spring2.z", "spring3.z"))
    found = bootstrap(model, table, free, np.random.default_rng(2), replicates=100)
    assert found.agrees, found.sentence
    assert found.names == free.free_names
    # what is left of 36 rows, 100 times: 4 sd
    assert abs(found.chi_square.mean() - found.dof) < 4 * np.sqrt(2 * found.dof / 100)
